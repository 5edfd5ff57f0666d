"""What the sampled controllers of a run had to say."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gustform_codegen.emit.controller.c_header import ERRORS

if TYPE_CHECKING:
    from gustform_runtime import Simulation

_MOST = 8  # turbines that are named


def controller_warnings(simulation: Simulation) -> list[str]:
    """A line for each turbine whose sampled controller raised its error signal."""
    lines = []
    for number, block in enumerate(simulation.sampled_blocks()):
        count = simulation.sampled_statistics(number)
        if not count.bad_samples:
            continue
        signals = [
            f"{name} in {samples}: {text}"
            for (name, text), samples in zip(ERRORS, count.errors, strict=False)
            if samples
        ]
        lines.append(
            f"{block.name}: the sampled controller raised its error signal in {count.bad_samples} of {count.samples} "
            f"samples, first at {count.first_error:.6g} s ({'; '.join(signals)})"
        )
    if len(lines) > _MOST:
        lines[_MOST:] = [f"and {len(lines) - _MOST} more sampled controllers raised their error signals"]
    return lines
