"""Power plant: synchronous machine, step-up transformer, turbine-governor and exciter."""

from __future__ import annotations

from gustform.conventions import NOMINAL_FREQUENCY, active_power, reactive_power
from gustform.electrical.dq import DqImpedance, RotorFrame
from gustform.electrical.exciter import Exciter
from gustform.electrical.governor import Governor
from gustform.electrical.machine6 import Machine6, MachineRest
from gustform.electrical.sexs import SEXS
from gustform.electrical.tgov1 import TGOV1
from gustform.interfaces import AcPort
from gustform.language import Component, Input, Output, Parameter, Part, Variable


class SynchronousGenerator(Component):
    """Sixth-order machine behind its step-up transformer, with governor and exciter.

        terminal (V, A) -- rotor frame -- transformer (d-q) -- machine -- E_fd -- exciter
                                                                 |
                                                                P_m -- governor

    The transformer is solved in the rotor's frame, together with the stator: no algebraic loop is left. Base of pu:
    `rating` and, at the terminal, `voltage`. P, Q are what all `aggregate` machines deliver. Wire the system's `frame`
    to this `omega`: the phasors then stand still at any common frequency.

    Source: see the parts; data: project notes, set A (210 MVA).
    """

    rating = Parameter("VA", "rated apparent power of one machine, base of pu", default=210e6, above=0.0)
    voltage = Parameter("V", "nominal line-to-line RMS voltage at the terminal", default=33e3, above=0.0)
    aggregate = Parameter("1", "number of identical machines", default=1.0, min=1.0)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)
    P_start = Parameter("pu", "first guess of the active power delivered, base rating", default=0.4)
    Q_start = Parameter("pu", "first guess of the reactive power delivered, base rating", default=0.1)

    terminal = AcPort(
        "high-voltage side of the step-up transformer",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )
    frame = Input("pu", "speed of the phasor frame, base f0", start=1.0)

    machine = Part(
        Machine6,
        "synchronous machine",
        f0=lambda self: self.f0,
        delta=lambda self: self.rest().delta,
        E1q=lambda self: self.rest().E1q,
        E1d=lambda self: self.rest().E1d,
        psi_1d=lambda self: self.rest().psi_1d,
        psi_2q=lambda self: self.rest().psi_2q,
        psi_d=lambda self: self.rest().psi_d,
        psi_q=lambda self: self.rest().psi_q,
        i_d=lambda self: self.rest().i_d,
        i_q=lambda self: self.rest().i_q,
    )
    transformer = Part(DqImpedance, "step-up transformer, pu of the machine's rating")
    rotor_frame = Part(
        RotorFrame,
        "change from network phasors to the machine's d-q frame",
        rating=lambda self: self.rating,
        voltage=lambda self: self.voltage,
        n=lambda self: self.aggregate,
    )
    governor = Part(
        TGOV1,
        "turbine and governor",
        base=Governor,
        P_ref=lambda self: self.rest().P_m,
        valve=lambda self: self.rest().P_m,
        reheater=lambda self: self.rest().P_m,
    )
    exciter = Part(SEXS, "excitation system", base=Exciter, E_fd=lambda self: self.rest().E_fd)

    omega = Output("pu", "rotor speed, base f0", start=1.0)
    frequency = Variable("Hz", "frequency of the machine", start=NOMINAL_FREQUENCY, nominal=NOMINAL_FREQUENCY)
    delta = Variable("rad", "angle of the q axis against the phasor frame")
    P = Variable("W", "active power delivered at the terminal", start=1e8, nominal=1e6)
    Q = Variable("var", "reactive power delivered at the terminal", nominal=1e6)
    P_m = Variable("pu", "mechanical power, base rating", start=0.5)
    E_fd = Variable("pu", "field voltage", start=1.5)
    V_t = Variable("pu", "voltage at the machine's terminals, below the transformer", start=1.0)

    def rest(self) -> MachineRest:
        """The machine at rest at the first guess of P and Q, with 1 pu and angle 0 at the terminal of the plant."""
        current = complex(self.P_start, -self.Q_start)
        voltage = 1.0 + complex(self.transformer.r, self.transformer.x) * current
        rest: MachineRest = self.machine.rest(voltage * current.conjugate(), voltage)
        return rest

    def equations(self) -> None:
        machine = self.machine
        self.connect(self.terminal, self.rotor_frame.network)
        self.connect(self.rotor_frame.machine, self.transformer.b)
        self.connect(self.transformer.a, machine.stator)
        self.connect(machine.delta, self.rotor_frame.delta)
        self.connect(machine.frame, self.frame)
        self.connect(machine.omega, self.governor.omega)
        self.connect(self.governor.P_m, machine.P_m)
        self.connect(machine.V_t, self.exciter.V_t)
        self.connect(self.exciter.E_fd, machine.E_fd)
        # what a user looks at
        self.connect(self.omega, machine.omega)
        self.connect(self.delta, machine.delta)
        self.connect(self.P_m, machine.P_m)
        self.connect(self.E_fd, machine.E_fd)
        self.connect(self.V_t, machine.V_t)
        self.eq(self.frequency, self.f0 * self.omega)
        self.eq(self.P, -active_power(self.terminal))
        self.eq(self.Q, -reactive_power(self.terminal))
