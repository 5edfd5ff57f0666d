"""Rotors: the closed form, tables, and the reader of rotor performance files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gustform.aero.closed_form_rotor import ClosedFormRotor
from gustform.aero.cp_file import read_cp_file
from gustform.aero.table_rotor import CP_FLOOR, TableRotor, read_cp_table
from gustform.language.errors import GustformError
from gustform.language.table import TableData
from gustform.turbines.pmsg_turbine import PmsgTurbine
from tests.components.evaluate import evaluate
from tests.components.systems import sampled_table
from tests.reference import paper_rms as ref

# The real files stand beside the checkout, where there is one.
FILES = Path(__file__).resolve().parents[3] / "shared" / "data" / "rosco"
NREL, IEA15, IEA10 = "Cp_Ct_Cq.NREL5MW.txt", "Cp_Ct_Cq.IEA15MW.txt", "IEA-10.0-198-RWT_Cp_Ct_Cq.txt"


def real(name: str) -> Path:
    if not (FILES / name).is_file():
        pytest.skip(f"{FILES / name} is not here")
    return FILES / name


@pytest.mark.parametrize(
    ("wind", "omega", "beta"),
    [(8.0, 1.1576, 0.0), (10.0, 1.2, 3.0), (12.0, 1.2, 5.4), (7.0, 0.5, 11.0),
     (20.0, 1.2, 5.0), (4.0, 1.2, 0.0), (10.0, 1.0, -2.0), (10.0, 1.0, 15.0)],
)  # fmt: skip
def test_closed_form_is_that_of_the_reference_inside_and_outside_its_range(
    wind: float, omega: float, beta: float
) -> None:
    found = evaluate(ClosedFormRotor(), {"wind": wind, "beta": beta, "shaft.w": omega * ref.OMEGA_BASE})
    expected = float(ref.wind_power(omega, beta, wind))
    assert found["P"] / 5e6 == pytest.approx(expected, rel=1e-12)
    assert found["shaft.tau"] == pytest.approx(-found["P"] / (omega * ref.OMEGA_BASE), rel=1e-12)
    assert found["tip_speed_ratio"] == pytest.approx(63.0 * omega * ref.OMEGA_BASE / wind, rel=1e-12)


def test_best_power_coefficient_and_rated_wind() -> None:
    found = evaluate(ClosedFormRotor(), {"wind": 11.2299, "beta": 0.0, "shaft.w": 7.6857 * 11.2299 / 63.0})
    assert found["Cp"] == pytest.approx(0.4897, rel=1e-12)
    assert found["P"] == pytest.approx(5e6, rel=1e-4)  # the rated wind is given to four digits


@pytest.mark.parametrize("wind", [0.0, -3.0])
def test_calm_gives_no_power_and_no_infinity(wind: float) -> None:
    found = evaluate(ClosedFormRotor(), {"wind": wind, "beta": 0.0, "shaft.w": 1.2})
    assert all(np.isfinite(list(found.values())))
    assert 0.0 <= found["P"] < 10.0  # W: what 0.1 m/s carries


@pytest.mark.parametrize("name", [NREL, IEA15, IEA10])
def test_real_files_are_read(name: str) -> None:
    data = read_cp_file(real(name))
    shape = (data.tip_speed_ratio.size, data.pitch.size)
    assert data.power.shape == shape
    assert data.thrust is not None
    assert data.thrust.shape == shape
    assert data.torque is not None
    # the files hold the same rotor three times over: Cp = lambda Cq, to the digits written
    np.testing.assert_allclose(
        data.power[:, :15], (data.tip_speed_ratio[:, None] * data.torque)[:, :15], atol=2e-2, rtol=2e-2
    )
    report = "\n".join(data.report(CP_FLOOR))
    assert f"tip speed ratio {data.tip_speed_ratio[0]:g} ... {data.tip_speed_ratio[-1]:g}" in report
    assert f"lowest {data.power.min():.2f}" in report
    assert ("resampling" in report) == (name == IEA10)


# A uniform grid is met to round-off; the non-uniform one is resampled (its own digits: 5e-7)
@pytest.mark.parametrize(("name", "difference"), [(NREL, 1e-14), (IEA15, 1e-14), (IEA10, 1e-6)])
def test_table_rotor_has_the_values_of_its_file(name: str, difference: float) -> None:
    data = read_cp_file(real(name))
    rotor = TableRotor(cp=read_cp_table(real(name)))
    ratio, pitch = np.meshgrid(data.tip_speed_ratio, data.pitch, indexing="ij")
    found = np.asarray(rotor.power_coefficient()(ratio.reshape(1, -1), pitch.reshape(1, -1))).reshape(ratio.shape)
    kept = data.power >= CP_FLOOR
    assert np.max(np.abs(found - data.power)[kept]) < difference


# A spline through every second line of the file, at the lines left out. With the spacing halved, as the rotor has it,
# the error of a cubic spline falls to a sixteenth.
@pytest.mark.parametrize("name", [NREL, IEA15])
def test_between_the_points_of_its_file_a_table_rotor_is_close(name: str) -> None:
    data = read_cp_file(real(name))
    coarse = TableData(data.tip_speed_ratio[::2], data.pitch[::2], np.maximum(data.power, CP_FLOOR)[::2, ::2])
    cp = TableRotor(cp=coarse).power_coefficient()
    ratio, pitch = np.meshgrid(data.tip_speed_ratio[1::2], data.pitch[1::2], indexing="ij")
    left_out = data.power[1::2, 1::2]
    found = np.asarray(cp(ratio.reshape(1, -1), pitch.reshape(1, -1))).reshape(ratio.shape)
    used = (left_out > 0.1) & (ratio > 4.0) & (ratio < 12.0)
    assert np.max(np.abs(found - left_out)[used]) < 5e-3
    assert np.sqrt(np.mean((found - left_out)[used] ** 2)) < 1.5e-3


@pytest.mark.parametrize(("wind", "omega_del", "beta_del"), [(8.0, 1.16, 0.0), (10.0, 1.2, 3.5), (12.0, 1.2, 5.2)])
def test_operating_points_of_the_real_rotor_are_near_the_published_ones(
    wind: float, omega_del: float, beta_del: float
) -> None:
    # the paper prints 0, 3, 5.4 deg; the file is another calculation of the same rotor
    turbine = PmsgTurbine(wind_speed=wind, curtailment=0.1, rotor=TableRotor(cp=read_cp_table(real(NREL))))
    assert turbine.omega_del == pytest.approx(omega_del, abs=0.005)
    assert turbine.beta_del == pytest.approx(beta_del, abs=0.05)


def test_real_rotor_reaches_at_12_ms_what_the_closed_form_does_not() -> None:
    turbine = PmsgTurbine(wind_speed=12.0, curtailment=0.1, rotor=TableRotor(cp=read_cp_table(real(NREL))))
    # published: K_beta .083 pu/deg, m_p 2.3 %
    assert turbine.operating_point().K_beta == pytest.approx(0.083, abs=0.003)
    assert turbine.gains().m_p == pytest.approx(0.023, abs=0.001)


def test_table_of_the_closed_form_is_the_closed_form() -> None:
    rng = np.random.default_rng(5)
    ratio, pitch = rng.uniform(5.6, 11.8, 200), rng.uniform(0.2, 11.8, 200)
    a, b = (r.power_coefficient() for r in (ClosedFormRotor(), TableRotor(cp=sampled_table())))
    difference = np.asarray(a(ratio[None, :], pitch[None, :]) - b(ratio[None, :], pitch[None, :]))
    # fourth-order spline on steps of 0.03 and 0.05 in the polynomial's own variables
    assert np.max(np.abs(difference)) < 1e-3


GOOD = """# written by hand
# Pitch angle vector, 4 entries
0 2 4 6
# TSR vector
4 6 8 10
# Wind speed vector
11
# Power coefficient

