"""The offline table: equal to its points, bounded where there are none, continuous through rated wind, exportable."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gustform.aero.closed_form_rotor import ClosedFormRotor
from gustform.aero.cp_solver import CpSolver
from gustform.aero.table_rotor import TableRotor
from gustform.control.curtailment_table import CurtailmentTable, curtailment_table
from gustform.control.operating_point import Limits, operating_point, power_at, power_slopes
from gustform.language.errors import GustformError
from tests.components.systems import sampled_table

ROTOR = ClosedFormRotor()
LIMITS = Limits(rating=5e6, omega_base=1.1417, omega_max=1.2, beta_min=0.0, cut_in=3.0, cut_out=25.0)
RATED = 11.2299  # m/s

# From below cut-in to above what the known pitch angles reach; curtailment beyond what speed alone can hold back.
WINDS = [2.0, 3.0, 5.0, 7.0, 8.0, 8.3, 9.0, 10.0, 11.0, 11.2, 11.25, 12.0, 14.0, 15.5, 16.0, 18.0, 25.0, 26.0]
ETAS = [0.2, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0]


@pytest.fixture(scope="module")
def table() -> CurtailmentTable:
    return curtailment_table(ROTOR, LIMITS, WINDS, ETAS)


def test_equals_the_single_points_also_in_what_is_infeasible(table: CurtailmentTable) -> None:
    reasons = {(p.wind, p.eta): p for p in table.infeasible}
    for i, wind in enumerate(WINDS):
        for j, eta in enumerate(ETAS):
            reason = reasons.pop((wind, eta), None)
            assert table.feasible[i, j] == (reason is None)
            if reason is not None:
                with pytest.raises(GustformError) as caught:
                    operating_point(ROTOR, wind, 1.0 - eta, LIMITS)
                assert (reason.code, reason.reason) == (caught.value.code, caught.value.message)
                continue
            point = operating_point(ROTOR, wind, 1.0 - eta, LIMITS)
            # both meet Cp to 1e-9 or better; a warm start may end on another side of it
            assert table.omega_del[i, j] == pytest.approx(point.omega_del, rel=1e-8)
            assert table.beta_del[i, j] == pytest.approx(point.beta_del, abs=1e-6)
    assert not reasons
    assert {p.code for p in table.infeasible} == {"GF2020", "GF2022", "GF2023"}


def test_published_operating_points_are_in_it() -> None:
    mine = curtailment_table(ROTOR, LIMITS, [8.0, 10.0, 12.0], [0.9, 1.0])
    # half a unit of the last published digit
    np.testing.assert_allclose(mine.omega_del[:, 0], [1.16, 1.2, 1.2], atol=0.005)
    np.testing.assert_allclose(mine.beta_del[:, 0], [0.0, 3.0, 5.4], atol=0.05)
    assert mine.beta_del[2, 1] == pytest.approx(4.3, abs=0.05)
    assert mine.rated_wind == pytest.approx(11.23, abs=0.005)


def test_what_is_infeasible_takes_the_nearest_point_that_exists(table: CurtailmentTable) -> None:
    row = {wind: i for i, wind in enumerate(WINDS)}
    column = {eta: j for j, eta in enumerate(ETAS)}
    # eta = 0.2 at 5 m/s: speed holds back 20 % at most (Cp at the end of the fit), so eta = 0.8 stands there
    at = row[5.0], column[0.2]
    assert not table.feasible[at]
    assert table.omega_del[at] == table.omega_del[row[5.0], column[0.8]]
    assert table.feasible[row[5.0], column[0.8]]
    # below cut-in, above cut-out and where no pitch angle is enough: the row of the nearest wind
    np.testing.assert_array_equal(table.beta_del[row[2.0]], table.beta_del[row[3.0]])
    last = max(i for i in range(len(WINDS)) if table.feasible[i].any())
    for i in range(last + 1, len(WINDS)):
        np.testing.assert_array_equal(table.beta_del[i], table.beta_del[last])
    assert np.all((table.omega_del > 0.0) & (table.omega_del <= LIMITS.omega_max))
    assert np.all((table.beta_del >= 0.0) & (table.beta_del <= 12.0))  # end of the known Cp


def test_continuous_through_rated_wind() -> None:
    h = 0.001  # m/s
    winds = np.round(np.arange(RATED - 0.2, RATED + 0.2, h), 6)
    etas = [0.8, 0.85, 0.9, 0.95, 0.98, 1.0]
    fine = curtailment_table(ROTOR, LIMITS, [float(v) for v in winds], etas)
    assert fine.feasible.all()
    # speed: proportional to the wind until it is at its limit
    assert np.max(np.abs(np.diff(fine.omega_del, axis=0))) <= 1.001 * h * LIMITS.omega_max / (RATED - 0.2)
    for j, eta in enumerate(etas):
        jump = np.abs(np.diff(fine.beta_del[:, j]))
        if eta == 1.0:
            # Cp(beta) = Cp_max (1 - a beta - c beta^2): the pitch starts with 3/(a v) and bends off; a = .00417 /deg
            assert np.max(jump) <= 1.01 * h * 3.0 / (0.00417 * RATED)
            continue
        slopes = []
        for i, wind in enumerate(winds):
            omega, beta = float(fine.omega_del[i, j]), float(fine.beta_del[i, j])
            step, power = 1e-4, eta * min((wind / fine.rated_wind) ** 3, 1.0)
            # d(beta)/dv = (dP/dv - d(target)/dv)/(-dP/d(beta)) at constant speed
            _, by_pitch = power_slopes(ROTOR, float(wind), omega, beta, LIMITS)
            rise = (_power(wind + step, omega, beta) - _power(wind - step, omega, beta)) / (2.0 * step)
            wanted = 3.0 * power / wind if wind < fine.rated_wind else 0.0
            slopes.append(abs((rise - wanted) / by_pitch))
        allowed = np.maximum(slopes[:-1], slopes[1:]) * h
        assert np.all(jump <= 1.02 * allowed + 1e-8), eta


def _power(wind: float, omega: float, beta: float) -> float:
    return power_at(ROTOR, float(wind), omega, beta, LIMITS)


def test_the_one_step_of_the_pitch_leaves_the_power_alone() -> None:
    # Cp rises with pitch at high tip speed ratios; where the speed reaches its limit the pitch steps over the rise
    h = 1e-4
    winds = [float(v) for v in np.round(np.arange(8.28, 8.30, h), 6)]
    fine = curtailment_table(ROTOR, LIMITS, winds, [0.9])
    jump = np.diff(fine.beta_del[:, 0])
    k = int(np.argmax(jump))
    assert jump[k] == pytest.approx(2.08, abs=0.02)
    assert np.max(np.delete(jump, k)) < 0.01
    powers = [_power(winds[i], fine.omega_del[i, 0], fine.beta_del[i, 0]) for i in (k, k + 1)]
    assert powers[1] - powers[0] == pytest.approx(3.0 * powers[0] / winds[k] * h, rel=0.01)


def test_a_row_from_its_neighbour_needs_few_scans(monkeypatch: pytest.MonkeyPatch) -> None:
    scans = 0
    plain = CpSolver._bracket

    def counted(self: CpSolver, *arguments: float) -> tuple[float, float] | None:
        nonlocal scans
        scans += 1
        return plain(self, *arguments)

    monkeypatch.setattr(CpSolver, "_bracket", counted)
    winds = [float(v) for v in np.linspace(3.05, 15.55, 126)]  # a grid that no other test has in the cache
    found = curtailment_table(ROTOR, LIMITS, winds, [float(e) for e in np.linspace(0.6, 1.0, 9)])
    pitching = int(np.sum(found.feasible & (found.beta_del > 0.0)))
    # new in a row: winds at which speed was enough before, and those at which pitch is enough no longer
    assert pitching > 400
    assert scans < 0.25 * pitching


def test_a_bad_guess_is_mended(table: CurtailmentTable) -> None:
    aero = CpSolver(ROTOR)
    # at this ratio Cp rises with pitch to 1 deg and falls then: 0.2 deg leads to the root on the rising side
    ratio = 1.3 * 7.6857
    target = aero.value(ratio, 0.2)
    right = aero.falling_pitch(ratio, target, 0.0)
    assert right is not None
    assert right > 1.0
    row = aero.falling_pitches(np.array([ratio, ratio]), np.array([target, target]), 0.0, np.array([0.21, 11.9]))
    np.testing.assert_allclose(row, right, atol=1e-6)


def test_a_table_rotor_has_nearly_the_same() -> None:
    winds, etas = [7.0, 9.0, 12.0], [0.85, 1.0]
    a = curtailment_table(ROTOR, LIMITS, winds, etas)
    b = curtailment_table(TableRotor(cp=sampled_table()), LIMITS, winds, etas)
    # the table is the closed form on a grid of .23 in lambda and .5 deg: its spline is off by 2e-5 of Cp
    np.testing.assert_allclose(b.omega_del, a.omega_del, atol=2e-3)
    np.testing.assert_allclose(b.beta_del, a.beta_del, atol=2e-2)


def test_it_is_frozen_and_shared(table: CurtailmentTable) -> None:
    assert curtailment_table(ROTOR, LIMITS, WINDS, ETAS) is table
    with pytest.raises(ValueError, match="read-only"):
        table.omega_del[0, 0] = 1.0


@pytest.mark.parametrize(
    ("winds", "etas", "code", "words"),
    [
        ([8.0, 8.0], [0.9], "GF2040", "winds must be finite numbers that increase"),
        ([8.0], [0.9, np.nan], "GF2040", "etas must be"),
        ([], [0.9], "GF2040", "winds"),
        ([8.0], [0.0], "GF2021", "got 1"),
        ([8.0], [0.9, 1.1], "GF2021", "got -0.1"),
        ([1.0, 2.0], [0.9], "GF2041", "cut-in at 3 m/s"),
        ([5.0], [0.2], "GF2041", "highest tip speed ratio"),
    ],
)
def test_grids_that_cannot_be_are_refused(winds: list[float], etas: list[float], code: str, words: str) -> None:
    with pytest.raises(GustformError, match=re.escape(words)) as caught:
        curtailment_table(ROTOR, LIMITS, winds, etas)
    assert caught.value.code == code


# ---- C --------------------------------------------------------------------------------------------------------------
PROGRAM = """
#include <stdio.h>
#include "table.c"

