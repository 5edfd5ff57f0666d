"""The charts of a campaign: scalars over what was varied.

One axis: every case and the mean at each value. Two: a heat map of the means, and lines where one of them has few
values. More: each scalar over the axes it follows most, and a map of the rank correlations. Seeds are no axis but
repetitions.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform_cli.report import axis as axes
from gustform_cli.report.campaign_folder import WEIGHT, Campaign, Column
from gustform_cli.report.charts import COLOURS, SMALL, Line, Points, lines, scatter
from gustform_cli.report.heat_map import BLUE_RED, heat_map
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import fixed, places, pretty, significant

Floats = NDArray[np.float64]

# Scalars in the order in which they interest, by patterns of their names; all others come after these.
_INTEREST = tuple(
    re.compile(pattern)
    for pattern in (
        r"nadir_hz$|nadir$",
        "rocof",
        "settle",
        r"^trips\.",
        r"\.del([._]|$)|DEL|fatigue|damage",
        "travel",
        "energy",
        "capacity",
        r"\.P\.mean$|P_gsc\.mean$",
        r"omega_r\.max$",
        r"v_dc\.min$",
        r"beta\.max$|pitch.*max$",
        r"(v_dc|\.P|omega_r)\.std$",
    )
)
# What the computation cost is not a result, and what went into it is not one either.
_EFFORT = re.compile(
    r"(^|[._])(wall|build|solve|simulated|compiled|unknowns|steps|rows|events|restarts|wind)([._]|$)"
    r"|evaluations|factorisations|iterations|failures|real_time|nadir_time|_seconds$"
)
_OUTER = 2  # dots in wt.P.mean
_CHARTED = 6  # scalars
_FOLLOWED = 2  # axes for each scalar where there are more than two
_FOLLOWS = 0.1  # rank correlation; less is noise
_MOST_POINTS = 4000  # cases drawn; of more every second, third ... one
_MOST_CELLS = 60  # along one side of a heat map


@dataclass(frozen=True)
class _Places:
    """An axis as positions: its numbers, or 0, 1, 2 ... for texts."""

    column: Column
    x: Floats
    scale: axes.Axis
    names: Sequence[str]  # of the distinct positions
    distinct: Floats


def varied(campaign: Campaign) -> list[Column]:
    """Axes with more than one value that are neither seeds nor weights, nor follow from one before them."""
    found: list[Column] = []
    for column in campaign.axes:
        if len(column.distinct()) < 2 or is_seed(column) or column.name == WEIGHT:
            continue
        if not any(_same(column, before) for before in found):
            found.append(column)
    return found


def main_scalars(campaign: Campaign) -> list[Column]:
    """Scalars that differ between the cases that are done, the most interesting first."""
    done = campaign.done
    return [
        column
        for column in by_interest(campaign.scalars)
        if column.numbers is not None and _spread(column.numbers[done]) > 0.0 and is_outer(column)
    ]


def by_interest(scalars: Sequence[Column]) -> list[Column]:
    """The most interesting first, else in the order of the table."""
    last = len(_INTEREST)
    return sorted(scalars, key=lambda c: next((k for k, word in enumerate(_INTEREST) if word.search(c.name)), last))


def is_outer(column: Column) -> bool:
    """Whether a scalar is a result, and not of a channel inside of a component (wt.control.gsc.xi.mean) or the cost of
    the computation."""
    return column.name.count(".") <= _OUTER and not _EFFORT.search(column.name)


def charts(campaign: Campaign) -> Content:
    """All charts, None if nothing was varied or nothing came out."""
    over = [_places(column) for column in varied(campaign)]
    shown = main_scalars(campaign)[:_CHARTED]
    if not over or not shown:
        return None
    if len(over) == 1:
        return tag("div", [_cloud(campaign, scalar, over[0]) for scalar in shown], class_="charts small")
    if len(over) == 2 and _gridded(over[0], over[1]):
        # Names go up, where there is room for them, and are told apart by colour.
        up, across = sorted(over, key=lambda place: (place.column.numbers is not None, place.distinct.size))
        maps = [_map(campaign, scalar, across, up) for scalar in shown]
        parts: list[Content] = [tag("div", maps, class_="charts maps")]
        if up.distinct.size <= COLOURS:
            families = [_family(campaign, scalar, across, up) for scalar in shown]
            parts.append(tag("div", families, class_="charts small"))
        return parts
    ranks = _correlations(campaign, shown, over)
    small = [_cloud(campaign, scalar, over[k]) for row, scalar in enumerate(shown) for k in _followed(ranks[row])]
    return [_correlation_map(shown, over, ranks), tag("div", small, class_="charts small")]


def is_seed(column: Column) -> bool:
    """Whether an axis only repeats a case with another wind of the same kind."""
    return column.name.split(".")[-1] in ("seed", "seed_number")


def _same(one: Column, other: Column) -> bool:
    """Whether each value of one goes with one value of the other, as in a list of values that are set together.

    Where no value comes twice, as in a Latin hypercube, that says something only if both rise or fall together.
    """
    pairs = {(str(a), str(b)) for a, b in zip(one.values, other.values, strict=True)}
    if not len(pairs) == len(one.distinct()) == len(other.distinct()):
        return False
    if len(pairs) < len(one.values) or one.numbers is None or other.numbers is None:
        return True
    return len(pairs) > 2 and abs(_rank_correlation(one.numbers, other.numbers)) > 1.0 - 1e-9


def _spread(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _places(column: Column) -> _Places:
    label = f"{column.name}, {pretty(column.unit)}" if column.unit else column.name
    if column.numbers is not None:
        distinct = np.unique(column.numbers[np.isfinite(column.numbers)])
        scale = axes.linear(float(distinct[0]), float(distinct[-1]), label)
        return _Places(column, column.numbers, scale, [significant(value) for value in distinct.tolist()], distinct)
    names = [str(value) for value in column.distinct()]
    number: dict[Any, float] = {name: float(k) for k, name in enumerate(names)}
    x = np.array([np.nan if value is None else number[str(value)] for value in column.values])
    return _Places(column, x, axes.categories(names, label), names, np.arange(float(len(names))))


def _values(campaign: Campaign, scalar: Column) -> Floats:
    """Of the cases that are done; NaN for the others."""
    assert scalar.numbers is not None  # main_scalars() sees to it
    return np.where(campaign.done, scalar.numbers, np.nan)


def _upright(scalar: Column, values: Floats) -> axes.Axis:
    known = values[np.isfinite(values)]
    return axes.linear(float(known.min()), float(known.max()), pretty(scalar.unit))


def _means(place: _Places, values: Floats) -> Floats:
    """The mean of the values at each position, NaN where there are none."""
    return np.array([_mean(values[place.x == x]) for x in place.distinct])


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan


def _cloud(campaign: Campaign, scalar: Column, place: _Places) -> Html:
    values = _values(campaign, scalar)
    known = np.flatnonzero(np.isfinite(values) & np.isfinite(place.x))
    kept = known[:: max(1, -(-known.size // _MOST_POINTS))]
    names = [f"case {campaign.cases[k]}: {significant(float(values[k]))} {scalar.unit}".rstrip() for k in kept]
    repeated = place.distinct.size <= 0.5 * known.size
    trend = Line("mean", place.distinct, _means(place, values)) if repeated else None
    rank = _rank_correlation(place.x[known], values[known])
    alt = (
        f"{scalar.name} over {place.column.name}, {known.size} cases, "
        f"from {significant(float(values[known].min()))} to {significant(float(values[known].max()))}, "
        f"rank correlation {significant(rank, 2)}"
    )
    cloud = Points(scalar.name, place.x[kept], values[kept], names)
    return scatter(scalar.name, place.scale, _upright(scalar, values), [cloud], trend, alt)


def _gridded(one: _Places, other: _Places) -> bool:
    """Whether the cases lie on a grid that a map can show, rather than anywhere."""
    if max(one.distinct.size, other.distinct.size) > _MOST_CELLS:
        return False
    taken = {pair for pair in zip(one.x.tolist(), other.x.tolist(), strict=True) if all(np.isfinite(pair))}
    return len(taken) > 0.4 * one.distinct.size * other.distinct.size


def _map(campaign: Campaign, scalar: Column, across: _Places, up: _Places) -> Html:
    values = _values(campaign, scalar)
    means = np.array([[_mean(values[(up.x == y) & (across.x == x)]) for x in across.distinct] for y in up.distinct])
    low, high = float(np.nanmin(means)), float(np.nanmax(means))
    decimals = places(high - low, max(abs(low), abs(high)))
    written = [["" if np.isnan(mean) else fixed(mean, decimals) for mean in row] for row in means.tolist()]
    alt = (
        f"{scalar.name} over {across.column.name} and {up.column.name}, "
        f"from {fixed(low, decimals)} to {fixed(high, decimals)}"
    )
    return heat_map(
        scalar.name,
        pretty(scalar.unit),
        (across.scale.label, across.names),
        (up.scale.label, up.names),
        means,
        written,
        alt,
    )


def _family(campaign: Campaign, scalar: Column, along: _Places, apart: _Places) -> Html:
    """One line of means for each value of the second axis."""
    values = _values(campaign, scalar)
    unit = f" {pretty(apart.column.unit)}" if apart.column.unit else ""
    family = [
        Line(f"{name}{unit}", along.distinct, _means(along, np.where(apart.x == position, values, np.nan)))
        for name, position in zip(apart.names, apart.distinct, strict=True)
    ]
    known = [line for line in family if np.isfinite(line.y).any()]
    return lines(scalar.name, along.scale, _upright(scalar, values), known, size=SMALL)


def _rank_correlation(x: Floats, y: Floats) -> float:
    """Spearman's, without a correction for ties."""
    if x.size < 3 or not np.ptp(x) or not np.ptp(y):
        return float("nan")
    return float(np.corrcoef(_ranks(x), _ranks(y))[0, 1])


