"""The discrete step: transfer functions in closed form, pre-warping, refusals; the printed sin and cos."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.signal import cont2discrete

from gustform.control.converter_control import ConverterControl
from gustform.language import Input, Parameter, Variable, limit
from gustform.language.errors import GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.emit.controller.block import Block, controller_block
from gustform_codegen.emit.controller.discretise import Method, discretise
from gustform_codegen.emit.controller.frequency import Pair, as_csv, as_text, frequency_response
from gustform_codegen.emit.controller.printer import helpers, literal
from gustform_codegen.emit.controller.program import Evaluator, program
from gustform_codegen.toolchain import find_compiler
from tests.support.controller import CONTROLS, PERIOD, Compiled, block_of


class Resonator(ConverterControl):
    """omega_gsc = k w^2/(s^2 + 2 z w s + w^2) v_dc: a badly damped pair."""

    w = Parameter("1/s", "natural frequency, rad/s", default=2.0 * math.pi * 50.0, above=0.0)
    z = Parameter("1", "damping ratio", default=0.01, above=0.0)
    x = Variable("pu", "position")
    y = Variable("pu", "rate by the natural frequency")

    def equations(self) -> None:
        self.eq(self.der(self.x), self.w * self.y)
        self.eq(self.der(self.y), self.w * (self.v_dc - self.x - 2.0 * self.z * self.y))
        self.eq(self.omega_gsc, self.x)


class Wave(ConverterControl):
    """Needs sin, cos and floor-free arithmetic of an input."""

    v_q = Input("pu", "angle")

    def equations(self) -> None:
        self.eq(self.omega_gsc, 1.0 + 0.1 * ca.sin(10.0 * self.v_q) * ca.cos(3.0 * self.v_dc))


class Bent(ConverterControl):
    """A rate limit: no clamp of an integral."""

    T = Parameter("s", "time constant", default=0.1, above=0.0)
    x = Variable("pu", "state")

    def equations(self) -> None:
        self.eq(self.der(self.x), limit((self.v_dc - self.x) / self.T, -0.1 / self.T, 0.1 / self.T))
        self.eq(self.omega_gsc, self.x)


def pair(pairs: list[Pair], source: str, output: str) -> Pair:
    return next(q for q in pairs if (q.input, q.output) == (source, output))


# ---- transfer functions ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("period", [1e-4, 1e-3, 5e-3])
def test_tustin_is_the_lead_lag_at_the_mapped_frequency(period: float) -> None:
    """omega_gsc/v_dc = (K + K_d s)/(T s + 1) with s = 2/h (z - 1)/(z + 1)."""
    q = pair(frequency_response(discretise(block_of("DualPort"), period)), "v_dc", "omega_gsc")
    z = np.exp(2j * np.pi * q.frequency * period)
    s = 2.0 / period * (z - 1.0) / (z + 1.0)
    K, K_d, T = 0.5, 0.0067, 0.002  # defaults of DualPort
    np.testing.assert_allclose(q.discrete, (K + K_d * s) / (T * s + 1.0), rtol=1e-9)
    s = 2j * np.pi * q.frequency
    np.testing.assert_allclose(q.continuous, (K + K_d * s) / (T * s + 1.0), rtol=1e-9)


def test_euler_is_the_lead_lag_at_its_mapped_frequency() -> None:
    q = pair(frequency_response(discretise(block_of("DualPort"), PERIOD, Method.euler)), "v_dc", "omega_gsc")
    s = (1.0 - np.exp(-2j * np.pi * q.frequency * PERIOD)) / PERIOD
    np.testing.assert_allclose(q.discrete, (0.5 + 0.0067 * s) / (0.002 * s + 1.0), rtol=1e-9)


def test_zero_order_hold_is_that_of_scipy() -> None:
    """P_gsc -> omega_gsc of the virtual synchronous machine: two coupled states, by the exponential of a matrix."""
    q = pair(
        frequency_response(discretise(block_of("VirtualSynchronousMachine"), PERIOD, Method.zoh)), "P_gsc", "omega_gsc"
    )
    M, D, m_p, T_f = 4.0, 100.0, 0.05, 0.5  # 2 H and the other defaults
    A = np.array([[-(1.0 / m_p + D) / M, D / M], [1.0 / T_f, -1.0 / T_f]])
    B, C = np.array([[-1.0 / M], [0.0]]), np.array([[1.0, 0.0]])
    A_d, B_d, _, _, _ = cont2discrete((A, B, C, np.zeros((1, 1))), PERIOD, "zoh")
    z = np.exp(2j * np.pi * q.frequency * PERIOD)
    expected = [(C @ np.linalg.solve(v * np.eye(2) - A_d, B_d))[0, 0] for v in z]
    np.testing.assert_allclose(q.discrete, expected, rtol=1e-8)


def test_zero_order_hold_is_exact_for_a_stiff_filter() -> None:
    """h/T from 0.001 to 100: x+ = e^(-h/T) x + (1 - e^(-h/T)) u."""
    for T in (1.0, 0.1, 1e-3, 1e-4, 1e-5):
        block = block_of(type("Filter", (Resonator,), {"equations": lag_equations})(w=1.0 / T))
        evaluator = Evaluator(program(discretise(block, PERIOD, Method.zoh)))
        inputs = np.array([s.value for s in block.inputs])
        inputs[[s.name for s in block.inputs].index("v_dc")] = 1.3
        evaluator.step(inputs)
        states = [s.name for s in block.states]
        assert evaluator.memory[states.index("x")] == pytest.approx(1.3 * -math.expm1(-PERIOD / T), rel=1e-12)


def lag_equations(self: Resonator) -> None:
    self.eq(self.der(self.x), self.w * (self.v_dc - self.x))
    self.eq(self.y, 0.0 * self.z)
    self.eq(self.omega_gsc, self.x)


def test_a_resonance_is_pre_warped() -> None:
    period = 2e-3  # a tenth of the period of the resonance
    step = discretise(block_of(Resonator()), period)
    w = 2.0 * math.pi * 50.0
    assert step.prewarped == pytest.approx({"x": w, "y": w}, rel=1e-12)
    z = complex(np.exp(1j * w * period))
    half = math.tan(w * period / 2.0) / w
    s = (z - 1.0) / (z + 1.0) / half
    assert s == pytest.approx(1j * w, rel=1e-12)  # so the peak stands where it was
    q = pair(frequency_response(step), "v_dc", "omega_gsc")
    s_all = (np.exp(2j * np.pi * q.frequency * period) - 1.0) / (np.exp(2j * np.pi * q.frequency * period) + 1.0) / half
    np.testing.assert_allclose(q.discrete, w * w / (s_all**2 + 0.02 * w * s_all + w * w), rtol=1e-8)
    assert not discretise(block_of(Resonator(z=0.8)), period).prewarped


@pytest.mark.parametrize("name", CONTROLS)
def test_report_of_every_control(name: str) -> None:
    step = discretise(block_of(name), PERIOD)
    pairs = frequency_response(step)
    # Tustin bends frequency by (w h)^2/12: 0.8 % at 50 Hz, of which a lead-lag with its corner there shows a quarter
    assert max(q.error(50.0) for q in pairs) < 2.5e-3
    assert name in as_text(step, pairs)
    assert len(as_csv(pairs).splitlines()) == 1 + sum(q.frequency.size for q in pairs)


@pytest.mark.parametrize("method", list(Method))
@pytest.mark.parametrize("name", CONTROLS)
def test_a_step_of_an_input_ends_where_the_equations_say(name: str, method: Method) -> None:
    """After a long time the filters stand at their inputs: the discrete step has the continuous steady state."""
    block = block_of(name)
    evaluator = Evaluator(program(discretise(block, PERIOD, method)))
    inputs = np.array([s.value for s in block.inputs])
    names = [s.name for s in block.inputs]
    inputs[names.index("Q_gsc")], inputs[names.index("P_pmsg")] = 0.0, 0.7
    for _ in range(8000):
        evaluator.step(inputs)
    states = [s.name for s in block.states]
    assert evaluator.memory[states.index("pitch_P_filtered")] == pytest.approx(0.7, rel=1e-6)
    if name == "VirtualSynchronousMachine":  # omega - 1 = m_p (P* - P): 0 at the start's power
        assert evaluator.outputs[0] == pytest.approx(1.0, abs=1e-5)


# ---- what is left out, what is refused ------------------------------------------------------------------------------
def test_the_servo_is_plant_and_repeated_parameters_are_one() -> None:
    block = block_of("DualPort")
    assert "pitch_servo_beta" not in [s.name for s in block.states]
    names = [p.name for p in discretise(block, PERIOD).parameters]
    assert "T_dc" in names
    assert not {"gsc_T_dc", "msc_T_dc", "pitch_servo_T", "pitch_speed_limiter_T_release"} & set(names)


def test_found_values_are_the_defaults() -> None:
    turbine = PmsgTurbine()
    found = {"control.gsc.Q_ref": 0.25, "pitch.P_filtered": 0.4}
    block = controller_block(turbine.control, turbine.pitch, found)
    assert next(p.value for p in block.parameters if p.name == "gsc_Q_ref") == 0.25
    assert next(s.value for s in block.states if s.name == "pitch_P_filtered") == 0.4


class Unknown(ConverterControl):
    temperature = Input("pu", "no range is known for it")

    def equations(self) -> None:
        self.eq(self.omega_gsc, self.temperature + 0.0 * self.v_dc)


def test_what_has_no_sampled_form_is_refused() -> None:
    with pytest.raises(GustformError, match=r"GF4102.*rate of x bends"):
        discretise(block_of(Bent()), PERIOD)
    with pytest.raises(GustformError, match=r"GF4101.*temperature"):
        block_of(Unknown())
    with pytest.raises(GustformError, match="GF2070"):
        discretise(block_of("Matching"), 0.0)
    with pytest.raises(GustformError, match="GF4101"):
        literal(math.inf)


# ---- printed functions ----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("double", "bound"), [(True, 2.0**-52), (False, 2.0**-23)])
def test_sin_and_cos_keep_their_bound(double: bool, bound: float, tmp_path: Path) -> None:
    real = "double" if double else "float"
    code = f"""#include <math.h>
