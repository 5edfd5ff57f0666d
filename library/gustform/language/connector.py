"""Connectors: the potentials and flows through which acausal components meet.

Connecting ports makes their potentials equal and their flows sum to zero. A flow is positive INTO the component.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from gustform.language.declare import Declaration, Value, refuse_assignment
from gustform.language.errors import GustformError

if TYPE_CHECKING:
    from gustform.language.component import Component


class Potential(Declaration):
    """A quantity that is equal at all connected ports. `start` and `nominal` may be set by the port."""

    def __init__(self, unit: str, description: str, *, start: Value = 0.0, nominal: Value = 1.0) -> None:
        super().__init__(unit, description)
        self.start = start
        self.nominal = nominal


class Flow(Declaration):
    """A quantity that sums to zero over connected ports; positive into the component."""

    def __init__(self, unit: str, description: str, *, nominal: Value = 1.0) -> None:
        super().__init__(unit, description)
        self.nominal = nominal


class Connector:
    """Base of connector types. Subclasses declare Potential and Flow attributes, in matching pairs:
    the k-th flow is the one whose sum row goes with the k-th potential.

    An instance as a class attribute of a component declares a port. Keyword arguments override `start`/`nominal`:
    ``grid = AcPort("grid terminal", start={"vr": lambda self: self.V_n})``.
    """

    _potentials: ClassVar[dict[str, Potential]] = {}
    _flows: ClassVar[dict[str, Flow]] = {}
    name: str = ""

    def __init_subclass__(cls) -> None:
        members = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
        cls._potentials = {name: value for name, value in members.items() if isinstance(value, Potential)}
        cls._flows = {name: value for name, value in members.items() if isinstance(value, Flow)}
        if len(cls._potentials) != len(cls._flows):
            raise GustformError(
                "GF1005",
                f"connector {cls.__name__} has {len(cls._potentials)} potentials and {len(cls._flows)} flows",
                hint="as many flows as potentials: that is what makes connections balance",
            )

    def __init__(
        self,
        description: str,
        *,
        start: dict[str, Value] | None = None,
        nominal: dict[str, Value] | None = None,
        optional: bool = False,
    ) -> None:
        self.description = description
        self.start = start or {}
        self.nominal = nominal or {}
        for name in {**self.start, **self.nominal}:
            if name not in self._potentials and name not in self._flows:
                raise GustformError(
                    "GF1006",
                    f"connector {type(self).__name__} has no quantity {name!r}",
                    hint=" or ".join([*self._potentials, *self._flows]),
                )
        self.optional = optional  # may be left unconnected: its flows are then zero

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Component | None, owner: type) -> Any:
        if instance is None:
            return self
        return instance._get(self)

    def __set__(self, instance: Component, value: object) -> None:
        refuse_assignment(instance, self.name)


class _NoQuantityError(GustformError, AttributeError):
    """An AttributeError too, as hasattr() expects of any object."""


class Port:
    """A port inside `equations()`: its potentials and flows as attributes."""

    def __init__(self, path: str, connector: Connector, symbols: dict[str, Any]) -> None:
        self.path = path
        self.connector = connector
        self.symbols = symbols

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)  # what Python and CasADi ask any object for
        try:
            return self.symbols[name]
        except KeyError:
            raise _NoQuantityError(
                "GF1006",
                f"connector {type(self.connector).__name__} has no quantity {name!r} (port {self.path})",
                hint=" or ".join(self.symbols),
            ) from None
