"""Machines, turbine-governor, exciter and drive train against closed forms."""

from __future__ import annotations

import cmath
import math
from typing import Any

import pytest

from gustform.electrical.constant_field import ConstantField
from gustform.electrical.dc_link import DcLink
from gustform.electrical.dq import DqImpedance
from gustform.electrical.first_order_governor import FirstOrderGovernor
from gustform.electrical.machine6 import Machine6
from gustform.electrical.machine_classical import ClassicalMachine
from gustform.electrical.msc import MachineSideConverter
from gustform.electrical.pmsg import Pmsg
from gustform.electrical.sexs import SEXS
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.electrical.tgov1 import TGOV1
from gustform.interfaces import DcPort, Shaft
from gustform.language import Component, GustformError, Input, Part
from gustform.mechanical.one_mass import OneMass
from tests.components.evaluate import evaluate

ROUND_OFF = 1e-12


def machine_at(power: complex, voltage: complex, **changes: float) -> dict[str, float]:
    """Machine6 at rest at a load, some values changed."""
    machine = Machine6()
    rest = machine.rest(power, voltage)
    v = voltage * cmath.exp(-1j * (rest.delta - cmath.pi / 2))
    given = {name: getattr(rest, name) for name in ("delta", "E1q", "E1d", "psi_1d", "psi_2q", "P_m", "E_fd")}
    given |= {"omega": 1.0, "frame": 1.0, "stator.vd": v.real, "stator.vq": v.imag}
    return evaluate(machine, given | changes)


@pytest.mark.parametrize("power", [0j, 0.4 + 0.1j, 0.9 - 0.3j])
def test_machine_at_rest_is_the_phasor_diagram(power: complex) -> None:
    voltage = cmath.rect(1.02, 0.1)
    found = machine_at(power, voltage)
    for name, value in found.items():
        if name.startswith("der("):
            assert value == pytest.approx(0.0, abs=1e-12), name
    # P and Q out of the machine, and the air-gap power above it by the stator losses
    i = complex(found["i_d"], found["i_q"])
    rest = Machine6().rest(power, voltage)
    v = voltage * cmath.exp(-1j * (rest.delta - cmath.pi / 2))
    assert v * i.conjugate() == pytest.approx(power, abs=1e-12)
    assert found["T_e"] == pytest.approx(power.real + 0.003 * abs(i) ** 2, abs=1e-12)
    assert found["V_t"] == pytest.approx(1.02, rel=ROUND_OFF)
    # the q axis is where E = V + (ra + j xq) I points
    assert rest.delta == pytest.approx(cmath.phase(voltage + complex(0.003, 1.76) * (power / voltage).conjugate()))


def test_field_voltage_of_one_gives_rated_voltage_at_no_load() -> None:
    assert Machine6().rest(0j, 1 + 0j).E_fd == pytest.approx(1.0, rel=ROUND_OFF)


def test_swing_is_the_power_that_is_missing() -> None:
    found = machine_at(0.5 + 0.1j, 1 + 0j, P_m=0.3)
    balanced = Machine6().rest(0.5 + 0.1j, 1 + 0j).P_m
    assert found["der(omega)"] == pytest.approx((0.3 - balanced) / (2.0 * 6.0), rel=1e-12)


def test_angle_follows_the_speed_against_the_frame() -> None:
    found = machine_at(0.5 + 0.1j, 1 + 0j, omega=1.01, frame=0.995)
    assert found["der(delta)"] == pytest.approx(2.0 * math.pi * 50.0 * 0.015, rel=1e-9)


def test_generator_transformer_is_a_reactance_between_machine_and_bus() -> None:
    generator = SynchronousGenerator()
    rest = generator.rest()
    assert rest.P_m == pytest.approx(0.4, abs=0.001)  # the guess, and stator losses of 0.003 x 0.17
    given = {f"machine.{name}": getattr(rest, name) for name in ("delta", "E1q", "E1d", "psi_1d", "psi_2q")}
    given |= {"machine.omega": 1.0, "frame": 1.0, "terminal.vr": 33e3, "terminal.vi": 0.0}
    given |= {"governor.valve": rest.P_m, "governor.reheater": rest.P_m, "exciter.E_fd": rest.E_fd}
    found = evaluate(generator, given | {"exciter.lead": rest.E_fd / 200.0})
    # the guess holds at the high-voltage side, behind the transformer
    assert found["P"] == pytest.approx(0.4 * 210e6, rel=1e-9)
    assert found["Q"] == pytest.approx(0.1 * 210e6, rel=1e-9)
    assert found["V_t"] == pytest.approx(abs(1.0 + 0.12j * complex(0.4, -0.1)), rel=1e-9)
    assert found["frequency"] == 50.0


