"""The page round its sections: one file, nothing loaded from anywhere, and no script but our own.

The content security policy in the head says so to the browser: it names the hash of our one script, so that a script
which came in by a name or a title would not run even if it were not escaped.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import gustform
from gustform_cli.report.markup import Content, Html, tag

_STYLE = (Path(__file__).with_name("page.css")).read_text(encoding="utf-8")
_SCRIPT = (Path(__file__).with_name("page.js")).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Section:
    """A heading, its anchor and what stands below it."""

    anchor: str
    title: str
    content: Content


@dataclass(frozen=True)
class Head:
    """What stands above the sections. `state`: good, warn or bad, the colour of `status`."""

    kind: str
    title: str
    description: str
    status: str
    state: str
    facts: Sequence[str]


def page(head: Head, sections: Sequence[Section]) -> Html:
    """The whole document."""
    shown = [section for section in sections if section.content]
    body = [
        tag(
            "header",
            tag("p", f"gustform {head.kind}", class_="kind"),
            tag("h1", head.title),
            tag("p", head.description, class_="lead") if head.description else None,
            tag(
                "p",
                tag("span", head.status, class_=f"status {head.state}"),
                [tag("span", fact) for fact in head.facts],
                class_="facts-line",
            ),
            tag(
                "nav", [tag("a", section.title, href=f"#{section.anchor}") for section in shown], aria_label="Sections"
            ),
        ),
        tag(
            "main",
            [tag("section", tag("h2", section.title), section.content, id=section.anchor) for section in shown],
        ),
        tag("footer", f"Written by gustform {gustform.__version__}. This page is one file and loads nothing."),
        tag("script", Html(_SCRIPT)),
    ]
    policy = f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{_hash(_SCRIPT)}'"
    top = [
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=policy),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", f"{head.title} · gustform"),
        tag("style", Html(_STYLE)),
    ]
    return Html("<!doctype html>\n" + tag("html", tag("head", top), tag("body", body), lang="en") + "\n")


def details(summary: str, *content: Content) -> Html:
    """Folded until asked for; printed open."""
    return tag("details", tag("summary", summary), content)


def _hash(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
