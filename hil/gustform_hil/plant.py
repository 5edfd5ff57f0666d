"""The simulated plant as a node of the bus: in each sample its measurements go out and the bridge's commands come in.

Before the first sample the plant stands still: the converter tells who it is and measures its steady state again and
again, until the bridge is ready, somebody presses start, and enabled references answer. From there on each period is
one sample: set points, measurements, Sync, and the references that answer to it.

GF8079 the bridge has left RUN   GF8082 the database and the controller do not fit
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_hil.client import Client, Command, Converter, ConverterState, Operator, References, State
from gustform_hil.decoding import key_of
from gustform_hil.faults import fault_names
from gustform_hil.message_set import Field, MessageSet, Part

Doubles = NDArray[np.float64]
_PATIENCE = 5.0  # s of wall time for an answer once it runs
_FIRST = 0.05  # s of wall time for an answer while nobody may be there yet
_AGAIN = 500  # periods between two presses of start that were not heard


class BusPlant:
    """Steps a sampled block over the bus. `step` runs in the simulation's thread, `stop` may be called from any."""

    def __init__(
        self,
        client: Client,
        measurements: Sequence[str],
        commands: Sequence[str],
        hold: Doubles,
        start: bool,
        check: Callable[[], None] | None = None,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        """`hold`: commands before the first answer; `start`: press the button as well; `check` raises where the bridge
        cannot answer any more; `say` is told what is being waited for. GF8082."""
        self.client = client
        self.converter = Converter(client)
        self._operator = Operator(client)
        self._start, self._check, self._say = start, check, say
        self._measurements, self._commands = list(measurements), list(commands)
        self._sent, self._set = split(client.codec.messages, measurements, commands)
        self._hold = np.array(hold, dtype=np.float64)
        self._last: tuple[dict[str, float], dict[str, float]] | None = None
        self._stopped = False
        self.first: int | None = None  # sample that is time 0
        self.cut = 0  # commands or measurements outside of the database's range

    def stop(self) -> None:
        """Hold the commands from now on and leave the bus alone."""
        self._stopped = True

    def step(self, now: float, measured: Doubles) -> Doubles:
        """One sample."""
        if self._stopped:
            return self._hold
        values = dict(zip(self._measurements, measured.tolist(), strict=True))
        sent = {name: values[name] for name in self._sent}
        points = {name: values[name] for name in self._set}
        self._last = sent, points
        if self.first is None:
            answer = self._shake_hands(sent, points)
            if answer is None:
                return self._hold
        else:
            sample = self.converter.tick(sent, points)
            answer = self.converter.answer(sample, self._check, _PATIENCE)
            self._check_enabled(answer, now)
        self._hold = np.array([answer.values[name] for name in self._commands])
        return self._hold

    def _shake_hands(self, sent: dict[str, float], points: dict[str, float]) -> References | None:
        """Periods in which the time of the plant stands still, until enabled references answer; None: stopped."""
        self._say("waiting for the bridge")
        told: State | None = None
        pressed = 0
        while not self._stopped:
            begin = time.monotonic()
            sample = self.converter.tick(sent, points)
            answer = self._listen(sample)
            if answer is not None and answer.enabled and answer.sample == sample % self.converter.answered:
                self.first = sample
                self.converter.announce(ConverterState.RUNNING)
                return answer
            state = self.client.heard.state
            if state != told:
                if told is None:
                    self.converter.introduce()  # the first time, the bridge may not have been there
                told = state
                self._say(_told(state, self.client.heard.faults, self._start))
            if self._start and state == State.READY and (pressed := pressed - 1) < 0:
                self._operator.press(Command.START)
                pressed = _AGAIN
            if not self._start or answer is None:  # nobody is in a hurry: the pace of a bus
                time.sleep(max(0.0, self.converter.period - (time.monotonic() - begin)))
        return None

    def _listen(self, sample: int) -> References | None:
        """The references of a period, or None while nobody answers."""
        deadline = time.monotonic() + _FIRST
        while (left := deadline - time.monotonic()) > 0.0:
            references = self.client.references(self.client.receive(left))
            if references is not None and references.sample == sample % self.converter.answered:
                return references
        if self._check is not None:
            self._check()
        return None

    def _check_enabled(self, answer: References, now: float) -> None:
        if answer.enabled:
            return
        for found in self.client.drain():  # its state is told right behind
            self.client.references(found)
        heard = self.client.heard
        names = ", ".join(fault_names(heard.faults)) or "no fault: an operator has stopped it"
        raise GustformError(
            "GF8079",
            f"the bridge has blocked its commands at {now:.3f} s, sample {answer.sample}; it tells: {names}",
            hint="a look at the log of the bus (--log); gust-bridge tells its faults on stdout",
        )

    def close(self) -> None:
        """The operator stops the controller and the converter switches off: the bridge is READY or SAFE after this."""
        if self._last is None:
            return
        self._operator.press(Command.STOP)
        self.converter.announce(ConverterState.READY)
        for _ in range(3):
            sample = self.converter.tick(*self._last)
            answer = self._listen(sample)
            if answer is None or not answer.enabled:
                return


def _told(state: State | None, faults: int, start: bool) -> str:
    if state == State.READY and not start:
        return "the bridge is READY; waiting for the operator's start (or --start)"
    if state == State.SAFE:
        return f"the bridge is SAFE ({', '.join(fault_names(faults))}); waiting for the operator's reset"
    return "waiting for the bridge" if state is None else f"the bridge is in {state.name}"


def split(messages: MessageSet, measurements: Sequence[str], commands: Sequence[str]) -> tuple[list[str], list[str]]:
    """What the controller reads, as measurements and as set points of the database. GF8082 if something is missing."""
    measured, points, commanded = (
        [key_of(s) for m in messages.pieces(part) for s in m.signals if s.field == Field.QUANTITY]
        for part in (Part.MEASUREMENTS, Part.SET_POINTS, Part.REFERENCES)
    )
    missing = [name for name in measurements if name not in measured and name not in points]
    missing += [name for name in commands if name not in commanded]
    if missing:
        raise GustformError(
            "GF8082",
            f"the database {messages.name} must have what the controller reads and commands; it lacks "
            + ", ".join(missing),
            hint="a mapping with these quantities (--dbc and --mapping)",
        )
    return [n for n in measurements if n in measured], [n for n in measurements if n not in measured]
