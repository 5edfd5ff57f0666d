"""The step as a program: what depends on parameters alone is computed once per calibration.

    c = prepare(p)                       at startup and recalibration
    (memory+, y) = step(memory, u, c)    in each sample

Where tables are looked up, in each sample the arguments of one look-up after the other are computed before the step,
and what was looked up, t, is an argument as well. All are CasADi functions, made from the instruction list of the whole
step. A division by something constant becomes a multiplication by its reciprocal, which is one of c. The C is printed
from these very functions, in their order, so that C in double and CasADi give the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform_codegen.emit.controller.discretise import Step
from gustform_codegen.emit.controller.look_up import spline_at
from gustform_codegen.symbolic import key_of, keys_in

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Wanted:
    """One number of a look-up: its value, or its slope along x or y."""

    x_slope: bool
    y_slope: bool


@dataclass(frozen=True, eq=False)
class LookUp:
    """arguments: (memory, u, c, t) -> x and y; t holds what `wanted` says from `first` on."""

    table: int
    arguments: Any
    wanted: tuple[Wanted, ...]
    first: int


@dataclass(frozen=True, eq=False)
class Program:
    """prepare: (p) -> c; advance: (memory, u, c, t) -> memory+, y and monitors in one vector; no t without look-ups."""

    step: Step
    prepare: Any
    advance: Any
    n_constants: int
    look_ups: tuple[LookUp, ...] = ()


def program(step: Step) -> Program:
    """Split a step into what parameters alone decide and the rest."""
    memory = ca.vertcat(*step.memory) if step.memory else ca.SX.sym("memory", 0)
    inputs = ca.vertcat(*[s.symbol for s in step.block.inputs])
    parameters = ca.vertcat(*[s.symbol for s in step.parameters])
    looked_up, look_ups = _wanted(step)
    t = [ca.vertcat(*looked_up)] if looked_up else []
    outputs = [*step.memory_next, *step.results, *(a for call in step.calls for a in (call.x, call.y))]
    arguments = [memory, inputs, parameters, *t]
    whole = ca.Function("whole", arguments, [ca.densify(ca.vertcat(*outputs))], {"cse": True})
    splitter = _Splitter()
    work: dict[int, _Node] = {}
    results: list[Any] = [None] * len(outputs)
    for k in range(whole.n_instructions()):
        op, a, out = whole.instruction_id(k), whole.instruction_input(k), whole.instruction_output(k)
        if op == ca.OP_INPUT:
            work[out[0]] = _Node(arguments[a[0]][a[1]], a[0] == 2, a[0] == 2)
        elif op == ca.OP_CONST:
            work[out[0]] = _Node(ca.SX(whole.instruction_constant(k)), True, False)
        elif op == ca.OP_OUTPUT:
            results[out[1]] = splitter.read(work[a[0]])
        else:
            work[out[0]] = splitter.operation(op, [work[i] for i in a])
    constants = ca.vertcat(*splitter.symbols) if splitter.symbols else ca.SX.sym("c", 0)
    values = ca.densify(ca.vertcat(*splitter.values)) if splitter.values else ca.SX(0, 1)
    prepare = ca.Function("prepare", [parameters], [values], {"cse": True})
    of_step = [memory, inputs, constants, *t]
    n = len(outputs) - 2 * len(step.calls)
    advance = ca.Function("advance", of_step, [ca.densify(ca.vertcat(*results[:n]))], {"cse": True})
    made = []
    for k, (call, (first, wanted)) in enumerate(zip(step.calls, look_ups, strict=True)):
        place = ca.densify(ca.vertcat(*results[n + 2 * k : n + 2 * k + 2]))
        made.append(LookUp(call.table, ca.Function(f"place_{k}", of_step, [place], {"cse": True}), wanted, first))
    return Program(step, prepare, advance, len(splitter.symbols), tuple(made))


def _wanted(step: Step) -> tuple[list[Any], list[tuple[int, tuple[Wanted, ...]]]]:
    """The symbols of t, and for each look-up its first place there and what is wanted of it."""
    expressions = [*step.memory_next, *step.results, *(a for call in step.calls for a in (call.x, call.y))]
    used = {key for e in expressions for key in keys_in(e)}
    symbols: list[Any] = []
    result = []
    for call in step.calls:
        kinds = (
            (call.value, Wanted(False, False)),
            (call.x_slope, Wanted(True, False)),
            (call.y_slope, Wanted(False, True)),
        )
        some = [(symbol, wanted) for symbol, wanted in kinds if key_of(symbol) in used]
        result.append((len(symbols), tuple(wanted for _, wanted in some)))
        symbols += [symbol for symbol, _ in some]
    return symbols, result


@dataclass(frozen=True, eq=False)
class _Node:
    """A value; `constant`: of parameters and numbers alone; `calibrated`: a parameter is among them."""

    expression: Any
    constant: bool
    calibrated: bool


class _Splitter:
    def __init__(self) -> None:
        self.symbols: list[Any] = []
        self.values: list[Any] = []
        self._known: dict[int, Any] = {}
        self._operations: dict[tuple[object, ...], _Node] = {}

    def read(self, node: _Node) -> Any:
        """A node as the step reads it: what is calibrated through a constant."""
        if not node.calibrated or not node.constant:
            return node.expression
        key = int(node.expression.element_hash())
        if key not in self._known:
            symbol = ca.SX.sym(f"c{len(self.symbols)}")
            self._known[key] = symbol
            self.symbols.append(symbol)
            self.values.append(node.expression)
        return self._known[key]

    def operation(self, op: int, arguments: list[_Node]) -> _Node:
        if op == ca.OP_ASSIGN:
            return arguments[0]
        constant = all(a.constant for a in arguments)
        if op == ca.OP_DIV and not constant and arguments[1].constant:
            arguments = [arguments[0], self.operation(ca.OP_INV, arguments[1:])]
            op = ca.OP_MUL
        values = [a.expression if constant else self.read(a) for a in arguments]
        key: tuple[object, ...] = (op, *(_identity(v) for v in values))
        if key not in self._operations:
            expression = ca.SX.unary(op, *values) if len(values) == 1 else ca.SX.binary(op, *values)
            calibrated = constant and any(a.calibrated for a in arguments)
            self._operations[key] = _Node(expression, constant, calibrated)
        return self._operations[key]


def _identity(value: Any) -> object:
    return float(value) if value.is_constant() else int(value.element_hash())


class Evaluator:
    """The controller by CasADi in double, with the checks of the C: the oracle for it, and the source of its vectors.

    `step` returns the outputs and whether the sample was accepted; `monitors` are those of the last accepted one.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        block = program.step.block
        self.low = np.array([s.low for s in block.inputs])
        self.high = np.array([s.high for s in block.inputs])
        self.out_low = np.array([s.low for s in block.outputs])
        self.out_high = np.array([s.high for s in block.outputs])
        self.calibrate(np.array([s.value for s in program.step.parameters]))
        self.memory = np.array([s.value for s in block.states])
        self.outputs = np.clip(np.array([s.value for s in block.outputs]), self.out_low, self.out_high)
        self.monitors = np.array([s.value for s in block.monitors])

    def calibrate(self, parameters: Array) -> None:
        """Constants from parameters, in the order of `program.step.parameters`."""
        self.constants = np.asarray(self.program.prepare(parameters)).ravel()

    def step(self, inputs: Array) -> tuple[Array, bool]:
        """One sample. One that is not finite or out of range changes nothing."""
        good = bool(np.all((inputs >= self.low) & (inputs <= self.high)))
        if good:
            known = [self.memory, inputs, self.constants, *self._look_up(inputs)]
            found = np.asarray(self.program.advance(*known)).ravel()
            n = self.memory.size
            self.memory, found = found[:n], found[n:]
            n = self.outputs.size
            self.outputs = np.minimum(np.maximum(found[:n], self.out_low), self.out_high)
            self.monitors = found[n:]
        return self.outputs.copy(), good

    def _look_up(self, inputs: Array) -> list[Array]:
        """t, or nothing without look-ups."""
        t = np.zeros(sum(len(one.wanted) for one in self.program.look_ups))
        for one in self.program.look_ups:
            x, y = np.asarray(one.arguments(self.memory, inputs, self.constants, t)).ravel()
            grid = self.program.step.block.tables[one.table]
            for k, wanted in enumerate(one.wanted):
                t[one.first + k] = spline_at(grid, float(x), float(y), wanted.x_slope, wanted.y_slope)
        return [t] if t.size else []
