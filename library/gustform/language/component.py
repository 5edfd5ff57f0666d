"""Component: the base class of every model, light until its equations are asked for.

An instance that a user builds holds only the modifiers it was given: `PmsgTurbine(aggregate=10)` costs nothing, so a
farm of ten thousand is cheap. Reading a parameter gives its number. `elaborate()` makes the symbolic twin, in which
the same attributes are CasADi symbols, and collects the equations.
"""

from __future__ import annotations

import difflib
import itertools
import linecache
import math
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from gustform.language.connector import Connector
from gustform.language.declare import Declaration, Discrete, Input, Parameter, Part, Table, Variable
from gustform.language.errors import GustformError
from gustform.language.table import TableData

if TYPE_CHECKING:
    from gustform.language.scope import Scope

AnyDeclaration = Declaration | Part | Connector


def suggest(name: str, known: list[str]) -> str:
    """One thing to try for a name that is not known: the nearest one, or the list."""
    near = difflib.get_close_matches(name, known, n=1)
    if near or not known:
        return near[0] if near else "nothing: it takes none"
    return "one of " + ", ".join(known[:10]) + (", ..." if len(known) > 10 else "")


@dataclass(frozen=True)
class Source:
    """Where an equation was written: file, line and the text of that line."""

    file: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.text} ({Path(self.file).name}:{self.line})"


def _equation_text(call: str, joiner: str) -> str:
    """ "C * der(v) = i" from the arguments of "self.eq(self.C * self.der(self.v), self.i)"."""
    call = re.sub(r"(?<=[(\[{]) |,? (?=[)\]}])", "", " ".join(call.split())).removesuffix(",")
    depth = 0
    for position, character in enumerate(call):
        depth += (character in "([{") - (character in ")]}")
        if character == "," and depth == 0:
            call = call[:position] + joiner + call[position + 1 :].lstrip()
            break
    return re.sub(r"\b(self|ca)\.", "", call)


