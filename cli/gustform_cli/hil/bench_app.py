"""The commands `gustform hil plant`, `faults`, `soak` and `compare`."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import DONE, FAILED, INTERRUPTED, guarded


class BusKind(StrEnum):
    """The shipped message sets."""

    fd = "fd"
    classic = "classic"


Interface = Annotated[str, typer.Option(metavar="NAME", help="SocketCAN interface")]
Kind = Annotated[BusKind, typer.Option(help="which of the shipped message sets")]
Database = Annotated[Path | None, typer.Option(metavar="FILE", help="a database of your own, with --mapping")]
Mapping = Annotated[Path | None, typer.Option(metavar="FILE", help="what its messages and signals mean")]
Rig = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="folder of `gustform hil build` [one is built for the load step at 8 m/s]"),
]
Json = Annotated[bool, typer.Option("--json", help="print the result as JSON on stdout")]


def plant(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO.yaml", help="scenario file; `gustform new` writes one")],
    interface: Interface = "vcan0",
    until: Annotated[str | None, typer.Option(metavar="TIME", help="end of the run [run.until]")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="folder of the results [results/NAME]")] = None,
    log: Annotated[Path | None, typer.Option(metavar="FILE", help="write the frames: .log (candump) or .mf4")] = None,
    bus: Kind = BusKind.fd,
    dbc: Database = None,
    mapping: Mapping = None,
    turbine: Annotated[
        str | None, typer.Option(metavar="NAME", help="turbine whose controller is on the bus [the only one]")
    ] = None,
    start: Annotated[bool, typer.Option("--start", help="play the operator who starts the controller")] = False,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="change one value of the scenario")
    ] = None,
    figure: Annotated[bool, typer.Option(help="draw figure.png")] = True,
    json: Json = False,
) -> None:
    """Run a scenario with its controller on the bus, sample by sample; writes what `gustform simulate` writes."""
    from gustform_cli.interrupt import Interrupt

    with Interrupt() as interrupt, guarded():
        from gustform_cli.closing import closing_lines, summary_json
        from gustform_cli.hil.plant import message_set
        from gustform_cli.hil.plant import plant as run

        settings = [*(overrides or []), *([f"run.until={until}"] if until is not None else [])]
        folder = out if out is not None else Path("results") / scenario.stem
        outcome = run(
            scenario,
            folder,
            settings,
            interrupt,
            message_set(bus.value, dbc, mapping),
            interface,
            turbine=turbine,
            log=log,
            start=start,
            figure=figure,
        )
        if outcome.error is not None:
            print(outcome.error, file=sys.stderr)
        print(summary_json(outcome) if json else closing_lines(outcome))
    codes = {"completed": DONE, "interrupted": INTERRUPTED}
    raise typer.Exit(codes.get(outcome.summary.status, FAILED))


def faults(
    interface: Interface = "vcan0",
    rig: Rig = None,
    monotonic: Annotated[
        bool, typer.Option("--monotonic", help="at 1 kHz of this computer's clock instead: wall times, not judged")
    ] = False,
    json: Json = False,
) -> None:
    """Inject twelve faults into a running bridge; 1 if one neither leads to SAFE in 3 periods nor is tolerated."""
    with guarded():
        from gustform_cli.hil import faults as bench

        found = bench.run(interface, rig, monotonic=monotonic)
        print(bench.as_json(found) if json else bench.as_text(found, monotonic))
        if not monotonic and not bench.good(found):
            raise typer.Exit(FAILED)


def soak(
    frames: Annotated[int, typer.Option(metavar="N", min=1, max=10**9, help="frames to send")] = 1_000_000,
    interface: Interface = "vcan0",
    rig: Rig = None,
    json: Json = False,
) -> None:
    """Send protected frames through the bus and check each; 1 if one is lost, damaged or out of order."""
    with guarded():
        from gustform_cli.hil import soak as soaking

        found = soaking.run(interface, rig, frames)
        print(soaking.as_json(found) if json else soaking.as_text(found))
        if not soaking.good(found):
            raise typer.Exit(FAILED)


def compare(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="frames of the bus: .log (candump) or .mf4")],
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="result.nc of the simulation")],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(metavar="[QUANTITY=]X", help="largest difference, in the unit of the quantity [1e-3]"),
    ] = None,
    bus: Kind = BusKind.fd,
    dbc: Database = None,
    mapping: Mapping = None,
    turbine: Annotated[str | None, typer.Option(metavar="NAME", help="whose controller it is [the only one]")] = None,
    out: Annotated[Path | None, typer.Option(metavar="FIGURE.png", help="also draw the differences")] = None,
    json: Json = False,
) -> None:
    """Compare what was on the bus with a result, quantity by quantity; 1 if one is beyond its tolerance."""
    with guarded():
        from gustform_cli.hil import compare as comparing
        from gustform_cli.hil.plant import message_set
        from gustform_cli.run_data import RunData
        from gustform_hil.codec import Codec
        from gustform_hil.trace import read_trace

        with RunData(result, every_row=True) as run:
            trace = read_trace(log, Codec(message_set(bus.value, dbc, mapping)))
            found = comparing.compare(trace, run, turbine or comparing.turbine_of(run), tolerance or [])
        figure = None
        if out is not None:
            from gustform_cli.hil.compare_figure import draw

            figure = draw(found, out)
        print(comparing.as_json(found, figure) if json else comparing.as_text(found))
        if figure is not None and not json:
            print(figure)
        if not found.good:
            raise typer.Exit(FAILED)


COMMANDS = (plant, faults, soak, compare)
