"""The page of one run: what was simulated, what came out, and what it was made with."""

from __future__ import annotations

from pathlib import Path

import h5py

from gustform.language.errors import GustformError
from gustform_cli.report import run_charts, run_tables
from gustform_cli.report.channel_statistics import Moments, moments
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import duration, many, moment
from gustform_cli.report.page import Head, Section, page
from gustform_cli.report.run_figures import key_numbers
from gustform_cli.report.run_folder import RunFolder, read_run
from gustform_cli.report.run_statistics import computed
from gustform_cli.report.tables import key_figures
from gustform_cli.run_data import RunData

_STATES = {"completed": "good", "interrupted": "warn", "unfinished": "warn", "failed": "bad"}


def run_page(folder: Path) -> Html:
    """The page for a folder of `gustform simulate`, also of a run that failed, was interrupted or goes on still."""
    run = read_run(folder)
    if run.result is None:
        return page(_head(run, None), _sections(run, None))
    with h5py.File(run.result, "r") as file:
        return page(_head(run, file), _sections(run, file))


def _head(run: RunFolder, file: h5py.File | None) -> Head:
    facts = []
    simulated = run.summary.get("simulated_seconds") or _reached(file)
    if simulated:
        facts.append(f"{duration(float(simulated))} simulated")
    entries = run.plain.get("components")
    if entries:
        facts.append(many(len(entries), "component", "components"))
    if file is not None and "time" in file:
        facts.append(many(file["time"].shape[0], "row", "rows"))
    facts.append(run.written)
    return Head(
        "run",
        run.title,
        run.texts.get("description", ""),
        run.status,
        _STATES.get(run.status, "bad"),
        facts,
    )


def _reached(file: h5py.File | None) -> float:
    return float(file["time"][-1]) if file is not None and "time" in file and file["time"].shape[0] else 0.0


def _sections(run: RunFolder, file: h5py.File | None) -> list[Section]:
    found = _moments(file) if file is not None else {}
    curves, without = _curves(run)
    plain = run.plain
    return [
        Section("warnings", "Warnings", _warnings(run, without)),
        Section("numbers", "Key figures", key_figures(key_numbers(run, file, found))),
        Section("curves", "Curves", curves),
        Section(
            "system",
            "System",
            _present(
                run_tables.components(plain), run_tables.wind(plain), run_tables.events(run), run_tables.settings(plain)
            ),
        ),
        Section("computed", "Computed while running", computed(run)),
        Section("turbulence", "Distributions and spectra", _turbulence(run, file, found)),
        Section("channels", "Channels", _channels(file, found)),
        Section("solver", "Solver", run_tables.solver(run.summary)),
        Section("provenance", "Provenance", run_tables.provenance(run)),
    ]


def _moments(file: h5py.File) -> dict[str, Moments]:
    """Of every channel; its first dimension is time."""
    if "time" not in file or not file["time"].shape[0]:
        return {}
    rows = file["time"].shape[0]
    return {
        name: moments(data, file["time"])
        for name, data in file.items()
        if isinstance(data, h5py.Dataset)  # statistics are a group
        and name != "time"
        and data.ndim
        and data.shape[0] == rows
        and "units" in data.attrs
    }


def _curves(run: RunFolder) -> tuple[Html | None, str]:
    """The panels, or None and why there are none."""
    if run.result is None:
        return None, run.unread
    try:
        with RunData(run.result) as data:
            drawn = run_charts.panels(run, data)
    except GustformError as error:
        return None, error.message
    return drawn, "" if drawn is not None else "no channel was stored that the panels show"


def _warnings(run: RunFolder, without: str) -> Html | None:
    said: list[tuple[str, str]] = []
    message = run.summary.get("message")
    if run.status == "failed":
        said.append(("bad", f"The run failed. {message or ''}"))
    elif run.status == "interrupted":
        reached = moment(float(run.summary.get("simulated_seconds", 0.0)))
        said.append(("warn", f"The run was interrupted at {reached}; what follows is over that time."))
    elif run.status == "unfinished":
        said.append(
            ("warn", "The run has not ended: it goes on still, or was killed. What follows is what was stored.")
        )
    for name, at in (run.summary.get("trips") or {}).items():
        said.append(("bad", f"{name} tripped at {moment(float(at))}."))
    if without:
        said.append(("warn", f"There are no curves: {without}."))
    given = run.summary.get("warnings") or run.parts["warnings"] or ()
    said += [("warn", str(text)) for text in given]
    return tag("ul", [tag("li", text, class_=kind) for kind, text in said], class_="notes") if said else None


def _present(*parts: Html | None) -> Content:
    return [part for part in parts if part is not None]


def _turbulence(run: RunFolder, file: h5py.File | None, found: dict[str, Moments]) -> Content:
    charts = run_charts.turbulence(file, found, run) if file is not None and found else None
    if charts is None:
        return None
    note = (
        "Distributions are over the stored rows; so are spectra, unless the run made them of every sample. "
        "After Welch: Hann window, half overlap, averaged to twelfths of an octave."
    )
    return [tag("p", note, class_="soft"), charts]


def _channels(file: h5py.File | None, found: dict[str, Moments]) -> Content:
    rows = run_tables.channels(file, found) if file is not None else None
    return [tag("p", "Over the stored rows; a click on a head sorts.", class_="soft"), rows] if rows else None
