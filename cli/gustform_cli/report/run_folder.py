"""What a folder of `gustform simulate` holds, whole or not: the page is made of what there is."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gustform.language.errors import GustformError
from gustform_cli.document import parse
from gustform_cli.journalled_file import complete
from gustform_cli.result import PARTIAL, RESULT

SUMMARY = "summary.json"
_HASHED = 256 << 20  # bytes; a larger result is not read again for its hash
_TEXTS = ("title", "description", "scenario", "scenario_file", "status", "frequency_channel")
_JSONS = ("events", "versions", "statistics", "warnings")


def is_run(folder: Path) -> bool:
    """Whether there is anything of a run in the folder."""
    return any((folder / name).is_file() for name in (RESULT, PARTIAL, SUMMARY))


@dataclass(frozen=True)
class RunFolder:
    """The texts and numbers of a run. `result` is None where no result can be read, `unread` then says why."""

    folder: Path
    result: Path | None
    unread: str
    texts: Mapping[str, str]
    parts: Mapping[str, Any]
    summary: Mapping[str, Any]
    plain: Mapping[str, Any] = field(default_factory=dict)  # the scenario as a tree

    @property
    def unfinished(self) -> bool:
        """Whether the run goes on still, or was killed."""
        return not self.summary.get("status") and self.texts.get("status", "running") == "running"

    @property
    def status(self) -> str:
        """completed, interrupted, failed, or unfinished."""
        return "unfinished" if self.unfinished else str(self.summary.get("status") or self.texts.get("status"))

    @property
    def title(self) -> str:
        """The scenario's name, the folder's where there is none."""
        return self.texts.get("title") or self.folder.resolve().name

    @property
    def written(self) -> str:
        """When the result was written last, UTC."""
        file = self.result or self.folder / SUMMARY
        return datetime.fromtimestamp(file.stat().st_mtime, UTC).strftime("%Y-%m-%d %H:%M UTC")

    def result_hash(self) -> str:
        """SHA-256 of the result file."""
        if self.result is None:
            return ""
        if self.result.stat().st_size > _HASHED:
            return f"not taken: the file is larger than {_HASHED >> 20} MB"
        with self.result.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def read_run(folder: Path) -> RunFolder:
    """Everything but the curves. A summary or a scenario that cannot be read is left out; the result says its own."""
    result = next((folder / name for name in (RESULT, PARTIAL) if (folder / name).is_file()), None)
    texts: dict[str, str] = {}
    unread = f"there is no {RESULT}" if result is None else ""
    if result is not None:
        try:
            texts = _attributes(result)
        except OSError as error:
            unread = f"{result.name} cannot be opened: {str(error).split('(')[0].strip()}"
            result = None
    parts = {name: _json(texts.get(name, "")) for name in _JSONS}
    summary = _json(_text(folder / SUMMARY))
    if not isinstance(summary, dict):
        summary = parts["statistics"] if isinstance(parts["statistics"], dict) else {}
    return RunFolder(folder, result, unread, texts, parts, summary, _tree(texts.get("scenario", "")))


def _attributes(result: Path) -> dict[str, str]:
    import h5py

    complete(result)
    with h5py.File(result, "r") as file:
        return {name: str(file.attrs[name]) for name in (*_TEXTS, *_JSONS) if name in file.attrs}


def _tree(text: str) -> Mapping[str, Any]:
    try:
        return parse(text, "scenario").plain() if text else {}
    except GustformError:
        return {}  # the text itself is on the page


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _json(text: str) -> Any:
    try:
        return json.loads(text) if text else None
    except ValueError:
        return None
