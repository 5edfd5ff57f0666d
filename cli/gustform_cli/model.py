"""From a scenario file to a linked model: what `check` and `simulate` have in common."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gustform.language.declare import Input
from gustform.language.errors import GustformError, Place
from gustform_cli import document
from gustform_cli.assemble import Assembled, assemble
from gustform_cli.errors import ErrorList
from gustform_cli.names import expand, with_best_names
from gustform_codegen.build import Built, build
from gustform_codegen.cache import KernelCache
from gustform_codegen.table import Channel


@dataclass(frozen=True)
class Model:
    """A scenario, its linked system and the channels to record."""

    assembled: Assembled
    built: Built
    channels: list[Channel]
    aliases: dict[str, tuple[str, int]]


def load(file: Path, overrides: Sequence[str] = ()) -> Assembled:
    """The assembled scenario in `file`. Raises ErrorList or GustformError with places in the file."""
    return assemble(document.read(file, overrides))


def print_warnings(assembled: Assembled) -> None:
    """What is to be known of a scenario before it runs, on stderr."""
    for text in assembled.warnings:
        print(f"warning: {text}", file=sys.stderr)


def link(assembled: Assembled) -> Model:
    """Build the system (compiling what is not cached) and select its channels."""
    # The header that kernels are compiled against is the runtime's.
    from gustform_runtime import include_dir

    try:
        built = build(assembled.system, KernelCache(include_dir()))
    except GustformError as error:
        raise placed(error, assembled) from None
    except FileNotFoundError as error:  # the runtime has not been built
        raise GustformError("GF4003", str(error), hint="make setup") from None
    channels, aliases = _select(assembled, built)
    return Model(assembled, built, channels, aliases)


def placed(error: GustformError, assembled: Assembled) -> GustformError:
    """An error of the model with the file it came from, where it has no place of its own."""
    place = error.place or Place(assembled.document.file)
    return GustformError(error.code, error.message, hint=error.hint, place=place)


def _select(assembled: Assembled, built: Built) -> tuple[list[Channel], dict[str, tuple[str, int]]]:
    """The channels of output.channels; the grid frequency is always among them."""
    patterns = [(pattern, index) for index, pattern in enumerate(assembled.scenario.output.channels)]
    errors = []
    for pattern, index in patterns:
        try:
            built.linked.select([expand(pattern, assembled.counts)])
        except GustformError as error:
            errors.append(
                GustformError(
                    "GF2406",
                    f"output.channels[{index}] must match a variable; none matches {pattern!r}",
                    hint=error.hint,
                    place=assembled.document.place(("output", "channels", index)),
                )
            )
    if errors:
        raise ErrorList(errors)
    wanted = [expand(pattern, assembled.counts) for pattern, _ in patterns]
    if assembled.frequency is not None and built.linked.channel(assembled.frequency) is not None:
        wanted.insert(0, assembled.frequency)
    channels, aliases = built.linked.select(wanted)
    return with_best_names(channels, aliases, all_inputs(assembled))


def all_inputs(assembled: Assembled) -> set[str]:
    """The names of all inputs, which say what a component reads and not what it is."""
    return {
        f"{name}.{declared}"
        for name, component in assembled.system.components.items()
        for declared in component.declared(Input)
    }
