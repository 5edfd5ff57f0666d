"""report.md of the paper study: every published number beside the reproduced one, and what cannot be met."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from gustform.analysis.droop_map import DroopMap
from gustform_cli.study import published
from gustform_cli.study.paper_cases import CASES
from gustform_cli.study.paper_findings import Stability
from gustform_cli.study.paper_tables import (
    Comparison,
    Frequency,
    compare,
    comparison_table,
    frequency_table,
    markdown,
    short_table,
)

_HEAD = """# The case study of Lyu, Subotić and Groß

{controls} at 8, 10 and 12 m/s: ten 5 MW turbines beside a 210 MVA synchronous generator, 20 MW more
load at 30 s. Fidelity `{fidelity}`, relative tolerance {rtol:g}. Written by `gustform study paper`; the cases with all
their channels are in `cases`, the numbers of this page in `summary.json`.

{met} of {all} published numbers are met.{missed}
"""

_NOT_MET = """These are not, {why}:

{rows}

GFM MPPT comes out {above:.1f} mHz above GFL MPPT at 8 m/s ({gfm:.4f} against {gfl:.4f} Hz). Its rotor follows the DC
voltage, so that some of its kinetic energy reaches the grid; grid-following control keeps the rotor out of it. The
paper prints 49.397 Hz for both.
"""

# Why frequencies differ at another fidelity than the one that the tolerances are set for.
_FIDELITY = {
    "rms": "each with the reason",
    "dq": "with the reason, or because dq has what rms leaves out: filter, stator and its resistance, inner loops",
    "lossless": "with the reason, or because lossless is the paper's analysis model (classical machine, first-order\n"
    "governor) and not the one behind its figures",
}

_FREQUENCY_NOTE = """Nadir: the lowest frequency of the synchronous generator after the step. The last three columns are
60 s after the step. Above rated wind GFM MPPT has a pitch gain too (beta_del is not 0), so that the turbines give more
than their rated power for some 20 s, until the power limiter has taken it back."""

_TABLES_NOTE = "Tables are numbered as in the LaTeX source of the paper. Allowed differences: project notes."

_STABILITY_NOTE = """The rightmost eigenvalue before the load step, {case}, fidelity `{fidelity}`, with governor
set B, without dead band (inside one the frequency is neutral). The published T_dc = {published:g} s with the published
K_d and K_theta violates T_dc < K_d/K_theta = {limit:.4f} s, which the filter needs and the theorem does not say,
because it assumes T_dc = 0. The study uses {used:g} s. The eigenvalues of all cases are in `summary.json`; that of the
reference angle is 0 and no mode. Where a limiter stands at its bend in the steady state (the speed limiter at 1.2 pu),
its slope is the mean of both sides."""

_DROOP_NOTE = """The smallest droop m_p, %, that the three limits of section V-B allow for a frequency deviation of
{reserve:g} pu, speed first, over eta = 1 - curtailment and wind speed; `-`: no operating point. All of the map is in
`summary.json`."""

_PANELS = """(a) DC voltage, (b) power of the wind turbines into the grid, (c) frequency of the synchronous generator,
(d) frequency of the grid-side converter (for grid-following control that of its PLL), (e) rotor speed, (f) pitch angle.
What the panels of the paper show is taken from its text."""


def report(
    fidelity: str,
    rtol: float,
    frequency: Frequency,
    numbers: Mapping[str, float],
    stability: Sequence[Stability],
    droop: DroopMap,
    figures: Mapping[str, Path],
) -> str:
    """The report as Markdown. `figures`: title and file beside it."""
    rows = compare(numbers)
    missed = [row for row in rows if not row.met]
    controls = ", ".join(dict.fromkeys(case.control.label for case in CASES))
    return "\n".join(
        [
            _HEAD.format(
                controls=controls,
                fidelity=fidelity,
                rtol=rtol,
                met=len(rows) - len(missed),
                all=len(rows),
                missed="" if missed else " None is missed.",
            ),
            _not_met(missed, numbers, fidelity),
            "## Frequency after the load step\n",
            frequency_table(frequency) + "\n",
            _FREQUENCY_NOTE + "\n",
            comparison_table(compare(numbers, published.FREQUENCY)) + "\n",
            "## The paper's tables\n",
            _TABLES_NOTE + "\n",
            "### Table I, wind turbine parameters\n",
            comparison_table(compare(numbers, published.TURBINE)) + "\n",
            "### Table II, control parameters that do not depend on the wind\n",
            comparison_table(compare(numbers, published.CONTROL)) + "\n",
            "### Table III, control parameters of GFM FR\n",
            comparison_table(compare(numbers, published.GAINS)) + "\n",
            "## Stability\n",
            _stability(stability),
            comparison_table(compare(numbers, published.THEOREM)) + "\n",
            "## Smallest achievable droop\n",
            _DROOP_NOTE.format(reserve=droop.frequency_reserve) + "\n",
            _droop_table(droop) + "\n",
            "## Figures\n",
            _PANELS + "\n",
            *(f"![{title}]({file.name})\n\n*{title}*\n" for title, file in figures.items()),
        ]
    )


def closing(numbers: Mapping[str, float], paths: Mapping[str, str]) -> str:
    """The last words on stdout: where things are, the frequencies, and what is not met."""
    rows = compare(numbers)
    missed = [row for row in rows if not row.met]
    lines = [f"{name:12} {path}" for name, path in paths.items()]
    lines += ["", short_table(CASES, numbers), ""]
    lines.append(f"{len(rows) - len(missed)} of {len(rows)} published numbers met" + (", all but:" if missed else ""))
    for row in missed:
        _, value, reproduced, _, _, _ = row.cells
        lines.append(f"  {row.published.quantity}: {reproduced} {row.published.unit}, published {value}")
    return "\n".join(lines)


def _not_met(missed: Sequence[Comparison], numbers: Mapping[str, float], fidelity: str) -> str:
    if not missed:
        return ""
    cells = [row.cells for row in missed]
    head = ["quantity", "published", "reproduced", "difference", "allowed", ""]
    gfl, gfm = (numbers.get(f"frequency.{key}.8.nadir_hz", float("nan")) for key in ("gfl", "gfm_mppt"))
    return _NOT_MET.format(
        why=_FIDELITY[fidelity], rows=markdown(head, cells), above=1e3 * (gfm - gfl), gfm=gfm, gfl=gfl
    )


def _stability(found: Sequence[Stability]) -> str:
    case = found[0].case
    rows = [
        [
            f"{one.T_dc:g}",
            f"{one.rightmost.real:+.4g}",
            f"{abs(one.rightmost.imag):.4g}",
            "stable" if one.rightmost.real < 0.0 else "**unstable**",
        ]
        for one in found
    ]
    note = _STABILITY_NOTE.format(
        case=f"{case.control.label} at {case.wind} m/s",
        fidelity=found[0].fidelity,
        limit=found[0].limit,
        used=found[0].T_dc,
        published=found[-1].T_dc,
    )
    return f"{note}\n\n{markdown(['T_dc, s', 'real part, 1/s', 'imaginary part, rad/s', ''], rows)}\n"


def _droop_table(droop: DroopMap) -> str:
    """Every other row and the whole wind speeds of the map; all of it is in summary.json."""
    columns = [k for k, wind in enumerate(droop.wind) if wind == int(wind)]
    rows = []
    for eta, values in list(zip(droop.eta, droop.percent(), strict=True))[::2]:
        cells = [values[k] for k in columns]
        rows.append([f"{eta:g}", *("-" if value is None else f"{value:.3g}" for value in cells)])
    return markdown(["eta", *(f"{droop.wind[k]:g} m/s" for k in columns)], rows)
