"""Inner loops of a converter: its voltage and its current, in its own d-q frame."""

from __future__ import annotations

from gustform.language import Component, Input, Output, Parameter, Variable


class VoltageLoop(Component):
    """PI control of the capacitor voltage of an LC filter; gives the references of the current.

        eps   = v* - v
        i_d*  = k_ff i_gd - b omega v_q + k_p eps_d + I_d          d(I_d)/dt = k_i eps_d
        i_q*  = k_ff i_gq + b omega v_d + k_p eps_q + I_q          d(I_q)/dt = k_i eps_q

    i_g: current from the capacitor into the grid; b: the capacitor's susceptance at nominal frequency, for decoupling.
    pu: rating and nominal voltage of the converter, f0; time in s; currents out of the converter.
    Source: D'Arco, Suul, Fosso, Electric Power Systems Research 122, 2015, 3.3; gains: project notes.
    """

    k_p = Parameter("pu", "proportional gain", default=1.0, min=0.0)
    k_i = Parameter("1/s", "integral gain, pu/s of current for 1 pu of voltage", default=100.0, min=0.0)
    k_ff = Parameter("pu", "share of the grid current that is fed forward", default=0.9, min=0.0, max=1.0)
    b = Parameter("pu", "susceptance of the capacitor at nominal frequency", default=0.0499, min=0.0)

    omega = Input("pu", "frequency of the frame, base f0", start=1.0)
    v_d_ref = Input("pu", "voltage reference along the frame", start=1.0)
    v_q_ref = Input("pu", "voltage reference across the frame")
    v_d = Input("pu", "capacitor voltage along the frame", start=1.0)
    v_q = Input("pu", "capacitor voltage across the frame")
    i_gd = Input("pu", "current into the grid along the frame", start=0.5)
    i_gq = Input("pu", "current into the grid across the frame")
    i_d_ref = Output("pu", "reference of the filter current along the frame", start=0.5)
    i_q_ref = Output("pu", "reference of the filter current across the frame")
    I_d = Variable("pu", "integrator along the frame")
    I_q = Variable("pu", "integrator across the frame")

    def equations(self) -> None:
        eps_d, eps_q = self.v_d_ref - self.v_d, self.v_q_ref - self.v_q
        b = self.omega * self.b
        self.eq(self.der(self.I_d), self.k_i * eps_d)
        self.eq(self.der(self.I_q), self.k_i * eps_q)
        self.eq(self.i_d_ref, self.k_ff * self.i_gd - b * self.v_q + self.k_p * eps_d + self.I_d)
        self.eq(self.i_q_ref, self.k_ff * self.i_gq + b * self.v_d + self.k_p * eps_q + self.I_q)


class CurrentLoop(Component):
    """PI control of the current through a reactance; gives the voltage of the converter's terminals.

        eps = i* - i
        e_d = v_d - x omega i_q + k_p eps_d + I_d          d(I_d)/dt = k_i eps_d
        e_q = v_q + x omega i_d + k_p eps_q + I_q          d(I_q)/dt = k_i eps_q

    v: voltage at the other end of the reactance, fed forward; x: the reactance at nominal frequency, for decoupling.
    pu: rating, nominal voltage and nominal frequency of the AC side; time in s; currents out of the converter.
    Source: D'Arco, Suul, Fosso, Electric Power Systems Research 122, 2015, 3.4; gains: project notes.
    """

    k_p = Parameter("pu", "proportional gain", default=1.27, min=0.0)
    k_i = Parameter("1/s", "integral gain, pu/s of voltage for 1 pu of current", default=14.3, min=0.0)
    x = Parameter("pu", "reactance at nominal frequency", default=0.1, min=0.0)

    omega = Input("pu", "frequency of the frame, base: the nominal one", start=1.0)
    i_d_ref = Input("pu", "current reference along the frame", start=0.5)
    i_q_ref = Input("pu", "current reference across the frame")
    i_d = Input("pu", "current along the frame", start=0.5)
    i_q = Input("pu", "current across the frame")
    v_d = Input("pu", "voltage fed forward along the frame", start=1.0)
    v_q = Input("pu", "voltage fed forward across the frame")
    e_d = Output("pu", "voltage of the converter along the frame", start=1.0)
    e_q = Output("pu", "voltage of the converter across the frame")
    I_d = Variable("pu", "integrator along the frame")
    I_q = Variable("pu", "integrator across the frame")

    def equations(self) -> None:
        eps_d, eps_q = self.i_d_ref - self.i_d, self.i_q_ref - self.i_q
        x = self.omega * self.x
        self.eq(self.der(self.I_d), self.k_i * eps_d)
        self.eq(self.der(self.I_q), self.k_i * eps_q)
        self.eq(self.e_d, self.v_d - x * self.i_q + self.k_p * eps_d + self.I_d)
        self.eq(self.e_q, self.v_q + x * self.i_d + self.k_p * eps_q + self.I_q)


class VoltageFilter(Component):
    """Low pass of a measured voltage, for feeding it forward.

        T d(v_f)/dt = v - v_f          in d and q

    pu: nominal voltage; time in s. A converter that imposes a current needs it: with the bare voltage fed forward, its
    filter's capacitor swings undamped against the grid's reactance.
    Source: first-order lag; Teodorescu, Liserre, Rodriguez, Grid Converters, 2011, 11.3, for the resonance.
    """

    T = Parameter("s", "time constant", default=0.001, above=0.0)

    v_d = Input("pu", "voltage along the frame", start=1.0)
    v_q = Input("pu", "voltage across the frame")
    v_fd = Output("pu", "filtered voltage along the frame", start=1.0)
    v_fq = Output("pu", "filtered voltage across the frame")

    def equations(self) -> None:
        self.eq(self.T * self.der(self.v_fd), self.v_d - self.v_fd)
        self.eq(self.T * self.der(self.v_fq), self.v_q - self.v_fq)
