"""The signals of one message, from cantools' view of the database and from the mapping."""

from __future__ import annotations

import math
from typing import Any

from gustform.language.errors import Place
from gustform_hil.dbc import Dbc
from gustform_hil.layout import bits, codes, integer_range, real_range
from gustform_hil.mapping import MappedMessage, MappedSignal
from gustform_hil.message_set import Field, Part, Signal
from gustform_hil.mistakes import Mistakes
from gustform_hil.names import is_c_name, snake_case
from gustform_hil.quantities import unit

# Fields that are numbers as such; all others are codes or counts.
_MEASURED = frozenset({Field.QUANTITY, Field.VALUE, Field.UPTIME})
# Counts and bit sets, which use all that their bits carry whatever range the database gives.
_WHOLE = frozenset(
    {Field.E2E_CRC, Field.E2E_COUNTER, Field.SAMPLE, Field.FAULTS, Field.ERRORS, Field.NONCE, Field.PARAMETER}
    | {Field.FINGERPRINT, Field.OPERATION}
)
# Least bits: a sample number that tells more than the tolerated losses apart, all faults, a CRC-32, an id.
_LEAST_BITS = {Field.SAMPLE: 4, Field.FAULTS: 19, Field.FINGERPRINT: 32, Field.PARAMETER: 16, Field.NONCE: 2}
# Largest code that the field must be able to carry.
_CODES = {Field.ENABLE: 1, Field.STATE: 3, Field.RESULT: 3}
_COMMANDS = {Part.OPERATOR_COMMAND: 3, Part.EMERGENCY_STOP: 1}
_OPERATIONS = (0, 1, 2)


def build_signals(
    message: Any, mapped: MappedMessage, dbc: Dbc, mistakes: Mistakes
) -> tuple[list[Signal], tuple[int, ...]]:
    """The mapped signals that are good so far, by their place in the frame, and the values of the multiplexer."""
    builder = _Builder(message, mapped, dbc, mistakes)
    by_name = {signal.name: signal for signal in message.signals}
    result = []
    taken: dict[str, str] = {}
    for entry in mapped.signals:
        found = by_name.get(entry.name)
        if found is None:
            mistakes.unknown("GF8006", f"a signal of {message.name}", entry.name, by_name, entry.place)
            continue
        other = taken.setdefault(snake_case(entry.name), entry.name)
        if other != entry.name:
            text = f"{message.name}.{entry.name} must have a name of its own in C; {other} becomes the same"
            mistakes.add("GF8021", text, dbc.place(message.name, entry.name), "another name")
        signal = builder.signal(found, entry)
        if signal is not None:
            result.append(signal)
    builder.check_overlaps(result)
    result.sort(key=lambda s: (min(bits(s.start, s.length, s.motorola)), s.multiplexed, s.name))
    return result, builder.values


