"""Power plant: synchronous machine, step-up transformer, turbine-governor and exciter."""

from __future__ import annotations

from typing import Any

from gustform.conventions import NOMINAL_FREQUENCY, active_power, reactive_power
from gustform.electrical.constant_field import ConstantField
from gustform.electrical.dq import DqImpedance, RotorFrame
from gustform.electrical.exciter import Exciter
from gustform.electrical.first_order_governor import FirstOrderGovernor
from gustform.electrical.governor import Governor
from gustform.electrical.machine6 import Machine6
from gustform.electrical.machine_classical import ClassicalMachine
from gustform.electrical.sexs import SEXS
from gustform.electrical.synchronous_machine import MachineRest, SynchronousMachine
from gustform.electrical.tgov1 import TGOV1
from gustform.interfaces import AcPort
from gustform.language import Component, GustformError, Input, Output, Parameter, Part, Variable


class SynchronousGenerator(Component):
    """Synchronous machine behind its step-up transformer, with governor and exciter.

        terminal (V, A) -- rotor frame -- transformer (d-q) -- machine -- E_fd -- exciter
                                                                 |
                                                                P_m -- governor

    The transformer is solved in the rotor's frame, together with the stator: no algebraic loop is left. Base of pu:
    `rating` and, at the terminal, `voltage`. P, Q are what all `aggregate` machines deliver. Wire the system's `frame`
    to this `omega`: the phasors then stand still at any common frequency.

    `fidelity` chooses what the scenario leaves open. rms and dq: sixth-order machine, TGOV1, SEXS. lossless, the
    paper's analysis model: classical machine with constant field, first-order governor, and no resistance anywhere.
    What is given is kept: a part that is named, and one with parameters that only the model of rms has. So a machine
    is of sixth order at lossless too when it is given an exciter, which would have no effect on a classical one.

    Source: see the parts; data: project notes, set A (210 MVA).
    """

    fidelity = Parameter(
        "1",
        "lossless: the paper's analysis model; rms, dq: sixth order with a quasi-static stator",
        default="rms",
        structural=True,
        choices=("lossless", "rms", "dq"),
    )
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
        base=SynchronousMachine,
        select=lambda self: self.chosen_machine(),
        among=(ClassicalMachine,),
        lossless=lambda self: self.fidelity == "lossless",
        f0=lambda self: self.f0,
        delta=lambda self: self.rest().delta,
        E=lambda self: self.rest().E,
        E1q=lambda self: self.rest().E1q,
        E1d=lambda self: self.rest().E1d,
        psi_1d=lambda self: self.rest().psi_1d,
        psi_2q=lambda self: self.rest().psi_2q,
        psi_d=lambda self: self.rest().psi_d,
        psi_q=lambda self: self.rest().psi_q,
        i_d=lambda self: self.rest().i_d,
        i_q=lambda self: self.rest().i_q,
    )
    transformer = Part(
        DqImpedance,
        "step-up transformer, pu of the machine's rating",
        lossless=lambda self: self.fidelity == "lossless",
    )
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
        select=lambda self: self.chosen_governor(),
        among=(FirstOrderGovernor,),
        P_m=lambda self: self.rest().P_m,
        P_ref=lambda self: self.rest().P_m,
        valve=lambda self: self.rest().P_m,
        reheater=lambda self: self.rest().P_m,
    )
    exciter = Part(
        SEXS,
        "excitation system",
        base=Exciter,
        select=lambda self: self.chosen_exciter(),
        among=(ConstantField,),
        E_fd=lambda self: self.rest().E_fd,
    )

    omega = Output("pu", "rotor speed, base f0", start=1.0)
    frequency = Variable("Hz", "frequency of the machine", start=NOMINAL_FREQUENCY, nominal=NOMINAL_FREQUENCY)
    delta = Variable("rad", "angle of the q axis against the phasor frame")
    P = Variable("W", "active power delivered at the terminal", start=1e8, nominal=1e6)
    Q = Variable("var", "reactive power delivered at the terminal", nominal=1e6)
    P_m = Variable("pu", "mechanical power, base rating", start=0.5)
    E_fd = Variable("pu", "field voltage", start=1.5)
    V_t = Variable("pu", "voltage at the machine's terminals, below the transformer", start=1.0)

    def __init__(self, **modifiers: Any) -> None:
        super().__init__(**modifiers)
        machine, exciter = self._modifiers.get("machine"), self._modifiers.get("exciter")
        idle = isinstance(machine, SynchronousMachine) and not machine.excited
        if idle and isinstance(exciter, Exciter) and not isinstance(exciter, ConstantField):
            raise GustformError(
                "GF2060",
                f"exciter must be ConstantField, because the voltage of a {type(machine).__name__} is constant; "
                f"got {type(exciter).__name__}",
                hint="machine: Machine6, or no exciter",
            )

    def chosen_machine(self) -> type[SynchronousMachine]:
        """The machine where none is named: classical at lossless, unless something given needs the sixth order."""
        classical = self._takes("machine", ClassicalMachine) and self._takes("exciter", ConstantField)
        return ClassicalMachine if self.fidelity == "lossless" and classical else Machine6

    def chosen_governor(self) -> type[Governor]:
        """The governor where none is named."""
        simple = self.fidelity == "lossless" and self._takes("governor", FirstOrderGovernor)
        return FirstOrderGovernor if simple else TGOV1

    def chosen_exciter(self) -> type[Exciter]:
        """The exciter where none is named: one that acts, if it would have an effect."""
        return SEXS if self.machine.excited else ConstantField

    def _takes(self, part: str, kind: type[Component]) -> bool:
        """Whether `kind` can stand for a part as it is given: as such, or by parameters all of which it has."""
        given = self._modifiers.get(part, {})
        return isinstance(given, kind) if isinstance(given, Component) else set(given) <= set(kind.declarations())

    def rest(self) -> MachineRest:
        """The machine at rest at the first guess of P and Q, with 1 pu and angle 0 at the terminal of the plant."""
        current = complex(self.P_start, -self.Q_start)
        voltage = 1.0 + complex(self.transformer.resistance, self.transformer.x) * current
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
