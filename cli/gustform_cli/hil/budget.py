"""`gustform hil budget`: load of the bus and response times as a table or JSON."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_cli.quantity import parse_quantity
from gustform_hil.budget import (
    DATA_RATES,
    NOMINAL_RATES,
    Assumptions,
    Budget,
    Frame,
    Row,
    budget,
    frames_of,
    paced_by_the_bridge,
    rate_text,
    rates_text,
)
from gustform_hil.database import load_message_set, shipped_files
from gustform_hil.dbc import read_dbc
from gustform_hil.frame_time import BitRates

_RATE = re.compile(r"(?P<number>\d+(?:\.\d+)?)\s*(?P<scale>k|M|)(?:bit/s|bps)?")
_SCALE = {"": 1, "k": 1000, "M": 1_000_000}


def bit_rate(text: str) -> int:
    """ "500k", "500 kbit/s", "2M", "1000000" in bit/s. GF8120."""
    found = _RATE.fullmatch(text.strip())
    rate = Fraction(found["number"]) * _SCALE[found["scale"]] if found else Fraction(0)
    if found is None or rate.denominator != 1 or not 0 < rate < 10**9:
        raise GustformError("GF8120", f"{text!r} is not a bit rate", hint="500k or 2M")
    return int(rate)


@dataclass(frozen=True)
class Request:
    """What the command line asks for."""

    bus: str = "fd"
    dbc: Path | None = None
    mapping: Path | None = None
    bitrate: str | None = None
    data_bitrate: str | None = None
    event_distance: str = "10 ms"
    jitter: str = "0"
    errors_every: str | None = None
    fifo: Sequence[str] = ()


@dataclass(frozen=True)
class Traffic:
    """A database as the bus sees it."""

    name: str
    frames: list[Frame]
    assumptions: Assumptions


def traffic(request: Request) -> Traffic:
    """All messages of the database that is asked for, with the cycle times of its mapping where it has others."""
    file, mapping = request.dbc, request.mapping
    if file is None:
        file, mapping = shipped_files(request.bus)
    mapped = None if mapping is None else load_message_set(file, mapping)
    cycles = {} if mapped is None else {m.name: Fraction(m.cycle, 1_000_000) for m in mapped.messages}
    paced = {} if mapped is None else paced_by_the_bridge(mapped)
    distance = _time(request.event_distance, "--event-distance", least=1e-4)
    assumed = Assumptions(
        jitter=_time(request.jitter, "--jitter", least=0.0),
        error_interval=None
        if request.errors_every is None
        else _time(request.errors_every, "--errors-every", least=1e-4),
        queues=tuple(frozenset(text.split("+")) for text in request.fifo),
    )
    return Traffic(file.stem, frames_of(read_dbc(file).database.messages, distance, cycles, paced), assumed)


def budget_of(request: Request) -> Budget:
    """The budget at the bit rates that are asked for: unless told, 500 kbit/s and 4 Mbit/s with FD frames, else 1."""
    found = traffic(request)
    fd = any(frame.fd for frame in found.frames)
    nominal = bit_rate(request.bitrate or ("500k" if fd else "1M"))
    data = "4M" if request.data_bitrate is None else request.data_bitrate
    rates = BitRates(nominal, bit_rate(data) if fd else nominal)
    return budget(found.name, found.frames, rates, found.assumptions)


def _time(text: str, option: str, least: float) -> Fraction:
    try:
        seconds = float(text)
    except ValueError:
        seconds = parse_quantity(text, "s", option, "time")
    if not least <= seconds <= 3600.0:
        raise GustformError("GF8123", f"{option} must be {least:g} to 3600 s; got {text}", hint=f"{option} '1 ms'")
    return Fraction(f"{seconds:.12g}")


def as_text(found: Budget) -> str:
    """A line for the bus, then the table, most urgent message first."""
    lines = [f"{found.name} at {rates_text(found)}: load {float(found.load):.1%}", ""]
    head = ("message", "identifier", "from", "bytes", "frame", "every", "response", "of it", "")
    rows = [head, *(_cells(row) for row in found.rows)]
    width = [max(len(row[k]) for row in rows) for k in range(len(head))]
    left = {0, 2, 8}
    for row in rows:
        cells = (
            text.ljust(w) if k in left else text.rjust(w) for k, (text, w) in enumerate(zip(row, width, strict=True))
        )
        lines.append("  ".join(cells).rstrip())
    lines += ["", "frame: longest time on the wire, us; every: ms, and the deadline; response: at worst, ms"]
    if any(row.frame.event for row in found.rows):
        lines.append("event: not cyclic; that two of them are as far apart as this is assumed (--event-distance)")
    said = found.assumptions
    if any(row.frame.paced is not None for row in found.rows):
        lines.append("the bridge sends one of its slow messages in each period; response: with their turns")
    lines += [
        f"{' and '.join(sorted(queue))}: a plain queue, whose frames leave in the order in which they were handed over"
        for queue in said.queues
    ]
    if said.jitter:
        lines.append(f"each frame up to {float(said.jitter) * 1e3:g} ms late in its queue")
    if said.error_interval is not None:
        lines.append(f"at most one error on the wire per {float(said.error_interval) * 1e3:g} ms")
    return "\n".join(lines)


def _cells(row: Row) -> tuple[str, ...]:
    frame = row.frame
    return (
        frame.name,
        f"0x{frame.identifier:08x}" if frame.extended else f"0x{frame.identifier:03x}",
        frame.sender,
        str(frame.length),
        f"{float(row.time) * 1e6:.1f}",
        f"{float(frame.distance) * 1e3:g}",
        "no bound" if row.response is None else f"{float(row.response) * 1e3:.3f}",
        "" if row.response is None else f"{float(row.response / row.deadline):.0%}",
        ("event" if frame.event else "") if row.fits else "late",
    )


def as_json(found: Budget) -> str:
    """Everything in the table, times in seconds."""
    return json.dumps(_as_data(found), indent=2)


def survey_json(found: list[Budget]) -> str:
    """A list of what `as_json` gives for one."""
    return json.dumps([_as_data(one) for one in found], indent=2)


def _as_data(found: Budget) -> dict[str, object]:
    messages = [
        {
            "name": row.frame.name, "id": row.frame.identifier, "sender": row.frame.sender, "fd": row.frame.fd,
            "length": row.frame.length, "event": row.frame.event, "frame_s": float(row.time),
            "paced_s": None if row.frame.paced is None else float(row.frame.paced),
            "period_s": float(row.frame.distance), "deadline_s": float(row.deadline),
            "response_s": None if row.response is None else float(row.response), "fits": row.fits,
        }
        for row in found.rows
    ]  # fmt: skip
    return {
        "database": found.name,
        "bitrate": found.rates.nominal,
        "data_bitrate": found.rates.data if found.fd else None,
        "load": float(found.load),
        "fifo": [sorted(queue) for queue in found.assumptions.queues],
        "fits": found.fits,
        "messages": messages,
    }


def survey(request: Request) -> list[Budget]:
    """The budget at each usual pair of bit rates."""
    found = traffic(request)
    fd = any(frame.fd for frame in found.frames)
    pairs = [(n, d) for n in NOMINAL_RATES for d in (DATA_RATES if fd else (n,)) if d >= n]
    return [budget(found.name, found.frames, BitRates(*pair), found.assumptions) for pair in pairs]


def survey_text(found: list[Budget]) -> str:
    """One line for each pair of rates: load, and the message with the least room."""
    lines = [f"{found[0].name}", f"{'bit rate':>11}  {'data':>9}  {'load':>7}  least room"]
    for one in found:
        tight = max(one.rows, key=lambda row: float("inf") if row.response is None else row.response / row.deadline)
        takes = "no bound" if tight.response is None else f"{float(tight.response) * 1e3:.3f} ms"
        data = rate_text(one.rates.data) if one.fd else ""
        lines.append(
            f"{rate_text(one.rates.nominal):>11}  {data:>9}  {float(one.load):7.1%}  "
            f"{tight.frame.name} {takes} of {float(tight.deadline) * 1e3:g} ms{'' if one.fits else ': does not fit'}"
        )
    return "\n".join(lines)
