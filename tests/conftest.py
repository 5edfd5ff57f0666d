"""What all tests share: the place of the work tree, a quiet and repeatable environment, hypothesis's settings."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import pytest

ROOT = Path(__file__).resolve().parent.parent

# Before anything imports numpy or matplotlib. Each xdist worker has one core, and figures go to files.
os.environ["MPLBACKEND"] = "Agg"
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
# Kernels compiled by one test serve the others, and none are left among the user's own.
os.environ.setdefault("GUSTFORM_CACHE", str(ROOT / "build" / "test-cache"))

# No deadline: a first example may compile a kernel. In CI the examples are the same on every run, so that a red run
# can be repeated; elsewhere new ones are tried each time.
hypothesis.settings.register_profile("default", deadline=None)
hypothesis.settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "default")


@pytest.fixture(scope="session")
def root() -> Path:
    """The work tree."""
    return ROOT
