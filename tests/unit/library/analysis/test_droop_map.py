"""The droop map against what the reserve says, and what of it cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from gustform.aero.closed_form_rotor import ClosedFormRotor
from gustform.analysis.droop_map import droop_map
from gustform.control.operating_point import Limits, operating_point
from gustform.language.errors import GustformError

ROTOR = ClosedFormRotor()
LIMITS = Limits(rating=5e6, omega_base=1.1417, omega_max=1.2, beta_min=0.0, cut_in=3.0, cut_out=25.0)
WINDS = [2.0, 5.0, 8.0, 10.0, 11.0, 12.0, 14.0, 20.0]
ETAS = [0.7, 0.8, 0.9, 0.95, 1.0]


def test_equals_the_closed_forms() -> None:
    found = droop_map(ROTOR, LIMITS, WINDS, ETAS, 0.005)
    for j, eta in enumerate(ETAS):
        for i, wind in enumerate(WINDS):
            if np.isnan(found.m_p[j, i]):
                continue
            point = operating_point(ROTOR, wind, 1.0 - eta, LIMITS)
            if eta == 1.0:
                assert np.isinf(found.m_p[j, i])
            elif wind < point.rated_wind:
                # all of the reserve over the deviation; Ipopt finds the MPP to 1e-10
                assert found.m_p[j, i] == pytest.approx(0.005 / (point.power / eta - point.power), rel=1e-6)
            else:
                share = (point.beta_del - point.beta_mpp) / point.beta_del
                assert found.m_p[j, i] == pytest.approx(0.005 * share / (1.0 - eta), rel=1e-6)


def test_half_the_published_droops_with_half_the_deviation() -> None:
    # the tables are for 0.01 pu: 27.7 % and 14.2 % at 8 and 10 m/s, eta = 0.9
    percent = droop_map(ROTOR, LIMITS, [8.0, 10.0], [0.9]).percent()
    assert percent[0] == pytest.approx([27.7 / 2, 14.2 / 2], abs=0.05 / 2)


def test_what_is_infeasible_is_listed_with_its_reason() -> None:
    found = droop_map(ROTOR, LIMITS, WINDS, ETAS)
    listed = {(p.eta, p.wind): p.code for p in found.infeasible}
    missing = {(ETAS[j], WINDS[i]) for j, i in np.argwhere(np.isnan(found.m_p))}
    assert set(listed) == missing
    assert {code for (_, wind), code in listed.items() if wind == 2.0} == {"GF2020"}
    assert listed[0.7, 5.0] == "GF2022"
    assert listed[0.9, 20.0] == "GF2023"
    assert found.percent()[0][1] is None
    assert found.percent()[-1][2] is None  # no reserve, no droop


def test_more_wind_and_more_curtailment_give_less_droop() -> None:
    m_p = droop_map(ROTOR, LIMITS, [5.0, 7.0, 9.0, 11.0, 11.3, 13.0], [0.8, 0.85, 0.9, 0.95]).m_p
    assert np.all(np.diff(m_p, axis=1) < 0.0)
    assert np.all(np.diff(m_p, axis=0) > 0.0)


def test_progress_is_told_row_by_row() -> None:
    told: list[tuple[int, int]] = []
    droop_map(ROTOR, LIMITS, [8.0], [0.8, 0.9], progress=lambda done, rows: told.append((done, rows)))
    assert told == [(1, 2), (2, 2)]


def test_a_map_without_a_point_is_refused() -> None:
    with pytest.raises(GustformError, match=r"GF2041.*cut-in at 3 m/s"):
        droop_map(ROTOR, LIMITS, [1.0, 2.0], [0.9])
