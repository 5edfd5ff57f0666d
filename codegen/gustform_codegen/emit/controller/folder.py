"""The folder of an exported controller: self-contained, and the same bytes each time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.a2l import a2l
from gustform_codegen.emit.controller.c_header import Names, errors_of, header
from gustform_codegen.emit.controller.c_source import source
from gustform_codegen.emit.controller.description import as_json
from gustform_codegen.emit.controller.host_test import host_test, vectors_header
from gustform_codegen.emit.controller.interface import common_header, interface_header, interface_source
from gustform_codegen.emit.controller.program import Program
from gustform_codegen.emit.controller.signals import Signal
from gustform_codegen.emit.controller.vectors import recorded

SAMPLES = 400  # of the recorded vectors
WARNINGS = (
    "-Wall -Wextra -Wpedantic -Wconversion -Wdouble-promotion -Wfloat-conversion -Wshadow -Wsign-conversion "
    "-Wcast-qual -Wundef -Werror"
)
_RESERVED = {
    "auto", "break", "case", "char", "class", "const", "continue", "default", "delete", "do", "double", "else", "enum",
    "extern", "float", "for", "goto", "if", "inline", "int", "long", "new", "private", "public", "real", "register",
    "restrict", "return", "short", "signed", "sizeof", "static", "struct", "switch", "template", "this", "try",
    "typedef", "union", "unsigned", "virtual", "void", "volatile", "while",
}  # fmt: skip


def check_prefix(prefix: str) -> str:
    """The prefix if it can begin names in C. GF2071."""
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", prefix) or prefix in _RESERVED:
        raise GustformError(
            "GF2071",
            f"the prefix must be a name in C of lower-case letters, digits and _, at most 31; got {prefix!r}",
            hint="dual_port",
        )
    return prefix


def default_prefix(name: str) -> str:
    """dual_port of DualPort."""
    return check_prefix(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower())


def files(program: Program, prefix: str, double: bool) -> dict[str, str]:
    """All files of the folder by name."""
    names = Names(check_prefix(prefix), double)
    inputs, outputs = recorded(program, SAMPLES)
    return {
        f"{prefix}.h": header(program, names),
        f"{prefix}.c": source(program, names),
        "gust_controller.h": common_header(),
        f"{prefix}_interface.h": interface_header(names),
        f"{prefix}_interface.c": interface_source(program, names),
        f"{prefix}.json": as_json(program, names),
        f"{prefix}.a2l": a2l(program, names),
        f"test_{prefix}.c": host_test(program, names),
        "vectors.h": vectors_header(inputs, outputs),
        "CMakeLists.txt": _cmake(prefix),
        "README.md": _readme(program, names),
    }


def write_folder(program: Program, prefix: str, double: bool, out: Path) -> list[Path]:
    """Write the folder; the paths of its files. GF7001 if it cannot be written."""
    texts = files(program, prefix, double)
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (out / name).write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise GustformError(
            "GF7001", f"the folder {str(out)!r} must be writable; {error.strerror}", hint="--out with another folder"
        ) from None
    return [out / name for name in texts]


def _cmake(prefix: str) -> str:
    return f"""# cmake -S . -B build && cmake --build build && ctest --test-dir build
cmake_minimum_required(VERSION 3.16)
project({prefix} C)

set(CMAKE_C_STANDARD 99)
set(CMAKE_C_STANDARD_REQUIRED ON)
set(CMAKE_C_EXTENSIONS OFF)
if(NOT CMAKE_BUILD_TYPE)
    set(CMAKE_BUILD_TYPE Release)
endif()

