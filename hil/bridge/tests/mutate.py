#!/usr/bin/env python3
"""Mutations of supervision.c, each of which its unit tests must catch.

    python hil/bridge/tests/mutate.py              all of them
    python hil/bridge/tests/mutate.py --sample 60  so many, drawn with a fixed seed

An operator is exchanged, a constant changed, a condition negated or a statement deleted; the file is compiled and
test_supervision.c runs against it. A mutant is caught when a test fails, crashes or does not end. Those that nobody can
tell from the original stand in EQUIVALENT with the reason; one that survives and is not there, or is there and does not
survive, is an error. Needs a C compiler and cmocka.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

BRIDGE = Path(__file__).resolve().parents[1]
SOURCE = BRIDGE / "src" / "supervision.c"
TEST = BRIDGE / "tests" / "test_supervision.c"
SEED = 20260922
TIMEOUT = 20.0  # s, of a run; 0.01 s is usual
WARNINGS = ("-w", "-std=c11", "-O0", f"-I{BRIDGE / 'include'}")

# What an operator becomes. Longer ones first, so that "<=" is never taken for "<".
OPERATORS = {
    "++": ("--",),
    "+=": ("-=", "="),
    "|=": ("&=", "="),
    "&&": ("||",),
    "||": ("&&",),
    "==": ("!=",),
    "!=": ("==",),
    "<=": ("<", ">"),
    ">=": (">", "<"),
    " < ": (" <= ", " > "),
    " > ": (" >= ", " < "),
    " + ": (" - ",),
    " - ": (" + ",),
    " * ": (" + ",),
    " % ": (" + ",),
    " | ": (" & ",),
    " & ": (" | ",),
    "!": ("",),
    "~": ("",),
}
# Constants of a family become the next one.
FAMILIES = (
    ("GUST_STATE_INIT", "GUST_STATE_READY", "GUST_STATE_RUN", "GUST_STATE_SAFE"),
    ("GUST_COMMAND_START", "GUST_COMMAND_STOP", "GUST_COMMAND_RESET"),
    ("GUST_ANSWER_DONE", "GUST_ANSWER_REPEATED", "GUST_ANSWER_REFUSED"),
    ("GUST_CONVERTER_READY", "GUST_CONVERTER_RUNNING", "GUST_CONVERTER_TRIPPED"),
    ("true", "false"),
)
FAULT = re.compile(r"\bGUST_FAULT_[A-Z_]+\b")
NUMBER = re.compile(r"\b(0x[0-9a-f]+|\d+)(U?)\b")
STATEMENT = re.compile(r"^\s+(?=\S)(?!return\b|const\b|uint|int|bool\b|double\b)[^{}]*;$")
CONDITION = re.compile(r"\bif \((.*)\) \{$")

# (line, mutant): why no test can tell it from the original.
EQUIVALENT: dict[tuple[str, str], str] = {}


@dataclass(frozen=True)
class Mutant:
    """One changed line, numbered from 1."""

    number: int
    original: str
    changed: str

    @property
    def key(self) -> tuple[str, str]:
        return self.original.strip(), self.changed.strip()

    def __str__(self) -> str:
        return f"{SOURCE.name}:{self.number}: {self.original.strip()}  ->  {self.changed.strip() or '(deleted)'}"


def mutants(text: str) -> list[Mutant]:
    """All of them, in the order of the file, each changed line once."""
    found: dict[tuple[int, str], Mutant] = {}
    comment = False
    for number, line in enumerate(text.splitlines(), 1):
        code, comment = _without_comments(line, comment)
        if not code.strip() or code.startswith("#") or _is_head(code):
            continue
        for changed in _changes(code):
            if changed != code:
                found.setdefault((number, changed), Mutant(number, line, changed))
    return list(found.values())


def _without_comments(line: str, comment: bool) -> tuple[str, bool]:
    """The line's code with its columns; whether a comment goes on after it."""
    if comment:
        return ("", "*/" not in line)
    begin = line.find("/*")
    if begin < 0:
        return line, False
    return line[:begin].rstrip(), "*/" not in line[begin:]


def _is_head(code: str) -> bool:
    """Heads of functions: their asterisks and parameters are no operators."""
    return not code.startswith(" ")


