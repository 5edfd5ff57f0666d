"""Printed kernels: they agree with CasADi, compile without a warning, and their text is reproducible and harmless."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gustform.interfaces import DcPort
from gustform.language import Component, Discrete, GustformError, Input, Parameter, Table, Variable, table2
from gustform.language.table import TableData
from gustform_codegen.emit.kernel import Kernel, emit_kernel
from gustform_codegen.emit.straightline import literal
from gustform_codegen.evaluate import TypeEvaluator
from gustform_codegen.flatten import flatten
from gustform_codegen.unit_type import UnitType
from tests.unit.codegen.circuits import (
    Capacitor,
    CurrentSource,
    Follower,
    Ground,
    IdealSource,
    Ladder,
    Load,
    Resistor,
    Storage,
)
from tests.unit.codegen.compiled import ROOT, CompiledKernel, compile_strictly
from tests.unit.codegen.everything import CP, CT, everything

Array = NDArray[np.float64]
RELATIVE = 1e-12  # the project's tolerance for C against CasADi


class Case:
    """`Everything` flattened, printed, compiled, and the same through CasADi's virtual machine."""

    def __init__(self, folder: Path) -> None:
        self.component = everything()
        self.unit: UnitType = flatten(self.component, frozenset({"w"}))
        self.kernel: Kernel = emit_kernel(self.unit)
        numbers = self.component.parameter_values()
        self.p = np.array([numbers[p.path] for p in self.unit.parameters])
        tables = [{"cp": CP, "ct": CT}[t.declaration.name] for t in self.unit.tables]
        self.compiled = CompiledKernel(compile_strictly(self.kernel.text, folder), self.p, tables)
        self.evaluator = TypeEvaluator(
            self.unit, np.arange(len(tables), dtype=np.int32)[None, :], [t.spline() for t in tables]
        )

    def point(self, seed: int) -> list[Array]:
        """y, yp, w, u, d at random. x, y in 0.5 ... 2: inside the domain of every operation."""
        random = np.random.default_rng(seed)
        unit = self.unit
        sizes = (len(unit.unknowns), len(unit.unknowns), len(unit.externals), len(unit.inputs), len(unit.discretes))
        return [random.uniform(0.5, 2.0, n) for n in sizes]

    def reference(self, expressions: list[Any], point: list[Array]) -> Array:
        e = self.evaluator
        columns = [a[:, None] for a in (*point, self.p)]
        function = e._function("f", [ca.vertcat(*expressions)])
        return function([*columns, e._call_values(columns)])[0].ravel()


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return Case(tmp_path_factory.mktemp("everything"))


def close(found: Array, expected: Array, names: list[str]) -> None:
    assert np.all(np.isfinite(expected))
    assert found.shape == expected.shape
    # Relative to the value, or to one where terms of order one cancel.
    off = np.abs(found - expected) > RELATIVE * np.maximum(np.abs(expected), 1.0)
    assert not np.any(off), [(names[k], found[k], expected[k]) for k in np.flatnonzero(off)]


@pytest.mark.parametrize("seed", range(5))
def test_residual_and_flows(case: Case, seed: int) -> None:
    point = case.point(seed)
    names = [r.text for r in case.unit.rows] + [f.path for f in case.unit.flows]
    expected = case.evaluator.residual(*[a[:, None] for a in (*point, case.p)])[:, 0]
    close(case.compiled.residual(*point), expected, names)


@pytest.mark.parametrize(("seed", "cj"), [(0, 0.0), (1, 1.0), (2, 1e4), (3, 1e-3)])
def test_jacobian(case: Case, seed: int, cj: float) -> None:
    point = case.point(seed)
    assert case.compiled.pattern == (case.kernel.jacobian_row, case.kernel.jacobian_column)
    found = case.compiled.jacobian(*point, cj=cj)
    y, yp, w, u, d, p = (a[:, None] for a in (*point, case.p))
    expected = case.evaluator.kernel_jacobian(y, yp, w, u, d, p, cj)[:, 0]
    names = [f"{r}, {c}" for r, c in zip(*case.compiled.pattern, strict=True)]
    close(found / max(1.0, cj), expected / max(1.0, cj), names)


