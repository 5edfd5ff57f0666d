"""The habits of the project: layers, documented commands, make targets, tidy files. CONTRIBUTING.md states them."""

from __future__ import annotations

import importlib.util
import os
import re
import shlex
import stat
import subprocess
import sys
import sysconfig
import tomllib
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "hil/README.md")),
    *sorted(ROOT.glob("docs/**/*.md")),
]
DOCUMENTS = [path for path in DOCUMENTS if "_build" not in path.parts]


def environment() -> dict[str, str]:
    """The environment for programs under test: this Python's programs and our packages first, and no make above."""
    kept = {key: value for key, value in os.environ.items() if key not in {"MAKEFLAGS", "MAKELEVEL", "MFLAGS"}}
    packages = [str((ROOT / folder).parent) for folder in pyproject()["tool"]["scikit-build"]["wheel"]["packages"]]
    return kept | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": os.pathsep.join(packages)}


def run(*command: str | Path, cwd: Path = ROOT, timeout: float = 60) -> subprocess.CompletedProcess[str]:
    """Runs a program to its end, with its output as text."""
    return subprocess.run(command, cwd=cwd, env=environment(), capture_output=True, text=True, timeout=timeout)


def pyproject() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


# ---- Layers ---------------------------------------------------------------------------------------------------------


def test_layers_hold() -> None:
    result = run("lint-imports")
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize(
    ("importer", "imported"),
    [
        ("gustform", "gustform_codegen"),
        ("gustform", "gustform_cli"),
        ("gustform_codegen", "gustform_cli"),
        ("gustform", "gustform_runtime"),
        ("gustform_codegen", "gustform_runtime"),
        ("gustform_runtime", "gustform"),
        ("gustform_runtime", "casadi"),
        ("gustform_runtime", "xarray"),
        ("gustform", "pint"),
        ("gustform_codegen", "typer"),
    ],
)
def test_a_seeded_violation_of_the_layers_is_found(importer: str, imported: str, tmp_path: Path) -> None:
    # Under other names, because an editable install would find the real packages first.
    def other(text: str) -> str:
        return text.replace("gustform", "seeded")

    (tmp_path / "pyproject.toml").write_text(other((ROOT / "pyproject.toml").read_text()))
    for package in pyproject()["tool"]["importlinter"]["root_packages"]:
        (tmp_path / other(package)).mkdir()
        text = f"import {other(imported)}\n" if package == importer else ""
        (tmp_path / other(package) / "__init__.py").write_text(text)
    result = run("lint-imports", "--no-cache", cwd=tmp_path)
    assert result.returncode == 1, result.stdout
    assert "BROKEN" in result.stdout


# ---- make -----------------------------------------------------------------------------------------------------------


def targets_in_help() -> set[str]:
    printed = run("make", "help").stdout
    return set(re.findall(r"^ +([a-z-]+)  +\S", printed, flags=re.MULTILINE))


