"""Mean wind speeds times seeds, and what two design load cases of IEC 61400-1 (ed. 3, amendment 1) say about them.

DLC 1.1  power production, normal turbulence model, ultimate loads: 15 winds of 10 minutes for each mean speed from
         2 m/s below rated on, 6 below (7.6.2.1: what the extrapolation of extremes needs at least)
DLC 1.2  the same for fatigue: 6 winds of 10 minutes for each mean speed (7.5)

Both from cut-in to cut-out in steps of 2 m/s (7.4). Of the standard this covers the longitudinal turbulence that a
rotor feels; shear, inclined flow, yaw error and the extrapolation itself are not covered.

Share of the time at mean speeds near V, Rayleigh (6.3.1.1):  F(V) = 1 - exp(-pi (V / 2 V_ave)^2),  V_ave = 0.2 V_ref
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from typing import Any

from gustform.language.errors import GustformError
from gustform_cli.document import Change, Document
from gustform_cli.errors import did_you_mean
from gustform_cli.sweep.axes import Point
from gustform_cli.sweep.campaign import SpeedRange, WindCampaign

AVERAGE_SPEED = {"I": 10.0, "II": 8.5, "III": 7.5}  # m/s, of the wind turbine class
WIND_SPEED, SEED_NUMBER, WEIGHT = "wind_speed", "seed_number", "weight"


def points(wind: WindCampaign, base: Mapping[str, Any], document: Document) -> list[Point]:
    """A point for each mean speed and seed. `base` is the plain base scenario. GF2604."""
    turbines = _turbines(wind, base, document)
    until = Change("run.until", f"{wind.transient_time + wind.analysis_time!r} s", document.place(("wind",)))
    place = document.place(("wind", "wind_speed"))
    found = []
    for speed in _speeds(wind, document):
        seeds = _seeds(wind, speed)
        for number in range(1, seeds + 1):
            changes = [until]
            labels: dict[str, Any] = {WIND_SPEED: f"{speed:g} m/s", SEED_NUMBER: number}
            if wind.turbine_class is not None:
                labels[WEIGHT] = _share(wind, speed) / seeds
            for name in turbines:
                seed = wind_seed(wind.seed, name, speed, number)
                labels[f"wind.{name}.seed"] = seed
                block = base["wind"].get(name, {})
                given = {"mean": f"{speed!r} m/s", "seed": seed}
                if wind.turbulence_class is not None:
                    given["class"] = wind.turbulence_class
                if isinstance(block, Mapping) and block.get("type") == "turbulence":
                    changes += [Change(f"wind.{name}.{key}", value, place) for key, value in given.items()]
                else:
                    changes.append(Change(f"wind.{name}", {"type": "turbulence", **given}, place))
            found.append(Point(tuple(changes), labels))
    return found


def wind_seed(seed: int, turbine: str, speed: float, number: int) -> int:
    """The seed of one wind. It follows from what the wind is for, so that a campaign with more speeds or more seeds
    keeps the winds it had, and cases that differ in other axes have the same wind."""
    text = f"{seed}/{turbine}/{speed:.6g}/{number}"
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "big")


def _turbines(wind: WindCampaign, base: Mapping[str, Any], document: Document) -> list[str]:
    blocks = base.get("wind")
    known = list(blocks) if isinstance(blocks, Mapping) else []
    for k, name in enumerate(wind.turbines):
        if name not in known:
            raise GustformError(
                "GF2604",
                f"wind.turbines[{k}] must be one of those the base scenario has a wind for; got {name!r}",
                hint=did_you_mean(name, known),
                place=document.place(("wind", "turbines", k)),
            )
    if not known:
        raise GustformError(
            "GF2604",
            "wind must be left out, because the base scenario has no wind",
            hint="another base",
            place=document.place(("wind",), key=True),
        )
    return wind.turbines or known


def _speeds(wind: WindCampaign, document: Document) -> list[float]:
    """Mean wind speeds, m/s."""
    given = wind.wind_speed
    if isinstance(given, list):
        return given
    if given is None and wind.DLC is None:
        raise GustformError(
            "GF2604",
            "wind must have wind_speed or a DLC; it has none",
            hint="wind_speed: {from: 4 m/s, to: 14 m/s}",
            place=document.place(("wind",), key=True),
        )
    low, high = (given.from_, given.to) if isinstance(given, SpeedRange) else (wind.cut_in, wind.cut_out)
    if high < low:
        keys = ("wind", "wind_speed", "to") if given is not None else ("wind", "cut_out")
        raise GustformError(
            "GF2604",
            f"{'.'.join(keys)} must be at least {low:g} m/s; got {high:g} m/s",
            hint="the higher speed",
            place=document.place(keys),
        )
    count = math.floor((high - low) / wind.ws_bin_size * (1.0 + 1e-9)) + 1
    return [round(low + k * wind.ws_bin_size, 9) for k in range(count)]


def _seeds(wind: WindCampaign, speed: float) -> int:
    if wind.n_seeds is not None:
        return wind.n_seeds
    if wind.DLC == "1.1":
        return 15 if speed >= wind.rated_speed - 2.0 else 6
    return 6 if wind.DLC == "1.2" else 1


def _share(wind: WindCampaign, speed: float) -> float:
    """Share of the time in the bin round a mean speed."""
    average = AVERAGE_SPEED[str(wind.turbine_class)]

    def below(limit: float) -> float:
        return -math.expm1(-math.pi * (max(limit, 0.0) / (2.0 * average)) ** 2)

    return below(speed + 0.5 * wind.ws_bin_size) - below(speed - 0.5 * wind.ws_bin_size)
