"""A system: named units, how they are connected, what drives their inputs, and what changes when. Plain data."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gustform.language.component import Component, suggest
from gustform.language.connector import Connector
from gustform.language.declare import Input, Parameter, Part
from gustform.language.errors import GustformError

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\[[0-9]+\])?")


@dataclass(frozen=True)
class Constant:
    """A constant input, in the unit of the input's declaration."""

    value: float


@dataclass(frozen=True, eq=False)
class Series:
    """A time series: samples held here, or delivered by a reader that the host sets on the runtime.

    `time` None: uniform from `t0` with spacing `dt`. `value` None: a reader delivers the samples.
    `interpolation` "linear", "pchip" or "hold"; `on_end` "error", "hold" or "repeat"; `t_end` the last valid time, s.
    `operating_value` is what the steady-state start takes (for wind: the mean the operating point is made for).
    """

    name: str
    operating_value: float
    t0: float = 0.0
    dt: float = 0.0
    time: NDArray[np.float64] | None = None
    value: NDArray[np.float64] | None = None
    interpolation: str = "linear"
    on_end: str = "error"
    t_end: float = float("inf")

    def __post_init__(self) -> None:
        wrong = ""
        if self.interpolation not in ("linear", "pchip", "hold"):
            wrong = f"interpolation must be linear, pchip or hold; got {self.interpolation!r}"
        elif self.on_end not in ("error", "hold", "repeat"):
            wrong = f"on_end must be error, hold or repeat; got {self.on_end!r}"
        elif self.time is None and not (math.isfinite(self.dt) and self.dt > 0 and math.isfinite(self.t0)):
            wrong = f"without times its samples need a spacing dt > 0 from t0; got {self.dt} from {self.t0}"
        elif self.value is not None and (self.value.ndim != 1 or self.value.size == 0):
            wrong = f"its values must be one row of numbers; got shape {self.value.shape}"
        elif self.value is not None and not np.all(np.isfinite(self.value)):
            wrong = f"value number {int(np.argmin(np.isfinite(self.value)))} is not finite"
        elif self.value is not None and self.time is not None:
            if self.time.shape != self.value.shape:
                wrong = f"it has {self.time.size} times for {self.value.size} values"
            elif not np.all(np.isfinite(self.time)) or not np.all(np.diff(self.time) > 0):
                wrong = "its times must be finite and increasing"
        if wrong:
            raise GustformError("GF2013", f"series {self.name!r}: {wrong}")


@dataclass(frozen=True)
class Change:
    """At time `at`, s, the parameter `path` ("load.P") takes `value`, in the unit of its declaration."""

    at: float
    path: str
    value: float


@dataclass
class System:
    """Units and how they hang together. Every method refuses what cannot be meant."""

    components: dict[str, Component] = field(default_factory=dict)
    connections: list[tuple[str, str]] = field(default_factory=list)
    inputs: dict[str, Constant | Series] = field(default_factory=dict)
    signals: dict[str, str] = field(default_factory=dict)
    schedule: list[Change] = field(default_factory=list)

    def add(self, name: str, component: Component) -> Component:
        """Add a unit. Names are letters, digits and _, optionally with an index: wt, wt[3]."""
        if not _NAME.fullmatch(name):
            raise GustformError(
                "GF2005", f"component name {name!r} is not usable", hint="letters, digits and _, e.g. wt or wt[3]"
            )
        if name in self.components:
            raise GustformError("GF2006", f"component name {name!r} is used twice", hint=f"{name}_2")
        self.components[name] = component
        return component

    def split(self, path: str) -> tuple[str, str]:
        """("wt", "grid") for "wt.grid"; GF2007 when there is no such component."""
        name, _, rest = path.partition(".")
        if name not in self.components:
            raise GustformError(
                "GF2007", f"there is no component {name!r} (in {path!r})", hint=suggest(name, list(self.components))
            )
        return name, rest

    def port(self, path: str) -> Connector:
        """The connector declaration behind "unit.port"."""
        name, rest = self.split(path)
        ports = self.components[name].declared(Connector)
        if rest not in ports:
            kind = type(self.components[name]).__name__
            raise GustformError("GF2008", f"{kind} {name!r} has no port {rest!r}", hint=suggest(rest, list(ports)))
        port = ports[rest]
        assert isinstance(port, Connector)
        return port

    def connect(self, a: str, b: str) -> None:
        """Connect two ports, "wt.grid" to "bus.terminal"."""
        one, other = self.port(a), self.port(b)
        if type(one) is not type(other):
            raise GustformError(
                "GF3001",
                f"cannot connect {a} ({type(one).__name__}) to {b} ({type(other).__name__})",
                hint="ports of one connector type",
            )
        if a == b:
            raise GustformError("GF3002", f"{a} is connected to itself", hint="another port")
        self.connections.append((a, b))

    def _input(self, path: str) -> Input:
        name, rest = self.split(path)
        inputs = self.components[name].declared(Input)
        if rest not in inputs:
            raise GustformError("GF2009", f"{name} has no input {rest!r}", hint=suggest(rest, list(inputs)))
        declaration = inputs[rest]
        assert isinstance(declaration, Input)
        return declaration

    def bind(self, path: str, source: Constant | Series) -> None:
        """Drive an input by a constant or a series. Binding it again replaces the source."""
        declaration = self._input(path)
        if path in self.signals:
            raise GustformError(
                "GF2014", f"{path} is driven by {self.signals[path]} already", hint="one source for each input"
            )
        value = source.value if isinstance(source, Constant) else source.operating_value
        if not math.isfinite(value):
            raise GustformError(
                "GF2002",
                f"{path} must be a finite number ({declaration.description}, {declaration.unit}); got {value}",
                hint=f"a number in {declaration.unit}",
            )
        self.inputs[path] = source

    def signal(self, target: str, source: str) -> None:
        """Wire an input of one unit to a variable of another: signal("wt.frame", "sg.omega")."""
        self._input(target)
        self.split(source)
        if target in self.inputs:
            raise GustformError(
                "GF2014", f"{target} is driven by a constant or a series already", hint="one source for each input"
            )
        self.signals[target] = source

    def frame(self, source: str) -> None:
        """Wire the input `frame` of every unit that has one to the speed of the reference machine."""
        for name, component in self.components.items():
            path = f"{name}.frame"
            if "frame" in component.declared(Input) and path not in self.signals and path not in self.inputs:
                self.signal(path, source)

    def change(self, at: float, path: str, value: float) -> None:
        """Schedule a parameter change; the value is checked against the declaration."""
        name, rest = self.split(path)
        component = self.components[name]
        *parts, parameter = rest.split(".")
        for part in parts:
            known = list(component.declared(Part))
            if part not in known:
                raise GustformError("GF2008", f"{path}: no part {part!r}", hint=suggest(part, known))
            component = component.part(part)
        parameters = component.declared(Parameter)
        if parameter not in parameters:
            raise GustformError(
                "GF2008", f"{path}: no parameter {parameter!r}", hint=suggest(parameter, list(parameters))
            )
        declaration = parameters[parameter]
        if declaration.structural:
            raise GustformError("GF2008", f"{path} cannot change while the model runs")
        if not math.isfinite(at):
            raise GustformError("GF2002", f"the time of a change of {path} must be finite; got {at}")
        self.schedule.append(Change(float(at), path, declaration.check(value, path)))
