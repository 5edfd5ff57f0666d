"""Averaged grid-side converter with the dynamics of its LC filter."""

from __future__ import annotations

from typing import Any

import casadi as ca

from gustform.control.inner_loops import CurrentLoop, VoltageFilter
from gustform.conventions import TWO_PI
from gustform.electrical.grid_side import GridSide
from gustform.language import Input, Parameter, Part, Variable


class GridSideDq(GridSide):
    """Base of averaged, lossless grid-side converters behind an LC filter, in the converter's own d-q frame.

        x/w0 d(i_fd)/dt = e_d - v_d - r i_fd + omega x i_fq          x/w0 d(i_fq)/dt = e_q - v_q - r i_fq - omega x i_fd
        b/w0 d(v_d)/dt  = i_fd - i_gd + omega b v_q                  b/w0 d(v_q)/dt  = i_fq - i_gq - omega b v_d
        i_gd + j i_gq   = i_g/I_b e^{-j theta}                       current into the grid
        P = (e_d i_fd + e_q i_fq) S_b                                at the switches
        Q = (v_q i_fd - v_d i_fq + omega x |i_f|^2) S_b              there too, but for x/w0 d(i_f)/dt

    States: theta, the current i_f of the inductor and the voltage v of the capacitor, which is that of the port. The
    voltage e of the switches comes from a current loop with v, filtered, fed forward. After `blocked` has become 1, its
    references are 0 and so is P. pu: rating, nominal voltage, f0; currents out of the converter.
    The port needs an inductor with a current of its own behind it (TransformerDq): a capacitor that feeds a reactance
    in phasors has a mode at w0/(b x), ten times the real resonance and hardly damped.
    Source: Lyu, Subotic, Gross 2022, II-B, Table I (0.0100/0.1000/0.0499 pu); D'Arco, Suul, Fosso 2015, 3.1.
    """

    b = Parameter("pu", "susceptance of the filter's capacitor at nominal frequency", default=0.0499, above=0.0)

    feed_forward = Part(VoltageFilter, "filter of the voltage that is fed forward")
    current = Part(CurrentLoop, "current loop", x=lambda self: self.x)

    blocked = Input("1", "1: the converter is blocked")
    i_fd = Variable("pu", "current of the filter's inductor along the frame", start=0.5)
    i_fq = Variable("pu", "current of the filter's inductor across the frame")
    i_gd = Variable("pu", "current into the grid along the frame", start=0.5)
    i_gq = Variable("pu", "current into the grid across the frame")
    e_d = Variable("pu", "voltage of the switches along the frame", start=1.0)
    e_q = Variable("pu", "voltage of the switches across the frame")

    def equations(self) -> None:
        super().equations()
        feed_forward, current, w0 = self.feed_forward, self.current, TWO_PI * self.f0
        r, x, b = self.resistance, self.x, self.b
        e_d, e_q, v_d, v_q, i_d, i_q = self.e_d, self.e_q, self.v_d, self.v_q, self.i_fd, self.i_fq
        self.eq(x / w0 * self.der(i_d), e_d - v_d - r * i_d + self.omega * x * i_q)
        self.eq(x / w0 * self.der(i_q), e_q - v_q - r * i_q - self.omega * x * i_d)
        self.eq(b / w0 * self.der(v_d), i_d - self.i_gd + self.omega * b * v_q)
        self.eq(b / w0 * self.der(v_q), i_q - self.i_gq - self.omega * b * v_d)
        self.eq(self.P, (1.0 - self.blocked) * self.rating * (e_d * i_d + e_q * i_q))
        # from what a converter measures, v and i: e would put the current loop's gain into a loop on Q
        self.eq(self.Q, self.rating * (v_q * i_d - v_d * i_q + self.omega * x * (i_d * i_d + i_q * i_q)))
        self.connect(feed_forward.v_d, v_d)
        self.connect(feed_forward.v_q, v_q)
        self.connect(current.v_d, feed_forward.v_fd)
        self.connect(current.v_q, feed_forward.v_fq)
        self.connect(current.omega, self.omega)
        self.connect(current.i_d, i_d)
        self.connect(current.i_q, i_q)
        self.connect(e_d, current.e_d)
        self.connect(e_q, current.e_q)

    def follow(self, i_d: Any, i_q: Any) -> None:
        """The references of the filter's current."""
        flowing = 1.0 - self.blocked
        self.eq(self.current.i_d_ref, flowing * i_d)
        self.eq(self.current.i_q_ref, flowing * i_q)

    def port_equations(self) -> None:
        v, I_b = self.grid, self.rating / self.voltage
        c, s = ca.cos(self.theta), ca.sin(self.theta)
        self.eq(v.vr, self.voltage * (self.v_d * c - self.v_q * s))
        self.eq(v.vi, self.voltage * (self.v_d * s + self.v_q * c))
        self.eq(self.i_gd, -(v.ir * c + v.ii * s) / I_b)
        self.eq(self.i_gq, -(v.ii * c - v.ir * s) / I_b)
