"""The schedule as part of an exported controller: its tables, its filter, the observer of the wind."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gustform.control.converter_control import ConverterControl
from gustform.control.curtailment_schedule import CurtailmentSchedule
from gustform.language import Parameter, Table, Variable, limit, table2
from gustform.language.errors import GustformError
from gustform.language.table import TableData
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.emit.controller.block import controller_block
from gustform_codegen.emit.controller.discretise import Method, discretise
from gustform_codegen.emit.controller.frequency import frequency_response
from gustform_codegen.emit.controller.look_up import spline_at
from gustform_codegen.emit.controller.program import Evaluator, program
from tests.support.controller import PERIOD, Compiled, block_of

MEASURED, ESTIMATED = "DualPort+measured", "DualPort+estimated"


def bowl() -> TableData:
    x, y = np.linspace(0.0, 2.0, 21), np.linspace(-1.0, 3.0, 17)
    return TableData(x, y, np.add.outer(np.sin(x), 0.2 * y * y))


def test_what_is_exported_reads_the_wind_or_the_rotor() -> None:
    measured, estimated = block_of(MEASURED), block_of(ESTIMATED)
    assert [s.name for s in measured.inputs] == ["v_dc", "Q_gsc", "Q_msc", "omega_r", "P_pmsg", "wind"]
    assert [s.name for s in estimated.inputs] == ["v_dc", "Q_gsc", "Q_msc", "omega_r", "P_pmsg", "beta"]
    assert [s.name for s in measured.states][-1:] == ["schedule_v"]
    assert [s.name for s in estimated.states][-2:] == ["schedule_v", "schedule_source_x"]
    assert [g.name for g in measured.tables] == ["schedule_omega_table", "schedule_beta_table"]
    assert [g.name for g in estimated.tables][-1] == "schedule_source_cp"


def test_a_look_up_is_that_of_the_simulation() -> None:
    """To 1e-11 of the largest coefficient, which is what the printed digits leave; slopes times the steps of a unit."""
    rng = np.random.default_rng(3)
    for grid in block_of(ESTIMATED).tables:
        s = grid.spline
        x = rng.uniform(s["x_start"] - 1.0, grid.x_end + 1.0, 300)
        y = rng.uniform(s["y_start"] - 0.1, grid.y_end + 0.1, 300)
        data = TableData(np.arange(4.0), np.arange(4.0), np.zeros((4, 4)), _spline=s)
        scale = float(np.max(np.abs(s["coefficient"])))
        kinds = ((False, False, 1.0), (True, False, grid.x_scale), (False, True, grid.y_scale))
        for expected, (x_slope, y_slope, steps) in zip(data.evaluate(x, y), kinds, strict=True):
            found = [spline_at(grid, float(a), float(b), x_slope, y_slope) for a, b in zip(x, y, strict=True)]
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-10 * scale * steps)


def test_a_constant_wind_ends_at_its_operating_point() -> None:
    turbine = PmsgTurbine(schedule=CurtailmentSchedule(curtailment=0.1, T_wind=0.1))
    block = controller_block(turbine.control, turbine.pitch, None, turbine.schedule)
    evaluator = Evaluator(program(discretise(block, PERIOD)))
    inputs = np.array([s.value for s in block.inputs])
    inputs[[s.name for s in block.inputs].index("wind")] = 7.0
    for _ in range(3000):  # 30 time constants
        evaluator.step(inputs)
    expected = turbine.schedule.table("omega_table").evaluate(np.array([7.0]), np.array([math.sqrt(0.1)]))[0][0]
    # omega_msc = omega_del at nominal DC voltage
    assert evaluator.outputs[[s.name for s in block.outputs].index("omega_msc")] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("method", "bound"),
    [(Method.tustin, 3e-8), (Method.euler, 2e-5), (Method.zoh, 2e-5)],  # of order 2, 1, and 1 with inputs held
)
def test_the_observer_follows_its_differential_equation(method: Method, bound: float) -> None:
    """Rotor speed and power swing at 0.2 Hz: 5 s of the wind that the observer tells, against a solver at 1e-11."""
    turbine = PmsgTurbine(schedule=CurtailmentSchedule(wind_source="estimated"))
    source = turbine.schedule.source
    cp = source.table("cp")
    w = 2.0 * math.pi * 0.2

    def speed(t: float) -> float:
        return 1.1 + 0.02 * math.sin(w * t)

    def power(t: float) -> float:
        return 0.35 + 0.05 * math.sin(1.3 * w * t)

    def rate(t: float, x: np.ndarray) -> list[float]:
        omega, v = speed(t), x[0] + source.gamma * speed(t)
        value = cp.evaluate(np.array([source.v_tip * omega / v]), np.array([0.5]))[0][0]
        return [-source.gamma * (value * (v / source.v_one) ** 3 - power(t)) / (2.0 * source.H * omega)]

    block = block_of(ESTIMATED)
    names, states = [s.name for s in block.inputs], [s.name for s in block.states]
    evaluator = Evaluator(program(discretise(block, PERIOD, method)))
    k, n = states.index("schedule_source_x"), 5000
    start = float(evaluator.memory[k])
    # The word of memory of Tustin's rule is the state half a step on: x + h/2 f(x).
    offset = 0.5 * PERIOD * rate(0.0, np.array([start]))[0] if method is Method.tustin else 0.0
    evaluator.memory[k] += offset
    inputs = np.array([s.value for s in block.inputs])
    inputs[names.index("beta")] = 0.5
    # Sample 0 is the start itself with Tustin's rule; backward Euler arrives with its first sample, the hold leaves.
    first = {Method.tustin: 1, Method.euler: 1, Method.zoh: 0}[method]
    for i in range(first, n + first):
        inputs[names.index("omega_r")], inputs[names.index("P_pmsg")] = speed(i * PERIOD), power(i * PERIOD)
        evaluator.step(inputs)
    end = n * PERIOD
    exact = float(solve_ivp(rate, (0.0, end), [start], rtol=1e-11, atol=1e-12).y[0, -1])
    found = float(evaluator.memory[k])
    if method is Method.tustin:
        found -= 0.5 * PERIOD * rate(end, np.array([exact]))[0]
    assert abs(exact - start) > 0.05  # m/s: there is something to follow
    assert abs(found - exact) < bound * 10.0  # of 10 m/s


def test_frequency_responses_go_through_the_tables() -> None:
    pairs = {(q.input, q.output): q for q in frequency_response(discretise(block_of(MEASURED), PERIOD))}
    q = pairs["wind", "omega_msc"]
    block = block_of(MEASURED)
    slope = spline_at(block.tables[0], 8.0, 0.0, True, False)
    np.testing.assert_allclose(q.continuous, slope / (10.0 * 2j * np.pi * q.frequency + 1.0), rtol=1e-9)
    assert q.error(50.0) < 1e-4
    observed = {(q.input, q.output): q for q in frequency_response(discretise(block_of(ESTIMATED), PERIOD))}
    assert max(q.error(200.0) for q in observed.values()) < 4e-2


class Looking(ConverterControl):
    curve = Table("pu", "pu", "pu", "a table")

    def equations(self) -> None:
        self.eq(self.omega_gsc, table2(self.curve, 2.0 * table2(self.curve, self.v_dc, 0.5 * self.v_dc), self.v_dc))


@pytest.mark.parametrize("double", [False, True])
def test_a_control_may_look_up_what_it_has_looked_up(double: bool, tmp_path: Path) -> None:
    table = bowl()
    one = Compiled(program(discretise(block_of(Looking(curve=table)), PERIOD)), tmp_path, double)
    block = one.program.step.block
    inputs = np.tile([s.value for s in block.inputs], (500, 1))
    v = np.linspace(0.0, 2.0, 500)
    inputs[:, [s.name for s in block.inputs].index("v_dc")] = v
    out, _, errors = one.run(inputs)
    inner = 2.0 * table.evaluate(v, 0.5 * v)[0]
    expected = np.clip(table.evaluate(inner, v)[0], 0.5, 1.5)  # the range of omega_gsc
    np.testing.assert_allclose(out[:, 0], expected, rtol=0.0, atol=1e-10 if double else 1e-6)
    beyond = inner > 2.0001  # a thousandth of a step counts as round-off
    np.testing.assert_array_equal((errors & 32) != 0, beyond)
    assert beyond.any()


class Together(ConverterControl):
    curve = Table("pu", "pu", "pu", "a table")
    x = Variable("pu", "one")
    y = Variable("pu", "other")
    T = Parameter("s", "time constant", default=0.1, above=0.0)

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), table2(self.curve, self.y, self.v_dc) - self.x)
        self.eq(self.T * self.der(self.y), self.x - self.y)
        self.eq(self.omega_gsc, self.x)


class Within(ConverterControl):
    curve = Table("pu", "pu", "pu", "a table")
    x = Variable("pu", "integral")
    T = Parameter("s", "time constant", default=0.1, above=0.0)

    def equations(self) -> None:
        rate = table2(self.curve, self.x, self.v_dc) / self.T
        self.eq(self.der(self.x), limit(rate, (0.0 - self.x) / self.T, (1.0 - self.x) / self.T))
        self.eq(self.omega_gsc, self.x)


@pytest.mark.parametrize("kind", [Together, Within])
def test_a_look_up_in_a_group_or_in_a_clamp_is_refused(kind: type[ConverterControl]) -> None:
    with pytest.raises(GustformError, match=r"GF4102.*look up a table"):
        discretise(block_of(kind(curve=bowl())), PERIOD)
