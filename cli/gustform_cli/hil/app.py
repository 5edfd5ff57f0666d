"""The commands `gustform hil ...`. Only what a command needs is loaded when it runs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import FAILED, guarded
from gustform_cli.hil.bench_app import COMMANDS

hil = typer.Typer(
    name="hil",
    help="The controller on the bus: bridge, plant, faults, logs.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Json = Annotated[bool, typer.Option("--json", help="print the result as JSON on stdout")]


class Bus(StrEnum):
    """The shipped message sets."""

    fd = "fd"
    classic = "classic"


@hil.callback()
def group() -> None:
    """The controller on the bus: bridge, plant, faults, logs."""


@hil.command()
def budget(
    bus: Annotated[Bus, typer.Option(help="which of the shipped databases")] = Bus.fd,
    dbc: Annotated[Path | None, typer.Option(metavar="FILE", help="a database of your own instead")] = None,
    mapping: Annotated[
        Path | None, typer.Option(metavar="FILE", help="its mapping.yaml, where that has other cycle times")
    ] = None,
    bitrate: Annotated[
        str | None, typer.Option(metavar="RATE", help="of the arbitration [500k with FD frames, else 1M]")
    ] = None,
    data_bitrate: Annotated[str | None, typer.Option(metavar="RATE", help="of the data of FD frames [4M]")] = None,
    event_distance: Annotated[
        str, typer.Option(metavar="TIME", help="least distance of two messages of a kind that are not cyclic")
    ] = "10 ms",
    jitter: Annotated[str, typer.Option(metavar="TIME", help="how late any sender may queue a frame")] = "0",
    errors_every: Annotated[
        str | None, typer.Option(metavar="TIME", help="least distance of two errors on the wire [no errors]")
    ] = None,
    fifo: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SENDER",
            help="a sender with a plain queue, as in Linux, A+B: on one interface; more than once for several",
        ),
    ] = None,
    every_rate: Annotated[bool, typer.Option("--all", help="one line for each usual pair of bit rates")] = False,
    json: Json = False,
) -> None:
    """Bus load and worst-case response times of a message set; 1 if a message can miss its deadline."""
    with guarded():
        from gustform_cli.hil import budget as budgets
        from gustform_hil.budget import refuse

        request = budgets.Request(
            bus.value, dbc, mapping, bitrate, data_bitrate, event_distance, jitter, errors_every, fifo or ()
        )
        if every_rate:
            found = budgets.survey(request)
            print(budgets.survey_json(found) if json else budgets.survey_text(found))
            return
        one = budgets.budget_of(request)
        print(budgets.as_json(one) if json else budgets.as_text(one))
        refuse(one)


@hil.command()
def pil(
    scenario: Annotated[
        Path | None, typer.Argument(metavar="SCENARIO.yaml", help="where samples are measured [the load step at 8 m/s]")
    ] = None,
    turbine: Annotated[str, typer.Option(metavar="NAME", help="turbine of the scenario")] = "wt",
    control: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="a control, more than once for several [all]")
    ] = None,
    begin: Annotated[float, typer.Option(metavar="S", help="time of the first sample, s")] = 28.0,
    samples: Annotated[int, typer.Option(min=1, help="samples, one each ms")] = 4000,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="change one value of the scenario")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="also write the result as JSON")] = None,
    json: Json = False,
) -> None:
    """Run exported controllers on emulated Cortex-M4F and Cortex-M7; 1 if a bit differs from this computer's."""
    with guarded():
        from gustform_cli.hil import pil as boards
        from gustform_cli.writing import write_text

        found = boards.pil(scenario or boards.SCENARIO, turbine, control or [], begin, samples, overrides or [])
        print(boards.as_json(found) if json else boards.as_text(found))
        if out is not None:
            write_text(out, boards.as_json(found))
        if not all(one.equal for one in found):
            raise typer.Exit(FAILED)


@hil.command()
def build(
    scenario: Annotated[Path, typer.Argument(metavar="SCENARIO.yaml", help="scenario file")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder to write: new, empty, or a rig")],
    turbine: Annotated[str | None, typer.Option(metavar="NAME", help="which turbine [the only one]")] = None,
    bus: Annotated[Bus, typer.Option(help="which of the shipped databases")] = Bus.fd,
    dbc: Annotated[Path | None, typer.Option(metavar="FILE", help="a database of your own instead")] = None,
    mapping: Annotated[Path | None, typer.Option(metavar="FILE", help="what its messages mean")] = None,
    period: Annotated[
        str | None, typer.Option(metavar="TIME", help="sample period [the cycle time of the references]")
    ] = None,
    bitrate: Annotated[
        str | None, typer.Option(metavar="RATE", help="that the messages must fit [500k with FD frames, else 1M]")
    ] = None,
    data_bitrate: Annotated[str | None, typer.Option(metavar="RATE", help="of the data of FD frames [4M]")] = None,
    allow_overload: Annotated[
        bool, typer.Option("--allow-overload", help="also where messages can miss their deadlines")
    ] = False,
    compile: Annotated[bool, typer.Option(help="compile the program as well")] = True,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="change one value of the scenario"),
    ] = None,
    json: Json = False,
) -> None:
    """Write a rig, the control of a turbine behind a CAN bus, as a folder that compiles anywhere; and compile it."""
    with guarded():
        from gustform_cli.hil import build as builder

        options = builder.Options(
            turbine, bus.value, dbc, mapping, period, bitrate, data_bitrate, allow_overload, compile, overrides or []
        )
        built = builder.build(scenario, out, options)
        print(builder.as_json(built) if json else builder.as_text(built))


class Button(StrEnum):
    """What an operator can press, and a look without pressing."""

    start = "start"
    stop = "stop"
    reset = "reset"
    emergency_stop = "emergency-stop"
    status = "status"


@hil.command()
def operate(
    button: Annotated[Button, typer.Argument(help="what to press; status only looks")],
    interface: Annotated[str, typer.Option(metavar="NAME", help="SocketCAN interface")] = "vcan0",
    bus: Annotated[Bus, typer.Option(help="which of the shipped databases")] = Bus.fd,
    dbc: Annotated[Path | None, typer.Option(metavar="FILE", help="a database of your own, with --mapping")] = None,
    mapping: Annotated[Path | None, typer.Option(metavar="FILE", help="what its messages mean")] = None,
    patience: Annotated[float, typer.Option(metavar="S", min=0.1, max=60.0, help="how long to wait")] = 2.0,
    json: Json = False,
) -> None:
    """Press a button of the operator and tell which state follows; 1 if the bridge does not follow."""
    with guarded():
        from gustform_cli.hil import operate as buttons
        from gustform_cli.hil.plant import message_set

        state, faults = buttons.operate(button.value, interface, message_set(bus.value, dbc, mapping), patience)
        print(buttons.as_json(state, faults) if json else buttons.as_text(state, faults))


for command in COMMANDS:
    hil.command()(command)
