"""The droop map as a study: figure, table and summary in a folder."""

from __future__ import annotations

import csv
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gustform.analysis.droop_map import FREQUENCY_RESERVE, DroopMap
from gustform.analysis.droop_map import droop_map as solve
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.figures import DARK, GREY, STYLE
from gustform_cli.png import save
from gustform_cli.result import prepare_folder
from gustform_cli.writing import write_text, writing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURE, TABLE, INFEASIBLE, SUMMARY = "droop_map.png", "droop_map.csv", "infeasible.csv", "summary.json"
WINDS = tuple(round(4.0 + 0.1 * k, 9) for k in range(111))  # m/s, to where the known pitch angles end
ETAS = tuple(round(0.70 + 0.02 * k, 9) for k in range(15))
_CURVES = (0.7, 0.8, 0.9, 0.94, 0.98)
_LEVELS = (0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)  # per cent
_SHOWN = (0.2, 600.0)
_GENERATOR = 5.0  # per cent, the droop of its governor


@dataclass(frozen=True)
class Study:
    """The map with its summary and files."""

    map: DroopMap
    summary: dict[str, Any]
    files: dict[str, Path]


def droop_map(out: Path) -> Study:
    """Solve the map of the NREL 5 MW turbine and write figure, tables and summary into the folder `out`."""
    prepare_folder(out)
    begin = time.perf_counter()

    def say(done: int, rows: int) -> None:
        seconds = time.perf_counter() - begin
        print(f"[{seconds:5.1f} s] eta {ETAS[done - 1]:.2f}, row {done} of {rows}", file=sys.stderr, flush=True)

    turbine = PmsgTurbine()
    found = solve(turbine.rotor, turbine.limits(), WINDS, ETAS, FREQUENCY_RESERVE, say)
    files = {"figure": out / FIGURE, "table": out / TABLE, "infeasible": out / INFEASIBLE, "summary": out / SUMMARY}
    summary = as_summary(found) | {"paths": {name: str(path) for name, path in files.items()}}
    _write_tables(found, files)
    write_text(files["summary"], json.dumps(summary, indent=2) + "\n")
    draw(found, files["figure"])
    return Study(found, summary, files)


def as_summary(found: DroopMap) -> dict[str, Any]:
    """eta, wind and m_p_percent (a row for each eta, null where there is no operating point), and what it is for."""
    return {
        "eta": list(found.eta),
        "wind": list(found.wind),
        "m_p_percent": found.percent(),
        "frequency_reserve_pu": found.frequency_reserve,
        "rated_wind": found.rated_wind,
        "infeasible": len(found.infeasible),
    }


def as_text(study: Study) -> str:
    """A coarse map for reading, what is infeasible in a line for each reason, and the files."""
    found = study.map
    columns = [k for k, wind in enumerate(found.wind) if float(wind).is_integer()]
    lines = [
        f"smallest droop m_p in per cent for {found.frequency_reserve:g} pu of frequency, NREL 5 MW",
        "eta \\ m/s " + "".join(f"{found.wind[k]:8g}" for k in columns),
    ]
    percent = found.percent()
    for j in reversed(range(len(found.eta))):
        row = [percent[j][k] for k in columns]
        lines.append(f"{found.eta[j]:<10.2f}" + "".join("       -" if v is None else f"{v:8.3g}" for v in row))
    if found.infeasible:
        lines.append(f"{len(found.infeasible)} of {found.m_p.size} points are infeasible:")
        for code in sorted({p.code for p in found.infeasible}):
            some = [p for p in found.infeasible if p.code == code]
            lines.append(f"  {len(some)} x {code}, e.g. {some[0].reason}")
    lines += [f"{name:<11}{path}" for name, path in study.files.items()]
    return "\n".join(lines)


def _write_tables(found: DroopMap, files: dict[str, Path]) -> None:
    percent = found.percent()
    rows = [("eta", "wind (m/s)", "m_p (%)")]
    for j, eta in enumerate(found.eta):
        for i, wind in enumerate(found.wind):
            value = percent[j][i]
            rows.append((f"{eta:g}", f"{wind:g}", "" if value is None else f"{value:.6g}"))
    missing = [("eta", "wind (m/s)", "code", "reason")]
    missing += [(f"{p.eta:g}", f"{p.wind:g}", p.code, p.reason) for p in found.infeasible]
    for path, table in ((files["table"], rows), (files["infeasible"], missing)):
        with writing(path), path.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(table)


