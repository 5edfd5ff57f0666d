"""Exported controllers as C: against CasADi, on bad samples, over random ones, many at a time."""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gustform.language.errors import GustformError
from gustform.language.table import TableData
from gustform_codegen.emit.controller.c_header import ERRORS
from gustform_codegen.emit.controller.description import stable_id
from gustform_codegen.emit.controller.discretise import Method
from gustform_codegen.emit.controller.folder import WARNINGS, default_prefix, files, write_folder
from gustform_codegen.emit.controller.footprint import cortex, footprint
from gustform_codegen.emit.controller.program import Evaluator, Program
from gustform_codegen.emit.controller.vectors import input_sequence
from gustform_codegen.toolchain import find_compiler
from tests.support.controller import CONTROLS, PREFIX, SCHEDULED, Array, Compiled, program_of

EVERY = [*CONTROLS, *SCHEDULED]
BIT = {name: 1 << k for k, (name, _) in enumerate(ERRORS)}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, bool], Compiled]:
    """Every control in float and in double."""
    return {
        (name, double): Compiled(program_of(name), tmp_path_factory.mktemp(f"{name}_{double}"), double)
        for name in EVERY
        for double in (False, True)
    }


def by_casadi(one: Compiled, inputs: Array) -> tuple[Array, Array]:
    """Outputs and memory after each sample."""
    evaluator = Evaluator(one.program)
    rows = [(evaluator.step(row)[0], evaluator.memory) for row in inputs]
    return np.array([y for y, _ in rows]), np.array([m for _, m in rows])


# ---- numbers --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EVERY)
def test_double_has_the_bits_of_casadi(name: str, compiled: dict[tuple[str, bool], Compiled]) -> None:
    one = compiled[name, True]
    inputs = input_sequence(one.program, 2000, seed=1)
    out, memory, errors = one.run(inputs)
    expected_out, expected_memory = by_casadi(one, inputs)
    np.testing.assert_array_equal(out, expected_out)
    np.testing.assert_array_equal(memory, expected_memory)
    assert not np.any(errors & ~np.uint32(BIT["OUTPUT_LIMITED"] | BIT["TABLE_RANGE"]))


@pytest.mark.parametrize("name", EVERY)
def test_float_follows_within_its_digits(name: str, compiled: dict[tuple[str, bool], Compiled]) -> None:
    one = compiled[name, False]
    inputs = input_sequence(one.program, 20_000, seed=2)
    out, _, _ = one.run(inputs)
    # C in double is the oracle here: it has the bits of CasADi and is a thousand times faster.
    expected, _, _ = compiled[name, True].run(inputs)
    nominal = np.array([s.nominal for s in one.program.step.block.outputs])
    assert np.max(np.abs(out - expected) / nominal) < 1e-5  # design.md; round-off of slow filters: some 1e-6


@pytest.mark.parametrize("method", [Method.euler, Method.zoh])
@pytest.mark.parametrize("name", ["VirtualSynchronousMachine", "DualPort+estimated"])
def test_other_methods_have_the_bits_of_casadi(name: str, method: Method, tmp_path: Path) -> None:
    one = Compiled(program_of(name, method), tmp_path, True)
    inputs = input_sequence(one.program, 500, seed=3)
    np.testing.assert_array_equal(one.run(inputs)[0], by_casadi(one, inputs)[0])


@pytest.mark.parametrize("name", EVERY)
def test_context_is_small(name: str, compiled: dict[tuple[str, bool], Compiled]) -> None:
    assert compiled[name, False].library.context_size() <= 512  # bytes, issue 5


