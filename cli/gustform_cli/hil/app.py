"""The commands `gustform hil ...`. Only what a command needs is loaded when it runs."""

from __future__ import annotations

import typer

hil = typer.Typer(
    name="hil",
    help="The controller on the bus: bridge, plant, faults, logs.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@hil.callback()
def group() -> None:
    """The controller on the bus: bridge, plant, faults, logs."""
