"""Where the compiled part of the runtime is: the folder with lib/, bin/ and include/."""

import os
import sysconfig
from pathlib import Path

ENVIRONMENT = "GUSTFORM_RUNTIME_DIR"
LIBRARY = Path("lib") / "libgustform.so"


def _candidates() -> list[Path]:
    """Folders to look in, first match wins: what the user says, beside this package (wheel, work tree), and where an
    editable install puts compiled files."""
    folders = []
    if os.environ.get(ENVIRONMENT):
        folders.append(Path(os.environ[ENVIRONMENT]))
    folders.append(Path(__file__).resolve().parent)
    folders += [Path(sysconfig.get_path(scheme)) / "gustform_runtime" for scheme in ("platlib", "purelib")]
    return folders


def _root() -> Path:
    folders = _candidates()
    for folder in folders:
        if (folder / LIBRARY).is_file():
            return folder.resolve()
    looked = ", ".join(str(folder / LIBRARY) for folder in folders)
    raise FileNotFoundError(
        f"the compiled runtime is missing (looked for {looked}): build it with `make`, or set {ENVIRONMENT} to the "
        "folder that holds its lib/"
    )


def library_path() -> Path:
    """The shared library libgustform.so."""
    return _root() / LIBRARY


def include_dir() -> Path:
    """The folder that holds gustform/gust_kernel.h, for compiling kernels."""
    return _root() / "include"


def gust_run_path() -> Path:
    """The program gust-run, which runs a built model without Python."""
    return _root() / "bin" / "gust-run"
