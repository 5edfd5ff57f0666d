"""Averaged machine-side converter with a loop on the stator current."""

from __future__ import annotations

from typing import Any

from gustform.control.inner_loops import CurrentLoop
from gustform.electrical.machine_side import MachineSide
from gustform.language import Input, Parameter, Part, Variable


class MachineSideDq(MachineSide):
    """Base of averaged, lossless machine-side converters that control the stator current in the rotor's frame.

        i_d + j i_q = i/I_b                                  measured, from the machine into the converter
        v_d = omega L i_q        - k_p (i_d* - i_d) - I_d    d(I_d)/dt = k_i (i_d* - i_d)
        v_q = omega (psi - L i_d) - k_p (i_q* - i_q) - I_q   d(I_q)/dt = k_i (i_q* - i_q)

    the CurrentLoop with the EMF fed forward and the current out of the converter, -i. Its gains make the closed loop a
    lag of T_i, if r, L, psi are those of the machine: with L/w_b di/dt = -r i + u,  k_p = L/(w_b T_i),  k_i = r/T_i.
    After `blocked` has become 1 the references are 0. pu: rating and voltage of the machine, base of the rotor speed.
    Source: Harnefors, Nee, IEEE Trans. Industry Applications 34(1), 1998 (internal model control); T_i: project notes.
    """

    rating = Parameter("VA", "base of power", default=5e6, above=0.0)
    omega_base = Parameter("1/s", "mechanical speed that is 1 pu, rad/s", default=1.1417, above=0.0)
    pole_pairs = Parameter("1", "pole pairs p of the machine", default=100.0, min=1.0)
    psi = Parameter("pu", "EMF of the machine at 1 pu speed", default=1.0 / 1.2, above=0.0)
    L = Parameter("pu", "stator reactance of the machine at 1 pu speed", default=0.4 / 1.2, above=0.0)
    r = Parameter("pu", "stator resistance of the machine", default=0.01, min=0.0)
    T_i = Parameter("s", "time constant of the closed current loop", default=0.002, above=0.0)

    current = Part(
        CurrentLoop,
        "current loop",
        x=lambda self: self.L,
        k_p=lambda self: self.L / (self.pole_pairs * self.omega_base * self.T_i),
        k_i=lambda self: self.r / self.T_i,
    )

    omega_r = Input("pu", "rotor speed, measured", start=1.2)
    blocked = Input("1", "1: the converter is blocked")
    i_d = Variable("pu", "current from the machine along the magnet")
    i_q = Variable("pu", "current from the machine along the EMF", start=0.5)

    def equations(self) -> None:
        super().equations()
        v, current = self.machine, self.current
        I_b = self.rating / self.voltage
        self.eq(self.i_d, v.ir / I_b)
        self.eq(self.i_q, v.ii / I_b)
        self.connect(current.omega, self.omega_r)
        self.eq(current.i_d, -self.i_d)
        self.eq(current.i_q, -self.i_q)
        self.eq(current.v_d, 0)
        self.eq(current.v_q, self.psi * self.omega_r)
        self.eq(v.vr, self.voltage * current.e_d)
        self.eq(v.vi, self.voltage * current.e_q)

    def follow(self, i_d: Any, i_q: Any) -> None:
        """The references of the current from the machine."""
        flowing = 1.0 - self.blocked
        self.eq(self.current.i_d_ref, -flowing * i_d)
        self.eq(self.current.i_q_ref, -flowing * i_q)
