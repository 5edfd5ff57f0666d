"""Network components against phasor arithmetic."""

from __future__ import annotations

import cmath

import pytest

from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.gsc import GridSideConverter
from gustform.electrical.line import Line
from gustform.electrical.parallel_units import ParallelUnits
from gustform.electrical.stiff_frame import StiffFrame
from gustform.electrical.stiff_grid import StiffGrid
from gustform.electrical.transformer import Transformer
from gustform.interfaces import AcPort
from gustform.language import Component, Part
from tests.components.evaluate import evaluate

ROUND_OFF = 1e-12


def port(name: str, v: complex) -> dict[str, float]:
    return {f"{name}.vr": v.real, f"{name}.vi": v.imag}


def current(found: dict[str, float], name: str) -> complex:
    return complex(found[f"{name}.ir"], found[f"{name}.ii"])


def test_bus_shows_its_voltage_and_takes_nothing() -> None:
    found = evaluate(Bus(voltage=20e3), port("terminal", cmath.rect(21e3, 0.3)))
    assert found["V"] == pytest.approx(1.05, rel=ROUND_OFF)
    assert current(found, "terminal") == 0


def test_line_carries_the_current_of_its_impedance() -> None:
    a, b = cmath.rect(33e3, 0.1), cmath.rect(32e3, 0.0)
    found = evaluate(Line(R=0.5, X=2.0), port("sending", a) | port("receiving", b))
    i = (a - b) / complex(0.5, 2.0)
    assert current(found, "sending") == pytest.approx(i, rel=ROUND_OFF)
    assert current(found, "receiving") == pytest.approx(-i, rel=ROUND_OFF)
    # and a lossless line transports V1 V2 / X sin(delta)
    lossless = evaluate(Line(R=0.0, X=2.0), port("sending", a) | port("receiving", b))
    P = (a * current(lossless, "sending").conjugate()).real
    assert pytest.approx(33e3 * 32e3 / 2.0 * cmath.sin(0.1).real, rel=ROUND_OFF) == P


def test_transformer_has_its_ratio_and_impedance() -> None:
    t = Transformer(rating=10e6, voltage_primary=3e3, voltage_secondary=30e3, r=0.01, x=0.08)
    a, b = cmath.rect(3.1e3, 0.05), cmath.rect(29e3, -0.02)
    found = evaluate(t, port("primary", a) | port("secondary", b))
    i = (10.0 * a - b) / (complex(0.01, 0.08) * 30e3**2 / 10e6)
    assert current(found, "secondary") == pytest.approx(-i, rel=ROUND_OFF)
    assert current(found, "primary") == pytest.approx(10.0 * i, rel=ROUND_OFF)
    # what goes in and does not come out is R I^2
    loss = (a * current(found, "primary").conjugate() + b * current(found, "secondary").conjugate()).real
    assert loss == pytest.approx(0.01 * 30e3**2 / 10e6 * abs(i) ** 2, rel=1e-9)


class SevenGrids(Component):
    """Seven identical sources, of which one is modelled."""

    terminal = AcPort("all of them")
    grid = Part(StiffGrid, "one of them", E=1.02)
    units = Part(ParallelUnits, "seven in parallel", n=7.0)

    def equations(self) -> None:
        self.connect(self.grid.terminal, self.units.one)
        self.connect(self.units.all, self.terminal)


def test_parallel_units_multiply_the_current() -> None:
    v = cmath.rect(32e3, -0.1)
    one, seven = evaluate(StiffGrid(E=1.02), port("terminal", v)), evaluate(SevenGrids(), port("terminal", v))
    assert current(seven, "terminal") == pytest.approx(7.0 * current(one, "terminal"), rel=ROUND_OFF)


@pytest.mark.parametrize("V", [1.05, 0.9, 0.7])
def test_load_takes_constant_power_at_usual_voltage(V: float) -> None:
    load = ConstantPowerLoad(voltage=33e3, active=30e6, reactive=7e6, aggregate=2)
    v = cmath.rect(V * 33e3, 0.4)
    found = evaluate(load, port("terminal", v))
    assert v * current(found, "terminal").conjugate() == pytest.approx(complex(60e6, 14e6), rel=ROUND_OFF)
    assert (found["P"], found["Q"], found["V"]) == pytest.approx((60e6, 14e6, V), rel=ROUND_OFF)


@pytest.mark.parametrize("V", [0.69, 0.3, 0.0])
def test_load_is_an_impedance_at_low_voltage(V: float) -> None:
    load = ConstantPowerLoad(voltage=33e3, active=30e6, reactive=7e6)
    v = cmath.rect(V * 33e3, 0.4)
    found = evaluate(load, port("terminal", v))
    share = (V / 0.7) ** 2  # of the power at the threshold of 0.7 pu
    assert complex(found["P"], found["Q"]) == pytest.approx(share * complex(30e6, 7e6), rel=ROUND_OFF, abs=1e-6)


def test_stiff_grid_is_a_source_behind_its_impedance() -> None:
    v = cmath.rect(32e3, -0.1)
    found = evaluate(StiffGrid(rating=500e6, r=0.1, x=0.9, E=1.02), port("terminal", v))
    i = (1.02 * 33e3 - v) / (complex(0.1, 0.9) * 33e3**2 / 500e6)
    assert current(found, "terminal") == pytest.approx(-i, rel=ROUND_OFF)
    assert complex(found["P"], found["Q"]) == pytest.approx(v * i.conjugate(), rel=ROUND_OFF)
    assert (found["omega"], found["frequency"]) == (1.0, 50.0)


def test_stiff_frame_turns_at_its_speed() -> None:
    found = evaluate(StiffFrame(speed=0.99, f0=60.0), {})
    assert (found["omega"], found["frequency"]) == pytest.approx((0.99, 59.4), rel=ROUND_OFF)


def test_grid_side_converter_is_a_voltage_behind_its_filter() -> None:
    v, e = cmath.rect(3.2e3, 0.02), cmath.rect(1.01 * 3.3e3, 0.15)
    given = port("grid", v) | {"V": 1.01, "omega": 1.002, "frame": 0.998, "theta": 0.15, "dc.v": 8000.0, "blocked": 0.0}
    found = evaluate(GridSideConverter(), given)
    i = (e - v) / (complex(0.01, 0.1) * 3.3e3**2 / 5e6)
    assert current(found, "grid") == pytest.approx(-i, rel=ROUND_OFF)
    assert complex(found["P"], found["Q"]) == pytest.approx(e * i.conjugate(), rel=ROUND_OFF)
    assert found["dc.i"] == pytest.approx(found["P"] / 8000.0, rel=ROUND_OFF)
    assert found["der(theta)"] == pytest.approx(2.0 * cmath.pi * 50.0 * 0.004, rel=1e-9)
