"""The elastic drive train against the closed form of two masses on a spring, and as part of a turbine."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gustform.interfaces import Shaft
from gustform.language import Component, Parameter
from gustform.language.system import System
from gustform.mechanical.two_mass import TwoMass
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.build import build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import steady_state
from gustform_runtime import Simulation
from tests.physics import paper_system as mine


class Torque(Component):
    """A constant torque."""

    tau = Parameter("N*m", "torque that drives what is connected", default=0.0)
    shaft = Shaft("what is driven")

    def equations(self) -> None:
        self.eq(self.shaft.tau, -self.tau)


STEP = 1e6  # N m


def test_a_step_of_torque_swings_as_two_masses_on_a_spring(cache: KernelCache) -> None:
    drive = TwoMass(w=1.0)
    system = System()
    system.add("drive", drive)
    system.add("rotor", Torque())
    system.add("generator", Torque())
    system.connect("drive.rotor", "rotor.shaft")
    system.connect("drive.generator", "generator.shaft")
    system.change(1.0, "rotor.tau", STEP)
    linked = build(system, cache).linked
    channels, _ = linked.select(["drive.phi", "drive.w", "drive.w_rotor"])
    table = linked.table.with_channels(channels)
    table.start[[k for k in range(table.n_unknowns) if linked.unknown_name(k) == "drive.phi"]] = 0.0
    rows = []
    with Simulation(table.to_bytes()) as simulation:
        for name, value in (("rtol", 1e-8), ("atol", 1e-10)):
            simulation.set_option(name, value)
        simulation.set_sink(0.01, lambda t, values: rows.append((t, values)))
        simulation.initialise()
        simulation.advance(6.0)
    time = np.concatenate([t for t, _ in rows])
    phi, w, w_rotor = np.concatenate([values for _, values in rows]).astype(float).T
    # reduced mass m: m phi'' + D phi' + K phi = m STEP / J_r
    m = drive.J_r * drive.J_g / (drive.J_r + drive.J_g)
    decay, natural = drive.D / (2.0 * m), math.sqrt(drive.K / m)
    damped = math.sqrt(natural**2 - decay**2)
    assert 2.0 < natural / (2.0 * math.pi) < 2.4  # Hz: the torsional mode of the NREL 5 MW, free at both ends
    t = np.maximum(time - 1.0, 0.0)
    final = m * STEP / drive.J_r / drive.K
    expected = final * (1.0 - np.exp(-decay * t) * (np.cos(damped * t) + decay / damped * np.sin(damped * t)))
    np.testing.assert_allclose(phi, expected, atol=1e-5 * final)
    # together they speed up as one mass
    momentum = drive.J_r * w_rotor + drive.J_g * w
    np.testing.assert_allclose(momentum, (drive.J_r + drive.J_g) * 1.0 + STEP * t, rtol=1e-6)


def test_the_shaft_carries_the_power_of_the_turbine(cache: KernelCache) -> None:
    system = mine.paper_system(8.0)
    system.components["wt"] = PmsgTurbine(aggregate=10, wind_speed=8.0, curtailment=0.1, drive=TwoMass())
    linked = build(system, cache).linked
    steady = steady_state(linked)
    y = dict(zip([linked.unknown_name(k) for k in range(linked.table.n_unknowns)], steady.table.start, strict=True))
    stiff = PmsgTurbine(aggregate=10, wind_speed=8.0, curtailment=0.1)
    drive = TwoMass()
    assert y["wt.drive.w"] == pytest.approx(y["wt.drive.w_rotor"], rel=1e-9)
    assert y["wt.drive.phi"] * drive.K * y["wt.drive.w"] == pytest.approx(stiff.operating_point().power * 5e6, rel=1e-6)
