"""A YAML document with the place of every node, and `--set path=value` applied to it.

YAML 1.2 (1e-6 is a number, `on` and `no` are words). Comments survive, so the resolved document can be kept with the
results as its author wrote it.
"""

from __future__ import annotations

import copy
import datetime
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from gustform.language.errors import GustformError, Place
from gustform_cli.errors import did_you_mean

# Keys and indices from the root of the document.
NodePath = tuple[str | int, ...]

# Aliases can make a small file stand for an enormous tree.
_MOST_NODES = 200_000


@dataclass(frozen=True)
class Change:
    """A new value for one path, as users write paths: wt.curtailment, run.until, events[0].at."""

    path: str
    value: Any
    place: Place | None  # where it was written, for errors


@dataclass(frozen=True)
class Document:
    """A mapping read from YAML. `tree` keeps comments and positions, `plain()` is ordinary Python."""

    file: str
    tree: CommentedMap
    overridden: Mapping[NodePath, Place | None] = field(default_factory=dict)  # path -> where its value was written

    def place(self, path: Sequence[str | int], *, key: bool = False) -> Place:
        """File, line and column of the value at `path` (of its key if `key`), or of the nearest node that exists."""
        path = tuple(path)
        for length in range(len(path), 0, -1):
            written = self.overridden.get(path[:length])
            if written is not None:
                return written
        node: Any = self.tree
        line, column = 0, 0
        for depth, step in enumerate(path):
            last = depth == len(path) - 1
            try:
                if isinstance(node, CommentedMap):
                    line, column = node.lc.key(step) if key and last else node.lc.value(step)
                elif isinstance(node, CommentedSeq) and isinstance(step, int):
                    line, column = node.lc.item(step)
                else:
                    break
                node = node[step]
            except (KeyError, IndexError, TypeError, AttributeError):
                break  # the place found so far is the nearest: a missing key, or a part of a merged mapping
        return Place(self.file, line + 1, column + 1)

    def plain(self) -> dict[str, Any]:
        """The document as dict, list, str, int, float, bool and None. Raises GF2104 for anything else."""
        budget = [_MOST_NODES]
        plain = self._plain(self.tree, (), budget)
        assert isinstance(plain, dict)
        return plain

    def changed(self, changes: Iterable[Change]) -> Document:
        """A copy in which some values are others. Raises GF2105 for a path that leads nowhere."""
        tree = copy.deepcopy(self.tree)
        overridden = dict(self.overridden)
        for change in changes:
            for path in put(tree, change):
                overridden[path] = change.place
        return Document(self.file, tree, overridden)

    def text(self) -> str:
        """The document as YAML, overrides applied, comments kept."""
        stream = io.StringIO()
        writer = YAML(typ="rt")
        writer.width = 120
        writer.dump(self.tree, stream)
        return stream.getvalue()

    def _plain(self, node: Any, path: NodePath, budget: list[int]) -> Any:
        budget[0] -= 1
        if budget[0] < 0 or len(path) > 50:
            raise GustformError(
                "GF2104",
                f"{dotted(path[:3])} must be a tree of moderate size; got one that repeats itself or never ends",
                hint="writing out what the anchors (&) and aliases (*) stand for",
                place=self.place(path[:3]),
            )
        if getattr(getattr(node, "tag", None), "value", None) is not None:
            raise self._not_plain(path, f"a {node.tag.value} tag")
        if isinstance(node, Mapping):
            result: dict[str, Any] = {}
            for key, value in node.items():
                if not isinstance(key, str):
                    raise GustformError(
                        "GF2104",
                        f"keys under {dotted(path)} must be text; got {key!r}",
                        hint=f'"{key}" in quotes',
                        place=self.place((*path, key), key=True),
                    )
                result[str(key)] = self._plain(value, (*path, str(key)), budget)
            return result
        if isinstance(node, list):
            return [self._plain(value, (*path, index), budget) for index, value in enumerate(node)]
        if node is None or isinstance(node, bool):
            return node
        # ruamel's scalars carry their formatting; bool is not among them (ScalarBoolean is an int).
        if type(node).__name__ == "ScalarBoolean":
            return bool(node)
        for kind in (int, float, str):
            if isinstance(node, kind):
                return kind(node)
        if isinstance(node, datetime.date | datetime.datetime):
            return node.isoformat()
        raise self._not_plain(path, f"a {type(node).__name__}")

    def _not_plain(self, path: NodePath, got: str) -> GustformError:
        return GustformError(
            "GF2104",
            f"{dotted(path)} must be plain text, a number, a list or a mapping; got {got}",
            hint="leaving the YAML tag (!...) out",
            place=self.place(path),
        )


