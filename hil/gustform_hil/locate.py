"""Where the databases and the C of the bridge are: beside this package in a work tree, inside it in an installation."""

from __future__ import annotations

from pathlib import Path

_HERE = Path(__file__).resolve().parent


def can_folder() -> Path:
    """The folder of the shipped databases and mappings."""
    return _folder("can")


def bridge_folder() -> Path:
    """The folder of the bridge's C: include, src, CMakeLists.txt."""
    return _folder("bridge")


def pil_folder() -> Path:
    """The folder of the C that runs a controller on an emulated board."""
    return _folder("pil")


def _folder(name: str) -> Path:
    inside = _HERE / name
    return inside if inside.is_dir() else _HERE.parent / name
