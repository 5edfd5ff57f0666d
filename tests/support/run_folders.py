"""Folders as `gustform simulate` leaves them, made without a run: a result with chosen names, texts and values."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

SCENARIO = """name: Test
components:
  bus: {type: Bus, voltage: 33 kV}
  wt: {type: PmsgTurbine, at: bus, aggregate: 10, curtailment: 10 %, control: {type: DualPort, K_p: 5}}
wind:
  wt: {type: constant, speed: 8 m/s}
run: {until: 10 s, rtol: 1e-6}
"""


def write_result(
    file: Path,
    time: NDArray[np.float64],
    channels: Mapping[str, tuple[str, NDArray[np.float64]]],
    texts: Mapping[str, str] | None = None,
) -> Path:
    """A result file: `channels` are name: (unit, values), values over time or over time and instances."""
    attributes = {"title": "Test", "description": "", "scenario": SCENARIO, "scenario_file": "test.yaml",
                  "events": "[]", "frequency_channel": "", "versions": "{}", "status": "completed"}  # fmt: skip
    with h5py.File(file, "w", track_order=True) as result:
        for name, text in {**attributes, **(texts or {})}.items():
            result.attrs[name] = text
        scale = result.create_dataset("time", data=time)
        scale.make_scale("time")
        for name, (unit, values) in channels.items():
            data = result.create_dataset(name, data=values.astype(np.float32))
            data.attrs["units"], data.attrs["long_name"] = unit, f"what {name} is"
            data.dims[0].attach_scale(scale)
            if values.ndim > 1:
                result[f"{name} number"] = np.arange(values.shape[1])
                result[f"{name} number"].make_scale(f"{name} number")
                data.dims[1].attach_scale(result[f"{name} number"])
    return file


def write_summary(folder: Path, **changes: Any) -> dict[str, Any]:
    """A summary.json as of a run of ten seconds."""
    summary = {
        "status": "completed", "simulated_seconds": 10.0, "wall_seconds": 0.02, "real_time_factor": 500.0,
        "build_seconds": 1.25, "compiled_types": 0, "unknowns": 24, "steps": 1026, "residual_evaluations": 1154,
        "jacobian_evaluations": 74, "factorisations": 2, "error_test_failures": 12, **changes,
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))
    return summary
