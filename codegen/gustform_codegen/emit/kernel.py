"""Print the kernel of a unit type: the C file behind `gust_kernel.h`. The text is byte-reproducible."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from gustform_codegen.emit.straightline import Hoister, Printer
from gustform_codegen.unit_type import Call, UnitType


@dataclass(frozen=True)
class Kernel:
    """C text of a unit type with the local Jacobian pattern (rows and columns as in gust_kernel.h)."""

    text: str
    jacobian_row: list[int]
    jacobian_column: list[int]
    jacobian_has_derivative: list[bool]  # whether an entry contains dF/dy'
    n_constants: int


def pattern_and_jacobian(unit: UnitType, cj: Any) -> tuple[list[int], list[int], list[Any]]:
    """Rows, columns and expressions of d(F, f)/d(y, w) + cj d(F, f)/dy', with the chain rule through tables."""
    values = ca.vertcat(*[r.expression for r in unit.rows], *[f.expression for f in unit.flows])
    y = ca.vertcat(*[u.symbol for u in unit.unknowns], *[x.symbol for x in unit.externals])
    if values.numel() == 0 or y.numel() == 0:
        return [], [], []
    total = ca.jacobian(values, y)
    ders = [(k, u.der) for k, u in enumerate(unit.unknowns) if u.der is not None]
    if ders:
        part = ca.jacobian(values, ca.vertcat(*[der for _, der in ders]))
        spread = ca.SX(values.numel(), y.numel())
        for column, (k, _) in enumerate(ders):
            spread[:, k] = part[:, column]
        total = total + cj * spread
    # d(table value)/d(y): each call may depend on earlier ones.
    gradients: list[Any] = []
    for number, call in enumerate(unit.calls):
        gradient = call.x_slope * _total(call.x, y, unit.calls[:number], gradients) + call.y_slope * _total(
            call.y, y, unit.calls[:number], gradients
        )
        gradients.append(gradient)
        total = total + ca.jacobian(values, call.value) @ gradient
    total = ca.sparsify(total)
    rows, columns = total.sparsity().get_triplet()
    return list(rows), list(columns), [total.nz[k] for k in range(total.nnz())]


def _total(expression: Any, y: Any, calls: Sequence[Call], gradients: Sequence[Any]) -> Any:
    result = ca.jacobian(expression, y)
    for call, gradient in zip(calls, gradients, strict=True):
        result = result + ca.jacobian(expression, call.value) @ gradient
    return result


