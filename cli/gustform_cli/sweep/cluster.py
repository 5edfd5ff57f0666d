"""Cases on a cluster that dask.distributed runs: `gustform[cluster]`.

A task is plain data (the text of the base scenario and the changes), so a worker needs gustform and nothing of the
client's. Types and kernels are made once in each worker. A worker that dies gives its cases back to the scheduler,
which passes them on; a case whose workers die again and again has failed.
"""

from __future__ import annotations

import importlib
import queue
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, Self, TypeVar

import gustform
from gustform.language.errors import GustformError
from gustform_cli.sweep import case
from gustform_cli.sweep.local import Lost

T = TypeVar("T")
R = TypeVar("R")

_CONTACT = 10.0  # s to wait for the scheduler
_POLL = 0.1  # s between looks at `stopped`


class ClusterPool:
    """Workers behind the scheduler at `address`, tcp://host:port or the file that dask-scheduler wrote. A context."""

    def __init__(self, address: str) -> None:
        try:
            self._distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise GustformError(
                "GF2607",
                "--scheduler needs dask.distributed, which is not installed",
                hint="pip install 'gustform[cluster]'",
            ) from None
        self._address = address
        where: dict[str, Any] = {"scheduler_file": address} if address.endswith(".json") else {"address": address}
        try:
            self._client = self._distributed.Client(timeout=_CONTACT, set_as_default=False, **where)
        except (OSError, TimeoutError, ValueError) as error:
            raise GustformError(
                "GF2608",
                f"the scheduler {address!r} must answer; {error}",
                hint="the address that dask-scheduler prints, tcp://host:8786",
            ) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def refuse_other_versions(self) -> None:
        """GF2609 for workers that have no gustform, or another one: their numbers would not be these."""
        mine = gustform.__version__
        try:
            found = self._client.run(case.version)
        except Exception as error:  # whatever a worker raises while it imports
            raise GustformError(
                "GF2609", f"every worker must have gustform {mine}; one answers: {error!r}", hint="installing it there"
            ) from None
        if not found:
            raise GustformError("GF2608", f"the scheduler {self._address!r} has no workers", hint="dask worker ADDRESS")
        for address, other in found.items():
            if other != mine:
                raise GustformError(
                    "GF2609", f"every worker must have gustform {mine}; {address} has {other}", hint="installing it"
                )

    def map(
        self, function: Callable[[T], R], tasks: Sequence[T], stopped: Callable[[], bool] = lambda: False
    ) -> Iterator[tuple[T, R | Lost]]:
        """(task, function(task)) in the order in which they end, until `stopped`. What `function` raises is raised."""
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        given: dict[str, T] = {}
        futures: list[Any] = []  # a future that nobody holds is forgotten by the scheduler
        for task in tasks:
            future = self._client.submit(function, task, pure=False)
            given[future.key] = task
            futures.append(future)
            future.add_done_callback(ended.put)
        try:
            while given and not stopped():
                try:
                    future = ended.get(timeout=_POLL)
                except queue.Empty:
                    continue
                task = given.pop(future.key)
                try:
                    result: R | Lost = future.result()
                except self._distributed.KilledWorker as error:
                    result = Lost(str(error))
                yield task, result
                future.release()
        finally:
            if given:
                self._client.cancel([future for future in futures if future.key in given], force=True)