def test_dq_impedance_is_a_complex_impedance() -> None:
    a, b = complex(0.1, 1.0), complex(0.2, 0.9)
    given = {"a.vd": a.real, "a.vq": a.imag, "b.vd": b.real, "b.vq": b.imag}
    found = evaluate(DqImpedance(r=0.01, x=0.2), given)
    i = (a - b) / complex(0.01, 0.2)
    assert complex(found["a.id"], found["a.iq"]) == pytest.approx(i, rel=ROUND_OFF)
    assert complex(found["b.id"], found["b.iq"]) == pytest.approx(-i, rel=ROUND_OFF)


# P_ref - (deviation less the dead band)/R, within the valve's limits
@pytest.mark.parametrize(
    ("omega", "order"),
    [(1.0, 0.4), (1.001, 0.4), (0.999, 0.4), (0.99, 0.4 + (0.01 - 0.00105) / 0.05), (1.01, 0.4 - 0.179), (0.9, 1.0),
     (1.1, 0.0)],
)  # fmt: skip
def test_governor_order(omega: float, order: float) -> None:
    found = evaluate(TGOV1(), {"omega": omega, "valve": 0.3, "reheater": 0.5}, {"P_ref": 0.4})
    assert found["der(valve)"] == pytest.approx((order - 0.3) / 0.3, abs=1e-12)
    assert found["der(reheater)"] == pytest.approx((0.3 - 0.5) / 7.4, rel=ROUND_OFF)
    assert found["P_m"] == pytest.approx(0.5 + 2.2 / 7.4 * (0.3 - 0.5), rel=ROUND_OFF)


@pytest.mark.parametrize(("V_t", "order"), [(1.0, 200.0 * (0.006 + 0.1 * 0.001)), (0.7, 5.0), (1.2, 0.0)])
def test_exciter_order_and_ceiling(V_t: float, order: float) -> None:
    found = evaluate(SEXS(), {"V_t": V_t, "lead": 0.006, "E_fd": 1.3}, {"V_ref": 1.007})
    assert found["der(E_fd)"] == pytest.approx((order - 1.3) / 0.05, rel=1e-9)
    assert found["der(lead)"] == pytest.approx((1.007 - V_t - 0.006) / 10.0, rel=1e-9)


@pytest.mark.parametrize("power", [0j, 0.4 + 0.1j, 0.9 - 0.3j])
@pytest.mark.parametrize("lossless", [False, True])
def test_classical_machine_is_a_voltage_behind_its_transient_reactance(power: complex, lossless: bool) -> None:
    machine, voltage = ClassicalMachine(lossless=lossless, ra=0.02, xd1=0.28), cmath.rect(1.02, 0.1)
    i = (power / voltage).conjugate()
    inner = voltage + complex(0.0 if lossless else 0.02, 0.28) * i
    rest = machine.rest(power, voltage)
    assert cmath.rect(rest.E, rest.delta) == pytest.approx(inner, rel=ROUND_OFF)
    v = voltage * cmath.exp(-1j * (rest.delta - cmath.pi / 2))
    given = {"omega": 1.0, "frame": 1.0, "delta": rest.delta, "P_m": rest.P_m, "E_fd": 0.0}
    found = evaluate(machine, given | {"stator.vd": v.real, "stator.vq": v.imag}, {"E": rest.E})
    assert v * complex(found["i_d"], found["i_q"]).conjugate() == pytest.approx(power, abs=1e-12)
    assert found["T_e"] == pytest.approx(power.real + (0.0 if lossless else 0.02) * abs(i) ** 2, abs=1e-12)
    assert found["T_e"] == pytest.approx((inner * i.conjugate()).real, abs=1e-12)
    assert found["der(omega)"] == pytest.approx(0.0, abs=1e-12)
    assert found["V_t"] == pytest.approx(1.02, rel=ROUND_OFF)


