"""A file that goes from one whole state to the next, at whatever moment its process is killed.

HDF5 changes its directory in place: the extents of the variables, the index of their chunks, the end of the file. A
process that is killed between two of these writes leaves a file whose parts do not belong together. So HDF5 writes
into a `JournalledFile`: what lies behind the last whole state goes to the disk at once, nothing refers to it yet; pages
of that state which change are kept in memory. `commit` writes them beside the file first, then into it:

    FILE           the last whole state, or between two of them while FILE.redo is there and whole
    FILE.redo      digest of what follows; length of the file; numbers of the pages; the pages. All numbers are u64, LE

This is a redo log, as databases have it. `complete` does what the one that was killed had left to do.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

_PAGE = 4096
_DIGEST = hashlib.sha256().digest_size


class JournalledFile:
    """What h5py takes for a file that it may read and write. OSError where the disk refuses, or when it is in use."""

    def __init__(self, path: Path) -> None:
        """An empty file, in the place of one that was there; no other process may write to it or read it as HDF5."""
        self.path = path
        self._stream = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b", buffering=0)
        self._file = self._stream.fileno()
        try:
            lock(self._stream)
            os.ftruncate(self._file, 0)
        except OSError:
            self._stream.close()
            raise
        _redo(path).unlink(missing_ok=True)
        self._place = 0
        self._size = 0
        self._border = 0  # end of the last page that has bytes of the last whole state
        self._pages: dict[int, bytearray] = {}  # before it, as they will be in the next state

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place, counted from the beginning or from the end."""
        self._place = offset + (self._size if whence == os.SEEK_END else 0)
        return self._place

    def tell(self) -> int:
        """The place."""
        return self._place

    def readinto(self, buffer: memoryview) -> int:
        """As many bytes from here as the buffer takes or the file has."""
        count = max(0, min(len(buffer), self._size - self._place))
        data = bytearray(os.pread(self._file, count, self._place).ljust(count, b"\0"))
        for number, in_page, in_data in _pieces(self._place, count):
            if number in self._pages:
                data[in_data] = self._pages[number][in_page]
        buffer[:count] = data
        self._place += count
        return count

    def read(self, count: int) -> bytes:
        """At most so many bytes from here."""
        data = bytearray(count)
        return bytes(data[: self.readinto(memoryview(data))])

    def write(self, data: memoryview) -> int:
        """Put bytes here: into pages of the last whole state, and on the disk behind them."""
        place, count = self._place, len(data)
        inside = max(0, min(count, self._border - place))
        for number, in_page, in_data in _pieces(place, inside):
            self._page(number)[in_page] = data[in_data]
        _put(self._file, data[inside:], place + inside)
        self._place = place + count
        self._size = max(self._size, self._place)
        return count

    def truncate(self, size: int) -> int:
        """The length that the file will have; the disk has it after `commit`."""
        self._size = size
        return size

    def flush(self) -> None:
        """HDF5 asks for it more often than its file is whole: nothing."""

    def commit(self) -> None:
        """What has been written is the next whole state."""
        pages = sorted((number, page) for number, page in self._pages.items() if number * _PAGE < self._size)
        redo = _redo(self.path)
        if pages:
            numbers = struct.pack(f"<{len(pages)}Q", *(number for number, _ in pages))
            text = struct.pack("<2Q", self._size, len(pages)) + numbers + b"".join(page for _, page in pages)
            redo.write_bytes(hashlib.sha256(text).digest() + text)
        _carry_out(self._file, self._size, pages)
        redo.unlink(missing_ok=True)
        self._border = -(-self._size // _PAGE) * _PAGE
        self._pages.clear()

    def sync(self) -> None:
        """See to it that the disk has what was committed."""
        os.fsync(self._file)

    def close(self) -> None:
        """Close it as it is; what was not committed is gone."""
        self._stream.close()

    def _page(self, number: int) -> bytearray:
        if number not in self._pages:
            self._pages[number] = bytearray(os.pread(self._file, _PAGE, number * _PAGE).ljust(_PAGE, b"\0"))
        return self._pages[number]


def complete(path: Path) -> None:
    """Carry out what a killed process had written down and not done, if it did; nothing if another one still writes to
    the file, or this one may not."""
    redo = _redo(path)
    if not redo.exists():
        return
    with contextlib.suppress(OSError), path.open("r+b", buffering=0) as stream:
        lock(stream)
        data = redo.read_bytes()
        if hashlib.sha256(data[_DIGEST:]).digest() == data[:_DIGEST]:
            size, count = struct.unpack_from("<2Q", data, _DIGEST)
            numbers = struct.unpack_from(f"<{count}Q", data, _DIGEST + 16)
            pages = memoryview(data)[_DIGEST + 16 + 8 * count :]
            pieces = ((n, pages[k * _PAGE : (k + 1) * _PAGE]) for k, n in enumerate(numbers))
            _carry_out(stream.fileno(), size, pieces)
        redo.unlink()


def lock(stream: IO[bytes], *, shared: bool = False) -> None:
    """Until it is closed nobody else writes to this file, nor reads it unless `shared`; BlockingIOError if somebody
    does. HDF5 locks the files that it opens in the same way. Some file systems have no locks."""
    try:
        fcntl.flock(stream, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise BlockingIOError(error.errno, "another process has it open") from None
    except OSError:
        pass


def _redo(path: Path) -> Path:
    return path.with_name(f"{path.name}.redo")


def _pieces(place: int, count: int) -> Iterator[tuple[int, slice, slice]]:
    """Of some bytes what lies in each page: its number, where it is there and where among the bytes."""
    for number in range(place // _PAGE, -(-(place + count) // _PAGE) if count else 0):
        at = number * _PAGE - place
        begin, end = max(at, 0), min(at + _PAGE, count)
        yield number, slice(begin - at, end - at), slice(begin, end)


def _carry_out(file: int, size: int, pages: Iterable[tuple[int, bytearray | memoryview]]) -> None:
    for number, page in pages:
        _put(file, memoryview(page), number * _PAGE)
    os.ftruncate(file, size)


def _put(file: int, data: memoryview, at: int) -> None:
    while data:
        written = os.pwrite(file, data, at)
        data, at = data[written:], at + written
