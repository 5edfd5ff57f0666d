"""Drive train as one rotating mass."""

from __future__ import annotations

from gustform.mechanical.drive_train import DriveTrain


class OneMass(DriveTrain):
    """Rotor, hub, shaft and generator as one stiff mass.

        J d(omega)/dt = tau_rotor + tau_generator         torques INTO the mass at its two sides

    SI units: rad/s, N m. Source: Lyu, Subotic, Gross 2022, eq. (2b), divided by omega.
    """

    def equations(self) -> None:
        self.eq(self.w, self.generator.w)
        self.eq(self.w, self.rotor.w)
        self.eq(self.J * self.der(self.w), self.rotor.tau + self.generator.tau)
