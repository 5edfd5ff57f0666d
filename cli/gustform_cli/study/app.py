"""The commands `gustform study ...`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gustform_cli.exits import guarded

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
