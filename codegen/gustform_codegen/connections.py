"""Connections inside a unit type, as equations."""

from __future__ import annotations

from typing import Any

from gustform.language.errors import GustformError
from gustform.language.scope import Elaborated


def connection_equations(elaborated: Elaborated, boundary: set[str]) -> list[tuple[Any, str]]:
    """(expression, text) with expression = 0 for every connection set: equal potentials, flows that sum to zero.

    A port counts with its flow's own sign where it is seen from outside its component, and with the opposite sign
    where the component connects its own port to its parts (Modelica's inside and outside connectors). A part's port
    that nobody connects is GF3003 unless it is optional.
    """
    parent: dict[tuple[str, bool], tuple[str, bool]] = {}

    def find(key: tuple[str, bool]) -> tuple[str, bool]:
        while parent.setdefault(key, key) != key:
            key = parent[key]
        return key

    for a, b, path, _source in elaborated.connections:
        keys = []
        for port in (a, b):
            owner = port.path.rpartition(".")[0]
            keys.append((port.path, owner != path))  # (port, seen from outside its component)
        parent[find(keys[0])] = find(keys[1])
    members: dict[tuple[str, bool], list[tuple[str, bool]]] = {}
    for key in list(parent):
        members.setdefault(find(key), []).append(key)
    statements: list[tuple[Any, str]] = []
    for group in members.values():
        ports = [elaborated.ports[path] for path, _ in group]
        text = "connection of " + ", ".join(path for path, _ in group)
        connector = ports[0].connector
        for name in connector._potentials:
            statements += [(port.symbols[name] - ports[0].symbols[name], text) for port in ports[1:]]
        for name in connector._flows:
            terms = [
                port.symbols[name] if side else -port.symbols[name]
                for port, (_, side) in zip(ports, group, strict=True)
            ]
            statements.append((sum(terms[1:], terms[0]), text))
    connected = set(parent)
    for path, port in elaborated.ports.items():
        if path in boundary or (path, True) in connected:
            continue
        if not port.connector.optional:
            raise GustformError(
                "GF3003",
                f"{type(elaborated.component).__name__}: port {path} ({port.connector.description}) is not connected",
                hint=f"self.connect(self.{path}, ...) or optional=True at its declaration",
            )
        for name in port.connector._flows:
            statements.append((port.symbols[name], f"{path}.{name} = 0 (not connected)"))
    return statements