.1 .1 .1 .1
.2 .2 .2 .2
.3 .3 .3 .3
.2 .2 .2 .2
"""


def write(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "table.txt"
    file.write_text(text, encoding="utf-8")
    return file


def test_file_without_thrust_and_torque_is_enough(tmp_path: Path) -> None:
    data = read_cp_file(write(tmp_path, GOOD))
    assert data.thrust is None
    assert data.torque is None
    assert data.power[2, 3] == 0.3


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", 0, "there is no section '# Pitch angle vector'"),
        ("1 2 3\n" + GOOD, 1, "before the first section"),
        (GOOD.replace("4 6 8 10", "4 8 6 10"), 5, "must increase"),
        (GOOD.replace("4 6 8 10", "4 6 8"), 5, "at least 4 points"),
        (GOOD.replace(".2 .2 .2 .2", ".2 .2 .2", 1), 11, "a row of 4 coefficients"),
        (GOOD.replace(".3 .3 .3 .3\n", ""), 10, "4 rows were expected"),
        (GOOD.replace(".3 .3 .3 .3", ".3 .3 x .3"), 12, "not a row of numbers"),
        (GOOD.replace(".3 .3 .3 .3", ".3 .3 nan .3"), 12, "not finite"),
        (GOOD + "# TSR vector\n1 2 3 4\n", 14, "is there twice"),
        (GOOD.replace("# Power coefficient", "# Power"), 0, "there is no section '# Power coefficient'"),
    ],
)
def test_wrong_files_are_refused_with_their_line(tmp_path: Path, text: str, line: int, words: str) -> None:
    with pytest.raises(GustformError, match=words) as caught:
        read_cp_file(write(tmp_path, text))
    assert caught.value.code == "GF2031"
    assert caught.value.place is not None
    assert caught.value.place.line == line


def test_missing_and_binary_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(GustformError, match="cannot be read") as caught:
        read_cp_file(tmp_path / "none.txt")
    assert caught.value.code == "GF2030"
    binary = tmp_path / "binary"
    binary.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(GustformError, match="not a text file"):
        read_cp_file(binary)
    with pytest.raises(GustformError, match="cannot be read"):
        read_cp_file(tmp_path)


def test_table_rotor_without_a_table_is_refused() -> None:
    with pytest.raises(GustformError, match="needs a table"):
        TableRotor().power_coefficient()
