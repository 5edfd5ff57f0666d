"""What every component must pass: the registered ones, and the fixed parts inside them."""

from __future__ import annotations

import inspect
import math
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from gustform.language import Component, GustformError, Parameter, Part
from gustform.language.declare import Declaration, Variable
from gustform.language.scope import Symbol, elaborate
from gustform.language.unitcheck import check_units
from gustform.language.units import dimension_of
from gustform.registry import component_types
from gustform_cli.catalogue import all_types
from gustform_codegen.build import build, unit_type
from gustform_codegen.cache import KernelCache
from gustform_codegen.emit.kernel import Kernel
from gustform_codegen.evaluate import TypeEvaluator
from gustform_codegen.initial import steady_state
from gustform_codegen.unit_type import UnitType
from gustform_runtime import Simulation
from tests.components.kernel import Array, CompiledKernel, Point
from tests.components.systems import SYSTEMS, VARIANTS, example

NAMES = sorted(component_types())
EVERY = sorted(all_types())  # with the fixed parts of units, which need not stand alone
BUILT = [*NAMES, *sorted(VARIANTS)]
# The flags of the contract for generated C.
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wstrict-prototypes", "-Werror"]
# A stiff drive train by itself: the torque that holds its two shafts together comes from what hangs at them.
ALONE = {"OneMass": 1}
# Units that a system wires to the speed of a machine; there the input is an unknown of the system, not a constant.
FRAMED = ("PmsgTurbine", "SynchronousGenerator")


def tree(component: Component) -> list[Component]:
    """A component and all its parts."""
    found = [component]
    for name in component.declared(Part):
        found += tree(component.part(name))
    return found


def flat(name: str) -> tuple[UnitType, Kernel]:
    """The unit type of a component, and its C."""
    return unit_type(example(name), signals(name))


def signals(name: str) -> frozenset[str]:
    """Inputs that a system wires to another unit."""
    return frozenset({"frame"}) if name.partition(",")[0] in FRAMED else frozenset()


def points(unit: UnitType, n: int = 5, spread: float = 0.02) -> list[Point]:
    """Points around the start values: each unknown off by up to `spread` of itself and of its nominal value."""
    rng = np.random.default_rng(7)
    component = unit.component
    values = component.parameter_values()

    def start(path: str, declared: Symbol) -> tuple[float, float]:
        """Start and nominal value."""
        owner, port, name = component.at(declared.owner.path), declared.port, path.rpartition(".")[2]
        declaration: Any = declared.declaration
        if port is None:
            return owner.start_value(declaration), owner.number(declaration.nominal)
        value = port.start.get(name, getattr(declaration, "start", 0.0))
        return owner.number(value), owner.number(port.nominal.get(name, declaration.nominal))

    def around(pairs: list[tuple[float, float]]) -> Array:
        base = np.array([p[0] for p in pairs])
        size = np.array([abs(p[0]) + abs(p[1]) for p in pairs])
        return base + spread * size * rng.uniform(-1.0, 1.0, len(pairs))

    result = []
    for k in range(n):
        y = around([start(u.path, u.declared) for u in unit.unknowns])
        w = around([start(x.path, x.declared) for x in unit.externals])
        u = around([start(s.path, s) for s in unit.inputs])
        p = np.array([values[s.path] for s in unit.parameters])
        tables = [component.at(t.owner.path).table(t.declaration.name) for t in unit.tables]
        # discrete values stand at either side of what switches them
        d = np.array([float(k % 2) for _ in unit.discretes])
        result.append(Point(y, rng.uniform(-1.0, 1.0, y.size), w, u, d, p, tables))
    return result


def close(a: Array, b: Array, relative: float) -> None:
    """Equal to `relative` of the entry, or of the largest entry in its row where terms cancel."""
    assert a.shape == b.shape
    if not b.size:
        return
    scale = np.maximum(np.abs(b), np.max(np.abs(b), axis=-1, keepdims=True)) if b.ndim > 1 else np.abs(b)
    assert np.all(np.abs(a - b) <= relative * np.maximum(scale, 1.0)), np.max(np.abs(a - b) / np.maximum(scale, 1.0))


def whole_jacobian(evaluator: TypeEvaluator, at: Point, cj: float, n: int) -> Array:
    """d(rows, flows)/d(y, w) + cj d(rows, flows)/dy' by CasADi, of the equations as they were written."""
    e = evaluator
    values = ca.SX(ca.vertcat(*[r.expression for r in e.unit.rows], *[f.expression for f in e.unit.flows]))
    assert values.numel() == n
    slope = ca.horzcat(ca.jacobian(values, e.y) + cj * ca.jacobian(values, e.yp), ca.jacobian(values, e.w))
    function = ca.Function("slope", [e.y, e.yp, e.w, e.u, e.d, e.p], [ca.densify(slope)])
    return np.asarray(function(at.y, at.yp[: e.yp.numel()], at.w, at.u, at.d, at.p)).reshape(n, at.y.size + at.w.size)


