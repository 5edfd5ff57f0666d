"""Highest power that the machine side may take from a slow rotor."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, limit


class LowSpeedLimit(Component):
    """Power limit that falls to zero before the rotor stands still.

        P_limit = P_max limit((omega_r/omega_min - s)/(1 - s), 0, 1)

    A rotor that is asked for more than the wind gives slows down, and the slower it is the less the wind gives. The
    limit ends that between omega_min and s omega_min, where the power taken meets what the wind still gives. At the
    optimal tip speed the power at these speeds is far below the limit. pu: rating, base of the rotor speed. Ours.
    """

    P_max = Parameter("pu", "highest power of the machine side", default=1.0, above=0.0)
    omega_min = Parameter("pu", "rotor speed below which the limit falls", default=0.6, above=0.0)
    stop = Parameter("1", "share s of omega_min at which it is zero", default=0.5, min=0.0, max=0.95)

    omega_r = Input("pu", "rotor speed", start=1.2)
    P_limit = Output("pu", "highest power to be taken from the machine", start=1.0)

    def equations(self) -> None:
        share = limit((self.omega_r / self.omega_min - self.stop) / (1.0 - self.stop), 0.0, 1.0)
        self.eq(self.P_limit, self.P_max * share)
