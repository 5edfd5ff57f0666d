"""Cases on the cores of this machine, each worker a process that keeps its types and kernels.

Threads would share them, but building a case is Python and takes as long as running it: two threads were 1.2 times as
fast as one on 60 s of turbulent wind, two processes twice (docs/campaigns.md). A case is a few hundred bytes to send.
Processes come from a server that has loaded everything once, so the third costs no second import. One that dies takes
its case with it: the case is tried again in another, and after a second death it has failed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Self, TypeVar

T = TypeVar("T")
R = TypeVar("R")

_DEATHS = 2  # of workers with the same task, after which it is given up
_POLL = 0.1  # s between looks at `stopped`
_SINGLE_THREADED = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Lost:
    """Stands for the result of a task whose workers died."""

    def __init__(self, reason: str) -> None:
        self.reason = reason


@dataclass(eq=False)
class _Worker:
    process: BaseProcess
    connection: Connection
    task: Any = field(default=None)
    busy: bool = False


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


class LocalPool:
    """Worker processes; use as a context."""

    def __init__(self, workers: int) -> None:
        self.size = workers
        self._context: ForkServerContext = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([f"{__package__}.case"])
        self._workers: list[_Worker] = []

    def __enter__(self) -> Self:
        for variable in _SINGLE_THREADED:  # one core each
            os.environ.setdefault(variable, "1")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for worker in self._workers:
            worker.connection.close()  # an idle one ends by itself
            if worker.busy:
                worker.process.terminate()
        for worker in self._workers:
            worker.process.join()
            worker.process.close()
        self._workers.clear()

    def map(
        self, function: Callable[[T], R], tasks: Sequence[T], stopped: Callable[[], bool] = lambda: False
    ) -> Iterator[tuple[T, R | Lost]]:
        """(task, function(task)) in the order in which they end, until `stopped`; workers that are busy then are ended.
        What `function` raises is raised."""
        waiting = deque(tasks)
        deaths: dict[int, int] = {}
        ending = False
        while not ending and (waiting or any(worker.busy for worker in self._workers)):
            ending = stopped()
            if not ending:
                self._give(function, waiting)
            busy = {worker.connection: worker for worker in self._workers if worker.busy}
            for connection in wait(list(busy), 0.0 if ending else _POLL):
                assert isinstance(connection, Connection)
                worker = busy[connection]
                task, worker.task, worker.busy = worker.task, None, False
                try:
                    result = connection.recv()
                except (EOFError, ConnectionError):
                    reason = self._bury(worker)
                    deaths[id(task)] = deaths.get(id(task), 0) + 1
                    if deaths[id(task)] < _DEATHS:
                        waiting.appendleft(task)
                    else:
                        yield task, Lost(reason)
                    continue
                if isinstance(result, _Raised):
                    raise WorkerDefect(result.traceback)
                yield task, result
        for worker in [one for one in self._workers if one.busy]:
            worker.process.terminate()
            self._bury(worker)

    def _give(self, function: Callable[[T], R], waiting: deque[T]) -> None:
        """A task for every idle worker; new workers while there are fewer than wanted."""
        while waiting:
            worker = next((one for one in self._workers if not one.busy), None)
            if worker is None and len(self._workers) < self.size:
                worker = self._start()
            if worker is None:
                return
            worker.task, worker.busy = waiting.popleft(), True
            try:
                worker.connection.send((function, worker.task))
            except (BrokenPipeError, ConnectionError):  # it died idle; no fault of the task's
                waiting.appendleft(worker.task)
                self._bury(worker)

    def _start(self) -> _Worker:
        mine, its = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(its,), daemon=True, name="gustform-case")
        process.start()
        its.close()
        worker = _Worker(process, mine)
        self._workers.append(worker)
        return worker

    def _bury(self, worker: _Worker) -> str:
        self._workers.remove(worker)
        worker.connection.close()
        worker.process.join()
        code = worker.process.exitcode
        worker.process.close()
        if code is not None and code < 0:
            return f"it was ended by {signal.Signals(-code).name}"
        return f"it ended with exit code {code}"


class WorkerDefect(Exception):
    """What a function raised in a worker, with its traceback as text."""


@dataclass(frozen=True)
class _Raised:
    traceback: str


def _serve(connection: Connection) -> None:
    """The life of a worker: tasks until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to the whole group; the parent decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    while True:
        try:
            function, task = connection.recv()
        except (EOFError, ConnectionError):
            return
        try:
            result = function(task)
        except Exception:
            result = _Raised(traceback.format_exc())
        try:
            connection.send(result)
        except ConnectionError:
            return
