from __future__ import annotations

import os
import signal
import time
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from gustform_cli.sweep.local import LocalPool, Lost, WorkerDefect


def square(number: int) -> int:
    return number * number


def die_once(mark: str) -> str:
    """Kills its process the first time."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def die(number: int) -> int:
    if number == 3:
        os._exit(7)
    return number


def fail(number: int) -> int:
    raise ValueError(f"not {number}")


def write_later(task: tuple[str, float]) -> None:
    file, seconds = task
    time.sleep(seconds)
    Path(file).touch()


def sleep(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


def test_every_task_is_done_once() -> None:
    with LocalPool(2) as pool:
        assert sorted(pool.map(square, range(50))) == [(k, k * k) for k in range(50)]
        assert list(pool.map(square, [])) == []
        assert dict(pool.map(square, [7])) == {7: 49}  # the same workers again


def test_a_task_whose_worker_died_is_tried_again(tmp_path: Path) -> None:
    with LocalPool(1) as pool:
        assert list(pool.map(die_once, [str(tmp_path / "mark")])) == [(str(tmp_path / "mark"), "done")]


def test_one_whose_workers_die_again_and_again_is_lost_alone() -> None:
    with LocalPool(2) as pool:
        found = dict(pool.map(die, range(8)))
    assert {k: v for k, v in found.items() if k != 3} == {k: k for k in range(8) if k != 3}
    assert isinstance(found[3], Lost)
    assert "exit code 7" in found[3].reason


def test_a_defect_comes_with_the_traceback_of_the_worker() -> None:
    with LocalPool(1) as pool, pytest.raises(WorkerDefect, match="ValueError: not 5"):
        list(pool.map(fail, [5]))


def test_stopping_does_not_wait_for_what_is_running() -> None:
    begin = time.monotonic()
    with LocalPool(1) as pool:
        found: list[float] = []
        for task, _ in pool.map(sleep, [0.0, 3600.0], lambda: bool(found)):
            found.append(task)
    assert found == [0.0]
    assert time.monotonic() - begin < 60.0


def test_what_has_ended_when_it_stops_is_kept_and_nothing_runs_on(tmp_path: Path) -> None:
    """One task is through, another one would write a file later, when nobody looks any more."""
    late = tmp_path / "late"
    looks = 0

    def stopped() -> bool:
        nonlocal looks
        looks += 1
        if looks == 2:
            assert wait([worker.connection for worker in pool._workers], 60.0)  # the result of the early one
        return looks > 1

    with LocalPool(2) as pool:
        tasks = [(str(tmp_path / "early"), 0.2), (str(late), 30.0)]
        assert [task for task, _ in pool.map(write_later, tasks, stopped)] == tasks[:1]
        assert len(pool._workers) == 1  # the other one has been ended
    assert not late.exists()
