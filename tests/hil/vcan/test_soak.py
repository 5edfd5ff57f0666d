"""A million protected frames through the bus, each checked."""

from __future__ import annotations

import json

from typer.testing import CliRunner

from gustform_cli.main import app
from gustform_hil.rig_files import RigFiles

FRAMES = 1_000_000
FLAT = 256  # kB of two processes: a page here and there, not a hundredth of a byte per frame


def test_none_is_lost_and_memory_stays_flat(rig: RigFiles, interface: str) -> None:
    words = ["hil", "soak", "--frames", str(FRAMES), "--interface", interface, "--rig", str(rig.folder), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    counted = json.loads(done.stdout)
    print(counted)
    assert (counted["sent"], counted["received"]) == (FRAMES, FRAMES)
    assert (counted["lost"], counted["out_of_order"], counted["damaged"]) == (0, 0, 0)
    assert counted["memory_kb_end"] - counted["memory_kb_start"] <= FLAT
    assert counted["e2e_profile"] == 5