def _ranks(values: Floats) -> Floats:
    """Ranks, equal values sharing the mean of theirs."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    shared: Floats = (last - 0.5 * (counts - 1))[place]
    return shared


def _correlations(campaign: Campaign, scalars: Sequence[Column], over: Sequence[_Places]) -> Floats:
    result = np.full((len(scalars), len(over)), np.nan)
    for i, scalar in enumerate(scalars):
        values = _values(campaign, scalar)
        for j, place in enumerate(over):
            if place.column.numbers is not None:
                known = np.isfinite(values) & np.isfinite(place.x)
                result[i, j] = _rank_correlation(place.x[known], values[known])
    return result


def _followed(ranks: Floats) -> list[int]:
    """The axes that a scalar follows most: the first in any case, more if it follows them at all."""
    strength = np.abs(np.nan_to_num(ranks))
    order = np.argsort(-strength, kind="stable").tolist()
    return [k for place, k in enumerate(order[:_FOLLOWED]) if place == 0 or strength[k] > _FOLLOWS]


def _correlation_map(scalars: Sequence[Column], over: Sequence[_Places], ranks: Floats) -> Content:
    if not np.isfinite(ranks).any():
        return None
    rows = list(reversed(range(len(scalars))))  # the first row of a map is the lowest
    written = [["" if np.isnan(rank) else f"{rank:+.2f}" for rank in ranks[k].tolist()] for k in rows]
    names = [scalars[k].name for k in rows]
    chart = heat_map(
        "What each scalar follows",
        "Spearman's rank correlation",
        ("", [place.column.name for place in over]),
        ("", names),
        ranks[rows],
        written,
        "Rank correlations of scalars with axes: "
        + "; ".join(
            f"{scalar.name} with {place.column.name} {ranks[i, j]:+.2f}"
            for i, scalar in enumerate(scalars)
            for j, place in enumerate(over)
            if np.isfinite(ranks[i, j])
        ),
        BLUE_RED,
        (-1.0, 1.0),
    )
    return tag("div", chart, class_="charts maps one")
