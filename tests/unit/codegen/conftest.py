"""One kernel cache for the session, in a folder that is thrown away."""

from __future__ import annotations

from pathlib import Path

import pytest

from gustform_codegen.cache import KernelCache
from tests.unit.codegen.compiled import INCLUDE


@pytest.fixture(scope="session")
def cache_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kernels")


@pytest.fixture
def cache(cache_folder: Path) -> KernelCache:
    """A fresh counter over the session's folder."""
    return KernelCache(INCLUDE, cache_folder)