static double at(const double values[nrel_winds][nrel_etas], double v, double eta)
{
    int i = 0, j = 0;
    double a, b;
    while (i < nrel_winds - 2 && v > nrel_wind[i + 1]) i++;
    while (j < nrel_etas - 2 && eta > nrel_eta[j + 1]) j++;
    a = (v - nrel_wind[i]) / (nrel_wind[i + 1] - nrel_wind[i]);
    b = (eta - nrel_eta[j]) / (nrel_eta[j + 1] - nrel_eta[j]);
    return (1 - a) * ((1 - b) * values[i][j] + b * values[i][j + 1])
         + a * ((1 - b) * values[i + 1][j] + b * values[i + 1][j + 1]);
}

int main(void)
{
    double v, eta;
    while (scanf("%lf %lf", &v, &eta) == 2)
        printf("%.17g %.17g %d\\n", at(nrel_omega_del, v, eta), at(nrel_beta_del, v, eta), nrel_feasible[0][0]);
    return 0;
}
"""
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def _compiler() -> str:
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler is not None, "the tests need a C compiler"
    return compiler


def _bilinear(grid: CurtailmentTable, values: NDArray[np.float64], v: float, eta: float) -> float:
    along = [float(np.interp(eta, grid.eta, row)) for row in values]
    return float(np.interp(v, grid.wind, along))


def test_c_compiles_without_a_warning_and_interpolates_the_same(table: CurtailmentTable, tmp_path: Path) -> None:
    table.write_c(tmp_path / "table.c", "nrel")
    (tmp_path / "main.c").write_text(PROGRAM)
    run = subprocess.run(
        [_compiler(), *FLAGS, "-c", "table.c", "-o", "table.o"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    run = subprocess.run(
        [_compiler(), *FLAGS, "main.c", "-o", "main"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    rng = np.random.default_rng(3)
    points = [(8.0, 0.9), *zip(rng.uniform(3.0, 25.0, 50), rng.uniform(0.2, 1.0, 50), strict=True)]
    answer = subprocess.run(
        [tmp_path / "main"], input="\n".join(f"{v!r} {eta!r}" for v, eta in _plain(points)),
        capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    assert len(answer) == len(points)
    for (v, eta), line in zip(points, answer, strict=True):
        omega, beta, feasible = line.split()
        # the same arithmetic in another order
        assert float(omega) == pytest.approx(_bilinear(table, table.omega_del, v, eta), abs=1e-13)
        assert float(beta) == pytest.approx(_bilinear(table, table.beta_del, v, eta), abs=1e-12)
        assert int(feasible) == 0


def _plain(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return [(float(v), float(eta)) for v, eta in points]


def test_c_is_reproducible_and_says_what_it_is(table: CurtailmentTable, tmp_path: Path) -> None:
    a = table.write_c(tmp_path / "a.c", "nrel").read_text()
    assert a == table.write_c(tmp_path / "b.c", "nrel").read_text()
    for words in ("m/s", "pu of 1.1417 rad/s", "deg", "gustform", "ClosedFormRotor", "11.2299", "nrel_winds = 18"):
        assert words in a
    assert str(tmp_path) not in a
    assert max(len(line) for line in a.splitlines()) <= 120


@pytest.mark.parametrize("name", ["", "9lives", "int x; //", "a" * 60, "ä"])
def test_names_that_c_does_not_take_are_refused(table: CurtailmentTable, tmp_path: Path, name: str) -> None:
    with pytest.raises(GustformError, match="GF2042"):
        table.write_c(tmp_path / "t.c", name)
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_refused(table: CurtailmentTable, tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="GF2043"):
        table.write_c(tmp_path / "no" / "t.c", "nrel")
