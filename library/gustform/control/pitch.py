"""Blade pitch controller: proportional part, speed limiter, power limiter, servo."""

from __future__ import annotations

from gustform.control.pi_limiter import PiLimiter
from gustform.control.pitch_servo import PitchServo
from gustform.language import Component, Input, Output, Parameter, Part, Variable, limit


class PitchControl(Component):
    """Pitch angle from rotor speed and power.

        beta_ref = limit(beta_del + K_p (omega_r - omega_del) + u_speed + u_power, beta_min, beta_max)
        u_speed  = PI limiter of omega_r above omega_max
        u_power  = PI limiter of P/(T_P s + 1) above P_max

    and the servo behind it. Angles in deg; omega_r in pu of the turbine's base speed, P (electrical, from the machine)
    in pu of the rating of one turbine; time in s.
    Source: Lyu, Subotic, Gross 2022, eq. (11), Fig. 7; gains of the limiters: project notes.
    """

    K_p = Parameter("deg", "pitch for speed, deg/pu", default=0.0, min=0.0)
    beta_min = Parameter("deg", "lowest pitch demand", default=0.0)
    beta_max = Parameter("deg", "highest pitch demand: feathered", default=90.0, above=0.0)
    omega_max = Parameter("pu", "speed above which the speed limiter acts", default=1.2, above=0.0)
    P_max = Parameter("pu", "power above which the power limiter acts", default=1.0, above=0.0)
    beta_start = Parameter("deg", "first guess of the pitch angle", default=0.0)
    beta_limiter = Parameter("deg", "start of the integral of the speed limiter", default=0.0, min=0.0)
    T_P = Parameter("s", "time constant of the filter of the power", default=0.5, above=0.0)

    speed_limiter = Part(
        PiLimiter,
        "limits the rotor speed",
        x_max=lambda self: self.omega_max,
        k_p=60.0,
        k_i=12.0,
        integral=lambda self: self.beta_limiter,
        u_max=lambda self: self.beta_max,
    )
    power_limiter = Part(
        PiLimiter, "limits the power", x_max=lambda self: self.P_max, k_p=1.0, k_i=2.0, u_max=lambda self: self.beta_max
    )
    servo = Part(PitchServo, "pitch actuator", beta=lambda self: self.beta_start)

    beta_del = Input("deg", "pitch angle at the operating point", nominal=10.0)
    omega_del = Input("pu", "rotor speed at the operating point", start=1.2)
    omega_r = Input("pu", "rotor speed", start=1.2)
    P = Input("pu", "active power taken from the machine", start=0.5)
    beta = Output("deg", "pitch angle", nominal=10.0)
    P_filtered = Variable("pu", "filtered power", start=0.5)
    beta_ref = Variable("deg", "pitch demand", nominal=10.0)

    def equations(self) -> None:
        speed_limiter, power_limiter, servo = self.speed_limiter, self.power_limiter, self.servo
        self.eq(self.T_P * self.der(self.P_filtered), self.P - self.P_filtered)
        self.connect(speed_limiter.x, self.omega_r)
        self.connect(power_limiter.x, self.P_filtered)
        proportional = self.beta_del + self.K_p * (self.omega_r - self.omega_del)
        demand = proportional + speed_limiter.u + power_limiter.u
        self.eq(self.beta_ref, limit(demand, self.beta_min, self.beta_max))
        self.connect(servo.beta_ref, self.beta_ref)
        self.connect(self.beta, servo.beta)


class HeldPitchDemand(PitchControl):
    """The pitch servo with a demand that a sampled controller holds.

        beta_ref held,   beta by the servo

    The rest of the pitch control is part of that controller. Source: see PitchControl.
    """

    kept_parts = ("servo",)

    def held(self) -> tuple[str, ...]:
        return ("beta_ref",)

    def held_equations(self) -> None:
        self.connect(self.servo.beta_ref, self.beta_ref)
        self.connect(self.beta, self.servo.beta)
