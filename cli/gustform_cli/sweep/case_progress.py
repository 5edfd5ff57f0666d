"""Progress of a campaign on stderr: how many cases, how fast, how long to go."""

from __future__ import annotations

from gustform_cli.progress import RunProgress, clock


class CaseProgress(RunProgress):
    """Shows cases done, those that failed, the rate and the time left. Use as a context; `show` at any rate."""

    def __init__(self, cases: int, doing: str) -> None:
        super().__init__(float(cases))
        self.doing = doing
        self.failed = 0

    def state(self, simulated: float, waited: float) -> str:
        """ "12 / 240 cases, 1 failed, 14.2 a second, 0:16 left"."""
        text = f"{simulated:.0f} / {self.until:.0f} cases"
        if self.failed:
            text += f", {self.failed} failed"
        if simulated > 0.0 and waited > 0.0:
            rate = simulated / waited
            pace = f"{rate:.3g} a second" if rate >= 1.0 else f"{clock(1.0 / rate)} a case"
            text += f", {pace}, {clock((self.until - simulated) / rate)} left"
        return text