#include <stdio.h>
#define T_DOUBLE {int(double)}
typedef {real} real;
#define R(x) x{"" if double else "##f"}
{helpers({"sin", "cos"}, "T")}
int main(void)
{{
    real x;
    while (fread(&x, sizeof x, 1, stdin) == 1) {{
        const real y[2] = {{ sin_real(x), cos_real(x) }};
        (void)fwrite(y, sizeof y, 1, stdout);
    }}
    return 0;
}}
"""
    (tmp_path / "wave.c").write_text(code)
    command = [find_compiler().path, "-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*command, str(tmp_path / "wave.c"), "-o", str(tmp_path / "wave"), "-lm"], check=True)
    kind = np.float64 if double else np.float32
    quarters = np.arange(-640, 641) * (np.pi / 2.0)  # where the cancellation is worst
    x = np.concatenate([np.linspace(-1000.0, 1000.0, 200_001), quarters, np.linspace(-0.8, 0.8, 20_001)]).astype(kind)
    run = subprocess.run([str(tmp_path / "wave")], input=x.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(run.stdout, kind).reshape(-1, 2).astype(np.longdouble)
    exact = x.astype(np.longdouble)  # 64 bits of mantissa: 1e-16 of 1000 would be no oracle in double
    assert float(np.max(np.abs(found[:, 0] - np.sin(exact)))) <= bound
    assert float(np.max(np.abs(found[:, 1] - np.cos(exact)))) <= bound


def test_a_control_with_sin_and_cos(tmp_path: Path) -> None:
    made = program(discretise(block_of(Wave()), PERIOD))
    one = Compiled(made, tmp_path, True)
    rng = np.random.default_rng(8)
    block: Block = made.step.block
    inputs = np.tile([s.value for s in block.inputs], (500, 1))
    names = [s.name for s in block.inputs]
    inputs[:, names.index("v_q")] = rng.uniform(-2.0, 2.0, 500)
    inputs[:, names.index("v_dc")] = rng.uniform(0.0, 2.0, 500)
    expected = 1.0 + 0.1 * np.sin(10.0 * inputs[:, names.index("v_q")]) * np.cos(3.0 * inputs[:, names.index("v_dc")])
    np.testing.assert_allclose(one.run(inputs)[0][:, 0], expected, rtol=0.0, atol=1e-15)
