"""The group `statistics` of a result file; xarray.open_dataset(file, group="statistics") reads it.

Variables stand over `channel`, and over `turbine` where they belong to one; the attributes name the algorithms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gustform_cli.statistics import ChannelStatistics, Report

if TYPE_CHECKING:
    import h5py

GROUP = "statistics"
WELCH = "Welch: Hann window, half overlap, mean of each segment taken off, one-sided density"


# Of a grid event: its key in summary.json and the variable, unit and sentence here.
_EVENT = {
    "nadir_hz": ("nadir", "Hz", "lowest grid frequency after the event"),
    "nadir_time_s": ("nadir_time", "s", "when that was"),
    "peak_hz": ("peak", "Hz", "highest grid frequency after the event"),
    "peak_time_s": ("peak_time", "s", "when that was"),
    "rocof_hz_per_s": ("rocof", "Hz/s", "mean rate of change over the first 100 ms"),
    "settle_hz": ("settle", "Hz", "grid frequency at the end of the window"),
    "settling_time_s": ("settling_time", "s", "from the event until it stays near that"),
}


def write_statistics(file: h5py.File, found: Report | None, events: Sequence[Mapping[str, Any]] = ()) -> None:
    """Add the group. Nothing is added where there are neither statistics nor grid events."""
    if found is not None and found.channels:
        group = _Group(file.create_group(GROUP, track_order=True))
        _channels(group, found)
        _turbines(group, found)
        _events(group, events)
    elif events:
        _events(_Group(file.create_group(GROUP, track_order=True)), events)


def _channels(group: _Group, found: Report) -> None:
    from gustform_runtime import RAINFLOW

    plan, channels = found.plan, found.channels
    group.attribute("every_seconds", plan.every)
    group.attribute("start_seconds", plan.start)
    group.texts("channel", [one.channel.name for one in channels], "channel")
    group.texts("unit", [one.channel.unit for one in channels], "unit of the channel", over="channel")
    moments = [one.moments for one in channels]
    group.add("mean", [m.mean for m in moments], "mean of the samples")
    group.add("std", [m.deviation for m in moments], "standard deviation of the samples about their mean")
    group.add("min", [m.minimum for m in moments], "smallest sample")
    group.add("max", [m.maximum for m in moments], "largest sample")
    group.add("min_time", [m.t_minimum for m in moments], "time of the smallest sample", units="s")
    group.add("max_time", [m.t_maximum for m in moments], "time of the largest sample", units="s")
    group.add("samples", np.array([m.count for m in moments], np.int64), "number of finite samples")
    group.add("not_finite", np.array([m.not_finite for m in moments], np.int64), "samples left out: no number")
    if channels[0].histogram is not None:
        _histograms(group, found)
    if channels[0].spectrum is not None:
        _spectra(group, channels)
    if channels[0].cycles is not None:
        group.attribute("rainflow", RAINFLOW)
        _cycles(group, found)


def _histograms(group: _Group, found: Report) -> None:
    histograms = [one.histogram for one in found.channels if one.histogram is not None]
    bins = found.plan.block.bins
    edges = np.array([np.linspace(low, high, bins + 1) for low, high in found.plan.spans])
    group.add("bin_edges", edges, "edges of the bins, in the unit of the channel", over=("channel", "bin_edge"))
    counts = np.array([h.count for h in histograms])
    group.add("histogram", counts, "samples in each bin, the last one closed above", over=("channel", "bin"))
    group.add("below", np.array([h.below for h in histograms]), "samples below the first edge")
    group.add("above", np.array([h.above for h in histograms]), "samples above the last edge")


def _spectra(group: _Group, channels: tuple[ChannelStatistics, ...]) -> None:
    spectra = [one.spectrum for one in channels if one.spectrum is not None]
    group.attribute("spectrum", WELCH)
    group.scale("frequency", spectra[0].frequency, "frequency of the spectrum", units="Hz")
    density = np.array([s.density for s in spectra])
    group.add("psd", density, "power spectral density, unit squared per Hz", over=("channel", "frequency"))
    group.add("segments", np.array([s.segments for s in spectra]), "segments that the density is the mean of")


def _cycles(group: _Group, found: Report) -> None:
    counted = [(one, one.cycles) for one in found.channels if one.cycles is not None]
    block = found.plan.block
    group.scale("wohler", np.array(block.wohler), "slope of the fatigue curve")
    loads = np.array([found.equivalent_loads(one) for one, _ in counted])
    group.add("damage_equivalent_load", loads, "range that does the same damage at 1 Hz", over=("channel", "wohler"))
    group.add("full_cycles", np.array([c.full for _, c in counted]), "full rainflow cycles")
    group.add("half_cycles", np.array([c.half for _, c in counted]), "half rainflow cycles")
    group.add("forced_cycles", np.array([c.forced for _, c in counted]), "full cycles counted before they closed")
    group.add("largest_range", [c.largest for _, c in counted], "largest rainflow range")
    widths = [(high - low) / block.bins for low, high in found.plan.spans]
    group.add("range_width", widths, "width of the bins of ranges, which begin at 0")
    group.add(
        "range_cycles", np.array([c.cycles for _, c in counted]), "cycles in each bin of ranges; the last: above all",
        over=("channel", "range_bin"),
    )  # fmt: skip


def _turbines(group: _Group, found: Report) -> None:
    if not found.energies:
        return
    energies = found.energies
    group.texts("turbine", [one.turbine for one in energies], "turbine")
    over = ("turbine",)
    group.add("energy", [one.mwh for one in energies], "energy delivered", over=over, units="MWh")
    group.add("mean_power", [one.mean_power for one in energies], "mean power delivered", over=over, units="W")
    group.add("capacity_factor", [one.capacity_factor for one in energies], "mean over rated power", over=over)
    group.add("available_power", [one.available for one in energies], "mean that the wind offers", over=over, units="W")
    group.add("reserve", [one.reserve for one in energies], "mean reserve, offered less taken", over=over, units="W")
    group.add("least_reserve", [one.least_reserve for one in energies], "least reserve", over=over, units="W")
    names = list(dict.fromkeys(at.limit.name for at in found.limits))
    turbines = [one.turbine for one in energies]
    times = np.full((len(turbines), len(names)), np.nan)
    for at in found.limits:
        if at.turbine in turbines:
            times[turbines.index(at.turbine), names.index(at.limit.name)] = at.seconds
    group.texts("limit", names, "limit; summary.json says when a turbine stands at it")
    group.add("time_at_limit", times, "time at each limit", over=("turbine", "limit"), units="s")


def _events(group: _Group, events: Sequence[Mapping[str, Any]]) -> None:
    if not events:
        return
    group.scale("event", np.array([event["at_s"] for event in events]), "moment of the grid event", units="s")
    for key, (name, unit, text) in _EVENT.items():
        values = [event[key] for event in events]
        numbers = np.array([np.nan if value is None else value for value in values])
        group.add(name, numbers, text, over=("event",), units=unit)


class _Group:
    """A group in the making: datasets over named dimensions, each a scale of the group as netCDF-4 wants it."""

    def __init__(self, group: h5py.Group) -> None:
        self._group = group

    def attribute(self, name: str, value: float | str) -> None:
        self._group.attrs[name] = value

    def scale(self, name: str, values: NDArray[Any], text: str, units: str = "") -> None:
        """A dimension with its coordinate."""
        data = self._group.create_dataset(name, data=values)
        self._describe(data, text, units)
        data.make_scale(name)

    def texts(self, name: str, values: list[str], text: str, over: str = "") -> None:
        """Words over a dimension, or a dimension of words."""
        import h5py

        data = self._group.create_dataset(name, data=np.array(values, dtype=object), dtype=h5py.string_dtype())
        self._describe(data, text, "")
        if over:
            data.dims[0].attach_scale(self._group[over])
        else:
            data.make_scale(name)

    def add(self, name: str, values: Any, text: str, over: tuple[str, ...] = ("channel",), units: str = "") -> None:
        """A variable; a dimension that is not there yet is made without a coordinate."""
        array = np.asarray(values)
        data = self._group.create_dataset(name, data=array)
        self._describe(data, text, units)
        for axis, dimension in enumerate(over):
            if dimension not in self._group:
                bare = self._group.create_dataset(dimension, (array.shape[axis],), np.float32)
                # What netCDF-4 calls a dimension that has no variable.
                bare.make_scale(f"This is a netCDF dimension but not a netCDF variable.{array.shape[axis]:10d}")
            data.dims[axis].attach_scale(self._group[dimension])

    def _describe(self, data: h5py.Dataset, text: str, units: str) -> None:
        data.attrs["long_name"] = text
        if units:
            data.attrs["units"] = units