def test_jacobian_against_differences_of_the_compiled_residual(case: Case) -> None:
    """Independent of CasADi's derivatives, tables within tables included: central differences with h = 1e-6 are good
    to 1e-9 or so; bends are 1e-3 away at this point or more."""
    y, yp, w, u, d = case.point(7)
    n, m = y.size, w.size
    cj, h = 3.0, 1e-6
    size = n + len(case.unit.flows)
    dense, differences = np.zeros((size, n + m)), np.zeros((size, n + m))
    for r, c, value in zip(*case.compiled.pattern, case.compiled.jacobian(y, yp, w, u, d, cj=cj), strict=True):
        dense[r, c] = value
    for k in range(n + m):
        step = np.zeros(n + m)
        step[k] = h
        # Moving y and y' together along (1, cj) gives dF/dy + cj dF/dy'.
        above, below = (
            case.compiled.residual(y + s * step[:n], yp + s * cj * step[:n], w + s * step[n:], u, d) for s in (1, -1)
        )
        differences[:, k] = (above - below) / (2 * h)
    np.testing.assert_allclose(dense, differences, rtol=1e-6, atol=1e-6)


def test_has_derivative_marks_what_depends_on_cj(case: Case) -> None:
    point = case.point(11)
    change = case.compiled.jacobian(*point, cj=2.0) - case.compiled.jacobian(*point, cj=1.0)
    assert ((change != 0) == np.array(case.kernel.jacobian_has_derivative)).all()


def test_outputs_and_roots(case: Case) -> None:
    for seed in range(3):
        point = case.point(seed)
        recorded, roots = case.unit.recorded, case.unit.roots
        assert {r.path for r in recorded} >= {"shown", "pin.i", "u", "d", "d2"}
        expected = case.reference([r.expression for r in recorded], point)
        close(case.compiled.outputs(*point), expected, [r.path for r in recorded])
        expected = case.reference([r.expression for r in roots], point)
        close(case.compiled.roots(*point), expected, [r.text for r in roots])


def test_when_clauses_write_what_they_set_and_nothing_else(case: Case) -> None:
    for seed in range(3):
        point = case.point(seed)
        for number, clause in enumerate(case.unit.whens):
            y, d = case.compiled.when(number, *point)
            expected = case.reference([v for _, v in [*clause.assign, *clause.reinit]], point)
            found = [d[k] for k, _ in clause.assign] + [y[k] for k, _ in clause.reinit]
            close(np.array(found), expected, [clause.text] * len(found))
            assert np.isnan(np.delete(d, [k for k, _ in clause.assign])).all()
            assert np.isnan(np.delete(y, [k for k, _ in clause.reinit])).all()
    y, d = case.compiled.when(99, *case.point(0))  # a clause that is not there
    assert np.isnan(y).all()
    assert np.isnan(d).all()


def test_limiters_on_either_side(case: Case) -> None:
    """At points well outside every limiter and the tables' grids the two still agree."""
    for scale in (0.01, 50.0):
        y, yp, w, u, d = case.point(4)
        paths = [x.path for x in case.unit.unknowns]
        rows = [k for k, r in enumerate(case.unit.rows) if re.search(r"s_(min|max|abs|limit|dead|table)", paths[k])]
        y[paths.index("x")] *= scale
        expected = case.evaluator.residual(*[a[:, None] for a in (y, yp, w, u, d, case.p)])[:, 0]
        found = case.compiled.residual(y, yp, w, u, d)
        close(found[rows], expected[rows], [paths[k] for k in rows])


# ---- tables ----


class TableOnly(Component):
    x = Variable("1", "x")
    y = Variable("1", "y")
    T = Parameter("s", "time", default=1.0)
    cp = Table("1", "1", "1", "table")
    seen = Variable("1", "value")

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), 0)
        self.eq(self.T * self.der(self.y), 0)
        self.eq(self.seen, table2(self.cp, self.x, self.y))


