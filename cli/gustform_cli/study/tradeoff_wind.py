"""What a design does in turbulent wind, and to a load step in it: one case of the trade-off study.

The same wind is run twice, with the step and without it. Without: fatigue, pitch travel, energy, and how the wind
moves the frequency. The difference of the two is what the step does, whatever the wind does meanwhile: turbulence in
all turbines at once moves the frequency by as much as the step, and a nadir read from one run would be luck.

    damage rate     sum of n_i R_i^4 per second      rainflow cycles of the shaft torque, ASTM E1049
    damage of step  the same sum with the step, less that without it
    pitch travel    mean of |d(beta)/dt|
    nadir, RoCoF    f0 + the least of f_step - f_quiet within 60 s; slope of that difference over the first 0.5 s
    settling        means of the differences of frequency and of turbine power, 40 to 60 s after the step
    shock           largest of |T_step - T_quiet| within 10 s
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gustform.conventions import NOMINAL_FREQUENCY
from gustform_cli.document import Change
from gustform_cli.run import Run
from gustform_cli.study.tradeoff_case import TURBINE, Scalars, built, outcome
from gustform_cli.sweep.case import Outcome, Task

Array = NDArray[np.float64]

EXPONENT = 4.0  # of the Woehler curve: steel
FREQUENCY, TORQUE, POWER = "sg.frequency", f"{TURBINE}.drive.T", f"{TURBINE}.P"
V_DC, SPEED, PITCH = f"{TURBINE}.v_dc", f"{TURBINE}.omega_r", f"{TURBINE}.beta"
CHANNELS = (FREQUENCY, TORQUE, POWER, V_DC, SPEED, PITCH)
WINDOW, SETTLED = 60.0, 20.0  # s after the step, and the last of them
ROCOF_WINDOW = 0.5  # s
SHOCK_WINDOW = 10.0  # s, in which the shaft answers to the step

UNITS = {
    "power_pu": "pu", "damage_rate": "(MN*m)^4/s", "damage_of_step": "(MN*m)^4", "del_wind_nm": "N*m",
    "shock_nm": "N*m", "torque_max_nm": "N*m", "pitch_travel_deg_per_s": "deg/s", "nadir_hz": "Hz",
    "nadir_time_s": "s", "rocof_hz_per_s": "Hz/s", "settle_hz": "Hz", "settle_power_pu": "pu",
    "frequency_std_hz": "Hz", "frequency_min_hz": "Hz", "v_dc_min_pu": "pu", "v_dc_max_pu": "pu",
    "omega_r_min_pu": "pu", "omega_r_max_pu": "pu", "tripped": "1",
}  # fmt: skip


@dataclass(frozen=True)
class Rows:
    """Rows of one run: times in s, channels by name. `rating` of all turbines, VA, is the base of pu."""

    time: Array
    values: Mapping[str, Array]
    rating: float
    tripped: bool = False


def measure(task: Task) -> Outcome:
    """Run a case with and without its load step and compare."""
    return outcome(task, _measured, UNITS)


def _measured(task: Task) -> tuple[Scalars, float]:
    stepped, at, first = _run(task, ())
    quiet, _, second = _run(task, (Change("events", [], None),))
    return compare(quiet, stepped, task.transient, at), first + second


def _run(task: Task, changes: Sequence[Change]) -> tuple[Rows, float, float]:
    """Rows of a run, when its first event is, and the seconds it took."""
    model, table = built(task, changes)
    times: list[Array] = []
    rows: list[NDArray[np.float32]] = []

    def take(t: Array, block: NDArray[np.float32]) -> None:
        times.append(t)
        rows.append(block)

    with Run(model, table, None, [take]) as run:
        ended = run.execute()
    if ended.error is not None:
        raise ended.error
    values = np.concatenate(rows).astype(np.float64)
    channels = {channel.name: values[:, k] for k, channel in enumerate(model.channels)}
    turbine = model.assembled.system.components[TURBINE]
    rating = float(turbine.value("rating") * turbine.value("aggregate"))
    at = min((event.at for event in model.assembled.scenario.events), default=float("inf"))
    return (
        Rows(np.concatenate(times), channels, rating, bool(ended.summary.trips)),
        at,
        ended.summary.wall_seconds,
    )


def compare(quiet: Rows, stepped: Rows, transient: float, at: float) -> dict[str, float]:
    """The scalars of a case from its two runs, whose step is `at`, s; rows before `transient`, s, do not count."""
    time = quiet.time
    step = float(time[1] - time[0])
    counted = time >= transient - 0.5 * step
    seconds = float(np.count_nonzero(counted)) * step
    still, struck = (damage(rows.values[TORQUE][counted] / 1e6, step) for rows in (quiet, stepped))

    def difference(name: str, begin: float, end: float) -> tuple[Array, Array]:
        inside = (time >= at + begin - 0.5 * step) & (time <= at + end + 0.5 * step)
        return time[inside] - at, (stepped.values[name] - quiet.values[name])[inside]

    after, frequency = difference(FREQUENCY, 0.0, WINDOW)
    lowest = int(np.argmin(frequency))
    first = round(ROCOF_WINDOW / step)
    return {
        "power_pu": float(quiet.values[POWER][counted].mean()) / quiet.rating,
        "damage_rate": still / seconds,
        "damage_of_step": struck - still,
        "del_wind_nm": 1e6 * float((still / seconds) ** (1.0 / EXPONENT)),
        "shock_nm": float(np.abs(difference(TORQUE, 0.0, SHOCK_WINDOW)[1]).max()),
        "torque_max_nm": float(stepped.values[TORQUE][counted].max()),
        "pitch_travel_deg_per_s": float(np.abs(np.diff(quiet.values[PITCH][counted])).sum() / seconds),
        "nadir_hz": NOMINAL_FREQUENCY + float(frequency[lowest]),
        "nadir_time_s": float(after[lowest]),
        "rocof_hz_per_s": float((frequency[first] - frequency[0]) / (after[first] - after[0])),
        "settle_hz": NOMINAL_FREQUENCY + float(difference(FREQUENCY, WINDOW - SETTLED, WINDOW)[1].mean()),
        "settle_power_pu": float(difference(POWER, WINDOW - SETTLED, WINDOW)[1].mean()) / quiet.rating,
        "frequency_std_hz": float(quiet.values[FREQUENCY][counted].std()),
        "frequency_min_hz": float(stepped.values[FREQUENCY][counted].min()),
        "v_dc_min_pu": float(stepped.values[V_DC][counted].min()),
        "v_dc_max_pu": float(stepped.values[V_DC][counted].max()),
        "omega_r_min_pu": float(stepped.values[SPEED][counted].min()),
        "omega_r_max_pu": float(stepped.values[SPEED][counted].max()),
        "tripped": float(quiet.tripped or stepped.tripped),
    }


def damage(torque: Array, step: float) -> float:
    """Sum of n_i R_i^4 over the rainflow cycles of samples `step` s apart."""
    from gustform_runtime import Keep, Statistics

    statistics = Statistics([Keep(0, exponents=[EXPONENT])], 1, step)
    statistics.add(np.arange(torque.size) * step, torque[:, np.newaxis])
    return float(statistics.cycles(0).damage[0])
