"""What a result was made with."""

from __future__ import annotations

import platform

import casadi
import numpy as np

import gustform


def versions() -> dict[str, str]:
    """Versions of everything that numbers depend on."""
    from gustform_runtime import solver_versions

    return {
        "gustform": gustform.__version__,
        "casadi": casadi.CasadiMeta.version(),
        **solver_versions(),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