@pytest.mark.parametrize("machine", [Machine6(D=2.0), ClassicalMachine(D=2.0)])
def test_damping_is_power_for_speed_off_nominal(machine: Machine6 | ClassicalMachine) -> None:
    rest = machine.rest(0.5 + 0j, 1 + 0j)
    states = ("E1q", "E1d", "psi_1d", "psi_2q") if isinstance(machine, Machine6) else ()
    given = {name: getattr(rest, name) for name in ("delta", "P_m", "E_fd", *states)}
    v = cmath.exp(-1j * (rest.delta - cmath.pi / 2))
    given |= {"omega": 1.01, "frame": 1.0, "stator.vd": v.real, "stator.vq": v.imag}
    found = evaluate(machine, given, {"E": rest.E_fd} if not states else None)
    assert found["der(omega)"] == pytest.approx(-2.0 * 0.01 / (2.0 * 6.0 * 1.01), rel=1e-9)


@pytest.mark.parametrize(
    ("given", "wrong"),
    [({"xd1": 0.1}, "xd1 must be at least xd2 = 0.23"), ({"xl": 0.23}, "xd2 must be above xl = 0.23"),
     ({"xq": 0.6}, "xq must be at least xq1 = 0.65")],
)  # fmt: skip
def test_reactances_must_grow_from_the_leakage_to_the_synchronous_one(given: dict[str, float], wrong: str) -> None:
    with pytest.raises(GustformError, match=f"GF2061: machine.{wrong}"):
        SynchronousGenerator(machine=given).parameter_values()


@pytest.mark.parametrize(("omega", "P_m"), [(1.0, 0.4), (0.99, 0.4), (1.2, 0.0)])
def test_first_order_governor_is_the_papers(omega: float, P_m: float) -> None:
    # T_g dP_g/dt = -P_g - k_g omega_g in deviations, k_g = 1/R
    found = evaluate(FirstOrderGovernor(droop=0.04, T=3.0), {"omega": omega, "P_m": P_m}, {"P_ref": 0.4})
    assert found["der(P_m)"] == pytest.approx((-(P_m - 0.4) - 25.0 * (omega - 1.0)) / 3.0, rel=1e-12, abs=1e-15)


def test_constant_field_is_constant() -> None:
    assert evaluate(ConstantField(), {"V_t": 0.7}, {"E_ref": 1.8})["E_fd"] == 1.8


def kinds(generator: SynchronousGenerator) -> list[str]:
    return [type(generator.part(name)).__name__ for name in ("machine", "governor", "exciter")]


# What fidelity chooses, and what is given instead: a part, or parameters that one of the models only has.
@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, ["Machine6", "TGOV1", "SEXS"]),
        ({"fidelity": "dq"}, ["Machine6", "TGOV1", "SEXS"]),
        ({"fidelity": "lossless"}, ["ClassicalMachine", "FirstOrderGovernor", "ConstantField"]),
        ({"fidelity": "lossless", "machine": {"H": 8.0}, "governor": {"droop": 0.04}, "exciter": {"V_start": 1.01}},
         ["ClassicalMachine", "FirstOrderGovernor", "ConstantField"]),
        ({"fidelity": "lossless", "machine": Machine6()}, ["Machine6", "FirstOrderGovernor", "SEXS"]),
        ({"fidelity": "lossless", "machine": {"xd": 1.9}}, ["Machine6", "FirstOrderGovernor", "SEXS"]),
        ({"fidelity": "lossless", "governor": TGOV1()}, ["ClassicalMachine", "TGOV1", "ConstantField"]),
        ({"fidelity": "lossless", "governor": {"T1": 0.2}}, ["ClassicalMachine", "TGOV1", "ConstantField"]),
        ({"fidelity": "lossless", "exciter": SEXS()}, ["Machine6", "FirstOrderGovernor", "SEXS"]),
        ({"fidelity": "lossless", "exciter": {"K": 100.0}}, ["Machine6", "FirstOrderGovernor", "SEXS"]),
        ({"machine": ClassicalMachine()}, ["ClassicalMachine", "TGOV1", "ConstantField"]),
        ({"exciter": ConstantField()}, ["Machine6", "TGOV1", "ConstantField"]),
    ],
)  # fmt: skip
def test_fidelity_chooses_what_is_not_given(given: dict[str, Any], expected: list[str]) -> None:
    generator = SynchronousGenerator(**given)
    assert kinds(generator) == expected
    generator.parameter_values()  # everything given has a place there
    # a changed parameter leaves the parts what they are
    assert kinds(generator.with_value("governor.droop", 0.06)) == expected


