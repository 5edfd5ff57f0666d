"""What a run computed while it went on, from its summary: events of the grid, energy, limits, channels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeGuard

from gustform_cli.report.markup import Content, tag
from gustform_cli.report.numbers import duration, fixed, moment, places, scale, significant
from gustform_cli.report.page import details
from gustform_cli.report.run_folder import RunFolder
from gustform_cli.report.tables import Cell, table

Rows = list[list[Cell | str]]

# Keys of the summary that are shown here.
GRID_EVENTS, ENERGY, LIMITS, STATISTICS = "grid_events", "energy", "limits", "statistics"
_ENERGY = {
    "energy_mwh": "energy, MWh",
    "mean_power_mw": "mean power, MW",
    "capacity_factor": "capacity factor",
    "available_mwh": "offered by the wind, MWh",
    "reserve_mean_mw": "mean reserve, MW",
    "reserve_least_mw": "least reserve, MW",
}
_EVENT = {
    "nadir_hz": "nadir, Hz",
    "nadir_time_s": "at, s",
    "peak_hz": "peak, Hz",
    "rocof_hz_per_s": "RoCoF, Hz/s",
    "settle_hz": "settling, Hz",
    "settling_time_s": "settled after, s",
}


def computed(run: RunFolder) -> Content:
    """Tables of what there is, None if there is nothing."""
    parts: list[Content] = []
    for title, content in (
        ("Frequency after each event", _grid_events(run.summary.get(GRID_EVENTS))),
        ("Energy", _energy(run.summary.get(ENERGY))),
        ("Time at limits", _limits(run.summary.get(LIMITS))),
        ("Channels", _channels(run.summary.get(STATISTICS))),
    ):
        if content is not None:
            parts += [tag("h3", title), content]
    return parts or None


def _grid_events(events: object) -> Content:
    if not isinstance(events, Sequence) or isinstance(events, str):
        return None
    rows: Rows = [
        [
            _number(event.get("at_s"), 6),
            ", ".join(f"{target} = {value}" for target, value in (event.get("set") or {}).items()),
            *(_number(event.get(key), 5) for key in _EVENT),
        ]
        for event in events
        if isinstance(event, Mapping)
    ]
    return table(["time, s", "event", *_EVENT.values()], rows) if rows else None


def _energy(energy: object) -> Content:
    rows: Rows = [
        [Cell(tag("b", name)), *(_number(found.get(key)) for key in _ENERGY)] for name, found in _entries(energy)
    ]
    return table(["turbine", *_ENERGY.values()], rows) if rows else None


def _limits(limits: object) -> Content:
    rows: Rows = []
    for turbine, found in _entries(limits):
        for name, at in _entries(found):
            seconds, share = at.get("seconds"), at.get("share")
            rows.append(
                [
                    Cell(tag("b", turbine)),
                    Cell(tag("code", name)),
                    Cell(tag("span", str(at.get("when", "")), class_="soft")),
                    Cell(duration(seconds) if seconds else "never", seconds) if _is_number(seconds) else "–",
                    Cell(f"{100.0 * share:.3g} %", share) if _is_number(share) else "–",
                ]
            )
    return table(["turbine", "limit", "when", "time at it", "share"], rows, fit=True) if rows else None


def _channels(statistics: object) -> Content:
    found = list(_entries(statistics))
    slopes = list(dict.fromkeys(slope for _, one in found for slope in one.get("damage_equivalent_load") or ()))
    heads = ["channel", "unit", "mean", "std", "min", "at", "max", "at", "samples"]
    heads += [f"DEL, m = {slope}" for slope in slopes]
    rows = {name: _channel(name, one, slopes) for name, one in found}
    outer = [row for name, row in rows.items() if name.count(".") <= 1]
    inner = [row for name, row in rows.items() if name.count(".") > 1]
    if not rows:
        return None
    if not outer or not inner:
        return table(heads, outer or inner, sortable=True)
    folded = details(f"Channels inside of components ({len(inner)})", table(heads, inner, sortable=True))
    return [table(heads, outer, sortable=True), folded]


def _channel(name: str, one: Mapping[str, Any], slopes: Sequence[str]) -> list[Cell | str]:
    low, high = one.get("min"), one.get("max")
    ends = [abs(value) for value in (low, high) if _is_number(value)]
    largest = max(ends, default=0.0)
    factor, unit = scale(str(one.get("unit", "")), largest)
    spread = high - low if _is_number(low) and _is_number(high) else 0.0
    decimals = places(spread / factor, largest / factor)

    def shown(value: Any) -> Cell | str:
        return Cell(fixed(value / factor, decimals), value) if _is_number(value) else "–"

    def at(time: Any) -> Cell | str:
        return Cell(tag("span", moment(time), class_="soft"), time) if _is_number(time) else "–"

    loads = one.get("damage_equivalent_load") or {}
    missing = one.get("not_finite")
    samples = _number(one.get("samples"))
    return [
        Cell([tag("code", name), f" ({missing} samples were no numbers)" if missing else None]),
        unit,
        shown(one.get("mean")),
        shown(one.get("std")),
        shown(low),
        at(one.get("min_time_s")),
        shown(high),
        at(one.get("max_time_s")),
        samples,
        *(shown(loads.get(slope)) for slope in slopes),
    ]


def _entries(block: object) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if isinstance(block, Mapping):
        yield from ((str(name), entry) for name, entry in block.items() if isinstance(entry, Mapping))


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _number(value: Any, digits: int = 4) -> Cell | str:
    return Cell(significant(float(value), digits), float(value)) if _is_number(value) else "–"
