"""Linearisation of a linked system in a steady state: dx/dt = A x + B u, y = C x + D u in deviations from it.

The system is 0 = F(y, y', u, p). Its derivatives come from the unit types, for all instances at once, and are gathered
like those of the steady-state start. With the states x and the algebraic unknowns z, both of them unknowns y,

    0 = F_x' dx' + F_x dx + F_z dz + F_u du,        [dx'; dz] = -[F_x' F_z]^-1 (F_x dx + F_u du)

which needs index one: the matrix in brackets is regular. A parameter may be an input; what is computed from it moves
with it. Where a limiter stands exactly at its bend the derivative is the mean of those on both sides; such equations
are named, as are those in which a limiter stands on a flat part and hides an unknown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.language.component import suggest
from gustform.language.errors import GustformError
from gustform_codegen.evaluate import Array, TypeEvaluator
from gustform_codegen.events import bend_roots
from gustform_codegen.link import Linked, LinkedType
from gustform_codegen.table import Channel, SystemTable

MOST_UNKNOWNS = 5000  # the matrices are dense: 200 MB each here
_STEADY = 1e-6  # largest scaled residual, and share of nominal a second, that still count as steady
_SINGULAR = 1e-14  # reciprocal condition of the equilibrated matrix below which index one is refused
_AT_BEND = 1e-7  # distance from a bend, as a share of nominal, that counts as standing on it
_ASIDE = 1e-6  # step to either side of a bend, as a share of nominal
_REACHES = (0.01, 0.03, 0.1, 0.3, 1.0, 10.0) * 3  # how far to look for the other parts of a limiter, of nominal
_JUMP = 1e-4  # change between both sides, as a share of the largest term of the equation, that is no curvature

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Quantity:
    """A state, an input or an output."""

    name: str
    unit: str
    description: str


@dataclass(frozen=True)
class Limiter:
    """An equation of some instances with a limiter at the operating point, and the unknowns that are concerned."""

    instances: list[str]
    text: str
    unknowns: list[str]

    def __str__(self) -> str:
        who = self.instances[0] + (f" and {len(self.instances) - 1} more" if len(self.instances) > 1 else "")
        return f"{who}: {self.text} [{', '.join(self.unknowns)}]"


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """The linear system with its operating point. Values are in the units of the quantities."""

    A: Array
    B: Array
    C: Array
    D: Array
    states: list[Quantity]
    inputs: list[Quantity]
    outputs: list[Quantity]
    x0: Array
    u0: Array
    y0: Array
    nominal: Array  # of the states
    bends: list[Limiter]  # exactly at a bend: the derivative to these unknowns is the mean of both sides
    flats: list[Limiter]  # on a flat part: no influence of these unknowns
    held: list[str]  # values that events or samples set; they stay as they are


class _Derivatives(TypeEvaluator):
    """Rows, flows, recorded variables and limiters of one type, with their derivatives to everything."""

    def __init__(self, t: LinkedType, splines: Sequence[dict[str, Any]], recorded: list[int], parameters: list[int]):
        unit = t.unit
        super().__init__(unit, t.table.table, splines)
        self.recorded, self.parameters = recorded, parameters
        self.bends = [r for r in unit.roots if r.kind == 0]
        equations = [r.expression for r in unit.rows] + [f.expression for f in unit.flows]
        self.texts = [r.text for r in unit.rows] + [f"flow {f.path}" for f in unit.flows]
        values = ca.vertcat(
            *equations,
            *[unit.recorded[k].expression for k in recorded],
            *[r.expression for r in self.bends],
        )
        self.n_equations = len(equations)
        self.limited = {
            k for k, e in enumerate(equations) if bend_roots([(ca.SX(e), self.texts[k])])
        }  # fmt: skip
        columns = ca.vertcat(self.y, self.w, self.yp, self.u, *[unit.parameters[k].symbol for k in parameters])
        self.row, self.column = np.zeros(0, int), np.zeros(0, int)
        entries: list[Any] = []
        if values.numel() and columns.numel():
            total = ca.sparsify(self.total_jacobian(values, columns))
            rows, cols = total.sparsity().get_triplet()
            self.row, self.column = np.array(rows, int), np.array(cols, int)
            entries = [total.nz[k] for k in range(total.nnz())]
        self.size = values.numel()
        self._all = self._function("derivatives", [ca.vertcat(values, *entries)])

    def values(self, arguments: list[Array]) -> tuple[Array, Array]:
        """Values (rows, flows, recorded, limiters) and entries of their derivatives, per instance (columns)."""
        if self.size == 0:
            return np.zeros((0, arguments[0].shape[1])), np.zeros((0, arguments[0].shape[1]))
        both = self._all([*arguments, self._call_values(arguments)])[0]
        return both[: self.size], both[self.size :]

    def at(self, arguments: list[Array], nominal: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Values, entries, and which entries jump here. CasADi's own derivative of min and max at a tie would not do:
        it is the mean in each of them, and of two, one inside the other, a quarter.

        `nominal`: of the local unknowns and externals, (columns, instances).
        """
        values, entries = self.values(arguments)
        jumps = np.zeros(entries.shape, bool)
        some = np.flatnonzero(self._bent(values, entries, nominal))
        if not some.size:
            return values, entries, jumps
        sides = []
        size = self.y.numel()
        uneven = 1.0 + 0.5 * np.modf(0.618034 * np.arange(nominal.shape[0]))[0][:, None]
        for sign in (1.0, -1.0):
            aside = [a[:, some].copy() for a in arguments]
            shift = sign * _ASIDE * uneven * nominal[:, some]
            aside[0] += shift[:size]
            aside[2] += shift[size:]
            sides.append(self.values(aside)[1])
        one, other = sides
        local = self.column < nominal.shape[0]
        width = np.where(local[:, None], nominal[np.where(local, self.column, 0)][:, some], 0.0)
        largest = np.zeros((self.size, some.size))
        np.maximum.at(largest, self.row, np.maximum(np.abs(one), np.abs(other)) * width)
        jump = np.abs(one - other) * width > _JUMP * largest[self.row]
        mean = 0.5 * (one + other)
        tie = np.abs(mean - entries[:, some]) * width > _JUMP * largest[self.row]
        entries[:, some] = np.where(jump | tie, mean, entries[:, some])
        jumps[:, some] = jump
        return values, entries, jumps

    def flat(self, arguments: list[Array], entries: Array, nominal: Array) -> NDArray[np.bool_]:
        """Which derivatives to unknowns a limiter makes zero here: those in an equation with a limiter that are zero
        and are not so elsewhere. (A factor that is zero, such as a gain, makes them zero everywhere.)"""
        local = self.column < nominal.shape[0]
        zero: NDArray[np.bool_] = (np.isin(self.row, list(self.limited)) & local)[:, None] & (entries == 0.0)
        if not zero.any():
            return zero
        size, alive = self.y.numel(), np.zeros(entries.shape, bool)
        rng = np.random.default_rng(0)
        for reach in _REACHES:
            direction = rng.choice((-1.0, 1.0), nominal.shape) * rng.uniform(0.5, 1.0, nominal.shape)
            for side in (reach, -reach):
                elsewhere = [a.copy() for a in arguments]
                elsewhere[0] += side * (direction * nominal)[:size]
                elsewhere[2] += side * (direction * nominal)[size:]
                there = self.values(elsewhere)[1]
                alive |= np.isfinite(there) & (there != 0.0)
        return np.logical_and(zero, alive)

    def _bent(self, values: Array, entries: Array, nominal: Array) -> NDArray[np.bool_]:
        """The instances of which a limiter stands at a bend."""
        bent = np.zeros(values.shape[1], bool)
        first = self.size - len(self.bends)
        for row in range(first, self.size):
            some = np.flatnonzero((self.row == row) & (self.column < nominal.shape[0]))
            slope = (np.abs(entries[some]) * nominal[self.column[some]]).sum(axis=0)
            bent |= (slope > 0.0) & (np.abs(values[row]) <= _AT_BEND * slope)
        return bent


