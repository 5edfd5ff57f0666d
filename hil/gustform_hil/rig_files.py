"""What a rig holds, for whoever runs its programs: message set, and measurements at which its controller stands still.

GF8085 the folder is no rig, or has not been compiled
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_hil.database import load_message_set
from gustform_hil.message_set import Field, MessageSet, Part

_HINT = "gustform hil build SCENARIO.yaml --out RIG"


@dataclass(frozen=True)
class RigFiles:
    """`measurements` and `set_points` are the start values of the controller's inputs."""

    folder: Path
    messages: MessageSet
    measurements: dict[str, float]
    set_points: dict[str, float]

    @property
    def bridge(self) -> Path:
        """The program gust-bridge."""
        return self._program("gust-bridge")

    @property
    def soak(self) -> Path:
        """The program gust-soak."""
        return self._program("gust-soak")

    @property
    def fd(self) -> bool:
        """Whether its bus carries CAN FD."""
        return any(message.fd for message in self.messages.messages)

    def _program(self, name: str) -> Path:
        program = self.folder / "build" / name
        if not program.is_file():
            raise GustformError(
                "GF8085", f"the rig {str(self.folder)!r} must be compiled; {name} is missing", hint=_HINT
            )
        return program


def read_rig(folder: Path) -> RigFiles:
    """GF8085."""
    try:
        described = json.loads((folder / "rig.json").read_text(encoding="utf-8"))
        prefix = str(described["prefix"])
        if not prefix.isidentifier():
            raise ValueError(f"the prefix {prefix[:40]!r} is not a name")
        signals = json.loads((folder / "controller" / f"{prefix}.json").read_text(encoding="utf-8"))["inputs"]
        start = {str(signal["name"]): float(signal["default"]) for signal in signals}
        (database,) = sorted((folder / "can").glob("*.dbc"))
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise GustformError("GF8085", f"{str(folder)!r} must be a rig; {error}", hint=_HINT) from None
    messages = load_message_set(database, folder / "can" / "mapping.yaml")
    points = {s.quantity for m in messages.pieces(Part.SET_POINTS) for s in m.signals if s.field == Field.QUANTITY}
    measured = {s.quantity for m in messages.pieces(Part.MEASUREMENTS) for s in m.signals if s.field == Field.QUANTITY}
    return RigFiles(
        folder,
        messages,
        {name: value for name, value in start.items() if name in measured},
        {name: value for name, value in start.items() if name in points - measured},
    )
