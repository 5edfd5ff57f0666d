"""One simulation of a model table: the C interface of gust_sim.h as a Python class."""

import ctypes
import os
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gustform_runtime.bindings import ROW_SINK, SAMPLED_STEP, SERIES_READER, Counters, SampledCounters, library
from gustform_runtime.errors import RunError, Status
from gustform_runtime.statistics import Statistics

Doubles = NDArray[np.float64]
Reader = Callable[[int, int], tuple[Doubles, Doubles]]
Sink = Callable[[Doubles, NDArray[np.float32]], None]
SampledStep = Callable[[float, Doubles], Doubles]

_MESSAGE_SIZE = 4096
_SINK_FAILED = -1
_READER_FAILED = -1
_STEP_FAILED = -1


class Option(NamedTuple):
    """An option of the integrator."""

    name: str
    default: float
    description: str


class SampledBlock(NamedTuple):
    """A controller outside of the equations: what it measures and what it commands, in order, with units.

    `period` in s, `delay` in samples; `real_size` is that of its numbers, 4 bytes or 8, which measurements and commands
    are rounded to. `start` holds before the first sample.
    """

    name: str
    period: float
    delay: int
    real_size: int
    measurements: dict[str, str]
    commands: dict[str, str]
    start: Doubles


class SampledCount(NamedTuple):
    """How a sampled block has fared: `errors` are samples with that bit of the error signal, least first; `first_error`
    the time of the first bad sample, s, nan if there was none."""

    samples: int
    bad_samples: int
    errors: list[int]
    first_error: float


