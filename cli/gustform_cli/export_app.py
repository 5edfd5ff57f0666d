"""The commands `gustform export ...`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import guarded

export = typer.Typer(
    name="export",
    help="Exports: a control as C for a rig.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


class Real(StrEnum):
    """The number type of the exported C."""

    float = "float"
    double = "double"


class How(StrEnum):
    """How the dynamic part is discretised; see gustform_codegen.emit.controller.discretise."""

    tustin = "tustin"
    euler = "euler"
    zoh = "zoh"


@export.command()
def controller(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="control, e.g. DualPort; with a scenario, the turbine it controls")
    ],
    scenario: Annotated[
        Path | None,
        typer.Argument(metavar="SCENARIO.yaml", help="take parameters, set points and start from its steady state"),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder to write")] = Path("controller"),
    real: Annotated[Real, typer.Option(help="number type; a macro of the C changes it")] = Real.float,
    period: Annotated[str, typer.Option(metavar="TIME", help="sample period, s unless a unit is given")] = "1e-3",
    prefix: Annotated[str | None, typer.Option(metavar="P", help="how names in C begin [the control's name]")] = None,
    method: Annotated[How, typer.Option(help="discretisation: tustin, backward euler, zero-order hold")] = How.tustin,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="change one value of the scenario, e.g. wt.K_gsc=0.4"),
    ] = None,
    schedule: Annotated[
        bool | None,
        typer.Option(
            "--schedule/--no-schedule",
            help="with the scenario's curtailment schedule, or its result as input [as its location says]",
        ),
    ] = None,
    report: Annotated[
        bool, typer.Option("--report", help="compare with the continuous frequency response; adds frequency.csv")
    ] = False,
) -> None:
    """Write a control as sampled C99: source, tests with recorded vectors, CMake, README and a JSON description."""
    with guarded():
        from gustform_cli.export import export_controller

        print(
            export_controller(
                name,
                scenario,
                out,
                double=real is Real.double,
                period=period,
                prefix=prefix,
                method=method.value,
                overrides=overrides or [],
                report=report,
                schedule=schedule,
            )
        )
