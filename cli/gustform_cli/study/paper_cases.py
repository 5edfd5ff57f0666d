"""The nine cases of the paper's case study, run side by side: three controls at three wind speeds.

Every case is the shipped load step with a few values changed. Models are built one after another, because CasADi holds
Python's lock, and run in threads, because the runtime does not.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from gustform.language.errors import GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.interrupt import Interrupt
from gustform_cli.model import Model, link, load, placed
from gustform_cli.new import SCENARIOS
from gustform_cli.progress import RunProgress
from gustform_cli.run import Ended, Run
from gustform_codegen.initial import steady_state
from gustform_codegen.table import SystemTable

SCENARIO = SCENARIOS / "load_step_8ms.yaml"
TURBINE = "wt"
WINDS = (8, 10, 12)  # m/s
_POLL = 0.1  # s between looks at the time reached


@dataclass(frozen=True)
class Control:
    """One of the three controls that the paper compares."""

    key: str
    label: str
    overrides: tuple[str, ...]


GFL = Control("gfl", "GFL MPPT", ("wt.control.type=GridFollowing", "wt.curtailment=0%"))
GFM_MPPT = Control("gfm_mppt", "GFM MPPT", ("wt.control.type=DualPort", "wt.curtailment=0%"))
GFM_FR = Control("gfm_fr", "GFM FR", ("wt.control.type=DualPort", "wt.curtailment=10%"))
CONTROLS = (GFL, GFM_MPPT, GFM_FR)


@dataclass(frozen=True)
class Case:
    """A control at a wind speed, m/s."""

    control: Control
    wind: int

    @property
    def name(self) -> str:
        """Name of its files, gfm_fr_8."""
        return f"{self.control.key}_{self.wind}"

    def overrides(self, fidelity: str) -> list[str]:
        """What differs from the shipped scenario."""
        return [
            f"name=20 MW load step at {self.wind} m/s, {self.control.label}",
            f"fidelity={fidelity}",
            f"wind.wt.speed={self.wind} m/s",
            *self.control.overrides,
        ]


CASES = tuple(Case(control, wind) for wind in WINDS for control in CONTROLS)


@dataclass(frozen=True)
class Built:
    """A case ready to run: its model, and its table in the steady state."""

    case: Case
    model: Model
    table: SystemTable
    seconds: float

    @property
    def turbine(self) -> PmsgTurbine:
        """The turbines of the case."""
        turbine = self.model.assembled.system.components[TURBINE]
        assert isinstance(turbine, PmsgTurbine)
        return turbine


def build(case: Case, fidelity: str) -> Built:
    """Build a case; kernels come from the cache."""
    begin = time.perf_counter()
    assembled = load(SCENARIO, case.overrides(fidelity))
    model = link(assembled)
    try:
        table = steady_state(model.built.linked).table.with_channels(model.channels)
    except GustformError as unsolved:
        raise placed(unsolved, assembled) from None
    return Built(case, model, table, time.perf_counter() - begin)


def run(built: Sequence[Built], folder: Path, jobs: int, interrupt: Interrupt) -> dict[Case, Ended]:
    """Run all cases into `folder`, `jobs` at a time. After Ctrl-C those that had begun are cut short, with their rows
    so far readable, and those that had not are left out."""
    with ExitStack() as stack:
        runs = [stack.enter_context(Run(b.model, b.table, folder / f"{b.case.name}.nc")) for b in built]

        def stop() -> None:
            for one in runs:
                one.request_stop()

        def execute(one: Run, seconds: float) -> Ended | None:
            return None if interrupt.requested else one.execute(seconds)

        interrupt.running(stop)
        progress = stack.enter_context(RunProgress(sum(one.until for one in runs)))
        with ThreadPoolExecutor(jobs, thread_name_prefix="gustform-case") as workers:
            futures = [workers.submit(execute, one, b.seconds) for one, b in zip(runs, built, strict=True)]
            while wait(futures, _POLL).not_done:
                done = sum(future.done() for future in futures)
                progress.show(sum(one.time for one in runs), f"{done} of {len(runs)} cases, ")
        interrupt.closing()
        ended = {b.case: future.result() for b, future in zip(built, futures, strict=True)}
    return {case: end for case, end in ended.items() if end is not None}