# ---- bad samples ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("double", [False, True])
def test_a_bad_sample_of_any_input_is_as_if_it_had_not_been(
    name: str, double: bool, compiled: dict[tuple[str, bool], Compiled]
) -> None:
    one = compiled[name, double]
    block = one.program.step.block
    good = input_sequence(one.program, 60, seed=4)
    reference, reference_memory, _ = one.run(good)
    for k, signal in enumerate(block.inputs):
        outside = [s + d for s, d in ((signal.low, -1.0), (signal.high, 1.0))]
        for value in (np.nan, np.inf, -np.inf, 1e38, -1e38, *outside):
            spoilt = np.insert(good, 30, good[30], axis=0)
            spoilt[30, k] = value
            out, memory, errors = one.run(spoilt)
            np.testing.assert_array_equal(out[30], reference[29])  # held, so finite and within limits
            np.testing.assert_array_equal(memory[30], reference_memory[29])
            assert errors[30] == BIT["INPUT_RANGE" if np.isfinite(value) else "INPUT_NOT_FINITE"]
            np.testing.assert_array_equal(np.delete(out, 30, axis=0), reference)
            assert not int(errors[31]) & ~(BIT["OUTPUT_LIMITED"] | BIT["TABLE_RANGE"])


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize(("double", "denormal"), [(False, 1e-40), (True, 1e-310)])
def test_a_denormal_is_a_number_like_others(
    name: str, double: bool, denormal: float, compiled: dict[tuple[str, bool], Compiled]
) -> None:
    one = compiled[name, double]
    block = one.program.step.block
    low, high = (np.array([getattr(s, end) for s in block.outputs]) for end in ("low", "high"))
    for k, signal in enumerate(block.inputs):
        inputs = input_sequence(one.program, 40, seed=5)
        zero = inputs.copy()
        inputs[20, k], zero[20, k] = denormal, 0.0
        out, _, errors = one.run(inputs)
        assert np.all((out >= low) & (out <= high))
        if signal.name == "omega_r" and "estimated" in name:  # the observer divides by it
            assert errors[20] & BIT["NUMERIC"]
            np.testing.assert_array_equal(out[20], out[19])
            np.testing.assert_array_equal(np.delete(out, 20, axis=0), one.run(np.delete(inputs, 20, axis=0))[0])
            continue
        assert not np.any(errors & (BIT["INPUT_NOT_FINITE"] | BIT["INPUT_RANGE"] | BIT["NUMERIC"]))
        # It may come through as it is, below the smallest normal number, 1.2e-38.
        np.testing.assert_allclose(out, one.run(zero)[0], rtol=0.0, atol=1e-38)


# ---- random samples -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EVERY)
def test_limits_hold_over_random_samples(name: str, compiled: dict[tuple[str, bool], Compiled]) -> None:
    one = compiled[name, False]
    step = one.program.step
    block, n = step.block, 1_000_000
    rng = np.random.default_rng(6)
    low, high = (np.array([getattr(s, end) for s in block.inputs]) for end in ("low", "high"))
    inputs = low + (high - low) * rng.random((n, len(block.inputs)))
    bad = rng.random(inputs.shape) < 0.01  # one value in a hundred is nonsense
    inputs[bad] = rng.choice([np.nan, np.inf, -np.inf, 1e38, -1e38], int(bad.sum()))
    out, memory, errors = one.run(inputs)
    out_low, out_high = (np.array([getattr(s, end) for s in block.outputs]) for end in ("low", "high"))
    assert np.all((out >= out_low.astype(np.float32)) & (out <= out_high.astype(np.float32)))
    states = [s.name for s in block.states]
    value = {p.name: p.value for p in step.parameters}
    for limiter in ("pitch_speed_limiter_integral", "pitch_power_limiter_integral"):
        column = memory[:, states.index(limiter)]
        assert column.min() == 0.0  # exactly at its limit, never beyond
        assert column.max() <= value["pitch_beta_max"]
    accepted = (errors & (BIT["INPUT_NOT_FINITE"] | BIT["INPUT_RANGE"])) == 0
    assert not np.any(errors & BIT["NUMERIC"])
    assert 0.85 * n < accepted.sum() < n
    held = np.flatnonzero(~accepted[1:]) + 1
    np.testing.assert_array_equal(out[held], out[held - 1])
    if name.startswith("GridFollowing"):
        i = [s.name for s in block.outputs]
        current = np.hypot(out[:, i.index("i_d_gsc")], out[:, i.index("i_q_gsc")])
        assert current.max() <= value["i_max"] * (1.0 + 1e-6)  # float


def test_an_integral_comes_off_its_limit_with_the_first_sample_of_the_other_sign(
    compiled: dict[tuple[str, bool], Compiled],
) -> None:
    one = compiled["GridFollowing", True]
    block = one.program.step.block
    names = [s.name for s in block.inputs]
    inputs = np.tile([s.value for s in block.inputs], (3000, 1))
    inputs[:2000, names.index("v_dc")] = 1.2  # 4 pu/s: at the limit after 0.15 s, wound up for long after
    inputs[2000:, names.index("v_dc")] = 0.999
    _, memory, _ = one.run(inputs)
    integral = memory[:, [s.name for s in block.states].index("dc_voltage_integral")]
    upper = 1.1 * (1.0 - 0.1 * 0.1) ** 0.5  # active_max of the declaration
    assert integral[1999] == upper
    # k_i e h = -2e-5 in each sample; the first holds both halves of its own
    np.testing.assert_allclose(integral[2000:2003] - upper, [-2e-5, -4e-5, -6e-5], rtol=1e-9)


