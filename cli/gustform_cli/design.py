"""Gain design on the command line: quantities with units in, a report or JSON out."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gustform.analysis.gain_design import GainDesign, Specification, design_gains
from gustform.control.curtailment_schedule import default_table
from gustform.control.dual_port import DualPort
from gustform.language.component import suggest
from gustform.language.errors import GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_cli.quantity import parse_quantity

if TYPE_CHECKING:
    from gustform_cli.assemble import Assembled

# Options with a quantity: unit and sentence, by the name in Specification.
QUANTITIES: Mapping[str, tuple[str, str]] = {
    "frequency_reserve": ("pu", "largest frequency deviation"),
    "dc_reserve": ("pu", "largest deviation of the DC voltage"),
    "K_gsc": ("pu", "droop of the grid side"),
    "K_msc": ("pu", "droop of the machine side"),
    "K_p": ("deg", "pitch for speed, deg/pu"),
    "K_d_gsc": ("s", "derivative gain of the grid side"),
    "K_d_msc": ("s", "derivative gain of the machine side"),
    "T_dc": ("s", "time constant of the filter of the DC voltage"),
}


@dataclass(frozen=True)
class Turbine:
    """The turbine that is designed for, with its name in the scenario ("" for the default, the NREL 5 MW)."""

    name: str
    component: PmsgTurbine


def find_turbine(scenario: Path | None, name: str | None) -> Turbine:
    """The default turbine, or a component of a scenario: the one named, or the only turbine there is. GF2047."""
    if scenario is None:
        return Turbine("", PmsgTurbine())
    from gustform_cli.model import load  # half a second, which a design without a scenario does not need

    return only_turbine(load(scenario), scenario, name)


def only_turbine(assembled: Assembled, scenario: Path, name: str | None) -> Turbine:
    """The turbine of an assembled scenario that is named, or the only one. GF2047."""
    found = {key: unit for key, unit in assembled.system.components.items() if isinstance(unit, PmsgTurbine)}
    names = list(dict.fromkeys(key.partition("[")[0] for key in found))
    if name is None and len(names) == 1:
        name = names[0]
    if name is None:
        raise GustformError(
            "GF2047",
            f"one turbine must be named: {scenario} has {', '.join(names) or 'none'}",
            hint=f"{scenario} {names[0]}" if names else "a scenario with a PmsgTurbine",
        )
    for key in (name, f"{name}[1]"):
        if key in found:
            return Turbine(key, found[key])
    raise GustformError(
        "GF2047",
        f"{name!r} must be a PmsgTurbine of {scenario}, which has {', '.join(names) or 'none'}",
        hint=suggest(name, names),
    )


def design(
    turbine: Turbine,
    wind: str | None,
    eta: str | None,
    curtailment: str | None,
    given: Mapping[str, str | None],
    tangent: bool,
) -> GainDesign:
    """The design for options as they were written; what is not given comes from the turbine."""
    unit = turbine.component
    if eta is not None and curtailment is not None:
        raise GustformError("GF2047", "--eta and --curtailment say the same; only one may be given", hint="--eta 0.9")
    speed = unit.wind_speed if wind is None else parse_quantity(wind, "m/s", "--wind", "wind speed")
    if eta is not None:
        held_back = round(1.0 - parse_quantity(eta, "1", "--eta", "share of the available power"), 12)
    elif curtailment is not None:
        held_back = parse_quantity(curtailment, "1", "--curtailment", "share held back")
    else:
        held_back = float(unit.control.curtailment) if turbine.name else 0.1
    values: dict[str, Any] = {}
    if isinstance(unit.control, DualPort):
        values = {key: float(unit.control.value(key)) for key in ("frequency_reserve", "K_gsc", "K_d_gsc", "T_dc")}
        if not turbine.name:
            del values["K_gsc"]  # the largest that the reserves allow
    for key, text in given.items():
        if text is None:
            continue
        declared, sentence = QUANTITIES[key]
        values[key] = parse_quantity(text, declared, f"--{key.replace('_', '-')}", sentence)
    return design_gains(unit.rotor, unit.limits(), speed, held_back, Specification(tangent=tangent, **values))


def write_table(turbine: Turbine, file: Path) -> Path:
    """The curtailment table of the turbine as C, named after the file. GF2042, GF2043."""
    return default_table(turbine.component.rotor, turbine.component.limits()).write_c(file, file.stem)


def as_json(d: GainDesign) -> str:
    """The design as JSON; what is infinite (no droop, no limit) is null."""
    gains = ("K_gsc", "K_msc", "K_p", "K_d_gsc", "K_d_msc", "T_dc")
    result = {
        "operating_point": {f.name: getattr(d.point, f.name) for f in fields(d.point) if not f.name.startswith("K_")},
        "slopes": {"kind": "tangent" if d.specification.tangent else "secant", "K_wr": d.K_wr, "K_beta": d.K_beta},
        "reserves": {
            "frequency_pu": d.specification.frequency_reserve,
            "dc_voltage_pu": d.specification.dc_reserve,
            "omega_r_pu": d.speed_at_limit,
            "beta_deg": d.pitch_at_limit,
        },
        "limits": [
            {
                "name": one.name,
                "equation": one.equation,
                "gain": one.gain,
                "relation": one.relation,
                "bound": _finite(one.bound),
                "chosen": one.chosen,
                "binds": one.binds,
                "broken": one.broken,
            }
            for one in d.limits
        ],
        "gains": {name: getattr(d, name) for name in gains},
        "m_p_percent": _finite(100.0 * d.m_p),
        "warnings": list(d.warnings),
    }
    return json.dumps(result, indent=2)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def as_text(d: GainDesign, turbine: Turbine) -> str:
    """The design for reading."""
    p, spec = d.point, d.specification
    name = f"{turbine.name}: " if turbine.name else ""
    kind = "tangents" if spec.tangent else "secants"
    end = f"omega_r {d.speed_at_limit:.4f} pu, beta {d.pitch_at_limit:.3f} deg"
    lines = [
        f"{name}{p.wind:g} m/s, eta {p.eta:g}  (rated wind {p.rated_wind:.2f} m/s)",
        "",
        "operating point      maximum power    curtailed",
        f"  rotor speed        {p.omega_mpp:12.4f}     {p.omega_del:8.4f}  pu",
        f"  pitch angle        {p.beta_mpp:12.3f}     {p.beta_del:8.3f}  deg",
        f"  power              {p.power / p.eta:12.4f}     {p.power:8.4f}  pu",
        "",
        f"slopes ({kind})   K_wr {_plain(d.K_wr)} pu    K_beta {_plain(d.K_beta)} pu/deg",
        "",
        f"limits for {spec.frequency_reserve:g} pu of frequency, {spec.dc_reserve:g} pu of DC voltage",
    ]
    for one in d.limits:
        if one.applies:
            state = "broken" if one.broken else "binds" if one.binds else "met"
            rest = f"{f'{one.gain} {one.relation} {one.bound:.4g}':<18}{state:<8}{one.keeps}"
        else:
            rest = "does not apply above rated wind"
        lines.append(f"  {one.name:<12}{one.equation:<6}{rest}")
    lines += [
        "",
        "gains",
        f"  K_gsc    {d.K_gsc:10.4g} pu        K_d_gsc  {d.K_d_gsc:10.4g} s",
        f"  K_msc    {d.K_msc:10.4g} pu        K_d_msc  {d.K_d_msc:10.4g} s",
        f"  K_p      {d.K_p:10.4g} deg/pu    T_dc     {d.T_dc:10.4g} s",
        "",
        f"droop m_p {100.0 * d.m_p:.2f} %" if math.isfinite(d.m_p) else "droop m_p: none, the power does not answer",
        f"at -{spec.frequency_reserve:g} pu of frequency: {end}",
    ]
    return "\n".join(line.rstrip() for line in lines)


def _plain(value: float) -> str:
    return f"{value:.4f}" if value else "0"
