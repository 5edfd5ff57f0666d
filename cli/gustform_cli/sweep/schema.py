"""The JSON schema of a campaign, for editors.

python -m gustform_cli.sweep.schema      writes campaign.schema.json beside that of the scenario
"""

from __future__ import annotations

import json
from typing import Any

from gustform_cli.schema import FILE as SCENARIO_SCHEMA
from gustform_cli.schema import tidy
from gustform_cli.sweep.campaign import Campaign

FILE = SCENARIO_SCHEMA.with_name("campaign.schema.json")


def campaign_schema() -> dict[str, Any]:
    """The schema as a JSON object (draft 2020-12)."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gustform campaign",
        **tidy(Campaign.model_json_schema(by_alias=True)),
    }


def schema_text() -> str:
    """The schema as it stands in the file."""
    return json.dumps(campaign_schema(), indent=1, ensure_ascii=False) + "\n"


def main() -> None:
    """Write the file."""
    FILE.write_text(schema_text(), encoding="utf-8")
    print(FILE)


if __name__ == "__main__":
    main()