add_library({prefix} STATIC {prefix}.c {prefix}_interface.c)
target_include_directories({prefix} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
# No fused multiply-add: the same bits on every machine.
target_compile_options({prefix} PRIVATE -ffp-contract=off)
target_link_libraries({prefix} PUBLIC m)

# The same behind gust_controller_interface(), for a program that loads it.
add_library({prefix}_library MODULE {prefix}.c {prefix}_interface.c)
target_compile_definitions({prefix}_library PRIVATE GUST_CONTROLLER_LIBRARY)
target_compile_options({prefix}_library PRIVATE -ffp-contract=off)
target_link_libraries({prefix}_library PRIVATE m)
set_target_properties({prefix}_library PROPERTIES PREFIX "" OUTPUT_NAME {prefix})

enable_testing()
foreach(real 0 1)
    add_executable(test_{prefix}_${{real}} test_{prefix}.c {prefix}.c {prefix}_interface.c)
    target_compile_definitions(test_{prefix}_${{real}} PRIVATE {prefix.upper()}_DOUBLE=${{real}})
    target_compile_options(test_{prefix}_${{real}} PRIVATE -ffp-contract=off)
    target_link_libraries(test_{prefix}_${{real}} PRIVATE m)
    add_test(NAME {prefix}_${{real}} COMMAND test_{prefix}_${{real}})
endforeach()
"""


def _rows(signals: Sequence[Signal], start: str) -> list[str]:
    lines = [f"| name | unit | range | {start} | |", "|---|---|---|---|---|"]
    for s in signals:
        low = f"{'above ' if s.exclusive else ''}{s.low:g}" if s.low > -float("inf") else ""
        high = f"{s.high:g}" if s.high < float("inf") else ""
        lines.append(f"| `{s.name}` | {s.unit} | {low} … {high} | {s.value:.9g} | {s.description} |")
    return lines


def _tables(program: Program) -> list[str]:
    tables = program.step.block.tables
    if not tables:
        return []
    lines = [
        "## Tables",
        "",
        "| name | unit | first argument | second argument | numbers | |",
        "|---|---|---|---|---|---|",
    ]
    for g in tables:
        s = g.spline
        lines.append(
            f"| `{g.name}` | {g.declared.unit} | {s['x_start']:g} … {g.x_end:g} | {s['y_start']:g} … {g.y_end:g} "
            f"| {s['coefficient'].size} | {g.declared.description} |"
        )
    return [
        *lines,
        "",
        "Constant data of the object: coefficients of bicubic splines on uniform grids. Beyond a grid its edge counts.",
        "",
    ]


def _monitors(signals: list[Signal]) -> list[str]:
    if not signals:
        return []
    text = "To be looked at, for a log or a calibration tool: nothing is commanded by them. Members of `mon`."
    return ["## Monitors", "", *_rows(signals, "start"), "", text, ""]


def _readme(program: Program, names: Names) -> str:
    block, step, p, upper = program.step.block, program.step, names.prefix, names.upper
    warped = [f"- `{name}` is pre-warped at {w:.4g} rad/s." for name, w in step.prewarped.items()]
    lines = [
        f"# {p}: sampled controller",
        "",
        f"{block.name}: {block.description} With the demand of the pitch control; the servo behind it is plant.",
        "",
        f"- Period {step.period:g} s. Discretised by {step.method.value}; outputs belong to the sample they were",
        "  computed from.",
        f"- `{p}_real` is {'double' if names.double else 'float'}; `-D{upper}_DOUBLE=0` or `=1`, the same for all",
        "  files, chooses the other one.",
        "- C99 and C++. No heap, no static data, no recursion, bounded loops; of the C library `sqrt` and `floor`",
        "  alone.",
        "- Compile with `-ffp-contract=off`: results are then the same bits on all machines with IEEE 754 arithmetic.",
        "- `footprint.json`, where the export found a compiler: frames on the stack, worst chain of calls, size of the",
        "  object. It is the one file that depends on the machine of the export.",
        *warped,
        "",
        "```c",
        f'#include "{p}.h"',
        "",
        f"{p}_context c;",
        f"(void){p}_startup(&c);",
        "for (;;) {              /* each period */",
        f"    c.in.{block.inputs[0].name} = measured;",
        f"    errors = {p}_step(&c);",
        f"    command = c.out.{block.outputs[0].name};",
        "}",
        "```",
        "",
        f"A program that runs any controller takes `{p}_interface.h`: one table of signals and functions,",
        f"`{p}_controller`, or `gust_controller_interface()` of the shared library `{p}.so`; see `gust_controller.h`.",
        "",
        "`cmake -S . -B build && cmake --build build && ctest --test-dir build` runs the recorded vectors in float and",
        f"in double. `{p}.json` has all of the tables below with stable ids.",
        "",
        "## Inputs",
        "",
        *_rows(block.inputs, "start"),
        "",
        "A sample with an input that is NaN, infinite or out of its range is not acted upon: state and outputs stay as",
        "they were, the error signal tells why, `faulty_inputs` which. The next good sample goes on from there.",
        "",
        "## Outputs",
        "",
        *_rows(block.outputs, "start"),
        "",
        "Always finite and within the range, from startup on.",
        "",
        *_monitors(block.monitors),
        "## Parameters",
        "",
        *_rows(step.parameters, "default"),
        "",
        f"Write them into `p`, then call `{p}_recalibrate`: all are taken over or, if one is out of its range, none.",
        "",
        *_tables(program),
        "## Error signal",
        "",
        "| bit | name | |",
        "|---|---|---|",
        *[f"| {mask.bit_length() - 1} | `{upper}_{name}` | {text} |" for mask, name, text in errors_of(program)],
        "",
    ]
    return "\n".join(lines)
