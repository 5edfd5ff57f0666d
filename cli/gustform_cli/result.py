"""The result file: netCDF-4 (HDF5) written in blocks while the run goes on.

Every channel is a variable over `time` with its unit and sentence; those of a component that stands there several
times (`count`) share one variable over time and the component's number. The file is called result.nc.part until the
run is over, completed or not, and is whole at any moment (journalled_file.py): what a killed run leaves can be opened
and plotted.

The time dimension has an upper bound (the rows the run can give) instead of none: for unlimited dimensions h5netcdf
asks all variables for their length, each time anybody asks one, which takes 40 s with 300 variables.
"""

from __future__ import annotations

import errno
import functools
import json
import os
import re
import tempfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.journalled_file import JournalledFile

if TYPE_CHECKING:
    import h5py

RESULT = "result.nc"
PARTIAL = f"{RESULT}.part"

_ROOM = 256 << 10  # bytes beyond a block, for what HDF5 keeps beside it and for closing the file
_ROOM_OF_ONE = 8 << 10  # bytes for each variable: a page of its directory, in the journal and in the file
_COMPRESSED_FROM = 16 << 20  # bytes; below, the time is worth more than the space

_INSTANCE = re.compile(r"(?P<component>[^.\[]+)\[(?P<number>\d+)\](?P<rest>\..*)")


@dataclass(frozen=True)
class Quantity:
    """What is recorded: name, unit and sentence of one column of the rows."""

    name: str
    unit: str
    description: str


@dataclass(frozen=True)
class _Variable:
    """One variable of the file and the columns it takes, several if it has a dimension of its own."""

    quantity: Quantity
    columns: NDArray[np.intp]
    dimension: str | None


def arrange(quantities: Sequence[Quantity], counts: Mapping[str, int]) -> list[_Variable]:
    """Variables for the columns. wt[1].x ... wt[n].x become wt.x over the dimension wt when all n are there."""
    groups: dict[tuple[str, str], dict[int, int]] = {}
    for column, quantity in enumerate(quantities):
        if match := _INSTANCE.fullmatch(quantity.name):
            groups.setdefault((match["component"], match["rest"]), {})[int(match["number"])] = column
    whole = {
        f"{component}{rest}": (component, columns)
        for (component, rest), columns in groups.items()
        if len(columns) == counts.get(component)
    }
    result: list[_Variable] = []
    done: set[str] = set()
    for column, quantity in enumerate(quantities):
        match = _INSTANCE.fullmatch(quantity.name)
        shared = f"{match['component']}{match['rest']}" if match else ""
        if shared not in whole:
            result.append(_Variable(quantity, np.array([column]), None))
        elif shared not in done:
            done.add(shared)
            component, columns = whole[shared]
            joined = Quantity(shared, quantity.unit, quantity.description)
            result.append(_Variable(joined, np.array([columns[n] for n in sorted(columns)]), component))
    return result


