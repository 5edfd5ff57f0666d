"""What a case leaves in the process that ran it."""

from __future__ import annotations

from pathlib import Path

import psutil

from gustform_cli.document import Change
from gustform_cli.sweep.case import Task, run
from tests.unit.cli.sweep.campaigns import BASE


def task(number: int, folder: Path) -> Task:
    settings = {"run.until": "2 s", "events": [], "wind.wt.seed": number, "wt.curtailment": f"{5 + number % 7} %"}
    changes = tuple(Change(path, value, None) for path, value in settings.items())
    return Task(
        number, f"{number:032x}", f"model {number % 7}", str(BASE), BASE.read_text(), changes, 0.0, "all", str(folder)
    )


def test_memory_and_handles_stay(tmp_path: Path) -> None:
    """1,000 runs of 60 s were measured by hand (docs/campaigns.md); this finds a leak of some kB a run."""
    process = psutil.Process()
    for number in range(40):  # caches fill, the heap finds its size
        assert run(task(number, tmp_path)).status == "completed"
    memory, handles, threads = process.memory_info().rss, process.num_fds(), process.num_threads()
    for number in range(40, 140):
        assert run(task(number, tmp_path)).status == "completed"
    assert process.num_fds() == handles
    assert process.num_threads() == threads
    # 1.5 MB: the heap of one run is several MB, so a hundred leaks of a model's table (30 kB) would show.
    assert process.memory_info().rss - memory < 1_500_000