# ---- figure ---------------------------------------------------------------------------------------------------------
def draw(found: DroopMap, file: Path) -> Path:
    """Curves over the wind speed for some eta beside the whole map; GF7001 if the figure cannot be saved."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.5, 4.6))
        left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.12))
        _curves(left, found)
        _map(figure, right, found)
        figure.suptitle(
            f"Smallest achievable droop of the NREL 5 MW turbine, for {100 * found.frequency_reserve:g} % of frequency",
            x=0.012, ha="left", fontsize=12, fontweight="bold",
        )  # fmt: skip
        return save(figure, file)


def _curves(axis: Axes, found: DroopMap) -> None:
    import matplotlib as mpl

    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, len(_CURVES)))
    wind = np.array(found.wind)
    axis.axhline(_GENERATOR, color=GREY, linewidth=0.9, zorder=1)
    axis.text(wind[0] + 0.15, 0.95 * _GENERATOR, "5 %: generator\nof the case study", fontsize=8, color=GREY, va="top")
    for colour, eta in zip(colours, _CURVES, strict=True):
        m_p = 100.0 * found.m_p[found.eta.index(eta)]
        axis.semilogy(wind, m_p, color=colour, label=f"{100.0 * (1.0 - eta):.0f} %", linewidth=1.8)
    axis.set_ylim(*_SHOWN)
    axis.set_xlim(wind[0], wind[-1])
    _name_rated(axis, found)
    axis.set_title("(a)  Droop over wind speed")
    axis.set_xlabel("wind speed (m/s)")
    axis.set_ylabel("m_p (%)")
    _plain_numbers(axis.yaxis)
    axis.legend(title="curtailment", loc="upper right")


def _map(figure: Figure, axis: Axes, found: DroopMap) -> None:
    from matplotlib.colors import LogNorm

    wind, held_back = np.array(found.wind), 100.0 * (1.0 - np.array(found.eta))
    m_p = np.ma.masked_invalid(100.0 * found.m_p)
    axis.set_facecolor("#f3f3f3")
    levels = np.geomspace(*_SHOWN, 29)
    filled = axis.contourf(wind, held_back, m_p, levels=levels, norm=LogNorm(*_SHOWN), cmap="viridis_r", extend="both")
    lines = axis.contour(wind, held_back, m_p, levels=_LEVELS, colors="white", linewidths=0.8)
    axis.clabel(lines, fmt=lambda value: f"{value:g} %", fontsize=8)
    bar = figure.colorbar(filled, ax=axis, ticks=_LEVELS, label="m_p (%)")
    bar.ax.minorticks_off()
    _plain_numbers(bar.ax.yaxis)
    axis.grid(visible=False)
    axis.axvline(found.rated_wind, color=DARK, linewidth=0.9, linestyle=(0, (4, 3)))
    if any(p.code == "GF2022" for p in found.infeasible):
        axis.text(
            0.02, 0.97, "no operating point:\nspeed alone cannot\nhold back so much", transform=axis.transAxes,
            fontsize=8, color=DARK, va="top",
        )  # fmt: skip
    axis.set_title("(b)  The whole map")
    axis.set_xlabel("wind speed (m/s)")
    axis.set_ylabel("curtailment (%)")


def _name_rated(axis: Axes, found: DroopMap) -> None:
    axis.axvline(found.rated_wind, color=DARK, linewidth=0.9, linestyle=(0, (4, 3)))
    axis.annotate(
        f"rated, {found.rated_wind:.2f} m/s", (found.rated_wind, 0.0), xycoords=("data", "axes fraction"),
        xytext=(-4, 4), textcoords="offset points", rotation=90, ha="right", va="bottom", fontsize=8, color=DARK,
    )  # fmt: skip


def _plain_numbers(axis: Any) -> None:
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
