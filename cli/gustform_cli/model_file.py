"""The model file: a linked system at its steady state, for `gust-run` and other hosts without Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gustform.language.errors import GustformError
from gustform_cli.model import Model
from gustform_codegen.initial import steady_state
from gustform_codegen.table import SeriesTable

_BLOCK = 8192


def write_model(model: Model, file: Path) -> Path:
    """Write the system table with start values, channels and all series up to the end of the run.

    Series that are made or read while running are written out as samples here, so that no reader is needed. The
    kernels stay where they are, in the cache; the file names them. GF7001 if it cannot be written.
    """
    scenario, readers = model.assembled.scenario, model.assembled.readers
    table = steady_state(model.built.linked).table.with_channels(model.channels)
    series = [
        _with_samples(one, readers[one.name], scenario.run.until) if one.name in readers else one
        for one in table.series
    ]
    data = replace(table, series=series).with_metadata({"scenario": model.assembled.document.text()}).to_bytes()
    part = file.with_name(file.name + ".part")
    try:
        part.write_bytes(data)
        part.replace(file)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise GustformError(
            "GF7001", f"the model file {str(file)!r} cannot be written; {error.strerror}", hint="a folder of yours"
        ) from None
    return file


def _with_samples(series: SeriesTable, reader: object, until: float) -> SeriesTable:
    """The series with every sample up to the first one after `until`."""
    assert callable(reader)
    times, values, first = [], [], 0
    while True:
        time, value = reader(first, _BLOCK)
        times.append(np.asarray(time, dtype=np.float64).copy())
        values.append(np.asarray(value, dtype=np.float64).copy())
        first += values[-1].size
        if values[-1].size < _BLOCK or times[-1][-1] > until:
            break
    time, value = np.concatenate(times), np.concatenate(values)
    kept = int(np.searchsorted(time, until, side="right")) + 1
    # What comes after the run is cut off, so beyond the last sample the last value holds.
    return replace(series, source=0, time=None if series.time is None else time[:kept], value=value[:kept], on_end=1)
