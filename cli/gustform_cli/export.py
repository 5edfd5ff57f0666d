"""Export a control as a folder of C: which one, with which parameters, at which period."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from gustform.control.converter_control import ConverterControl
from gustform.language.component import suggest
from gustform.language.errors import GustformError
from gustform.registry import PARTS
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.emit.controller.block import Block, controller_block
from gustform_codegen.emit.controller.discretise import Method, discretise
from gustform_codegen.emit.controller.folder import default_prefix, write_folder
from gustform_codegen.emit.controller.footprint import as_json, as_text, footprint, targets
from gustform_codegen.emit.controller.frequency import as_csv, frequency_response
from gustform_codegen.emit.controller.frequency import as_text as differences
from gustform_codegen.emit.controller.program import Program, program
from gustform_codegen.sampled_start import rounded

_LONGEST = 1.0  # s; a longer period is a slip of the unit


def controls() -> dict[str, type[ConverterControl]]:
    """The controls that a scenario may name."""
    return {name: part.kind for name, part in PARTS.items() if issubclass(part.kind, ConverterControl)}


def export_controller(
    name: str,
    scenario: Path | None,
    out: Path,
    *,
    double: bool,
    period: str,
    prefix: str | None,
    method: str,
    overrides: Sequence[str],
    report: bool,
    schedule: bool | None = None,
) -> str:
    """Write the folder; returns what to print: with `report` the table of differences, the memory needed, the path."""
    h = sample_period(period)
    if scenario is None:
        if overrides:
            raise GustformError("GF2070", "--set changes a scenario, and none is given", hint="NAME SCENARIO.yaml")
        block = default_block(name)
    else:
        block = block_of_scenario(name, scenario, overrides, schedule=schedule)
    made = program(discretise(block, h, Method(method)))
    known_as = default_prefix(block.name) if prefix is None else prefix
    write_folder(made, known_as, double, out)
    memory = _memory(made, known_as, double, out)
    if not report:
        return f"{memory}{out}"
    pairs = frequency_response(made.step)
    (out / "frequency.csv").write_text(as_csv(pairs), encoding="utf-8", newline="\n")
    return f"{differences(made.step, pairs)}\n{memory}{out}"


def _memory(made: Program, prefix: str, double: bool, out: Path) -> str:
    """What the compilers here make of it, as text. footprint.json has it too, the one file that depends on them."""
    file = out / "footprint.json"
    file.unlink(missing_ok=True)
    found, failed = [], []
    for target in targets():
        try:
            found.append(footprint(made, prefix, double, out, target))
        except GustformError as error:
            failed.append(f"{target.name}: not measured: {error.message}\n")
    if not found:
        return "".join(failed) or "no C compiler here: stack and sizes not measured\n"
    file.write_text(as_json(found), encoding="utf-8", newline="\n")
    return as_text(found) + "".join(failed)


def sample_period(text: str) -> float:
    """Seconds of --period: s unless a unit is given. GF2070."""
    from gustform_cli.quantity import parse_quantity

    try:
        seconds = float(text)
    except ValueError:
        seconds = parse_quantity(text, "s", "--period", "sample period")
    if not (math.isfinite(seconds) and 0.0 < seconds <= _LONGEST):
        raise GustformError(
            "GF2070", f"--period must be above 0 and at most {_LONGEST:g} s; got {text}", hint="--period 1e-3"
        )
    return seconds


def default_block(name: str) -> Block:
    """A control with the parameters of the default turbine. GF2070."""
    known = controls()
    if name not in known:
        raise GustformError(
            "GF2070", f"{name!r} must be a control of a turbine: {', '.join(known)}", hint=suggest(name, list(known))
        )
    turbine = PmsgTurbine(control=known[name]())
    return controller_block(turbine.control, turbine.pitch)


def block_of_scenario(name: str, scenario: Path, overrides: Sequence[str], *, schedule: bool | None = None) -> Block:
    """The control of a turbine of a scenario, with the set points and states of its steady state. GF2047.

    Where its operating point comes from a CurtailmentSchedule, that is part of it, or what it gives is an input: as its
    `location` says, unless `schedule` is given.
    """
    from gustform_cli.design import only_turbine
    from gustform_cli.model import link, load, placed, print_warnings
    from gustform_codegen.initial import steady_state
    from gustform_codegen.sampled import continuous, schedule_of

    assembled = load(scenario, overrides)
    print_warnings(assembled)
    assembled.system = continuous(assembled.system)
    found = only_turbine(assembled, scenario, name)
    linked = link(assembled).built.linked
    try:
        state = steady_state(linked)
    except GustformError as error:
        raise placed(error, assembled) from None
    values = {
        key.removeprefix(f"{found.name}."): v for key, v in state.free.items() if key.startswith(f"{found.name}.")
    }
    for t in linked.types:
        if found.name in t.names:
            first = int(t.table.first_unknown[t.names.index(found.name)])
            at = {u.path: float(state.table.start[first + k]) for k, u in enumerate(t.unit.unknowns)}
            values |= at
            values |= {alias: sign * at[path] for alias, (path, sign) in t.unit.aliases.items() if path in at}
    values = {key: rounded(v) for key, v in values.items()}
    turbine = found.component
    return controller_block(turbine.control, turbine.pitch, values, schedule_of(turbine, schedule))