def _changes(code: str) -> Iterator[str]:
    yield from _exchanged(code)
    for family in FAMILIES:
        for index, name in enumerate(family):
            for match in re.finditer(rf"\b{name}\b", code):
                yield _put(code, match, family[(index + 1) % len(family)])
    for match in FAULT.finditer(code):
        yield _put(code, match, "GUST_FAULT_DEADLINE" if "DEADLINE" not in match[0] else "GUST_FAULT_SEND")
    for match in NUMBER.finditer(code):
        yield _put(code, match, f"{int(match[1], 0) + 1}{match[2]}")
    condition = CONDITION.search(code)
    if condition:
        yield _put(code, condition, f"if (!({condition[1]})) {{")
    if STATEMENT.match(code):
        yield re.sub(r"\S.*", ";", code)


def _exchanged(code: str) -> Iterator[str]:
    position = 0
    while position < len(code):
        for operator, others in OPERATORS.items():
            if code.startswith(operator, position) and not code.startswith("->", position):
                for other in others:
                    yield code[:position] + other + code[position + len(operator) :]
                position += max(0, len(operator.rstrip()) - 1)
                break
        position += 1


def _put(code: str, match: re.Match[str], text: str) -> str:
    return code[: match.start()] + text + code[match.end() :]


class Bench:
    """Compiles and runs. `folder` is the caller's, and temporary."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.compiler = os.environ.get("CC", "cc")
        self.text = SOURCE.read_text()
        self.test = folder / "test.o"
        subprocess.run([self.compiler, *WARNINGS, "-c", str(TEST), "-o", str(self.test)], check=True)

    def caught(self, mutant: Mutant | None) -> bool | None:
        """Whether a test fails; None if it does not even compile. Without a mutant: the original."""
        lines = self.text.splitlines()
        if mutant is not None:
            lines[mutant.number - 1] = mutant.changed
        name = "original" if mutant is None else f"{mutant.number}_{abs(hash(mutant.changed))}"
        source, program = self.folder / f"{name}.c", self.folder / name
        source.write_text("\n".join(lines) + "\n")
        compiled = [self.compiler, *WARNINGS, str(source), str(self.test), "-lcmocka", "-lm", "-o", str(program)]
        if subprocess.run(compiled, capture_output=True, check=False).returncode != 0:
            return None
        try:
            run = subprocess.run([str(program)], capture_output=True, check=False, timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            return True
        finally:
            program.unlink()
            source.unlink()
        return run.returncode != 0


def main(arguments: list[str] | None = None) -> int:
    """0 if every mutant is caught."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, metavar="N", help="only N of them, drawn with a fixed seed")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    options = parser.parse_args(arguments)
    begun = time.monotonic()
    chosen = everything = mutants(SOURCE.read_text())
    if options.sample is not None and options.sample < len(everything):
        chosen = random.Random(SEED).sample(everything, options.sample)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        if bench.caught(None) is not False:
            print("the tests fail on the original", file=sys.stderr)
            return 1
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            results = list(zip(chosen, pool.map(bench.caught, chosen), strict=True))
    survived = [mutant for mutant, caught in results if caught is False]
    unexplained = [mutant for mutant in survived if mutant.key not in EQUIVALENT]
    wrong = [mutant for mutant, caught in results if caught and mutant.key in EQUIVALENT]
    unknown = EQUIVALENT.keys() - {mutant.key for mutant in everything}
    figures = {
        "mutants": len(chosen),
        "of": len(everything),
        "caught": sum(caught is True for _, caught in results),
        "equivalent": len(survived) - len(unexplained),
        "survived": len(unexplained),
        "not_compiled": sum(caught is None for _, caught in results),
        "seconds": round(time.monotonic() - begun, 1),
    }
    print(json.dumps(figures) if options.json else ", ".join(f"{k} {v}" for k, v in figures.items()))
    for mutant in unexplained:
        print(f"survived: {mutant}", file=sys.stderr)
    for mutant in wrong:
        print(f"listed as equivalent, but caught: {mutant}", file=sys.stderr)
    for line, changed in sorted(unknown):
        print(f"listed as equivalent, but no mutant: {line}  ->  {changed}", file=sys.stderr)
    return 1 if unexplained or wrong or unknown else 0


if __name__ == "__main__":
    sys.exit(main())