def _address(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def solver_versions() -> dict[str, str]:
    """Versions of the solvers that the runtime is built with."""
    loaded = library()
    return {
        "sundials": loaded.gust_sundials_version().decode(),
        "klu": loaded.gust_klu_version().decode(),
    }


class Simulation:
    """A model table and its run.

    Set options, readers and the sink; then initialise(), then advance() as often as wanted. One thread at a time,
    except `time` and request_stop(), which any thread may use while advance() runs (it releases the GIL).
    """

    def __init__(self, table: bytes | Path) -> None:
        """Read a table from bytes, or from a file; its kernels' relative paths start at the file's folder."""
        self._library = library()
        self._model = ctypes.c_void_p()
        self._handle = ctypes.c_void_p()
        self._callbacks: list[Any] = []  # ctypes does not keep them alive
        self._raised: BaseException | None = None  # by a callback, to be raised again outside of C
        message = ctypes.create_string_buffer(_MESSAGE_SIZE)
        if isinstance(table, Path):
            code = self._library.gust_model_load(str(table).encode(), ctypes.byref(self._model), message, _MESSAGE_SIZE)
        else:
            code = self._library.gust_model_parse(table, len(table), ctypes.byref(self._model), message, _MESSAGE_SIZE)
        if code != Status.OK:
            raise RunError(Status(code), message.value.decode(errors="replace"))
        code = self._library.gust_sim_create(self._model, ctypes.byref(self._handle))
        if code != Status.OK:
            self.close()
            raise RunError(Status(code), "no memory for the simulation")
        self.n_unknowns: int = self._library.gust_model_n_unknowns(self._model)
        self.n_nonzeros: int = self._library.gust_model_n_nonzeros(self._model)
        self.n_channels: int = self._library.gust_model_n_channels(self._model)
        self.n_sampled: int = self._library.gust_model_n_sampled(self._model)

    # -- life ---------------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Free everything; the object cannot be used afterwards. Not while advance() runs in another thread."""
        self._library.gust_sim_destroy(ctypes.byref(self._handle))
        self._library.gust_model_destroy(ctypes.byref(self._model))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __del__(self) -> None:
        if hasattr(self, "_handle"):
            self.close()

    def _open(self) -> ctypes.c_void_p:
        if self._handle.value is None:
            raise RunError(Status.BAD_ORDER, "the simulation has been closed")
        return self._handle

    def _check(self, code: int) -> Status:
        """The status of a call; an exception for an error, or for what a callback raised meanwhile."""
        raised, self._raised = self._raised, None
        if raised is not None:
            raise raised
        status = Status(code)
        if status < 0:
            raise RunError(status, self.message or self._library.gust_status_text(code).decode())
        return status

    # -- before initialise --------------------------------------------------------------------------------------------

    @staticmethod
    def options() -> list[Option]:
        """Every option with its default and a sentence on it."""
        found: list[Option] = []
        while info := library().gust_option_list(len(found)):
            row = info.contents
            found.append(Option(row.name.decode(), row.initial, row.sentence.decode()))
        return found

    def set_option(self, name: str, value: float) -> None:
        """Set an option of the integrator, by name."""
        self._check(self._library.gust_sim_set_option(self._open(), name.encode(), float(value)))

    def set_series_reader(self, series: int, reader: Reader) -> None:
        """Give a series of source "reader" its data: reader(first, count) -> times (s), values, at most `count` samples
        from sample `first` on, fewer only at the end. The times of a uniform series are not looked at."""

        def read(_context: int, first: int, count: int, time: Any, value: Any) -> int:
            try:
                times, values = reader(first, count)
                samples = np.ascontiguousarray(values, dtype=np.float64)
                if samples.ndim != 1 or len(samples) > count:
                    raise ValueError(f"a reader asked for {count} samples delivered an array of shape {samples.shape}")
                np.ctypeslib.as_array(value, shape=(count,))[: len(samples)] = samples
                if time:
                    np.ctypeslib.as_array(time, shape=(count,))[: len(samples)] = times
                return len(samples)
            except BaseException as error:  # must not travel through C
                self._raised = error
                return _READER_FAILED

        callback = SERIES_READER(read)
        self._check(self._library.gust_sim_set_series_reader(self._open(), series, callback, None))
        self._callbacks.append(callback)

    def set_sink(self, interval: float, sink: Sink, block_rows: int = 1024) -> None:
        """Call sink(times (s), values[rows, channels]) with blocks of result rows, one row every `interval` seconds.
        The arrays are the sink's to keep."""

        def receive(_context: int, rows: int, time: Any, values: Any) -> int:
            try:
                times = np.ctypeslib.as_array(time, shape=(rows,)).copy()
                if self.n_channels:
                    block = np.ctypeslib.as_array(values, shape=(rows, self.n_channels)).copy()
                else:
                    block = np.empty((rows, 0), dtype=np.float32)
                sink(times, block)
                return 0
            except BaseException as error:  # must not travel through C
                self._raised = error
                return _SINK_FAILED

        callback = ROW_SINK(receive)
        self._check(self._library.gust_sim_set_sink(self._open(), interval, block_rows, callback, None))
        self._callbacks.append(callback)

    def set_statistics(self, statistics: Statistics, start: float) -> None:
        """Give `statistics` a row of all channels at `start`, s, and every `statistics.interval` seconds from then on.
        Its columns are the channels of this simulation."""
        self._check(self._library.gust_sim_set_statistics(self._open(), statistics.handle, start))
        self._callbacks.append(statistics)  # alive as long as C may write to it

    def set_sampled(self, block: int, step: SampledStep) -> None:
        """At each sample of a sampled block call step(time (s), measurements) -> commands, in place of its own
        controller. Names and order are those of sampled_blocks(); numbers are rounded to the block's type on either
        side. What its own controller would tell of itself is recorded as NaN."""
        blocks = self.sampled_blocks()
        n_in, n_out = (
            (len(blocks[block].measurements), len(blocks[block].commands)) if 0 <= block < len(blocks) else (0, 0)
        )

        def sample(_context: int, time: float, measurements: Any, commands: Any) -> int:
            try:
                given = np.asarray(
                    step(time, np.ctypeslib.as_array(measurements, shape=(n_in,)).copy()), dtype=np.float64
                )
                if given.shape != (n_out,):
                    raise ValueError(f"a sampled block with {n_out} commands got an array of shape {given.shape}")
                np.ctypeslib.as_array(commands, shape=(n_out,))[:] = given
                return 0
            except BaseException as error:  # must not travel through C
                self._raised = error
                return _STEP_FAILED

        callback = SAMPLED_STEP(sample)
        self._check(self._library.gust_sim_set_sampled(self._open(), block, callback, None))
        self._callbacks.append(callback)

    # -- run ----------------------------------------------------------------------------------------------------------

    def initialise(self, t0: float = 0.0) -> None:
        """Find consistent values at t0 (s), from the start values of the table."""
        self._check(self._library.gust_sim_initialise(self._open(), t0))

    def advance(self, until: float) -> Status:
        """Integrate to `until` (s): OK, or a status > 0 that says why it stopped earlier. Raises RunError on errors,
        and whatever a reader or the sink raised."""
        return self._check(self._library.gust_sim_advance(self._open(), until, None))

    def request_stop(self) -> None:
        """Make advance() return Status.STOP_REQUESTED after the current step; from any thread."""
        self._library.gust_sim_request_stop(self._open())

    # -- checkpoints --------------------------------------------------------------------------------------------------

    def checkpoint(self, path: Path | None = None) -> None:
        """The state at the time reached, into a file that is replaced in one go, or for checkpoint_bytes() only.

        The integrator starts anew here, in this run as in one that takes it up, so that both go on with the same bits.
        Rows up to now have been handed over: write them to the disk first. RunError CHECKPOINT_FAILED leaves the last
        file in place, and the simulation can go on."""
        self._check(self._library.gust_sim_checkpoint(self._open(), None if path is None else os.fsencode(path)))

    def checkpoint_bytes(self) -> bytes:
        """The last checkpoint as bytes."""
        start, size = ctypes.c_void_p(), ctypes.c_size_t()
        code = self._library.gust_sim_checkpoint_bytes(self._open(), ctypes.byref(start), ctypes.byref(size))
        if code != Status.OK:
            raise RunError(Status(code), "no checkpoint has been made yet")
        return ctypes.string_at(start.value or 0, size.value)

    def restore(self, state: Path | bytes) -> None:
        """After initialise(): go on from a checkpoint of the same table with the same options, sink interval and
        statistics. statistics()["rows"] then says how many rows there were up to it."""
        if isinstance(state, Path):
            code = self._library.gust_sim_restore(self._open(), os.fsencode(state))
        else:
            code = self._library.gust_sim_restore_bytes(self._open(), state, len(state))
        self._check(code)

    # -- look ---------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time reached, s; from any thread."""
        return float(self._library.gust_sim_time(self._open()))

    @property
    def message(self) -> str:
        """What the last status other than OK was about."""
        return str(self._library.gust_sim_message(self._open()).decode(errors="replace"))

    def channel_names(self) -> list[str]:
        """Names of the recorded channels, in the order of a row."""
        name = self._library.gust_model_channel_name
        return [name(self._model, k).decode() for k in range(self.n_channels)]

    def channel_units(self) -> list[str]:
        """Units of the recorded channels, in the order of a row."""
        unit = self._library.gust_model_channel_unit
        return [unit(self._model, k).decode() for k in range(self.n_channels)]

    def sampled_blocks(self) -> list[SampledBlock]:
        """The sampled blocks of the table, in the order in which set_sampled() counts them."""
        self._open()
        found = []
        for number in range(self.n_sampled):
            info = self._library.gust_model_sampled_block(self._model, number).contents
            n_in, n_out = info.n_measurements, info.n_commands
            measured = zip(info.measurement_name[:n_in], info.measurement_unit[:n_in], strict=True)
            commanded = zip(info.command_name[:n_out], info.command_unit[:n_out], strict=True)
            found.append(
                SampledBlock(
                    info.name.decode(),
                    info.period,
                    info.delay,
                    info.real_size,
                    {name.decode(): unit.decode() for name, unit in measured},
                    {name.decode(): unit.decode() for name, unit in commanded},
                    np.array(info.command_start[:n_out]),
                )
            )
        return found

    def sampled_statistics(self, block: int) -> SampledCount:
        """Samples and errors of a sampled block so far."""
        counters = SampledCounters()
        self._check(self._library.gust_sim_sampled_statistics(self._open(), block, ctypes.byref(counters)))
        return SampledCount(counters.samples, counters.bad_samples, list(counters.errors), counters.first_error)

    def statistics(self) -> dict[str, int | float]:
        """Counters of the run, see gust_statistics in gust_sim.h."""
        counters = Counters()
        self._check(self._library.gust_sim_statistics(self._open(), ctypes.byref(counters)))
        return {field[0]: getattr(counters, field[0]) for field in Counters._fields_}

    def state(self) -> tuple[float, Doubles, Doubles]:
        """Time reached (s), the unknowns y there, and their derivatives y'."""
        time = ctypes.c_double()
        y = np.empty(self.n_unknowns)
        yp = np.empty(self.n_unknowns)
        self._check(self._library.gust_sim_state(self._open(), ctypes.byref(time), _address(y), _address(yp)))
        return time.value, y, yp

    def channels(self) -> Doubles:
        """All channels at the time reached."""
        row = np.empty(self.n_channels)
        self._check(self._library.gust_sim_channels(self._open(), _address(row)))
        return row

    def _unknowns(self, values: Doubles, name: str) -> Doubles:
        array = np.ascontiguousarray(values, dtype=np.float64)
        if array.shape != (self.n_unknowns,):
            raise RunError(Status.BAD_ARGUMENT, f"{name} must hold {self.n_unknowns} values; got shape {array.shape}")
        return array

    def residual(self, t: float, y: Doubles, yp: Doubles) -> Doubles:
        """F(t, y, y') with the parameters and discrete values of now."""
        at_y, at_yp = self._unknowns(y, "y"), self._unknowns(yp, "yp")
        result = np.empty(self.n_unknowns)
        self._check(self._library.gust_sim_residual(self._open(), t, _address(at_y), _address(at_yp), _address(result)))
        return result

    def jacobian(self, t: float, y: Doubles, yp: Doubles, cj: float) -> Doubles:
        """dF/dy + cj dF/dy', the nonzeros in the column order of the table's pattern."""
        at_y, at_yp = self._unknowns(y, "y"), self._unknowns(yp, "yp")
        result = np.empty(self.n_nonzeros)
        self._check(
            self._library.gust_sim_jacobian(self._open(), t, _address(at_y), _address(at_yp), cj, _address(result))
        )
        return result
