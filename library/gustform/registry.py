"""Every component that a scenario may name as a `type`, and how it stands in a system.

A scenario never names an import path: what is not listed here does not exist for it. Units stand in a system by
themselves; parts stand inside a unit, in the place of a replaceable part.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from gustform.aero.closed_form_rotor import ClosedFormRotor
from gustform.aero.table_rotor import TableRotor, read_cp_table
from gustform.control.curtailment_schedule import CurtailmentSchedule
from gustform.control.droop import Droop
from gustform.control.dual_port import DualPort
from gustform.control.grid_following import GridFollowing
from gustform.control.matching import Matching
from gustform.control.schedule import FixedPoint
from gustform.control.virtual_synchronous_machine import VirtualSynchronousMachine
from gustform.electrical.bus import Bus
from gustform.electrical.constant_field import ConstantField
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.first_order_governor import FirstOrderGovernor
from gustform.electrical.line import Line
from gustform.electrical.machine6 import Machine6
from gustform.electrical.machine_classical import ClassicalMachine
from gustform.electrical.sexs import SEXS
from gustform.electrical.stiff_frame import StiffFrame
from gustform.electrical.stiff_grid import StiffGrid
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.electrical.tgov1 import TGOV1
from gustform.electrical.transformer import Transformer
from gustform.language.component import Component, suggest
from gustform.language.declare import Part
from gustform.language.errors import GustformError
from gustform.language.table import TableData
from gustform.mechanical.one_mass import OneMass
from gustform.mechanical.two_mass import TwoMass
from gustform.turbines.pmsg_turbine import PmsgTurbine


@dataclass(frozen=True)
class Unit:
    """A component that stands in a system by itself.

    `at`: the port that is connected to the bus named under `at:`; `ends`: the ports for `from:` and `to:`.
    `voltage`: its parameter for the nominal voltage at that port, which follows the bus unless it is given.
    `speed`, `frequency`: variables by which it can give the phasor frame and the grid frequency. `wind`: the input that
    wind drives, and `wind_speed` the parameter for the wind of its operating point.
    """

    kind: type[Component]
    at: str | None = None
    ends: tuple[str, str] | None = None
    voltage: str | None = None
    speed: str | None = None
    frequency: str | None = None
    wind: str | None = None
    wind_speed: str | None = None


@dataclass(frozen=True)
class Replacement:
    """A component for the place of a replaceable part. `tables`: readers of its tables from a file, by name."""

    kind: type[Component]
    tables: Mapping[str, Callable[[Path], TableData]] = field(default_factory=dict)


UNITS: Mapping[str, Unit] = MappingProxyType(
    {
        "Bus": Unit(Bus, at="terminal", voltage="voltage"),
        "ConstantPowerLoad": Unit(ConstantPowerLoad, at="terminal", voltage="voltage"),
        "Line": Unit(Line, ends=("sending", "receiving"), voltage="voltage"),
        "PmsgTurbine": Unit(PmsgTurbine, at="grid", voltage="voltage", wind="wind", wind_speed="wind_speed"),
        "StiffFrame": Unit(StiffFrame, speed="omega", frequency="frequency"),
        "StiffGrid": Unit(StiffGrid, at="terminal", voltage="voltage", speed="omega", frequency="frequency"),
        "SynchronousGenerator": Unit(
            SynchronousGenerator, at="terminal", voltage="voltage", speed="omega", frequency="frequency"
        ),
        "Transformer": Unit(Transformer, ends=("primary", "secondary")),
    }
)

PARTS: Mapping[str, Replacement] = MappingProxyType(
    {
        "ClassicalMachine": Replacement(ClassicalMachine),
        "ClosedFormRotor": Replacement(ClosedFormRotor),
        "ConstantField": Replacement(ConstantField),
        "CurtailmentSchedule": Replacement(CurtailmentSchedule),
        "Droop": Replacement(Droop),
        "DualPort": Replacement(DualPort),
        "FirstOrderGovernor": Replacement(FirstOrderGovernor),
        "FixedPoint": Replacement(FixedPoint),
        "GridFollowing": Replacement(GridFollowing),
        "Machine6": Replacement(Machine6),
        "OneMass": Replacement(OneMass),
        "Matching": Replacement(Matching),
        "SEXS": Replacement(SEXS),
        "TGOV1": Replacement(TGOV1),
        "TwoMass": Replacement(TwoMass),
        "TableRotor": Replacement(TableRotor, tables={"cp": read_cp_table}),
        "VirtualSynchronousMachine": Replacement(VirtualSynchronousMachine),
    }
)

# Short names for what is asked for most.
ALIASES: Mapping[str, str] = MappingProxyType({"nrel_5mw": "ClosedFormRotor"})


def component_types() -> dict[str, type[Component]]:
    """All registered component types by name, without the aliases."""
    kinds = {name: unit.kind for name, unit in UNITS.items()} | {name: part.kind for name, part in PARTS.items()}
    return dict(sorted(kinds.items()))


def find_unit(name: str) -> Unit:
    """The unit of that name; GF2012 if there is none."""
    if name not in UNITS:
        raise GustformError("GF2012", f"there is no unit of type {name!r}", hint=suggest(name, list(UNITS)))
    return UNITS[name]


def find_part(name: str, place: Part) -> Replacement:
    """The component of that name for the place of a part; GF2012 if there is none, GF1007 if it does not fit."""
    wanted = ALIASES.get(name, name)
    base = place.base or place.kind
    own = {kind.__name__: kind for kind in place.among}
    if wanted not in PARTS and wanted not in own:
        raise GustformError(
            "GF2012", f"there is no {base.__name__} of type {name!r}", hint=suggest(name, fitting_parts(place))
        )
    found = PARTS[wanted] if wanted in PARTS else Replacement(own[wanted])
    if not issubclass(found.kind, base):
        raise GustformError(
            "GF1007",
            f"{place.name} must be a {base.__name__} ({place.description}); got {name!r}",
            hint=suggest(name, fitting_parts(place)),
        )
    return found


def fitting_parts(place: Part) -> list[str]:
    """The names, aliases too, of what may stand in the place of a part."""
    base = place.base or place.kind
    names = [name for name, entry in PARTS.items() if issubclass(entry.kind, base)]
    return sorted([*names, *(alias for alias, name in ALIASES.items() if name in names)])
