"""Converters at dq on a bench: step responses against a model written by hand in complex numbers, and closed forms."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from gustform.electrical.gsc_current_dq import GridSideCurrentDq
from gustform.electrical.gsc_dq import GridSideDq
from gustform.electrical.gsc_voltage_dq import GridSideVoltageDq
from gustform.electrical.msc_dq import MachineSideDq
from gustform.electrical.msc_power_dq import MachineSidePowerDq
from gustform.electrical.msc_voltage_dq import MachineSideVoltageDq
from gustform.electrical.pmsg_dq import PmsgDq
from gustform.electrical.transformer_dq import TransformerDq
from gustform.interfaces import AcPort, DcPort, Shaft
from gustform.language import Component, Parameter, Part, Variable
from gustform.language.system import System
from gustform_codegen.cache import KernelCache
from tests.physics.running import ready

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

W0 = 100.0 * math.pi  # rad/s
# project notes and Table I, pu; the last holds the angle of the bench's frame, pu/rad
X, R, B, X_T = 0.1, 0.01, 0.0499, 0.06
K_FF, K_PV, K_IV, K_PC, K_IC, T_FF = 0.9, 1.0, 100.0, 1.27, 14.3, 0.001
K_ANGLE = 0.02
# machine: pu, at the bench's speed
PSI, L, R_S, R_V, OMEGA = 1.0 / 1.2, 0.4 / 1.2, 0.01, 0.05, 1.16
STEP = 0.01  # s
AFTER = STEP + np.geomspace(1e-5, 0.3, 40)


class DcSource(Component):
    """A stiff DC link."""

    voltage = Parameter("V", "voltage", default=7920.0)
    port = DcPort("terminals")

    def equations(self) -> None:
        self.eq(self.port.v, self.voltage)


class AcSource(Component):
    """A stiff grid."""

    voltage = Parameter("V", "voltage", default=33e3)
    port = AcPort("terminals")

    def equations(self) -> None:
        self.eq(self.port.vr, self.voltage)
        self.eq(self.port.vi, 0)


class Drive(Component):
    """A shaft at constant speed."""

    w = Parameter("1/s", "speed, rad/s", default=OMEGA * 1.1417)
    port = Shaft("shaft")

    def equations(self) -> None:
        self.eq(self.port.w, self.w)


class GridBench(Component):
    """A grid side between a stiff DC link and a stiff grid; its angle is pulled to theta_0."""

    theta_0 = Parameter("rad", "angle of the converter's frame in a steady state", default=0.1)
    ac = Part(AcSource, "grid")
    dc = Part(DcSource, "DC link")
    transformer = Part(TransformerDq, "transformer to the stiff grid")

    def close(self, gsc: GridSideDq) -> None:
        self.connect(gsc.grid, self.transformer.primary)
        self.connect(self.transformer.secondary, self.ac.port)
        self.connect(gsc.dc, self.dc.port)
        self.eq(gsc.frame, 1.0)
        self.eq(gsc.omega, 1.0 + K_ANGLE * (self.theta_0 - gsc.theta))
        self.eq(gsc.blocked, 0.0)


class VoltageBench(GridBench):
    """A grid side that imposes a voltage."""

    V = Parameter("pu", "voltage imposed", default=1.0)
    gsc = Part(GridSideVoltageDq, "converter")

    def equations(self) -> None:
        self.close(self.gsc)
        self.eq(self.gsc.V, self.V)


class CurrentBench(GridBench):
    """A grid side that imposes a current."""

    i_d = Parameter("pu", "current imposed", default=0.5)
    gsc = Part(GridSideCurrentDq, "converter")

    def equations(self) -> None:
        self.close(self.gsc)
        self.eq(self.gsc.i_d_ref, self.i_d)
        self.eq(self.gsc.i_q_ref, -0.1)


def by_hand(
    V: Callable[[float], float] | None, i_d: Callable[[float], float] | None
) -> Callable[[float, Array], Array]:
    """The bench in complex numbers, pu: theta, filter current, capacitor, feed-forward, integrators, grid current."""

    def rates(t: float, x: Array) -> Array:
        theta = x[0]
        i, v, v_f, I_v, I_c, i_grid = x[1::2] + 1j * x[2::2]
        omega = 1.0 + K_ANGLE * (0.1 - theta)
        i_g = i_grid * cmath.exp(-1j * theta)
        eps = 0j
        if V is not None:
            eps = V(t) - (R + 1j * X) * i_g - v
            reference = K_FF * i_g + 1j * omega * B * v + K_PV * eps + I_v
        else:
            assert i_d is not None
            reference = i_d(t) - 0.1j
        e = v_f + 1j * omega * X * i + K_PC * (reference - i) + I_c
        rest = np.array(
            [
                W0 / X * (e - v - (R + 1j * omega * X) * i),
                W0 / B * (i - i_g - 1j * omega * B * v),
                (v - v_f) / T_FF,
                K_IV * eps,
                K_IC * (reference - i),
                W0 / X_T * (v * cmath.exp(1j * theta) - 1.0 - 1j * X_T * i_grid),
            ]
        )
        return np.concatenate([[W0 * (omega - 1.0)], rest.view(float)])

    return rates


NAMES = ["gsc.theta"]
NAMES += [f"gsc.{n}{a}" for n in ("i_f", "v_", "feed_forward.v_f", "capacitor.I_", "current.I_") for a in "dq"]
NAMES += ["transformer.i_r", "transformer.i_i"]


@pytest.mark.parametrize("imposes", ["voltage", "current"])
def test_step_responses_of_the_grid_side(imposes: str, cache: KernelCache) -> None:
    s = System()
    voltage = imposes == "voltage"
    s.add("b", VoltageBench() if voltage else CurrentBench())
    s.change(STEP, "b.V" if voltage else "b.i_d", 1.05 if voltage else 0.7)
    start = ready(s, cache)
    names = [f"b.{n}" for n in NAMES]
    states = [n for n in names if n in start.numbers]
    assert len(states) == start.table.n_unknowns == (13 if voltage else 11)
    base = np.array([5e6 / 33e3 if "transformer" in n else 1.0 for n in states])
    place = np.array([names.index(n) for n in states])  # where a current is imposed there is no integrator of a voltage
    x0 = np.zeros(len(names))
    x0[place] = start.table.start[[start.numbers[n] for n in states]] / base
    rates = by_hand(
        (lambda t: 1.0 if t < STEP else 1.05) if voltage else None, (lambda t: 0.5 if t < STEP else 0.7)
    )  # fmt: skip
    assert np.max(np.abs(rates(0.0, x0))) < 1e-6  # /s, of pu: the same steady state
    run = start.follow([], AFTER, rtol=1e-9)["y"][:, [start.numbers[n] for n in states]] / base
    hand = solve_ivp(rates, (STEP, AFTER[-1]), x0, "Radau", t_eval=AFTER, rtol=1e-10, atol=1e-12).y.T[:, place]
    assert np.max(np.abs(hand - x0[place])) > 0.05  # it moves
    np.testing.assert_allclose(run, hand, atol=1e-7)  # 100 x rtol of 1 pu, for the error summed up over the ringing
    if voltage:  # the capacitor stands at V behind the virtual impedance again, and the current has settled
        i_g = complex(*run[-1, -2:]) * cmath.exp(-1j * run[-1, 0])
        v = complex(*run[-1, 3:5])
        assert abs(1.05 - (R + 1j * X) * i_g - v) < 1e-3
    else:  # what is imposed flows; the integrator's last bit, of k_i/k_p = 11 /s, is not quite over
        assert abs(complex(*run[-1, 1:3]) - (0.7 - 0.1j)) < 1e-3


class MachineBench(Component):
    """A machine at constant speed and its converter."""

    drive = Part(Drive, "shaft")
    dc = Part(DcSource, "DC link")
    pmsg = Part(PmsgDq, "machine", stator_dynamics=True)
    omega = Variable("pu", "speed", start=OMEGA)

    def close(self, msc: MachineSideDq) -> None:
        self.connect(self.pmsg.shaft, self.drive.port)
        self.connect(self.omega, self.pmsg.omega)
        self.connect(self.pmsg.terminal, msc.machine)
        self.connect(msc.dc, self.dc.port)
        self.eq(msc.blocked, 0.0)
        self.connect(msc.omega_r, self.omega)


class PowerBench(MachineBench):
    """A machine side that imposes a power."""

    P = Parameter("pu", "power", default=0.5)
    msc = Part(MachineSidePowerDq, "converter")

    def equations(self) -> None:
        self.close(self.msc)
        self.eq(self.msc.P_ref, self.P)


class MachineVoltageBench(MachineBench):
    """A machine side that imposes a voltage, which follows the EMF at rho_0."""

    V = Parameter("pu", "voltage", default=0.9)
    rho_0 = Parameter("rad", "angle of the EMF ahead of the voltage", default=0.25)
    msc = Part(MachineSideVoltageDq, "converter")

    def equations(self) -> None:
        self.close(self.msc)
        self.eq(self.msc.V, self.V)
        self.eq(self.msc.omega, self.omega + 0.1 * (self.msc.rho - self.rho_0))


def admittance_current(V: float, rho: float) -> complex:
    """Current out of the machine, d + jq, between its EMF and V at rho behind it, through r_v + j omega L."""
    return (1j * PSI * OMEGA - V * cmath.exp(1j * (math.pi / 2 - rho))) / (R_V + 1j * OMEGA * L)


def stator_current(system: System, cache: KernelCache) -> tuple[complex, Complex]:
    """Before the step and after it."""
    start = ready(system, cache)
    columns = [start.numbers["b.pmsg.i_d"], start.numbers["b.pmsg.i_q"]]
    run = start.follow([], AFTER, rtol=1e-9)["y"][:, columns]
    return complex(*start.table.start[columns]), run[:, 0] + 1j * run[:, 1]


# Gains by internal model control: a lag of 2 ms without coupling of the axes.
LAG = np.exp(-(AFTER - STEP) / 0.002)


def test_torque_current_follows_a_step_as_a_lag_of_2_ms(cache: KernelCache) -> None:
    s = System()
    s.add("b", PowerBench())
    s.change(STEP, "b.P", 0.8)
    before, after = stator_current(s, cache)
    first, last = 1j * 0.5 / (PSI * OMEGA), 1j * 0.8 / (PSI * OMEGA)
    assert before == pytest.approx(first, abs=1e-9)
    np.testing.assert_allclose(after, last + (first - last) * LAG, atol=1e-8)


def test_virtual_admittance_gives_the_current_with_a_lag_of_2_ms(cache: KernelCache) -> None:
    s = System()
    s.add("b", MachineVoltageBench())
    s.change(STEP, "b.V", 0.95)
    before, after = stator_current(s, cache)
    first, last = admittance_current(0.9, 0.25), admittance_current(0.95, 0.25)
    assert before == pytest.approx(first, abs=1e-9)
    np.testing.assert_allclose(after, last + (first - last) * LAG, atol=1e-8)
    # with r_v = 0 the power into the virtual voltage is that of phasors, psi V/L sin(rho)
    power = (0.9 * cmath.exp(1j * (math.pi / 2 - 0.25)) * first.conjugate()).real
    assert power == pytest.approx(PSI * 0.9 / L * math.sin(0.25), rel=0.05)
