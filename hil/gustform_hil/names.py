"""Which names of a database or a mapping may become C."""

from __future__ import annotations

import re

_C_KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    """.split()  # noqa: SIM905
)
# Parameters and functions of the code that cantools prints, and macros of the headers that it includes.
_TAKEN = frozenset(
    ("src_p", "dst_p", "msg_p", "size", "memset", "memcpy", "round", "bool", "true", "false", "null", "einval")
)
_LONGEST = 64


def snake_case(name: str) -> str:
    """The name as cantools writes it in C: VdcRef becomes vdc_ref."""
    name = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", name)
    name = re.sub(r"(_+)", "_", name)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name).lower()


def is_c_name(name: str) -> bool:
    """Whether the name is an identifier of moderate length that nothing else has taken."""
    if len(name) > _LONGEST or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name, re.ASCII):
        return False
    return not {name, snake_case(name)} & (_C_KEYWORDS | _TAKEN)
