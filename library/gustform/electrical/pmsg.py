"""Permanent-magnet synchronous generator, reduced to an EMF behind the stator reactance."""

from __future__ import annotations

import math

import casadi as ca

from gustform.electrical.permanent_magnet import PermanentMagnetMachine
from gustform.language import Input, Variable


class Pmsg(PermanentMagnetMachine):
    """PMSG without stator dynamics, resistance and saliency: an EMF E behind X, both in proportion to the speed.

        E = psi omega e^{j rho},  X = L omega          E - v = jX i,  i out of the machine
        i_r = (psi sin(rho) - v_i/omega) / L
        i_i = (v_r/omega - psi cos(rho)) / L
        d(rho)/dt = p omega_base (omega - frame)
        tau = P / omega_shaft                          lossless: shaft power = electrical power P delivered

    rho: electrical angle of the EMF against the frame of the machine side, which turns at `frame` (pu of the electrical
    speed p omega_base). With the frame on the converter's voltage V, P = E V/X sin(rho) = psi V/L sin(rho).
    Inside pu: base rating, voltage, omega_base (mechanical); X at speed omega is L omega. The port is in V and A.

    Source: Lyu, Subotic, Gross 2022, eqs. (2), (4a); stator reactance 0.4 pu at 1.2 pu speed: project notes.
    """

    frame = Input("pu", "electrical speed of the machine-side frame, base p omega_base", start=1.2)
    rho = Variable(
        "rad", "angle of the EMF ahead of the machine-side frame", start=0.2, min=-math.pi / 2, max=math.pi / 2
    )

    def equations(self) -> None:
        super().equations()
        v, omega = self.terminal, self.omega
        I_b = self.rating / self.voltage
        self.eq(self.der(self.rho), self.pole_pairs * self.omega_base * (omega - self.frame))
        self.eq(v.ir, -I_b / self.L * (self.psi * ca.sin(self.rho) - v.vi / (self.voltage * omega)))
        self.eq(v.ii, -I_b / self.L * (v.vr / (self.voltage * omega) - self.psi * ca.cos(self.rho)))
        self.eq(self.shaft.tau, self.P / self.shaft.w)
