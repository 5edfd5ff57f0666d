"""`gustform report DIR`: finds out what the folder holds and writes its page."""

from __future__ import annotations

from pathlib import Path

from gustform.language.errors import GustformError
from gustform_cli.report.campaign_folder import is_campaign
from gustform_cli.report.run_folder import is_run

PAGE = "report.html"


def write_report(folder: Path, out: Path | None = None) -> Path:
    """The page of a run or a campaign, report.html in its folder unless `out` says otherwise.

    GF7002 if the folder holds neither, GF7001 if the page cannot be written.
    """
    if is_campaign(folder):
        from gustform_cli.report.campaign_page import campaign_page

        text = campaign_page(folder)
    elif is_run(folder):
        from gustform_cli.report.run_page import run_page

        text = run_page(folder)
    else:
        raise GustformError(
            "GF7002",
            f"{str(folder)!r} must be a folder of a run or of a campaign; {_lacks(folder)}",
            hint="the --out folder of gustform simulate or gustform sweep",
        )
    file = out if out is not None else folder / PAGE
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise GustformError(
            "GF7001",
            f"the page {str(file)!r} cannot be written; {error.strerror or error}",
            hint="--out with another file",
        ) from None
    return file


def _lacks(folder: Path) -> str:
    if not folder.exists():
        return "it does not exist"
    if not folder.is_dir():
        return "it is a file"
    return "it has neither result.nc, result.nc.part or summary.json nor scalars.parquet"
