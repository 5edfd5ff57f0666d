"""mapping.yaml: which message of a database is which part, and what its signals mean (format: hil/can/README.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from gustform.language.errors import GustformError, Place
from gustform_hil.message_set import E2E, Field, Part
from gustform_hil.mistakes import Mistakes
from gustform_hil.text import read

_MOST_BYTES = 1 << 20
_MESSAGE_KEYS = ("part", "piece", "cycle", "e2e", "signals")
_SIGNAL_KEYS = ("field", "quantity", "base", "range", "safe")
_Kind = TypeVar("_Kind", Part, Field)
_E2E_KEYS = ("profile", "data_id", "data_ids")


@dataclass(frozen=True)
class MappedSignal:
    """What a signal of the database means."""

    name: str
    place: Place
    field: Field
    quantity: str = ""
    base: float = 1.0  # value of the database that is 1 in the controller's unit
    range: tuple[float, float] | None = None  # in place of the database's, in its unit
    safe: float | None = None  # in the controller's unit


@dataclass(frozen=True)
class MappedMessage:
    """What a message of the database is for."""

    name: str
    place: Place
    part: Part
    piece: int
    cycle: int | None  # us; in place of the database's
    e2e: E2E | None  # in place of the database's
    signals: tuple[MappedSignal, ...]


@dataclass(frozen=True)
class Mapping:
    """The whole file."""

    file: str
    name: str
    name_place: Place
    messages: tuple[MappedMessage, ...]


def read_mapping(file: Path, mistakes: Mistakes) -> Mapping | None:
    """The mapping in `file`. Raises GF8001 and GF8003; adds GF8004 and GF8007 to `mistakes`. None: nothing usable."""
    reader = _Reader(str(file), mistakes)
    return reader.mapping(_compose(read(file, "mapping", _MOST_BYTES, ("utf-8-sig",)), str(file)))


def _compose(text: str, file: str) -> Node | None:
    try:
        node = YAML(typ="safe", pure=True).compose(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(file, mark.line + 1, mark.column + 1) if mark is not None else Place(file)
        raise GustformError(
            "GF8003",
            f"the mapping must be valid YAML; {error.problem or 'it cannot be read'}",
            hint="checking indentation, colons (key: value) and brackets near this place",
            place=place,
        ) from None
    except (YAMLError, ValueError, RecursionError) as error:
        problem = (str(error).splitlines() or ["it cannot be read"])[0]
        raise GustformError("GF8003", f"the mapping must be valid YAML; {problem}", place=Place(file)) from None
    return node if isinstance(node, Node) else None


class _Reader:
    """Walks the nodes along the format and nowhere else, so that aliases cannot make it long."""

    def __init__(self, file: str, mistakes: Mistakes) -> None:
        self.file = file
        self.mistakes = mistakes

    def mapping(self, root: Node | None) -> Mapping | None:
        """The file from its root."""
        entries = self._entries(root, "the mapping", ("name", "messages"))
        if entries is None:
            return None
        if not self._needs(entries, root, "the mapping", ("name", "messages")):
            return None
        name = self._text(entries["name"], "name")
        listed = self._entries(entries["messages"], "messages", None) or {}
        messages = [self._message(key, node) for key, node in listed.items()]
        found = tuple(m for m in messages if m is not None)
        return Mapping(self.file, name or "", self._place(entries["name"]), found)

    def _message(self, name: str, node: Node) -> MappedMessage | None:
        path = f"messages.{name}"
        entries = self._entries(node, path, _MESSAGE_KEYS)
        if entries is None or not self._needs(entries, node, path, ("part", "signals")):
            return None
        part = self._member(entries["part"], f"{path}.part", Part)
        piece = self._whole(entries.get("piece"), f"{path}.piece", 0, 15)
        cycle = self._number(entries.get("cycle"), f"{path}.cycle")
        if cycle is not None and not 0 <= cycle <= 60_000:
            self._wrong(entries["cycle"], f"{path}.cycle", "a time in ms, 0 to 60000")
            cycle = None
        listed = self._entries(entries["signals"], f"{path}.signals", None) or {}
        signals = [self._signal(key, f"{path}.signals.{key}", value) for key, value in listed.items()]
        if part is None:
            return None
        return MappedMessage(
            name,
            self._place(node),
            part,
            piece or 0,
            None if cycle is None else round(cycle * 1000),
            self._e2e(entries.get("e2e"), f"{path}.e2e"),
            tuple(s for s in signals if s is not None),
        )

    def _signal(self, name: str, path: str, node: Node) -> MappedSignal | None:
        if isinstance(node, ScalarNode):
            field = self._member(node, path, Field)
            if field == Field.QUANTITY:
                self._wrong(node, path, "which quantity: {quantity: v_dc}")
                return None
            return None if field is None else MappedSignal(name, self._place(node), field)
        entries = self._entries(node, path, _SIGNAL_KEYS)
        if entries is None:
            return None
        if ("field" in entries) == ("quantity" in entries):
            self.mistakes.add(
                "GF8004", f"{path} must have either field or quantity", self._place(node), "{quantity: v_dc}"
            )
            return None
        field = Field.QUANTITY if "quantity" in entries else self._member(entries["field"], f"{path}.field", Field)
        quantity = self._text(entries.get("quantity"), f"{path}.quantity")
        base = self._number(entries.get("base"), f"{path}.base")
        if base == 0.0:
            self._wrong(entries["base"], f"{path}.base", "a number other than 0")
            base = None
        if field is None:
            return None
        return MappedSignal(
            name,
            self._place(node),
            field,
            quantity or "",
            1.0 if base is None else base,
            self._range(entries.get("range"), f"{path}.range"),
            self._number(entries.get("safe"), f"{path}.safe"),
        )

    def _e2e(self, node: Node | None, path: str) -> E2E | None:
        if node is None:
            return None
        if isinstance(node, ScalarNode) and node.value == "none":
            return E2E()
        entries = self._entries(node, path, _E2E_KEYS)
        if entries is None:
            return None
        profile = self._whole(entries.get("profile"), f"{path}.profile", 1, 5)
        data_id = self._whole(entries.get("data_id"), f"{path}.data_id", 0, 0xFFFF)
        ids = self._text(entries.get("data_ids"), f"{path}.data_ids")
        try:
            id_list = bytes.fromhex(ids or "")
        except ValueError:
            self._wrong(entries["data_ids"], f"{path}.data_ids", "32 hexadecimal digits")
            id_list = b""
        if profile is None or (profile == 2) == ("data_id" in entries) or (profile == 2) != ("data_ids" in entries):
            self._wrong(node, path, "{profile: 5, data_id: 0x1234}, or 1 for 5, or {profile: 2, data_ids: ...}")
        return E2E(profile or 0, data_id or 0, id_list)

    def _range(self, node: Node | None, path: str) -> tuple[float, float] | None:
        if node is None:
            return None
        if not isinstance(node, SequenceNode) or len(node.value) != 2:
            self._wrong(node, path, "two numbers, [low, high]")
            return None
        low, high = (self._number(item, path) for item in node.value)
        return None if low is None or high is None else (low, high)

    def _entries(self, node: Node | None, path: str, known: tuple[str, ...] | None) -> dict[str, Node] | None:
        if not isinstance(node, MappingNode):
            self._wrong(node, path, "a mapping of keys")
            return None
        entries: dict[str, Node] = {}
        for key, value in node.value:
            if not isinstance(key, ScalarNode):
                self._wrong(key, f"a key of {path}", "plain text")
            elif key.value in entries:
                self._wrong(key, f"the key {key.value!r} of {path}", "there once")
            elif known is not None and key.value not in known:
                self.mistakes.unknown("GF8004", f"a key of {path}", key.value, known, self._place(key))
            else:
                entries[key.value] = value
        return entries

    def _needs(self, entries: dict[str, Node], node: Node | None, path: str, keys: tuple[str, ...]) -> bool:
        missing = [key for key in keys if key not in entries]
        for key in missing:
            self.mistakes.add("GF8004", f"{path} must have the key {key}; it is not there", self._place(node))
        return not missing

    def _member(self, node: Node, path: str, kind: type[_Kind]) -> _Kind | None:
        text = self._text(node, path)
        if text is None:
            return None
        known = {member.name.lower(): member for member in kind}
        if text not in known:
            self.mistakes.unknown("GF8007", path, text, known, self._place(node))
        return known.get(text)

    def _text(self, node: Node | None, path: str) -> str | None:
        if node is None:
            return None
        if not isinstance(node, ScalarNode):
            self._wrong(node, path, "plain text")
            return None
        return str(node.value)

    def _number(self, node: Node | None, path: str) -> float | None:
        if node is None:
            return None
        try:
            number = float(node.value) if isinstance(node, ScalarNode) else math.nan
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            self._wrong(node, path, "a finite number")
            return None
        return number

    def _whole(self, node: Node | None, path: str, low: int, high: int) -> int | None:
        if node is None:
            return None
        try:
            number = int(node.value, 0) if isinstance(node, ScalarNode) else low - 1
        except ValueError:
            number = low - 1
        if not low <= number <= high:
            self._wrong(node, path, f"a whole number from {low} to {high}")
            return None
        return number

    def _wrong(self, node: Node | None, path: str, must_be: str) -> None:
        if isinstance(node, ScalarNode):
            got = repr(node.value)
        else:
            got = "nothing" if node is None else "a mapping" if isinstance(node, MappingNode) else "a list"
        self.mistakes.add("GF8004", f"{path} must be {must_be}; got {got}", self._place(node))

    def _place(self, node: Node | None) -> Place:
        mark = getattr(node, "start_mark", None)
        return Place(self.file) if mark is None else Place(self.file, mark.line + 1, mark.column + 1)
