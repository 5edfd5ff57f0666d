"""The same campaign on a cluster of separate processes."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.unit.cli.sweep.campaigns import CURTAILMENTS, SHORT, numbers, rows, start, sweep, wait_for_cases, write

pytestmark = pytest.mark.xdist_group("cluster")  # one cluster at a time


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A scheduler and two workers, each a process that a nanny starts anew when it dies."""
    distributed = pytest.importorskip("distributed")
    # Workers import gustform from where this process does.
    os.environ["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as made:
        yield made


def workers(cluster: Any) -> list[int]:
    """Process numbers of the workers."""
    with cluster.get_client() as client:
        return [int(pid) for pid in client.run(os.getpid).values()]


@pytest.mark.parametrize("keep", ["none", "all"])
def test_the_numbers_are_those_of_the_local_sweep(cluster: Any, tmp_path: Path, keep: str) -> None:
    file = write(tmp_path, f"{CURTAILMENTS}      wind.wt.seed: [1, 2, 3]\nkeep: {keep}\n")
    here, there = tmp_path / "here", tmp_path / "there"
    assert sweep(file, here).exit_code == 0
    result = sweep(file, there, "--scheduler", cluster.scheduler_address)
    assert result.exit_code == 0, result.output
    assert numbers(here) == numbers(there)
    if keep == "all":
        for row in rows(there):
            assert (there / row["result"]).stat().st_size == (here / row["result"]).stat().st_size
        assert len(list((there / "runs").iterdir())) == 6


def test_a_worker_without_the_folder_sends_its_file(cluster: Any, tmp_path: Path) -> None:
    """A task whose mark the worker does not see: it has another file system."""
    from dataclasses import replace

    from gustform_cli.sweep.case import run
    from tests.unit.cli.sweep.test_leaks import task

    (tmp_path / "runs").mkdir()
    given = replace(task(1, tmp_path / "runs"), mark="not there")
    with cluster.get_client() as client:
        outcome = client.submit(run, given, pure=False).result()
    assert outcome.status == "completed"
    assert outcome.data is not None
    assert outcome.data.startswith(b"\x89HDF")
    assert not list((tmp_path / "runs").iterdir())


def test_a_killed_worker_loses_no_run(cluster: Any, tmp_path: Path) -> None:
    values = ", ".join(str(seed) for seed in range(1, 25))
    body = f"axes: [{{type: grid, values: {{wind.wt.seed: [{values}]}}}}]\nkeep: all\n"
    file, out = write(tmp_path, body, SHORT.replace("5 s", "20 min")), tmp_path / "out"
    process = start(file, out, "--scheduler", cluster.scheduler_address, "--json")
    wait_for_cases(process, out, 3, 120.0)
    victim = workers(cluster)[0]
    psutil.Process(victim).send_signal(signal.SIGKILL)
    stdout, stderr = process.communicate(timeout=200)
    assert process.returncode == 0, stderr
    assert json.loads(stdout)["ran"] == 24
    assert victim not in workers(cluster)
    assert {row["status"] for row in rows(out)} == {"completed"}
    assert sorted(f"runs/{f.name}" for f in (out / "runs").iterdir()) == sorted(row["result"] for row in rows(out))
    whole = tmp_path / "whole"
    assert sweep(file, whole, "--workers", 2).exit_code == 0
    assert numbers(out) == numbers(whole)


def test_a_scheduler_that_does_not_answer_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gustform_cli.sweep.cluster._CONTACT", 0.5)
    result = sweep(write(tmp_path), tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "GF2608" in result.stderr
    assert "tcp://127.0.0.1:1" in result.stderr


def test_without_the_extra_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = sweep(write(tmp_path), tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1")
    assert result.exit_code == 2
    assert "GF2607" in result.stderr
    assert "gustform[cluster]" in result.stderr
