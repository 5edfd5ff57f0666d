"""Rotor whose power coefficient comes from a table file."""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from gustform.aero.cp_file import read_cp_file
from gustform.aero.rotor import Rotor
from gustform.language import Table, table2
from gustform.language.table import TableData

# Table files have absurd values in the corner of high tip speed ratio and high pitch (Cp down to -11.85 in the file of
# the NREL 5 MW rotor). No turbine is operated there; a braking rotor of -0.2 is as far as the table is followed.
CP_FLOOR = -0.2


class TableRotor(Rotor):
    """Rotor with Cp from a table, such as a `Cp_Ct_Cq` file.

        Cp = table(lambda, beta)

    The table is evaluated as a twice continuously differentiable bicubic B-spline on a uniform grid; a non-uniform
    grid is resampled (the difference is in `table.resampling_error`). Outside the grid the arguments are held at its
    edge. SI units, beta in deg.

    Use: `TableRotor(cp=read_cp_table("Cp_Ct_Cq.NREL5MW.txt"))`.
    Source: Lyu, Subotic, Gross 2022, eq. (1), Fig. 2.
    """

    cp = Table("1", "deg", "1", "power coefficient of tip speed ratio and pitch")

    def equations(self) -> None:
        super().equations()
        self.eq(self.Cp, table2(self.cp, self.tip_speed_ratio, self.beta))

    def tip_speed_ratio_range(self) -> tuple[float, float]:
        x = self.table("cp").x
        return float(x[0]), float(x[-1])

    def pitch_range(self) -> tuple[float, float]:
        y = self.table("cp").y
        return float(y[0]), float(y[-1])

    def power_coefficient(self) -> Any:
        """The same spline as the runtime's, as a CasADi function."""
        s = self.table("cp").spline()
        knots = [
            [float(s[f"{axis}_start"] + s[f"{axis}_step"] * k) for k in range(-3, s[f"n_{axis}"] + 3)] for axis in "xy"
        ]
        # CasADi wants the first argument to vary fastest.
        coefficients = np.asarray(s["coefficient"]).reshape(s["n_x"] + 2, s["n_y"] + 2).ravel(order="F")
        spline = ca.Function.bspline("Cp", knots, [float(c) for c in coefficients], [3, 3], 1)
        ratio, beta = ca.MX.sym("lambda"), ca.MX.sym("beta")
        return ca.Function("Cp", [ratio, beta], [spline(ca.vertcat(ratio, beta))])

    def aerodynamic_key(self) -> Hashable:
        return (type(self), self.table("cp"))


def read_cp_table(path: str | Path, cp_floor: float = CP_FLOOR) -> TableData:
    """The Cp of a `Cp_Ct_Cq` file as the table of a TableRotor; values below `cp_floor` are raised to it."""
    return read_cp_file(path).table(cp_floor)
