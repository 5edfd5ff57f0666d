"""Drive train as two masses and a shaft that twists between them."""

from __future__ import annotations

from gustform.language import Parameter, Variable
from gustform.mechanical.drive_train import DriveTrain


class TwoMass(DriveTrain):
    """Rotor and generator as two masses, with an elastic, damped shaft between them.

        J_r d(w_rotor)/dt = tau_rotor - T          d(phi)/dt = w_rotor - w
        J_g d(w)/dt = T + tau_generator            T = K phi + D (w_rotor - w)

    SI units: rad/s, N m, rad. T, the torque in the shaft, is what fatigues it. All speeds are those of the slow shaft.
    Source: NREL 5 MW reference turbine (Jonkman et al., NREL/TP-500-38060, 2009): K = 8.676e8 N m/rad,
    D = 6.215e6 N m s, generator 534.116 kg m^2 behind a gear of 97. J = J_r + J_g is the paper's, Table I.
    """

    J_g = Parameter("kg*m^2", "moment of inertia of the generator's rotor", default=534.116 * 97.0**2, above=0.0)
    J_r = Parameter("kg*m^2", "moment of inertia of the rotor", default=lambda self: self.J - self.J_g, above=0.0)
    K = Parameter("N*m", "stiffness of the shaft, N m/rad", default=8.676e8, above=0.0)
    D = Parameter("N*m*s", "damping of the shaft, N m s/rad", default=6.215e6, min=0.0)

    w_rotor = Variable("1/s", "speed of the rotor, rad/s", start=lambda self: self.start_value(type(self).w), min=0.0)
    phi = Variable("rad", "twist of the shaft, rotor ahead of generator", start=4e-3, nominal=1e-2)
    T = Variable("N*m", "torque in the shaft, driving the generator", start=4e6, nominal=1e6)

    def equations(self) -> None:
        self.eq(self.w, self.generator.w)
        self.eq(self.w_rotor, self.rotor.w)
        slip = self.w_rotor - self.w
        self.eq(self.der(self.phi), slip)
        self.eq(self.T, self.K * self.phi + self.D * slip)
        self.eq(self.J_r * self.der(self.w_rotor), self.rotor.tau - self.T)
        self.eq(self.J_g * self.der(self.w), self.T + self.generator.tau)