@dataclass(frozen=True)
class _Input:
    """An input: a slot of the driven inputs, or a parameter with everything that is computed from it."""

    quantity: Quantity
    slot: int  # -1 for a parameter
    type: int = -1
    instance: int = -1
    parameter: int = -1
    direction: tuple[tuple[int, float], ...] = ()  # (parameter, change for a change of 1)


class Lineariser:
    """Linearises one linked system in any of its steady states; for many of them in a row.

    `inputs` are driven inputs and parameters by name ("wt.wind", "load.active"); without them all driven inputs and
    the parameters that events change. `outputs` are channels as `Linked.select` gives them. `find_flats=False` leaves
    `flats` empty: finding them takes most of the time.
    """

    def __init__(
        self,
        linked: Linked,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[Channel] = (),
        *,
        find_flats: bool = True,
    ) -> None:
        self.find_flats = find_flats
        n = linked.table.n_unknowns
        if n > MOST_UNKNOWNS:
            raise GustformError(
                "GF5006",
                f"a linear system of at most {MOST_UNKNOWNS} unknowns can be made; this one has {n}",
                hint="fewer instances with a larger aggregate each",
            )
        self.linked, self.outputs = linked, list(outputs)
        self.state = np.flatnonzero(linked.table.differential)
        self.inputs = _inputs(linked, inputs)
        splines = [lookup.spline for lookup in linked.table.tables]
        self._types: list[_Derivatives] = []
        for number, t in enumerate(linked.types):
            last = t.first_instance + len(t.names)
            recorded = sorted({c.b for c in self.outputs if c.kind == 1 and t.first_instance <= c.a < last})
            moved = sorted({k for i in self.inputs if i.type == number for k, _ in i.direction})
            self._types.append(_Derivatives(t, splines, recorded, moved))
        declared = _declared(linked)
        self.states = [declared[int(k)] for k in self.state]

    def at(self, table: SystemTable) -> LinearSystem:
        """The linear system about the steady state in `table`. GF5004 if it is none, GF5005 if index one fails."""
        linked, n, m = self.linked, table.n_unknowns, len(self.inputs)
        F, F_y, F_yp, F_u = np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, m))
        n_out = len(self.outputs)
        G, G_y, G_yp, G_u = np.zeros(n_out), np.zeros((n_out, n)), np.zeros((n_out, n)), np.zeros((n_out, m))
        bends: list[Limiter] = []
        flats: list[Limiter] = []
        for number, (t, arrays, d) in enumerate(zip(linked.types, table.types, self._types, strict=True)):
            size, externals = len(t.unit.unknowns), len(t.unit.externals)
            own = (arrays.first_unknown[:, None] + np.arange(size)).astype(int)
            slots = (arrays.first_input[:, None] + np.arange(len(t.unit.inputs))).astype(int)
            rows = np.concatenate([own, arrays.flow_row], axis=1).astype(int)
            unknowns = np.concatenate([own, arrays.external], axis=1).astype(int)
            arguments = [
                table.start[own].T,
                table.start_derivative[own].T,
                table.start[arrays.external].T,
                linked.operating_input[slots].T,
                arrays.discrete.T,
                arrays.parameters.T,
            ]
            nominal = table.nominal[unknowns].T
            values, entries, jumps = d.at(arguments, nominal)
            is_y = d.column < size + externals
            is_yp = ~is_y & (d.column < 2 * size + externals)
            is_u = ~is_y & ~is_yp
            is_equation = d.row < d.n_equations
            np.add.at(F, rows.T, values[: d.n_equations])
            for k in range(len(t.names)):
                value, entry = values[:, k], entries[:, k]
                for kind, target in ((is_y, F_y), (is_yp, F_yp)):
                    some = np.flatnonzero(kind & is_equation)
                    column = d.column[some] - (size + externals if kind is is_yp else 0)
                    np.add.at(target, (rows[k, d.row[some]], unknowns[k, column]), entry[some])
                du = self._input_columns(number, k, d, slots[k])
                some = np.flatnonzero(is_u & is_equation)
                np.add.at(F_u, rows[k, d.row[some]], entry[some, None] * du[d.column[some] - 2 * size - externals])
                for position, channel in enumerate(self.outputs):
                    if channel.kind != 1 or channel.a != t.first_instance + k:
                        continue
                    row = d.n_equations + d.recorded.index(channel.b)
                    G[position] = value[row]
                    some = np.flatnonzero(is_y & (d.row == row))
                    np.add.at(G_y[position], unknowns[k, d.column[some]], entry[some])
                    some = np.flatnonzero(is_yp & (d.row == row))
                    np.add.at(G_yp[position], own[k, d.column[some] - size - externals], entry[some])
                    some = np.flatnonzero(is_u & (d.row == row))
                    G_u[position] += entry[some] @ du[d.column[some] - 2 * size - externals]
            bends += _limiters(linked, t, d, jumps, unknowns)
            if self.find_flats:
                flats += _limiters(linked, t, d, d.flat(arguments, entries, nominal), unknowns)
        for position, channel in enumerate(self.outputs):
            if channel.kind == 0:
                G[position], G_y[position, channel.a] = table.start[channel.a], 1.0
        self._refuse_unsteady(table, F, F_y, F_yp)
        solution = self._solve(table, F_y, F_yp, F_u)
        n_x, x = self.state.size, self.state
        # dy = Y dx + U du for all unknowns, dy' likewise for the states
        Y, U = np.zeros((n, n_x)), np.zeros((n, m))
        Y[x, np.arange(n_x)] = 1.0
        z = np.flatnonzero(table.differential == 0)
        Y[z], U[z] = solution[z, :n_x], solution[z, n_x:]
        A, B = solution[x, :n_x], solution[x, n_x:]
        return LinearSystem(
            A=A,
            B=B,
            C=G_y @ Y + G_yp[:, x] @ A,
            D=G_y @ U + G_yp[:, x] @ B + G_u,
            states=self.states,
            inputs=[i.quantity for i in self.inputs],
            outputs=[Quantity(c.name, c.unit, c.description) for c in self.outputs],
            x0=table.start[x].copy(),
            u0=self._input_values(table),
            y0=G,
            nominal=table.nominal[x].copy(),
            bends=bends,
            flats=flats,
            held=[f"{name}.{s.path}" for t in linked.types for name in t.names for s in t.unit.discretes],
        )

    def _input_columns(self, number: int, k: int, d: _Derivatives, slots: Ints) -> Array:
        """How the driven inputs and the moved parameters of one instance change with each input of the system."""
        du = np.zeros((slots.size + len(d.parameters), len(self.inputs)))
        for j, i in enumerate(self.inputs):
            if i.slot >= 0:
                du[np.flatnonzero(slots == i.slot), j] = 1.0
            elif (i.type, i.instance) == (number, k):
                for parameter, change in i.direction:
                    du[slots.size + d.parameters.index(parameter), j] = change
        return du

    def _input_values(self, table: SystemTable) -> Array:
        return np.array(
            [
                self.linked.operating_input[i.slot] if i.slot >= 0
                else table.types[i.type].parameters[i.instance, i.parameter]
                for i in self.inputs
            ],
            dtype=np.float64,
        )  # fmt: skip

    def _refuse_unsteady(self, table: SystemTable, F: Array, F_y: Array, F_yp: Array) -> None:
        """GF5004 unless all equations hold and nothing moves."""
        size = np.maximum(np.abs(F_y * table.nominal).max(axis=1), np.abs(F_yp * table.nominal).max(axis=1))
        off = np.abs(F) / np.where(size > 0.0, size, 1.0)
        rate = np.abs(table.start_derivative) / table.nominal
        if np.all(off <= _STEADY) and np.all(rate <= _STEADY):
            return
        off = np.where(np.isnan(off), np.inf, off)
        worst, fastest = int(np.argmax(off)), int(np.argmax(rate))
        what = (
            f"{self.linked.row_text(worst)} is off by {off[worst]:.3g} (scaled)"
            if off[worst] > _STEADY
            else f"{self.linked.unknown_name(fastest)} moves by {rate[fastest]:.3g} of its nominal value a second"
        )
        raise GustformError(
            "GF5004", f"the system is not in a steady state: {what}", hint="the table of steady_state(linked)"
        )

    def _solve(self, table: SystemTable, F_y: Array, F_yp: Array, F_u: Array) -> Array:
        """-[F_x' F_z]^-1 [F_x F_u], by unknown; GF5005 names the unknowns that nothing determines."""
        differential = table.differential != 0
        M = np.where(differential, F_yp, F_y)
        column = table.nominal
        row = np.abs(M * column).max(axis=1)
        row = np.where(row > 0.0, row, 1.0)
        scaled = M * column / row[:, None]
        right = np.concatenate([F_y[:, differential], F_u], axis=1) / row[:, None]
        try:
            inverse = np.linalg.inv(scaled)
            reciprocal = 1.0 / (np.abs(scaled).sum(axis=0).max() * np.abs(inverse).sum(axis=0).max())
        except np.linalg.LinAlgError:
            reciprocal = 0.0
        if not reciprocal > _SINGULAR:
            _, values, vectors = np.linalg.svd(scaled)
            share = np.abs(vectors[values <= 1e-12 * values[0]]).max(axis=0, initial=0.0)
            if not share.any():
                share = np.abs(vectors[-1])
            algebraic = ~differential & (share > 0.1 * share.max())
            if algebraic.any():  # the derivatives move with them
                share = np.where(algebraic, share, 0.0)
            names = [
                f"der({self.linked.unknown_name(int(k))})" if differential[k] else self.linked.unknown_name(int(k))
                for k in np.argsort(-share)[:6]
                if share[k] > 0.1 * share.max()
            ]
            raise GustformError(
                "GF5005",
                f"the equations do not determine {', '.join(names)} here: the derivative with respect to the algebraic "
                "unknowns is singular",
                hint="an operating point with less load (at the limit of voltage stability it is singular), "
                "or equations of index one",
            )
        return np.asarray(-column[:, None] * np.linalg.solve(scaled, right))