class _KernelPrinter:
    def __init__(self, unit: UnitType) -> None:
        self.unit = unit
        self.hoister = Hoister()
        self.cj = ca.SX.sym("cj")
        self.time = ca.SX.sym("t")
        self.symbols: list[Any] = [self.cj]
        self.texts: list[str] = ["at->cj"]
        self.parameter: list[bool] = [False]

        def declare(symbols: Sequence[Any], array: str, parameter: bool = False) -> None:
            for k, symbol in enumerate(symbols):
                self.symbols.append(symbol)
                self.texts.append(f"{array}[{k}]")
                self.parameter.append(parameter)

        declare([u.symbol for u in unit.unknowns], "y")
        for k, u in enumerate(unit.unknowns):
            if u.der is not None:
                self.symbols.append(u.der)
                self.texts.append(f"yp[{k}]")
                self.parameter.append(False)
        declare([x.symbol for x in unit.externals], "w")
        declare([s.symbol for s in unit.inputs], "u")
        declare([s.symbol for s in unit.discretes], "d")
        declare([s.symbol for s in unit.parameters], "p", parameter=True)
        for k, call in enumerate(unit.calls):
            for symbol, suffix in ((call.value, ""), (call.x_slope, "x"), (call.y_slope, "y")):
                self.symbols.append(symbol)
                self.texts.append(f"table{k}{suffix}")
                self.parameter.append(False)

    def body(self, expressions: Sequence[Any], store: Callable[[int, str], str]) -> list[str]:
        """Statements computing `expressions`; store(i, text) gives the statement that keeps output i."""
        printer = Printer(self.hoister)
        used = self._calls_used(expressions)
        arguments: list[Any] = []
        for k in used:
            arguments += [self.unit.calls[k].x, self.unit.calls[k].y]
        pending: dict[int, str] = {}

        def on_output(index: int, text: str) -> None:
            if index >= len(arguments):
                printer.define(store(index - len(arguments), text))
                return
            pending[index] = text
            if index % 2 == 1:
                k = used[index // 2]
                printer.define(f"double table{k}, table{k}x, table{k}y;")
                printer.define(
                    f"gust_table_evaluate(at->tables[{self.unit.calls[k].table}], {pending[index - 1]}, {text}, "
                    f"&table{k}, &table{k}x, &table{k}y);"
                )

        printer.run(self.symbols, self.texts, self.parameter, [*arguments, *expressions], on_output)
        text = "\n".join(printer.lines)
        for k in used:
            for suffix in ("", "x", "y"):
                if text.count(f"table{k}{suffix}") < 3:
                    printer.define(f"(void)table{k}{suffix};")
        return printer.lines

    def _calls_used(self, expressions: Sequence[Any]) -> list[int]:
        number = {}
        for k, call in enumerate(self.unit.calls):
            for symbol in (call.value, call.x_slope, call.y_slope):
                number[symbol.element_hash()] = k
        needed: set[int] = set()
        stack = list(expressions)
        while stack:
            for symbol in ca.symvar(stack.pop()):
                k = number.get(symbol.element_hash(), -1)
                if k >= 0 and k not in needed:
                    needed.add(k)
                    stack += [self.unit.calls[k].x, self.unit.calls[k].y]
        return sorted(needed)


_ARRAYS = ("y", "yp", "w", "u", "d", "p", "c")
_ARRAY_USE = re.compile(r"(?<![A-Za-z0-9_>])(yp|y|w|u|d|p|c)\[")


def _function(name: str, arguments: str, lines: list[str], unused: str) -> list[str]:
    used = {match for line in lines for match in _ARRAY_USE.findall(line)}
    head = [f"static void {name}({arguments})", "{"]
    head += [f"    const double *restrict {array} = at->{array};" for array in _ARRAYS if array in used]
    if not used and not any("at->" in line for line in lines):
        head.append("    (void)at;")
    if not lines:
        head += [f"    (void){word};" for word in unused.split()]
    return [*head, *[f"    {line}" for line in lines], "}", ""]


def emit_kernel(unit: UnitType) -> Kernel:
    """The C file of a unit type."""
    printer = _KernelPrinter(unit)
    n = len(unit.rows)
    rows, columns, entries = pattern_and_jacobian(unit, printer.cj)
    functions: list[str] = []

    residual = printer.body(
        [r.expression for r in unit.rows] + [f.expression for f in unit.flows],
        lambda k, text: f"residual[{k}] = {text};" if k < n else f"flow[{k - n}] = {text};",
    )
    if not unit.flows:
        residual.append("(void)flow;")
    if n == 0:
        residual.append("(void)residual;")
    functions += _function("kernel_residual", "const gust_point *at, double *residual, double *flow", residual, "")
    jacobian = printer.body(entries, lambda k, text: f"value[{k}] = {text};")
    functions += _function("kernel_jacobian", "const gust_point *at, double *value", jacobian, "value")
    outputs = printer.body([r.expression for r in unit.recorded], lambda k, text: f"value[{k}] = {text};")
    functions += _function("kernel_outputs", "const gust_point *at, double *value", outputs, "value")
    roots = printer.body([r.expression for r in unit.roots], lambda k, text: f"value[{k}] = {text};")
    functions += _function("kernel_roots", "const gust_point *at, double *value", roots, "value")

    cases: list[str] = []
    for number, when in enumerate(unit.whens):
        targets = [f"d_new[{k}]" for k, _ in when.assign] + [f"y_new[{k}]" for k, _ in when.reinit]

        def store(k: int, text: str, targets: list[str] = targets) -> str:
            return f"{targets[k]} = {text};"

        lines = printer.body([v for _, v in [*when.assign, *when.reinit]], store)
        body = _function(f"kernel_when_{number}", "const gust_point *at, double *y_new, double *d_new", lines, "")
        used = "\n".join(lines)
        extra = [f"    (void){name};" for name in ("y_new", "d_new") if f"{name}[" not in used]
        functions += [*body[:-2], *extra, *body[-2:]]
        cases += [f"    case {number}:", f"        kernel_when_{number}(at, y, d);", "        break;"]
    functions += ["static void kernel_when(const gust_point *at, int32_t clause, double *y, double *d)", "{"]
    if cases:
        functions += ["    switch (clause) {", *cases, "    default:", "        break;", "    }"]
    else:
        functions += ["    (void)at;", "    (void)clause;", "    (void)y;", "    (void)d;"]
    functions += ["}", ""]

    name = re.sub(r"[^A-Za-z0-9_]", "_", unit.name)  # a class may have any name; C gets letters and digits
    prepare = printer.hoister.body()
    text = "\n".join(prepare)
    prepare_lines = [f"    {line}" for line in prepare]
    if "p[" not in text:
        prepare_lines.append("    (void)p;")
    if "c[" not in text:
        prepare_lines.append("    (void)c;")

    def array(name: str, values: Sequence[int]) -> list[str]:
        items = ", ".join(str(v) for v in values) or "0"
        return [f"static const int32_t {name}[] = {{{items}}};"]

    counts = [
        ("n_unknowns", len(unit.unknowns)), ("n_external", len(unit.externals)), ("n_inputs", len(unit.inputs)),
        ("n_parameters", len(unit.parameters)), ("n_constants", printer.hoister.n_constants),
        ("n_discrete", len(unit.discretes)), ("n_tables", len(unit.tables)), ("n_flows", len(unit.flows)),
        ("n_nonzeros", len(rows)), ("n_outputs", len(unit.recorded)), ("n_roots", len(unit.roots)),
        ("n_whens", len(unit.whens)),
    ]  # fmt: skip
    lines = [
        f"/* Kernel of unit type {name}. Generated by gustform; do not edit. */",
        "#include <math.h>",
        "#include <stdint.h>",
        "#include <gustform/gust_kernel.h>",
        "",
        "static void kernel_prepare(const double *p, double *c)",
        "{",
        *prepare_lines,
        "}",
        "",
        *functions,
        *array("kernel_rows", rows),
        *array("kernel_columns", columns),
        "",
        "static const gust_kernel kernel = {",
        "    .abi = GUST_KERNEL_ABI,",
        f'    .type_name = "{name}",',
        *[f"    .{name} = {value}," for name, value in counts],
        "    .jacobian_row = kernel_rows,",
        "    .jacobian_column = kernel_columns,",
        *[f"    .{f} = kernel_{f}," for f in ("prepare", "residual", "jacobian", "outputs", "roots", "when")],
        "};",
        "",
        "const gust_kernel *gust_kernel_get(void);",
        "",
        "const gust_kernel *gust_kernel_get(void)",
        "{",
        "    return &kernel;",
        "}",
        "",
    ]
    has_derivative = [bool(ca.depends_on(e, printer.cj)) for e in entries]
    return Kernel("\n".join(lines), rows, columns, has_derivative, printer.hoister.n_constants)
