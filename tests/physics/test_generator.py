"""The power plant against closed forms and against scipy's Radau on equations written by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, curve_fit, root

from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.first_order_governor import FirstOrderGovernor
from gustform.electrical.machine_classical import ClassicalMachine
from gustform.electrical.stiff_grid import StiffGrid
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.electrical.tgov1 import TGOV1
from gustform.language.system import System
from gustform_codegen.cache import KernelCache
from tests.physics.running import Ready, ready

Array = NDArray[np.float64]

S_N = 210e6  # VA
OMEGA_0 = 2.0 * math.pi * 50.0  # rad/s
X_GRID = 0.2  # pu of S_N
X_ALL = 0.30 + 0.12 + X_GRID  # x'd, transformer, grid
H = 6.0  # s
CONSTANT_POWER = {"droop": 1e9}  # a governor that does not move


def against_grid(D: float, cache: KernelCache) -> Ready:
    """The paper's machine on a voltage source that nothing moves, without a resistance anywhere."""
    s = System()
    s.add("grid", StiffGrid(rating=S_N, r=0.0, x=X_GRID))
    s.add("sg", SynchronousGenerator(rating=S_N, fidelity="lossless", machine={"D": D}, governor=CONSTANT_POWER))
    s.connect("sg.terminal", "grid.terminal")
    s.frame("grid.omega")
    return ready(s, cache)


def alone(cache: KernelCache, step: float, at: float = 1.0, **parts: Any) -> Ready:
    """A plant that feeds 100 MW + j20 Mvar, and `step` W more from a time on."""
    s = System()
    s.add("bus", Bus())
    s.add("sg", SynchronousGenerator(rating=S_N, **parts))
    s.add("load", ConstantPowerLoad(active=100e6, reactive=20e6))
    s.connect("sg.terminal", "bus.terminal")
    s.connect("load.terminal", "bus.terminal")
    s.frame("sg.omega")
    s.change(at, "load.active", 100e6 + step)
    return ready(s, cache)


# ---- swing against a stiff grid --------------------------------------------------------------------------------------
def largest_power(plant: Ready) -> float:
    """b = E V/X of P = b sin(delta), pu."""
    return plant.free["sg.machine.E"] / X_ALL


def test_power_is_that_of_the_paper(cache: KernelCache) -> None:
    plant = against_grid(0.0, cache)
    found = plant.moved({"sg.machine.delta": 0.6}).follow(["sg.P", "sg.delta"], np.array([0.0]))
    assert found["sg.P"][0] / S_N == pytest.approx(largest_power(plant) * math.sin(found["sg.delta"][0]), rel=1e-9)
    # V_t = 1 at the machine's terminals: a phasor of 1 pu on the line between E at delta and the grid at 0
    inner, share = plant.free["sg.machine.E"] * np.exp(1j * plant.table.start[plant.numbers["sg.machine.delta"]]), 0.3
    assert abs(inner + share / X_ALL * (1.0 - inner)) == pytest.approx(1.0, abs=1e-7)


# Off by 1e-3 pu of speed the sine bends the frequency by (0.03 rad)^2/16 = 6e-5.
def test_small_swing_has_the_frequency_and_damping_of_the_linear_equation(cache: KernelCache) -> None:
    D = 10.0
    plant = against_grid(D, cache)
    delta = plant.table.start[plant.numbers["sg.machine.delta"]]
    damping = D / (4.0 * H)
    swing = math.sqrt(largest_power(plant) * math.cos(delta) * OMEGA_0 / (2.0 * H) - damping**2)
    times = np.linspace(0.0, 5.0, 501)
    found = plant.moved({"sg.machine.omega": 1e-3}).follow(["sg.omega"], times, rtol=1e-8)

    def linear(t: Array, a: float, b: float, s: float, w: float) -> Array:
        return np.asarray(np.exp(-s * t) * (a * np.cos(w * t) + b * np.sin(w * t)))

    fitted, _ = curve_fit(linear, times, 1e3 * (found["sg.omega"] - 1.0), p0=(1.0, 0.0, 0.5, 9.0))
    assert fitted[2] == pytest.approx(damping, rel=1e-3)
    assert fitted[3] == pytest.approx(swing, rel=1e-3)


@pytest.fixture(scope="module")
def large_swing(cache: KernelCache) -> tuple[Ready, Array, dict[str, Array]]:
    """Half a per cent off in speed, no damping: 10 degrees either way."""
    plant = against_grid(0.0, cache)
    times = np.linspace(0.0, 10.0, 2001)
    return plant, times, plant.moved({"sg.machine.omega": 5e-3}).follow(["sg.omega", "sg.delta"], times, rtol=1e-8)


