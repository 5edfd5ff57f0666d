"""A bench without a plant: a converter that measures the same each period, an operator, and a bridge on the sync clock.

What it is for is the bridge itself: faults, states, what is sent when. Each tick is one period of bus time, so what
happens is the same on every run, however busy the machine is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gustform.language.errors import GustformError
from gustform_hil.client import (
    Client,
    Command,
    Converter,
    ConverterState,
    Frame,
    Operator,
    References,
    State,
    Values,
)
from gustform_hil.message_set import Field, Part, Signal

PATIENCE = 10.0  # s of wall time for an answer: longer than any pause of this computer
QUIET = 20  # periods without a fault before the bridge may leave INIT or SAFE; gust_limits
_MOST = 400  # periods to wait for a state
_CLOSE = 1e-6  # float32, relative


@dataclass(frozen=True)
class Tick:
    """A period: the number of its sample, and the references that the bridge sent in it, None if none."""

    sample: int
    references: References | None


class Bench:
    """Drives a bridge period by period. `check` is called when the bridge is silent, to say why."""

    def __init__(
        self,
        client: Client,
        measurements: Values,
        set_points: Values,
        check: Callable[[], None] | None = None,
        patience: float = PATIENCE,
    ) -> None:
        self.client = client
        self.converter = Converter(client)
        self.operator = Operator(client)
        self.measurements, self.set_points = dict(measurements), dict(set_points)
        self.check = check
        self.patience = patience  # s of wall time for an answer
        self.measured: list[Frame] = []
        self.violations: list[str] = []  # commands that must not have been sent
        self._limits = {
            signal.quantity: signal
            for message in client.codec.messages.pieces(Part.REFERENCES)
            for signal in message.signals
            if signal.field == Field.QUANTITY
        }

    @property
    def first(self) -> Signal:
        """The first signal of the measurements that is a quantity."""
        pieces = self.client.codec.messages.pieces(Part.MEASUREMENTS)
        return next(s for m in pieces for s in m.signals if s.field == Field.QUANTITY)

    def tick(self, send: Callable[[Bench], None] | None = None) -> Tick:
        """One period, with `send` in place of the measurements."""
        self.converter.cyclic()
        self.converter.set_points(self.set_points)
        if send is None:
            self.client.put(self.measure())
        else:
            send(self)
        sample = self.converter.sync()
        references = self._await()
        if references is not None:
            self._inspect(sample, references)
        return Tick(sample, references)

    def measure(self) -> list[Frame]:
        """The measurements of this period, not sent yet; `measured` keeps them."""
        values = {**self.measurements, "sample": self.converter.sample}
        self.measured = self.client.frames(Part.MEASUREMENTS, values)
        return self.measured

    def _await(self) -> References | None:
        """The references of this period; what else has come in before them is taken note of."""
        while (found := self.client.receive(self.patience)) is not None:
            references = self.client.references(found)
            if references is not None:
                return references
        if self.check is not None:
            self.check()
        return None

    def _inspect(self, sample: int, references: References) -> None:
        """Range and age of what was sent: true of every frame, whatever happens."""
        for name, value in references.values.items():
            signal = self._limits[name]
            if not signal.low <= value <= signal.high:
                self.violations.append(f"sample {sample}: {name} = {value:g} is out of range")
            half = 0.5 * signal.scale if not signal.real else _CLOSE * max(1.0, abs(signal.safe))
            if not references.enabled and abs(value - signal.safe) > half:
                self.violations.append(f"sample {sample}: {name} = {value:g} while blocked, safe is {signal.safe:g}")

    def age(self, tick: Tick) -> int:
        """Periods between the sample of a tick and the one that its references answer."""
        assert tick.references is not None
        modulus = self.converter.answered
        age = (tick.sample - tick.references.sample) % modulus
        return age if age <= modulus // 2 else age - modulus

    def ticks(self, number: int) -> Tick:
        """Some ordinary periods; the last of them."""
        tick = self.tick()
        for _ in range(number - 1):
            tick = self.tick()
        return tick

    @property
    def state(self) -> State | None:
        """What the bridge has told last."""
        return self.client.heard.state

    def until(self, state: State, most: int = _MOST) -> int:
        """Ordinary periods until the bridge is in a state; how many it took. GF8077."""
        for number in range(most):
            if self.state == state:
                return number
            self.tick()
        faults = self.client.heard.faults
        shown = "nothing" if self.state is None else self.state.name
        raise GustformError(
            "GF8077",
            f"the bridge must come to {state.name}; after {most} periods it says {shown}, faults {faults:#x}",
            hint="gust-bridge --clock sync with the same database; gustform hil build",
        )

    def run(self) -> None:
        """From wherever it is to RUN: reset if need be, then start."""
        if self.state is None:
            self.ticks(2)
            self.converter.introduce()  # the first time, the bridge may not have been there
        if self.state == State.SAFE:
            self.reset()
        if self.state != State.RUN:
            self.until(State.READY)
            self.operator.press(Command.START)
            self.until(State.RUN)
        self.converter.announce(ConverterState.RUNNING)
        self.ticks(3)

    def reset(self) -> None:
        """Out of SAFE, as an operator does it: wait until the cause is gone, press reset."""
        self.converter.announce(ConverterState.READY)
        self.converter.introduce()
        self.ticks(QUIET + 2)
        self.operator.press(Command.RESET)
        self.until(State.READY)