@pytest.mark.parametrize("data", [CP, CT])
def test_table_in_c_equals_python(data: TableData, tmp_path: Path) -> None:
    component = TableOnly(cp=data)
    unit = flatten(component)
    compiled = CompiledKernel(compile_strictly(emit_kernel(unit).text, tmp_path), [1.0], [data])
    random = np.random.default_rng(5)
    x = np.concatenate([random.uniform(-3, 6, 200), data.x, [-1e300, 1e300, data.x[0], data.x[-1]]])
    y = np.concatenate([random.uniform(-3, 6, 200), random.choice(data.y, data.x.size), [1e300, -1e300, 0.0, 0.0]])
    expected, _, _ = data.evaluate(x, y)
    found = [compiled.outputs(np.array([a, b]), np.zeros(2), *[np.zeros(0)] * 3)[0] for a, b in zip(x, y, strict=True)]
    # The same sums in another order: 16 products of numbers up to the largest coefficient.
    scale = np.max(np.abs(data.spline()["coefficient"]))
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14 * scale)


# ---- warnings, corners of the C text ----


class Nothing(Component):
    """No equation, no variable, nothing."""


class Constants(Component):
    x = Variable("1", "a constant")

    def equations(self) -> None:
        self.eq(self.x, 2)


class OnlyEvents(Component):
    u = Input("1", "input")
    T = Parameter("s", "period", default=1.0)
    d = Discrete("1", "kept")

    def equations(self) -> None:
        self.when(self.u > 1, {self.d: 1})
        self.sample(self.T, {self.d: self.u})


class Constrains(Component):
    a = DcPort("a")
    b = DcPort("b")

    def equations(self) -> None:
        self.connect(self.a, self.b)


class UnusedTable(Component):
    """A table whose value nobody needs, and one of which only the slope is needed."""

    cp = Table("1", "1", "1", "table")
    x = Variable("1", "x")
    seen = Variable("1", "value")
    T = Parameter("s", "time", default=1.0)

    def equations(self) -> None:
        self.eq(self.T * self.der(self.x), table2(self.cp, self.x, 0.5) - 1)
        self.eq(self.seen, table2(self.cp, self.x, self.x))


@pytest.mark.parametrize(
    "kind",
    [Nothing, Constants, OnlyEvents, Constrains, UnusedTable, Resistor, Capacitor, CurrentSource, Ground, IdealSource,
     Load, Storage, Follower, Ladder],
)  # fmt: skip
def test_every_shape_of_type_compiles_without_a_warning(kind: type[Component], tmp_path: Path) -> None:
    unit = flatten(kind())
    text = emit_kernel(unit).text
    compile_strictly(text, tmp_path, "-O0")
    wired = frozenset(s.path for s in unit.inputs)
    if wired:
        compile_strictly(emit_kernel(flatten(kind(), wired)).text, tmp_path, "-O0")


def test_stricter_warnings_still(tmp_path: Path) -> None:
    source = tmp_path / "kernel.c"
    source.write_text(emit_kernel(flatten(everything())).text)
    flags = "-std=c11 -pedantic-errors -Wall -Wextra -Wdouble-promotion -Wundef -Wcast-qual -Wpointer-arith"
    flags += " -Wwrite-strings -Wmissing-prototypes -Wfloat-conversion -Werror -fsyntax-only"
    run = subprocess.run(
        ["gcc", *flags.split(), f"-I{ROOT / 'runtime' / 'include'}", str(source)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr


@example(-0.0)
@example(5e-324)
@example(-1.7976931348623157e308)
@given(st.floats(allow_nan=False))
def test_literals_read_back_to_the_same_bits(value: float) -> None:
    text = literal(value)
    assert re.fullmatch(r"\(?-?(\d+\.\d+(e[+-]?\d+)?|\d+e[+-]?\d+|INFINITY)\)?", text)
    if "INF" not in text:
        assert float(text.strip("()")) == value
        assert np.signbit(float(text.strip("()"))) == np.signbit(value)
    assert (text[0] == "(") == (value < 0 or str(value) == "-0.0")  # "a - -1.0" and "a--1.0" stay apart


def test_a_function_without_a_c_form_is_refused() -> None:
    class Strange(Component):
        x = Variable("1", "x")
        u = Input("1", "u")

        def equations(self) -> None:
            self.eq(self.x, ca.erfinv(self.u))

    with pytest.raises(GustformError, match="GF4004"):
        emit_kernel(flatten(Strange()))


# ---- the text ----

PRINT = """
import hashlib
import sys
from pathlib import Path
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from tests.unit.codegen.compiled import INCLUDE
from tests.unit.codegen.test_link import network
from tests.unit.codegen.circuits import Follower, Ladder, Storage
from tests.unit.codegen.everything import everything
from gustform_codegen.emit.kernel import emit_kernel
from gustform_codegen.flatten import flatten
parts = [emit_kernel(flatten(everything(), frozenset({"w"}), frozenset({"shown"}))).text]
parts += [emit_kernel(flatten(c)).text for c in (Storage(), Ladder())]
parts += [emit_kernel(flatten(Follower(), frozenset({"u"}))).text]
linked = build(network(2), KernelCache(INCLUDE, Path(sys.argv[1]))).linked
table = linked.table.with_channels(linked.select(["*"])[0])
parts.append(hashlib.sha256(table.to_bytes()).hexdigest())
sys.stdout.write("".join(parts))
"""


def test_text_and_table_are_the_same_in_every_process(cache_folder: Path) -> None:
    texts = []
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)}
        run = subprocess.run(
            [sys.executable, "-c", PRINT, str(cache_folder)],
            capture_output=True,
            text=True,
            check=True,
            cwd=ROOT,
            env=environment,
        )
        texts.append(run.stdout)
    assert len(texts[0]) > 10000
    assert texts[0] == texts[1]


