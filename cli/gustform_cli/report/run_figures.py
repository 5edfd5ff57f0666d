"""The numbers of a run that a reader looks for: frequency, wind, energy, speed of the computation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import h5py

from gustform_cli.frequency import ROCOF_WINDOW, SETTLE_AFTER
from gustform_cli.progress import times
from gustform_cli.report.channel_statistics import Moments, turbulent
from gustform_cli.report.numbers import duration, moment, significant
from gustform_cli.report.run_folder import RunFolder
from gustform_cli.report.run_statistics import ENERGY
from gustform_cli.report.tables import Figure

_TURBINES = 3  # with figures of their own; the table of channels has all
_JOULES_PER_WH = 3600.0


def key_numbers(run: RunFolder, file: h5py.File | None, found: Mapping[str, Moments]) -> list[Figure]:
    """Figures in the order of interest."""
    figures = list(_frequency(run))
    if file is not None and "time" in file and file["time"].shape[0] > 1:
        span = float(file["time"][-1] - file["time"][0])
        for name in _turbines(found)[:_TURBINES]:
            figures += _turbine(run, name, file, found, span)
    figures += _computation(run)
    return figures


def _frequency(run: RunFolder) -> Iterator[Figure]:
    frequency = run.summary.get("frequency") or {}
    nadir, at = frequency.get("nadir_hz"), frequency.get("nadir_time_s")
    if nadir is not None:
        yield Figure("Frequency nadir", f"{nadir:.3f}", "Hz", f"at {moment(at)}" if at is not None else "")
    settled = frequency.get("settle_hz")
    if settled is not None:
        begin = min((float(event["at"]) for event in run.parts["events"] or ()), default=math.inf)
        reached = float(run.summary.get("simulated_seconds", 0.0)) >= begin + SETTLE_AFTER
        note = f"{SETTLE_AFTER:g} s after the first event" if reached else "at the end"
        yield Figure("Settling", f"{settled:.3f}", "Hz", note)
    rocof = frequency.get("rocof_hz_per_s")
    if rocof is not None:
        yield Figure("RoCoF", f"{rocof:.3f}", "Hz/s", f"over {ROCOF_WINDOW:g} s after the first event")


def _turbines(found: Mapping[str, Moments]) -> list[str]:
    return [name.removesuffix(".wind") for name in found if name.endswith(".wind") and name.count(".") == 1]


def _turbine(run: RunFolder, name: str, file: h5py.File, found: Mapping[str, Moments], span: float) -> Iterator[Figure]:
    wind = found[f"{name}.wind"]
    if turbulent(file[f"{name}.wind"]):
        note = f"turbulence intensity {100 * wind.std / wind.mean:.1f} %"
    elif wind.spread > 1e-6:
        note = f"{significant(wind.low, 3)} … {significant(wind.high, 3)} m/s"
    else:
        note = "constant"
    yield Figure(f"Wind of {name}", significant(wind.mean, 3), "m/s", note)
    # What the run computed from every sample is better than what the stored rows give.
    energy = (run.summary.get(ENERGY) or {}).get(name) or {}
    mean, whole, factor = (energy.get(key) for key in ("mean_power_mw", "energy_mwh", "capacity_factor"))
    power, per_unit = found.get(f"{name}.P"), found.get(f"{name}.P_gsc")
    if whole is None and power is not None:
        mean, whole = power.integral / span / 1e6, power.integral / _JOULES_PER_WH / 1e6
    if factor is None and per_unit is not None:
        factor = per_unit.mean
    if whole is not None:
        note = f"{significant(mean)} MW in the mean" if mean is not None else ""
        yield Figure(f"Energy of {name}", significant(whole), "MWh", note)
    if factor is not None:
        yield Figure("Capacity factor", f"{factor:.3f}", "", f"mean power over rating of {name}")


def _computation(run: RunFolder) -> Iterator[Figure]:
    factor = run.summary.get("real_time_factor")
    if factor:
        wall, simulated = run.summary.get("wall_seconds", 0.0), run.summary.get("simulated_seconds", 0.0)
        note = f"{duration(simulated)} in {significant(wall, 3)} s"
        yield Figure("Real-time factor", times(factor), "", note)
