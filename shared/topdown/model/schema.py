"""The JSON schema of design files, for editors that complete and check TOML while it is written."""

from typing import Any

import msgspec

from topdown.model.elements import DesignFile

DRAFT = "http://json-schema.org/draft-07/schema#"
"""Newer drafts write a tuple otherwise, and taplo (Even Better TOML) does not read that."""


def schema() -> dict[str, Any]:
    """The schema, made of the entries' types; a class's docstring is its description."""
    return {"$schema": DRAFT, **_tuples_of_draft_7(msgspec.json.schema(DesignFile))}


def _tuples_of_draft_7(part: Any) -> Any:
    """`prefixItems` is `items` in draft 7."""
    if isinstance(part, list | tuple):
        return [_tuples_of_draft_7(one) for one in part]
    if not isinstance(part, dict):
        return part
    found = {name: _tuples_of_draft_7(value) for name, value in part.items()}
    if "prefixItems" in found:
        found["items"] = found.pop("prefixItems")
        found["additionalItems"] = False
    return found