# ---- life cycle -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["DualPort", "GridFollowing+estimated"])
def test_a_hundred_interleaved_instances_are_a_hundred_runs(
    name: str, compiled: dict[tuple[str, bool], Compiled]
) -> None:
    one = compiled[name, False]
    inputs = np.stack([input_sequence(one.program, 300, seed=100 + k) for k in range(100)], axis=1)
    together, memory, _ = one.run(inputs)
    for k in range(100):
        alone, alone_memory, _ = one.run(inputs[:, k])
        np.testing.assert_array_equal(together[:, k], alone)
        np.testing.assert_array_equal(memory[:, k], alone_memory)


def test_recalibrate_takes_all_parameters_or_none(compiled: dict[tuple[str, bool], Compiled]) -> None:
    one = compiled["DualPort", True]
    parameters = one.program.step.parameters
    names = [p.name for p in parameters]
    values = np.array([p.value for p in parameters])
    inputs = input_sequence(one.program, 200, seed=7)
    changed = values.copy()
    changed[names.index("K_gsc")], changed[names.index("T_v")] = 0.3, 0.02
    out, _, _ = one.run(inputs, changed)
    assert one.calibration == 0
    evaluator = Evaluator(one.program)
    evaluator.calibrate(changed)
    np.testing.assert_array_equal(out, np.array([evaluator.step(row)[0] for row in inputs]))
    before, _, _ = one.run(inputs)
    for name, bad in (("K_gsc", 0.0), ("T_v", -1.0), ("T_dc", 5e-324), ("V_ref", np.nan), ("pitch_K_p", np.inf)):
        wrong = changed.copy()
        wrong[names.index(name)] = bad
        out, _, errors = one.run(inputs, wrong)
        assert one.calibration == BIT["PARAMETER"]
        assert np.all(errors & BIT["PARAMETER"])
        np.testing.assert_array_equal(out, before)


# ---- the folder -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("language", ["c", "c++"])
def test_no_warning_in_c_or_cpp_and_the_folder_tests_itself(name: str, language: str, tmp_path: Path) -> None:
    made = program_of(name)
    prefix = default_prefix(name.partition("+")[0])
    write_folder(made, prefix, False, tmp_path)
    strict = ["-std=c99", "-Wmissing-prototypes", "-Wstrict-prototypes"] if language == "c" else ["-std=c++11"]
    compiler = find_compiler().path if language == "c" else "c++"
    for real in (0, 1):
        program = tmp_path / f"test_{real}"
        command = [
            compiler, "-x", language, *strict, *WARNINGS.split(), "-O1", "-ffp-contract=off",
            f"-D{prefix.upper()}_DOUBLE={real}", "-DGUST_CONTROLLER_LIBRARY",
            *(str(tmp_path / f) for f in (f"test_{prefix}.c", f"{prefix}.c", f"{prefix}_interface.c")),
            "-o", str(program), "-lm",
        ]  # fmt: skip
        built = subprocess.run(command, capture_output=True, text=True, check=False)
        assert built.returncode == 0, built.stderr
        ran = subprocess.run([str(program)], capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stdout


def with_small_tables(made: Program) -> Program:
    """cppcheck takes half a minute over tables of full size."""
    block = made.step.block
    x, y = np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 4)
    small = TableData(x, y, np.add.outer(x, y)).spline()
    block = replace(block, tables=[replace(g, spline=small) for g in block.tables])
    return replace(made, step=replace(made.step, block=block))


