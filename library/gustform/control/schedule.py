"""Where the operating point of a turbine comes from while it runs."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter


class OperatingSchedule(Component):
    """Base of what gives the operating point (omega_del, beta_del) to the control.

    omega_r, P in pu of the turbine's bases, beta in deg; P is the power taken from the machine.
    """

    wind = Input("m/s", "measured wind speed", start=8.0, nominal=10.0)
    omega_r = Input("pu", "rotor speed", start=1.2)
    beta = Input("deg", "pitch angle", nominal=10.0)
    P = Input("pu", "active power taken from the machine", start=0.5)
    omega_del = Output("pu", "rotor speed of the operating point", start=1.2)
    beta_del = Output("deg", "pitch angle of the operating point", nominal=10.0)


class FixedPoint(OperatingSchedule):
    """One operating point, whatever the wind.

        omega_del = omega_point,      beta_del = beta_point

    Speed in pu of the turbine's base, pitch in deg.
    Source: Lyu, Subotic, Gross 2022, VI: each case has the operating point of its own constant wind.
    """

    omega_point = Parameter("pu", "rotor speed of the operating point", default=1.2, above=0.0)
    beta_point = Parameter("deg", "pitch angle of the operating point", default=0.0)

    def equations(self) -> None:
        self.eq(self.omega_del, self.omega_point)
        self.eq(self.beta_del, self.beta_point)
