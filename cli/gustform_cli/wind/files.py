"""From a `file` block to a series: the format, the pass over a table, the filter, and what is said about it."""

from __future__ import annotations

from collections import OrderedDict
from datetime import datetime
from pathlib import Path

import numpy as np

from gustform.language.errors import GustformError, Place
from gustform.language.system import Series
from gustform_cli.quantity import conversion
from gustform_cli.wind.bladed import BLADED, bladed_box
from gustform_cli.wind.blocks import FileWind
from gustform_cli.wind.box import Box, BoxWind, disc_weights, hub_weights
from gustform_cli.wind.clean import Policy
from gustform_cli.wind.csv_file import Columns, CsvFile, first_bytes
from gustform_cli.wind.mann import mann_box
from gustform_cli.wind.netcdf_file import NetcdfFile
from gustform_cli.wind.parquet_file import ParquetFile
from gustform_cli.wind.rotor import Reader, RotorWind
from gustform_cli.wind.source import Site, WindSource, at_end, with_blades
from gustform_cli.wind.stamps import Clock
from gustform_cli.wind.survey import Survey, TableWind, survey
from gustform_cli.wind.table import TableFile
from gustform_cli.wind.three_p import check_spacing
from gustform_cli.wind.turbsim import turbsim_box
from gustform_cli.wind.uniform_file import UniformFile

_ENDINGS = {
    ".csv": "csv", ".txt": "csv", ".tsv": "csv", ".dat": "csv", ".parquet": "parquet", ".pq": "parquet",
    ".nc": "netcdf", ".nc4": "netcdf", ".h5": "netcdf", ".hh": "uniform", ".bts": "turbsim", ".bin": "mann",
}  # fmt: skip
_ALL = {"type", "path", "format", "start", "is_", "mean", "radius", "on_end", "three_p"}
_TABLE = _ALL | {"columns", "units", "time_zone", "missing", "every", "gaps", "longest_gap", "interpolation"}
_KEYS = {
    "csv": _TABLE | {"time_format", "header_rows"},
    "parquet": _TABLE,
    "netcdf": _TABLE,
    "uniform": _ALL,
    "turbsim": _ALL | {"reduce", "interpolation"},
    "bladed": _ALL | {"reduce", "interpolation"},
    "mann": _ALL | {"reduce", "interpolation", "shape", "spacing", "scale"},
}
_PCHIP_FROM = 1.0  # s between samples
_ROTOR_SIZED = 10.0  # s; in slower samples a rotor does not show

# Passes over tables that have been made, the latest last: a campaign asks for the same one again and again.
_KNOWN: OrderedDict[tuple[object, ...], Survey] = OrderedDict()
_MOST_KNOWN = 16


def file_source(block: FileWind, site: Site) -> WindSource:
    """Wind from a file, which is looked at here. GF2201, GF2202, GF2303, GF25xx."""
    kind = _format(block, site.folder)
    _check_keys(block, kind, site)
    if kind in ("turbsim", "bladed", "mann"):
        return _box_source(block, kind, site)
    return _table_source(block, kind, site)


def file_mean(block: FileWind, folder: Path, until: float) -> float:
    """The mean wind of a file over the run, m/s."""
    kind = _format(block, folder)
    if kind in ("turbsim", "bladed", "mann"):
        return _box(block, kind, folder).mean
    return _surveyed(block, kind, folder, until).mean


def _format(block: FileWind, folder: Path) -> str:
    path = folder / block.path
    head = first_bytes(path) if path.suffix != ".gz" else b""  # GF2501 before anything else
    if block.format is not None:
        return block.format
    ending = Path(path.stem).suffix if path.suffix == ".gz" else path.suffix
    if ending.lower() == ".wnd":
        return "bladed" if head[:2] == BLADED else "uniform"
    if ending.lower() in _ENDINGS:
        return _ENDINGS[ending.lower()]
    raise GustformError(
        "GF2202",
        f"wind format must be given, because the ending of {block.path!r} does not tell it; it is missing",
        hint="format: csv",
    )


