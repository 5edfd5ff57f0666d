"""What a quantity of a mapping may be: the signals of the controllers, by their names and units."""

from __future__ import annotations

from collections.abc import Mapping

from gustform_codegen.emit.controller.ranges import INPUT_RANGES, OUTPUT_RANGES
from gustform_hil.message_set import Field, Part

_UNITS = {"dv_dc": "1/s", "wind": "m/s", "beta": "deg", "beta_del": "deg", "beta_ref": "deg"}

# Also what only a controller with a schedule reads.
_INPUTS = frozenset(INPUT_RANGES) | {"beta"}

# Where quantities may stand. A set point may also be sent with the measurements, and the reverse.
QUANTITIES: Mapping[Part, frozenset[str]] = {
    Part.MEASUREMENTS: _INPUTS,
    Part.SET_POINTS: _INPUTS,
    Part.REFERENCES: frozenset(OUTPUT_RANGES),
}

# Fields that a part must have in one of its messages, and those that it may have besides E2E.
REQUIRED: Mapping[Part, frozenset[Field]] = {
    Part.SYNC: frozenset({Field.SAMPLE}),
    Part.MEASUREMENTS: frozenset({Field.SAMPLE, Field.QUANTITY}),
    Part.REFERENCES: frozenset({Field.SAMPLE, Field.QUANTITY, Field.ENABLE}),
    Part.SET_POINTS: frozenset({Field.QUANTITY}),
    Part.CONTROLLER_STATE: frozenset({Field.STATE}),
    Part.CONVERTER_STATE: frozenset({Field.STATE}),
    Part.OPERATOR_COMMAND: frozenset({Field.COMMAND, Field.NONCE}),
    Part.EMERGENCY_STOP: frozenset({Field.COMMAND}),
    Part.PARAMETER_REQUEST: frozenset({Field.OPERATION, Field.PARAMETER, Field.VALUE}),
    Part.PARAMETER_RESPONSE: frozenset({Field.OPERATION, Field.PARAMETER, Field.VALUE, Field.RESULT}),
    Part.CONTROLLER_HEARTBEAT: frozenset(),
    Part.CONVERTER_HEARTBEAT: frozenset(),
    Part.CONTROLLER_FINGERPRINT: frozenset({Field.FINGERPRINT}),
    Part.CONVERTER_FINGERPRINT: frozenset({Field.FINGERPRINT}),
}
OPTIONAL: Mapping[Part, frozenset[Field]] = {
    Part.SET_POINTS: frozenset({Field.SAMPLE}),
    Part.CONTROLLER_STATE: frozenset({Field.FAULTS, Field.ERRORS, Field.SAMPLE}),
    Part.CONVERTER_STATE: frozenset({Field.FAULTS, Field.ERRORS, Field.SAMPLE}),
    Part.EMERGENCY_STOP: frozenset({Field.NONCE}),
    Part.PARAMETER_REQUEST: frozenset({Field.NONCE}),
    Part.PARAMETER_RESPONSE: frozenset({Field.NONCE}),
    Part.CONTROLLER_HEARTBEAT: frozenset({Field.UPTIME, Field.STATE}),
    Part.CONVERTER_HEARTBEAT: frozenset({Field.UPTIME, Field.STATE}),
}

# Parts without which nothing can be run: all others may be left out of a database.
NEEDED = (Part.MEASUREMENTS, Part.REFERENCES, Part.OPERATOR_COMMAND)

# Parts of one message only, and parts whose every piece needs a sample number, so that pieces are never mixed.
SPLIT = frozenset({Part.MEASUREMENTS, Part.REFERENCES, Part.SET_POINTS})
SAMPLED = frozenset({Part.MEASUREMENTS, Part.REFERENCES})


def unit(quantity: str) -> str:
    """The unit in which the controller has it."""
    return _UNITS.get(quantity, "pu")
