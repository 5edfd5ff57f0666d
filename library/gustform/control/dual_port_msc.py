"""Dual-port grid-forming control of the machine-side converter."""

from __future__ import annotations

from typing import Any

from gustform.control.dual_port_side import DualPortSide
from gustform.language import Input, Output, Parameter


class DualPortMsc(DualPortSide):
    """Machine-side frequency from the DC voltage, machine-side voltage from the reactive power.

        omega = omega_del + (K_theta + K_d s)/(T_dc s + 1) (v_dc - v_dc*)
        V     = V* + K_q (Q* - Q/(T_v s + 1))

    States and the `lossless` form: DualPortSide. pu: base of the rotor speed, nominal voltages, rating of the turbine;
    time in s; Q delivered to the machine. V* is found at a steady-state start so that the reactive power is Q* = 0.
    Source: Lyu, Subotic, Gross 2022, eqs. (9a), (9b) with K_q^msc (project notes).
    """

    K_q = Parameter("pu", "droop of the voltage with the reactive power", default=0.05, min=0.0)
    V_ref = Parameter("pu", "voltage set point V*, found at the start", free=True, start=0.95)

    omega_del = Input("pu", "rotor speed at the operating point", start=1.2)
    omega = Output("pu", "frequency of the converter's voltage, base of the rotor speed", start=1.2)

    def omega_ref(self) -> Any:
        return self.omega_del
