"""`gustform hil pil`: exported controllers on emulated Cortex-M boards, over what a simulation measured."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from gustform_cli.export import block_of_scenario, controls
from gustform_cli.hil.record import recorded_inputs
from gustform_codegen.emit.controller.discretise import discretise
from gustform_codegen.emit.controller.folder import default_prefix
from gustform_codegen.emit.controller.program import program
from gustform_hil.pil import MACHINES, Measured, processor_in_the_loop, require

SCENARIO = Path(__file__).parents[1] / "scenarios" / "load_step_8ms.yaml"
PERIOD = 1e-3  # s


def pil(
    scenario: Path, turbine: str, names: Sequence[str], begin: float, samples: int, overrides: Sequence[str]
) -> list[Measured]:
    """Every control in float and double on every board, fed with what it read in the scenario from `begin` on."""
    require()
    found: list[Measured] = []
    for name in names or list(controls()):
        chosen = [*overrides, f"components.{turbine}.control={{type: {name}}}"]
        block = block_of_scenario(turbine, scenario, chosen)
        inputs = recorded_inputs(scenario, chosen, turbine, block, PERIOD, begin, samples)
        made = program(discretise(block, PERIOD))
        print(f"{name}: {len(inputs)} samples", file=sys.stderr)
        found += processor_in_the_loop(made, default_prefix(name), inputs, list(MACHINES))
    return found


def as_text(found: Sequence[Measured]) -> str:
    """A table; bytes where nothing else is said."""
    heads = ("instructions", "min", "max", "text", "linked", "data", "bss", "context", "frame", "chain", "stack")
    first = f"{'control':<26}{'board':<12}{'real':<8}{'samples':>8}{'bits':>8}{heads[0]:>13}"
    lines = [first + "".join(f"{h:>8}" for h in heads[1:])]
    for m in found:
        sizes = (m.text, m.linked, m.data, m.bss, m.context, m.frame, m.chain, m.stack)
        numbers = (m.instructions_min, m.instructions_max, *sizes)
        lines.append(
            f"{m.control:<26}{m.board:<12}{m.real:<8}{m.samples:>8}{'equal' if m.equal else 'DIFFER':>8}"
            f"{m.instructions_mean:>13.1f}" + "".join(f"{n:>8}" for n in numbers)
        )
    return "\n".join(lines)


def as_json(found: Sequence[Measured]) -> str:
    """The same as data."""
    return json.dumps([asdict(m) for m in found], indent=2)
