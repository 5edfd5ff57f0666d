"""The step as a program: what depends on parameters alone is computed once per calibration.

    c = prepare(p)                       at startup and recalibration
    (memory+, y) = step(memory, u, c)    in each sample

Both are CasADi functions, made from the instruction list of the whole step. A division by something constant becomes a
multiplication by its reciprocal, which is one of c. The C is printed from these very functions, in their order, so
that C in double and CasADi give the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform_codegen.emit.controller.discretise import Step

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Program:
    """prepare: (p) -> c; advance: (memory, u, c) -> memory+ and y in one vector."""

    step: Step
    prepare: Any
    advance: Any
    n_constants: int


def program(step: Step) -> Program:
    """Split a step into what parameters alone decide and the rest."""
    memory = ca.vertcat(*step.memory) if step.memory else ca.SX.sym("memory", 0)
    inputs = ca.vertcat(*[s.symbol for s in step.block.inputs])
    parameters = ca.vertcat(*[s.symbol for s in step.parameters])
    whole = ca.Function(
        "whole", [memory, inputs, parameters], [ca.densify(ca.vertcat(*step.memory_next, *step.results))], {"cse": True}
    )
    arguments = [memory, inputs, parameters]
    splitter = _Splitter()
    work: dict[int, _Node] = {}
    results: list[Any] = [None] * (len(step.memory_next) + len(step.results))
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
    advance = ca.Function("advance", [memory, inputs, constants], [ca.densify(ca.vertcat(*results))], {"cse": True})
    return Program(step, prepare, advance, len(splitter.symbols))


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

    `step` returns the outputs and whether the sample was accepted.
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

    def calibrate(self, parameters: Array) -> None:
        """Constants from parameters, in the order of `program.step.parameters`."""
        self.constants = np.asarray(self.program.prepare(parameters)).ravel()

    def step(self, inputs: Array) -> tuple[Array, bool]:
        """One sample. One that is not finite or out of range changes nothing."""
        good = bool(np.all((inputs >= self.low) & (inputs <= self.high)))
        if good:
            found = np.asarray(self.program.advance(self.memory, inputs, self.constants)).ravel()
            n = self.memory.size
            self.memory = found[:n]
            self.outputs = np.minimum(np.maximum(found[n:], self.out_low), self.out_high)
        return self.outputs.copy(), good
