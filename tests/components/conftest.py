"""A kernel cache that the component tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from gustform_codegen.cache import KernelCache


@pytest.fixture(scope="session")
def cache(root: Path, tmp_path_factory: pytest.TempPathFactory) -> KernelCache:
    """Kernels compiled by this test session."""
    return KernelCache(root / "runtime" / "include", tmp_path_factory.mktemp("kernels"))
