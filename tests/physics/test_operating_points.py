"""Operating points and gains against the reference and the paper's tables; what cannot be is refused by name."""

from __future__ import annotations

import pytest

from gustform.aero.table_rotor import TableRotor
from gustform.language.errors import GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine
from tests.components.systems import sampled_table
from tests.reference import paper_rms as ref

POINT = ("omega_mpp", "omega_del", "beta_mpp", "beta_del", "power", "K_wr", "K_beta")
GAINS = ("K_msc", "K_p", "m_p")


def turbine(wind: float, curtailment: float = 0.1) -> PmsgTurbine:
    return PmsgTurbine(wind_speed=wind, curtailment=curtailment)


@pytest.mark.parametrize("curtailment", [0.05, 0.1, 0.2])
@pytest.mark.parametrize("wind", [5.0, 8.0, 10.0, 11.0, 12.0, 13.0])
def test_equals_the_reference(wind: float, curtailment: float) -> None:
    mine, point = turbine(wind, curtailment), ref.operating_point(wind, 1.0 - curtailment)
    # Ipopt finds the flat top of Cp to about 1e-10; the reference has it in closed form
    for name in POINT:
        assert getattr(mine.operating_point(), name) == pytest.approx(getattr(point, name), rel=1e-7, abs=1e-9), name
    for name in GAINS:
        assert getattr(mine.gains(), name) == pytest.approx(getattr(point, name), rel=1e-7, abs=1e-9), name
    assert mine.operating_point().rated_wind == pytest.approx(ref.WIND_RATED, rel=1e-9)


# tolerance: half a unit of the last published digit, or 1 % for K_p (the paper computes it from rounded values)
@pytest.mark.parametrize(
    ("wind", "name", "published", "tolerance"),
    [
        (8.0, "omega_del", 1.16, 0.005), (10.0, "omega_del", 1.2, 1e-12), (12.0, "omega_del", 1.2, 1e-12),
        (8.0, "beta_del", 0.0, 1e-12), (10.0, "beta_del", 3.0, 0.05), (12.0, "beta_del", 5.4, 0.05),
        (8.0, "K_msc", 15.1, 0.05), (10.0, "K_msc", 6.6, 0.05), (12.0, "K_msc", 1.0, 1e-12),
        (8.0, "K_p", 0.0, 1e-12), (10.0, "K_p", 22.7, 0.227), (12.0, "K_p", 270.0, 2.7),
    ],
)  # fmt: skip
def test_turbine_parameters_reach_the_published_table(
    wind: float, name: str, published: float, tolerance: float
) -> None:
    assert getattr(turbine(wind), name) == pytest.approx(published, abs=tolerance)


def test_given_values_are_kept() -> None:
    mine = PmsgTurbine(wind_speed=8.0, curtailment=0.1, omega_del=1.1, K_msc=9.0)
    assert (mine.omega_del, mine.K_msc) == (1.1, 9.0)
    assert mine.drive.start_value(type(mine.drive).w) == pytest.approx(1.1 * 1.1417)
    assert mine.schedule.omega_point == 1.1
    assert mine.control.K_d_msc == pytest.approx(0.0067 * 9.0 / 0.5)


def test_curtailment_may_be_given_to_the_control() -> None:
    mine = PmsgTurbine(wind_speed=8.0, control={"curtailment": 0.1})
    assert mine.omega_del == pytest.approx(turbine(8.0).omega_del, rel=1e-12)


def test_maximum_power_has_no_reserve() -> None:
    mine = turbine(8.0, 0.0)
    point = mine.operating_point()
    assert point.omega_del == point.omega_mpp
    assert mine.beta_del == 0.0
    assert mine.K_msc == mine.control.K_gsc
    assert mine.K_p == 0.0


def test_gains_stay_bounded_just_below_rated_wind() -> None:
    # the speed reserve vanishes at 11.2299 m/s; K_p is then beta_del / frequency reserve
    mine = turbine(11.2298)
    assert mine.K_msc == mine.control.K_gsc
    assert mine.K_p == pytest.approx(mine.beta_del / mine.control.frequency_reserve, rel=1e-12)


@pytest.mark.parametrize(
    ("wind", "curtailment", "code", "words"),
    [
        (2.9, 0.1, "GF2020", "cut-in at 3 m/s"),
        (25.1, 0.1, "GF2020", "cut-out at 25 m/s"),
        (5.0, 0.9, "GF2022", "highest tip speed ratio"),
        (20.0, 0.1, "GF2023", "highest pitch angle"),
    ],
)
def test_impossible_points_are_refused(wind: float, curtailment: float, code: str, words: str) -> None:
    with pytest.raises(GustformError, match=words) as caught:
        turbine(wind, curtailment).operating_point()
    assert caught.value.code == code
    assert caught.value.hint


def test_curtailment_outside_its_range_is_refused() -> None:
    with pytest.raises(GustformError, match="curtailment must be at most"):
        turbine(8.0, 1.0)


def test_table_rotor_has_nearly_the_points_of_the_closed_form() -> None:
    for wind in (8.0, 10.0, 12.0):
        a = turbine(wind).operating_point()
        b = PmsgTurbine(wind_speed=wind, curtailment=0.1, rotor=TableRotor(cp=sampled_table())).operating_point()
        # the table is the closed form on a grid of .23 in lambda and .5 deg: its spline is off by 2e-5 of Cp
        assert b.omega_del == pytest.approx(a.omega_del, abs=2e-3)
        assert b.beta_del == pytest.approx(a.beta_del, abs=2e-2)
        assert b.power == pytest.approx(a.power, rel=1e-3)


def test_a_lowest_pitch_outside_the_known_cp_is_refused() -> None:
    with pytest.raises(GustformError, match=r"beta_min must be less than 12 deg, .*; got 20"):
        PmsgTurbine(wind_speed=8.0, curtailment=0.1, beta_min=20.0).operating_point()
