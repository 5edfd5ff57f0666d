"""Statistics of a run against numpy, scipy and rainflow on its stored rows; limits, energy and grid events."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rainflow
import scipy.signal
import xarray
from typer.testing import CliRunner

from gustform_cli.closing import closing_lines
from gustform_cli.grid_events import EventWatch, Window, event_figures, windows
from gustform_cli.main import app
from gustform_cli.new import SCENARIOS
from gustform_cli.simulate import Outcome
from gustform_cli.statistics import segment_samples
from gustform_cli.summary import Summary

TURBULENT = SCENARIOS / "turbulent_10min.yaml"
FARM = SCENARIOS / "farm.yaml"
EVERY = 0.05
CHANNELS = "[sg.frequency, wt.wind, wt.omega_r, wt.beta, wt.P, wt.P_wt, wt.P_reserve, wt.P_available]"
EXTRA = "[wt.pitch.P_filtered, wt.pitch.servo.rate]"


def simulate(out: Path, *changes: str, scenario: Path = TURBULENT) -> dict[str, Any]:
    sets = [word for change in changes for word in ("--set", change)]
    result = CliRunner().invoke(app, ["simulate", str(scenario), "--out", str(out), "--no-figure", *sets])
    assert result.exit_code == 0, result.stderr
    summary: dict[str, Any] = json.loads((out / "summary.json").read_text())
    return summary


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], xarray.Dataset, xarray.Dataset]:
    """Two minutes with a gusty end, all statistics, rows in double precision at the same times."""
    out = tmp_path_factory.mktemp("statistics")
    summary = simulate(
        out, "run.until=120 s", "events[0].at=60 s", "output.precision=float64",
        f"output.channels={CHANNELS[:-1]}, {EXTRA[1:]}",
        "output.statistics={of: [histogram, psd, rainflow], segment: 20 s, ranges: {wt.wind: [8 m/s, 12 m/s]}}",
    )  # fmt: skip
    file = out / "result.nc"
    return summary, xarray.load_dataset(file), xarray.load_dataset(file, group="statistics")


def test_moments_are_those_of_the_rows(run: tuple[dict[str, Any], xarray.Dataset, xarray.Dataset]) -> None:
    summary, rows, found = run
    assert rows["wt.omega_r"].dtype == np.float64
    assert set(summary["statistics"]) == set(found["channel"].values) == set(rows.data_vars)
    for name in rows.data_vars:
        values, one = rows[name].values, found.sel(channel=name)
        # The bound. Scaled by the largest value, since a mean may be close to zero.
        tolerance = 1e-10 * max(1e-12, float(np.abs(values).max()))
        for key, expected in (
            ("mean", values.mean()),
            ("std", values.std()),
            ("min", values.min()),
            ("max", values.max()),
        ):
            assert abs(one[key].item() - expected) <= tolerance, (name, key)
            assert summary["statistics"][name][key] == one[key].item()
        assert one["min_time"].item() == pytest.approx(rows["time"].values[values.argmin()], abs=1e-9)
        assert one["samples"].item() == values.size == 2401


def test_histograms_are_those_of_the_rows(run: tuple[dict[str, Any], xarray.Dataset, xarray.Dataset]) -> None:
    _, rows, found = run
    for name in rows.data_vars:
        values, one = rows[name].values, found.sel(channel=name)
        edges = one["bin_edges"].values
        assert np.array_equal(one["histogram"].values, np.histogram(values, edges)[0]), name
        assert one["below"].item() == np.count_nonzero(values < edges[0])
        assert one["above"].item() == np.count_nonzero(values > edges[-1])
    wind = found.sel(channel="wt.wind")["bin_edges"].values
    assert (wind[0], wind[-1], wind.size) == (8.0, 12.0, 101)


def test_spectra_are_those_of_the_rows(run: tuple[dict[str, Any], xarray.Dataset, xarray.Dataset]) -> None:
    _, rows, found = run
    segment = segment_samples(20.0, EVERY)
    assert segment == 512, "400 samples, rounded up"
    for name in ("wt.wind", "wt.omega_r", "wt.P", "sg.frequency"):
        frequency, density = scipy.signal.welch(rows[name].values, 1.0 / EVERY, nperseg=segment)
        one = found.sel(channel=name)
        assert np.allclose(one["frequency"], frequency, rtol=1e-12)
        # The bound is 1e-6; of the largest density, as round-off is.
        assert np.max(np.abs(one["psd"].values - density)) <= 1e-6 * density.max(), name
        assert one["segments"].item() == (2401 - segment // 2) // (segment // 2)


def test_cycles_are_those_of_the_rows(run: tuple[dict[str, Any], xarray.Dataset, xarray.Dataset]) -> None:
    summary, rows, found = run
    assert "ASTM E1049-85" in found.attrs["rainflow"]
    for name in ("wt.wind", "wt.omega_r", "wt.P", "wt.P_wt", "sg.frequency"):
        cycles = list(rainflow.extract_cycles(rows[name].values))
        one = found.sel(channel=name)
        assert one["full_cycles"].item() == sum(count == 1.0 for _, _, count, _, _ in cycles)
        assert one["half_cycles"].item() == sum(count == 0.5 for _, _, count, _, _ in cycles)
        assert one["largest_range"].item() == max(size for size, *_ in cycles)
        seconds = 2401 * EVERY
        for m in (3.0, 4.0, 10.0):
            expected = (sum(count * size**m for size, _, count, _, _ in cycles) / seconds) ** (1.0 / m)
            load = one["damage_equivalent_load"].sel(wohler=m).item()
            assert load == pytest.approx(expected, rel=1e-12)
            assert summary["statistics"][name]["damage_equivalent_load"][f"{m:g}"] == load


def test_energy_limits_and_reserve_are_those_of_the_rows(
    run: tuple[dict[str, Any], xarray.Dataset, xarray.Dataset],
) -> None:
    summary, rows, found = run
    energy = summary["energy"]["wt"]
    # Ten turbines of 5 MW. Trapezoids against means of samples: they part by what the two ends have in excess.
    assert energy["energy_mwh"] == pytest.approx(
        np.trapezoid(rows["wt.P"].values, rows["time"].values) / 3.6e9, rel=1e-3
    )
    assert energy["mean_power_mw"] == pytest.approx(rows["wt.P"].values.mean() / 1e6, rel=1e-12)
    assert energy["capacity_factor"] == pytest.approx(energy["mean_power_mw"] / 50.0, rel=1e-12)
    reserve = rows["wt.P_reserve"].values
    assert energy["reserve_mean_mw"] == pytest.approx(50.0 * reserve.mean(), rel=1e-10)
    assert energy["reserve_least_mw"] == pytest.approx(50.0 * reserve.min(), rel=1e-10)
    at = {
        "omega_max": rows["wt.omega_r"].values > 1.2 - 1e-3,
        "P_max": rows["wt.pitch.P_filtered"].values > 1.0 - 1e-3,
        "beta_min": rows["wt.beta"].values < 1e-2,
        "beta_max": rows["wt.beta"].values > 90.0 - 1e-2,
        "pitch_rate": np.abs(rows["wt.pitch.servo.rate"].values) > 0.999 * 8.0,
    }
    assert set(summary["limits"]["wt"]) == set(at)
    for name, where in at.items():
        seconds = summary["limits"]["wt"][name]["seconds"]
        assert seconds == pytest.approx(EVERY * np.count_nonzero(where), abs=1e-12), name
        assert found["time_at_limit"].sel(turbine="wt", limit=name).item() == seconds
    assert summary["limits"]["wt"]["omega_max"]["seconds"] > 0.0, "gusts take the rotor there"
    assert summary["limits"]["wt"]["omega_max"]["when"] == "wt.omega_r above 1.199 pu"


def test_statistics_do_not_depend_on_what_is_stored(
    tmp_path: Path, run: tuple[dict[str, Any], xarray.Dataset, xarray.Dataset]
) -> None:
    """Rows at 1 Hz and one channel stored; statistics see 20 Hz and channels that are not stored. The last bits of a
    mean do not depend on it either."""
    summary = simulate(
        tmp_path, "run.until=120 s", "events[0].at=60 s", "output.every=1 s", "output.channels=[wt.wind]",
        "output.statistics={every: 50 ms, channels: [wt.omega_r, sg.frequency], of: [rainflow], start: 0 s}",
    )  # fmt: skip
    full = run[0]
    assert set(summary["statistics"]) == {"wt.omega_r", "sg.frequency"}
    with xarray.open_dataset(tmp_path / "result.nc") as rows:
        assert dict(rows.sizes) == {"time": 121}
        assert set(rows.data_vars) == {"sg.frequency", "wt.wind"}
    for name, one in summary["statistics"].items():
        assert one == full["statistics"][name]
    assert summary["energy"] == full["energy"]
    assert summary["limits"] == full["limits"]
    # 50 ms beside rows that are 1 s apart, with full precision: the same frequencies after the event.
    (mine,), (theirs,) = summary["grid_events"], full["grid_events"]
    for name, value in mine.items():
        assert value == (pytest.approx(theirs[name], rel=1e-12) if name != "set" else theirs[name]), name
    assert mine["rocof_hz_per_s"] < -0.1
    event = run[2].sel(event=60.0)
    assert event["nadir"].item() == theirs["nadir_hz"]
    assert event["settling_time"].item() == theirs["settling_time_s"]


def test_statistics_begin_where_they_are_told(tmp_path: Path) -> None:
    summary = simulate(
        tmp_path, "run.until=20 s", "output.precision=float64", "output.statistics={start: 5 s}",
    )  # fmt: skip
    with xarray.open_dataset(tmp_path / "result.nc") as rows:
        late = rows["wt.wind"].where(rows["time"] >= 5.0 - 1e-9, drop=True).values
    assert summary["statistics"]["wt.wind"]["mean"] == pytest.approx(late.mean(), rel=1e-12)
    assert summary["statistics"]["wt.wind"]["samples"] == late.size == 301


def test_double_precision_rounds_to_single(tmp_path: Path) -> None:
    """Rows of either kind are the same numbers, also at the moment of an event, where they hold what was before it."""
    for kind in ("float32", "float64"):
        simulate(tmp_path / kind, "run.until=70 s", "events[0].at=60 s", f"output.precision={kind}")
    with (
        xarray.open_dataset(tmp_path / "float32/result.nc") as single,
        xarray.open_dataset(tmp_path / "float64/result.nc") as double,
    ):
        assert np.array_equal(single["time"], double["time"])
        for name in single.data_vars:
            assert np.array_equal(single[name].values, double[name].values.astype(np.float32)), name


def test_each_turbine_of_a_farm_has_its_own(tmp_path: Path) -> None:
    summary = simulate(tmp_path, "turbines=3", "run.until=10 s", "output.statistics=true", scenario=FARM)
    assert set(summary["energy"]) == {"wt[1]", "wt[2]", "wt[3]"}
    assert len({one["energy_mwh"] for one in summary["energy"].values()}) == 3
    assert {"wt[1].wind", "wt[3].wind"} <= set(summary["statistics"])


@pytest.mark.parametrize(
    ("change", "code", "text"),
    [
        ("output.statistics={channels: [wt.nothing]}", "GF2406", "output.statistics.channels[0]"),
        ("output.statistics={ranges: {wt.nothing: [0, 1]}}", "GF2406", "ranges.wt.nothing"),
        ("output.statistics={ranges: {wt.wind: [5 m/s, 2 m/s]}}", "GF2003", "[lowest, highest]"),
        ("output.statistics={ranges: {wt.wind: [0 m/s, 2 MW]}}", "GF2302", "ranges.wt.wind"),
        ("output.statistics={ranges: {wt.wind: 3}}", "GF2003", "[lowest, highest]"),
        ("output.statistics={of: [median]}", "GF2204", "psd"),
        ("output.statistics={wohler: [0]}", "GF2003", "0.5 to 50"),
        ("output.statistics={evry: 1 s}", "GF2201", "every"),
        ("output.statistics=7", "GF2203", "a mapping"),
        ("output.precision=float16", "GF2204", "float32"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_for(tmp_path: Path, change: str, code: str, text: str) -> None:
    for command in (["check"], ["simulate", "--out", str(tmp_path / "out"), "--no-figure"]):
        result = CliRunner().invoke(app, [*command, str(TURBULENT), "--set", change])
        assert result.exit_code == 2
        assert code in result.stderr
        assert text in result.stderr
    assert not (tmp_path / "out" / "result.nc").exists()


# ---- events of the grid ---------------------------------------------------------------------------------------------
def test_windows_end_at_the_next_event() -> None:
    found = windows([(30.0, {"a": 1}), (10.0, {"b": 2}), (10.0, {"c": 3}), (200.0, {"d": 4})], 150.0)
    assert found == (Window(10.0, 30.0, {"b": 2, "c": 3}), Window(30.0, 90.0, {"a": 1}))


@pytest.mark.parametrize("block", [1, 13, 100_000])
def test_figures_of_an_event_have_closed_forms(block: int) -> None:
    """f = 50 - 0.2 (1 - e^(-t/2)) - 0.3 t e^(-t) after 20 s and, after 100 s, a rise of 0.1 Hz within 5 s."""
    times = np.arange(0.0, 150.0, 0.02)
    after = np.maximum(times - 20.0, 0.0)
    hertz = 50.0 - 0.2 * (1.0 - np.exp(-after / 2.0)) - 0.3 * after * np.exp(-after)
    hertz += 0.1 * np.clip((times - 100.0) / 5.0, 0.0, 1.0)
    watch = EventWatch(windows([(20.0, {"load.P": "1 MW"}), (100.0, {})], 149.98))
    for first in range(0, times.size, block):
        watch.add(times[first : first + block], hertz[first : first + block])
        again = EventWatch(watch.windows)
        again.restore(json.loads(json.dumps(watch.state())))
        watch = again
    drop, rise = watch.summary()
    assert drop["set"] == {"load.P": "1 MW"}
    assert drop["nadir_hz"] == hertz[times < 80.0].min()
    assert drop["settle_hz"] == pytest.approx(49.8, abs=1e-9), "what is left of the exponentials after 60 s"
    assert drop["rocof_hz_per_s"] == pytest.approx((hertz[1005] - 50.0) / 0.1, rel=1e-9)
    # 5 % of the largest excursion, which is the 0.2 Hz at the event itself: 10 mHz.
    window = (times >= 20.0) & (times <= 80.0)
    outside = times[window][np.abs(hertz[window] - 49.8) > 0.01]
    assert drop["settling_time_s"] == pytest.approx(outside[-1] + 0.02 - 20.0, abs=1e-9)
    assert rise["peak_hz"] == pytest.approx(49.9, abs=1e-9)
    assert rise["nadir_time_s"] == pytest.approx(100.0)
    # 0.1 Hz in 5 s; within 5 mHz of the end 4.75 s after the event, the next sample is the first inside.
    assert rise["settling_time_s"] == pytest.approx(4.75, abs=0.021)


def test_figures_that_samples_do_not_carry_are_left_out() -> None:
    window = Window(10.0, 20.0, {})
    assert set(event_figures(window, np.empty(0), np.empty(0)).values()) == {None}
    coarse = event_figures(window, np.array([10.0, 11.0, 12.0]), np.array([50.0, 49.0, 49.5]))
    assert (coarse["nadir_hz"], coarse["rocof_hz_per_s"], coarse["settle_hz"]) == (49.0, None, None)


# ---- the last words -------------------------------------------------------------------------------------------------
def test_a_calm_long_run_ends_with_its_energy() -> None:
    energy = {"mean_power_mw": 12.5, "energy_mwh": 300.0, "capacity_factor": 0.25, "rated_power_mw": 50.0}
    summary = Summary(
        "completed", None, 86400.0, 4.0, 1.0, 0, 24,
        frequency={"nadir_hz": 49.9, "nadir_time_s": 5.0, "settle_hz": 50.0},
        statistics={"energy": {"a": energy, "b": energy}},
    )  # fmt: skip
    text = closing_lines(Outcome(Path("r"), Path("s"), None, summary, None))
    assert "mean power 25 MW, energy 600 MWh, capacity factor 25.0 %" in text
    assert "nadir" not in text
    assert "nadir 49.900 Hz" in closing_lines(
        Outcome(Path("r"), Path("s"), None, Summary(**{**summary.__dict__, "events": ({"at_s": 1.0},)}), None)
    )
