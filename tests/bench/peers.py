"""The peers: a bare IDA + KLU program in C, and CasADi's own `idas`, on the same condensed equations.

Both get the flat system, the same start values, tolerances, wind samples and load step, and write no results.
"""

from __future__ import annotations

import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform_codegen.link import Linked
from gustform_codegen.table import SystemTable
from tests.support.flat import Flat, flatten_system, semi_explicit

_HERE = Path(__file__).parent
_C_FLAGS = ["-O3", "-march=native", "-w"]
_LIBRARIES = [
    "-lsundials_ida", "-lsundials_nvecserial", "-lsundials_sunlinsolklu", "-lsundials_sunmatrixsparse",
    "-lsundials_generic", "-lklu", "-lamd", "-lcolamd", "-lbtf", "-lsuitesparseconfig", "-lm",
]  # fmt: skip


_JIT_MEMORY = 12_000_000  # kB


class NotCompiledError(Exception):
    """The C compiler gave up on a peer's code: out of time or of memory."""


@dataclass(frozen=True)
class Wind:
    """Uniform samples of every input slot: value[sample, slot], m/s."""

    dt: float
    value: NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """One run of a peer. `final` holds the unknowns at the end, to see that it solved the same problem."""

    build_seconds: float
    solve_seconds: float
    steps: int
    final: NDArray[np.float64]


class BareProgram:
    """Generates, compiles and runs the bare program."""

    def __init__(self, linked: Linked, table: SystemTable, folder: Path) -> None:
        begin = time.perf_counter()
        self.table = table
        self.flat: Flat = flatten_system(linked, table)
        f = self.flat
        cj = ca.SX.sym("cj")
        jacobian = ca.jacobian(f.residual, f.y) + cj * ca.jacobian(f.residual, f.yp)
        generator = ca.CodeGenerator("flat.c", {"with_header": True})
        arguments = [f.y, f.yp, f.u, f.changing]
        generator.add(ca.Function("residual_function", arguments, [f.residual], {"cse": True}))
        generator.add(ca.Function("jacobian_function", [*arguments, cj], [ca.sparsify(jacobian)], {"cse": True}))
        folder.mkdir(parents=True, exist_ok=True)
        generator.generate(str(folder) + "/")
        self.program = folder / "bare"
        sources = [str(_HERE / "bare.c"), str(folder / "flat.c")]
        includes = [f"-I{folder}", "-I/usr/include/suitesparse"]
        subprocess.run(["cc", *_C_FLAGS, *includes, *sources, "-o", str(self.program), *_LIBRARIES], check=True)
        self.folder = folder
        self.build_seconds = time.perf_counter() - begin

    def run(self, wind: Wind, until: float, rtol: float, atol: float) -> Measured:
        """One run as a process of its own; the seconds are those of the integration alone."""
        f, table = self.flat, self.table
        numbers: list[float] = [
            table.n_unknowns, table.input_value.size, len(f.changing_start), len(f.changes), rtol, until, wind.dt,
            wind.value.shape[0],
        ]  # fmt: skip
        numbers += f.changing_start
        for y, d, a in zip(table.start, table.differential, atol * table.nominal, strict=True):
            numbers += [float(y), float(d), float(a)]
        for at, index, value in f.changes:
            numbers += [at, index, value]
        settings, wind_file = self.folder / "settings.txt", self.folder / "wind.f64"
        settings.write_text("\n".join(repr(float(v)) for v in numbers))
        np.ascontiguousarray(wind.value, dtype="<f8").tofile(wind_file)
        run = subprocess.run(
            [str(self.program), str(settings), str(wind_file)], check=True, capture_output=True, text=True
        )
        words = run.stdout.split()
        return Measured(self.build_seconds, float(words[2]), int(words[0]), np.array([float(w) for w in words[3:]]))


class CasadiIdas:
    """CasADi's idas on the same equations, with the wind as a linear interpolant of time."""

    def __init__(
        self,
        linked: Linked,
        table: SystemTable,
        wind: Wind,
        until: float,
        rtol: float,
        atol: float,
        *,
        jit: int | None = None,
    ) -> None:
        """`jit` is the time that the C compiler gets, s. Raises NotCompiledError when time or memory does not do."""
        self.table = table
        begin = time.perf_counter()
        self.flat = flatten_system(linked, table)
        s = semi_explicit(self.flat, table.nominal)
        self.s = s
        right = ca.Function("right", [s.x, s.z, s.u, s.changing], [s.ode, s.alg], {"cse": True})
        t = ca.MX.sym("t")
        x, z = ca.MX.sym("x", s.x.numel()), ca.MX.sym("z", s.z.numel())
        changing = ca.MX.sym("changing", s.changing.numel())
        grid = np.arange(wind.value.shape[0]) * wind.dt
        # lookup_mode exact: the grid is uniform, so the interval is found by a division.
        speed = ca.interpolant(
            "wind", "linear", [grid.tolist()], wind.value.ravel().tolist(), {"lookup_mode": ["exact"]}
        )
        ode, alg = right(x, z, speed(t), changing)
        # `u` is constant between the points of the grid: one integrator, and one compilation, for all of the run.
        problem = {"x": x, "z": z, "t": t, "u": changing, "ode": ode, "alg": alg}
        options: dict[str, Any] = {
            "reltol": rtol,
            "abstol": atol,
            "max_num_steps": 100_000_000,
            "suppress_algebraic": True,
            "calc_ic": True,
            "first_time": min(until, 1.0),  # what IDACalcIC takes for the size of a step: not the whole run
        }
        if jit:
            # For a hundred turbines gcc takes more than 23 GB, at -O0 too; it must not take the machine's last.
            level = "-O2" if table.n_unknowns < 500 else "-O0"
            compiler = f"ulimit -v {_JIT_MEMORY}; timeout {jit} gcc"
            options |= {
                "jit": True,
                "compiler": "shell",
                "jit_options": {"compiler": compiler, "flags": [level, "-march=native"]},
            }
        self.edges = [0.0, *sorted({at for at, _, _ in self.flat.changes if at < until}), until]
        try:
            self.integrator = ca.integrator("peer", "idas", problem, 0.0, self.edges[1:], options)
        except RuntimeError as error:
            if "Compilation failed" not in str(error):
                raise
            raise NotCompiledError(f"after {time.perf_counter() - begin:.0f} s") from error
        self.build_seconds = time.perf_counter() - begin

    def run(self) -> Measured:
        """One run. CasADi has one absolute tolerance for all unknowns, so they are in units of their nominals."""
        s = self.s
        nominal = self.table.nominal
        start = self.table.start / nominal
        changing, columns = list(self.flat.changing_start), []
        for a in self.edges[:-1]:
            for at, index, value in self.flat.changes:
                if at == a:
                    changing[index] = value
            columns.append(list(changing))
        u = np.array(columns).T
        begin = time.perf_counter()
        result = self.integrator(x0=start[s.x_index], z0=start[s.z_index], u=u)
        seconds = time.perf_counter() - begin
        steps = int(self.integrator.stats().get("nsteps", 0))
        x, z = np.asarray(result["xf"])[:, -1], np.asarray(result["zf"])[:, -1]
        final = np.zeros(self.table.n_unknowns)
        final[s.x_index], final[s.z_index] = x, z
        return Measured(self.build_seconds, seconds, steps, final * nominal)