def energy(plant: Ready, omega: Any, delta: Any) -> Any:
    """Constant of the undamped swing in power form: 2 H w0 (w^3/3 - w^2/2) = P_m delta + b cos(delta) + constant."""
    kinetic = 2.0 * H * OMEGA_0 * (omega**3 / 3.0 - omega**2 / 2.0)
    return kinetic - plant.free["sg.governor.P_ref"] * delta - largest_power(plant) * np.cos(delta)


def test_large_undamped_swing_keeps_its_energy(large_swing: tuple[Ready, Array, dict[str, Array]]) -> None:
    plant, _, found = large_swing
    values = energy(plant, found["sg.omega"], found["sg.delta"])
    rest = energy(plant, 1.0, plant.table.start[plant.numbers["sg.machine.delta"]])
    swinging = values[0] - rest
    # BDF starts at first order: what that takes in the first 5 ms is left to the bound on the whole run
    period = 120
    assert np.max(np.abs(values[1 + period :] - values[1:-period])) < 1e-5 * swinging
    assert np.max(np.abs(values - values[0])) < 1e-4 * swinging


def test_large_undamped_swing_has_its_period_from_a_quadrature(
    large_swing: tuple[Ready, Array, dict[str, Array]],
) -> None:
    plant, times, found = large_swing
    delta_0 = plant.table.start[plant.numbers["sg.machine.delta"]]
    total = energy(plant, 1.0 + 5e-3, delta_0)

    def angle(omega: float, side: float) -> float:
        """Where the orbit has this speed, above or below the angle at rest."""
        return float(brentq(lambda d: energy(plant, omega, d) - total, delta_0, delta_0 + side, xtol=1e-15))

    # dt = 2 H w dw/(P_m - b sin(delta)) along the orbit; w = 1 + a sin(s) between its extremes takes the poles away
    low = float(brentq(lambda w: energy(plant, w, delta_0) - total, 0.99, 1.0 - 1e-6, xtol=1e-16))
    middle, half = (1.005 + low) / 2.0, (1.005 - low) / 2.0

    def slope(s: float, side: float) -> float:
        omega = middle + half * math.sin(s)
        missing = plant.free["sg.governor.P_ref"] - largest_power(plant) * math.sin(angle(omega, side))
        return 2.0 * H * omega * half * math.cos(s) / abs(missing)

    edge = math.pi / 2.0 - 1e-6
    period = sum(quad(slope, -edge, edge, args=(side,), epsabs=1e-10, epsrel=1e-10)[0] for side in (1.0, -1.0))
    period *= math.pi / (2.0 * edge)  # what the edges leave out: the slope is flat there
    off = found["sg.delta"] - delta_0
    up = np.flatnonzero((off[:-1] < 0.0) & (off[1:] >= 0.0))
    # crossings by the Hermite cubic through angle and speed of both neighbours
    rate = OMEGA_0 * (found["sg.omega"] - 1.0)
    crossings = [_crossing(times[k : k + 2], off[k : k + 2], rate[k : k + 2]) for k in up]
    assert len(crossings) >= 10
    assert (crossings[-1] - 0.0) / len(crossings) == pytest.approx(period, rel=1e-5)


def _crossing(time: Array, value: Array, rate: Array) -> float:
    h = time[1] - time[0]

    def cubic(s: float) -> float:
        a, b = rate[0] * h, rate[1] * h
        rise = value[1] - value[0]
        return float(value[0] + s * (a + s * (3.0 * rise - 2.0 * a - b + s * (a + b - 2.0 * rise))))

    return float(time[0] + h * brentq(cubic, 0.0, 1.0))


# ---- a load step -----------------------------------------------------------------------------------------------------
def test_first_slope_of_the_frequency_is_the_missing_power_over_2H(cache: KernelCache) -> None:
    step = 20e6
    plant = alone(cache, step, fidelity="lossless")
    expected = -step / S_N / (2.0 * H)  # pu/s
    # The derivative between two steps is their difference: the first one must be short for it to be the slope at once.
    found = plant.follow(["sg.omega"], np.array([1.0, 1.0 + 1e-6, 1.001]), rtol=1e-10, first_step=1e-8)
    # 1 us after the step the speed has fallen by 8e-9 pu
    assert found["yp"][1, plant.numbers["sg.machine.omega"]] == pytest.approx(expected, rel=1e-7)
    # within 1 ms by 8e-6 pu, and the slope follows 1/omega; the governor has moved by t^2/(4 H R T) = 2e-7 of the step
    assert (found["sg.omega"][2] - found["sg.omega"][0]) / 1e-3 == pytest.approx(expected, rel=1e-5)


