"""The commands `gustform study ...`."""

from __future__ import annotations

import typer

study = typer.Typer(
    name="study",
    help="Studies: several cases or many operating points, with figures and tables.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
