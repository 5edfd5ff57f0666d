"""Dual-port grid-forming control of the grid-side converter."""

from __future__ import annotations

from typing import Any

from gustform.control.dual_port_side import DualPortSide
from gustform.language import Parameter


class DualPortGsc(DualPortSide):
    """Grid-side frequency from the DC voltage, voltage from the reactive power.

        omega = omega_0 + (K_theta + K_d s)/(T_dc s + 1) (v_dc - v_dc*)
        V     = V* + K_q (Q* - Q/(T_v s + 1))

    States and the `lossless` form: DualPortSide. pu: base f0, nominal voltages, rating of the turbine; time in s;
    Q delivered. Q* is found at a steady-state start so that V = V*.
    Source: Lyu, Subotic, Gross 2022, eqs. (7), (8).
    """

    omega_0 = Parameter("pu", "nominal frequency", default=1.0, above=0.0)
    Q_ref = Parameter("pu", "reactive power set point Q*, found at the start", free=True, start=0.0)

    def omega_ref(self) -> Any:
        return self.omega_0