class _Builder:
    def __init__(self, message: Any, mapped: MappedMessage, dbc: Dbc, mistakes: Mistakes) -> None:
        self.message = message
        self.mapped = mapped
        self.dbc = dbc
        self.mistakes = mistakes
        self.values = self._multiplexer_values()

    def _multiplexer_values(self) -> tuple[int, ...]:
        """The operations that the database knows, if the message is multiplexed."""
        multiplexers = [s for s in self.message.signals if s.is_multiplexer]
        operations = {s.name for s in self.mapped.signals if s.field == Field.OPERATION}
        known = {value for s in self.message.signals for value in s.multiplexer_ids or ()}
        for signal in multiplexers:
            if len(multiplexers) > 1 or signal.name not in operations:
                text = (
                    f"{self.message.name}.{signal.name} must be the only multiplexer of its message and"
                    " mapped to the field operation"
                )
                self._add("GF8016", text, signal.name, "a message of its own for what is multiplexed")
        values = tuple(value for value in _OPERATIONS if value in known)
        if multiplexers and not values:
            text = f"the multiplexer of {self.message.name} must know the values 0 (read), 1 (write) or 2 (activate)"
            self._add("GF8016", text, multiplexers[0].name, "signals with m0, m1 or m2")
        return values if multiplexers else ()

    def signal(self, found: Any, entry: MappedSignal) -> Signal | None:
        """One signal, None if it cannot be one."""
        what = f"{self.message.name}.{found.name}"
        if not is_c_name(found.name):
            text = f"the name of a signal must be a C identifier that is not taken; got {found.name[:80]!r}"
            self._add("GF8020", f"{text} in {self.message.name}", found.name, "another name")
        layout = self._layout(found, what)
        multiplexed = self._multiplexed(found, what)
        if layout is None or multiplexed is None:
            return None
        scale, offset = layout
        unit_of = self._unit(found, entry, what)
        limits = self._limits(found, entry, what, scale, offset)
        if limits is None:
            return None
        low, high = limits
        if entry.base != 1.0:
            scale, offset = scale / entry.base, offset / entry.base
        carried = self._carried(found, low / entry.base, high / entry.base, scale, offset)
        if carried is None:
            text = f"the range of {what} must hold a value that its bits carry; got [{low:g}, {high:g}]"
            self._add("GF8011", text, found.name, "range: [low, high] in the mapping")
            return None
        self._check_code(entry, what, found, carried[1])
        return Signal(
            found.name,
            entry.field,
            entry.quantity,
            unit_of,
            int(found.start),
            int(found.length),
            found.byte_order == "big_endian",
            bool(found.is_signed),
            bool(found.conversion.is_float),
            scale,
            offset,
            carried[0],
            carried[1],
            self._safe(entry, what, *carried),
            multiplexed,
            {int(value): str(name) for value, name in (found.conversion.choices or {}).items()},
            str(found.comment or ""),
        )

    def _layout(self, found: Any, what: str) -> tuple[float, float] | None:
        """Scale and offset, if the layout is one that can be carried."""
        real, length = bool(found.conversion.is_float), int(found.length)
        scale, offset = found.conversion.scale, found.conversion.offset
        problem = hint = ""
        if real and length not in (32, 64):
            problem, hint = f"be IEEE 754 of 32 or 64 bits; got {length}", "SIG_VALTYPE_ 1 with 32 bits"
        elif not real and length > 32:
            problem, hint = f"have at most 32 bits; got {length}", "two signals, or IEEE 754"
        elif not all(map(math.isfinite, (scale, offset))) or scale == 0 or abs(scale) < 1e-30 or abs(scale) > 1e30:
            problem, hint = f"have a finite factor other than 0 and a finite offset; got ({scale:g}, {offset:g})", "1"
        elif min(bits(found.start, length, found.byte_order == "big_endian")) < 0 or (
            max(bits(found.start, length, found.byte_order == "big_endian")) >= 8 * self.message.length
        ):
            problem = f"lie within the {self.message.length} bytes of its message; it does not"
        if problem:
            self._add("GF8017", f"{what} must {problem}", found.name, hint)
            return None
        return scale, offset

    def _multiplexed(self, found: Any, what: str) -> int | None:
        """For which operation it is there; -1 for all of them."""
        ids = set(found.multiplexer_ids or ())
        if not ids or set(self.values) <= ids:
            return -1
        inside = ids & set(self.values)
        if len(inside) == 1:
            return int(inside.pop())
        text = f"{what} must be there for all of the operations {self.values} or for one; got {sorted(ids)[:9]}"
        self._add("GF8016", text, found.name, "one signal for each operation")
        return None

    def _unit(self, found: Any, entry: MappedSignal, what: str) -> str:
        written = str(found.unit or "")
        if entry.field != Field.QUANTITY:
            return written
        needed = unit(entry.quantity)
        if entry.base == 1.0 and written != needed and (written or needed != "pu"):
            self.mistakes.add(
                "GF8012",
                f"{what} must have the unit of {entry.quantity}, {needed}; got {written[:20]!r}",
                entry.place,
                f"base: the value in the database that is 1 {needed}",
            )
        return needed

    def _limits(
        self, found: Any, entry: MappedSignal, what: str, scale: float, offset: float
    ) -> tuple[float, float] | None:
        """The range that is meant, in the unit of the database."""
        if entry.range is not None:
            low, high = entry.range
        elif entry.field not in _WHOLE and found.minimum is not None and found.maximum is not None:
            low, high = float(found.minimum), float(found.maximum)
        elif entry.field in _MEASURED and entry.field != Field.UPTIME:
            text = f"{what} must have a range, by which a fault is told from a value; the database has none"
            self._add("GF8011", text, found.name, "range: [low, high] in the mapping")
            return None
        elif found.conversion.is_float:
            low, high = -3.4e38, 3.4e38
        else:
            ends = sorted(code * scale + offset for code in codes(found.length, found.is_signed))
            low, high = ends[0], ends[1]
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            self._add("GF8011", f"{what} must have a range from low to high; got [{low:g}, {high:g}]", found.name)
            return None
        return low, high

    def _carried(self, found: Any, low: float, high: float, scale: float, offset: float) -> tuple[float, float] | None:
        low, high = min(low, high), max(low, high)
        if found.conversion.is_float:
            return real_range(low, high, scale, offset, found.length)
        return integer_range(low, high, scale, offset, *codes(found.length, found.is_signed))

    def _check_code(self, entry: MappedSignal, what: str, found: Any, high: float) -> None:
        field = entry.field
        if field in _MEASURED:
            return
        name = field.name.lower()
        plain = not (found.conversion.is_float or found.is_signed)
        if not plain or found.conversion.scale != 1 or found.conversion.offset != 0:
            self._add("GF8017", f"{what} ({name}) must be an unsigned whole number, factor 1, offset 0", found.name)
        elif found.length < _LEAST_BITS.get(field, 1):
            text = f"{what} ({name}) must have at least {_LEAST_BITS[field]} bits; got {found.length}"
            self._add("GF8017", text, found.name)
        needed = _COMMANDS.get(self.mapped.part, 0) if field == Field.COMMAND else _CODES.get(field, 0)
        if high < needed:
            self._add("GF8011", f"{what} ({name}) must have a range up to {needed}; it ends at {high:g}", found.name)

    def _safe(self, entry: MappedSignal, what: str, low: float, high: float) -> float:
        if entry.safe is None:
            return min(max(0.0, low), high)
        if not low <= entry.safe <= high:
            text = f"the safe value of {what} must be within [{low:g}, {high:g}]; got {entry.safe:g}"
            self.mistakes.add("GF8022", text, entry.place)
        return min(max(entry.safe, low), high)

    def check_overlaps(self, signals: list[Signal]) -> None:
        """No bit belongs to two signals that can be there at once; adds GF8017."""
        for at, one in enumerate(signals):
            mine = set(bits(one.start, one.length, one.motorola))
            for other in signals[at + 1 :]:
                apart = one.multiplexed != other.multiplexed and -1 not in (one.multiplexed, other.multiplexed)
                if not apart and mine & set(bits(other.start, other.length, other.motorola)):
                    text = f"{self.message.name}.{other.name} must not share bits with {one.name}"
                    self._add("GF8017", text, other.name, "another start bit")

    def _add(self, code: str, text: str, signal: str, hint: str = "") -> None:
        self.mistakes.add(code, text, self._place(signal), hint)

    def _place(self, signal: str) -> Place:
        return self.dbc.place(self.message.name, signal)
