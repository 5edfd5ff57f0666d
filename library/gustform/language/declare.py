"""Declarations of a component: parameters, variables, signals, discrete values, tables, parts.

Each declaration is a class attribute with a unit and a sentence. Read on an instance built by a user it gives the
number (parameters) or the sub-component (parts); read inside `equations()` it gives the CasADi symbol.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, NoReturn

from gustform.language.errors import GustformError
from gustform.language.units import Dimension, dimension_of

if TYPE_CHECKING:
    from gustform.language.component import Component

# A number, or a function of the component it is declared in (numbers in, number out).
Value = float | Callable[[Any], Any]

# What lies closer to an exclusive bound counts as on it. The reciprocal of a smaller number would leave the range of
# doubles in its fourth power, and an equation divides by squares of ratios.
_NEXT = 1e-60


def refuse_assignment(instance: Component, name: str) -> NoReturn:
    """GF1002: what is declared is given to the constructor."""
    raise GustformError(
        "GF1002",
        f"{type(instance).__name__}.{name} cannot be assigned after construction",
        hint=f"{type(instance).__name__}({name}=...)",
    )


class Declaration:
    """What all declarations share: name, unit and sentence."""

    name: str = ""

    def __init__(self, unit: str, description: str) -> None:
        self.unit = unit
        self.dimension: Dimension = dimension_of(unit)
        self.description = description

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Component | None, owner: type) -> Any:
        if instance is None:
            return self
        return instance._get(self)

    def __set__(self, instance: Component, value: object) -> None:
        refuse_assignment(instance, self.name)


def _check_finite(kind: str, owner: str, label: str, value: float) -> float:
    if not math.isfinite(value):
        raise GustformError("GF2002", f"{owner} must be a finite number ({label}); got {value}", hint="a number")
    return value


class Parameter(Declaration):
    """A value that stays constant while the model runs.

    `default` is a number or a function of the component; without one the user must give a value. `min`, `max` are
    inclusive, `above` is an exclusive lower bound. `structural=True`: the value shapes the equations, so another
    value makes another type (and a compilation); a word among `choices`, if there are any. `free=True`: the value is
    found by the steady-state start, from `start`, through an `initial()` equation.
    """

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        default: Value | str | bool | None = None,
        min: float | None = None,
        max: float | None = None,
        above: float | None = None,
        structural: bool = False,
        choices: Sequence[str] = (),
        free: bool = False,
        start: Value | None = None,
    ) -> None:
        super().__init__(unit, description)
        self.default = default
        self.choices = tuple(choices)
        self.min = min
        self.max = max
        self.above = above
        self.structural = structural
        self.free = free
        self.start = start
        if free and start is None:
            raise GustformError("GF1003", f"a free parameter needs start= ({description})", hint="start=1.0")

    def check(self, value: Any, path: str) -> Any:
        """The value, or GF2002/GF2003 with the path, the bound and something to try."""
        if self.choices and value not in self.choices:
            raise GustformError(
                "GF2003",
                f"{path} must be {' or '.join(self.choices)} ({self.description}); got {value!r}",
                hint=str(self.default),
            )
        if self.structural and not isinstance(value, int | float):
            return value
        if isinstance(value, bool) and self.structural:
            return value
        if isinstance(value, bool) or not isinstance(value, Real):
            raise GustformError(
                "GF2001",
                f"{path} must be a number in {self.unit} ({self.description}); got {value!r}",
                hint=f"a number in {self.unit}",
            )
        number = _check_finite("parameter", path, f"{self.description}, {self.unit}", float(value))
        low, high, above = self.min, self.max, self.above
        wrong = ""
        if above is not None and not number - above >= _NEXT:
            wrong = f"greater than {above:g}"
        elif low is not None and number < low:
            wrong = f"at least {low:g}"
        elif high is not None and number > high:
            wrong = f"at most {high:g}"
        if wrong:
            raise GustformError(
                "GF2003",
                f"{path} must be {wrong} ({self.description}, {self.unit}); got {number:g}",
                hint=self._suggestion(),
            )
        return value if self.structural else number

    def _suggestion(self) -> str:
        if isinstance(self.default, int | float) and not isinstance(self.default, bool):
            return f"the default, {self.default:g}"
        low = self.above if self.above is not None else self.min
        if low is not None and self.max is not None:
            return f"a value from {low:g} to {self.max:g}"
        return f"a value above {low:g}" if low is not None else f"a value below {self.max:g}"


class Variable(Declaration):
    """A scalar unknown of the DAE; a state if its derivative appears in an equation.

    `start` is the first guess (and the start value with `fixed=True`, where a steady-state start keeps it instead
    of asking for der = 0), `nominal` the magnitude that tolerances scale with, `min`/`max` bound the steady-state
    start.
    """

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        start: Value = 0.0,
        nominal: Value = 1.0,
        min: float | None = None,
        max: float | None = None,
        fixed: bool = False,
    ) -> None:
        super().__init__(unit, description)
        self.start = start
        self.nominal = nominal
        self.min = min
        self.max = max
        self.fixed = fixed


class Output(Variable):
    """A causal signal that the component defines by an equation, for others to read."""


class Input(Variable):
    """A causal signal that the component reads: another component's output, a constant or a time series."""


class Discrete(Declaration):
    """A value that changes only at events (`when`, `sample`) and is constant between them."""

    def __init__(self, unit: str, description: str, *, start: Value = 0.0) -> None:
        super().__init__(unit, description)
        self.start = start


class Table(Declaration):
    """A two-dimensional look-up table of values on a rectangular grid, given as run-time data.

    Its value is a `gustform.language.table.TableData`. `x_unit`, `y_unit` are those of the two arguments.
    """

    def __init__(self, x_unit: str, y_unit: str, unit: str, description: str) -> None:
        super().__init__(unit, description)
        self.x_dimension = dimension_of(x_unit)
        self.y_dimension = dimension_of(y_unit)


class Part:
    """A sub-component. Modifiers are numbers, or functions of the parent's parameters (kept symbolic).

    With `base`, a user may put another component in its place, provided it is a `base`. With `select`, the component
    itself chooses what stands there unless the user does: a function of its structural parameters and its other parts
    that gives one of `among` (which `kind` is one of).
    """

    name: str = ""

    def __init__(
        self,
        kind: type[Component],
        description: str,
        *,
        base: type[Component] | None = None,
        select: Callable[[Any], type[Component]] | None = None,
        among: Sequence[type[Component]] = (),
        **modifiers: Any,
    ) -> None:
        self.kind = kind
        self.description = description
        self.base = base
        self.select = select
        self.among: tuple[type[Component], ...] = tuple(dict.fromkeys((kind, *among)))
        self.modifiers = modifiers
        usable = {name for one in self.among for name in one.declarations()}
        unknown = set(modifiers) - usable
        if unknown:
            raise GustformError("GF1004", f"{kind.__name__} has no parameter {sorted(unknown)[0]!r}")

    def chosen(self, owner: Component) -> type[Component]:
        """What stands in this place of `owner` where the user says nothing."""
        return self.kind if self.select is None else self.select(owner)

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Component | None, owner: type) -> Any:
        if instance is None:
            return self
        return instance._get(self)

    def __set__(self, instance: Component, value: object) -> None:
        refuse_assignment(instance, self.name)
