"""The command `gustform`: simulate, check, linearise, design, study, info, plot, new.

Only what a command needs is loaded when it runs; `gustform --help` loads none of it. Exit codes: 0 done, 1 the model
or the run failed, 2 usage or scenario, 130 interrupted.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import DONE, FAILED, INTERRUPTED, USAGE, guarded
from gustform_cli.study.app import study

app = typer.Typer(
    name="gustform",
    help="Simulate wind turbines with grid-forming control, from a YAML scenario to figures.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.add_typer(study)

Scenario = Annotated[Path, typer.Argument(metavar="SCENARIO.yaml", help="scenario file; `gustform new` writes one")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="change one value of the scenario, e.g. run.until=30s"),
]
Json = Annotated[bool, typer.Option("--json", help="print the result as JSON on stdout")]


@app.command()
def simulate(
    scenario: Scenario,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="folder of the results [results/NAME]")] = None,
    overrides: Overrides = None,
    json: Json = False,
    figure: Annotated[bool, typer.Option(help="draw figure.png")] = True,
) -> None:
    """Run a scenario; writes result.nc, summary.json and figure.png."""
    from gustform_cli.interrupt import Interrupt

    with Interrupt() as interrupt, guarded():
        from gustform_cli.simulate import simulate as run

        folder = out if out is not None else Path("results") / scenario.stem
        outcome = run(scenario, folder, overrides or [], interrupt, figure=figure)
        if outcome.error is not None:
            print(outcome.error, file=sys.stderr)
        from gustform_cli.closing import closing_lines, summary_json

        print(summary_json(outcome) if json else closing_lines(outcome))
    codes = {"completed": DONE, "interrupted": INTERRUPTED}
    raise typer.Exit(codes.get(outcome.summary.status, FAILED))


@app.command()
def check(
    scenario: Scenario,
    overrides: Overrides = None,
    json: Json = False,
    model_file: Annotated[
        Path | None, typer.Option("--model", metavar="FILE", help="also write the model that gust-run runs")
    ] = None,
) -> None:
    """Everything up to the linked model, no run: prints the model report."""
    with guarded():
        from gustform_cli.model import link, load
        from gustform_cli.model_report import as_json, as_text
        from gustform_codegen.report import model_report

        model = link(load(scenario, overrides or []))
        report = model_report(model.built.linked)
        print(as_json(report, model) if json else as_text(report, model))
        if model_file is not None:
            from gustform_cli.model_file import write_model

            write_model(model, model_file)


@app.command()
def linearise(
    scenario: Scenario,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="folder of the results [results/NAME]")] = None,
    overrides: Overrides = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option("--input", metavar="NAME", help="a parameter as an input, beside wind and what events set"),
    ] = None,
    json: Json = False,
) -> None:
    """Eigenvalues, participation and A, B, C, D at the steady state; writes linear.nc, modes.json, eigenvalues.png."""
    with guarded():
        from gustform_cli.linearise import as_json, as_text, warnings
        from gustform_cli.linearise import linearise as run

        folder = out if out is not None else Path("results") / scenario.stem
        result = run(scenario, folder, overrides or [], inputs or [])
        for line in warnings(result):
            print(f"warning: {line}", file=sys.stderr)
        print(as_json(result) if json else as_text(result))


@app.command()
def info(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="component type; all are listed without")] = None,
) -> None:
    """Components and their parameters, from the declarations."""
    with guarded():
        from gustform_cli.info import describe, overview

        print(overview() if name is None else describe(name))


@app.command()
def plot(
    result: Annotated[Path, typer.Argument(metavar="RESULT.nc", help="result file, also one of an unfinished run")],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="figure file [beside the result]")] = None,
) -> None:
    """Draw the figure of a run again, from its result file."""
    with guarded():
        from gustform_cli.figures import draw

        print(draw(result, out if out is not None else result.parent / "figure.png"))


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="scenario file to write")],
) -> None:
    """Write a commented scenario to start from; never overwrites."""
    with guarded():
        from gustform_cli.new import write

        print(write(file))


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="print the version and exit")] = False,
) -> None:
    """Options of all commands."""
    if version:
        from gustform import __version__

        print(f"gustform {__version__}")
        raise typer.Exit(DONE)
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(USAGE)


def main() -> None:
    """Entry point of the installed command."""
    # A terminal that knows no dash must not turn an error message into another error.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    app()
