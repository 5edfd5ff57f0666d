"""Where a controller knows the wind speed from: a measurement, or an observer of the rotor."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Table, Variable, maximum, table2


class WindSource(Component):
    """Base of what tells a controller the wind speed. omega_r, P in pu of the turbine's bases, beta in deg."""

    wind = Input("m/s", "measured wind speed", start=8.0, nominal=10.0)
    omega_r = Input("pu", "rotor speed", start=1.2)
    beta = Input("deg", "pitch angle", nominal=10.0)
    P = Input("pu", "active power taken from the machine", start=0.5)
    v = Output("m/s", "wind speed as the controller knows it", start=8.0, nominal=10.0)


class MeasuredWind(WindSource):
    """The rotor-effective wind speed itself, as a lidar would measure it: v = wind. SI units."""

    def equations(self) -> None:
        self.eq(self.v, self.wind)


class WindObserver(WindSource):
    """Immersion-and-invariance observer of the wind speed from rotor speed, pitch angle and power.

        v      = x + gamma omega_r
        P_v    = Cp(v_tip omega_r/v, beta) (v/v_one)^3          power that such a wind would give, pu
        dx/dt  = -gamma (P_v - P)/(2 H omega_r)

    With the swing equation 2 H omega_r d(omega_r)/dt = P_wt - P the speed drops out,

        dv/dt  = gamma (P_wt - P_v)/(2 H omega_r),

    so the estimate converges to the true wind, whatever speed and pitch do, where P_v rises with v at fixed omega_r:
    where lambda dCp/dlambda < 3 Cp, which holds outside deep stall. Its time constant is 2 H omega_r/(gamma dP_v/dv),
    about 1 s at 8 m/s with the default. A loss that P does not hold makes the estimate low by a third of its share.

    pu of the turbine's rating and base speed, beta in deg; H at base speed. v below `v_min` counts as `v_min`.
    Source: R. Ortega, F. Mancilla-David, F. Jaramillo, "A globally convergent wind speed estimator for wind turbine
    systems", Int. J. Adapt. Control Signal Process. 27 (2013) 413-425, written with power and pitch.
    """

    gamma = Parameter("m/s", "gain: wind speed for 1 pu of rotor speed", default=50.0, above=0.0)
    H = Parameter("s", "inertia constant of rotor and generator at base speed", default=4.605, above=0.0)
    v_tip = Parameter("m/s", "speed of the blade tips at base speed", default=71.93, above=0.0)
    v_one = Parameter("m/s", "wind speed that would give rated power with Cp = 1", default=8.853, above=0.0)
    v_min = Parameter("m/s", "lowest wind speed that the equations see", default=1.0, above=0.0)
    cp = Table("1", "deg", "1", "power coefficient of tip speed ratio and pitch, the controller's own copy")

    x = Variable("m/s", "state of the observer: the estimate less gamma omega_r", start=-50.0, nominal=10.0)

    def equations(self) -> None:
        v = maximum(self.v, self.v_min)
        P_v = table2(self.cp, self.v_tip * self.omega_r / v, self.beta) * (v / self.v_one) ** 3
        self.eq(self.v, self.x + self.gamma * self.omega_r)
        self.eq(self.der(self.x), -self.gamma * (P_v - self.P) / (2.0 * self.H * self.omega_r))
