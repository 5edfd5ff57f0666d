"""From the axes of a campaign to points: which paths take which values together.

A grid is the product of its lists, the last one changing fastest; a list goes row by row; a Latin hypercube (McKay,
Beckman, Conover 1979; scipy.stats.qmc) puts one of n points into each n-th part of every range.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gustform.language.errors import GustformError
from gustform_cli.document import Change, Document, NodePath, dotted
from gustform_cli.fields import shown
from gustform_cli.quantity import conversion, split_quantity
from gustform_cli.sweep.campaign import Axis, GridAxis, LatinHypercubeAxis, ListAxis, Range

_DIGITS = 9  # of a sampled value, so that it can be typed again


@dataclass(frozen=True)
class Point:
    """Values that are set together, and what the table calls them."""

    changes: tuple[Change, ...]
    labels: Mapping[str, Any] = field(default_factory=dict)


def points(axis: Axis, path: NodePath, document: Document) -> list[Point]:
    """The points of one axis, which stands at `path` of the campaign. GF2601, GF2602, GF2603."""
    if isinstance(axis, GridAxis):
        columns = [
            [Change(name, value, document.place((*path, "values", name, k))) for k, value in enumerate(values)]
            for name, values in axis.values.items()
        ]
        return [_point(changes) for changes in itertools.product(*columns)]
    if isinstance(axis, ListAxis):
        return _listed(axis, path, document)
    return _sampled(axis, path, document)


def _point(changes: tuple[Change, ...]) -> Point:
    return Point(changes, {change.path: change.value for change in changes})


def _listed(axis: ListAxis, path: NodePath, document: Document) -> list[Point]:
    if bool(axis.values) == bool(axis.rows):
        raise GustformError(
            "GF2601",
            f"{dotted(path)} must have either values or rows; it has {'both' if axis.rows else 'none'}",
            hint="rows: [{wt.control.type: DualPort, wt.curtailment: 10 %}]",
            place=document.place(path),
        )
    if axis.rows:
        first = set(axis.rows[0])
        for k, row in enumerate(axis.rows):
            if set(row) != first:
                odd = sorted(set(row) ^ first)[0]
                raise GustformError(
                    "GF2601",
                    f"{dotted((*path, 'rows', k))} must have the paths of the first row; {odd!r} is in one of the two",
                    hint=", ".join(axis.rows[0]),
                    place=document.place((*path, "rows", k)),
                )
        return [
            _point(tuple(Change(name, value, document.place((*path, "rows", k, name))) for name, value in row.items()))
            for k, row in enumerate(axis.rows)
        ]
    name, longest = max(axis.values.items(), key=lambda item: len(item[1]))
    for other, values in axis.values.items():
        if len(values) != len(longest):
            raise GustformError(
                "GF2601",
                f"{dotted((*path, 'values'))} must have equally many values for each path; {other} has {len(values)} "
                f"and {name} has {len(longest)}",
                hint="type: grid for every combination",
                place=document.place((*path, "values", other)),
            )
    return [
        _point(tuple(Change(n, v[k], document.place((*path, "values", n, k))) for n, v in axis.values.items()))
        for k in range(len(longest))
    ]


def _sampled(axis: LatinHypercubeAxis, path: NodePath, document: Document) -> list[Point]:
    from scipy.stats import qmc  # 0.5 s of imports

    ends = {name: _ends(axis.ranges[name], name, (*path, "ranges", name), document) for name in axis.ranges}
    unit_cube = qmc.LatinHypercube(len(ends), rng=axis.seed).random(axis.n)
    found = []
    for row in unit_cube:
        changes = []
        for share, (name, (low, high, unit)) in zip(row, ends.items(), strict=True):
            if axis.ranges[name].scale == "log":
                number = low * (high / low) ** float(share)
            else:
                number = low + (high - low) * float(share)
            number = float(f"{number:.{_DIGITS}g}")
            value = f"{number!r} {unit}" if unit else number
            changes.append(Change(name, value, document.place((*path, "ranges", name))))
        found.append(_point(tuple(changes)))
    return found


def _ends(span: Range, name: str, path: NodePath, document: Document) -> tuple[float, float, str]:
    """The ends of a range in the unit of the first, and that unit."""

    def refuse(message: str, hint: str, key: str) -> GustformError:
        return GustformError("GF2603", message, hint=hint, place=document.place((*path, key)))

    ends = []
    for key, value in (("from", span.from_), ("to", span.to)):
        end = split_quantity(value)
        if end is None or not math.isfinite(end[0]):
            raise refuse(
                f"{dotted((*path, key))} must be a number or a quantity; got {shown(value)}", "5 %, 2 ms or 0.3", key
            )
        ends.append(end)
    (low, unit), (high, other) = ends
    try:
        factor = 1.0 if unit == other else conversion(other or "1", unit or "1")
    except ValueError:
        factor = None
    if factor is None:
        raise refuse(
            f"{dotted(path)} must go from one value to another of the same kind; got {shown(span.from_)} and "
            f"{shown(span.to)}",
            f"to: a value in {unit or 'the unit of from'}",
            "to",
        )
    high *= factor
    if not low < high:
        raise refuse(
            f"{dotted((*path, 'to'))} must be greater than from, {shown(span.from_)}; got {shown(span.to)}",
            "from: the lower value",
            "to",
        )
    if span.scale == "log" and low <= 0.0:
        raise refuse(
            f"{dotted((*path, 'from'))} must be greater than 0, because the scale is log; got {shown(span.from_)}",
            "scale: linear",
            "from",
        )
    return low, high, unit
