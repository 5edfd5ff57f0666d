"""Rigs, as `gustform hil build` makes them. `make test-hil` builds them beforehand, on the host."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gustform_cli.hil.build import Options, build
from gustform_cli.hil.rigs import SCENARIO
from gustform_hil.rig_files import RigFiles, read_rig


@pytest.fixture(scope="session")
def interface() -> str:
    return os.environ.get("GUSTFORM_VCAN_INTERFACES", "vcan0").split(",")[0]


@pytest.fixture(scope="session")
def rig_for(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], RigFiles]:
    """The rig of the load step at 8 m/s for a bus, "fd" or "classic"."""
    made: dict[str, RigFiles] = {}

    def rig(bus: str) -> RigFiles:
        if bus not in made:
            ready = os.environ.get("GUSTFORM_RIGS")
            folder = Path(ready) / bus if ready else tmp_path_factory.mktemp("rig") / bus
            if not ready:
                build(SCENARIO, folder, Options(bus=bus))
            made[bus] = read_rig(folder)
        return made[bus]

    return rig


@pytest.fixture(scope="session")
def rig(rig_for: Callable[[str], RigFiles]) -> RigFiles:
    return rig_for("fd")
