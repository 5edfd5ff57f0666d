"""DC link of a back-to-back converter."""

from __future__ import annotations

from gustform.interfaces import DcPort
from gustform.language import Component, Parameter, Variable


class DcLink(Component):
    """Capacitor between two converters.

        C d(v)/dt = i_machine + i_grid          currents into the capacitor, so C v dv/dt = P_msc - P_gsc

    SI units; C and the currents are those of one turbine.
    Source: Lyu, Subotic, Gross 2022, eq. (3), divided by v; Table I.
    """

    C = Parameter("F", "capacitance of one turbine", default=31.88e-3, above=0.0)
    voltage = Parameter("V", "nominal DC voltage", default=7920.0, above=0.0)

    machine = DcPort("machine-side converter")
    grid = DcPort("grid-side converter")
    v = Variable("V", "DC voltage", start=lambda self: self.voltage, nominal=lambda self: self.voltage, min=0.0)

    def equations(self) -> None:
        self.eq(self.machine.v, self.v)
        self.eq(self.grid.v, self.v)
        self.eq(self.C * self.der(self.v), self.machine.i + self.grid.i)
