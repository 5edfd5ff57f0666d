"""The operating point looked up while the turbine runs: over wind speed and curtailment."""

from __future__ import annotations

import math
from functools import lru_cache

import casadi as ca
import numpy as np

from gustform.aero.cp_solver import CpSolver, cp_solver
from gustform.aero.rotor import Rotor
from gustform.aero.table_rotor import TableRotor
from gustform.control.curtailment_table import CurtailmentTable, curtailment_table
from gustform.control.operating_point import Limits
from gustform.control.schedule import OperatingSchedule
from gustform.control.wind_source import MeasuredWind, WindObserver, WindSource
from gustform.language import Parameter, Part, Table, Variable, minimum, table2
from gustform.language.table import TableData

WIND_STEP = 0.1  # m/s
# Of the root of the curtailment: a multiple of it is the root of 10 %, so that the paper's operating points are looked
# up without an interpolation.
ROOT_STEP = math.sqrt(0.1) / 9.0
ETAS = tuple(1.0 - (ROOT_STEP * k) ** 2 for k in reversed(range(19)))
CURTAILMENT_MAX = 0.4  # 1 - ETAS[0]


class CurtailmentSchedule(OperatingSchedule):
    """Operating point for the wind of the moment: the curtailment strategy with its look-up table.

        T_wind dv/dt = v_source - v                 v_source: measured, or from an observer of the rotor
        omega_del    = min(omega_table(v, sqrt(curtailment)), omega_max)
        beta_del     = beta_table(v, sqrt(curtailment))

    Power is held back by speed first, by pitch where the speed is at its limit; curtailment = 1 - eta, of the rated
    power above rated wind. It may be changed by an event; what the turbine computes from it, K_msc and K_p, changes
    with it.

    The tables are C2 splines through points of `control.curtailment_table`, 0.1 m/s and 19 curtailments from 0 to 40 %
    apart by equal steps of their root: near maximum power the speed follows the root of the curtailment, which is then
    no bend. Between the points they are off by up to 0.007 pu of speed, and by 0.3 deg and 0.4 % of rated power at the
    bend at rated wind; more where the pitch angle steps (see there), where it is 1.5 % of rated power.

    The machine-side converter makes the rotor follow omega_del, so dv/dt costs power: 2 H omega_r d(omega_del)/dt,
    0.15 pu for 0.1 m/s per s below rated wind. T_wind keeps turbulence off the power.

    Beside a sampled control the schedule is part of the exported controller, which then reads the wind: omega_del and
    beta_del are what that controller tells of them. With `location: outside` it stays in the equations, as one that the
    controller gets set points from.

    omega_del in pu of the turbine's base speed, beta_del in deg, wind in m/s. The tables default to those of the
    turbine's rotor and limits; limits of pitch and speed act behind this.
    Source: Lyu, Subotic, Gross 2022, IV-B, Fig. 4; observer: see WindObserver.
    """

    wind_source = Parameter(
        "1",
        "measured: the wind input, as from a lidar; estimated: from rotor speed, pitch and power",
        default="measured",
        structural=True,
        choices=("measured", "estimated"),
    )
    location = Parameter(
        "1",
        "controller: part of an exported or sampled controller; outside: that controller reads omega_del and beta_del",
        default="controller",
        structural=True,
        choices=("controller", "outside"),
    )
    sampled = Parameter("s", "sample period of the control; 0: in the equations", default=0.0, min=0.0, structural=True)
    curtailment = Parameter(
        "1", "share of the available power held back, 1 - eta", default=0.0, min=0.0, max=CURTAILMENT_MAX
    )
    T_wind = Parameter("s", "time constant of the filter of the wind speed", default=10.0, above=0.0)
    wind_point = Parameter("m/s", "first guess of the wind speed", default=8.0, above=0.0)
    omega_point = Parameter("pu", "first guess of the rotor speed", default=1.2, above=0.0)
    H = Parameter(
        "s", "inertia constant of rotor and generator at base speed, for the observer", default=4.605, above=0.0
    )
    v_tip = Parameter("m/s", "speed of the blade tips at base speed, for the observer", default=71.93, above=0.0)
    v_one = Parameter(
        "m/s", "wind speed that would give rated power with Cp = 1, for the observer", default=8.853, above=0.0
    )
    omega_max = Parameter("pu", "highest operating speed", default=1.2, above=0.0)
    omega_table = Table("m/s", "1", "pu", "rotor speed of wind speed and root of the curtailment, not yet limited")
    beta_table = Table("m/s", "1", "deg", "pitch angle of wind speed and root of the curtailment")
    cp = Table("1", "deg", "1", "power coefficient of tip speed ratio and pitch, for the observer")

    source = Part(
        MeasuredWind,
        "where the wind speed is known from",
        base=WindSource,
        select=lambda self: WindObserver if self.wind_source == "estimated" else MeasuredWind,
        among=(MeasuredWind, WindObserver),
        H=lambda self: self.H,
        v_tip=lambda self: self.v_tip,
        v_one=lambda self: self.v_one,
        cp=lambda self: self.table("cp"),
        v=lambda self: self.wind_point,
        x=lambda self: self.wind_point - self.source.gamma * self.omega_point,
    )
    v = Variable("m/s", "filtered wind speed", start=lambda self: self.wind_point, nominal=10.0)

    def held(self) -> tuple[str, ...]:
        return ("omega_del", "beta_del") if self.sampled > 0.0 and self.location == "controller" else ()

    def equations(self) -> None:
        source = self.source
        for name in ("wind", "omega_r", "beta", "P"):
            self.connect(getattr(source, name), getattr(self, name))
        self.eq(self.T_wind * self.der(self.v), source.v - self.v)
        root = ca.sqrt(self.curtailment)
        self.eq(self.omega_del, minimum(table2(self.omega_table, self.v, root), self.omega_max))
        self.eq(self.beta_del, table2(self.beta_table, self.v, root))


