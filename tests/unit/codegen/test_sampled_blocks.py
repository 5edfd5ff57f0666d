"""Sampled controllers in the system table: what they are made of and share, where they start, what is refused."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gustform.control.converter_control import ConverterControl
from gustform.control.curtailment_schedule import CurtailmentSchedule
from gustform.control.dual_port import DualPort
from gustform.control.pitch import PitchControl
from gustform.language import Discrete, Output
from gustform.language.errors import GustformError
from gustform.language.system import Constant
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.export import block_of_scenario
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.emit.controller.c_header import Names
from gustform_codegen.emit.controller.c_source import source
from gustform_codegen.emit.controller.discretise import discretise
from gustform_codegen.emit.controller.interface import HEADER
from gustform_codegen.emit.controller.program import Evaluator, program
from gustform_codegen.flatten import flatten
from gustform_codegen.initial import steady_state
from gustform_codegen.sampled import continuous, library_sources
from gustform_codegen.symbolic import key_of, keys_in
from gustform_codegen.unit_type import UnitType
from gustform_runtime import RunError, Simulation, Status
from tests.physics.paper_system import paper_system
from tests.support.case import SCENARIOS, Case, open_case
from tests.support.controller import CONTROLS

ROOT = Path(__file__).resolve().parents[3]
CHANNELS = ("sg.frequency", "wt.v_dc", "wt.omega_r", "wt.P_gsc", "wt.control.V_gsc")
SCHEDULES = ["CurtailmentSchedule", "CurtailmentSchedule, wind_source: estimated"]
WIND = "wind.wt={type: ramp, from: 8 m/s, to: 9 m/s, at: 0.2 s, duration: 1 s}"
EARLY = "events=[{at: 0.5 s, set: {load.active: 120 MW}}]"


def case(*changes: str) -> Case:
    return open_case("load_step_8ms", "wt.control.sampled=1 ms", *changes)


def collector(rows: list[Any]) -> Callable[[Any, Any], None]:
    def keep(_times: Any, values: Any) -> None:
        rows.append(values)

    return keep


@pytest.fixture(scope="module")
def cache(root: Path, tmp_path_factory: pytest.TempPathFactory) -> KernelCache:
    return KernelCache(root / "runtime" / "include", tmp_path_factory.mktemp("kernels"))


# ---- equations ----


def test_no_equation_of_the_control_is_left() -> None:
    whole, plant = (flatten(PmsgTurbine(control=DualPort(sampled=h)), frozenset({"frame"})) for h in (0.0, 1e-3))
    assert {u.path for u in plant.unknowns} < {u.path for u in whole.unknowns}
    assert [u.path for u in plant.unknowns] == ["drive.w", "pmsg.rho", "dc_link.v", "gsc.theta", "pitch.servo.beta"]
    commands = [f"control.{name}" for name in DualPort.declared(Output)]
    assert {d.path for d in plant.discretes} == {"dc_link.trip", *commands, "pitch.beta_ref"}
    assert not plant.free_parameters
    assert not plant.initial
    # Its parameters are the controller's; the servo's are the plant's.
    paths = {p.path for p in plant.parameters}
    assert not any(path.startswith(("control.", "pitch.")) and not path.startswith("pitch.servo.") for path in paths)


@pytest.mark.parametrize("source", ["measured", "estimated"])
def test_a_schedule_leaves_the_equations_with_its_control(source: str) -> None:
    """Or stays there, where it is outside of the controller."""

    def plant(location: str) -> UnitType:
        schedule = CurtailmentSchedule(wind_source=source, location=location)
        return flatten(PmsgTurbine(control=DualPort(sampled=1e-3), schedule=schedule), frozenset({"frame"}))

    inside, outside = plant("controller"), plant("outside")
    states = {"schedule.v", "schedule.source.x"} if source == "estimated" else {"schedule.v"}
    assert {u.path for u in outside.unknowns} - {u.path for u in inside.unknowns} == states
    told = {"schedule.omega_del", "schedule.beta_del"}
    assert {d.path for d in inside.discretes} - {d.path for d in outside.discretes} == told
    assert not any(p.path.startswith("schedule.") for p in inside.parameters)
    assert not [ref for ref in inside.tables if ref.owner.path.startswith("schedule")]
    # What the controller tells of itself is no command: no equation has it.
    symbols = {key_of(d.symbol) for d in inside.discretes if d.path in told}
    assert all(symbols.isdisjoint(keys_in(row.expression)) for row in inside.rows)


def test_the_header_of_the_runtime_is_that_of_the_export() -> None:
    assert (ROOT / "runtime" / "include" / "gustform" / "gust_controller.h").read_text() == HEADER.read_text()


# ---- what is loaded ----


@pytest.mark.parametrize(
    ("control", "schedule"), [*((c, "FixedPoint") for c in CONTROLS), *(("DualPort", s) for s in SCHEDULES)]
)
def test_the_library_is_that_of_the_export(control: str, schedule: str, tmp_path: Path) -> None:
    """The C beside the library that is loaded differs from the exported one in start and default values alone."""
    chosen = [
        f"components.wt.control={{type: {control}, sampled: 1 ms}}",
        f"components.wt.schedule={{type: {schedule}}}",
    ]
    sampled = open_case("load_step_8ms", *chosen).table.sampled
    block = block_of_scenario("wt", SCENARIOS / "load_step_8ms.yaml", chosen)
    made = program(discretise(block, 1e-3))
    exported = source(made, Names(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", control).lower(), False)).splitlines()
    loaded = Path(sampled.libraries[0]).with_suffix(".c").read_text().splitlines()
    assert len(exported) == len(loaded)
    value = re.compile(r" *c->(in|out|mon|p|memory)[.\[][a-zA-Z_0-9\]]+ = (R\(.*\)|\(-R\(.*\)\));")
    other = [(a, b) for a, b in zip(exported, loaded, strict=True) if a != b]
    assert all(value.fullmatch(a) and value.fullmatch(b) for a, b in other)
    # And the values themselves are those of the export.
    found = sampled.blocks[0]
    assert found.measurement_names == [s.name for s in block.inputs]
    assert found.command_names == [s.name for s in block.outputs]
    assert found.monitor_names == [s.name for s in block.monitors]
    np.testing.assert_array_equal(found.parameters, [p.value for p in made.step.parameters])
    np.testing.assert_allclose(found.states, [s.value for s in block.states], rtol=1e-8, atol=1e-9)


class _Descriptor(ctypes.Structure):
    _fields_ = (("version", ctypes.c_uint32), ("real_size", ctypes.c_uint32), ("name", ctypes.c_char_p))


@pytest.mark.parametrize("real", ["float", "double"])
def test_number_type(real: str) -> None:
    found = case(f"wt.control.real={real}").table.sampled
    library: Any = ctypes.CDLL(found.libraries[0])
    library.gust_controller_interface.restype = ctypes.POINTER(_Descriptor)
    descriptor = library.gust_controller_interface().contents
    assert (descriptor.version, descriptor.name) == (2, b"dual_port")
    assert descriptor.real_size == found.blocks[0].real_size == {"float": 4, "double": 8}[real]


def test_instances_share_a_library(cache: KernelCache) -> None:
    """Turbines that differ by numbers alone, also by those of their operating points, have one library and start each
    in their own steady state; another period is another library."""
    system = paper_system(8.0)
    for number, (wind, control) in enumerate(
        [(9.0, DualPort(sampled=1e-3)), (10.0, DualPort(sampled=1e-3)), (9.0, DualPort(sampled=2e-3, delay=1)),
         (8.0, DualPort())], start=1,
    ):  # fmt: skip
        name = f"w[{number}]"
        system.add(name, PmsgTurbine(wind_speed=wind, curtailment=0.1, control=control))
        system.connect(f"{name}.grid", "bus.terminal")
        system.bind(f"{name}.wind", Constant(wind))
    system.frame("sg.omega")
    built = build(system, cache)
    table = steady_state(built.linked).table
    blocks = {b.name: b for b in table.sampled.blocks}
    assert list(blocks) == ["w[1]", "w[2]", "w[3]"]
    assert [b.library for b in blocks.values()] == [0, 0, 1]
    assert [(b.period, b.delay) for b in blocks.values()] == [(1e-3, 0), (1e-3, 0), (2e-3, 1)]
    assert np.any(blocks["w[1]"].parameters != blocks["w[2]"].parameters)
    again = build(system, cache)
    assert again.compilations == 0
    with Simulation(table.to_bytes()) as simulation:
        simulation.set_option("rtol", 1e-8)
        assert [b.name for b in simulation.sampled_blocks()] == list(blocks)
        simulation.initialise(0.0)
        simulation.advance(2.0)
        counts = [simulation.sampled_statistics(k) for k in range(3)]
        _, y, _ = simulation.state()
    assert [c.samples for c in counts] == [2000, 2000, 1000]
    assert all(c.bad_samples == 0 and np.isnan(c.first_error) for c in counts)
    # Angles drift by the jitter of float commands; see tests/physics/test_sampled.py.
    assert np.max(np.abs(y - table.start) / table.nominal) < 1e-5


def test_the_twin_is_the_system_without_samples(cache: KernelCache) -> None:
    """The same types, so that they are flattened once in a process, whatever the samples are like."""
    plain, twin = paper_system(8.0), paper_system(8.0)
    plain.components["wt"] = PmsgTurbine(control=DualPort(K_gsc=0.6))
    twin.components["wt"] = PmsgTurbine(control=DualPort(K_gsc=0.6, sampled=2e-3, delay=1, real="double"))
    found = build(twin, cache).linked.twin
    assert found is not None
    assert [t.unit for t in found.types] == [t.unit for t in build(plain, cache).linked.types]
    assert found.system.components["wt"].part("control").value("K_gsc") == 0.6


def test_systems_without_samples_are_as_they_were(cache: KernelCache) -> None:
    system = paper_system(8.0)
    assert continuous(system) is system
    linked = build(system, cache).linked
    assert linked.twin is None
    assert not linked.table.sampled.sections()


# ---- the host in place of the library ----


@pytest.mark.parametrize("schedule", ["FixedPoint", *SCHEDULES])
def test_casadi_in_place_of_the_library_gives_the_same_bits(schedule: str) -> None:
    """The step as CasADi evaluates it, made by the export, called back at each sample: the run is that of the C. What
    the controller tells of its schedule is told by the C alone."""
    changes = ("wt.control.real=double", f"components.wt.schedule={{type: {schedule}}}", WIND, EARLY)
    found = case(*changes)
    block = block_of_scenario("wt", SCENARIOS / "load_step_8ms.yaml", ["wt.control.sampled=1 ms", *changes])
    oracle = Evaluator(program(discretise(block, 1e-3)))
    times: list[float] = []
    monitors: list[Any] = []

    def step(time: float, measured: Any) -> Any:
        times.append(time)
        commands, _ = oracle.step(measured)
        monitors.append(oracle.monitors)
        return commands

    results = []
    told = tuple(f"wt.schedule.{s.name}" for s in block.monitors)
    for by_host in (False, True):
        rows: list[Any] = []
        with found.simulation((*CHANNELS, *told), rtol=1e-7) as simulation:
            simulation.set_sink(1e-3, collector(rows))
            if by_host:
                simulation.set_sampled(0, step)
            simulation.initialise(0.0)
            simulation.advance(2.0)
            results.append((np.concatenate(rows), simulation.statistics(), simulation.state()[1]))
    np.testing.assert_allclose(times, 1e-3 * np.arange(2000), rtol=1e-12, atol=0.0)
    (a, effort_a, y_a), (b, effort_b, y_b) = results
    n = len(CHANNELS)
    assert np.array_equal(a[:, :n], b[:, :n])
    assert np.isnan(b[:, n:]).all()
    assert np.array_equal(a[1 : len(monitors), n:], np.array(monitors[:-1], np.float32))  # rows are before the sample
    assert effort_a == effort_b
    assert np.array_equal(y_a, y_b)
    assert np.ptp(a[:, 0]) > 0.05
    assert (len(told) == 2) == (schedule != "FixedPoint")


def test_a_host_that_fails_is_raised() -> None:
    def late(time: float, measured: Any) -> Any:
        if time > 0.0105:
            raise RuntimeError("the bus is gone")
        return [1.0, 1.0, 1.2, 0.9, 0.0]

    found = case()
    with found.simulation() as simulation:
        simulation.set_sampled(0, late)
        simulation.initialise(0.0)
        with pytest.raises(RuntimeError, match="the bus is gone"):
            simulation.advance(1.0)
        assert simulation.time == pytest.approx(0.011)
    wrong: list[tuple[Any, type[Exception]]] = [([1.0], ValueError), ([1.0, 1.0, np.nan, 0.9, 0.0], RunError)]
    for given, code in wrong:

        def answer(_time: float, _measured: Any, given: Any = given) -> Any:
            return given

        with found.simulation() as simulation:
            simulation.set_sampled(0, answer)
            simulation.initialise(0.0)
            with pytest.raises(code):
                simulation.advance(1.0)
    with found.simulation() as simulation, pytest.raises(RunError) as refused:
        simulation.set_sampled(1, late)
    assert refused.value.code == Status.BAD_ARGUMENT


def test_what_the_runtime_tells_of_a_block() -> None:
    with case("wt.control.delay=1").simulation() as simulation:
        (block,) = simulation.sampled_blocks()
        assert simulation.n_sampled == 1
    assert (block.name, block.period, block.delay, block.real_size) == ("wt", 1e-3, 1, 4)
    assert list(block.commands.items()) == [
        ("omega_gsc", "pu"), ("V_gsc", "pu"), ("omega_msc", "pu"), ("V_msc", "pu"), ("beta_ref", "deg")
    ]  # fmt: skip
    assert block.measurements["beta_del"] == "deg"
    assert np.array_equal(block.start, block.start.astype(np.float32))  # as on a bus
    assert block.start[0] == pytest.approx(1.0, abs=1e-6)


# ---- checkpoints ----


@pytest.mark.parametrize("delay", [0, 1])
def test_a_run_goes_on_from_a_checkpoint_with_the_same_bits(delay: int) -> None:
    found = case(f"wt.control.delay={delay}", EARLY)

    def run(start: bytes | None) -> tuple[Any, bytes]:
        rows: list[Any] = []
        with found.simulation(CHANNELS, rtol=1e-6) as simulation:
            simulation.set_sink(2e-3, collector(rows))
            simulation.initialise(0.0)
            if start is None:
                simulation.advance(0.7315)
                simulation.checkpoint()
                rows.clear()
            else:
                simulation.restore(start)
            simulation.advance(1.5)
            return np.concatenate(rows), start or simulation.checkpoint_bytes()

    whole, state = run(None)
    again, _ = run(state)
    assert np.array_equal(whole, again)


# ---- what is refused ----


class _WithEvent(ConverterControl):
    """A control that has no sampled form."""

    d = Discrete("pu", "a value that jumps", start=1.0)
    V_gsc = Output("pu", "voltage", start=1.0)
    omega_msc = Output("pu", "frequency", start=1.2)
    V_msc = Output("pu", "voltage", start=0.9)

    def equations(self) -> None:
        self.when(self.v_dc > 2.0, {self.d: 0.5})
        self.eq(self.omega_gsc, self.d)
        self.eq(self.V_gsc, self.d)
        self.eq(self.omega_msc, 1.2)
        self.eq(self.V_msc, 0.9)


def test_a_control_that_cannot_be_exported(cache: KernelCache) -> None:
    system = paper_system(8.0)
    system.components["wt"] = PmsgTurbine(control=_WithEvent(sampled=1e-3))
    with pytest.raises(GustformError, match=r"GF4101: .*_WithEvent cannot be exported .* it has events"):
        build(system, cache)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"sampled": -1e-3}, "sampled must be at least 0"),
        ({"sampled": 1e-6}, "sampled must be 0 or at least 1e-05"),
        ({"sampled": 2.0}, "sampled must be at most 1"),
        ({"sampled": 1e-3, "delay": 2}, "delay must be at most 1"),
        ({"sampled": 1e-3, "delay": 0.5}, "delay must be 0 or 1"),
        ({"sampled": 1e-3, "delay": True}, "delay must be 0 or 1"),
        ({"delay": 1}, "delay must be 0 where the control is continuous"),
        ({"sampled": 1e-3, "real": "half"}, "real must be float or double"),
    ],
)
def test_values_that_cannot_be(given: dict[str, Any], says: str) -> None:
    with pytest.raises(GustformError, match=f"GF2003: .*{says}"):
        DualPort(**given)


def test_half_a_controller_is_refused(cache: KernelCache) -> None:
    system = paper_system(8.0)
    system.components["wt"] = PmsgTurbine(control=DualPort(sampled=1e-3), pitch=PitchControl())
    with pytest.raises(GustformError, match=r"GF4105: .*both controls are one controller"):
        build(system, cache)
    system.components["wt"] = PmsgTurbine(schedule=CurtailmentSchedule(sampled=1e-3))
    with pytest.raises(GustformError, match=r"GF4105: .*schedule.sampled = 0.001 s, .*both are one controller"):
        build(system, cache)


def test_the_library_is_compiled_once(tmp_path: Path) -> None:
    cache = KernelCache(ROOT / "runtime" / "include", tmp_path)
    turbine = PmsgTurbine()
    from gustform_codegen.emit.controller.block import controller_block

    made = program(discretise(controller_block(turbine.control, turbine.pitch), 1e-3))
    sources = library_sources(made, Names("dual_port", False))
    path = cache.controller(sources, "DualPort")
    assert path.parent == tmp_path / "controllers"
    assert path.with_suffix(".c").read_text() == sources["dual_port.c"]
    assert cache.controller(sources, "DualPort") == path
    assert cache.compilations == 1
    path.write_bytes(path.read_bytes()[:1000])  # cut off by a crash
    assert cache.controller(sources, "DualPort") == path
    assert cache.compilations == 2
    with pytest.raises(GustformError, match=r"GF4002: .* failed on controller DualPort"):
        cache.controller({**sources, "dual_port.c": "int x"}, "DualPort")
