"""What a compiler says about stack and sizes, read right: frames, chains of calls, refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from gustform.language.errors import GustformError
from gustform_codegen.emit.controller.footprint import (
    FLAGS,
    Target,
    _run,
    call_graph,
    stack_usage,
    worst_chain,
)
from gustform_codegen.toolchain import find_compiler

CHAIN = """
int leaf(int x);
static int __attribute__((noinline)) low(int x) { volatile int a[32]; a[0] = x; return a[0] + leaf(a[0]); }
static int __attribute__((noinline)) side(int x) { volatile int a[4]; a[0] = x; return a[0] + leaf(a[0]); }
int top(int x);
int top(int x) { volatile int a[8]; a[0] = side(x); return a[0] + low(a[0]); }
"""


def compiled(source: str, folder: Path) -> tuple[dict[str, int], dict[str, list[str]]]:
    (folder / "some.c").write_text(source)
    options = ["-O1", "-fstack-usage", "-fcallgraph-info=su", "-c", "-o", str(folder / "some.o")]
    _run(["gcc", *options, str(folder / "some.c")])
    return stack_usage((folder / "some.su").read_text()), call_graph((folder / "some.ci").read_text())


def test_the_worst_chain_is_that_of_the_compiler(tmp_path: Path) -> None:
    frames, calls = compiled(CHAIN, tmp_path)
    assert set(frames) == {"low", "side", "top"}
    assert frames["low"] >= 128 > frames["side"] >= 16  # their arrays
    assert worst_chain(frames, calls) == ["top", "low"]
    assert {c for callees in calls.values() for c in callees} - set(frames) == {"leaf"}


def test_what_has_no_bound_is_refused(tmp_path: Path) -> None:
    grows = "int any(int n); int any(int n) { volatile int a[n]; a[0] = n; return a[0]; }"
    with pytest.raises(GustformError, match=r"GF4104.*frame of any has no fixed size"):
        compiled(grows, tmp_path)
    frames, calls = compiled("int f(int n); int f(int n) { return n < 2 ? 1 : n * f(n - 1) + f(n / 2); }", tmp_path)
    with pytest.raises(GustformError, match=r"GF4104.*f calls itself"):
        worst_chain(frames, calls)


def test_a_compiler_that_fails_says_so(tmp_path: Path) -> None:
    (tmp_path / "bad.c").write_text("int f(void) { return nothing; }")
    target = Target("host", find_compiler().path, "size", FLAGS)
    with pytest.raises(GustformError, match=r"GF4104.*failed: .*"):
        _run([target.compiler, *target.flags, "-c", str(tmp_path / "bad.c"), "-o", str(tmp_path / "bad.o")])
    with pytest.raises(GustformError, match=r"GF4104.*could not be run"):
        _run([str(tmp_path / "nobody")])
