"""Recorded test vectors: a deterministic sequence of inputs, and what the controller gives, computed by CasADi."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gustform_codegen.emit.controller.program import Evaluator, Program

Array = NDArray[np.float64]

_SEED = 20220915
_HOLD = 25  # samples between jumps
_SMALL, _LARGE = 0.03, 0.5  # deviations from the start value, of the nominal one; one jump in five is large


def input_sequence(program: Program, n: int, seed: int = _SEED) -> Array:
    """n samples of all inputs: jumps, a slow swing and noise, within the ranges, representable in float."""
    rng = np.random.default_rng(seed)
    inputs = program.step.block.inputs
    time = np.arange(n)
    result = np.zeros((n, len(inputs)))
    for k, s in enumerate(inputs):
        jumps = rng.random((n + _HOLD - 1) // _HOLD) * 2.0 - 1.0
        size = np.where(rng.random(jumps.size) < 0.2, _LARGE, _SMALL)
        level = np.repeat(jumps * size, _HOLD)[:n]
        swing = _SMALL * np.sin(2.0 * np.pi * time * (k + 1.0) / 300.0)
        noise = 0.1 * _SMALL * (rng.random(n) - 0.5)
        value = s.value + s.nominal * (level + swing + noise)
        result[:, k] = np.clip(value, s.low, s.high)
    return result.astype(np.float32).astype(np.float64)


def recorded(program: Program, n: int) -> tuple[Array, Array]:
    """Inputs and the outputs that follow from startup on."""
    inputs = input_sequence(program, n)
    evaluator = Evaluator(program)
    return inputs, np.array([evaluator.step(row)[0] for row in inputs])
