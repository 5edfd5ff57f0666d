"""What a control reads in a simulation, sample by sample."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from gustform_cli.interrupt import Interrupt
from gustform_cli.simulate import simulate
from gustform_codegen.emit.controller.block import Block

# Where a turbine has what the control reads under another name: of its own or of a part.
_ELSEWHERE = {"omega_del": "schedule.omega_del", "beta_del": "schedule.beta_del"}


def recorded_inputs(
    scenario: Path, overrides: Sequence[str], turbine: str, block: Block, period: float, begin: float, samples: int
) -> NDArray[np.float64]:
    """Inputs of a turbine's controller in closed loop with it, one row for each period from `begin` on."""
    channels = [f"{turbine}.{_ELSEWHERE.get(s.name, s.name)}" for s in block.inputs]
    run = [
        f"run.until={begin + samples * period!r} s",
        "run.rtol=1e-8",
        f"output.every={period!r} s",
        f"output.channels=[{', '.join(dict.fromkeys(channels))}]",
    ]
    with tempfile.TemporaryDirectory(prefix="gustform-record-") as folder, Interrupt() as interrupt:
        outcome = simulate(scenario, Path(folder), [*overrides, *run], interrupt, figure=False)
        if outcome.error is not None:
            raise outcome.error
        with xr.open_dataset(outcome.result, engine="h5netcdf") as data:
            first = round(begin / period)
            rows = [data[name].values[first : first + samples] for name in channels]
    return np.column_stack(rows).astype(np.float64)
