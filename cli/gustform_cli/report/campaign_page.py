"""The page of one campaign: what was varied, what came out, what failed, and every case."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from gustform_cli.progress import times
from gustform_cli.report import campaign_charts, campaign_tables
from gustform_cli.report.campaign_folder import TABLE, WEIGHT, Campaign, read_campaign
from gustform_cli.report.markup import Content, Html, tag
from gustform_cli.report.numbers import count, duration, fixed, many, places, pretty, size
from gustform_cli.report.page import Head, Section, details, page
from gustform_cli.report.tables import Figure, facts, key_figures

_NAMES = {"nadir_hz": "Frequency nadir", "settle_hz": "Settling", "rocof_hz_per_s": "RoCoF"}
_FIGURES = 3  # scalars whose range is among the key figures


def campaign_page(folder: Path) -> Html:
    """The page for a folder of `gustform sweep`, also of one that goes on still."""
    campaign = read_campaign(folder)
    return page(_head(campaign), _sections(campaign))


def _head(campaign: Campaign) -> Head:
    done, rows = int(campaign.done.sum()), len(campaign.cases)
    if rows < campaign.planned:
        status, state = f"{count(rows)} of {count(campaign.planned)} cases so far", "warn"
    elif done < rows:
        status, state = f"{count(rows - done)} of {count(rows)} cases failed", "bad" if done == 0 else "warn"
    else:
        status, state = "all cases done", "good"
    facts_line = [
        many(len(campaign_charts.varied(campaign)), "axis", "axes"),
        many(len(campaign.scalars), "scalar", "scalars"),
        campaign.written,
    ]
    return Head("campaign", campaign.title, campaign.description, status, state, facts_line)


def _sections(campaign: Campaign) -> list[Section]:
    shown, rows = campaign_tables.rows_shown(campaign), len(campaign.cases)
    note = f"The first {count(shown)} of {count(rows)}; all are in {TABLE}. " if shown < rows else ""
    table = campaign_tables.cases(campaign)
    return [
        Section("numbers", "Key figures", key_figures(_figures(campaign))),
        Section("failures", "Failures", campaign_tables.failures(campaign)),
        Section("axes", "What was varied", campaign_tables.axes(campaign)),
        Section("charts", "Scalars over the axes", _charts(campaign)),
        Section("statistics", "Statistics of the scalars", _statistics(campaign)),
        Section(
            "cases", "Cases", [tag("p", f"{note}A click on a head sorts.", class_="soft"), table] if table else None
        ),
        Section("provenance", "Provenance", _provenance(campaign)),
    ]


def _figures(campaign: Campaign) -> list[Figure]:
    done = campaign.done
    whole = len(done)
    figures = [
        Figure("Cases", count(whole), "", f"of {count(campaign.planned)} planned" if campaign.planned > whole else ""),
        Figure(
            "Failed", count(whole - int(done.sum())), "", f"{100 * (1 - done.mean()):.1f} %" if not done.all() else ""
        ),
    ]
    for scalar in campaign_charts.main_scalars(campaign)[:_FIGURES]:
        assert scalar.numbers is not None  # main_scalars() sees to it
        known = scalar.numbers[done & np.isfinite(scalar.numbers)]
        low, high = float(known.min()), float(known.max())
        decimals = places(high - low, max(abs(low), abs(high)))
        note = f"mean; {fixed(low, decimals)} … {fixed(high, decimals)}"
        name = next((name for end, name in _NAMES.items() if scalar.name.endswith(end)), scalar.name)
        figures.append(Figure(name, fixed(float(known.mean()), decimals), pretty(scalar.unit), note))
    simulated, waited = _total(campaign, "simulated_seconds"), _total(campaign, "solve_seconds")
    if simulated:
        figures.append(Figure("Simulated", duration(simulated)))
    if simulated and waited:
        figures.append(Figure("Real-time factor", times(simulated / waited), "", "mean of one run"))
    return figures


def _total(campaign: Campaign, name: str) -> float:
    column = next((column for column in campaign.scalars if column.name == name), None)
    return float(np.nansum(column.numbers)) if column is not None and column.numbers is not None else 0.0


def _charts(campaign: Campaign) -> Content:
    drawn = campaign_charts.charts(campaign)
    if drawn is None:
        return None
    note = "Cases that are done. "
    if any(campaign_charts.is_seed(column) for column in campaign.axes):
        note += "Seeds are repetitions: lines and maps are means over them. "
    return [tag("p", note, class_="soft"), drawn]


def _statistics(campaign: Campaign) -> Content:
    table = campaign_tables.scalars(campaign)
    note = "Over the cases that are done."
    if any(axis.name == WEIGHT for axis in campaign.axes):
        note += " By weight: the mean with the share of the time that each case stands for."
    return [tag("p", note, class_="soft"), table] if table else None


def _provenance(campaign: Campaign) -> Html:
    file = campaign.folder / TABLE
    pairs: list[tuple[Content, Content]] = [
        ("folder", str(campaign.folder.resolve())),
        ("written", campaign.written),
        ("versions", ", ".join(f"{name} {version}" for name, version in campaign.versions.items()) or None),
        ("table", f"{TABLE}, {size(file.stat().st_size)}"),
        ("SHA-256 of the table", tag("code", hashlib.sha256(file.read_bytes()).hexdigest())),
        ("hash of the cases", tag("code", campaign.hash) if campaign.hash else None),
        ("runs kept", count(campaign.kept) if campaign.kept else None),
    ]
    texts = [details(f"{name}, as it was read", tag("pre", text)) for name, text in campaign.texts.items() if text]
    return Html(facts((name, value) for name, value in pairs if value) + "".join(texts))