def linearise(
    linked: Linked, table: SystemTable, inputs: Sequence[str] | None = None, outputs: Sequence[Channel] = ()
) -> LinearSystem:
    """The linear system about the steady state in `table`; see Lineariser."""
    return Lineariser(linked, inputs, outputs).at(table)


# ---- names ----


def _declared(linked: Linked) -> dict[int, Quantity]:
    """The states by global index."""
    result = {}
    for t in linked.types:
        for j, u in enumerate(t.unit.unknowns):
            if u.der is not None:
                for name, first in zip(t.names, t.table.first_unknown, strict=True):
                    s = u.declared
                    result[int(first) + j] = Quantity(f"{name}.{u.path}", s.unit, s.description)
    return result


def _inputs(linked: Linked, names: Sequence[str] | None) -> list[_Input]:
    slots = {}
    for t in linked.types:
        for name, first in zip(t.names, t.table.first_input, strict=True):
            for j, s in enumerate(t.unit.inputs):
                quantity = Quantity(f"{name}.{s.path}", s.unit, s.description)
                slots[quantity.name] = _Input(quantity, int(first) + j)
    if names is None:
        names = [*slots, *(change.path for change in linked.system.schedule)]
    return [slots[name] if name in slots else _parameter(linked, name, list(slots)) for name in dict.fromkeys(names)]


