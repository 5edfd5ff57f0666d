"""The commands `gustform study ...`."""

from __future__ import annotations

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import INTERRUPTED, guarded

study = typer.Typer(
    name="study",
    help="Studies: several cases or many operating points, with figures and tables.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@study.command()
def stability(
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder of the results")] = Path("results/stability"),
    json: Annotated[bool, typer.Option("--json", help="print the summary as JSON on stdout")] = False,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="seed of the random parameter sets")] = 1,
) -> None:
    """The paper's theorem checked, and sweeps of T_dc, of the K_d ratio and of K_wt that show where stability ends."""
    with guarded():
        from gustform_cli.study.stability import as_text
        from gustform_cli.study.stability import stability as run

        found = run(out, seed)
        if json:
            from json import dumps

            print(dumps(found.summary, indent=2))
        else:
            print(as_text(found))


class Fidelity(StrEnum):
    """How finely turbines and generators are modelled."""

    lossless = "lossless"
    rms = "rms"
    dq = "dq"


@study.command()
def paper(
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder of the results")] = Path("results/paper"),
    fidelity: Annotated[Fidelity, typer.Option(help="how finely everything is modelled")] = Fidelity.rms,
    jobs: Annotated[int | None, typer.Option(metavar="N", min=1, help="cases at a time [one a core]")] = None,
    json: Annotated[bool, typer.Option("--json", help="print the summary as JSON on stdout")] = False,
) -> None:
    """The paper's case study: nine load steps side by side, its figures, and its tables beside the published ones."""
    from gustform_cli.interrupt import Interrupt

    with Interrupt() as interrupt, guarded():
        from gustform_cli.study.paper import paper as run

        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        found = run(out, fidelity.value, jobs or cores, interrupt)
        if found.status == "interrupted":
            print("\n".join(["interrupted; of the cases there are", *found.paths.values()]), file=sys.stderr)
            raise typer.Exit(INTERRUPTED)
        print(found.as_json() if json else found.as_text())


@study.command(name="droop-map")
def droop_map(
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder of the results")] = Path("results/droop-map"),
    json: Annotated[bool, typer.Option("--json", help="print the summary as JSON on stdout")] = False,
) -> None:
    """The smallest droop a turbine can have, over wind speed and curtailment: figure and table."""
    with guarded():
        from gustform_cli.study.droop_map import as_text
        from gustform_cli.study.droop_map import droop_map as run

        found = run(out)
        if json:
            from json import dumps

            print(dumps(found.summary, indent=2))
        else:
            print(as_text(found))


class Objective(StrEnum):
    """What designs are judged by."""

    fatigue = "fatigue"
    pitch = "pitch"
    capacitor = "capacitor"
    nadir = "nadir"
    rocof = "rocof"
    droop = "droop"
    energy = "energy"


@study.command()
def tradeoff(
    out: Annotated[Path, typer.Option(metavar="DIR", help="folder of the results")] = Path("results/tradeoff"),
    n: Annotated[int, typer.Option("--n", metavar="N", min=1, help="designs, beside the paper's two")] = 96,
    wind: Annotated[
        list[str] | None, typer.Option(metavar="SPEED", help="mean wind speed, may be repeated [8, 10, 12 m/s]")
    ] = None,
    seeds: Annotated[int, typer.Option(metavar="N", min=1, help="winds for each mean speed")] = 2,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="seed of the designs")] = 1,
    steps_per_day: Annotated[
        float, typer.Option(metavar="NUMBER", min=0.0, help="load steps that count in the shaft's fatigue")
    ] = 24.0,
    objective: Annotated[
        list[Objective] | None,
        typer.Option(help="what designs are judged by, may be repeated [fatigue, capacitor, nadir, energy]"),
    ] = None,
    workers: Annotated[int | None, typer.Option(metavar="N", min=1, help="processes [one a core]")] = None,
    json: Annotated[bool, typer.Option("--json", help="print the summary as JSON on stdout")] = False,
) -> None:
    """Stress, DC-link capacitor and grid support traded against each other: a campaign, its Pareto figure and table."""
    from gustform_cli.interrupt import Interrupt

    with Interrupt() as interrupt, guarded():
        from gustform_cli.study.tradeoff import Settings, speeds
        from gustform_cli.study.tradeoff import tradeoff as run
        from gustform_cli.sweep.local import cores

        standard = Settings()
        settings = Settings(
            n=n,
            winds=speeds(wind) if wind else standard.winds,
            seeds=seeds,
            seed=seed,
            steps_per_day=steps_per_day,
            objectives=tuple(dict.fromkeys(one.value for one in objective)) if objective else standard.objectives,
        )
        found = run(out, settings, workers or cores(), interrupt)
        if found.status == "interrupted":
            print("interrupted; the same command goes on from here:", *found.paths.values(), sep="\n", file=sys.stderr)
            raise typer.Exit(INTERRUPTED)
        print(found.as_json() if json else found.as_text())
