"""The paper's test system out of library components, and the map between it and the hand-written reference."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.language.system import Constant, System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.evaluate import TypeEvaluator
from gustform_codegen.link import Linked
from gustform_codegen.table import SystemTable
from tests.reference import paper_rms as ref

Array = NDArray[np.float64]

V_BUS = 33e3  # V
# Reference state or bus voltage -> unknown of the linked system and the value of 1 (pu, rad, deg) in its unit.
UNKNOWNS: dict[str, tuple[str, float]] = {
    "sg.w": ("sg.machine.omega", 1.0),
    "sg.Eq1": ("sg.machine.E1q", 1.0),
    "sg.Ed1": ("sg.machine.E1d", 1.0),
    "sg.psi1d": ("sg.machine.psi_1d", 1.0),
    "sg.psi2q": ("sg.machine.psi_2q", 1.0),
    "gov.valve": ("sg.governor.valve", 1.0),
    "gov.lag": ("sg.governor.reheater", 1.0),
    "avr.lead": ("sg.exciter.lead", 1.0),
    "avr.Efd": ("sg.exciter.E_fd", 1.0),
    "wt.omega_r": ("wt.drive.w", ref.OMEGA_BASE),
    "wt.rho": ("wt.pmsg.rho", 1.0),
    "wt.v_dc": ("wt.dc_link.v", 7920.0),
    "gsc.xi": ("wt.control.gsc.xi", 1.0),
    "msc.xi": ("wt.control.msc.xi", 1.0),
    "gsc.theta": ("wt.gsc.theta", 1.0),
    "gsc.Qf": ("wt.control.gsc.Q_filtered", 1.0),
    "msc.Qf": ("wt.control.msc.Q_filtered", 1.0),
    "pitch.beta": ("wt.pitch.servo.beta", 1.0),
    "pitch.Pf": ("wt.pitch.P_filtered", 1.0),
    "pitch.I_speed": ("wt.pitch.speed_limiter.integral", 1.0),
    "pitch.I_power": ("wt.pitch.power_limiter.integral", 1.0),
    "vr": ("bus.terminal.vr", V_BUS),
    "vi": ("bus.terminal.vi", V_BUS),
}


def paper_system(wind: float, curtailment: float = 0.1) -> System:
    """One 210 MVA generator, ten turbines as one, 100 MW + j5 Mvar, 20 MW more at 30 s."""
    s = System()
    s.add("bus", Bus(voltage=V_BUS))
    s.add("sg", SynchronousGenerator(rating=ref.S_SG))
    s.add("wt", PmsgTurbine(aggregate=10, wind_speed=wind, curtailment=curtailment))
    s.add("load", ConstantPowerLoad(active=ref.LOAD_P, reactive=ref.LOAD_Q))
    for port in ("sg.terminal", "wt.grid", "load.terminal"):
        s.connect(port, "bus.terminal")
    s.frame("sg.omega")
    s.bind("wt.wind", Constant(wind))
    s.change(ref.T_STEP, "load.active", ref.LOAD_P + ref.LOAD_STEP)
    return s


def unknown_numbers(linked: Linked) -> dict[str, int]:
    """Global unknown by name."""
    return {linked.unknown_name(k): k for k in range(linked.table.n_unknowns)}


def with_parameters(linked: Linked, table: SystemTable, values: dict[str, float]) -> None:
    """Put other numbers for parameters ("sg.governor.P_ref") into the table, in place."""
    for path, value in values.items():
        name, _, rest = path.partition(".")
        number, k = linked.index_of[name]
        j = [p.path for p in linked.types[number].unit.parameters].index(rest)
        table.types[number].parameters[k, j] = value


def residual(linked: Linked, table: SystemTable, y: Array, yp: Array) -> Array:
    """The residual of the linked system by CasADi's own evaluation of each type."""
    result = np.zeros(table.n_unknowns)
    for t, arrays in zip(linked.types, table.types, strict=True):
        own = arrays.first_unknown[:, None] + np.arange(len(t.unit.unknowns))
        inputs = arrays.first_input[:, None] + np.arange(len(t.unit.inputs))
        values = TypeEvaluator(t.unit).residual(
            y[own].T,
            yp[own].T,
            y[arrays.external].T,
            table.input_value[inputs].T,
            arrays.discrete.T,
            arrays.parameters.T,
        )
        rows = np.concatenate([own, arrays.flow_row], axis=1).T
        np.add.at(result, rows, values[: rows.shape[0]])
    return result


def from_reference(linked: Linked, dae: ref.FlatDae, x: Array, z: Array, delta: float) -> Array:
    """The reference's state as unknowns of the linked system, in the frame in which the rotor stands at `delta`."""
    numbers = unknown_numbers(linked)
    y = np.zeros(linked.table.n_unknowns)
    turn = np.exp(1j * (delta - dae.start.delta))
    v = complex(z[0], z[1]) * turn
    values: dict[str, Any] = dict(zip(dae.x_names, x, strict=True)) | {"vr": v.real, "vi": v.imag}
    values["gsc.theta"] += delta - dae.start.delta
    for name, (path, scale) in UNKNOWNS.items():
        y[numbers[path]] = scale * values[name]
    y[numbers["sg.machine.delta"]] = delta
    return y
