"""Permanent-magnet synchronous generator, reduced to an EMF behind the stator reactance."""

from __future__ import annotations

import math

import casadi as ca

from gustform.interfaces import AcPort, Shaft
from gustform.language import Component, Input, Parameter, Variable


class Pmsg(Component):
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

    rating = Parameter("VA", "base of power", default=5e6, above=0.0)
    voltage = Parameter("V", "line-to-line RMS voltage that is 1 pu (EMF at nominal speed)", default=3.3e3, above=0.0)
    omega_base = Parameter("1/s", "mechanical speed that is 1 pu, rad/s", default=1.1417, above=0.0)
    pole_pairs = Parameter("1", "pole pairs p", default=100.0, min=1.0)
    psi = Parameter("pu", "EMF at 1 pu speed", default=1.0 / 1.2, above=0.0)
    L = Parameter("pu", "stator reactance at 1 pu speed", default=0.4 / 1.2, above=0.0)

    frame = Input("pu", "electrical speed of the machine-side frame, base p omega_base", start=1.2)
    shaft = Shaft("rotor of the machine", start={"w": lambda self: self.omega_base})
    terminal = AcPort(
        "stator terminals",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    omega = Variable("pu", "speed, base omega_base", start=1.2)
    rho = Variable(
        "rad", "angle of the EMF ahead of the machine-side frame", start=0.2, min=-math.pi / 2, max=math.pi / 2
    )
    P = Variable("W", "active power delivered", start=1e6, nominal=1e6)

    def equations(self) -> None:
        v, omega = self.terminal, self.omega
        I_b = self.rating / self.voltage
        self.eq(omega, self.shaft.w / self.omega_base)
        self.eq(self.der(self.rho), self.pole_pairs * self.omega_base * (omega - self.frame))
        self.eq(v.ir, -I_b / self.L * (self.psi * ca.sin(self.rho) - v.vi / (self.voltage * omega)))
        self.eq(v.ii, -I_b / self.L * (v.vr / (self.voltage * omega) - self.psi * ca.cos(self.rho)))
        self.eq(self.P, -(v.vr * v.ir + v.vi * v.ii))
        self.eq(self.shaft.tau, self.P / self.shaft.w)