def test_first_slope_of_the_sixth_order_machine_has_its_losses_too(cache: KernelCache) -> None:
    step, ra = 20e6, 0.003
    plant = alone(cache, step)
    found = plant.follow(["sg.omega", "sg.machine.i_d", "sg.machine.i_q"], np.array([1.0, 1.0 + 1e-6]), rtol=1e-10)
    before, after = found["sg.machine.i_d"] ** 2 + found["sg.machine.i_q"] ** 2
    missing = step / S_N + ra * (after - before)
    # 1 us after the step the fastest flux linkage (0.03 s) has moved by 3e-5 of its way
    assert found["yp"][1, plant.numbers["sg.machine.omega"]] == pytest.approx(-missing / (2.0 * H), rel=1e-6)


@pytest.mark.parametrize("droop", [0.03, 0.05])
def test_first_order_governor_settles_on_its_droop(droop: float, cache: KernelCache) -> None:
    step = 20e6
    plant = alone(cache, step, fidelity="lossless", governor={"droop": droop})
    found = plant.follow(["sg.omega", "sg.P_m", "sg.P"], np.array([0.0, 200.0]), rtol=1e-8)
    assert found["sg.P"][1] == pytest.approx(120e6, rel=1e-9)
    assert found["sg.P_m"][1] * S_N == pytest.approx(120e6, rel=1e-8)
    assert found["sg.omega"][1] - 1.0 == pytest.approx(-droop * step / S_N, rel=1e-6)  # rtol over the deviation


# Set B of the project notes has no dead band, so that the frequency is not neutral about the operating point.
SET_B: dict[str, Any] = {
    "machine": {"H": 8.0},
    "governor": TGOV1(T1=0.3, T2=2.5, T3=8.4, droop=0.0613, half_dead_band=0.0),
}


def test_set_b_answers_a_small_step_and_set_a_waits_for_its_dead_band(cache: KernelCache) -> None:
    step = 1e5  # W: 2.4e-5 pu of speed at 5 % droop
    times = np.array([0.0, 400.0])
    at_b = alone(cache, step, **SET_B).follow(["sg.omega", "sg.P_m"], times, rtol=1e-9)
    taken = at_b["sg.P_m"][1] - at_b["sg.P_m"][0]
    assert taken == pytest.approx(step / S_N, rel=4e-3)  # with it come 2 r_a i = 0.3 % of stator losses
    assert at_b["sg.omega"][1] - 1.0 == pytest.approx(-0.0613 * taken, rel=1e-4)
    at_a = alone(cache, step).follow(["sg.omega", "sg.P_m"], times, rtol=1e-9)
    taken = at_a["sg.P_m"][1] - at_a["sg.P_m"][0]
    assert at_a["sg.omega"][1] - 1.0 == pytest.approx(-0.00105 - 0.05 * taken, rel=1e-4)


# ---- another integrator on equations written by hand -----------------------------------------------------------------
X_T = 0.12
TIMES = np.linspace(0.0, 20.0, 201)
STEP = 20e6 / S_N


def feeding(t: float) -> complex:
    """What the plant feeds, pu."""
    return complex(100e6 / S_N + (STEP if t >= 1.0 else 0.0), 20e6 / S_N)


def by_radau(slope: Callable[[float, Array], Array], start: Array) -> Array:
    """States on TIMES, the step at 1 s as a restart."""
    rows = []
    for begin, end in ((0.0, 1.0), (1.0, TIMES[-1])):
        inside = TIMES[(begin <= TIMES) & (end >= TIMES)]

        def ode(_t: float, x: Array, side: float = begin) -> Array:
            return slope(side, x)

        answer = solve_ivp(ode, (begin, end), start, method="Radau", t_eval=inside, rtol=1e-10, atol=1e-12)
        assert answer.success, answer.message
        rows.append(answer.y.T[0 if begin == 0.0 else 1 :])
        start = answer.y[:, -1]
    return np.concatenate(rows)


def agree(plant: Ready, names: tuple[str, ...], other: Array) -> None:
    """Another solver on the same equations: 10 x rtol of nominal (all of these are pu, nominal 1)."""
    rtol = 1e-6
    found = plant.follow([], TIMES, rtol=rtol)["y"][:, [plant.numbers[name] for name in names]]
    error = np.max(np.abs(found - other), axis=0)
    assert np.all(error < 10.0 * rtol), dict(zip(names, error, strict=True))


