"""Checks the files that git tracks or would add: plain text habits, sizes, and nothing that a program writes.

    python tools/check_files.py [FILE ...]

Without arguments every such file of the work tree is checked. Each complaint is one line, "path:line: what is wrong",
and the exit status is 1 if there is any. The hooks and tests/unit/test_project.py call the same functions.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

MAX_BYTES = 100_000
"""A repository that everyone clones holds sources, not data: larger inputs are made or fetched by what needs them."""

# Markdown ends a line with two spaces to break it; make and git want their tabs, so tabs are not checked.
TRAILING_SPACE_ALLOWED = {".md"}
CONFLICT_MARKERS = ("<<<<<<< ", ">>>>>>> ")


def work_tree_files(root: Path) -> list[Path]:
    """Files that are tracked or would be added, relative to `root`, without those deleted in the work tree."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=root,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return sorted(path for name in set(listed.split("\0")) if name and (root / (path := Path(name))).is_file())


def tracked_but_ignored(root: Path) -> list[str]:
    """Tracked files that .gitignore names: something a program writes was committed."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--ignored", "--exclude-standard"],
        cwd=root,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    return sorted(name for name in listed.split("\0") if name)


def complaints_about(path: Path, content: bytes) -> Iterator[str]:
    """What is wrong with one file, given its path and content."""
    if len(content) > MAX_BYTES:
        yield f"{path}: {len(content)} bytes; at most {MAX_BYTES} are kept in the repository"
    if b"\0" in content:
        return
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        yield f"{path}: not UTF-8 at byte {error.start}"
        return
    if "\r" in text:
        yield f"{path}: has carriage returns; lines end with a line feed alone"
    if text and not text.endswith("\n"):
        yield f"{path}:{text.count(chr(10)) + 1}: the last line has no line feed"
    if text.endswith("\n\n"):
        yield f"{path}:{text.count(chr(10))}: blank lines at the end"
    for number, line in enumerate(text.splitlines(keepends=True), start=1):
        if path.suffix not in TRAILING_SPACE_ALLOWED and line.rstrip("\r\n") != line.rstrip():
            yield f"{path}:{number}: trailing space"
        if line.startswith(CONFLICT_MARKERS):
            yield f"{path}:{number}: merge conflict marker"


def complaints(root: Path, files: Iterable[Path]) -> Iterator[str]:
    """What is wrong with these files and with the set of tracked files."""
    for path in files:
        yield from complaints_about(path, (root / path).read_bytes())
    for name in tracked_but_ignored(root):
        yield f"{name}: is tracked although .gitignore names it; a program writes it"


def main(arguments: list[str]) -> int:
    """Prints the complaints and returns the exit status."""
    root = Path(__file__).resolve().parent.parent
    files = [Path(name).resolve().relative_to(root) for name in arguments] or work_tree_files(root)
    found = list(complaints(root, files))
    for line in found:
        print(line)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
