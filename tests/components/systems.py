"""Every registered component as an example, and each in a small system in which it can stand still."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gustform.aero.closed_form_rotor import ClosedFormRotor, polynomial
from gustform.aero.table_rotor import TableRotor
from gustform.control.curtailment_schedule import CurtailmentSchedule
from gustform.control.droop import Droop
from gustform.control.grid_following import GridFollowing
from gustform.control.matching import Matching
from gustform.control.virtual_synchronous_machine import VirtualSynchronousMachine
from gustform.electrical.bus import Bus
from gustform.electrical.constant_field import ConstantField
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.line import Line
from gustform.electrical.machine_classical import ClassicalMachine
from gustform.electrical.sexs import SEXS
from gustform.electrical.stiff_frame import StiffFrame
from gustform.electrical.stiff_grid import StiffGrid
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.electrical.transformer import Transformer
from gustform.language import Component
from gustform.language.system import Constant, System
from gustform.language.table import TableData
from gustform.mechanical.two_mass import TwoMass
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.catalogue import all_types

WIND = 9.0  # m/s: below rated, speed and pitch both off their limits


def sampled_table() -> TableData:
    """The closed-form Cp on a grid, so that a table rotor needs no file here."""
    ratio, pitch = np.linspace(0.7, 1.56, 30), np.linspace(0.0, 12.0, 25)
    value = 0.4897 * np.asarray(polynomial(ratio[:, None], pitch[None, :] / 10.0))
    return TableData(7.6857 * ratio, pitch, value, "closed form, sampled")


def example(name: str) -> Component:
    """The component of that name with whatever it cannot do without."""
    if name in VARIANTS:
        return VARIANTS[name]()
    kind = all_types()[name]
    if kind is TableRotor:
        return kind(cp=sampled_table())
    if kind is CurtailmentSchedule:  # a turbine gives it the tables of its own rotor
        turbine = PmsgTurbine(wind_speed=WIND, curtailment=0.1, schedule=CurtailmentSchedule(wind_source="estimated"))
        schedule = turbine.schedule
        return kind(
            wind_source="estimated",
            **{name: schedule.table(name) for name in ("omega_table", "beta_table", "cp")},
        )
    return kind()


def with_turbine(turbine: PmsgTurbine, frame: str = "grid.omega") -> System:
    """A turbine on a strong network."""
    s = System()
    s.add("grid", StiffGrid())
    s.add("bus", Bus())
    s.add("wt", turbine)
    s.connect("grid.terminal", "bus.terminal")
    s.connect("wt.grid", "bus.terminal")
    s.bind("wt.wind", Constant(WIND))
    if frame == "frame.omega":
        s.add("frame", StiffFrame())
    s.frame(frame)
    return s


def with_load() -> System:
    """A strong network and a load."""
    s = System()
    s.add("grid", StiffGrid())
    s.add("bus", Bus())
    s.add("load", ConstantPowerLoad(reactive=20e6))
    s.connect("grid.terminal", "bus.terminal")
    s.connect("load.terminal", "bus.terminal")
    return s


def with_line() -> System:
    """A load at the end of a line."""
    s = System()
    s.add("grid", StiffGrid())
    s.add("far", Bus())
    s.add("line", Line())
    s.add("load", ConstantPowerLoad(active=50e6, reactive=10e6))
    s.connect("grid.terminal", "line.sending")
    s.connect("line.receiving", "far.terminal")
    s.connect("load.terminal", "far.terminal")
    return s


def with_transformer() -> System:
    """A load behind a transformer."""
    s = System()
    s.add("grid", StiffGrid())
    s.add("low", Bus(voltage=11e3))
    s.add("transformer", Transformer(rating=80e6, voltage_primary=33e3, voltage_secondary=11e3, r=0.005, x=0.1))
    s.add("load", ConstantPowerLoad(voltage=11e3, active=50e6, reactive=10e6))
    s.connect("grid.terminal", "transformer.primary")
    s.connect("transformer.secondary", "low.terminal")
    s.connect("load.terminal", "low.terminal")
    return s


def with_generator(**parts: str | Component) -> System:
    """A power plant and its load."""
    s = System()
    s.add("sg", SynchronousGenerator(**parts))
    s.add("bus", Bus())
    s.add("load", ConstantPowerLoad(reactive=20e6))
    s.connect("sg.terminal", "bus.terminal")
    s.connect("load.terminal", "bus.terminal")
    s.frame("sg.omega")
    return s


def _turbine(**parameters: float | Component) -> PmsgTurbine:
    return PmsgTurbine(aggregate=10, wind_speed=WIND, curtailment=0.1, **parameters)


SYSTEMS: dict[str, Callable[[], System]] = {
    "Bus": with_load,
    "ClassicalMachine": lambda: with_generator(machine=ClassicalMachine()),
    "ClosedFormRotor": lambda: with_turbine(_turbine(rotor=ClosedFormRotor())),
    "ConstantField": lambda: with_generator(exciter=ConstantField()),
    "ConstantPowerLoad": with_load,
    "CurtailmentSchedule": lambda: with_turbine(_turbine(schedule=CurtailmentSchedule(wind_source="estimated"))),
    "Droop": lambda: with_turbine(_turbine(control=Droop())),
    "DualPort": lambda: with_turbine(_turbine()),
    "FirstOrderGovernor": lambda: with_generator(fidelity="lossless"),
    "FixedPoint": lambda: with_turbine(_turbine()),
    "GridFollowing": lambda: with_turbine(_turbine(control=GridFollowing())),
    "Line": with_line,
    "Machine6": with_generator,
    "Matching": lambda: with_turbine(_turbine(control=Matching())),
    "PmsgTurbine": lambda: with_turbine(_turbine()),
    "OneMass": lambda: with_turbine(_turbine()),
    "SEXS": with_generator,
    "StiffFrame": lambda: with_turbine(_turbine(), "frame.omega"),
    "StiffGrid": with_load,
    "SynchronousGenerator": with_generator,
    "TGOV1": with_generator,
    "TwoMass": lambda: with_turbine(_turbine(drive=TwoMass())),
    "TableRotor": lambda: with_turbine(_turbine(rotor=TableRotor(cp=sampled_table()))),
    "Transformer": with_transformer,
    "VirtualSynchronousMachine": lambda: with_turbine(_turbine(control=VirtualSynchronousMachine())),
}

# Units whose structure depends on a choice, as that choice makes them.
VARIANTS: dict[str, Callable[[], Component]] = {
    "PmsgTurbine, dq": lambda: PmsgTurbine(fidelity="dq"),
    "PmsgTurbine, dq with grid-following control": lambda: PmsgTurbine(fidelity="dq", control=GridFollowing()),
    "PmsgTurbine, lossless": lambda: PmsgTurbine(fidelity="lossless"),
    "SynchronousGenerator, lossless": lambda: SynchronousGenerator(fidelity="lossless"),
    "SynchronousGenerator, lossless with exciter": lambda: SynchronousGenerator(fidelity="lossless", exciter=SEXS()),
    "SynchronousGenerator, classical": lambda: SynchronousGenerator(machine=ClassicalMachine()),
}
