"""A load that grows at the end of a weak line, past the most that the line can carry."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.line import Line
from gustform.electrical.stiff_grid import StiffGrid
from gustform.language.system import System
from gustform_codegen.cache import KernelCache
from tests.components.evaluate import evaluate
from tests.physics.running import Ready, ready

V_N = 33e3  # V
X = 10.0  # ohm per phase, of grid and line together: at most V_N^2/(2 X) = 54.45 MW at unity power factor
V_MIN = 0.7  # pu
LEAST, MOST, EVERY = 20.0, 90.0, 1.0  # MW, one step a second


@pytest.fixture(scope="module")
def weak(cache: KernelCache) -> Ready:
    s = System()
    s.add("grid", StiffGrid(voltage=V_N, rating=1e9, r=0.0, x=1.0))  # 1.089 ohm
    s.add("line", Line(R=0.0, X=X - 1.089))
    s.add("bus", Bus(voltage=V_N))
    s.add("load", ConstantPowerLoad(voltage=V_N, active=LEAST * 1e6, V_min=V_MIN))
    s.connect("grid.terminal", "line.sending")
    s.connect("line.receiving", "bus.terminal")
    s.connect("load.terminal", "bus.terminal")
    for k in range(1, int((MOST - LEAST) / EVERY) + 1):
        s.change(k - 0.5, "load.active", (LEAST + k * EVERY) * 1e6)
    return ready(s, cache)


def expected_voltage(power: float) -> float:
    """V in pu: the upper root of V^4 - V^2 + (P X/V_n^2)^2 = 0, or the divider of X and the load's impedance."""
    p = power * X / V_N**2
    if p <= V_MIN * math.sqrt(1.0 - V_MIN**2):
        return math.sqrt((1.0 + math.sqrt(1.0 - 4.0 * p * p)) / 2.0)
    return 1.0 / abs(1.0 + 1j * p / V_MIN**2)


def test_network_keeps_a_solution_when_the_load_outgrows_the_line(weak: Ready) -> None:
    times = np.arange(0.0, (MOST - LEAST) / EVERY + 0.5)
    wanted = (LEAST + EVERY * times) * 1e6
    found = weak.follow(["load.V", "load.P", "load.Q", "grid.P", "grid.Q"], times, rtol=1e-8)
    np.testing.assert_allclose(found["load.V"], [expected_voltage(p) for p in wanted], rtol=1e-6)
    # P_max lies at V = 0.7071, just above the threshold: both sides of it are there
    above = found["load.V"] >= V_MIN
    assert 30 <= np.count_nonzero(above) <= len(times) - 30
    np.testing.assert_allclose(found["load.P"][above], wanted[above], rtol=1e-12)
    np.testing.assert_allclose(found["load.P"][~above], (wanted * (found["load.V"] / V_MIN) ** 2)[~above], rtol=1e-12)
    assert np.all(found["load.P"] <= V_N**2 / (2.0 * X) * (1.0 + 1e-6))  # the line carries no more
    # balance to 1e-9 of 100 MW: the line takes reactive power only
    current = np.abs(found["load.P"] / (found["load.V"] * V_N))
    assert np.max(np.abs(found["grid.P"] - found["load.P"])) < 0.1
    assert np.max(np.abs(found["grid.Q"] - found["load.Q"] - (X - 1.089) * current**2)) < 0.1


@pytest.mark.parametrize("angle", [0.0, 0.4, -2.0])
def test_current_is_continuous_at_the_threshold_and_its_slope_bends(angle: float) -> None:
    power = complex(30e6, 12e6)
    load = ConstantPowerLoad(voltage=V_N, active=power.real, reactive=power.imag, V_min=V_MIN)

    def current(V: float) -> complex:
        v = cmath.rect(V * V_N, angle)
        found = evaluate(load, {"terminal.vr": v.real, "terminal.vi": v.imag})
        return complex(found["terminal.ir"], found["terminal.ii"])

    eps = 1e-6
    here, up, down = current(V_MIN), current(V_MIN * (1.0 + eps)), current(V_MIN * (1.0 - eps))
    assert here == pytest.approx((power / cmath.rect(V_MIN * V_N, angle)).conjugate(), rel=1e-12)
    # |i| falls with 1/|v| above and rises with |v| below; there is no step between
    assert (abs(up) / abs(here) - 1.0) / eps == pytest.approx(-1.0, rel=1e-3)
    assert (abs(down) / abs(here) - 1.0) / eps == pytest.approx(-1.0, rel=1e-3)
