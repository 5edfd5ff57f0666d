"""An impedance that a converter's control pretends to have."""

from __future__ import annotations

import casadi as ca

from gustform.language import Component, Input, Output, Parameter


class VirtualImpedance(Component):
    """Voltage reference of a converter that is to look like V behind r + jx.

        v_d* = V - r i_d + x i_q          v_q* = -r i_q - x i_d

    i: current out of the converter, in the frame that V stands in. Without it the controlled capacitor voltage would
    be as stiff as V itself, and the reactance between V and the grid smaller by that of the filter.
    pu: rating and nominal voltage of the converter. Source: Lyu, Subotic, Gross 2022, eq. (4b): b_gsc; He, Li, IEEE
    Trans. Power Electronics 26(11), 2011 (virtual impedance).
    """

    r = Parameter("pu", "resistance", default=0.01, min=0.0)
    x = Parameter("pu", "reactance at nominal frequency", default=0.1, min=0.0)

    V = Input("pu", "magnitude of the voltage behind the impedance", start=1.0)
    i_d = Input("pu", "current along the frame", start=0.5)
    i_q = Input("pu", "current across the frame")
    v_d = Output("pu", "voltage reference along the frame", start=1.0)
    v_q = Output("pu", "voltage reference across the frame")

    def equations(self) -> None:
        self.eq(self.v_d, self.V - self.r * self.i_d + self.x * self.i_q)
        self.eq(self.v_q, -self.r * self.i_q - self.x * self.i_d)


class VirtualAdmittance(Component):
    """Current reference of a machine-side converter that is to look like a voltage V on the machine's terminals.

        u_d + j u_q = V e^{j (pi/2 - rho)}                             virtual voltage, rho behind the EMF
        (r + j x omega) (i_d* + j i_q*) = j psi omega - (u_d + j u_q)  current out of the machine

    in the rotor's frame: d along the magnet, q along the EMF j psi omega. rho is electrical. x is the machine's own
    reactance at 1 pu speed; r damps, and only the converter knows of it.
    pu: rating and voltage of the machine; omega: base of the rotor speed.
    Source: Lyu, Subotic, Gross 2022, II-B, eq. (4a): b_msc; Rodriguez et al., PEDG 2013 (virtual admittance); data:
    project notes.
    """

    r = Parameter("pu", "resistance", default=0.05, min=0.0)
    x = Parameter("pu", "reactance at 1 pu speed", default=0.4 / 1.2, above=0.0)
    psi = Parameter("pu", "EMF at 1 pu speed", default=1.0 / 1.2, above=0.0)

    V = Input("pu", "magnitude of the virtual voltage", start=1.0)
    rho = Input("rad", "angle of the EMF ahead of the virtual voltage", start=0.2)
    omega = Input("pu", "rotor speed", start=1.2)
    i_d = Output("pu", "current reference along the magnet")
    i_q = Output("pu", "current reference along the EMF", start=0.5)

    def equations(self) -> None:
        r, x = self.r, self.x * self.omega
        # r + jx times the current
        d = -self.V * ca.sin(self.rho)
        q = self.psi * self.omega - self.V * ca.cos(self.rho)
        square = r * r + x * x
        self.eq(self.i_d, (r * d + x * q) / square)
        self.eq(self.i_q, (r * q - x * d) / square)
