"""The kernel cache and the compiler behind it: damage, absence, failure, two processes at once."""

from __future__ import annotations

import ctypes
import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from gustform.language.errors import GustformError
from gustform_codegen import toolchain
from gustform_codegen.cache import KernelCache, default_folder
from gustform_codegen.emit.kernel import emit_kernel
from gustform_codegen.flatten import flatten
from tests.unit.codegen.circuits import Load
from tests.unit.codegen.compiled import INCLUDE, ROOT, CompiledKernel

SOURCE = emit_kernel(flatten(Load())).text


@pytest.fixture
def fresh(tmp_path: Path) -> KernelCache:
    return KernelCache(INCLUDE, tmp_path / "cache")


def works(path: Path) -> bool:
    return CompiledKernel(path, [2.0]).counts["n_flows"] == 1


def test_a_kernel_is_compiled_once_and_found_again(fresh: KernelCache) -> None:
    path = fresh.get(SOURCE, "Load")
    assert works(path)
    assert path.parent == fresh.folder / "kernels"
    assert path.with_suffix(".c").read_text() == SOURCE  # for whoever wants to read it
    assert fresh.get(SOURCE, "Load") == path
    assert fresh.compilations == 1
    # Nothing of the temporary folders is left.
    assert {p.suffix for p in path.parent.iterdir()} == {".so", ".c", ".sha256"}


def test_other_text_other_kernel(fresh: KernelCache) -> None:
    assert fresh.get(SOURCE, "Load") != fresh.get(SOURCE + "\n", "Load")
    assert fresh.compilations == 2