def dotted(path: Iterable[str | int]) -> str:
    """A path as users write it: components.wt.rating, events[0].at."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            text += f".{step}" if text else str(step)
    return text or "the scenario"


def read(file: Path, overrides: Sequence[str] = (), what: str = "scenario") -> Document:
    """The document in `file`, a `what`, with overrides applied. Raises GF2101 (unreadable) to GF2105."""
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise GustformError(
            "GF2101",
            f"the {what} must be UTF-8 text; byte {error.start} is not",
            hint="saving it as UTF-8",
            place=Place(str(file)),
        ) from None
    except OSError as error:
        raise GustformError(
            "GF2101",
            f"the {what} must be a readable file; got: {error.strerror or error}",
            hint="gustform new FILE, which writes one to start from" if what == "scenario" else "the path of a file",
            place=Place(str(file)),
        ) from None
    return parse(text, str(file), overrides, what)


def parse(text: str, file: str, overrides: Sequence[str] = (), what: str = "scenario") -> Document:
    """The document written in `text`; `file` is the name used in errors."""
    tree = _load(text, file)
    if not isinstance(tree, CommentedMap):
        got = "nothing" if tree is None else "a list" if isinstance(tree, list) else "a single value"
        raise GustformError(
            "GF2104",
            f"the {what} must be a mapping of keys; got {got}",
            hint="gustform new FILE, which writes one to start from",
            place=Place(file, 1, 1),
        )
    document = Document(file, tree)
    return document.changed(_from_text(override) for override in overrides) if overrides else document


def _load(text: str, file: str) -> Any:
    loader = YAML(typ="rt")
    loader.allow_duplicate_keys = False
    try:
        return loader.load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(file, mark.line + 1, mark.column + 1) if mark is not None else Place(file)
        problem = str(error.problem or "cannot be read")
        if problem.startswith("found duplicate key"):
            key = problem.split('"')[1] if '"' in problem else ""
            raise GustformError(
                "GF2103",
                f"each key must stand once in its mapping; {key!r} stands here again",
                hint="removing one of the two",
                place=place,
            ) from None
        raise GustformError(
            "GF2102", f"the text must be valid YAML; {problem}", hint=_yaml_hint(problem), place=place
        ) from None
    except (YAMLError, ValueError, RecursionError) as error:
        raise GustformError(
            "GF2102", f"the text must be valid YAML; {str(error).splitlines()[0]}", place=Place(file)
        ) from None


def _yaml_hint(problem: str) -> str:
    if "tab" in problem or "\\t" in problem:
        return "spaces instead of tabs"
    return "checking indentation, colons (key: value) and brackets near this place"


def _from_text(override: str) -> Change:
    """The change that `--set path=value` asks for."""
    place = Place(f"--set {override}")
    name, equals, text = override.partition("=")
    if not equals or not name.strip():
        raise GustformError(
            "GF2105", f"--set must be path=value; got {override!r}", hint="--set run.until=30s", place=place
        )
    return Change(name.strip(), _load(text, str(place)) if text.strip() else None, place)


def put(tree: dict[str, Any], change: Change) -> list[NodePath]:
    """Set one path of a tree, a document's or a plain one; returns the path, and those of mappings it had to begin.

    A first key that is no top-level key but a component's name is looked up among the components, as in events
    (`load.active`).
    """
    name, value, place = change.path, change.value, change.place
    keys = name.replace("[", ".").replace("]", "").split(".")
    components = tree.get("components")
    if keys[0] not in tree and isinstance(components, dict) and keys[0] in components:
        keys.insert(0, "components")
    node: Any = tree
    path: list[str | int] = []
    begun: list[NodePath] = []
    for depth, step in enumerate(keys):
        last = depth == len(keys) - 1
        if isinstance(node, dict):
            if not last and step not in node:
                # A mapping that may be left out is begun by its first key: output.every, wt.control.K_gsc. If it may
                # not be there at all, the check of the whole says so. A new component is more than one value.
                if (depth == 0 and len(keys) == 2) or (depth >= 2 and keys[0] == "components"):
                    node[step] = type(node)()
                    begun.append((*path, step))
                else:
                    raise GustformError(
                        "GF2105",
                        f"the path {name!r} must lead to a key; {dotted(path)} has no {step!r}",
                        hint=did_you_mean(step, [str(key) for key in node]),
                        place=place,
                    )
            path.append(step)
            if last:
                node[step] = value
            else:
                node = node[step]
        elif isinstance(node, list):
            if not step.isdigit() or int(step) >= len(node):
                raise GustformError(
                    "GF2105",
                    f"the path {name!r} must lead to a key; {dotted(path)} has {len(node)} items, no {step!r}",
                    hint=f"a number from 0 to {len(node) - 1}",
                    place=place,
                )
            path.append(int(step))
            if last:
                node[int(step)] = value
            else:
                node = node[int(step)]
        else:
            raise GustformError(
                "GF2105",
                f"the path {name!r} must lead to a key; {dotted(path)} is a single value",
                hint=f"--set {dotted(path)}=...",
                place=place,
            )
    return [*begun, tuple(path)]