def _check_keys(block: FileWind, kind: str, site: Site) -> None:
    """Keys that mean nothing for a format would be silently without effect."""
    for field in sorted(block.model_fields_set - _KEYS[kind]):
        key = field.rstrip("_")
        raise site.error(
            "GF2201",
            f"wind.{site.name}.{key} must not be here: a file of format {kind} takes no {key}",
            f"removing it, or format: {' or '.join(other for other, keys in _KEYS.items() if field in keys)}",
            key,
        )
    if kind == "mann":
        for key in ("shape", "spacing", "mean"):
            if getattr(block, key) is None:
                raise site.error(
                    "GF2202",
                    f"wind.{site.name}.{key} must be given, because a Mann box does not tell it; it is missing",
                    {"shape": "shape: [8192, 32, 32]", "spacing": "spacing: [0.5 m, 4 m, 4 m]"}.get(
                        key, "mean: 10 m/s"
                    ),
                )
    if kind in ("turbsim", "bladed", "mann"):
        if isinstance(block.start, datetime):
            raise site.error(
                "GF2511", f"wind.{site.name}.start of a box must be a time in s; got {block.start}", "60 s", "start"
            )
        if block.is_ == "point" and block.reduce != "hub":
            raise site.error(
                "GF2204",
                f"wind.{site.name}.is must be rotor_effective for a mean over the rotor; got 'point'",
                "reduce: hub",
                "is",
            )


# ---- tables ---------------------------------------------------------------------------------------------------------
def _unit(block: FileWind, role: str, declared: str) -> float:
    unit = getattr(block.units, role)
    try:
        factor = conversion(unit, declared)
    except ValueError:
        factor = None
    if factor is None:
        raise GustformError("GF2303", f"wind units.{role} must be a unit of {declared}; got {unit!r}", hint=declared)
    return factor


def _table(block: FileWind, kind: str, path: Path) -> TableFile:
    factor = _unit(block, "speed", "m/s")
    clock = Clock(_unit(block, "time", "s"), block.time_zone, block.start, block.time_format)
    columns = Columns(block.columns.time, block.columns.speed, factor, block.header_rows, tuple(block.missing))
    if kind == "csv":
        return CsvFile(path, columns, clock)
    if kind == "parquet":
        return ParquetFile(path, columns, clock)
    if kind == "uniform":
        return UniformFile(path, clock)
    said = block.units.model_fields_set
    return NetcdfFile(
        path, columns, clock,
        time_unit=block.units.time if "time" in said else None,
        speed_unit=block.units.speed if "speed" in said else None,
    )  # fmt: skip


def _surveyed(block: FileWind, kind: str, folder: Path, until: float) -> Survey:
    """The pass over a table, made once for a file that stays as it is."""
    path = folder / block.path
    facts = path.stat()
    # What the pass hangs on; the rest of a block is no reason for another one.
    relevant = block.model_dump_json(include=_KEYS["csv"] - {"is_", "mean", "radius", "on_end", "three_p"})
    key = (str(path.resolve()), facts.st_mtime_ns, facts.st_size, relevant, kind, until)
    if key not in _KNOWN:
        policy = Policy(block.gaps, block.longest_gap, block.every)
        _KNOWN[key] = survey(_table(block, kind, path), policy, until)
        if len(_KNOWN) > _MOST_KNOWN:
            _KNOWN.popitem(last=False)
    return _KNOWN[key]


