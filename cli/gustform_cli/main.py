"""The command `gustform`: simulate, check, sweep, linearise, design, study, export, info, plot, report, new.

Only what a command needs is loaded when it runs; `gustform --help` loads none of it. Exit codes: 0 done, 1 the model
or the run failed, 2 usage or scenario, 130 interrupted.
"""

from __future__ import annotations

import io
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import DONE, FAILED, INTERRUPTED, USAGE, guarded
from gustform_cli.export_app import export
from gustform_cli.hil.app import hil
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
app.add_typer(export)
app.add_typer(hil)

Scenario = Annotated[Path, typer.Argument(metavar="SCENARIO.yaml", help="scenario file; `gustform new` writes one")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="change one value of the scenario, e.g. run.until=30s"),
]
Json = Annotated[bool, typer.Option("--json", help="print the result as JSON on stdout")]


@app.command()
def simulate(
    scenario: Annotated[
        Path | None, typer.Argument(metavar="SCENARIO.yaml", help="scenario file; `gustform new` writes one")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="folder of the results [results/NAME]")] = None,
    overrides: Overrides = None,
    json: Json = False,
    figure: Annotated[bool, typer.Option(help="draw figure.png")] = True,
    resume: Annotated[
        Path | None, typer.Option(metavar="DIR", help="go on with the run in DIR from its last checkpoint")
    ] = None,
) -> None:
    """Run a scenario; writes result.nc, summary.json and figure.png."""
    if (scenario is None) == (resume is None):
        raise typer.BadParameter("SCENARIO.yaml or --resume DIR is needed, one of them")
    if resume is not None and (out is not None or overrides):
        raise typer.BadParameter("--resume takes scenario and folder from DIR, without --out and --set")
    from gustform_cli.interrupt import Interrupt

    with Interrupt() as interrupt, guarded():
        from gustform_cli.simulate import resume as go_on
        from gustform_cli.simulate import simulate as run

        if scenario is not None:
            folder = out if out is not None else Path("results") / scenario.stem
            outcome = run(scenario, folder, overrides or [], interrupt, figure=figure)
        else:
            assert resume is not None
            outcome = go_on(resume, interrupt, figure=figure)
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
        from gustform_cli.model import link, load, print_warnings
        from gustform_cli.model_report import as_json, as_text
        from gustform_cli.statistics import plan
        from gustform_codegen.report import model_report

        assembled = load(scenario, overrides or [])
        print_warnings(assembled)
        model = link(assembled)
        plan(model)  # whether its statistics can be made
        report = model_report(model.built.linked)
        print(as_json(report, model) if json else as_text(report, model))
        if model_file is not None:
            from gustform_cli.model_file import write_model

            write_model(model, model_file)


@app.command()
def sweep(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN.yaml", help="campaign file")],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="folder of the results [results/NAME]")] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="processes on this machine [all its cores]")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="run on a cluster: tcp://host:8786 of a dask scheduler"),
    ] = None,
    json: Json = False,
) -> None:
    """Run the cases of a campaign that are missing or failed; writes scalars.parquet and, where wanted, runs/*.nc."""
    from gustform_cli.interrupt import Interrupt

    with Interrupt() as interrupt, guarded():
        from gustform_cli.sweep import closing
        from gustform_cli.sweep.execute import sweep as run
        from gustform_cli.sweep.local import cores

        folder = out if out is not None else Path("results") / campaign.stem
        swept = run(campaign, folder, workers or cores(), scheduler, interrupt)
        for line in closing.failure_lines(swept):
            print(line, file=sys.stderr)
        print(closing.as_json(swept) if json else closing.as_text(swept))
    codes = {"completed": DONE, "interrupted": INTERRUPTED}
    raise typer.Exit(codes.get(closing.status(swept), FAILED))


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
def design(
    scenario: Annotated[
        Path | None, typer.Argument(metavar="SCENARIO.yaml", help="take rotor, ratings and defaults from a scenario")
    ] = None,
    component: Annotated[
        str | None, typer.Argument(metavar="TURBINE", help="which turbine of the scenario [the only one]")
    ] = None,
    wind: Annotated[str | None, typer.Option(metavar="SPEED", help="wind speed [8 m/s, or the scenario's]")] = None,
    eta: Annotated[str | None, typer.Option(metavar="SHARE", help="share of the power that is delivered [0.9]")] = None,
    curtailment: Annotated[str | None, typer.Option(metavar="SHARE", help="1 - eta instead")] = None,
    frequency_reserve: Annotated[
        str | None, typer.Option(metavar="PU", help="largest frequency deviation [0.01]")
    ] = None,
    dc_reserve: Annotated[
        str | None, typer.Option(metavar="PU", help="largest deviation of the DC voltage [0.02]")
    ] = None,
    tangent: Annotated[bool, typer.Option("--tangent", help="K_wr, K_beta as tangents, not as secants")] = False,
    K_gsc: Annotated[str | None, typer.Option("--K-gsc", metavar="PU", help="droop of the grid side")] = None,
    K_msc: Annotated[str | None, typer.Option("--K-msc", metavar="PU", help="droop of the machine side")] = None,
    K_p: Annotated[str | None, typer.Option("--K-p", metavar="DEG", help="pitch for speed, deg/pu")] = None,
    K_d_gsc: Annotated[
        str | None, typer.Option("--K-d-gsc", metavar="TIME", help="derivative gain of the grid side [6.7 ms]")
    ] = None,
    K_d_msc: Annotated[
        str | None, typer.Option("--K-d-msc", metavar="TIME", help="that of the machine side [K_d_gsc K_msc/K_gsc]")
    ] = None,
    T_dc: Annotated[str | None, typer.Option("--T-dc", metavar="TIME", help="filter of the DC voltage [2 ms]")] = None,
    table: Annotated[
        Path | None, typer.Option(metavar="FILE.c", help="also write the turbine's curtailment table as C")
    ] = None,
    json: Json = False,
) -> None:
    """Gains of dual-port control for a wind speed and a curtailment: operating point, limits, droop."""
    with guarded():
        from gustform_cli import design as designer

        turbine = designer.find_turbine(scenario, component)
        given = {
            "frequency_reserve": frequency_reserve, "dc_reserve": dc_reserve, "K_gsc": K_gsc, "K_msc": K_msc,
            "K_p": K_p, "K_d_gsc": K_d_gsc, "K_d_msc": K_d_msc, "T_dc": T_dc,
        }  # fmt: skip
        found = designer.design(turbine, wind, eta, curtailment, given, tangent)
        print(designer.as_json(found) if json else designer.as_text(found, turbine))
        for warning in found.warnings:
            print(f"warning: {warning}", file=sys.stderr)
        if table is not None:
            print(f"table    {designer.write_table(turbine, table)}", file=sys.stderr)


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


class Open(StrEnum):
    """Whether a page is shown when it is written."""

    never = "never"
    browser = "browser"


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="folder of a run, unfinished or not, or a campaign")],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="page to write [DIR/report.html]")] = None,
    show: Annotated[Open, typer.Option("--open", help="show the page in the browser")] = Open.never,
) -> None:
    """Write one self-contained HTML page with the figures and tables of a run or a campaign; prints its path."""
    with guarded():
        from gustform_cli.report.report import write_report

        page = write_report(folder, out)
        print(page)
        if show is Open.browser:
            import webbrowser

            webbrowser.open(page.resolve().as_uri())


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
