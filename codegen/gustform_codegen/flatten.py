"""Flatten one unit type: from declared equations to the few rows that the solver has to see.

Order of work: connections become equations; aliases leave; the rest is matched, sorted into blocks and solved
symbolically where that is exact (explicit assignments, small linear blocks); what remains are states with an
explicit derivative, torn iteration variables, and the flows at the connectors.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from gustform.language.component import Component
from gustform.language.errors import GustformError, Place
from gustform.language.operators import TableCall, constants, table_calls
from gustform.language.scope import Elaborated, Symbol, elaborate
from gustform.language.unitcheck import check_units
from gustform_codegen.alias import GIVEN, AliasSets, as_alias
from gustform_codegen.balance import check_balance, refuse_constraint, refuse_singular
from gustform_codegen.connections import connection_equations
from gustform_codegen.events import bend_roots, indicator, refuse_bare_comparisons
from gustform_codegen.structure import Matching, blocks, match, tear
from gustform_codegen.symbolic import Substitution, key_of, keys_in, solve_for, solve_linear
from gustform_codegen.unit_type import (
    BoundaryFlow,
    Call,
    External,
    Recorded,
    Root,
    Row,
    UnitType,
    Unknown,
    WhenClause,
)

# Linear blocks up to this many unknowns are solved by symbolic elimination; larger ones are left to the solver.
_MAX_LINEAR_BLOCK = 3


@dataclass(frozen=True)
class _Statement:
    """One equation of the flat system: expression = 0."""

    expression: Any
    text: str
    place: Place | None


class _Flattener:
    def __init__(self, component: Component, signals: frozenset[str], keep: frozenset[str]) -> None:
        self.component = component
        self.signals = signals
        self.keep = keep
        self.name = type(component).__name__
        self.e: Elaborated = elaborate(component)
        check_units(self.e)
        self.boundary = {path for path in self.e.ports if "." not in path}
        self.table_index = {(id(t.declaration), t.owner.path): k for k, t in enumerate(self.e.tables)}
        self.constants = Substitution()
        for constant in constants.values():
            self.constants.add(constant.symbol, ca.SX(constant.value))

    # ---- who is known, who is not ----
    def is_external(self, s: Symbol) -> bool:
        if s.kind == "potential":
            return s.path.rpartition(".")[0] in self.boundary
        return s.kind == "input" and "." not in s.path and s.path in self.signals

    def is_input(self, s: Symbol) -> bool:
        return s.kind == "input" and "." not in s.path and s.path not in self.signals

    def is_unknown(self, s: Symbol) -> bool:
        if s.kind in ("parameter", "discrete"):
            return False
        return not self.is_external(s) and not self.is_input(s)

    # ---- the phases ----
    def run(self) -> UnitType:
        statements = [
            _Statement(eq.lhs - eq.rhs, str(eq), Place(eq.source.file, eq.source.line)) for eq in self.e.equations
        ]
        statements += [_Statement(e, text, None) for e, text in connection_equations(self.e, self.boundary)]
        declared_equations = len(statements)
        statements = [_Statement(self.constants.one(s.expression), s.text, s.place) for s in statements]
        for statement in statements:
            refuse_bare_comparisons(statement.expression, statement.text, statement.place)
        statements = self.eliminate_aliases(statements)
        return self.solve(statements, declared_equations)

    def eliminate_aliases(self, statements: list[_Statement]) -> list[_Statement]:
        symbols, ders = self.e.symbols, self.e.derivatives

        def rank(key: int) -> int:
            s = symbols[key]
            if not self.is_unknown(s):
                return GIVEN
            if getattr(s.declaration, "fixed", False):
                return 3  # whoever stands for the set, its start value must be this one's
            if key in ders:
                return 2
            return 1 if s.kind in ("variable", "output") else 0

        sets = AliasSets(rank)

        def joins_state_to_given(a: int, b: int) -> bool:
            ends = [sets.find(key)[0] for key in (a, b)]
            states = {sets.find(key)[0] for key in ders}
            return any(rank(x) == GIVEN and y in states for x, y in (ends, ends[::-1]))

        rest: list[_Statement] = []
        for statement in statements:
            pair = as_alias(statement.expression)
            if pair is not None:
                a, b, sign = pair
                ka, kb = key_of(a), key_of(b)
                mergeable = all(
                    k in symbols
                    and symbols[k].kind not in ("parameter", "discrete")
                    and symbols[k].path not in self.keep
                    for k in (ka, kb)
                )
                if mergeable and not joins_state_to_given(ka, kb) and sets.join(ka, kb, sign):
                    continue
            rest.append(statement)
        self.alias: dict[int, tuple[int, int]] = {}
        substitution = Substitution()
        for key, s in symbols.items():
            target, sign = sets.find(key)
            if target != key:
                self.alias[key] = (target, sign)
                substitution.add(s.symbol, sign * symbols[target].symbol)
        for key, der in list(ders.items()):
            if key in self.alias:
                target, sign = self.alias[key]
                if target not in ders:
                    ders[target] = ca.SX.sym(f"der({symbols[target].path})")
                substitution.add(der, sign * ders[target])
        self.alias_substitution = substitution
        self.states = {key for key in ders if key not in self.alias}
        for key in self.states:
            if not self.is_unknown(symbols[key]):
                raise GustformError(
                    "GF3004",
                    f"{self.name}: the derivative of {symbols[key].path} is used, but it is given from outside",
                    hint="a state of the unit's own, coupled to the connector by a resistance or reactance",
                )
        expressions = substitution.apply([s.expression for s in rest])
        return [_Statement(expression, s.text, s.place) for expression, s in zip(expressions, rest, strict=True)]

    def prepared(self, expression: Any) -> Any:
        return self.alias_substitution.one(self.constants.one(expression))

    def solve(self, statements: list[_Statement], declared_equations: int) -> UnitType:
        symbols, ders = self.e.symbols, self.e.derivatives
        self.find_calls([s.expression for s in statements] + [self.prepared(x) for x in self._other_expressions()])
        # Unknowns: algebraic variables by their symbol, states by their derivative.
        unknown_symbols: list[Any] = []
        labels: list[str] = []
        for key, s in symbols.items():
            if key in self.alias or not self.is_unknown(s):
                continue
            unknown_symbols.append(ders[key] if key in self.states else s.symbol)
            labels.append(f"der({s.path})" if key in self.states else s.path)
        index = {key_of(s): k for k, s in enumerate(unknown_symbols)}
        n_own = len(unknown_symbols)
        externals = [(key, s) for key, s in symbols.items() if self.is_external(s)]
        external_index = {key: n_own + k for k, (key, _) in enumerate(externals)}

        texts = [s.text for s in statements]
        incidence: list[frozenset[int]] = []
        with_external: list[frozenset[int]] = []
        for statement in statements:
            used = {*keys_in(statement.expression), *self.through_tables(statement.expression)}
            incidence.append(frozenset(index[k] for k in used if k in index))
            with_external.append(incidence[-1] | {external_index[k] for k in used if k in external_index})
        check_balance(self.name, texts, labels, incidence)
        matching = match(incidence, n_own)
        iterate: set[int] = set()
        left_over: list[int] = []
        if matching.free_equations:
            full = match(with_external, n_own + len(externals), matching)
            if full.free_equations:
                states = [[symbols[k].path for k in keys_in(s.expression) if k in self.states] for s in statements]
                refuse_singular(self.name, texts, labels, incidence, matching, states)
            # An equation that fixes a connector potential: the unit's own unknown left over (a flow) is iterated on.
            left_over = [e for e, z in enumerate(full.unknown_of) if z >= n_own]
            iterate = {z for z in range(n_own) if full.equation_of[z] < 0}
            matching = full

        solution = Substitution()
        rows: list[Row] = []
        torn: list[int] = sorted(iterate)
        inner = [frozenset(z for z in row if z not in iterate) for row in incidence]
        trimmed = Matching(
            [z if z < n_own and e not in set(left_over) else -1 for e, z in enumerate(matching.unknown_of)],
            matching.equation_of[:n_own],
        )
        for block in blocks(inner, trimmed):
            unknowns = [trimmed.unknown_of[e] for e in block]
            torn += self.solve_block(
                [statements[e] for e in block],
                [inner[e] for e in block],
                unknowns,
                unknown_symbols,
                solution,
                rows,
            )
        for e in left_over:
            rows.append(Row(solution.one(statements[e].expression), statements[e].text))
        return self.collect(rows, torn, unknown_symbols, solution, externals, declared_equations, statements)

    # ---- table look-ups: functions of their arguments, never unknowns themselves ----
    def find_calls(self, expressions: Iterable[Any]) -> None:
        """Keep in `calls` the look-ups that expressions need, with their arguments."""
        self.calls: dict[int, tuple[TableCall, Any, Any]] = {}
        pending = list(expressions)
        while pending:
            for key in keys_in(pending.pop()):
                if key in table_calls and key not in self.calls:
                    call = table_calls[key]
                    self.calls[key] = (call, self.prepared(call.x), self.prepared(call.y))
                    text = f"the arguments of table {call.table.name}"
                    for argument in self.calls[key][1:]:
                        refuse_bare_comparisons(argument, text, None)
                        pending.append(argument)

    def through_tables(self, expression: Any, *known: Substitution) -> set[int]:
        """The symbols that an expression depends on through table look-ups, `known` ones replaced."""
        result: set[int] = set()
        pending = [key for key in keys_in(expression) if key in self.calls]
        seen = set(pending)
        while pending:
            arguments = list(self.calls[pending.pop()][1:])
            for substitution in known:
                arguments = substitution.apply(arguments)
            for key in (key for argument in arguments for key in keys_in(argument)):
                result.add(key)
                if key in self.calls and key not in seen:
                    seen.add(key)
                    pending.append(key)
        return result

    def final_calls(self, solution: Substitution) -> list[Call]:
        """The look-ups in an order in which they can be evaluated, their arguments in terms of what is known."""
        arguments = {key: solution.apply([x, y]) for key, (_, x, y) in self.calls.items()}
        ordered: dict[int, Call] = {}

        def place(key: int) -> None:
            for inner in (k for argument in arguments[key] for k in keys_in(argument)):
                if inner in arguments and inner not in ordered:
                    place(inner)
            call = self.calls[key][0]
            slopes = [ca.SX.sym(f"{call.symbol}/d{axis}") for axis in "xy"]
            number = self.table_index[(id(call.table), call.owner.path)]
            ordered[key] = Call(call.symbol, slopes[0], slopes[1], number, *arguments[key])

        for key in arguments:
            if key not in ordered:
                place(key)
        return list(ordered.values())

    def solve_block(
        self,
        statements: list[_Statement],
        incidence: list[frozenset[int]],
        unknowns: list[int],
        symbols: list[Any],
        solution: Substitution,
        rows: list[Row],
    ) -> list[int]:
        """Solve one block as far as symbols reach; append to `solution` and `rows`; return what stays unknown."""
        wanted = frozenset(unknowns)
        local = solution.apply([s.expression for s in statements])
        solvable: list[frozenset[int]] = []
        for expression, used in zip(local, incidence, strict=True):
            opaque = self.through_tables(expression, solution)
            can = set()
            for z in used & wanted:
                slope = ca.jacobian(expression, symbols[z])
                explicit = not ca.depends_on(slope, symbols[z]) and not slope.is_zero() and self.is_constant(slope)
                if explicit and key_of(symbols[z]) not in opaque:
                    can.add(z)
            solvable.append(frozenset(can))
        sequence, tears, residuals = tear(incidence, wanted, solvable)
        block_solution = Substitution()
        assigned: list[tuple[int, Any]] = []
        for e, z in sequence:
            value = solve_for(block_solution.one(local[e]), symbols[z])
            block_solution.add(symbols[z], value)
            assigned.append((z, value))
        left = [block_solution.one(local[e]) for e in residuals]
        tear_symbols = [symbols[z] for z in tears]
        opaque = set[int]().union(*(self.through_tables(e, solution, block_solution) for e in left))
        exact = 0 < len(tears) <= _MAX_LINEAR_BLOCK and opaque.isdisjoint(key_of(s) for s in tear_symbols)
        solved = solve_linear(left, tear_symbols) if exact else None
        if solved is not None:
            final = Substitution()
            for symbol, value in zip(tear_symbols, solved, strict=True):
                final.add(symbol, value)
                solution.add(symbol, value)
            for z, value in assigned:
                solution.add(symbols[z], final.one(value))
            tears = []
        else:
            for z, value in assigned:
                solution.add(symbols[z], value)
            rows += [Row(value, statements[e].text) for value, e in zip(left, residuals, strict=True)]
        return tears

    def is_constant(self, expression: Any) -> bool:
        """Whether it depends on parameters and numbers only, so that it cannot pass through zero during a run, and does
        not vanish with those that may be zero."""
        symbols = ca.symvar(expression)
        known = [self.e.symbols.get(key_of(s)) for s in symbols]
        if not all(s is not None and s.kind == "parameter" for s in known):
            return False
        at_zero = [x for x, s in zip(symbols, known, strict=True) if s is not None and _may_be_zero(s.declaration)]
        rest = ca.substitute(expression, ca.vertcat(*at_zero), ca.SX.zeros(len(at_zero))) if at_zero else expression
        return not ca.simplify(rest).is_zero()

    # ---- the result ----
    def collect(
        self,
        rows: list[Row],
        torn: list[int],
        unknown_symbols: list[Any],
        solution: Substitution,
        externals: list[tuple[int, Symbol]],
        declared_equations: int,
        statements: list[_Statement],
    ) -> UnitType:
        symbols, ders = self.e.symbols, self.e.derivatives
        values = {key_of(s): v for s, v in zip(solution.symbols, solution.values, strict=True)}
        unknowns: list[Unknown] = []
        state_rows: list[Row] = []
        torn_keys = {key_of(unknown_symbols[z]) for z in torn}
        text_of_der: dict[int, str] = {}
        for statement in statements:
            for key in keys_in(statement.expression):
                text_of_der.setdefault(key, statement.text)
        for key in (k for k in symbols if k in self.states):
            s, der = symbols[key], ders[key]
            unknowns.append(Unknown(s.path, s.symbol, der, s))
            if key_of(der) in values:
                state_rows.append(Row(der - values[key_of(der)], text_of_der.get(key_of(der), s.path)))
        for key, s in symbols.items():
            if key not in self.alias and key not in self.states and self.is_unknown(s):
                if key_of(s.symbol) in torn_keys:
                    unknowns.append(Unknown(s.path, s.symbol, None, s))
                elif s.path in self.keep:
                    unknowns.append(Unknown(s.path, s.symbol, None, s))
                    rows.append(Row(s.symbol - values[key_of(s.symbol)], f"{s.path}: signal read by other units"))
        if self.keep:
            solution = self._without(solution, {u.path for u in unknowns})
        order = {key_of(u.symbol): k for k, u in enumerate(unknowns)}
        flows, recorded, aliases = [], [], {}
        by_path = {s.path: key for key, s in symbols.items()}
        for key, s in symbols.items():
            if s.kind == "flow" and s.path.rpartition(".")[0] in self.boundary:
                flows.append(BoundaryFlow(s.path, self._potential_of(s), self._final(s.symbol, solution)))
            if key in self.alias:
                target, sign = self.alias[key]
                aliases[s.path] = (symbols[target].path, sign)
            elif self.is_unknown(s) and key not in order:
                recorded.append(Recorded(s.path, self._final(s.symbol, solution), s))
            elif self.is_input(s) or s.kind == "discrete":
                recorded.append(Recorded(s.path, s.symbol, s))
        parameters = list(self.e.of_kind("parameter"))
        discretes = list(self.e.of_kind("discrete"))
        roots, whens = self._whens(parameters, discretes, order, by_path, solution)
        final_rows = [Row(r.expression, r.text) for r in [*state_rows, *rows]]
        self.refuse_constraints(final_rows, unknowns, externals, solution)
        calls = self.final_calls(solution)
        roots += bend_roots(
            [(r.expression, r.text) for r in final_rows]
            + [(f.expression, f.path) for f in flows]
            + [(e, f"table {self.e.tables[c.table].declaration.name}") for c in calls for e in (c.x, c.y)]
        )
        free = [k for k, p in enumerate(parameters) if p.declaration.free]  # type: ignore[attr-defined]
        initial = [Row(self._final(eq.lhs - eq.rhs, solution), str(eq)) for eq in self.e.initial]
        if len(initial) != len(free):
            raise GustformError(
                "GF3005",
                f"{self.name} has {len(free)} free parameters and {len(initial)} initial equations: "
                + ", ".join(parameters[k].path for k in free),
                hint="one self.initial(...) for each free parameter",
            )
        return UnitType(
            name=self.name,
            component=self.component,
            parameters=parameters,
            unknowns=unknowns,
            externals=[External(s.path, s.symbol, s) for _, s in externals],
            inputs=[s for s in symbols.values() if self.is_input(s)],
            discretes=discretes,
            tables=self.e.tables,
            calls=calls,
            rows=final_rows,
            flows=flows,
            recorded=recorded,
            aliases=aliases,
            roots=roots,
            whens=whens,
            initial=initial,
            free_parameters=free,
            substituted=sum(self.is_unknown(r.declared) for r in recorded),
            declared_equations=declared_equations,
        )

    def refuse_constraints(
        self, rows: list[Row], unknowns: list[Unknown], externals: list[tuple[int, Symbol]], solution: Substitution
    ) -> None:
        """GF3013 for a row in which nothing is left but states, once everything is put into it."""
        free = {key_of(u.symbol if u.der is None else u.der) for u in unknowns} | {key for key, _ in externals}
        for row in rows:
            used = {*keys_in(row.expression), *self.through_tables(row.expression, solution)}
            if not used & free:
                states = [u.path for u in unknowns if u.der is not None and key_of(u.symbol) in used]
                refuse_constraint(self.name, [row.text], states)

    @staticmethod
    def _without(solution: Substitution, paths: set[str]) -> Substitution:
        kept = Substitution()
        for symbol, value in zip(solution.symbols, solution.values, strict=True):
            if str(symbol) not in paths:
                kept.add(symbol, value)
        return kept

    def _final(self, expression: Any, solution: Substitution) -> Any:
        return solution.one(self.prepared(expression))

    def _potential_of(self, flow: Symbol) -> str:
        assert flow.port is not None
        port, _, name = flow.path.rpartition(".")
        position = list(flow.port._flows).index(name)
        return f"{port}.{list(flow.port._potentials)[position]}"

    def _other_expressions(self) -> Iterable[Any]:
        """What may use table values apart from the equations: initial equations and when-clauses."""
        for equation in self.e.initial:
            yield equation.lhs - equation.rhs
        for when in self.e.whens:
            if when.condition is not None:
                yield when.condition
            for _, value in [*when.assign, *when.reinit]:
                yield value

    def _whens(
        self,
        parameters: list[Symbol],
        discretes: list[Symbol],
        order: dict[int, int],
        by_path: dict[str, int],
        solution: Substitution,
    ) -> tuple[list[Root], list[WhenClause]]:
        roots: list[Root] = []
        clauses: list[WhenClause] = []
        parameter_index = {key_of(p.symbol): k for k, p in enumerate(parameters)}
        discrete_index = {key_of(d.symbol): k for k, d in enumerate(discretes)}
        for when in self.e.whens:
            text = f"{when.path + ': ' if when.path else ''}{when.source}"
            root, period = -1, -1
            if when.condition is not None:
                root = len(roots)
                condition = indicator(self._final(when.condition, solution), text)
                roots.append(Root(1, condition, text))
            else:
                period = parameter_index.get(key_of(when.period), -1) if when.period.is_symbolic() else -1
                if period < 0:
                    raise GustformError("GF1015", f"the sample period must be a parameter in {text}")
            reinit = []
            for target, value in when.reinit:
                key, sign = self.alias.get(key_of(target), (key_of(target), 1))
                if key not in self.states:
                    raise GustformError("GF1016", f"reinit needs a state; {target} is none in {text}")
                reinit.append((order[key], sign * self._final(value, solution)))
            assign = [(discrete_index[key_of(t)], self._final(v, solution)) for t, v in when.assign]
            clauses.append(WhenClause(root, period, assign, reinit, text))
        return roots, clauses


def _may_be_zero(parameter: Any) -> bool:
    """Whether a parameter is declared to be 0 at times, by a bound at or below it."""
    return parameter.above is None and parameter.min is not None and bool(parameter.min <= 0.0)


def flatten(
    component: Component, signals: frozenset[str] = frozenset(), keep: frozenset[str] = frozenset()
) -> UnitType:
    """The unit type of a component.

    `signals`: inputs of the unit that are wired to other units (the rest are constants or series). `keep`: variables
    that must stay unknowns because other units read them. Raises GF1xxx and GF3xxx with the equation's place.
    """
    return _Flattener(component, signals, keep).run()