def prepare_folder(folder: Path) -> None:
    """Make the folder and see that files can be written into it. GF7001 before anything in it is touched."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise GustformError(
            "GF7001",
            f"the result folder {str(folder)!r} must be writable; {error.strerror or error}",
            hint="--out with another folder",
        ) from None


class ResultWriter:
    """Writes one result file. `append` may run in another thread than the rest, one at a time."""

    def __init__(
        self,
        folder: Path,
        quantities: Sequence[Quantity],
        counts: Mapping[str, int],
        most_rows: int,
        block_rows: int,
        attributes: Mapping[str, str],
        name: str = RESULT,
        precision: str = "float32",
        part: str | None = None,
        closing: int = 0,
    ) -> None:
        import h5py  # 0.2 s: not for `gustform --help`

        self.path = folder / (part or f"{name}.part")
        self.rows = 0
        self._final = folder / name
        self._variables = arrange(quantities, counts)
        self._room = _ROOM + _ROOM_OF_ONE * len(self._variables) + closing
        # A block is a chunk: it is written once, and HDF5 has nothing to keep that would grow with the run.
        self._chunk_rows = min(block_rows, most_rows)
        self._type = np.dtype(precision)
        self._compressed = self._type.itemsize * most_rows * len(quantities) > _COMPRESSED_FROM
        widest = max((v.columns.size for v in self._variables), default=1)
        try:
            self._disk = JournalledFile(self.path)
        except OSError as error:
            raise _not_written(self.path, error) from None
        try:
            self._look_for_room(0)
            self._file = h5py.File(self._disk, "w", track_order=True, rdcc_nbytes=8 * self._chunk_rows * widest)
            self._create(attributes, most_rows)
        except (OSError, GustformError) as error:
            self.path.unlink(missing_ok=True)
            raise (_not_written(self.path, error) if isinstance(error, OSError) else error) from None

    def _create(self, attributes: Mapping[str, str], most_rows: int) -> None:
        for name, text in {"Conventions": "CF-1.10", **attributes, "status": "running"}.items():
            self._file.attrs[name] = text
        self._time = self._scale("time", np.empty(0), most_rows)
        _describe(self._time, "s", "simulated time")
        numbers: dict[str, h5py.Dataset] = {}
        self._datasets: list[h5py.Dataset] = []
        for variable in self._variables:
            dimension, size = variable.dimension, variable.columns.size
            if dimension is not None and dimension not in numbers:
                numbers[dimension] = self._scale(dimension, np.arange(1, size + 1, dtype=np.int32), size)
                numbers[dimension].attrs["long_name"] = f"number of the {dimension}"
            tail = () if dimension is None else (size,)
            dataset = self._file.create_dataset(
                variable.quantity.name,
                (0, *tail),
                self._type,
                maxshape=(most_rows, *tail),
                chunks=(self._chunk_rows, *tail),
                compression="gzip" if self._compressed else None,
                compression_opts=1 if self._compressed else None,
                shuffle=self._compressed,
            )
            _describe(dataset, variable.quantity.unit, variable.quantity.description)
            dataset.dims[0].attach_scale(self._time)
            if dimension is not None:
                dataset.dims[1].attach_scale(numbers[dimension])
            self._datasets.append(dataset)
        self._commit()

    def _scale(self, name: str, values: NDArray[Any], most: int) -> h5py.Dataset:
        """A dimension with its coordinate variable."""
        scale = self._file.create_dataset(
            name, values.shape, values.dtype, data=values, maxshape=(most,), chunks=(min(most, self._chunk_rows),)
        )
        scale.make_scale(name)
        return scale

    def append(self, times: NDArray[np.float64], rows: NDArray[Any]) -> None:
        """Write a block, rows x columns, and see it to the disk. GF7001 when it cannot be (the disk is full)."""
        end = self.rows + times.size
        self._look_for_room(times.size)
        try:
            self._write(self._time, times, compressed=False)
            for variable, dataset in zip(self._variables, self._datasets, strict=True):
                block = rows[:, variable.columns] if variable.dimension else rows[:, variable.columns[0]]
                self._write(dataset, block, self._compressed)
            self._commit()
        except OSError as error:
            raise _not_written(self.path, error) from None
        self.rows = end

    def _commit(self) -> None:
        """What there is now is what a killed run leaves."""
        self._file.flush()
        self._disk.commit()

    def _look_for_room(self, rows: int) -> None:
        """GF7001 if the disk has no room for a block and for closing the file after it.

        HDF5 cannot go on, nor even close a file, once a write of its own has failed; so it is not let run into that.
        """
        columns = sum(variable.columns.size for variable in self._variables)
        wanted = rows * (8 + columns * self._type.itemsize) + self._room
        try:
            with self.path.open("r+b") as file:
                size = file.seek(0, os.SEEK_END)
                try:
                    os.posix_fallocate(file.fileno(), size, wanted)
                finally:
                    file.truncate(size)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                raise _not_written(self.path, error) from None  # others: there is no asking on such a file system

    def _write(self, dataset: h5py.Dataset, block: NDArray[Any], compressed: bool) -> None:
        """Add a block to one variable. Whole chunks go past HDF5's selection machinery and its filters, which would
        take ten times as long as the writing itself."""
        end = self.rows + block.shape[0]
        dataset.id.set_extent((end, *dataset.shape[1:]))
        if self.rows % self._chunk_rows or block.shape[0] > self._chunk_rows:
            dataset[self.rows : end] = block
            return
        chunk = np.zeros(dataset.chunks, dataset.dtype)  # the last one is shorter; what lies beyond the end is not read
        chunk[: block.shape[0]] = block
        data = chunk.tobytes()
        if compressed:  # as HDF5's shuffle and gzip do it: first bytes of all values, second bytes, ...
            shuffled = np.frombuffer(data, np.uint8).reshape(-1, chunk.itemsize).T
            data = zlib.compress(shuffled.tobytes(), 1)
        dataset.id.write_direct_chunk((self.rows, *[0] * (chunk.ndim - 1)), data)

    # ---- blocks, for checkpoints -----------------------------------------------------------------------------------
    @property
    def blocks(self) -> int:
        """Whole blocks written so far."""
        return self.rows // self._chunk_rows

    @property
    def variables(self) -> int:
        """Variables that a block has a chunk of each of, the time among them."""
        return 1 + len(self._datasets)

    def places(self, first: int) -> NDArray[np.uint64]:
        """Offset and size in the file of each chunk of the whole blocks from `first` on: (blocks, variables, 2). They
        stay there, and nothing writes to them again."""
        result = np.empty((self.blocks - first, self.variables, 2), np.uint64)
        for block in range(first, self.blocks):
            for number, dataset in enumerate([self._time, *self._datasets]):
                origin = (block * self._chunk_rows, *[0] * (dataset.ndim - 1))
                found = dataset.id.get_chunk_info_by_coord(origin)
                result[block - first, number] = found.byte_offset, found.size
        return result

    def sync(self) -> None:
        """See to it that the disk has all blocks. GF7001 when it cannot be."""
        try:
            self._disk.sync()
        except OSError as error:
            raise _not_written(self.path, error) from None

    def adopt(self, source: BinaryIO, places: NDArray[np.uint64]) -> None:
        """Append whole blocks as they lie in another file of the same kind. ValueError if they do not lie there."""
        try:
            for block in places:
                self._look_for_room(self._chunk_rows)
                for (offset, size), dataset in zip(block.tolist(), [self._time, *self._datasets], strict=True):
                    source.seek(offset)
                    data = source.read(size)
                    if len(data) != size:
                        raise ValueError(f"it ends before byte {offset + size}")
                    dataset.id.set_extent((self.rows + self._chunk_rows, *dataset.shape[1:]))
                    dataset.id.write_direct_chunk((self.rows, *[0] * (dataset.ndim - 1)), data)
                self.rows += self._chunk_rows
            self._commit()
        except OSError as error:
            raise _not_written(self.path, error) from None

    def abandon(self) -> None:
        """Close the file and remove it."""
        self._file.close()
        self._disk.close()
        self.path.unlink(missing_ok=True)

    def rename(self, path: Path) -> None:
        """Give the open file another name."""
        self.path = self._disk.path = self.path.replace(path)

    def finish(
        self, status: str, statistics: Mapping[str, Any], add: Callable[[h5py.File], None] | None = None
    ) -> Path:
        """Write how the run ended, close the file and give it its name. `add` may put groups into it before. Returns
        the path it has then."""
        try:
            if add is not None:
                add(self._file)
            self._file.attrs["status"] = status
            self._file.attrs["statistics"] = json.dumps(statistics)
            self._file.close()
            self._disk.commit()
            self._disk.sync()
            self._disk.close()
            self.path.replace(self._final)
        except OSError as error:
            raise _not_written(self.path, error) from None
        return self._final


@functools.cache
def _text() -> tuple[Any, h5py.h5t.TypeID, h5py.h5s.SpaceID]:
    from h5py import h5s, h5t, string_dtype

    return string_dtype(), h5t.py_create(string_dtype(), logical=True), h5s.create(h5s.SCALAR)


def _describe(dataset: h5py.Dataset, unit: str, description: str) -> None:
    """Unit and sentence of a variable. By h5py's lower level: `attrs` would take a fifth of a short run's file."""
    from h5py import h5a

    kind, stored, one = _text()
    for name, text in ((b"units", unit), (b"long_name", description)):
        h5a.create(dataset.id, name, stored, one).write(np.array(text, kind))


def _not_written(path: Path, error: OSError) -> GustformError:
    reason = error.strerror or str(error).splitlines()[0]
    hint = (
        "--out with a folder of its own" if isinstance(error, BlockingIOError) else "--out with a folder that has space"
    )
    return GustformError("GF7001", f"the result {str(path)!r} cannot be written; {reason}", hint=hint)
