"""<name>.a2l: parameters and signals for calibration tools, ASAP2 1.61.

Addresses are offsets from the start of the context; those of an instance begin at its own address. The number type is
the one the folder was exported with.
"""

from __future__ import annotations

import math

from gustform_codegen.emit.controller.c_header import Names, members
from gustform_codegen.emit.controller.program import Program
from gustform_codegen.emit.controller.signals import Signal

_LARGEST = {4: 3.4e38, 8: 1.7e308}


def _text(words: str) -> str:
    return '"' + words.replace("\\", "\\\\").replace('"', '\\"') + '"'


def offsets(program: Program, size: int) -> dict[str, int]:
    """Where each member stands in the context, bytes; `size` of a number. The order is that of the header."""
    names = [f"{place}.{s.name}" for place, signals in members(program).values() for s in signals]
    result = {name: size * k for k, name in enumerate(names)}
    words = len(names) + max(program.n_constants, 1) + max(len(program.step.memory), 1)
    return result | {"errors": size * words, "faulty_inputs": size * words + 4}


def a2l(program: Program, names: Names) -> str:
    """The file."""
    block, step, p = program.step.block, program.step, names.prefix
    size = 8 if names.double else 4
    kind = f"FLOAT{8 * size}_IEEE"
    at = offsets(program, size)
    found = members(program)
    units = list(dict.fromkeys(s.unit for _, signals in found.values() for s in signals))

    def limits(s: Signal) -> str:
        low = s.low if math.isfinite(s.low) else -_LARGEST[size]
        high = s.high if math.isfinite(s.high) else _LARGEST[size]
        return f"{low!r} {high!r}"

    def unit(s: Signal) -> str:
        return f"unit_{units.index(s.unit)}"

    lines = [
        "ASAP2_VERSION 1 61",
        f"/begin PROJECT {p} {_text(block.description)}",
        f"  /begin MODULE {p} {_text('addresses are offsets from the start of a context')}",
        '    /begin MOD_COMMON "" BYTE_ORDER MSB_LAST /end MOD_COMMON',
        f"    /begin RECORD_LAYOUT number FNC_VALUES 1 {kind} COLUMN_DIR DIRECT /end RECORD_LAYOUT",
        '    /begin COMPU_METHOD bits "" IDENTICAL "%10.0" "" /end COMPU_METHOD',
    ]
    lines += [
        f'    /begin COMPU_METHOD unit_{k} "" IDENTICAL "%12.6" {_text(u)} /end COMPU_METHOD'
        for k, u in enumerate(units)
    ]
    lines += [
        f"    /begin CHARACTERISTIC p.{s.name} {_text(s.description)} VALUE 0x{at[f'p.{s.name}']:X} number 0 {unit(s)} "
        f"{limits(s)} /end CHARACTERISTIC"
        for s in step.parameters
    ]
    for place, some in (found[kind] for kind in ("inputs", "outputs", "monitors")):
        lines += [
            f"    /begin MEASUREMENT {place}.{s.name} {_text(s.description)} {kind} {unit(s)} 0 0 {limits(s)} "
            f"ECU_ADDRESS 0x{at[f'{place}.{s.name}']:X} /end MEASUREMENT"
            for s in some
        ]
    for name, words in (("errors", "error signal of the last call"), ("faulty_inputs", "inputs that were rejected")):
        lines.append(
            f"    /begin MEASUREMENT {name} {_text(words)} ULONG bits 0 0 0 4294967295 ECU_ADDRESS 0x{at[name]:X} "
            "/end MEASUREMENT"
        )
    return "\n".join([*lines, "  /end MODULE", "/end PROJECT", ""])
