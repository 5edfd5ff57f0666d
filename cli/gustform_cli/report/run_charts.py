"""The charts of a run: its panels over time, and distribution and spectrum of what turbulence moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np

from gustform_cli.panels import FREQUENCY, Panel, filled_panels
from gustform_cli.report import axis
from gustform_cli.report.channel_statistics import Moments, histogram, octaves, spectrum, turbulent
from gustform_cli.report.charts import SMALL, Floats, Line, Mark, Vertical, bars, lines
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import pretty, significant
from gustform_cli.report.run_folder import RunFolder
from gustform_cli.run_data import RunData

_BINS = 40
_SEGMENTS = 8  # pieces a spectrum is the mean of, at least; more where the run is long
_LONGEST_SEGMENT = 1 << 14  # rows
# What turbulence moves, by the ends of channel names: quantity, and how it is called.
_MOVED = (
    (".wind", "Wind"),
    (".P_gsc", "Converter power"),
    (".omega_r", "Rotor speed"),
    (".beta", "Pitch angle"),
    (".v_dc", "DC voltage"),
)


def panels(run: RunFolder, data: RunData) -> Html | None:
    """All panels of the run's figure that it has channels for."""
    time = axis.time(float(data.time[0]), float(data.time[-1]))
    filled = filled_panels(data)
    charts = [
        _panel(run, data, time, panel, curves, first=number == 0) for number, (panel, curves) in enumerate(filled)
    ]
    return tag("div", charts, class_="charts") if charts else None


def turbulence(file: h5py.File, found: dict[str, Moments], run: RunFolder) -> Content:
    """Distribution and spectrum of a few channels, None where no wind is turbulent."""
    every = _spacing(file["time"])
    rows = file["time"].shape[0]
    if not any(name.endswith(".wind") and turbulent(file[name]) for name in found):
        return None
    chosen = [
        (name, title)
        for end, title in _MOVED
        if (name := next((n for n in found if n.endswith(end)), None)) is not None
    ]
    if (grid := run.texts.get("frequency_channel", "")) in found:
        chosen.append((grid, "Grid frequency"))
    chosen = [
        (name, title)
        for name, title in chosen
        if found[name].spread > 1e-9 * max(abs(found[name].high), abs(found[name].low))
    ]
    segment = min(_LONGEST_SEGMENT, 2 * rows // (_SEGMENTS + 1))
    segment -= segment % 2
    parts: list[Content] = [
        tag("h3", "Distributions"),
        tag(
            "div",
            [_distribution(file[name], found[name], title, name) for name, title in chosen],
            class_="charts small",
        ),
    ]
    made = {name: own for name, _ in chosen if (own := _made_while_running(file, name)) is not None}
    if every is not None and segment >= 64:
        made = {name: spectrum(file[name], every, segment) for name, _ in chosen if name not in made} | made
    if made:
        densities = [_density(file[name], *made[name], title, name) for name, title in chosen if name in made]
        parts += [tag("h3", "Spectral densities"), tag("div", densities, class_="charts small")]
    return parts


def _panel(
    run: RunFolder,
    data: RunData,
    time: axis.Axis,
    panel: Panel,
    curves: Sequence[tuple[str, Floats]],
    *,
    first: bool,
) -> Html:
    known = np.concatenate([values[np.isfinite(values)] for _, values in curves])
    marks = _nadir(run) if panel.title == FREQUENCY.title else []
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    low -= 0.12 * (high - low) * len(marks)  # room for the text below the curve
    values = axis.linear(low, high, panel.unit, least=panel.least)
    moments = [_event(event, named=first) for event in run.parts["events"] or ()]
    trips = run.summary.get("trips") or {}
    moments += [
        Vertical(at, f"{name} trips" if first and number == 0 else "", "trip")
        for number, (name, at) in enumerate(sorted(trips.items(), key=lambda trip: float(trip[1])))
    ]
    return lines(panel.title, time, values, [Line(label, data.time, y) for label, y in curves], marks, moments)


def _event(event: dict[str, Any], *, named: bool) -> Vertical:
    text = ", ".join(f"{target} = {value}" for target, value in event["set"].items()) if named else ""
    return Vertical(float(event["at"]), text)


def _nadir(run: RunFolder) -> list[Mark]:
    frequency = run.summary.get("frequency") or {}
    nadir, at = frequency.get("nadir_hz"), frequency.get("nadir_time_s")
    if nadir is None or at is None or not run.parts["events"]:
        return []
    return [Mark(at, nadir, f"nadir {nadir:.3f} Hz")]


def _spacing(time: h5py.Dataset) -> float | None:
    """Seconds between rows, None if they differ. Looked at in the first rows: a run writes them at one spacing."""
    steps = np.diff(np.asarray(time[:1000], np.float64))
    return float(steps.mean()) if steps.size and np.ptp(steps) < 1e-6 * steps.mean() else None


def _distribution(data: h5py.Dataset, moments: Moments, title: str, name: str) -> Html:
    unit = pretty(str(data.attrs.get("units", "")))
    edges, share = histogram(data, moments.low, moments.high, _BINS)
    percent = 100.0 * share
    across = axis.linear(moments.low, moments.high, f"{name}, {unit}", room=0.02)
    up = axis.linear(0.0, float(percent.max()), "% of the rows", room=0.0)
    alt = (
        f"Histogram of {name}: mean {significant(moments.mean)}, standard deviation {significant(moments.std)}, "
        f"from {significant(moments.low)} to {significant(moments.high)} {unit}"
    )
    return bars(title, across, up, edges, percent, alt)


def _made_while_running(file: h5py.File, name: str) -> tuple[Floats, Floats] | None:
    """The spectrum that the run made of every sample, if it did: better than one of stored rows."""
    group = file.get("statistics")
    if not isinstance(group, h5py.Group) or not {"channel", "frequency", "psd"} <= set(group):
        return None
    names = [str(text) for text in group["channel"].asstr()[:]]
    if name not in names:
        return None
    density = np.asarray(group["psd"][names.index(name)], np.float64)
    return (np.asarray(group["frequency"], np.float64), density) if density.max() > 0.0 else None


def _density(data: h5py.Dataset, frequency: Floats, density: Floats, title: str, name: str) -> Html:
    unit = pretty(str(data.attrs.get("units", "")))
    frequency, density = octaves(frequency, density)
    # float32 rows end eight decades below their size; what is drawn beyond twelve is their rounding.
    seen = density > 1e-12 * density.max()
    frequency, density = frequency[seen], density[seen]
    across = axis.decades(float(frequency[0]), float(frequency[-1]), "frequency, Hz")
    up = axis.decades(float(density.min()), float(density.max()), f"{unit if unit.isalpha() else f'({unit})'}²/Hz")
    return lines(title, across, up, [Line(name, frequency, density)], size=SMALL)