@pytest.mark.parametrize("name", EVERY)
def test_no_message_on_a_required_misra_rule(name: str, tmp_path: Path) -> None:
    made = with_small_tables(program_of(name))
    write_folder(made, PREFIX, False, tmp_path)
    for real in (0, 1) if name == "DualPort" else (0,):  # the number type changes few lines
        command = ["cppcheck", "--quiet", "--enable=warning,style,portability", "--addon=misra", f"-DCTL_DOUBLE={real}"]
        sources = ["ctl.c", "ctl_interface.c"]
        done = subprocess.run([*command, *sources], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        rules = set(re.findall(r"misra-c2012-([0-9.]+)", done.stderr))
        assert rules, "the addon says something about these files; if not, it has not run"
        # Advisory, each with its reason in docs/export.md.
        assert rules <= {"2.5", "8.7", "8.9", "11.5", "20.10"}, done.stderr


def test_a_library_is_known_by_its_interface(tmp_path: Path) -> None:
    """As a simulation or a bench takes it: dlopen, one function, and everything else from its table."""

    class Signal(ctypes.Structure):
        _fields_ = [
            ("name", ctypes.c_char_p),
            ("unit", ctypes.c_char_p),
            ("id", ctypes.c_uint32),
            ("offset", ctypes.c_uint32),
            *((n, ctypes.c_double) for n in ("low", "high", "value", "nominal")),
        ]

    call = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_void_p)

    class Controller(ctypes.Structure):
        _fields_ = [
            *((n, ctypes.c_uint32) for n in ("version", "real_size")),
            *((n, ctypes.c_char_p) for n in ("name", "control")),
            ("period", ctypes.c_double),
            ("context_size", ctypes.c_uint32),
            *((n, ctypes.c_uint32) for n in ("n_inputs", "n_outputs", "n_parameters", "n_monitors", "faulty")),
            *((n, ctypes.POINTER(Signal)) for n in ("inputs", "outputs", "parameters", "monitors")),
            *((n, call) for n in ("startup", "step", "recalibrate", "reinitialise")),
        ]

    made = program_of("Droop")
    write_folder(made, "droop", False, tmp_path)
    build = [["cmake", "-S", ".", "-B", "build"], ["cmake", "--build", "build", "--target", "droop_library"]]
    for command in build:
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    library = ctypes.CDLL(str(tmp_path / "build" / "droop.so"))
    library.gust_controller_interface.restype = ctypes.POINTER(Controller)
    one = library.gust_controller_interface().contents
    block = made.step.block
    assert (one.version, one.real_size, one.name, one.control, one.period) == (2, 4, b"droop", b"Droop", 1e-3)
    assert [one.inputs[k].name.decode() for k in range(one.n_inputs)] == [s.name for s in block.inputs]
    assert [one.outputs[k].unit.decode() for k in range(one.n_outputs)] == [s.unit for s in block.outputs]
    assert [one.parameters[k].high for k in range(one.n_parameters)] == [s.high for s in made.step.parameters]
    context = (ctypes.c_double * (one.context_size // 8 + 1))()
    assert one.startup(context) == 0
    fresh = bytes(context)
    assert one.step(context) == 0
    found = [ctypes.c_float.from_buffer(context, one.outputs[k].offset).value for k in range(one.n_outputs)]
    assert bytes(context) != fresh
    # Start values again, with the parameters as they are.
    gain = ctypes.c_float.from_buffer(context, one.parameters[0].offset)
    gain.value *= 0.5
    assert one.recalibrate(context) == 0
    changed = bytes(context)
    assert one.reinitialise(context) == 0
    again = bytes(context)
    one.startup(context)
    assert bytes(context) == fresh
    at = one.parameters[0].offset
    assert again[at : at + 4] == changed[at : at + 4] != fresh[at : at + 4]
    # Inputs, outputs and the memory before the two last words are those of the start.
    end = one.faulty - 4
    memory = 4 * len(block.states)
    assert again[: one.parameters[0].offset] == fresh[: one.parameters[0].offset]
    assert again[end - memory :] == fresh[end - memory :]
    expected = Evaluator(made).step(np.array([s.value for s in block.inputs]))[0]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("name", EVERY)
def test_a_microcontroller_has_room_for_it(name: str, tmp_path: Path) -> None:
    """In float on a Cortex-M4F: nothing in double, no data, frames of at most 256 bytes, a context of at most 512."""
    made, target = program_of(name), cortex("Cortex-M4F")
    assert target is not None, "the set-up installs gcc-arm-none-eabi"
    write_folder(made, PREFIX, False, tmp_path)
    found = footprint(made, PREFIX, False, tmp_path, target)
    assert set(found.library) <= {"sqrtf", "floorf", "memcpy", "memset"}  # so no __aeabi_dmul, no malloc
    assert (found.data, found.bss) == (0, 0)
    assert found.largest[1] <= 256
    chain = [f"{PREFIX}_step", "look_up", "weights"]  # where they have not become one function
    assert found.chain_bytes >= sum(found.frames.get(name, 0) for name in chain) >= found.frames[chain[0]] > 0
    assert found.context <= 512
    tables = sum(4 * len(grid.coefficient) for grid in made.step.block.tables)
    assert found.text <= 5000 + tables


def test_the_object_has_no_data_and_calls_little(tmp_path: Path) -> None:
    write_folder(program_of("GridFollowing"), PREFIX, False, tmp_path)
    target = tmp_path / "ctl.o"
    subprocess.run(
        [
            find_compiler().path,
            "-std=c99",
            "-Os",
            "-ffp-contract=off",
            "-c",
            str(tmp_path / "ctl.c"),
            "-o",
            str(target),
        ],
        check=True,
    )
    symbols = subprocess.run(["nm", str(target)], capture_output=True, text=True, check=True).stdout
    kinds = re.findall(r" ([A-Za-z]) (\S+)$", symbols, flags=re.MULTILINE)
    undefined = {name for kind, name in kinds if kind == "U"} - {"_GLOBAL_OFFSET_TABLE_"}
    assert undefined <= {"sqrtf", "floorf", "memcpy", "memset", "__stack_chk_fail"}
    assert not [name for kind, name in kinds if kind in "dDbBC"]
    assert {name for kind, name in kinds if kind == "T"} == {
        f"ctl_{function}" for function in ("startup", "step", "recalibrate", "reinitialise")
    }


def test_the_same_bytes_each_time() -> None:
    a, b = (files(program_of("DualPort"), "dual_port", False) for _ in range(2))
    assert a == b
    for name, text in a.items():
        assert not re.search(r"20[2-9]\d-\d\d-\d\d|/work|/home|/tmp", text), name
        assert max(map(len, text.splitlines())) < 260, name


def test_the_folder_builds_with_cmake(tmp_path: Path) -> None:
    write_folder(program_of("DualPort"), "dual_port", False, tmp_path)
    output = ""
    for command in (
        ["cmake", "-S", ".", "-B", "build"],
        ["cmake", "--build", "build"],
        ["ctest", "--test-dir", "build"],
    ):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        output = done.stdout
    assert "tests failed out of 2" in output  # "100% tests passed, 0 tests failed out of 2"


def test_the_description_names_every_signal() -> None:
    made = program_of("DualPort")
    text = files(made, "dual_port", True)["dual_port.json"]
    found = json.loads(text)
    assert (found["control"], found["period_s"], found["method"], found["real"]) == (
        "DualPort",
        1e-3,
        "tustin",
        "double",
    )
    assert [s["name"] for s in found["inputs"]] == [
        "v_dc", "Q_gsc", "Q_msc", "omega_del", "beta_del", "omega_r", "P_pmsg",
    ]  # fmt: skip
    assert [s["name"] for s in found["outputs"]] == ["omega_gsc", "V_gsc", "omega_msc", "V_msc", "beta_ref"]
    K_gsc = next(s for s in found["parameters"] if s["name"] == "K_gsc")
    assert (K_gsc["default"], K_gsc["min"], K_gsc["min_excluded"], K_gsc["max"]) == (0.5, 0.0, True, None)
    assert K_gsc["c"] == "p.K_gsc"
    every = [s for kind in ("inputs", "outputs", "parameters") for s in found[kind]]
    assert len({s["id"] for s in every}) == len(every)
    assert all(s["unit"] and s["description"] for s in every)
    assert stable_id("inputs", "v_dc") == found["inputs"][0]["id"] == 21071  # for ever


@pytest.mark.parametrize("double", [False, True])
def test_the_a2l_file_has_the_addresses_of_the_context(double: bool, tmp_path: Path) -> None:
    made = program_of("DualPort")
    write_folder(made, PREFIX, double, tmp_path)
    text = (tmp_path / f"{PREFIX}.a2l").read_text()
    measured = re.findall(r"/begin MEASUREMENT (\S+) .* ECU_ADDRESS (0x[0-9A-F]+) /end MEASUREMENT", text)
    adjusted = re.findall(r"/begin CHARACTERISTIC (\S+) .* VALUE (0x[0-9A-F]+) number .* /end CHARACTERISTIC", text)
    assert len(measured) == 7 + 5 + 2
    assert len(adjusted) == len(made.step.parameters)
    assert text.count("/begin") == text.count("/end")
    checks = [f"offsetof(ctl_context, {name}) == {address}" for name, address in [*measured, *adjusted]]
    code = "\n".join(["#include <stddef.h>", '#include "ctl.h"', *[f'_Static_assert({c}, "{c}");' for c in checks], ""])
    (tmp_path / "offsets.c").write_text(code)
    command = [find_compiler().path, "-std=c11", "-fsyntax-only", str(tmp_path / "offsets.c")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("prefix", ["", "9a", "a-b", "Ab", "float", "a" * 40, "a;b"])
def test_a_prefix_that_is_no_name_is_refused(prefix: str) -> None:
    with pytest.raises(GustformError, match="GF2071"):
        files(program_of("Matching"), prefix, False)
