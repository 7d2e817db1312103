"""The canonical form of an artifact: kinds only, so that two hosts with the same devices agree byte for byte.

The schema states which members are of one host (``x-instance``) or of one moment (``x-volatile``); this module walks
value and schema together and drops them. It is light, because a plan with nothing to do digests every artifact.
"""

from pathlib import Path
from typing import Any

from octoform.base import digest
from octoform.base.files import read_json
from octoform.base.shape import resolve

_DROPPED = ("x-instance", "x-volatile")


def schema_path(stage: str, schemas: Path) -> Path:
    """Where the schema of a stage lies in a folder of schemas; all privileged steps share one."""
    return schemas / f"{'step' if stage.startswith('step.') else stage}.v1.schema.json"


def load_schema(stage: str, schemas: Path) -> dict[str, Any]:
    """The schema of a stage; OSError or ValueError when the installation is broken."""
    schema = read_json(schema_path(stage, schemas))
    if not isinstance(schema, dict):
        raise ValueError(f"{schema_path(stage, schemas)} does not hold a JSON object")
    return schema


def canonical(stage: str, value: object, schemas: Path) -> object:
    """``value`` without its members of one host or one moment; a copy, the value itself is not changed.

    For ``serve`` the canonical form is the text itself: generated code holds kinds only.
    """
    if stage == "serve":
        return value
    root = load_schema(stage, schemas)
    return _strip(value, root, root)


def output_digest(stage: str, value: object, schemas: Path) -> str:
    """Digest of the canonical form; of the UTF-8 text for ``serve``."""
    if stage == "serve":
        return digest.of_bytes(str(value).encode("utf-8", "surrogatepass"))
    return digest.of_value(canonical(stage, value, schemas))


def _strip(value: object, schema: object, root: dict[str, Any]) -> object:
    schema = _resolved(schema, root)
    if not isinstance(schema, dict):
        return value
    if isinstance(value, dict):
        return {
            name: _strip(item, _member(name, schema, root), root)
            for name, item in value.items()
            if not _dropped(_member(name, schema, root), root)
        }
    if isinstance(value, list):
        return [_strip(item, schema.get("items"), root) for item in value]
    return value


def _member(name: str, schema: dict[str, Any], root: dict[str, Any]) -> object:
    for part in (schema, *(_resolved(item, root) for item in schema.get("allOf", ()))):
        if isinstance(part, dict) and name in part.get("properties", {}):
            return part["properties"][name]
    return schema.get("additionalProperties")


def _dropped(schema: object, root: dict[str, Any]) -> bool:
    places = (schema, _resolved(schema, root))
    return any(isinstance(place, dict) and place.get(mark) is True for place in places for mark in _DROPPED)


def _resolved(schema: object, root: dict[str, Any]) -> object:
    """The schema that a chain of local references ends at."""
    for _ in range(16):
        reference = schema.get("$ref") if isinstance(schema, dict) else None
        if not isinstance(reference, str) or not reference.startswith("#"):
            return schema
        schema = resolve(root, reference)
    raise ValueError("references of a schema go in a circle")
