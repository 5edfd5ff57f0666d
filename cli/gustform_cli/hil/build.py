"""`gustform hil build`: the control of a scenario's turbine, a message set and the bridge as one folder, compiled."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_cli.design import find_turbine
from gustform_cli.export import block_of_scenario, sample_period
from gustform_cli.hil import budget as budgets
from gustform_codegen.emit.controller.discretise import discretise
from gustform_codegen.emit.controller.folder import default_prefix
from gustform_codegen.emit.controller.program import program
from gustform_hil.budget import Budget, refuse
from gustform_hil.database import load_message_set, shipped_files
from gustform_hil.message_set import MessageSet, Part
from gustform_hil.rig import Rig, check_target, compile_rig, period, write_rig


@dataclass(frozen=True)
class Built:
    """A rig that has been written; `program` is its bridge, if it has been compiled."""

    rig: Rig
    folder: Path
    program: Path | None


@dataclass(frozen=True)
class Options:
    """What the command line may change; `bus` counts where no database is given."""

    turbine: str | None = None
    bus: str = "fd"
    dbc: Path | None = None
    mapping: Path | None = None
    period: str | None = None
    bitrate: str | None = None
    data_bitrate: str | None = None
    allow_overload: bool = False
    compile: bool = True
    overrides: Sequence[str] = ()


def build(scenario: Path, out: Path, options: Options | None = None) -> Built:
    """Write the folder and compile it. Everything that can be refused is, before anything is written."""
    given = options or Options()
    check_target(out)
    database, mapping = _files(given)
    messages = load_message_set(database, mapping)
    if not given.allow_overload:
        refuse(_budget(given, database, mapping, messages))
    seconds = period(messages) if given.period is None else sample_period(given.period)
    name = find_turbine(scenario, given.turbine).name
    block = block_of_scenario(name, scenario, given.overrides)
    made = program(discretise(block, seconds))
    origin = {
        "scenario": scenario.name,
        "scenario_sha256": sha256(scenario.read_bytes()).hexdigest(),
        "set": list(given.overrides),
        "turbine": name,
    }
    rig = Rig(made, default_prefix(block.name), messages, database, mapping, origin)
    write_rig(rig, out)
    return Built(rig, out, compile_rig(out) if given.compile else None)


def _budget(given: Options, database: Path, mapping: Path, messages: MessageSet) -> Budget:
    """The bridge is a program on Linux: its interface has a plain queue."""
    references = messages.find(Part.REFERENCES)
    senders = () if references is None else references.senders[:1]
    return budgets.budget_of(
        budgets.Request(
            dbc=database, mapping=mapping, bitrate=given.bitrate, data_bitrate=given.data_bitrate, fifo=senders
        )
    )


def _files(given: Options) -> tuple[Path, Path]:
    if given.dbc is None and given.mapping is None:
        return shipped_files(given.bus)
    if given.dbc is None or given.mapping is None:
        raise GustformError(
            "GF8135", "a database of your own needs its mapping, and a mapping its database", hint="--dbc F --mapping F"
        )
    return given.dbc, given.mapping


def as_text(built: Built) -> str:
    """What to print: the program, or where there is none the folder."""
    return str(built.program or built.folder)


def as_json(built: Built) -> str:
    """What the rig was made from, and where its program is."""
    program = None if built.program is None else str(built.program)
    return json.dumps({"folder": str(built.folder), "program": program, **built.rig.description}, indent=2)