def test_the_key_depends_on_all_that_shapes_the_library(
    fresh: KernelCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = fresh.key(SOURCE)
    assert KernelCache(INCLUDE, tmp_path).key(SOURCE) == key  # not on the folder
    include = tmp_path / "include" / "gustform"
    include.mkdir(parents=True)
    header = (INCLUDE / "gustform" / "gust_kernel.h").read_text()
    (include / "gust_kernel.h").write_text(header + "/* changed */\n")
    assert KernelCache(include.parent, tmp_path).key(SOURCE) != key
    monkeypatch.setattr(toolchain, "FLAGS", (*toolchain.FLAGS, "-O1"))
    assert fresh.key(SOURCE) != key


@pytest.mark.parametrize("damage", ["cut off", "empty", "garbage", "no checksum", "a lone source", "one bit"])
def test_a_damaged_cache_is_made_anew(damage: str, fresh: KernelCache) -> None:
    path = fresh.get(SOURCE, "Load")
    content = path.read_bytes()
    # A new file each time: this process still has the old library mapped.
    path.unlink()
    if damage == "no checksum":
        path.write_bytes(content)
        path.with_suffix(".sha256").unlink()
    elif damage != "a lone source":
        flipped = bytearray(content)
        flipped[len(content) // 2] ^= 1
        path.write_bytes(
            {"cut off": content[:4000], "empty": b"", "garbage": b"\x7fELF" + b"\0" * 5000, "one bit": bytes(flipped)}[
                damage
            ]
        )
    assert fresh.get(SOURCE, "Load") == path
    assert fresh.compilations == 2
    assert works(path)


def test_gustform_cache_is_honoured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GUSTFORM_CACHE", str(tmp_path / "mine"))
    assert KernelCache(INCLUDE).get(SOURCE, "Load").is_relative_to(tmp_path / "mine")
    monkeypatch.delenv("GUSTFORM_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert default_folder() == tmp_path / "xdg" / "gustform"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert default_folder() == tmp_path / "home" / ".cache" / "gustform"


def test_folders_with_spaces_and_quotes(tmp_path: Path) -> None:
    assert works(KernelCache(INCLUDE, tmp_path / "a folder; with 'quotes' \" and $HOME").get(SOURCE, "Load"))


def test_a_cache_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(GustformError) as refusal:
        KernelCache(INCLUDE, tmp_path / "file").get(SOURCE, "Load")
    assert refusal.value.code == "GF4005"
    assert str(tmp_path / "file") in str(refusal.value)
    assert "GUSTFORM_CACHE" in refusal.value.hint
    assert (tmp_path / "file").read_text() == "in the way"


# ---- the compiler ----


def script(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


@pytest.mark.parametrize("compiler", ["/nonexistent", "no-such-compiler-anywhere"])
def test_no_compiler(compiler: str, fresh: KernelCache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", compiler)
    with pytest.raises(GustformError) as refusal:
        fresh.get(SOURCE, "Load")
    assert refusal.value.code == "GF4001"
    assert f"no C compiler: looked for $CC='{compiler}'" in str(refusal.value)
    assert "build-essential" in refusal.value.hint


def test_no_compiler_on_the_path(fresh: KernelCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(GustformError, match=r"GF4001.*cc, gcc and clang on the PATH"):
        fresh.get(SOURCE, "Load")


def test_a_compiler_that_fails_is_quoted(fresh: KernelCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = 'if [ "$1" = --version ]; then echo "mycc 1.0"; exit 0; fi; echo "disk on fire" >&2; exit 1'
    monkeypatch.setenv("CC", str(script(tmp_path, "mycc", text)))
    with pytest.raises(GustformError) as refusal:
        fresh.get(SOURCE, "Load")
    assert refusal.value.code == "GF4002"
    assert "mycc failed on type Load: disk on fire" in str(refusal.value)
    (kept,) = (fresh.folder / "kernels").glob("*.failed.c")
    assert str(kept) in str(refusal.value)
    assert kept.read_text() == SOURCE
    assert fresh.compilations == 0
    monkeypatch.delenv("CC")
    assert works(fresh.get(SOURCE, "Load"))  # the failure left nothing behind that is taken for a kernel


def test_a_compiler_that_cannot_even_say_its_version(
    fresh: KernelCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", str(script(tmp_path, "broken", "echo 'no licence found' >&2; exit 1")))
    with pytest.raises(GustformError, match=r"GF4002.*broken failed on --version: no licence found"):
        fresh.get(SOURCE, "Load")


def test_a_compiler_that_claims_success_and_writes_nothing(
    fresh: KernelCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", str(script(tmp_path, "liar", "exit 0")))
    with pytest.raises(GustformError, match=r"GF4002.*exit code 0"):
        fresh.get(SOURCE, "Load")


def test_source_that_does_not_compile(fresh: KernelCache) -> None:
    with pytest.raises(GustformError, match=r"GF4002.*failed on type Bad: .*error"):
        fresh.get("this is not C\n", "Bad")


def test_the_compiler_is_run_without_a_shell(fresh: KernelCache, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "gcc; touch /tmp/gustform-was-here")
    with pytest.raises(GustformError, match="GF4001"):
        fresh.get(SOURCE, "Load")
    assert not Path("/tmp/gustform-was-here").exists()


# ---- two processes ----

BUILD = """
import sys
from pathlib import Path
from gustform_codegen.cache import KernelCache
from gustform_codegen.emit.kernel import emit_kernel
from gustform_codegen.flatten import flatten
from tests.unit.codegen.circuits import Load
from tests.unit.codegen.compiled import INCLUDE
text = emit_kernel(flatten(Load())).text
print("ready", flush=True)
sys.stdin.readline()
cache = KernelCache(INCLUDE, Path(sys.argv[1]))
for k in range(3):
    print(cache.get(text + f"/* {k} */\\n", "Load"), flush=True)
"""


def test_two_processes_build_the_same_kernels_at_once(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", BUILD, str(tmp_path)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment,
        )
        for _ in range(2)
    ]  # fmt: skip
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    results = [process.communicate("go\n", timeout=60)[0].split() for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert results[0] == results[1]
    assert len(set(results[0])) == 3
    for path in results[0]:
        ctypes.CDLL(path)
        assert works(Path(path))
    again = KernelCache(INCLUDE, tmp_path)
    for k in range(3):
        again.get(SOURCE + f"/* {k} */\n", "Load")
    assert again.compilations == 0
    assert {p.suffix for p in (tmp_path / "kernels").iterdir()} == {".so", ".c", ".sha256"}
