"""Exit codes, and errors as lines on stderr: shared by all commands."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager

import typer

DONE, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130

# Codes of what the caller can mend on the command line or in the scenario: the exit code is then 2.
_USAGE_CODES = (
    *("GF2", "GF7001", "GF7002", "GF7003", "GF7006", "GF7007", "GF7008"),
    *("GF8071", "GF8072", "GF8074", "GF8075", "GF8081", "GF8083", "GF8084", "GF8085"),
    *("GF800", "GF801", "GF802", "GF8120", "GF8123", "GF8124", "GF8125", "GF8130", "GF8131", "GF8132", "GF8135"),
)


@contextmanager
def guarded() -> Iterator[None]:
    """Turn errors of ours into lines on stderr and an exit code; anything else is a defect and keeps its traceback."""
    from gustform.language.errors import GustformError
    from gustform_cli.errors import ErrorList

    try:
        yield
    except ErrorList as several:
        for error in several.errors:
            print(error, file=sys.stderr)
        raise typer.Exit(max(exit_code(error) for error in several.errors)) from None
    except GustformError as error:
        print(error, file=sys.stderr)
        raise typer.Exit(exit_code(error)) from None
    except KeyboardInterrupt:
        print("gustform: interrupted", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def exit_code(error: object) -> int:
    """2 for what the caller can mend on the command line or in the scenario, 1 for the rest."""
    return USAGE if str(getattr(error, "code", "")).startswith(_USAGE_CODES) else FAILED