def _table_source(block: FileWind, kind: str, site: Site) -> WindSource:
    try:
        found = _surveyed(block, kind, site.folder, site.until)
    except GustformError as error:
        if error.place is None:  # something in the scenario, not in the file
            key = {"GF2303": "units", "GF2511": "start"}.get(error.code)
            raise site.error(error.code, error.message, error.hint, *([key] if key else [])) from None
        raise
    warnings = [f"wind.{site.name}: {text}" for text in found.warnings]
    period = found.last - found.first
    if found.last < site.until:
        if block.on_end == "repeat" and found.samples < 2:
            raise site.error("GF2506", "a file of one row cannot be repeated", "on_end: hold", "on_end")
        try:
            warnings += at_end(site, block.on_end, "the wind file", found.last, period, "path")
        except GustformError as error:
            raise GustformError(
                error.code, error.message, hint=error.hint, place=Place(str(site.folder / block.path))
            ) from None
    if block.is_ is None and kind != "uniform" and found.spacing < _ROTOR_SIZED:
        warnings.append(
            f"wind.{site.name}: taken as rotor_effective; where it was measured at one point, say is: point"
        )
    mean = block.mean if block.mean is not None else found.mean
    reader = _finish(block, site, TableWind(found), block.is_ == "point", mean, found.spacing)
    series = Series(
        name=f"wind of {site.name}",
        operating_value=site.operating if site.operating is not None else mean,
        t0=found.first,
        time=np.empty(0),  # the samples carry their times; they come from the reader
        interpolation=_interpolation(block, found.spacing, polyline=found.table.polyline),
        on_end=block.on_end,
        t_end=found.last,
    )
    return WindSource(series, reader, tuple(warnings), found.longest_step)


# ---- boxes ----------------------------------------------------------------------------------------------------------
def _box(block: FileWind, kind: str, folder: Path) -> Box:
    path = folder / block.path
    if kind == "turbsim":
        return turbsim_box(path)
    if kind == "bladed":
        return bladed_box(path)
    assert block.shape is not None
    assert block.spacing is not None
    assert block.mean is not None
    return mann_box(path, block.shape, block.spacing, block.mean, block.scale)


def _box_source(block: FileWind, kind: str, site: Site) -> WindSource:
    box = _box(block, kind, site.folder)
    warnings: list[str] = []
    if block.reduce == "hub":
        weights = hub_weights(box)
    else:
        weights, said = disc_weights(box, block.radius or site.radius())
        warnings += [f"wind.{site.name}: {text}" for text in said]
    start = float(block.start) if isinstance(block.start, float) else 0.0
    end = box.duration - start
    if end <= 0.0:
        raise site.error(
            "GF2506",
            f"wind.{site.name}.start must lie within the file, {box.duration:.10g} s; got {start:g} s",
            "start: 0 s",
            "start",
        )
    if end < site.until:
        warnings += at_end(site, block.on_end, "the wind file", end, box.duration, "path")
    mean = block.mean if block.mean is not None else box.mean
    point = block.reduce == "hub" and block.is_ != "rotor_effective"
    reader = _finish(block, site, BoxWind(box, weights), point, mean, box.dt)
    series = Series(
        name=f"wind of {site.name}",
        operating_value=site.operating if site.operating is not None else mean,
        t0=-start,
        dt=box.dt,
        interpolation=_interpolation(block, box.dt, polyline=False),
        on_end=block.on_end,
        t_end=end,
    )
    return WindSource(series, reader, tuple(warnings))


# ---- both -----------------------------------------------------------------------------------------------------------
def _finish(block: FileWind, site: Site, reader: Reader, point: bool, mean: float, spacing: float) -> Reader:
    """The rotor's filter and the blades' component."""
    if point:
        reader = RotorWind(reader, block.radius or site.radius(), mean)
    if block.three_p is not None:
        check_spacing(f"wind.{site.name}", spacing, block.three_p.rotor_speed)
        reader = with_blades(reader, block.three_p)
    return reader


def _interpolation(block: FileWind, spacing: float, *, polyline: bool) -> str:
    if block.interpolation is not None:
        return block.interpolation
    return "pchip" if spacing >= _PCHIP_FROM and not polyline else "linear"
