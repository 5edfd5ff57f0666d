"""What a folder of `gustform sweep` holds: the table of cases, and the campaign it came from.

`scalars.parquet` has one row for each case that ended: `case`, the values of the axes, `status`, `error_code`, `error`,
`result`, the scalars. Its metadata has under `gustform` a JSON mapping with `axes` (names of columns), `units`,
`descriptions`, `cases` (how many are planned), `title`, `description`, `versions`, `campaign`, `base` (texts of the
files), `hash`; all of it may be missing.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform_cli.document import parse
from gustform_cli.report.numbers import scale

if TYPE_CHECKING:
    import pyarrow as pa

TABLE, CAMPAIGN, JOURNAL = "scalars.parquet", "campaign.yaml", "journal.jsonl"
DONE = ("completed", "done")
_FIXED = ("case", "status", "error_code", "error", "result")
WEIGHT = "weight"  # share of the time that a case stands for; among the axes, but follows from them
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d].*)?")


@dataclass(frozen=True)
class Column:
    """One column: the values as they stand there, and as numbers (NaN where there is none) if they are numbers."""

    name: str
    unit: str
    description: str
    values: Sequence[Any]
    numbers: NDArray[np.float64] | None

    @property
    def label(self) -> str:
        """Name and unit, for an axis of a chart."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    def distinct(self) -> list[Any]:
        """The values that occur: numbers in order, texts in that of the table."""
        known = dict.fromkeys(value for value in self.values if value is not None)
        return list(known) if self.numbers is None else [value for _, value in sorted(self._numbered(known))]

    def _numbered(self, known: Mapping[Any, None]) -> list[tuple[float, Any]]:
        assert self.numbers is not None  # distinct() has looked
        number = dict(zip(self.values, self.numbers.tolist(), strict=True))
        return [(number[value], value) for value in known]


@dataclass(frozen=True)
class Campaign:
    """The cases of a campaign, column by column."""

    folder: Path
    title: str
    description: str
    planned: int  # cases; more than there are rows while it goes on
    cases: Sequence[str]
    statuses: Sequence[str]
    errors: Sequence[str]
    axes: Sequence[Column]
    scalars: Sequence[Column]
    versions: Mapping[str, str]
    texts: Mapping[str, str]  # of the campaign's file and of the base scenario's, by their names
    kept: int  # runs with a file of their own
    hash: str  # of all cases as planned

    @property
    def done(self) -> NDArray[np.bool_]:
        """Which cases ended as they should."""
        return np.array([status in DONE for status in self.statuses], dtype=np.bool_)

    @property
    def written(self) -> str:
        """When the table was written last, UTC."""
        moment = datetime.fromtimestamp((self.folder / TABLE).stat().st_mtime, UTC)
        return moment.strftime("%Y-%m-%d %H:%M UTC")


def is_campaign(folder: Path) -> bool:
    """Whether there is anything of a campaign in the folder."""
    return any((folder / name).is_file() for name in (TABLE, JOURNAL))


def read_campaign(folder: Path) -> Campaign:
    """The campaign in a folder; GF7002 if it has no table or one that cannot be read."""
    table = _read(folder / TABLE)
    about = _metadata(table)
    text = str(about.get("campaign") or _text(folder / CAMPAIGN))
    plain = _tree(text)
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    rows = table.num_rows
    axes = [str(name) for name in about.get("axes") or () if name in columns]
    units, descriptions = _texts(about.get("units")), _texts(about.get("descriptions"))
    for field in table.schema:
        own = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
        units.setdefault(field.name, own.get("unit", own.get("units", "")))
        descriptions.setdefault(field.name, own.get("description", own.get("long_name", "")))
    made = {
        name: _column(name, values, units.get(name, ""), descriptions.get(name, ""))
        for name, values in columns.items()
        if name not in _FIXED
    }
    codes = columns.get("error_code", [None] * rows)
    errors = columns.get("error", [None] * rows)
    return Campaign(
        folder=folder,
        title=str(about.get("title") or plain.get("name") or folder.resolve().name),
        description=str(about.get("description") or plain.get("description") or ""),
        planned=max(rows, int(about["cases"]) if isinstance(about.get("cases"), int) else 0),
        cases=[str(case) for case in columns.get("case", range(1, rows + 1))],
        statuses=[str(status) for status in columns.get("status", ["completed"] * rows)],
        errors=[": ".join(str(part) for part in pair if part) for pair in zip(codes, errors, strict=True)],
        axes=[made[name] for name in axes if name in made],
        scalars=[_scaled(column) for name, column in made.items() if name not in axes],
        versions=_texts(about.get("versions")),
        texts={
            str(about.get("campaign_file") or CAMPAIGN): text,
            str(about.get("base_file") or "base"): str(about.get("base") or ""),
        },
        kept=sum(1 for file in columns.get("result", ()) if file),
        hash=str(about.get("hash") or ""),
    )


def _read(file: Path) -> pa.Table:
    import pyarrow as pa  # a tenth of a second: not for a run
    import pyarrow.parquet as pq

    if not file.is_file():
        raise GustformError(
            "GF7002",
            f"{str(file.parent)!r} must have the table of its campaign; the sweep was cut off before it wrote one",
            hint="gustform sweep again, which goes on from there",
        )
    try:
        return pq.read_table(file)
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise GustformError(
            "GF7002", f"{str(file)!r} must be the table of a campaign; {reason}", hint="gustform sweep again"
        ) from None


def _metadata(table: pa.Table) -> Mapping[str, Any]:
    try:
        found = json.loads((table.schema.metadata or {}).get(b"gustform", b"{}"))
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _column(name: str, values: list[Any], unit: str, description: str) -> Column:
    numbers = _numbers(values)
    if numbers is None and (parsed := _quantities(values)) is not None:
        numbers, unit = parsed[0], unit or parsed[1]
    return Column(name, "" if unit == "1" else unit, description, values, numbers)


def _scaled(column: Column) -> Column:
    """12e6 W as 12 MW."""
    if column.numbers is None or not np.isfinite(column.numbers).any():
        return column
    factor, unit = scale(column.unit, float(np.nanmax(np.abs(column.numbers))))
    return replace(column, numbers=column.numbers / factor, unit=unit)


def _numbers(values: Sequence[Any]) -> NDArray[np.float64] | None:
    if any(value is not None and not isinstance(value, int | float) for value in values):
        return None
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def _quantities(values: Sequence[Any]) -> tuple[NDArray[np.float64], str] | None:
    """ "8 m/s", "10 m/s" as numbers, if all have one unit."""
    found = [_QUANTITY.fullmatch(str(value)) for value in values if value is not None]
    matches = [match for match in found if match is not None]
    units = {(match[2] or "").strip() for match in matches}
    if not matches or len(matches) < len(found) or len(units) != 1:
        return None
    numbers = iter(float(match[1]) for match in matches)
    return np.array([np.nan if value is None else next(numbers) for value in values]), units.pop()


def _texts(mapping: object) -> dict[str, str]:
    return {str(k): str(v) for k, v in mapping.items()} if isinstance(mapping, Mapping) else {}


def _tree(text: str) -> Mapping[str, Any]:
    try:
        return parse(text, CAMPAIGN).plain() if text else {}
    except GustformError:
        return {}


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""