def numeric_parameters(component: Component, path: str = "") -> Iterator[tuple[str, Parameter, float]]:
    """Path, declaration and value of every parameter of a component and its parts that is not structural."""
    for name, declared in component.declared(Parameter).items():
        if not declared.structural:
            yield path + name, declared, float(component.value(name))
    for name in component.declared(Part):
        yield from numeric_parameters(component.part(name), f"{path}{name}.")


def extremes(declared: Parameter, value: float) -> list[float]:
    """The ends of the declared range, the smallest double above an open one, and a thousand times more and less."""
    size = value or 1.0
    found = {1e3 * size, -1e3 * size, 1e-3 * size, -1e-3 * size, 0.0}
    found |= {end for end in (declared.min, declared.max) if end is not None}
    if declared.above is not None:
        found |= {declared.above, math.nextafter(declared.above, math.inf), declared.above + 1e-12 * abs(size)}
    return sorted(found)


def test_every_registered_component_has_a_system() -> None:
    assert sorted(SYSTEMS) == NAMES


@pytest.mark.parametrize("name", [*EVERY, *sorted(VARIANTS)])
def test_declares_units_and_sentences(name: str) -> None:
    for component in tree(example(name)):
        kind = type(component)
        assert kind.__doc__, f"{kind.__name__} has no docstring"
        assert kind.__module__.startswith("gustform.")
        for label, declared in kind.declarations().items():
            where = f"{kind.__name__}.{label}"
            assert declared.description, f"{where} has no sentence"
            assert not declared.description.endswith("."), f"{where}: a declaration's sentence has no full stop"
            if isinstance(declared, Declaration):
                dimension_of(declared.unit)
            if isinstance(declared, Variable):
                assert component.number(declared.nominal) > 0.0, f"{where}: nominal must be positive"
                start = component.start_value(declared)
                assert declared.min is None or start >= declared.min, f"{where} starts below its minimum"
                assert declared.max is None or start <= declared.max, f"{where} starts above its maximum"
            if isinstance(declared, Parameter) and isinstance(declared.default, int | float):
                declared.check(declared.default, where)


@pytest.mark.parametrize("name", NAMES)
def test_docstring_names_equations_and_source(name: str) -> None:
    kind = component_types()[name]
    text = inspect.getdoc(kind) or ""
    if name not in ("Bus", "StiffFrame"):
        assert "Source" in text, f"{name}: where do the equations come from?"
    assert re.search(r"\bpu\b|SI units|[Bb]ase", text), f"{name}: in which units or bases?"
    assert re.search(r"^ {4}\S", text, re.MULTILINE), f"{name}: no equation or sketch in the docstring"


@pytest.mark.parametrize("name", [*EVERY, *sorted(VARIANTS)])
def test_units_of_every_equation_match(name: str) -> None:
    check_units(elaborate(example(name)))


@pytest.mark.parametrize("name", [*EVERY, *sorted(VARIANTS)])
def test_is_balanced(name: str) -> None:
    unit, _ = flat(name)
    assert len(unit.rows) == len(unit.unknowns)
    assert len(unit.initial) == len(unit.free_parameters)


@pytest.mark.parametrize("name", BUILT)
def test_leaves_only_states(name: str) -> None:
    unit, _ = flat(name)
    # explicit algebraics and small linear blocks are all solved: nothing is left to iterate on
    iterated = [u.path for u in unit.unknowns if u.der is None]
    assert len(iterated) == ALONE.get(name, 0), iterated
    assert len(unit.initial) == len(unit.free_parameters)


@pytest.mark.parametrize(("name", "states"), [("PmsgTurbine", 12), ("SynchronousGenerator", 10)])
def test_number_of_unknowns_of_the_large_units(name: str, states: int) -> None:
    assert len(flat(name)[0].unknowns) == states