def default_table(rotor: Rotor, limits: Limits) -> CurtailmentTable:
    """The table that a schedule looks up unless it is given another one: cut-in to cut-out, 0 to 40 % curtailment."""
    steps = math.ceil((limits.cut_out - limits.cut_in) / WIND_STEP - 1e-9)
    winds = np.linspace(limits.cut_in, limits.cut_out, max(steps, 3) + 1)
    return curtailment_table(rotor, limits, [float(v) for v in winds], ETAS)


def speed_table(rotor: Rotor, limits: Limits) -> TableData:
    """omega_free of the default table, as a schedule takes it."""
    return _look_ups(default_table(rotor, limits))[0]


def pitch_table(rotor: Rotor, limits: Limits) -> TableData:
    """beta_del of the default table, as a schedule takes it."""
    return _look_ups(default_table(rotor, limits))[1]


@lru_cache(maxsize=64)
def _look_ups(table: CurtailmentTable) -> tuple[TableData, TableData]:
    root = np.sqrt(1.0 - table.eta[::-1])
    speed, pitch = np.ascontiguousarray(table.omega_free[:, ::-1]), np.ascontiguousarray(table.beta_del[:, ::-1])
    return (
        TableData(table.wind, root, speed, f"omega_free of {table.rotor}"),
        TableData(table.wind, root, pitch, f"beta_del of {table.rotor}"),
    )


def observer_table(rotor: Rotor) -> TableData:
    """The Cp of a rotor as its observer takes it: the rotor's own table, or its formula on a fine grid."""
    return rotor.table("cp") if isinstance(rotor, TableRotor) else _sampled(cp_solver(rotor))


@lru_cache(maxsize=64)
def _sampled(aero: CpSolver) -> TableData:
    ratio, pitch = np.linspace(*aero.ratios, 61), np.linspace(*aero.pitches, 49)
    ratios, pitches = np.meshgrid(ratio, pitch, indexing="ij")
    value = aero.values(ratios.ravel(), pitches.ravel()).reshape(ratios.shape)
    return TableData(ratio, pitch, value, f"Cp of {aero.name}")
