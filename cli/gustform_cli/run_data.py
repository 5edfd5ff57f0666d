"""A result file read back for figures: a few channels, thinned to what a figure can show."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.journalled_file import complete

if TYPE_CHECKING:
    import h5py

_MOST_POINTS = 3000  # along time: two for each of some 1500 pixels
_BLOCK_ROWS = 65_536


@dataclass(frozen=True)
class Curve:
    """One channel over time, (rows,) or (rows, instances)."""

    name: str
    unit: str
    description: str
    values: NDArray[np.float64]


class RunData:
    """An open result file; use as a context. GF7002 for a file that is none. `every_row`: not thinned."""

    def __init__(self, file: Path, *, every_row: bool = False) -> None:
        import h5py

        self.path = file
        complete(file)
        try:
            self._file = h5py.File(file, "r")
        except OSError as error:
            reason = error.strerror or str(error).split("(")[0].strip()
            raise _not_a_result(file, f"it cannot be opened: {reason}") from None
        if "time" not in self._file or "scenario" not in self._file.attrs:
            self._file.close()
            raise _not_a_result(file, "it has no time or no scenario")
        rows = self._file["time"].shape[0]
        if rows < 2:
            self._file.close()
            raise _not_a_result(file, f"it has {rows} rows")
        # Rows that two points stand for: their smallest and largest value, so that no peak is lost.
        self._bin = 2 * -(-rows // _MOST_POINTS) if rows > _MOST_POINTS and not every_row else 1
        self.time = self._read(self._file["time"])

    def __enter__(self) -> RunData:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def attribute(self, name: str) -> str:
        """A text attribute, "" if it is not there."""
        return str(self._file.attrs.get(name, ""))

    def json(self, name: str) -> Any:
        """An attribute that holds JSON, None if it is not there."""
        text = self.attribute(name)
        return json.loads(text) if text else None

    def names(self) -> list[str]:
        """All channels, in the order of the file."""
        import h5py

        data = {name: node for name, node in self._file.items() if isinstance(node, h5py.Dataset) and name != "time"}
        return [name for name, node in data.items() if "time" in _dimensions(node)]

    def curve(self, name: str) -> Curve:
        """A channel, every so many rows of it."""
        data = self._file[name]
        return Curve(name, str(data.attrs.get("units", "")), str(data.attrs.get("long_name", "")), self._read(data))

    def _read(self, data: h5py.Dataset) -> NDArray[np.float64]:
        # Block by block: the whole may be large.
        parts = []
        begin = 0
        while begin < data.shape[0]:
            block = data[begin : begin + _BLOCK_ROWS - _BLOCK_ROWS % self._bin]
            parts.append(_envelope(block, self._bin).astype(np.float64))
            begin += block.shape[0]
        return np.concatenate(parts)


def _envelope(block: NDArray[Any], rows: int) -> NDArray[Any]:
    """Two of every `rows` values along the first axis: the extremes, in the order in which they come.

    For times, which increase, these are the first and the last of the bin. What does not fill a bin is left out, but
    for the last value.
    """
    if rows == 1:
        return block
    whole = block.shape[0] // rows * rows
    bins = block[:whole].reshape(-1, rows, *block.shape[1:])
    low, high = bins.argmin(axis=1), bins.argmax(axis=1)
    places = np.stack([np.minimum(low, high), np.maximum(low, high)], axis=1)
    pairs = np.take_along_axis(bins, places, axis=1).reshape(-1, *block.shape[1:])
    return np.concatenate([pairs, block[-1:]]) if whole < block.shape[0] else pairs


def _dimensions(data: h5py.Dataset) -> list[str]:
    return [scale.name.lstrip("/") for dimension in data.dims for scale in dimension.values()]


def _not_a_result(file: Path, reason: str) -> GustformError:
    return GustformError(
        "GF7002",
        f"{str(file)!r} must be a result of gustform with rows in it; {reason}",
        hint="the result.nc of a run",
    )