@pytest.mark.parametrize("name", BUILT)
def test_generated_c_compiles_without_a_warning(name: str, root: Path, tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None, "the tests need a C compiler"
    _, kernel = flat(name)
    source = tmp_path / "kernel.c"
    source.write_text(kernel.text, encoding="utf-8")
    run = subprocess.run(
        [compiler, *FLAGS, "-O1", f"-I{root / 'runtime' / 'include'}", "-c", str(source), "-o", "/dev/null"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("name", BUILT)
def test_kernel_equals_casadi_and_its_jacobian_finite_differences(name: str, cache: KernelCache) -> None:
    unit, kernel = flat(name)
    compiled = CompiledKernel(cache.get(kernel.text, unit.name))
    splines = [t.spline() for t in points(unit, 1)[0].tables]
    evaluator = TypeEvaluator(unit, np.arange(len(splines), dtype=np.int32)[None, :], splines)
    n = len(unit.unknowns) + len(unit.flows)
    cj = 3.0
    # near the start, and far from it: behind limits, below the voltage at which a load becomes an impedance
    for far, at in [*((False, at) for at in points(unit)), *((True, at) for at in points(unit, 3, spread=0.4))]:
        y, yp, w, u, d, p = (v[:, None] for v in (at.y, at.yp, at.w, at.u, at.d, at.p))
        rows = compiled.residual(at)
        expected = evaluator.residual(y, yp, w, u, d, p)[:n, 0]
        # far from the start large terms cancel: the round-off is theirs
        terms = np.abs(compiled.jacobian(at, 0.0)) @ np.abs(np.concatenate([at.y, at.w])) if far else np.zeros(n)
        close(rows + terms, expected + terms, 1e-12)
        if not unit.calls:
            e = evaluator
            arguments = [e.y, e.yp, e.w, e.u, e.d, e.p]
            outputs = ca.Function("outputs", arguments, [ca.vertcat(*[r.expression for r in unit.recorded])])
            values = outputs(at.y, at.yp[: e.yp.numel()], at.w, at.u, at.d, at.p)
            close(compiled.outputs(at), np.asarray(values).reshape(-1), 1e-12)
        jacobian = compiled.jacobian(at, cj)
        reference = np.zeros_like(jacobian)
        reference[kernel.jacobian_row, kernel.jacobian_column] = evaluator.kernel_jacobian(y, yp, w, u, d, p, cj)[:, 0]
        close(jacobian, reference, 1e-12)
        if not unit.calls:
            close(jacobian, whole_jacobian(evaluator, at, cj, n), 1e-12)
        for k in range(at.y.size + at.w.size):
            own = k < at.y.size
            value = at.y[k] if own else at.w[k - at.y.size]
            h = 1e-6 * max(abs(value), 1.0)

            def moved(sign: float, k: int = k, own: bool = own, at: Point = at, h: float = h) -> Point:
                y, yp, w = at.y.copy(), at.yp.copy(), at.w.copy()
                if own:
                    y[k] += sign * h
                    yp[k] += sign * cj * h
                else:
                    w[k - y.size] += sign * h
                return Point(y, yp, w, at.u, at.d, at.p, at.tables)

            up, down = moved(1.0), moved(-1.0)
            if np.any(np.sign(compiled.roots(up)) != np.sign(compiled.roots(down))):
                continue  # a bend lies between: there is no derivative to compare with
            difference = (compiled.residual(up) - compiled.residual(down)) / (2.0 * h)
            # second-order differences: h^2 of truncation, and the round-off of the residual over h
            noise = 1e-15 * np.max(np.abs(rows), initial=1.0) / h
            assert np.all(
                np.abs(difference - jacobian[:, k]) <= 1e-6 * np.max(np.abs(jacobian[:, k]), initial=1.0) + noise
            )


@pytest.mark.parametrize("name", NAMES)
def test_holds_its_equilibrium(name: str, cache: KernelCache) -> None:
    built = build(SYSTEMS[name](), cache)
    start = steady_state(built.linked)
    assert start.largest_residual < 1e-8
    table = start.table
    with Simulation(table.to_bytes()) as simulation:
        simulation.set_option("rtol", 1e-8)
        simulation.initialise(0.0)
        simulation.advance(20.0)  # s: longer than the slowest time constants of the controls
        _, y, _ = simulation.state()
    # design tolerance: 1e-6 of nominal
    np.testing.assert_array_less(np.abs(y - table.start) / table.nominal, 1e-6)


@pytest.mark.parametrize("name", BUILT)
def test_extreme_parameters_give_an_error_or_finite_equations(name: str) -> None:
    component = example(name)
    evaluators: dict[int, TypeEvaluator] = {}
    refused = 0
    for path, declared, value in numeric_parameters(component):
        for extreme in extremes(declared, value):
            try:
                changed = component.with_value(path, extreme)
                changed.parameter_values()  # those that are computed from others, too
                unit, _ = unit_type(changed, signals(name))
                at = points(replace(unit, component=changed), 1)[0]
            except GustformError:
                refused += 1
                continue
            splines = [t.spline() for t in at.tables]
            numbers = np.arange(len(splines), dtype=np.int32)[None, :]
            evaluator = evaluators.setdefault(id(unit), TypeEvaluator(unit, numbers, splines))
            arguments = [v[:, None] for v in (at.y, at.yp, at.w, at.u, at.d, at.p)]
            where = f"{name}.{path} = {extreme:g}"
            evaluator.initial_pattern()
            assert np.all(np.isfinite(evaluator.residual(*arguments))), where
            assert np.all(np.isfinite(evaluator.initial_jacobian(*arguments))), f"{where}: Jacobian"
    # a value on an open bound is refused, for one
    assert refused >= sum(declared.above is not None for _, declared, _ in numeric_parameters(component))
