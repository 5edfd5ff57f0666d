"""The tables of a campaign: what was varied, what failed and why, statistics of the scalars, all cases."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from gustform_cli.report.campaign_charts import by_interest, is_outer
from gustform_cli.report.campaign_folder import WEIGHT, Campaign, Column
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import fixed, places, plain, pretty, significant
from gustform_cli.report.page import details
from gustform_cli.report.tables import Cell, table

_LISTED = 8  # values of an axis, cases of a failure
_MOST_SCALARS = 40  # columns of the table of cases
_MOST_CELLS = 12_000  # of the table of cases: more make a page that no browser likes
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def axes(campaign: Campaign) -> Html | None:
    """Each axis with its values."""
    rows: list[list[Cell | str]] = []
    for column in campaign.axes:
        if column.name == WEIGHT:  # follows from the wind speed
            continue
        distinct = column.distinct()
        rows.append(
            [
                Cell(tag("code", column.name)),
                pretty(column.unit),
                Cell(str(len(distinct)), len(distinct)),
                _values(column, distinct),
                Cell(tag("span", column.description, class_="soft")),
            ]
        )
    heads = ["axis", "unit", "values", "", ""]
    return table(heads, rows, fit=True) if rows else None


def _values(column: Column, distinct: Sequence[object]) -> str:
    if len(distinct) <= _LISTED:
        return ", ".join(plain(value) for value in distinct)
    if column.numbers is not None:
        low, high = float(np.nanmin(column.numbers)), float(np.nanmax(column.numbers))
        return f"{significant(low)}\u00a0…\u00a0{significant(high)}"
    return ", ".join(str(value) for value in distinct[:_LISTED]) + ", …"


def failures(campaign: Campaign) -> Html | None:
    """Reasons, the most frequent first, with their cases. Reasons that differ in numbers only are one."""
    groups: dict[str, list[int]] = {}
    for k, done in enumerate(campaign.done.tolist()):
        if not done:
            reason = campaign.errors[k] or campaign.statuses[k]
            groups.setdefault(_NUMBER.sub("#", reason), []).append(k)
    rows: list[list[Cell | str]] = [
        [
            Cell(str(len(cases)), len(cases)),
            Cell(campaign.errors[cases[0]] or f"{campaign.statuses[cases[0]]}, without a reason"),
            Cell(_links(campaign, cases)),
        ]
        for cases in sorted(groups.values(), key=len, reverse=True)
    ]
    return table(["cases", "reason, in the words of the first", "which"], rows) if rows else None


def _links(campaign: Campaign, cases: Sequence[int]) -> Content:
    shown: list[Content] = []
    for k in cases[:_LISTED]:
        shown += [", " if shown else None, _link(campaign, k)]
    return [*shown, ", …" if len(cases) > _LISTED else None]


def _link(campaign: Campaign, k: int) -> Html:
    """The case's name, leading to its row where the table has one."""
    name = campaign.cases[k]
    return tag("a", name, href=f"#case-{k}") if k < rows_shown(campaign) else Html(tag("span", name))


def scalars(campaign: Campaign) -> Html | None:
    """Mean, deviation, median and extremes of every scalar, with the cases of the extremes.

    What is inside of components and what the computation cost is folded away.
    """
    ordered = by_interest(campaign.scalars)
    outer = _statistics(campaign, [column for column in ordered if is_outer(column)])
    inner = _statistics(campaign, [column for column in ordered if not is_outer(column)])
    if outer is None or inner is None:
        return outer or inner
    return Html(outer + details("Channels inside of components, and what the computation cost", inner))


def _statistics(campaign: Campaign, columns: Sequence[Column]) -> Html | None:
    done = campaign.done
    weight = next((axis.numbers for axis in campaign.axes if axis.name == WEIGHT), None)
    rows: list[list[Cell | str]] = []
    for column in columns:
        if column.numbers is None:
            continue
        numbers = np.where(done, column.numbers, np.nan)
        known = numbers[np.isfinite(numbers)]
        if not known.size:
            continue
        decimals = places(float(np.ptp(known)), float(np.abs(known).max()))
        lowest, highest = int(np.nanargmin(numbers)), int(np.nanargmax(numbers))
        figures = [known.mean(), known.std(), np.percentile(known, 5), np.median(known), np.percentile(known, 95)]
        if weight is not None:
            there = np.isfinite(numbers) & np.isfinite(weight)
            figures.insert(1, np.average(numbers[there], weights=weight[there]) if weight[there].sum() > 0 else np.nan)
        rows.append(
            [
                Cell(tag("code", column.name), None),
                pretty(column.unit),
                Cell(str(known.size), known.size),
                *(Cell(fixed(float(figure), decimals), float(figure)) for figure in figures),
                *(
                    Cell(
                        [fixed(float(numbers[k]), decimals), tag("small", " in ", _link(campaign, k), class_="soft")],
                        float(numbers[k]),
                    )
                    for k in (lowest, highest)
                ),
            ]
        )
    by_weight = ["by weight"] if weight is not None else []
    heads = ["scalar", "unit", "cases", "mean", *by_weight, "std", "5 %", "median", "95 %", "lowest", "highest"]
    return table(heads, rows, sortable=True) if rows else None


def rows_shown(campaign: Campaign) -> int:
    """How many cases the table of cases has room for."""
    return min(len(campaign.cases), _MOST_CELLS // (2 + len(_columns(campaign))))


def _columns(campaign: Campaign) -> list[Column]:
    outer = [column for column in by_interest(campaign.scalars) if is_outer(column)]
    effort = [column for column in campaign.scalars if column.name.count(".") == 0 and not is_outer(column)]
    return [*campaign.axes, *[*outer, *effort][:_MOST_SCALARS]]


def cases(campaign: Campaign) -> Html | None:
    """All cases with their values, or as many as a page can hold."""
    columns = _columns(campaign)
    decimals = [_decimals(column) for column in columns]
    rows: list[list[Cell | str]] = [
        [
            Cell(tag("span", campaign.cases[k], id=f"case-{k}"), _number(campaign.cases[k])),
            campaign.statuses[k] if done else Cell(tag("span", campaign.statuses[k], class_="bad")),
            *(_value(column, k, d) for column, d in zip(columns, decimals, strict=True)),
        ]
        for k, done in enumerate(campaign.done[: rows_shown(campaign)].tolist())
    ]
    heads: list[Content] = ["case", "status"]
    heads += [[tag("code", column.name), f" {pretty(column.unit)}" if column.unit else None] for column in columns]
    return table(heads, rows, sortable=True) if rows else None


def _decimals(column: Column) -> int:
    if column.numbers is None:
        return 0
    known = column.numbers[np.isfinite(column.numbers)]
    if not known.size:
        return 0
    if np.all(known == np.round(known)):
        return 0
    return places(float(np.ptp(known)), float(np.abs(known).max()))


def _value(column: Column, k: int, decimals: int) -> Cell | str:
    if column.numbers is None:
        value = column.values[k]
        return "–" if value is None else plain(value)
    number = float(column.numbers[k])
    return Cell(fixed(number, decimals), number)


def _number(case: str) -> float | None:
    return float(case) if case.isdigit() else None