def test_the_text_holds_no_place_no_date_and_no_value_of_a_parameter() -> None:
    class Told(Component):
        """R = 12.345 is a value; 0.625 is part of the equation."""

        R = Parameter("ohm", "resistance", default=12.345)
        pin = DcPort("terminal")

        def equations(self) -> None:
            self.eq(self.pin.i * self.R, 0.625 * self.pin.v)

    text = emit_kernel(flatten(Told())).text
    assert text == emit_kernel(flatten(Told(R=99.75))).text
    assert "0.625" in text
    assert "12.345" not in text
    assert str(ROOT) not in text
    assert Path(__file__).name not in text
    assert not re.search(r"\b20\d\d\b|__DATE__|__TIME__|__FILE__", text)
    assert text.isascii()


def test_odd_names_never_reach_the_compiler(tmp_path: Path) -> None:
    nasty = 'X"; } int main(void) { return system("id"); /* */ \\ é'
    attribute = 'i"*/;#include</etc/passwd>'
    kind = type(
        nasty,
        (Component,),
        {
            attribute: Variable("1", "a name that Python allows through setattr"),
            "T": Parameter("s", "*/ #error description", default=1.0),
            "equations": lambda self: self.eq(self.T * self.der(getattr(self, attribute)), 1),
        },
    )
    unit = flatten(kind())
    assert unit.unknowns[0].path == attribute
    text = emit_kernel(unit).text
    for word in ("system(", "passwd", "#error", "include</", "é", "\\"):
        assert word not in text
    compiled = CompiledKernel(compile_strictly(text, tmp_path), [1.0])
    assert re.fullmatch(rb"X[A-Za-z0-9_]+", compiled.kernel.type_name)


def test_what_depends_on_parameters_alone_is_computed_once() -> None:
    class Heavy(Component):
        p = Parameter("1", "a parameter", default=1.0)
        T = Parameter("s", "time", default=1.0)
        x = Variable("1", "state")

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), ca.exp(self.p) * self.x + ca.sin(ca.sqrt(self.p)))

    text = emit_kernel(flatten(Heavy())).text
    prepare, _, rest = text.partition("static void kernel_residual")
    for function in ("exp(", "sin(", "sqrt("):
        assert prepare.count(function) == 1
        assert function not in rest
    assert "/" not in re.sub(r"/\*.*?\*/", "", rest.partition("static const")[0])  # reciprocals are prepared


def test_equal_subexpressions_are_computed_once(case: Case) -> None:
    residual = case.kernel.text.partition("static void kernel_residual")[2].partition("static void")[0]
    x = f"y[{[u.path for u in case.unit.unknowns].index('x')}]"
    assert residual.count(f"sin({x})") == 1  # it occurs in three of the equations
