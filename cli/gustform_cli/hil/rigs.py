"""The rig that a command of the bench runs: the one that is named, or one built for the occasion."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gustform_hil.rig_files import RigFiles, read_rig

SCENARIO = Path(__file__).resolve().parents[1] / "scenarios" / "load_step_8ms.yaml"


@contextmanager
def rig_of(folder: Path | None) -> Iterator[RigFiles]:
    """Of a folder; None: that of the load step at 8 m/s, in a temporary one."""
    if folder is not None:
        yield read_rig(folder)
        return
    from gustform_cli.hil.build import build

    with tempfile.TemporaryDirectory(prefix="gust-rig-") as made:
        print(f"building a rig for {SCENARIO.name}", file=sys.stderr)
        build(SCENARIO, Path(made))
        yield read_rig(Path(made))