def test_classical_machine_against_radau(cache: KernelCache) -> None:
    r, x, droop, T = 0.003, 0.30 + X_T, 0.05, 5.5
    plant = alone(cache, 20e6, machine=ClassicalMachine(), governor=FirstOrderGovernor())
    E = plant.free["sg.machine.E"]

    def current(S: complex) -> float:
        """|i|^2 where E stands behind r + jx before a load S: the upper root of |E|^2 = |V + (r + jx) conj(S)/V|^2."""
        half = E * E / 2.0 - S.real * r - S.imag * x
        V2 = half + math.sqrt(half * half - (r * r + x * x) * abs(S) ** 2)
        return float(abs(S) ** 2 / V2)

    def slope(t: float, state: Array) -> Array:
        omega, P_m = state
        S = feeding(t)
        return np.array([
            (P_m - S.real - r * current(S)) / (2.0 * H * omega),
            (plant.free["sg.governor.P_ref"] - (omega - 1.0) / droop - P_m) / T,
        ])  # fmt: skip

    start = np.array([1.0, feeding(0.0).real + r * current(feeding(0.0))])
    agree(plant, ("sg.machine.omega", "sg.governor.P_m"), by_radau(slope, start))


def test_sixth_order_machine_against_radau(cache: KernelCache) -> None:
    """Sauer and Pai's equations, TGOV1 and SEXS, by hand; the stator and the load by a root finder."""
    plant = alone(cache, 20e6)
    xd, xq, xd1, xq1, xd2, xq2, xl, ra = 1.81, 1.76, 0.30, 0.65, 0.23, 0.25, 0.15, 0.003
    P_ref, V_ref = plant.free["sg.governor.P_ref"], plant.free["sg.exciter.V_ref"]
    names = ("machine.omega", "machine.E1q", "machine.E1d", "machine.psi_1d", "machine.psi_2q", "governor.valve",
             "governor.reheater", "exciter.lead", "exciter.E_fd")  # fmt: skip
    guess = np.array([0.3, 0.4])

    def stator(S: complex, voltage_d: float, voltage_q: float) -> tuple[float, float]:
        """i_d, i_q at which the voltages behind x'' feed S through the transformer."""

        def gap(i: Array) -> Array:
            v = complex(voltage_d - ra * i[0] + xq2 * i[1], voltage_q - ra * i[1] - xd2 * i[0])
            current = complex(i[0], i[1])
            missing = (v - 1j * X_T * current) * current.conjugate() - S
            return np.array([missing.real, missing.imag])

        found = root(gap, guess, tol=1e-14)
        assert np.max(np.abs(found.fun)) < 1e-11
        guess[:] = found.x
        return float(found.x[0]), float(found.x[1])

    def slope(t: float, state: Array) -> Array:
        omega, E1q, E1d, psi_1d, psi_2q, valve, reheater, lead, E_fd = state
        behind_q = ((xd2 - xl) * E1q + (xd1 - xd2) * psi_1d) / (xd1 - xl)
        behind_d = ((xq2 - xl) * E1d - (xq1 - xq2) * psi_2q) / (xq1 - xl)
        i_d, i_q = stator(feeding(t), behind_d, behind_q)
        psi_d, psi_q = behind_q - xd2 * i_d, -behind_d - xq2 * i_q
        V_t = math.hypot(-ra * i_d - psi_q, -ra * i_q + psi_d)
        deviation = omega - 1.0
        outside = math.copysign(max(abs(deviation) - 0.00105, 0.0), deviation)
        P_m = reheater + 2.2 / 7.4 * (valve - reheater)
        error = V_ref - V_t
        return np.array([
            (P_m - (psi_d * i_q - psi_q * i_d)) / (2.0 * H * omega),
            (-E1q - (xd - xd1) * (i_d - (xd1 - xd2) / (xd1 - xl) ** 2 * (psi_1d + (xd1 - xl) * i_d - E1q)) + E_fd) / 8,
            (-E1d + (xq - xq1) * (i_q - (xq1 - xq2) / (xq1 - xl) ** 2 * (psi_2q + (xq1 - xl) * i_q + E1d))) / 1.0,
            (-psi_1d + E1q - (xd1 - xl) * i_d) / 0.03,
            (-psi_2q - E1d - (xq1 - xl) * i_q) / 0.07,
            (min(max(P_ref - outside / 0.05, 0.0), 1.0) - valve) / 0.3,
            (valve - reheater) / 7.4,
            (error - lead) / 10.0,
            (min(max(200.0 * (lead + 0.1 * (error - lead)), 0.0), 5.0) - E_fd) / 0.05,
        ])  # fmt: skip

    paths = tuple(f"sg.{name}" for name in names)
    start = plant.table.start[[plant.numbers[path] for path in paths]]
    assert np.max(np.abs(slope(0.0, start))) < 1e-6  # a rest of these equations too
    agree(plant, paths, by_radau(slope, start))
