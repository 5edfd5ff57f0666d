"""Available power: what the wind offers at the best tip speed ratio, at most the rating; the reserve is the rest."""

from __future__ import annotations

import numpy as np

from gustform.turbines.pmsg_turbine import PmsgTurbine
from tests.support.case import open_case


def test_available_power_is_that_of_the_maximum_power_point() -> None:
    case = open_case("turbulent_10min", "run.until=60 s")
    turbine = case.assembled.system.components["wt"]
    assert isinstance(turbine, PmsgTurbine)
    names = ("wt.wind", "wt.P_available", "wt.P_reserve", "wt.P_wt", "wt.pitch.servo.rate", "wt.beta")
    times, rows, _ = case.run(names, 0.05)
    wind = rows["wt.wind"].astype(float)
    # The rotor's own table of the operating point, P_mpp = P v^3 Cp_max; float32 rows carry 1e-7.
    offered = np.minimum(turbine.rotor.power_per_cube() * turbine.cp_max() * wind**3 / turbine.rating, 1.0)
    assert np.max(np.abs(rows["wt.P_available"] - offered)) < 1e-6
    assert np.max(np.abs(rows["wt.P_reserve"] - (rows["wt.P_available"] - rows["wt.P_wt"]))) < 1e-6
    point = turbine.operating_point()
    at_point = min(turbine.rotor.power_per_cube() * turbine.cp_max() * point.wind**3 / turbine.rating, 1.0)
    assert abs(point.power - point.eta * at_point) < 1e-8, "the operating point holds back its share of the same power"
    # The rate is the derivative of the angle: its integral by the trapezoidal rule over 50 ms is the travel.
    travel = np.concatenate(
        [[0.0], np.cumsum(0.5 * (rows["wt.pitch.servo.rate"][1:] + rows["wt.pitch.servo.rate"][:-1]) * np.diff(times))]
    )
    assert np.max(np.abs(rows["wt.beta"] - rows["wt.beta"][0] - travel)) < 2e-3