def test_every_make_target_is_in_help() -> None:
    phony = set(re.findall(r"^\.PHONY: ([a-z-]+)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    assert {"demo", "test", "bench", "lint", "format", "docs", "clean", "help"} <= phony
    assert targets_in_help() == phony


def test_make_alone_prints_the_help() -> None:
    assert run("make").stdout == run("make", "help").stdout


def test_ci_runs_make_test_in_strict_mode() -> None:
    script = ROOT / ".ci" / "run"
    assert script.stat().st_mode & stat.S_IXUSR
    lines = script.read_text().splitlines()
    assert lines[0] == "#!/usr/bin/env bash"
    assert "set -euo pipefail" in lines
    assert any(re.search(r"\bmake\b.* test\b", line) for line in lines)


@pytest.mark.parametrize("script", sorted([ROOT / ".ci" / "run", *ROOT.glob("tools/*.sh")]), ids=lambda path: path.name)
def test_shell_scripts_parse(script: Path) -> None:
    result = run("bash", "-n", script)
    assert result.returncode == 0, result.stderr


# ---- System packages ------------------------------------------------------------------------------------------------


def path_without(programs: set[str], folder: Path) -> str:
    """A PATH of one folder that links to every program there is, except for these."""
    folder.mkdir()
    for place in reversed(os.environ["PATH"].split(os.pathsep)):
        for program in Path(place).iterdir() if Path(place).is_dir() else []:
            if program.name not in programs:
                link = folder / program.name
                link.unlink(missing_ok=True)
                link.symlink_to(program)
    return str(folder)


def test_without_root_the_line_to_install_is_printed(tmp_path: Path) -> None:
    programs = tmp_path / "programs"
    variables = environment() | {"PATH": path_without({"ninja", "cmake", "sudo", "apt-get", "id"}, programs)}
    for name, text in {"id": "echo 1000", "apt-get": "echo apt-get was called >&2; exit 99"}.items():
        (programs / name).write_text(f"#!/bin/sh\n{text}\n")
        (programs / name).chmod(0o755)
    result = subprocess.run(
        [ROOT / "tools" / "system_packages.sh", "--python", sys.executable],
        env=variables,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert result.returncode == 1
    assert "sudo apt-get update && sudo apt-get install --no-install-recommends cmake ninja-build\n" in result.stderr


def test_without_apt_the_packages_are_named(tmp_path: Path) -> None:
    variables = environment() | {"PATH": path_without({"ninja", "apt-get"}, tmp_path / "programs")}
    result = subprocess.run(
        [ROOT / "tools" / "system_packages.sh", "--python", sys.executable],
        env=variables,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert result.returncode == 1
    assert "missing, by the names of their Debian packages: ninja-build" in result.stderr


def test_an_old_python_is_refused_with_the_way_out(tmp_path: Path) -> None:
    old = tmp_path / "python3"
    old.write_text('#!/bin/sh\nif [ "$1" = -V ]; then echo Python 3.9.2; else exit 1; fi\n')
    old.chmod(0o755)
    result = run(ROOT / "tools" / "system_packages.sh", "--python", old)
    assert result.returncode == 1
    assert "needs Python 3.11 or newer" in result.stderr
    assert "Python 3.9.2" in result.stderr
    assert "make PYTHON=" in result.stderr


# ---- pyproject ------------------------------------------------------------------------------------------------------


def test_every_requirement_is_pinned_to_a_version_it_allows() -> None:
    project = pyproject()["project"]
    extras = project["optional-dependencies"]
    pinned = {}
    for line in (ROOT / "tools" / "constraints.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            name, version = line.split("==")
            pinned[canonicalize_name(name)] = version
    for text in [*project["dependencies"], *extras["dev"], *extras["docs"], *pyproject()["build-system"]["requires"]]:
        requirement = Requirement(text)
        assert requirement.specifier, f"{text} has no floor"
        assert requirement.specifier.contains(pinned[canonicalize_name(requirement.name)]), text


def test_each_package_is_typed_and_known_to_every_tool() -> None:
    tools = pyproject()["tool"]
    packages = {Path(folder).name: ROOT / folder for folder in tools["scikit-build"]["wheel"]["packages"]}
    assert set(tools["importlinter"]["root_packages"]) == set(packages)
    assert set(packages) <= set(tools["ruff"]["lint"]["isort"]["known-first-party"])
    for name, folder in packages.items():
        assert (folder / "__init__.py").is_file(), name
        assert (folder / "py.typed").is_file(), name
        assert folder.parent.name in tools["mypy"]["files"]


@pytest.mark.timeout(600)
def test_the_wheel_holds_all_that_running_needs(tmp_path: Path) -> None:
    built = run(
        *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", tmp_path, "."),
        timeout=500,
    )
    assert built.returncode == 0, built.stderr
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    installed = run(sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, wheel)
    assert installed.returncode == 0, installed.stderr
    program = "import gustform_runtime as r; print(r.library_path(), r.include_dir() / 'gustform/gust_kernel.h')"
    # -S leaves the editable install out: its path entries would win.
    found = subprocess.run(
        [sys.executable, "-S", "-c", program],
        cwd=tmp_path,
        env=environment() | {"PYTHONPATH": os.pathsep.join([str(site), sysconfig.get_path("platlib")])},
        capture_output=True,
        text=True,
        timeout=60,
    )
    paths = [Path(word) for word in found.stdout.split()]
    assert len(paths) == 2, found.stderr
    assert all(path.is_file() and path.is_relative_to(site) for path in paths)
    assert run(site / "gustform_runtime" / "bin" / "gust-run", "--help").returncode == 0
    assert list(site.glob("gustform_cli/scenarios/*.yaml"))
    for pattern in ("can/*.dbc", "can/*.yaml", "bridge/include/gustform_bridge/*.h", "bridge/src/*.c", "pil/*.c"):
        shipped = [path.relative_to(ROOT / "hil") for path in (ROOT / "hil").glob(pattern)]
        assert shipped, pattern
        assert all((site / "gustform_hil" / path).is_file() for path in shipped), pattern
    assert not (site / "gustform_hil" / "bridge" / "tests").exists()
    assert not list(site.glob("**/*.o"))


def test_hooks_are_local_and_valid() -> None:
    from ruamel.yaml import YAML

    configuration = YAML(typ="safe").load(ROOT / ".pre-commit-config.yaml")
    assert [entry["repo"] for entry in configuration["repos"]] == ["local"]
    result = run("pre-commit", "validate-config")
    assert result.returncode == 0, result.stdout


# ---- Files ----------------------------------------------------------------------------------------------------------


def load_tool(name: str) -> ModuleType:
    specification = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_files_are_small_tidy_and_written_by_people() -> None:
    result = run(sys.executable, "tools/check_files.py")
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"x" * 100_001 + b"\n", "at most 100000 are kept"),
        (b"a\r\nb\r\n", "carriage returns"),
        (b"no end", "the last line has no line feed"),
        (b"end\n\n\n", "blank lines at the end"),
        (b"a \nb\n", ":1: trailing space"),
        (b"a\n<<<<<<< HEAD\n", ":2: merge conflict marker"),
        (b"\xff\xfe", "not UTF-8 at byte 0"),
    ],
)
def test_a_seeded_fault_in_a_file_is_found(content: bytes, complaint: str) -> None:
    found = list(load_tool("check_files").complaints_about(Path("some.py"), content))
    assert len(found) == 1
    assert complaint in found[0]


def test_a_committed_product_is_found(tmp_path: Path) -> None:
    for command in (["init", "-q"], ["add", "-f", "a.so", ".gitignore"]):
        (tmp_path / ".gitignore").write_text("*.so\n")
        (tmp_path / "a.so").write_bytes(b"\x7fELF\0")
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    assert load_tool("check_files").tracked_but_ignored(tmp_path) == ["a.so"]


# ---- Documents ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Command:
    """One command line of a document."""

    document: Path
    line: int
    text: str

    @property
    def words(self) -> list[str]:
        """The words of the line without comments, in the shell's sense."""
        return shlex.split(self.text, comments=True)

    def __str__(self) -> str:
        return f"{self.document.name}:{self.line}: {self.text}"


def commands_of(document: Path, text: str) -> list[Command]:
    """The command lines in the sh, bash and console blocks of a Markdown text.

    In a block with prompts only the lines after `$ ` are commands and the others show output; in a block without
    prompts every line is one. A backslash at the end joins the next line; comments and blank lines are left out.
    """
    found: list[Command] = []
    block: list[tuple[int, str]] | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        if block is None:
            if re.fullmatch(r"\s*```(sh|bash|shell|console)\s*", line):
                block = []
        elif line.strip().startswith("```"):
            prompts = any(text.lstrip().startswith("$ ") for _, text in block)
            joined = ""
            for at, text in block:
                stripped = text.strip()
                if not joined:
                    if prompts and not stripped.startswith("$ "):
                        continue
                    stripped = stripped.removeprefix("$ ")
                joined += stripped
                if joined.endswith("\\"):
                    joined = joined[:-1]
                    continue
                if shlex.split(joined, comments=True):
                    found.append(Command(document, at, joined))
                joined = ""
            block = None
        else:
            block.append((number, line))
    return found


def test_the_extractor_reads_both_kinds_of_block() -> None:
    text = "\n".join(
        [
            "```sh",
            "# a comment",
            "make demo   # sets up",
            "gustform simulate a.yaml \\",
            "    --out there",
            "```",
            "```console",
            "$ gustform info",
            "output",
            "```",
            "```yaml",
            "make: no command",
            "```",
        ]
    )
    found = commands_of(Path("x.md"), text)
    assert [(command.line, command.words) for command in found] == [
        (3, ["make", "demo"]),
        (5, ["gustform", "simulate", "a.yaml", "--out", "there"]),
        (8, ["gustform", "info"]),
    ]


ALL_COMMANDS = [command for path in DOCUMENTS for command in commands_of(path, path.read_text())]

RUN = {"gustform", "python", "python3", "gust-run", "with-vcan"}
"""Programs whose lines in a document are run, in order, in one folder that looks like the work tree."""


def test_readme_shows_the_two_commands_first() -> None:
    assert [command.words for command in ALL_COMMANDS if command.document.name == "README.md"][:2] == [
        ["make", "demo"],
        ["make", "test"],
    ]


@pytest.mark.parametrize("command", ALL_COMMANDS, ids=str)
def test_documented_commands_exist(command: Command) -> None:
    words = command.words
    program = Path(words[0]).name
    if program == "make":
        targets = [word for word in words[1:] if "=" not in word and not word.startswith("-")]
        assert set(targets) <= targets_in_help()
    elif words[:3] == ["sudo", "ip", "link"]:
        pass  # a real interface
    elif program in {"sudo", "apt-get"}:
        ours = run("tools/system_packages.sh", "--tests", "--print").stdout.split()
        packages = {word for word in words if word not in {"sudo", "apt-get", "update", "install", "&&", "-y", "--yes"}}
        assert packages <= set(ours)
    elif program in {"git", "cd", "source", "."}:
        pass
    elif program == "bash":
        assert (ROOT / words[1]).is_file()
    else:
        assert program in RUN, f"teach this test how to check {command}"


WITH_COMMANDS = sorted({c.document for c in ALL_COMMANDS if Path(c.words[0]).name in RUN})


@pytest.mark.timeout(600)
@pytest.mark.parametrize("document", WITH_COMMANDS, ids=lambda path: path.name)
def test_documented_commands_run(document: Path, tmp_path: Path) -> None:
    # Results land in the folder, while every path into the work tree is good.
    for name in {path.parts[0] for path in load_tool("check_files").work_tree_files(ROOT)}:
        (tmp_path / name).symlink_to(ROOT / name)
    for command in commands_of(document, document.read_text()):
        program = Path(command.words[0]).name
        if command.words[:2] == ["make", "demo"]:
            result = run("make", "-C", ROOT, "demo", f"DEMO_OUT={tmp_path / 'demo'}", timeout=500)
        elif program in RUN:
            result = run("bash", "-c", command.text, cwd=tmp_path, timeout=300)
        else:
            continue
        assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"


def test_the_readme_shows_the_code_that_runs() -> None:
    """Every line of its component but the docstring, which is shortened, stands in the source in the same order."""
    block = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), flags=re.DOTALL | re.MULTILINE)[0]
    source = iter((ROOT / "library/gustform/electrical/dc_link.py").read_text().splitlines())
    for line in block.splitlines():
        assert '"""' in line or line in source, line


def test_the_tutorial_does_what_it_says(tmp_path: Path) -> None:
    """Its Python blocks, one after the other, print what it shows as their output."""
    text = (ROOT / "docs" / "tutorial.md").read_text()
    program = tmp_path / "tutorial.py"
    program.write_text("\n".join(re.findall(r"^```python\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)))
    shown = re.findall(r"^```text\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    result = run(sys.executable, program)
    assert result.returncode == 0, result.stderr
    assert result.stdout == "".join(shown)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_between_files_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", document.read_text()):
        if not re.match(r"[a-z]+:|#", target):
            path = document.parent / target.split("#")[0]
            assert path.exists(), f"{document.relative_to(ROOT)} links to {target}"


def test_changelog_is_written_in_sentences() -> None:
    text = (ROOT / "CHANGELOG.md").read_text()
    assert "## [Unreleased]" in text or re.search(r"^## \[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d$", text, flags=re.MULTILINE)
    entries = re.findall(r"^- (.+(?:\n  .+)*)", text, flags=re.MULTILINE)
    assert entries
    for entry in entries:
        assert re.match(r"[A-Z`]", entry), entry
        assert entry.endswith("."), entry
