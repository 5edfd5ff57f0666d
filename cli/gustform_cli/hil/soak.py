"""`gustform hil soak`: many frames through the bus, by the C program gust-soak of a rig."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

from gustform.language.errors import GustformError
from gustform_cli.hil.rigs import rig_of
from gustform_hil.bus import check_interface

_SLOWEST = 500.0  # frames/s: below this something hangs


def run(interface: str, rig: Path | None, frames: int) -> dict[str, Any]:
    """What the program counts. GF8086 if it cannot do its work."""
    with rig_of(rig) as found:
        check_interface(interface, fd=found.fd)
        command = [str(found.soak), "--interface", interface, "--frames", str(frames)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=60.0 + frames / _SLOWEST
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise GustformError("GF8086", f"gust-soak could not be run; {error}", hint="gustform hil build") from None
    try:
        counted: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        words = done.stderr.strip() or f"exit code {done.returncode}"
        raise GustformError("GF8086", f"gust-soak gave no result; {words}", hint="gustform hil build") from None
    return counted


def good(counted: dict[str, Any]) -> bool:
    """All sent frames arrived, unharmed and in order."""
    return counted["sent"] == counted["received"] > 0 and not any(
        counted[key] for key in ("lost", "out_of_order", "damaged")
    )


def as_json(counted: dict[str, Any]) -> str:
    """One object."""
    return json.dumps(counted, indent=2)


def as_text(counted: dict[str, Any]) -> str:
    """Two lines."""
    return (
        f"{counted['sent']} frames of {counted['bytes']} bytes sent, {counted['lost']} lost, "
        f"{counted['out_of_order']} out of order, {counted['damaged']} damaged\n"
        f"{counted['frames_per_second']:.0f} frames/s, memory {counted['memory_kb_start']} kB at the start, "
        f"{counted['memory_kb_end']} kB at the end"
    )
