"""What a result was made with."""

from __future__ import annotations

import ctypes
import platform

import casadi
import numpy as np

import gustform


def versions() -> dict[str, str]:
    """Versions of everything that numbers depend on."""
    return {
        "gustform": gustform.__version__,
        "casadi": casadi.CasadiMeta.version(),
        "sundials": _sundials(),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def _sundials() -> str:
    """The version of the SUNDIALS that the runtime is linked to, from the library itself."""
    from gustform_runtime import library_path

    text = ctypes.create_string_buffer(32)
    try:
        ctypes.CDLL(str(library_path())).SUNDIALSGetVersion(text, len(text))
    except (OSError, AttributeError):
        return "unknown"
    return text.value.decode(errors="replace")
