"""`gustform hil operate`: the operator's buttons, and what the bridge makes of them.

GF8140 the bridge does not follow   GF8141 no bridge is heard
"""

from __future__ import annotations

import json
import secrets
import time

from gustform.language.errors import GustformError
from gustform_hil.bus import Bus
from gustform_hil.client import Client, Command, Operator, State
from gustform_hil.codec import Codec
from gustform_hil.faults import fault_names
from gustform_hil.message_set import MessageSet, Part

_AGAIN = 0.1  # s between two presses of a button that nothing followed
_LEADS_TO = {
    "start": (Command.START, {State.RUN}),
    "stop": (Command.STOP, {State.INIT, State.READY, State.SAFE}),
    "reset": (Command.RESET, {State.INIT, State.READY, State.RUN}),
}
_HINTS = {
    ("start", State.SAFE): "gustform hil operate reset",
    ("start", State.INIT): "waiting until the converter's fingerprint, heartbeat and measurements are good",
    ("reset", State.SAFE): "removing the cause first; it must be gone for 20 periods",
}


def operate(action: str, interface: str, messages: MessageSet, patience: float) -> tuple[State, list[str]]:
    """Press a button, "status" presses none: the state that follows, and its faults. GF8140, GF8141."""
    told = [m.id for m in messages.pieces(Part.CONTROLLER_STATE)]
    with Bus(interface, fd=any(m.fd for m in messages.messages), only=told) as bus:
        client = Client(bus, Codec(messages))
        operator = Operator(client, secrets.randbelow(65536))
        deadline = time.monotonic() + patience
        if action == "emergency-stop":
            # First and whatever the state; twice, so that a lost frame is not the only one.
            operator.emergency_stop()
            operator.emergency_stop()
        state = _hear(client, deadline)
        wanted = _LEADS_TO[action][1] if action in _LEADS_TO else {State.SAFE}
        while action != "status" and state not in wanted and time.monotonic() < deadline:
            if action in _LEADS_TO:
                # Counters begin anew in each process, and a frame with the bridge's last one passes for a repeat.
                operator.press(_LEADS_TO[action][0])
                operator.repeat(_LEADS_TO[action][0])
            else:
                operator.emergency_stop()
            state = _follow(client, wanted, min(deadline, time.monotonic() + _AGAIN), state)
    faults = fault_names(client.heard.faults)
    if action != "status" and state not in wanted:
        raise GustformError(
            "GF8140",
            f"the bridge must follow {action!r}; it stays in {state.name}{_because(faults)}",
            hint=_HINTS.get((action, state), "gustform hil operate status"),
        )
    return state, faults


def _because(faults: list[str]) -> str:
    return f" ({', '.join(faults)})" if faults else ""


def _hear(client: Client, deadline: float) -> State:
    """The state that the bridge tells every 10 ms. GF8141."""
    while client.heard.state is None and time.monotonic() < deadline:
        client.receive(max(0.0, deadline - time.monotonic()))
    if client.heard.state is None:
        raise GustformError(
            "GF8141", "no bridge is heard on this bus", hint="gust-bridge --interface NAME, with the same database"
        )
    return client.heard.state


def _follow(client: Client, wanted: set[State], deadline: float, state: State) -> State:
    while state not in wanted and time.monotonic() < deadline:
        client.receive(max(0.0, deadline - time.monotonic()))
        if client.heard.state is not None:
            state = client.heard.state
    return state


def as_text(state: State, faults: list[str]) -> str:
    """SAFE (TIMEOUT)."""
    return f"{state.name}{_because(faults)}"


def as_json(state: State, faults: list[str]) -> str:
    """The same as data."""
    return json.dumps({"state": state.name, "faults": faults})
