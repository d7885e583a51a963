"""The JSON schema of a record, in the narrow form that viewers of MCAP read.

Foxglove's parser wants `type: object` at the root and a plain type for each field; it follows no `$ref`, which is what
msgspec writes for a Struct and for an enumeration.
"""

from typing import Any

import msgspec


def schema(kind: type) -> dict[str, Any]:
    """The schema of a Struct whose fields are plain or enumerations; each reference stands where it points to."""
    (root,), parts = msgspec.json.schema_components((kind,))
    return _inlined(root, parts)


def _inlined(one: dict[str, Any], parts: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in one:
        one = parts[one["$ref"].removeprefix("#/$defs/")]
    if "enum" in one:
        one = {"type": "string", **one}
    if "properties" in one:
        one = one | {"properties": {name: _inlined(field, parts) for name, field in one["properties"].items()}}
    return one
