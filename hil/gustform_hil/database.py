"""Loads a message set: a CAN database (DBC) with the mapping that says what its messages and signals mean.

Everything wrong with either is told in one go. What comes out is checked: names can become C, signals lie
where they fit and carry their ranges, the header of the end-to-end protection is at its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gustform.language.errors import GustformError, Place
from gustform_hil.dbc import Dbc, read_dbc
from gustform_hil.layout import FD_LENGTHS
from gustform_hil.locate import can_folder
from gustform_hil.mapping import MappedMessage, Mapping, read_mapping
from gustform_hil.message_set import E2E, E2E_FIELDS, MOST_SIGNALS, Field, Message, MessageSet, Part, Signal
from gustform_hil.mistakes import Mistakes
from gustform_hil.names import is_c_name
from gustform_hil.protection import check_data_ids, check_header, from_attributes
from gustform_hil.quantities import NEEDED, OPTIONAL, QUANTITIES, REQUIRED, SAMPLED, SPLIT
from gustform_hil.signals import build_signals

BUSES = ("fd", "classic")


def shipped(bus: str) -> MessageSet:
    """The message set that comes with gustform, for "fd" or "classic"."""
    if bus not in BUSES:
        raise GustformError("GF8001", f"the bus must be one of {', '.join(BUSES)}; got {bus!r}", hint="fd")
    return load_message_set(*shipped_files(bus))


def shipped_files(bus: str) -> tuple[Path, Path]:
    """Its database and mapping."""
    return can_folder() / f"gustform_{bus}.dbc", can_folder() / f"mapping_{bus}.yaml"


def load_message_set(database: Path, mapping: Path) -> MessageSet:
    """The message set of a DBC and a mapping. Raises GF8000 to GF8022, several at once as an ErrorList."""
    mistakes = Mistakes()
    mapped = read_mapping(mapping, mistakes)
    dbc = read_dbc(database)
    if mapped is None:
        mistakes.stop()
        raise AssertionError("an unusable mapping without a mistake")
    loader = _Loader(dbc, mapped, mistakes)
    messages = loader.messages()
    loader.check_set(messages)
    mistakes.stop()
    return MessageSet(mapped.name, tuple(sorted(messages, key=lambda m: (m.id, m.extended))))


class _Loader:
    def __init__(self, dbc: Dbc, mapping: Mapping, mistakes: Mistakes) -> None:
        self.dbc = dbc
        self.mapping = mapping
        self.mistakes = mistakes
        specifics = dbc.database.dbc
        self.definitions = specifics.attribute_definitions if specifics is not None else {}

    def messages(self) -> list[Message]:
        """Each mapped message that is there."""
        if not is_c_name(self.mapping.name) or self.mapping.name.startswith("gust_"):
            self._refuse_name("the name of the message set", self.mapping.name, self.mapping.name_place)
        by_name: dict[str, list[Any]] = {}
        for message in self.dbc.database.messages:
            by_name.setdefault(message.name, []).append(message)
        result = []
        for mapped in self.mapping.messages:
            found = by_name.get(mapped.name, [])
            if not found:
                self.mistakes.unknown("GF8005", "a message of the mapping", mapped.name, by_name, mapped.place)
            elif len(found) > 1:
                text = f"{mapped.name} must be in the database once; it is there {len(found)} times"
                self.mistakes.add("GF8015", text, mapped.place)
            else:
                result.append(self._message(found[0], mapped))
        return result

    def _message(self, message: Any, mapped: MappedMessage) -> Message:
        place = self.dbc.place(message.name)
        if not is_c_name(message.name):
            self._refuse_name("the name of a message", message.name, place)
        e2e = mapped.e2e if mapped.e2e is not None else from_attributes(message, self.definitions, place, self.mistakes)
        signals, values = build_signals(message, mapped, self.dbc, self.mistakes)
        cycle = mapped.cycle if mapped.cycle is not None else round(1000 * (message.cycle_time or 0))
        operation = [at for at, s in enumerate(signals) if s.field == Field.OPERATION]
        result = Message(
            message.name,
            int(message.frame_id),
            bool(message.is_extended_frame),
            bool(message.is_fd),
            int(message.length),
            mapped.part,
            mapped.piece,
            cycle,
            e2e,
            tuple(signals),
            operation[0] if operation and values else -1,
            values,
            tuple(message.senders),
            str(message.comment or ""),
        )
        self._check_frame(result, place)
        check_header(result, self.dbc, self.mistakes)
        self._check_fields(result, mapped)
        return result

    def _check_frame(self, message: Message, place: Place) -> None:
        allowed: Sequence[int] = FD_LENGTHS if message.fd else FD_LENGTHS[:9]
        if message.length not in allowed[1:]:
            kind = "CAN FD" if message.fd else "classic CAN"
            hint = "" if message.fd else 'VFrameFormat "StandardCAN_FD" where the message is CAN FD'
            text = f"{message.name} must have a length that {kind} knows; got {message.length} bytes"
            self.mistakes.add("GF8019", text, place, hint)
        if len(message.signals) > MOST_SIGNALS:
            text = f"{message.name} must have at most {MOST_SIGNALS} mapped signals; got {len(message.signals)}"
            self.mistakes.add("GF8018", text, place, "leaving signals that nobody needs out of the mapping")

    def _check_fields(self, message: Message, mapped: MappedMessage) -> None:
        seen: set[tuple[Field, str]] = set()
        allowed = REQUIRED[message.part] | OPTIONAL.get(message.part, frozenset()) | E2E_FIELDS
        places = {s.name: s.place for s in mapped.signals}
        for signal in message.signals:
            what = f"{message.name}.{signal.name}"
            place = places[signal.name]
            if signal.field not in allowed:
                names = ", ".join(sorted(f.name.lower() for f in allowed))
                got = signal.field.name.lower()
                self.mistakes.add(
                    "GF8009", f"{what} must be of a field of its part, one of {names}; got {got}", place, "another part"
                )
            if (signal.field, signal.quantity) in seen:
                got = signal.quantity or signal.field.name.lower()
                self.mistakes.add("GF8009", f"{what} must be the only {got} of its message; there are two", place)
            seen.add((signal.field, signal.quantity))
            if signal.field == Field.QUANTITY:
                known = QUANTITIES.get(message.part, frozenset())
                if signal.quantity not in known:
                    self.mistakes.unknown("GF8010", f"the quantity of {what}", signal.quantity, known, place)

    def check_set(self, messages: list[Message]) -> None:
        """What only shows when all messages are seen together."""
        self._check_identifiers(messages)
        check_data_ids(messages, self.dbc, self.mistakes)
        places = {m.name: m.place for m in self.mapping.messages}
        for part in Part:
            pieces = sorted((m for m in messages if m.part == part), key=lambda m: m.piece)
            if pieces:
                self._check_part(part, pieces, places)
            elif part in NEEDED and not any(m.part == part for m in self.mapping.messages):
                self.mistakes.add(
                    "GF8008",
                    f"the mapping must have a message with the part {part.name.lower()}; there is none",
                    Place(self.mapping.file),
                )

    def _check_identifiers(self, messages: list[Message]) -> None:
        mapped = {(m.id, m.extended): m.name for m in messages}
        for other in self.dbc.database.messages:
            key = (int(other.frame_id), bool(other.is_extended_frame))
            if key in mapped and mapped[key] != other.name:
                text = f"the identifier 0x{key[0]:x} must belong to one message; {mapped[key]} and {other.name} have it"
                self.mistakes.add("GF8015", text, self.dbc.place(other.name), "another identifier")

    def _check_part(self, part: Part, pieces: list[Message], places: dict[str, Place]) -> None:
        name = part.name.lower()
        numbers = [m.piece for m in pieces]
        if len(pieces) > 1 and part not in SPLIT:
            text = f"the part {name} must be one message; got {', '.join(m.name for m in pieces)}"
            self.mistakes.add("GF8008", text, places[pieces[1].name])
        elif numbers != list(range(len(pieces))):
            text = f"the pieces of {name} must be numbered 0, 1, ...; got {', '.join(map(str, numbers))}"
            self.mistakes.add("GF8008", text, places[pieces[-1].name], "piece: 0 for the first of them")
        if len({m.cycle for m in pieces}) > 1:
            text = f"the pieces of {name} must have one cycle time; got {', '.join(f'{m.cycle} us' for m in pieces)}"
            self.mistakes.add("GF8008", text, places[pieces[-1].name])
        have = {s.field for m in pieces for s in m.signals}
        for field in sorted(REQUIRED[part] - have):
            text = f"the part {name} must have a signal with the field {field.name.lower()}; there is none"
            self.mistakes.add("GF8009", text, places[pieces[0].name])
        for message in pieces if part in SAMPLED and Field.SAMPLE in have else ():
            if message.signal(Field.SAMPLE) is None:
                text = f"{message.name} must have a sample number, by which pieces belong together; it has none"
                self.mistakes.add("GF8009", text, places[message.name])
        quantities = [s.quantity for m in pieces for s in m.signals if s.field == Field.QUANTITY]
        for quantity in sorted({q for q in quantities if quantities.count(q) > 1 and len(pieces) > 1}):
            text = f"the quantity {quantity} must be in one piece of {name}; it is in several"
            self.mistakes.add("GF8009", text, places[pieces[-1].name])

    def _refuse_name(self, what: str, name: str, place: Place) -> None:
        text = f"{what} must be a C identifier that is not taken ([A-Za-z_][A-Za-z0-9_]*); got {name[:80]!r}"
        self.mistakes.add("GF8020", text, place, "another name")


__all__ = [
    "BUSES",
    "E2E",
    "Field",
    "Message",
    "MessageSet",
    "Part",
    "Signal",
    "load_message_set",
    "shipped",
    "shipped_files",
]
