"""scalars.parquet: one row for each case that ended, units in the columns' metadata, provenance in the table's.

Columns: case; the axes by their path (a number in the unit of the first value, or text); status, error_code, error;
result (its file, where one is kept);
wall_seconds, solve_seconds; then the scalars that were asked for.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import translate
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gustform_cli.quantity import conversion, split_quantity
from gustform_cli.sweep.case import RUNS, result_name
from gustform_cli.sweep.plan import Plan
from gustform_cli.sweep.store import Record
from gustform_cli.versions import versions
from gustform_cli.writing import writing

if TYPE_CHECKING:
    import pyarrow as pa

TABLE = "scalars.parquet"
CAMPAIGN = "campaign.yaml"  # a copy of it, beside the table
METADATA = "gustform"  # key of the JSON text in the table's metadata


def selected(names: Iterable[str], patterns: Sequence[str]) -> list[str]:
    """The names that match one of the patterns, in their own order. Square brackets are numbers of instances."""
    escaped = [p.replace("[", "\0").replace("]", "[]]").replace("\0", "[[]") for p in patterns]
    match = re.compile("|".join(translate(pattern) for pattern in escaped)).match
    return [name for name in names if match(name)]


def write_table(plan: Plan, records: Mapping[str, Record], units: Mapping[str, str], folder: Path) -> Path:
    """Write the table of the cases that have ended; it takes the place of an older one only when it is whole."""
    import pyarrow.parquet as pq

    file = folder / TABLE
    part = folder / f"{TABLE}.part"
    with writing(file):
        (folder / CAMPAIGN).write_text(plan.campaign_text, encoding="utf-8")
        pq.write_table(_table(plan, records, units, folder), part, compression="zstd")
        part.replace(file)
    return file


def _table(plan: Plan, records: Mapping[str, Record], units: Mapping[str, str], folder: Path) -> pa.Table:
    import pyarrow as pa

    rows = [(case, records[case.key]) for case in plan.cases if case.key in records]
    fields: list[pa.Field] = []
    columns: list[Any] = []

    def column(name: str, kind: pa.DataType, values: list[Any], unit: str | None = None) -> None:
        fields.append(pa.field(name, kind, metadata={"unit": unit} if unit is not None else None))
        columns.append(pa.array(values, kind))

    column("case", pa.int32(), [case.number for case, _ in rows])
    axes = list(dict.fromkeys(name for case in plan.cases for name in case.labels))
    for name in axes:
        unit, numbers = axis_column([case.labels.get(name) for case in plan.cases])
        if numbers is None:
            column(name, pa.string(), [_text(case.labels.get(name)) for case, _ in rows])
        else:
            whole = unit == "" and all(isinstance(case.labels.get(name), int) for case in plan.cases)
            values = [numbers[case.number - 1] for case, _ in rows]
            column(name, pa.int64() if whole else pa.float64(), [int(v) for v in values] if whole else values, unit)
    column("status", pa.string(), [record.status for _, record in rows])
    column("error_code", pa.string(), [record.fault.code if record.fault else None for _, record in rows])
    column("error", pa.string(), [record.fault.message if record.fault else None for _, record in rows])
    kept = {
        key: result_name(key) for key in (case.key for case, _ in rows) if (folder / RUNS / result_name(key)).is_file()
    }
    column("result", pa.string(), [f"{RUNS}/{kept[case.key]}" if case.key in kept else None for case, _ in rows])
    column("wall_seconds", pa.float64(), [record.wall_seconds for _, record in rows], "s")
    column("solve_seconds", pa.float64(), [record.solve_seconds for _, record in rows], "s")
    known = dict.fromkeys(name for _, record in rows for name in record.scalars)
    for name in selected(known, plan.campaign.scalars):
        column(name, pa.float64(), [record.scalars.get(name) for _, record in rows], units.get(name, "1"))
    shown = {field.name: field.metadata[b"unit"].decode() for field in fields if field.metadata}
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, metadata=_provenance(plan, axes, shown)))


def axis_column(values: Sequence[Any]) -> tuple[str, list[float] | None]:
    """Values of an axis as numbers in the unit of the first; None in place of the numbers if some are none."""
    unit: str | None = None
    numbers = []
    for value in values:
        quantity = split_quantity(value)
        if quantity is None:
            return "", None
        number, own = quantity
        unit = own if unit is None else unit
        if own != unit:
            try:
                factor = conversion(own or "1", unit or "1")
            except ValueError:
                factor = None
            if factor is None:
                return "", None
            number *= factor
        numbers.append(number)
    return unit or "", numbers


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) or value is None else json.dumps(value)


def _provenance(plan: Plan, axes: Sequence[str], units: Mapping[str, str]) -> dict[str, str]:
    """One JSON text: what the table is of, and all that made it."""
    about = {
        "title": plan.campaign.name,
        "description": plan.campaign.description,
        "cases": len(plan.cases),
        "axes": list(axes),
        "units": dict(units),
        "transient_seconds": plan.campaign.transient,
        "campaign_file": plan.document.file,
        "campaign": plan.campaign_text,
        "base_file": str(plan.base_file),
        "base": plan.base_text,
        "hash": hashlib.sha256("".join(case.key for case in plan.cases).encode()).hexdigest(),
        "versions": versions(),
    }
    return {METADATA: json.dumps(about)}
