"""The tables of the paper study: what is published, what comes out, the difference, and whether that is near enough."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gustform_cli.study.paper_cases import CONTROLS, Case
from gustform_cli.study.published import ALL, Published

Frequency = Mapping[str, Mapping[str, Mapping[str, float | None]]]

_FIGURES = (
    ("nadir_hz", "nadir, Hz", "{:.4f}"),
    ("settle_hz", "60 s after, Hz", "{:.4f}"),
    ("rocof_hz_per_s", "first 0.1 s, Hz/s", "{:.3f}"),
    ("v_dc_end_pu", "v_dc, pu", "{:.4f}"),
    ("omega_r_end_pu", "omega_r, pu", "{:.4f}"),
    ("beta_end_deg", "beta, deg", "{:.3f}"),
)


@dataclass(frozen=True)
class Comparison:
    """A published number beside the reproduced one."""

    published: Published
    reproduced: float

    @property
    def met(self) -> bool:
        """Whether the reproduced number is as near as it must be."""
        return self.published.met(self.reproduced)

    @property
    def verdict(self) -> str:
        """ "met", or "not met" with the reason where one is known."""
        if self.met:
            return "met"
        return f"**not met**; {self.published.beside}" if self.published.beside else "**not met**"

    @property
    def cells(self) -> list[str]:
        """Quantity, published, reproduced, difference, allowed difference, verdict."""
        p = self.published
        difference = self.reproduced - p.value
        allowed = p.why if p.why[0].isdigit() else f"{p.tolerance:.2g}"
        return [
            f"{p.quantity}, {p.unit}" if p.unit != "1" else p.quantity,
            f"{p.value:.6g}",
            number(self.reproduced),
            f"{difference:+.2g}" if difference else "0",
            allowed,
            self.verdict,
        ]


def number(value: float) -> str:
    """Six digits, without a sign on what rounds to zero."""
    return f"{value:.6g}" if abs(value) > 1e-300 else "0"


def compare(numbers: Mapping[str, float], published: Sequence[Published] = ALL) -> list[Comparison]:
    """Published numbers beside reproduced ones; a number that a run did not reach compares as not a number."""
    return [Comparison(p, numbers.get(p.key, float("nan"))) for p in published]


def comparison_table(rows: Sequence[Comparison]) -> str:
    """The comparisons as a Markdown table."""
    head = ["quantity", "published", "reproduced", "difference", "allowed", ""]
    return markdown(head, [row.cells for row in rows])


def frequency_table(frequency: Frequency) -> str:
    """All cases as a Markdown table, by wind speed."""
    rows = []
    for wind in sorted({wind for by_wind in frequency.values() for wind in by_wind}, key=int):
        for control in CONTROLS:
            figures = frequency.get(control.key, {}).get(wind)
            if figures is not None:
                rows.append([f"{wind} m/s", control.label, *_cells(figures)])
    return markdown(["wind", "control", *(title for _, title, _ in _FIGURES)], rows)


def short_table(cases: Sequence[Case], numbers: Mapping[str, float]) -> str:
    """The frequencies of all cases beside the published ones, for a terminal."""
    printed = {p.key: p for p in ALL}
    lines = [f"{'':18} {'nadir':>9} {'published':>9}  {'60 s after':>10} {'published':>9}   Hz"]
    for case in cases:
        cells = []
        for figure, width in (("nadir_hz", 9), ("settle_hz", 10)):
            key = f"frequency.{case.control.key}.{case.wind}.{figure}"
            beside = f"{printed[key].value:9.3f}" if key in printed else f"{'-':>9}"
            cells.append(f"{numbers.get(key, float('nan')):{width}.4f} {beside}")
        lines.append(f"{case.control.label:9} {case.wind:4} m/s {'  '.join(cells)}")
    return "\n".join(lines)


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table with aligned columns."""
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + " |"

    return "\n".join([line(head), "|" + "|".join("-" * (width + 2) for width in widths) + "|", *map(line, rows)])


def _cells(figures: Mapping[str, float | None]) -> list[str]:
    return ["-" if (value := figures[name]) is None else layout.format(value) for name, _, layout in _FIGURES]
