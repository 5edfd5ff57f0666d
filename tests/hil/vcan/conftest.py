"""Rigs, as `gustform hil build` makes them. `make test-hil` builds them beforehand, on the host."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gustform_cli.hil.build import build
from gustform_cli.hil.rigs import SCENARIO
from gustform_hil.rig_files import RigFiles, read_rig
from tests.support.rigs import RIGS


@pytest.fixture(scope="session")
def interface() -> str:
    return os.environ.get("GUSTFORM_VCAN_INTERFACES", "vcan0").split(",")[0]


@pytest.fixture(scope="session")
def rig_for(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], RigFiles]:
    """One of RIGS."""
    made: dict[str, RigFiles] = {}

    def rig(name: str) -> RigFiles:
        if name not in made:
            ready = os.environ.get("GUSTFORM_RIGS")
            folder = Path(ready) / name if ready else tmp_path_factory.mktemp("rig") / name
            if not ready:
                build(SCENARIO, folder, RIGS[name])
            made[name] = read_rig(folder)
        return made[name]

    return rig


@pytest.fixture(scope="session")
def rig(rig_for: Callable[[str], RigFiles]) -> RigFiles:
    return rig_for("fd")
