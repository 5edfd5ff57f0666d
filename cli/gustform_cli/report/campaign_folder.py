"""What a folder of `gustform sweep` holds: the table of cases, and the campaign it came from.

`scalars.parquet` has one row for each case: `case`, the values of the axes, the scalars, `status` and `error`. Which
columns are axes is in the table's metadata (`gustform`: a JSON mapping with `axes`, `units`, `descriptions`, `cases`,
`title`, `description`, `versions`) or follows from `axes:` of the campaign's YAML beside it.
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

TABLE, CAMPAIGN, RUNS = "scalars.parquet", "campaign.yaml", "runs"
DONE = ("completed", "done")
_FIXED = ("case", "status", "error", "message")
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d].*)?")
# Units of scalars that carry them in their names.
_SUFFIXES = (
    ("_hz_per_s", "Hz/s"), ("_hz", "Hz"), ("_seconds", "s"), ("_s", "s"), ("_mwh", "MWh"), ("_mw", "MW"), ("_pu", "pu"),
    ("_deg", "deg"), ("_nm", "N*m"),
)  # fmt: skip


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
        """The values that occur, in order."""
        known = {value for value in self.values if value is not None}
        return sorted(known, key=lambda value: (isinstance(value, str), value))


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
    text: str  # of the campaign's YAML
    kept: int  # runs with a file of their own

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
    """Whether there is a table of cases in the folder."""
    return (folder / TABLE).is_file()


def read_campaign(folder: Path) -> Campaign:
    """The campaign in a folder; GF7002 if its table cannot be read."""
    table = _read(folder / TABLE)
    text = _text(folder / CAMPAIGN)
    plain = _tree(text)
    about = _metadata(table)
    columns = {name: table.column(name).to_pylist() for name in table.column_names}
    rows = table.num_rows
    axes = [name for name in _axes(about, plain) if name in columns]
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
    runs = folder / RUNS
    return Campaign(
        folder=folder,
        title=str(about.get("title") or plain.get("name") or folder.resolve().name),
        description=str(about.get("description") or plain.get("description") or ""),
        planned=max(rows, int(about["cases"]) if isinstance(about.get("cases"), int) else 0),
        cases=[str(case) for case in columns.get("case", range(1, rows + 1))],
        statuses=[str(status) for status in columns.get("status", ["completed"] * rows)],
        errors=[str(error or "") for error in columns.get("error", columns.get("message", [""] * rows))],
        axes=[made[name] for name in axes if name in made],
        scalars=[_scaled(column) for name, column in made.items() if name not in axes],
        versions=_texts(about.get("versions")),
        text=text,
        kept=sum(1 for _ in runs.glob("*.nc")) if runs.is_dir() else 0,
    )


def _read(file: Path) -> pa.Table:
    import pyarrow as pa  # a tenth of a second: not for a run
    import pyarrow.parquet as pq

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


def _axes(about: Mapping[str, Any], plain: Mapping[str, Any]) -> list[str]:
    """Names of the axes: a list, or the keys of a mapping; of a list of mappings their names."""
    axes = about.get("axes") or plain.get("axes") or ()
    return [str(axis.get("name", axis.get("path", ""))) if isinstance(axis, Mapping) else str(axis) for axis in axes]


def _column(name: str, values: list[Any], unit: str, description: str) -> Column:
    numbers = _numbers(values)
    if numbers is None and (parsed := _quantities(values)) is not None:
        numbers, unit = parsed[0], unit or parsed[1]
    if not unit:
        unit = next((u for suffix, u in _SUFFIXES if name.endswith(suffix)), "")
    return Column(name, unit, description, values, numbers)


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