def _parameter(linked: Linked, path: str, slots: list[str]) -> _Input:
    """A parameter as an input. GF2007 or GF2008 for a name that is none."""
    name, _, rest = path.partition(".")
    if name not in linked.index_of:
        raise GustformError(
            "GF2007", f"there is no component {name!r} (in {path!r})", hint=suggest(name, list(linked.index_of))
        )
    number, k = linked.index_of[name]
    t = linked.types[number]
    paths = [p.path for p in t.unit.parameters]
    if rest not in paths:
        known = [s for s in slots if s.startswith(f"{name}.")] + [f"{name}.{p}" for p in paths]
        raise GustformError("GF2008", f"{path} is neither an input nor a parameter", hint=suggest(path, known))
    j = paths.index(rest)
    symbol = t.unit.parameters[j]
    quantity = Quantity(path, symbol.unit, symbol.description)
    return _Input(quantity, -1, number, k, j, _direction(t, k, rest, j))


def _direction(t: LinkedType, k: int, rest: str, number: int) -> tuple[tuple[int, float], ...]:
    """What moves with a parameter: itself, and everything computed from it by the slope there."""
    component = t.components[k]
    values = component.parameter_values()
    step = 1e-4 * max(abs(values[rest]), 1e-2)
    sides = []
    for h in (step, -step):
        try:
            sides.append((h, component.with_value(rest, values[rest] + h).parameter_values()))
        except GustformError:  # beyond a bound: one side is left
            continue
    if not sides:
        return ((number, 1.0),)
    if len(sides) == 1:
        sides.append((0.0, values))
    (h1, one), (h2, other) = sides
    result = [(number, 1.0)]
    for j, p in enumerate(t.unit.parameters):
        if j == number or getattr(p.declaration, "free", False):
            continue
        change = (one[p.path] - other[p.path]) / (h1 - h2)
        if change != 0.0 and math.isfinite(change):
            result.append((j, change))
    return tuple(result)


# ---- limiters at the operating point ----


def _limiters(
    linked: Linked, t: LinkedType, d: _Derivatives, chosen: NDArray[np.bool_], unknowns: Ints
) -> list[Limiter]:
    """Equations with a limiter whose derivative to some unknown is chosen; instances with the same ones together."""
    limited = np.isin(d.row, list(d.limited)) & (d.column < unknowns.shape[1])
    found: dict[tuple[int, tuple[int, ...]], list[int]] = {}
    for row in sorted({int(r) for r in d.row[limited]}):
        some = np.flatnonzero(limited & (d.row == row))
        for k in range(unknowns.shape[0]):
            columns = tuple(int(c) for c in d.column[some[chosen[some, k]]])
            if columns:
                found.setdefault((row, columns), []).append(k)
    return [
        Limiter(
            [t.names[k] for k in instances],
            d.texts[row],
            [linked.unknown_name(int(unknowns[instances[0], c])) for c in columns],
        )
        for (row, columns), instances in found.items()
    ]
