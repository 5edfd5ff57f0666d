"""`gustform new`: a commented scenario to start from."""

from __future__ import annotations

from pathlib import Path

from gustform.language.errors import GustformError

SCENARIOS = Path(__file__).with_name("scenarios")
SCHEMA = Path(__file__).with_name("scenario.schema.json")
TEMPLATE = SCENARIOS / "load_step_8ms.yaml"


def write(file: Path) -> str:
    """Write the template; returns what to do next. GF7003 if the file exists, GF7001 if it cannot be written."""
    # Editors look the schema up where this installation has it; in the package the path is relative.
    text = TEMPLATE.read_text(encoding="utf-8").replace("$schema=../scenario.schema.json", f"$schema={SCHEMA}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("x", encoding="utf-8") as stream:  # x: never over an existing file
            stream.write(text)
    except FileExistsError:
        raise GustformError("GF7003", f"{str(file)!r} must not exist yet; it does", hint="another name") from None
    except OSError as error:
        raise GustformError(
            "GF7001", f"{str(file)!r} must be writable; {error.strerror or error}", hint="another folder"
        ) from None
    return f"{file}\nnext: gustform simulate {file}"
