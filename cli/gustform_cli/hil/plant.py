"""`gustform hil plant`: the plant of a scenario on the bus, its controller behind a bridge.

The turbine's control must be sampled. Where the scenario does not say so, its period is taken from the database and
its commands act one sample after the measurements, which is what a bus does.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gustform.language.errors import GustformError
from gustform_cli.design import only_turbine
from gustform_cli.interrupt import Interrupt
from gustform_cli.model import load
from gustform_cli.simulate import Outcome, simulate
from gustform_hil.bus import Bus, check_interface
from gustform_hil.client import Client
from gustform_hil.codec import Codec
from gustform_hil.database import load_message_set, shipped
from gustform_hil.log import Log
from gustform_hil.message_set import MessageSet, Part
from gustform_hil.plant import BusPlant

if TYPE_CHECKING:
    from gustform_runtime import Simulation


def message_set(bus: str, dbc: Path | None, mapping: Path | None) -> MessageSet:
    """The shipped one for "fd" or "classic", or that of two files. GF8083."""
    if (dbc is None) != (mapping is None):
        raise GustformError(
            "GF8083", "a database of your own needs its mapping, and the reverse", hint="--dbc FILE --mapping FILE"
        )
    return shipped(bus) if dbc is None or mapping is None else load_message_set(dbc, mapping)


class OnBus:
    """Puts the bus in the place of one sampled controller of a run."""

    def __init__(self, client: Client, turbine: str, start: bool) -> None:
        self._client, self._turbine, self._start = client, turbine, start
        self.plant: BusPlant | None = None
        self._stopped = False

    def attach(self, simulation: Simulation) -> None:
        blocks = simulation.sampled_blocks()
        number = [block.name for block in blocks].index(self._turbine)
        block = blocks[number]
        self.plant = BusPlant(
            self._client, list(block.measurements), list(block.commands), block.start, self._start, say=_say
        )
        if self._stopped:
            self.plant.stop()
        simulation.set_sampled(number, self.plant.step)

    def stop(self) -> None:
        self._stopped = True
        if self.plant is not None:
            self.plant.stop()

    def detach(self) -> None:
        """Leave the bridge in a state in which it commands nothing, before it misses the next sample."""
        if self.plant is not None:
            with suppress(GustformError):  # a bus that is gone: the bridge knows, and why the run ended is said already
                self.plant.close()


def plant(
    scenario: Path,
    out: Path,
    overrides: Sequence[str],
    interrupt: Interrupt,
    messages: MessageSet,
    interface: str,
    *,
    turbine: str | None = None,
    log: Path | None = None,
    start: bool = False,
    figure: bool = True,
) -> Outcome:
    """Run it; as `simulate`, with the bus in the place of the controller."""
    fd = any(message.fd for message in messages.messages)
    check_interface(interface, fd=fd)
    name, settings = sampled(scenario, overrides, messages, turbine)
    with ExitStack() as stack:
        heard = [m.id for m in messages.messages if m.part in _HEARD]
        bus = stack.enter_context(Bus(interface, fd=fd, only=heard if log is None else None))
        if log is not None:
            bus.taps.append(stack.enter_context(Log(log)))
        on_bus = OnBus(Client(bus, Codec(messages)), name, start)
        return simulate(scenario, out, settings, interrupt, figure=figure, attached=on_bus)


_HEARD = frozenset({Part.REFERENCES, Part.CONTROLLER_STATE, Part.CONTROLLER_HEARTBEAT, Part.CONTROLLER_FINGERPRINT})


def sampled(
    scenario: Path, overrides: Sequence[str], messages: MessageSet, turbine: str | None
) -> tuple[str, list[str]]:
    """The turbine whose controller is on the bus, and the settings that make it sampled. GF8084."""
    found = only_turbine(load(scenario, overrides), scenario, turbine)
    period = messages.pieces(Part.SYNC)[0].cycle * 1e-6
    control = found.component.control
    kept = float(control.sampled)
    if kept == 0.0:
        base = found.name.partition("[")[0]
        added = [f"{base}.control.sampled={period:g}s", f"{base}.control.delay=1"]
        print(f"the control of {base} is sampled each {period * 1e3:g} ms, one sample late", file=sys.stderr)
        return found.name, [*overrides, *added]
    if abs(kept - period) > 1e-9 * period:
        raise GustformError(
            "GF8084",
            f"{found.name}.control.sampled must be the period of the database, {period:g} s; got {kept:g} s",
            hint=f"--set {found.name}.control.sampled={period:g}s",
        )
    return found.name, list(overrides)


def _say(text: str) -> None:
    print(f"plant: {text}", file=sys.stderr, flush=True)