def test_lossless_leaves_out_every_resistance_that_is_given() -> None:
    given: dict[str, Any] = {"machine": {"ra": 0.01}, "transformer": {"r": 0.02}}
    losses = []
    for fidelity in ("rms", "lossless"):
        rest = SynchronousGenerator(fidelity=fidelity, P_start=0.5, Q_start=0.0, **given).rest()
        losses.append(rest.P_m - 0.5)
    assert losses == pytest.approx([0.03 * 0.25, 0.0], abs=1e-15)


def test_exciter_without_effect_is_refused() -> None:
    with pytest.raises(GustformError, match=r"GF2060: exciter must be ConstantField.*got SEXS.*try machine: Machine6"):
        SynchronousGenerator(machine=ClassicalMachine(), exciter=SEXS())
    SynchronousGenerator(machine=ClassicalMachine(), exciter=ConstantField(V_start=1.02))


@pytest.mark.parametrize("rho", [-0.3, 0.0, 0.2, 0.7])
def test_pmsg_transports_power_by_its_angle(rho: float) -> None:
    V, omega = 0.95, 1.1
    given = {"terminal.vr": V * 3.3e3, "terminal.vi": 0.0, "shaft.w": omega * 1.1417, "rho": rho, "frame": 1.05}
    found = evaluate(Pmsg(), given)
    E, X = omega / 1.2, 0.4 * omega / 1.2
    assert found["P"] == pytest.approx(5e6 * E * V / X * math.sin(rho), rel=1e-9, abs=1e-6)
    i = complex(found["terminal.ir"], found["terminal.ii"]) * 3.3e3 / 5e6
    assert i == pytest.approx(-(cmath.rect(E, rho) - V) / (1j * X), rel=1e-9)
    assert found["shaft.tau"] == pytest.approx(found["P"] / (omega * 1.1417), rel=1e-9, abs=1e-6)
    assert found["der(rho)"] == pytest.approx(100.0 * 1.1417 * (omega - 1.05), rel=1e-9)


class MachineSide(Component):
    """PMSG and MSC."""

    dc = DcPort("DC link")
    shaft = Shaft("rotor")
    V = Input("pu", "MSC voltage")
    omega = Input("pu", "MSC frequency")
    pmsg = Part(Pmsg, "machine")
    msc = Part(MachineSideConverter, "converter")

    def equations(self) -> None:
        self.connect(self.pmsg.terminal, self.msc.machine)
        self.connect(self.pmsg.shaft, self.shaft)
        self.connect(self.msc.dc, self.dc)
        self.connect(self.msc.V, self.V)
        self.connect(self.pmsg.frame, self.omega)


def test_converter_on_its_machine_is_the_form_of_the_reference() -> None:
    V, omega, rho = 0.96, 1.15, 0.14
    E, X = omega / 1.2, 0.4 * omega / 1.2
    given = {"dc.v": 7900.0, "shaft.w": omega * 1.1417, "V": V, "omega": 1.15, "pmsg.rho": rho}
    found = evaluate(MachineSide(), given)
    P = E * V / X * math.sin(rho)
    assert found["msc.P"] == pytest.approx(5e6 * P, rel=1e-9)
    assert found["msc.Q"] == pytest.approx(5e6 * (V * V - E * V * math.cos(rho)) / X, rel=1e-9)
    assert found["dc.i"] == pytest.approx(-5e6 * P / 7900.0, rel=1e-9)
    assert found["shaft.tau"] == pytest.approx(5e6 * P / (omega * 1.1417), rel=1e-9)


def test_time_constants_of_dc_link_and_drive_train() -> None:
    assert pytest.approx(0.400, abs=5e-4) == DcLink().C * 7920.0**2 / 5e6  # s, tau_dc of the project notes
    assert pytest.approx(4.605, abs=5e-4) == OneMass().J * 1.1417**2 / 2.0 / 5e6  # s, H_wt of the project notes
