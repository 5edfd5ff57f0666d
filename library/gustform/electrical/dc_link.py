"""DC link of a back-to-back converter."""

from __future__ import annotations

from gustform.interfaces import DcPort
from gustform.language import Component, Discrete, Output, Parameter, Variable


class DcLink(Component):
    """Capacitor between two converters.

        C d(v)/dt = i_machine + i_grid          currents into the capacitor, so C v dv/dt = P_msc - P_gsc

    `tripped` becomes 1 when v falls below v_min, where a two-level converter cannot form its nominal AC voltage any
    more (sqrt(2) 3.3 kV = 0.589 pu of 7.92 kV), and stays so; converters that read it are blocked then.

    SI units; C and the currents are those of one turbine.
    Source: Lyu, Subotic, Gross 2022, eq. (3), divided by v; Table I.
    """

    C = Parameter("F", "capacitance of one turbine", default=31.88e-3, above=0.0)
    voltage = Parameter("V", "nominal DC voltage", default=7920.0, above=0.0)

    v_min = Parameter("pu", "DC voltage below which the converters trip, base `voltage`", default=0.6, min=0.0)

    machine = DcPort("machine-side converter")
    grid = DcPort("grid-side converter")
    v = Variable("V", "DC voltage", start=lambda self: self.voltage, nominal=lambda self: self.voltage, min=0.0)
    trip = Discrete("1", "1 after the voltage has been below v_min", start=0.0)
    tripped = Output("1", "1 when the converters are to be blocked")

    def equations(self) -> None:
        self.when(self.v < self.v_min * self.voltage, {self.trip: 1.0})
        self.eq(self.tripped, self.trip)
        self.eq(self.machine.v, self.v)
        self.eq(self.grid.v, self.v)
        self.eq(self.C * self.der(self.v), self.machine.i + self.grid.i)
