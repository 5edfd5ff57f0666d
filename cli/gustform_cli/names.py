"""Names of channels: patterns over components that stand there several times, and the best of several names."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from gustform_codegen.table import Channel

Aliases = Mapping[str, tuple[str, int]]  # name -> (name it is recorded under, sign)


def expand(pattern: str, counts: Mapping[str, int]) -> str:
    """The pattern over instances: `wt.*` means `wt[*].*` where wt stands there several times."""
    name, dot, rest = pattern.partition(".")
    if name in counts:
        return f"{name}[*]{dot}{rest}"
    return pattern


def with_best_names(
    channels: Sequence[Channel], aliases: Aliases, inputs: Collection[str]
) -> tuple[list[Channel], dict[str, tuple[str, int]]]:
    """Channels under the name nearest to the top of the model: wt.beta rather than wt.pitch.servo.beta.

    `inputs` are names of inputs, which say what a component reads and not what it is. The names that were not chosen
    become aliases.
    """
    same: dict[str, list[str]] = {}
    for name, (target, sign) in aliases.items():
        if sign > 0:
            same.setdefault(target, []).append(name)
    best = {
        channel.name: min(
            [channel.name, *same.get(channel.name, [])], key=lambda name: (name.count("."), name in inputs)
        )
        for channel in channels
    }
    renamed = {name: (best.get(target, target), sign) for name, (target, sign) in aliases.items()}
    for old, new in best.items():
        if old != new:
            renamed[old] = (new, 1)
            del renamed[new]
    return [replace(channel, name=best[channel.name]) for channel in channels], renamed


def short_aliases(aliases: Aliases, counts: Mapping[str, int]) -> dict[str, list[str | int]]:
    """The alias table for the result file: name -> [name it is recorded under, sign].

    Instances of one component have the same aliases; they are kept once, for `wt` instead of wt[1], wt[2], ...
    """
    short: dict[str, list[str | int]] = {}
    for name, (target, sign) in aliases.items():
        short[_without_number(name, counts)] = [_without_number(target, counts), sign]
    return dict(sorted(short.items()))


def _without_number(name: str, counts: Mapping[str, int]) -> str:
    instance, dot, rest = name.partition(".")
    component = instance.partition("[")[0]
    return f"{component}{dot}{rest}" if component in counts else name