def _caller(joiner: str = " = ") -> Source:
    """Where the statement two frames up was written, with its text, which may run over several lines."""
    frame = sys._getframe(2)
    file, line = frame.f_code.co_filename, frame.f_lineno
    positions = itertools.islice(frame.f_code.co_positions(), frame.f_lasti // 2, None)
    first, last, begin, end = next(positions, (None, None, None, None))
    if first is None or last is None or begin is None or end is None:
        return Source(file, line, linecache.getline(file, line).strip())
    # Columns count UTF-8 bytes.
    lines = [linecache.getline(file, k).encode() for k in range(first, last + 1)]
    lines[-1] = lines[-1][:end]
    lines[0] = lines[0][begin:]
    text = b"".join(lines).decode(errors="replace")
    return Source(file, line, _equation_text(text[text.find("(") + 1 : text.rfind(")")], joiner))


class Component:
    """Base of all components. Subclasses declare attributes and write `equations()`."""

    _declarations: ClassVar[dict[str, AnyDeclaration]] = {}
    _scope: Scope | None = None
    _parent: Component | None = None
    _path: str = ""

    def __init_subclass__(cls) -> None:
        members = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
        cls._declarations = {
            name: value for name, value in members.items() if isinstance(value, Declaration | Part | Connector)
        }
        for name in cls._declarations:
            if hasattr(Component, name):
                raise GustformError(
                    "GF1021",
                    f"{cls.__name__} declares {name!r}, which is a method of every component",
                    hint=f"{name}_ or another name",
                )

    def __init__(self, **modifiers: Any) -> None:
        declarations = self._declarations
        for name, value in modifiers.items():
            declaration = declarations.get(name)
            if isinstance(declaration, Input) or not isinstance(
                declaration, Parameter | Part | Table | Variable | Discrete
            ):
                raise GustformError(
                    "GF1004",
                    f"{type(self).__name__} has no parameter {name!r}",
                    hint=suggest(name, self.parameter_names()),
                )
            if isinstance(declaration, Part):
                self._check_part(declaration, value)
            elif isinstance(declaration, Table):
                if not isinstance(value, TableData):
                    raise GustformError("GF2001", f"{name} must be a table; got {value!r}", hint="TableData(...)")
            elif isinstance(declaration, Parameter) and not callable(value):
                modifiers[name] = declaration.check(value, f"{type(self).__name__}.{name}")
        self._modifiers: dict[str, Any] = modifiers
        self._parts: dict[str, Component] = {}
        self._numbers: dict[str, Any] = {}  # values of parameters found so far
        self._computing: set[str] = set()  # parameters whose value is being computed right now

    def _check_part(self, part: Part, value: Any) -> None:
        if isinstance(value, Mapping):
            return
        base = part.base or part.kind
        if not isinstance(value, base):
            raise GustformError(
                "GF1007",
                f"{type(self).__name__}.{part.name} must be a {base.__name__}; got {type(value).__name__}",
                hint=f"a component derived from {base.__name__}",
            )

    # ---- declarations ----
    @classmethod
    def declarations(cls) -> dict[str, AnyDeclaration]:
        """All declarations by name, those of base classes first."""
        return cls._declarations

    @classmethod
    def declared(cls, kind: type[Any]) -> dict[str, Any]:
        """The declarations of one kind, e.g. `declared(Parameter)`."""
        return {name: value for name, value in cls._declarations.items() if isinstance(value, kind)}

    @classmethod
    def parameter_names(cls) -> list[str]:
        """What may be given to the constructor: parameters, tables and parts."""
        return [name for name, value in cls._declarations.items() if isinstance(value, Parameter | Part | Table)]

    # ---- numbers ----
    @property
    def path(self) -> str:
        """Dotted name inside the unit ("" for the unit itself)."""
        return self._path

    def part(self, name: str) -> Component:
        """The sub-component of that name, built on first use from its modifiers."""
        if name not in self._parts:
            declaration = self._declarations[name]
            assert isinstance(declaration, Part)
            given = self._modifiers.get(name, {})
            if isinstance(given, Component):
                child = type(given)(**given._modifiers)
            else:
                child = declaration.chosen(self)(**given)
            usable = type(child).declarations()
            for key, value in declaration.modifiers.items():
                if key in usable:
                    child._modifiers.setdefault(key, value)
            child._parent = self
            child._path = f"{self._path}.{name}" if self._path else name
            child._numbers.clear()  # what its constructor looked at knew no parent
            self._parts[name] = child
        return self._parts[name]

    def _get(self, declaration: AnyDeclaration) -> Any:
        if self._scope is not None:
            return self._scope.symbol(declaration)
        if isinstance(declaration, Part):
            return self.part(declaration.name)
        if isinstance(declaration, Parameter):
            return self.value(declaration.name)
        if isinstance(declaration, Table):
            return self.table(declaration.name)
        raise GustformError(
            "GF1008",
            f"{type(self).__name__}.{declaration.name} has a value only in a running model",
            hint="reading it inside equations()",
        )

    def value(self, name: str) -> Any:
        """The number of a parameter: given, bound by the parent, or the default. GF2004 if there is none."""
        if name in self._numbers:
            return self._numbers[name]
        declaration = self._declarations[name]
        assert isinstance(declaration, Parameter)
        label = f"{self._path}.{name}" if self._path else name
        given = self._modifiers.get(name, declaration.start if declaration.free else declaration.default)
        if callable(given):
            if name in self._computing:
                raise GustformError("GF1022", f"{type(self).__name__}.{label} is computed from itself")
            self._computing.add(name)
            try:
                given = given(self._parent if self.is_bound(name) else self)
            finally:
                self._computing.discard(name)
        if given is None:
            raise GustformError(
                "GF2004",
                f"{type(self).__name__}.{label} is not given ({declaration.description}, {declaration.unit})",
                hint=f"{name}: a number in {declaration.unit}",
            )
        self._numbers[name] = declaration.check(given, label)
        return self._numbers[name]

    def is_bound(self, name: str) -> bool:
        """Whether the parent sets this parameter by a function of its own parameters (and nobody overrode it)."""
        return callable(self._modifiers.get(name)) and self._parent is not None

    def table(self, name: str) -> TableData:
        """The data of a table; GF2004 if there is none."""
        given = self._modifiers.get(name)
        if callable(given) and self._parent is not None:
            given = given(self._parent)
        if not isinstance(given, TableData):
            raise GustformError("GF2004", f"{type(self).__name__}.{name} needs a table", hint="a table file")
        return given

    def parameter_values(self) -> dict[str, float]:
        """Every non-structural parameter of the tree by path. Free ones have their start value."""
        values: dict[str, float] = {}
        for name, declaration in self._declarations.items():
            if isinstance(declaration, Parameter) and not declaration.structural:
                values[f"{self._path}.{name}" if self._path else name] = float(self.value(name))
            elif isinstance(declaration, Part):
                values.update(self.part(name).parameter_values())
        return values

    def at(self, path: str) -> Component:
        """The component of a dotted path of parts ("" is this one)."""
        component: Component = self
        for name in path.split(".") if path else ():
            component = component.part(name)
        return component

    def with_value(self, path: str, value: float) -> Self:
        """A copy in which the parameter `path` has another value; what is computed from it follows."""
        head, _, rest = path.partition(".")
        modifiers = dict(self._modifiers)
        if not rest:
            modifiers[head] = value
        else:
            given = modifiers.get(head, {})
            child = given if isinstance(given, Component) else type(self.part(head))(**given)
            modifiers[head] = child.with_value(rest, value)
        return type(self)(**modifiers)

    def number(self, value: float | Callable[[Any], Any], label: str = "") -> float:
        """A start or nominal as a number; GF2002 with its label if it is not finite."""
        result = float(value(self)) if callable(value) else float(value)
        if not math.isfinite(result):
            path = f"{self._path}.{label}" if self._path else label
            raise GustformError("GF2002", f"{type(self).__name__}: {path} must be finite; got {result}")
        return result

    def start_value(self, declaration: Variable | Discrete) -> float:
        """The start of a variable or discrete value: given to the constructor, bound by the parent, or declared."""
        given = self._modifiers.get(declaration.name, declaration.start)
        owner = self._parent if self._parent is not None and self.is_bound(declaration.name) else self
        return owner.number(given, f"{declaration.name} (start)")

    def structure_key(self) -> tuple[Any, ...]:
        """Equal keys mean equal equations: class, structural values, and those of the parts."""
        key: list[Any] = [type(self)]
        for name, declaration in self._declarations.items():
            if isinstance(declaration, Parameter):
                if declaration.structural:
                    key.append((name, self.value(name)))
            elif isinstance(declaration, Part):
                key.append((name, self.part(name).structure_key()))
        return tuple(key)

    # ---- held between samples ----
    kept_parts: ClassVar[tuple[str, ...]] = ()  # those that a component which holds values has in the system

    def held(self) -> tuple[str, ...]:
        """Variables and outputs whose values come from a controller outside of the equations, held between its samples.

        If there are any, the system has these values as discrete ones, the component's inputs and outputs, its
        `kept_parts`, and `held_equations` in the place of `equations`: no other variable, parameter or part of it.
        """
        return ()

    def held_equations(self) -> None:
        """Equations of a component that holds values."""

    # ---- equations ----
    def equations(self) -> None:
        """Written by subclasses: `self.eq(...)`, `self.connect(...)`, `self.initial(...)`, `self.when(...)`."""

    def _need_scope(self) -> Scope:
        if self._scope is None:
            raise GustformError("GF1009", "equations can only be stated while a model is elaborated")
        return self._scope

    def eq(self, lhs: Any, rhs: Any) -> None:
        """lhs = rhs. Both sides must have the same unit."""
        self._need_scope().add_equation(lhs, rhs, _caller())

    def initial(self, lhs: Any, rhs: Any) -> None:
        """lhs = rhs at a steady-state start; one for each free parameter."""
        self._need_scope().add_initial(lhs, rhs, _caller())

    def connect(self, a: Any, b: Any) -> None:
        """Connect two ports of the same connector type, or two signals."""
        self._need_scope().add_connection(a, b, _caller())

    def der(self, variable: Any) -> Any:
        """Time derivative of a declared variable."""
        return self._need_scope().derivative(variable, _caller())

    def when(
        self, condition: Any, assign: dict[Any, Any] | None = None, *, reinit: dict[Any, Any] | None = None
    ) -> None:
        """When `condition` (a comparison, or several joined by logic_and/logic_or) becomes true: set discrete
        values (`assign`) and states (`reinit`). The right-hand sides see the values before the event."""
        self._need_scope().add_when(condition, assign or {}, reinit or {}, _caller(": "))

    def sample(self, period: Any, assign: dict[Any, Any], *, reinit: dict[Any, Any] | None = None) -> None:
        """Every `period` (a parameter in s): set discrete values; the block of a sampled controller."""
        self._need_scope().add_sampled(period, assign, reinit or {}, _caller(": "))
