"""From a `wind:` block to what drives the input of a turbine: a constant, or a series with its reader."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.language.errors import GustformError
from gustform.language.system import Constant, Series
from gustform_cli.quantity import conversion
from gustform_cli.wind.blocks import ConstantWind, FileWind, TurbulentWindBlock
from gustform_cli.wind.csv_file import CsvColumns, CsvWind, scan
from gustform_cli.wind.kaimal import Kaimal, length_scale, standard_deviation
from gustform_cli.wind.turbulence import TurbulentWind

Reader = Callable[[int, int], tuple[NDArray[np.float64], NDArray[np.float64]]]


@dataclass(frozen=True)
class WindSource:
    """What drives one input, and the reader that delivers a series' samples."""

    drive: Constant | Series
    reader: Reader | None = None


def constant(block: ConstantWind) -> WindSource:
    """Wind of one speed."""
    return WindSource(Constant(block.speed))


def turbulence(block: TurbulentWindBlock, name: str, number: int, radius: float) -> WindSource:
    """Turbulence of turbine `number` (from 1) called `name`; each has a stream of its own under the block's seed."""
    spectrum = Kaimal(
        mean=block.mean,
        sigma=standard_deviation(block.class_, block.mean),
        length=length_scale(block.hub_height),
    )
    reader = TurbulentWind(
        spectrum, step=block.every, seed=(block.seed, number), radius=radius if block.rotor_effective else None
    )
    return WindSource(Series(name=f"wind of {name}", operating_value=block.mean, dt=block.every), reader)


def csv_file(block: FileWind, name: str, folder: Path, until: float, start: float | None) -> WindSource:
    """Wind from a file, which is checked here: GF2501 ... GF2506, GF2303 for a unit of its columns. `start` is the
    wind of the steady state that the run starts from, m/s; None takes the first of the file."""
    factors = []
    for role, declared in (("time", "s"), ("speed", "m/s")):
        unit = getattr(block.units, role)
        try:
            factor = conversion(unit, declared)
        except ValueError:
            factor = None
        if factor is None:
            raise GustformError(
                "GF2303", f"wind.{name}.units.{role} must be a unit of {declared}; got {unit!r}", hint=declared
            )
        factors.append(factor)
    columns = CsvColumns(folder / block.path, block.columns.time, block.columns.speed, *factors)
    last = scan(columns, until, hold=block.on_end == "hold")
    reader = CsvWind(columns)
    drive = Series(
        name=f"wind of {name}",
        operating_value=start if start is not None else float(reader(0, 1)[1][0]),
        time=np.empty(0),  # the samples carry their times; they come from the reader
        on_end=block.on_end,
        t_end=last,
    )
    return WindSource(drive, reader)
