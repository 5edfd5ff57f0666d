"""Linearise a scenario at its steady state: modes as a table and JSON, the matrices as netCDF, the eigenvalue plane."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gustform.language.declare import Input
from gustform.language.errors import GustformError
from gustform_cli.model import Model, link, load, placed
from gustform_cli.names import with_best_names
from gustform_cli.result import prepare_folder
from gustform_cli.versions import versions
from gustform_codegen.initial import steady_state
from gustform_codegen.linear import Limiter, Lineariser, LinearSystem
from gustform_codegen.modes import NEUTRAL, REFERENCE, UNSTABLE, Mode, Modes, modes
from gustform_codegen.sampled import continuous
from gustform_codegen.table import Channel

MATRICES, MODES, FIGURE = "linear.nc", "modes.json", "eigenvalues.png"
_SHOWN = 3  # states that the table names for each mode
_ROWS = 40  # modes in the table, the least damped; all are in modes.json


@dataclass(frozen=True)
class Linearised:
    """A linear system with its modes and the files it was written to."""

    title: str
    system: LinearSystem
    modes: Modes
    files: dict[str, Path]
    sampled: list[str]  # units with a sampled control, which stands in the equations here


def linearise(file: Path, out: Path, overrides: Sequence[str] = (), inputs: Sequence[str] = ()) -> Linearised:
    """Linearise the scenario in `file` and write everything into the folder `out`.

    `inputs` are parameters ("sg.governor.P_ref") that become inputs beside the driven ones and those of events.
    """
    prepare_folder(out)
    assembled = load(file, overrides)
    before = assembled.system.components
    assembled.system = continuous(assembled.system)
    sampled = [name for name, unit in assembled.system.components.items() if unit is not before[name]]
    model = link(assembled)
    linked = model.built.linked
    try:
        table = steady_state(linked).table
        lineariser = Lineariser(linked, None, model.channels)
        if inputs:
            known = [i.quantity.name for i in lineariser.inputs]
            lineariser = Lineariser(linked, [*known, *inputs], model.channels)
        system = _named(lineariser.at(table), model)
    except GustformError as error:
        raise placed(error, assembled) from None
    found = modes(system)
    files = {"matrices": out / MATRICES, "modes": out / MODES, "figure": out / FIGURE}
    result = Linearised(assembled.scenario.name, system, found, files, sampled)
    _write_matrices(result, assembled.document.text())
    try:
        files["modes"].write_text(as_json(result) + "\n", encoding="utf-8")
    except OSError as error:
        raise _not_written(files["modes"], error) from None
    from gustform_cli.eigenvalue_plane import draw  # a second of imports

    draw(found, result.title, files["figure"])
    return result


def _named(system: LinearSystem, model: Model) -> LinearSystem:
    """States under the name nearest to the top of the model, as in the result of a run: sg.omega."""
    linked = model.built.linked
    aliases = {}
    for t in linked.types:
        states = {u.path for u in t.unit.unknowns if u.der is not None}
        for path, (target, sign) in t.unit.aliases.items():
            if target in states and sign > 0:
                aliases.update({f"{name}.{path}": (f"{name}.{target}", 1) for name in t.names})
    inputs = {f"{name}.{i}" for name, c in linked.system.components.items() for i in c.declared(Input)}
    channels = [Channel(q.name, q.unit, q.description, 0, 0, 0) for q in system.states]
    renamed, _ = with_best_names(channels, aliases, inputs)
    best = {old.name: new.name for old, new in zip(channels, renamed, strict=True)}

    def limiters(some: list[Limiter]) -> list[Limiter]:
        return [replace(one, unknowns=[best.get(name, name) for name in one.unknowns]) for one in some]

    return replace(
        system,
        states=[replace(q, name=best[q.name]) for q in system.states],
        bends=limiters(system.bends),
        flats=limiters(system.flats),
    )


# ---- what is printed ----


def as_text(result: Linearised) -> str:
    """The modes as a table, then the paths."""
    found = result.modes
    rows = [("real", "imag", "frequency", "damping", "", "states that participate most"), ("1/s", "rad/s", "Hz", "1")]
    rows += [_row(mode) for mode in found.listed[:_ROWS]]
    widths = [max(len(row[k]) for row in rows if k < len(row)) for k in range(5)]
    lines = [result.title, ""]
    for row in rows:
        cells = [cell.rjust(width) for cell, width in zip(row[:4], widths, strict=False)]
        cells += [cell.ljust(width) for cell, width in zip(row[4:5], widths[4:], strict=False)]
        lines.append("  ".join([*cells, *row[5:]]).rstrip())
    if len(found.listed) > _ROWS:
        lines.append(f"... and {len(found.listed) - _ROWS} faster ones in {MODES}")
    lines += ["", _verdict(found), ""]
    lines += [f"{name:8}  {path}" for name, path in result.files.items()]
    return "\n".join(lines)


def _row(mode: Mode) -> tuple[str, ...]:
    value = mode.eigenvalue
    oscillates = value.imag > 0.0
    return (
        "0" if mode.kind == NEUTRAL and not oscillates else f"{value.real:.5g}",
        f"{value.imag:.5g}" if oscillates else "",
        f"{mode.frequency:.4g}" if oscillates else "",
        f"{mode.damping:.4f}" if oscillates and mode.damping is not None else "",
        "" if mode.kind == "stable" else mode.kind,
        ", ".join(f"{name} {share:.2f}" for name, share in mode.participation[:_SHOWN] if share >= 0.005),
    )


def _verdict(found: Modes) -> str:
    """Stable or not, and by which mode."""
    bad = [mode for mode in found.listed if mode.kind == UNSTABLE]
    if bad:
        worst = bad[0].eigenvalue
        grow = "mode grows" if len(bad) == 1 else "modes grow"
        return f"unstable: {len(bad)} {grow}, the fastest with {_number(worst)} 1/s"
    neutral = [mode for mode in found.listed if mode.kind == NEUTRAL]
    if neutral:
        who = ", ".join(name for name, share in neutral[0].participation[:_SHOWN] if share >= 0.005)
        return f"neutral: {len(neutral)} eigenvalue 0 that is not the reference angle's ({who})"
    return f"stable: the rightmost eigenvalue is {_number(found.rightmost)} 1/s"


def _number(value: complex) -> str:
    return f"{value:.5g}" if value.imag else f"{value.real:.5g}"


def warnings(result: Linearised) -> list[str]:
    """What a reader of the eigenvalues must know: limiters at a bend or on a flat part, values that are held,
    controls that are sampled."""
    system = result.system
    lines = [
        f"{_who(one)}: at a bend of a limiter, mean of both slopes to {', '.join(one.unknowns)} taken in {one.text}"
        for one in system.bends
    ]
    lines += [
        f"{_who(one)}: on a flat part of a limiter, {', '.join(one.unknowns)} has no influence in {one.text}"
        for one in system.flats
    ]
    if system.held:
        more = f" and {len(system.held) - 6} more" if len(system.held) > 6 else ""
        lines.append(f"held, because only events or samples change them: {', '.join(system.held[:6])}{more}")
    if result.sampled:
        more = f" and {len(result.sampled) - 6} more" if len(result.sampled) > 6 else ""
        lines.append(f"sampled controls, linearised as continuous ones: {', '.join(result.sampled[:6])}{more}")
    if result.modes.ill_conditioned:
        lines.append("eigenvectors nearly coincide: the participation factors of those modes mean little")
    return lines


def _who(limiter: Limiter) -> str:
    others = f" and {len(limiter.instances) - 1} more" if len(limiter.instances) > 1 else ""
    return limiter.instances[0] + others


def as_json(result: Linearised) -> str:
    """Eigenvalues as [re, im], modes with participation, names and warnings; what modes.json holds."""
    system, found = result.system, result.modes

    def names(quantities: Sequence[Any]) -> list[dict[str, str]]:
        return [{"name": q.name, "unit": q.unit, "description": q.description} for q in quantities]

    data = {
        "title": result.title,
        "stable": found.stable,
        "eigenvalues": [_pair(value) for value in found.eigenvalues],
        "modes": [
            {
                "eigenvalue": _pair(mode.eigenvalue),
                "kind": mode.kind,
                "frequency_hz": mode.frequency,
                "damping_ratio": mode.damping,
                "participation": {name: share for name, share in mode.participation if share >= 1e-6},
            }
            for mode in found.listed
        ],
        "states": names(system.states),
        "inputs": names(system.inputs),
        "outputs": names(system.outputs),
        "at_a_bend": [_limiter(limiter) for limiter in system.bends],
        "on_a_flat_part": [_limiter(limiter) for limiter in system.flats],
        "held": system.held,
        "paths": {name: str(path) for name, path in result.files.items()},
    }
    return json.dumps(data, indent=2)


def _pair(value: complex) -> list[float]:
    return [float(value.real), float(value.imag)]


def _limiter(limiter: Limiter) -> dict[str, Any]:
    return {"instances": limiter.instances, "equation": limiter.text, "unknowns": limiter.unknowns}


# ---- the file ----


def _write_matrices(result: Linearised, scenario: str) -> None:
    """linear.nc: A, B, C, D, the operating point, eigenvalues and participation, with names and units."""
    import xarray  # a second

    system, found = result.system, result.modes

    def dimension(name: str, quantities: Sequence[Any]) -> dict[str, Any]:
        return {
            name: (name, [q.name for q in quantities]),
            f"{name}_unit": (name, [q.unit for q in quantities]),
            f"{name}_description": (name, [q.description for q in quantities]),
        }

    def parts(values: Any) -> Any:
        return np.stack([values.real, values.imag], axis=-1)

    of = "state", "input", "output"
    data = xarray.Dataset(
        {
            "A": (("state", "by_state"), system.A, {"long_name": "d(state)/dt for by_state"}),
            "B": (("state", "input"), system.B, {"long_name": "d(state)/dt for input"}),
            "C": (("output", "state"), system.C, {"long_name": "output for state"}),
            "D": (("output", "input"), system.D, {"long_name": "output for input"}),
            "x0": ("state", system.x0, {"long_name": "states at the operating point"}),
            "u0": ("input", system.u0, {"long_name": "inputs at the operating point"}),
            "y0": ("output", system.y0, {"long_name": "outputs at the operating point"}),
            "eigenvalue": (("mode", "part"), parts(found.eigenvalues), {"units": "1/s"}),
            "kind": ("mode", found.kinds, {"long_name": "stable, unstable, neutral, reference angle or constant"}),
            "right": (("state", "mode", "part"), parts(found.right), {"long_name": "right eigenvectors"}),
            "left": (("mode", "state", "part"), parts(found.left), {"long_name": "left eigenvectors, left right = 1"}),
            "participation": (("state", "mode"), found.participation, {"units": "1"}),
        },
        coords={
            **{
                k: v
                for name, q in zip(of, (system.states, system.inputs, system.outputs), strict=True)
                for k, v in dimension(name, q).items()
            },
            "by_state": ("by_state", [q.name for q in system.states]),
            "part": ("part", ["re", "im"]),
        },
        attrs={
            "title": result.title,
            "source": "gustform linearise",
            "scenario": scenario,
            "reference": f"kind {REFERENCE!r}: all angles turn together; not a matter of stability",
            "versions": json.dumps(versions()),
        },
    )
    path = result.files["matrices"]
    part = path.with_name(path.name + ".part")
    try:
        data.to_netcdf(part, engine="h5netcdf")
        part.replace(path)
    except OSError as error:
        raise _not_written(path, error) from None


def _not_written(path: Path, error: OSError) -> GustformError:
    reason = error.strerror or str(error).splitlines()[0]
    return GustformError("GF7001", f"{str(path)!r} cannot be written; {reason}", hint="--out with another folder")
