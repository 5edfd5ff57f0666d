"""The rigs that the tests on a CAN bus run, as the Makefile builds them."""

from __future__ import annotations

from gustform_cli.hil.build import Options

# The operating point looked up in a table by the controller itself.
SCHEDULE = "wt.schedule.type=CurtailmentSchedule"
RIGS = {"fd": Options(), "classic": Options(bus="classic"), "scheduled": Options(overrides=(SCHEDULE,))}
