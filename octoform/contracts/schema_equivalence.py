"""Two input schemas compared for what they accept, not for how they are written.

INTERFACE is written by an agent; the server's schemas come out of a Python signature by way of a library with
habits of its own (titles everywhere, `anyOf` with null for what may be omitted, `const` for an enum of one). Only
what changes the values that a caller may send counts as a difference. Light.
"""

from collections.abc import Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import resolve
from octoform.contracts.artifact_parser import MAX_DEPTH, deeper_than
from octoform.contracts.model import JsonObject
from octoform.diagnostics import Diagnostic, error

_SILENT = frozenset(
    {"title", "description", "examples", "$schema", "$id", "$comment", "$defs", "definitions", "deprecated"}
    | {"readOnly", "writeOnly"}
)
_SUBSCHEMAS = frozenset({"items", "additionalProperties", "not", "if", "then", "else", "contains", "propertyNames"})
_LISTS = frozenset({"anyOf", "oneOf", "allOf", "prefixItems"})
_TABLES = frozenset({"properties", "patternProperties", "dependentSchemas"})
_MAX_INLINED = 60


def schema_equal(a: dict[str, Any], b: dict[str, Any]) -> list[str]:
    """The differences between two schemas of type object, one line each; empty when they accept the same.

    ``a`` is what was promised and ``b`` what is there: a line reads "properties.x.maximum: 10 promised, 20 found".
    Dropped before comparing: titles, descriptions, examples, the order of keys, of ``required`` and of enums. Made
    one: local references and what they stand for, ``anyOf`` of X and null with the default null and an optional X,
    ``const`` and an enum of one, 1.0 and 1, a missing ``additionalProperties`` at the top and false.
    """
    return _differences(normal_form(a), normal_form(b), "")


def result_differences(promised: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """Where a server's result may be another one than promised, one line each, in the words of `schema_equal`.

    A result may be narrower than its promise: an integer for a number, never null where null was allowed, more members
    where the promise does not forbid them. Ranges, lengths and what is required are left to the results themselves.
    """
    return _wider(normal_form(promised), normal_form(found), "") if promised.get("properties") else []


def normal_form(schema: dict[str, Any]) -> Any:
    """The form that `schema_equal` compares; a copy."""
    value = _Normaliser(schema).schema(schema)
    if isinstance(value, dict):
        value.setdefault("additionalProperties", False)
        value.setdefault("properties", {})
    return value


class _Normaliser:
    """Rewrites one schema; references are followed at most `_MAX_INLINED` times in all, so every schema ends."""

    def __init__(self, root: dict[str, Any]) -> None:
        self.root = root
        self.left = _MAX_INLINED

    def schema(self, schema: Any) -> Any:
        """The normal form of a schema or of a part of one."""
        if not isinstance(schema, dict):
            return schema
        reference = schema.get("$ref")
        if isinstance(reference, str) and reference.startswith("#") and self.left > 0:
            target = resolve(self.root, reference)
            if isinstance(target, dict):
                self.left -= 1
                beside = {name: item for name, item in schema.items() if name != "$ref"}
                return self.schema({**target, **beside})
        return _merged({name: self.keyword(name, item) for name, item in schema.items() if name not in _SILENT})

    def keyword(self, name: str, item: Any) -> Any:
        """The normal form of one keyword's value."""
        if name in _SUBSCHEMAS:
            return self.schema(item)
        if name in _LISTS and isinstance(item, list):
            return [self.schema(part) for part in item]
        if name in _TABLES and isinstance(item, dict):
            return {key: self.schema(part) for key, part in item.items()}
        if name in ("required", "type") and isinstance(item, list):
            return sorted(item, key=str)
        return _plain(item)


def _merged(schema: dict[str, Any]) -> dict[str, Any]:
    """The spellings of one meaning made one."""
    if "const" in schema:
        schema["enum"] = [schema.pop("const")]
    if isinstance(schema.get("type"), list):
        if len(schema["type"]) == 1:
            schema["type"] = schema["type"][0]
        elif "null" in schema["type"]:
            schema = _split_null(schema)
    schema = _optional(schema)
    if isinstance(schema.get("enum"), list):
        schema["enum"] = sorted(schema["enum"], key=lambda item: (str(type(item)), str(item)))
        if all(_has_type(item, schema.get("type")) for item in schema["enum"]):
            schema.pop("type", None)
    for name in ("required", "properties"):
        if not schema.get(name, True):
            del schema[name]
    return schema


def _split_null(schema: dict[str, Any]) -> dict[str, Any]:
    """``type: [X, null]`` as the ``anyOf`` that Python signatures give."""
    kinds = [kind for kind in schema["type"] if kind != "null"]
    rest = {name: item for name, item in schema.items() if name not in ("type", "default")}
    inner = {**rest, "type": kinds[0] if len(kinds) == 1 else kinds}
    default = {"default": schema["default"]} if "default" in schema else {}
    return {"anyOf": [inner, {"type": "null"}], **default}


def _optional(schema: dict[str, Any]) -> dict[str, Any]:
    """X for ``anyOf: [X, null]`` whose default is null; a single choice for a choice of one."""
    choices = schema.get("anyOf", schema.get("oneOf"))
    if not isinstance(choices, list):
        if schema.get("default", 0) is None:
            return {name: item for name, item in schema.items() if name != "default"}
        return schema
    real = [item for item in choices if item != {"type": "null"}]
    nullable = len(real) < len(choices)
    if len(real) != 1 or not isinstance(real[0], dict) or (nullable and schema.get("default", 0) is not None):
        return schema
    rest = {name: item for name, item in schema.items() if name not in ("anyOf", "oneOf")}
    if nullable:
        rest.pop("default", None)
    return {**real[0], **rest}


def _has_type(value: Any, kind: Any) -> bool:
    if isinstance(value, bool):
        return bool(kind == "boolean")
    kinds = {str: ("string",), int: ("integer", "number"), float: ("number",), type(None): ("null",)}
    return kind in kinds.get(type(value), ())


def _plain(value: Any) -> Any:
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    return value


def _differences(a: Any, b: Any, where: str) -> list[str]:
    if isinstance(a, dict) and isinstance(b, dict):
        out = []
        for name in sorted({*a, *b}):
            place = f"{where}.{name}" if where else str(name)
            if name not in b:
                out.append(f"{_shown_place(place)}: {_short(a[name])} promised, nothing found")
            elif name not in a:
                out.append(f"{_shown_place(place)}: {_short(b[name])} found, nothing promised")
            else:
                out += _differences(a[name], b[name], place)
        return out
    if _same(a, b):
        return []
    return [f"{_shown_place(where)}: {_short(a)} promised, {_short(b)} found"]


def _same(a: Any, b: Any) -> bool:
    # True == 1 in Python, but not in JSON.
    return bool(a == b) and isinstance(a, bool) == isinstance(b, bool)


def _short(value: Any) -> str:
    return display(value, 60)[1:-1]


def _shown_place(place: str) -> str:
    return display(place, 120)[1:-1]


def _wider(promised: Any, found: Any, where: str) -> list[str]:
    wanted, given = _kinds(promised), _kinds(found)
    if not wanted:
        return []
    place = _shown_place(where) or "the result"
    if not given:
        is_known = isinstance(found, dict) and "$ref" in found  # beyond the references that a comparison follows
        return [] if is_known else [f"{place}: {_short(_named(wanted))} promised, nothing found"]
    if given - wanted - ({"integer"} if "number" in wanted else set()):
        return [f"{place}: {_short(_named(wanted))} promised, {_short(_named(given))} found"]
    choices, real = promised.get("enum"), found.get("enum")
    if choices is not None and (real is None or any(not _is_among(item, choices) for item in real)):
        return [f"{place}: {_short(choices)} promised, {_short(real or _named(given))} found"]
    out = []
    wanted_list, found_list = _only(promised, "array"), _only(found, "array")
    if wanted_list and found_list:
        out += _wider(wanted_list.get("items", {}), found_list.get("items", {}), f"{where}[]")
    wanted_record, found_record = _only(promised, "object"), _only(found, "object")
    if wanted_record and found_record:
        out += _members(wanted_record, found_record, where)
    return out


def _members(promised: dict[str, Any], found: dict[str, Any], where: str) -> list[str]:
    wanted, given = promised.get("properties", {}), found.get("properties", {})
    out = []
    for name, schema in wanted.items():
        place = f"{where}.{name}" if where else str(name)
        if name in given:
            out += _wider(schema, given[name], place)
        else:
            out.append(f"{_shown_place(place)}: promised, nothing found")
    if wanted and promised.get("additionalProperties") is False:
        extra = sorted(given.keys() - wanted.keys())
        out += [f"{_shown_place(f'{where}.{name}' if where else name)}: found, nothing promised" for name in extra]
    return out


def _alternatives(schema: Any) -> list[dict[str, Any]]:
    if not isinstance(schema, dict):
        return []
    choices = schema.get("anyOf", schema.get("oneOf"))
    if not isinstance(choices, list):
        return [schema]
    return [item for choice in choices for item in _alternatives(choice)]


def _kinds(schema: Any) -> set[str]:
    """The JSON types that a schema allows; empty where it does not say."""
    out: set[str] = set()
    for item in _alternatives(schema):
        kind = item.get("type")
        if "enum" in item:
            out |= {_type_of(value) for value in item["enum"]}
        elif isinstance(kind, str):
            out.add(kind)
        elif isinstance(kind, list):
            out |= {str(each) for each in kind}
        else:
            return {"object"} if item.get("properties") else set()
    return out


def _only(schema: Any, kind: str) -> dict[str, Any] | None:
    """The one alternative of a type; None where there is none, or more than one."""
    found = [item for item in _alternatives(schema) if kind in _kinds(item)]
    return found[0] if len(found) == 1 else None


def _type_of(value: Any) -> str:
    names = {bool: "boolean", int: "integer", float: "number", str: "string", type(None): "null", list: "array"}
    return names.get(type(value), "object")


def _named(kinds: set[str]) -> str:
    return " or ".join(sorted(kinds))


def _is_among(value: Any, values: list[Any]) -> bool:
    return any(_same(value, item) for item in values)


# What a server really declares once it is imported, held against what INTERFACE promised. Light.

_HINTS = ("readOnlyHint", "destructiveHint", "idempotentHint", "openWorldHint")


def serve_dynamic(report: Mapping[str, Any], interface: JsonObject, path: str = "server.py") -> list[Diagnostic]:
    """The differences between an import report and the INTERFACE artifact.

    ``report`` has ``tools``: a list of objects with ``name``, ``input_schema``, ``output_schema`` and ``annotations``
    in the wire's spelling. That the import itself went well is for the caller to know.
    """
    wanted = {tool["name"]: tool for tool in interface["tools"]}
    found = {str(tool["name"]): tool for tool in report.get("tools") or ()}
    out = _sets(wanted, found, path)
    for name in sorted(wanted.keys() & found.keys()):
        out += _schema(name, wanted[name], found[name], path)
        out += _result(name, wanted[name], found[name], path)
        out += _annotations(name, wanted[name], found[name], path)
    return out


def _sets(wanted: Mapping[str, Any], found: Mapping[str, Any], path: str) -> list[Diagnostic]:
    out = []
    absent, foreign = sorted(wanted.keys() - found.keys()), sorted(found.keys() - wanted.keys())
    hint = "serve exactly the tools of the INTERFACE artifact"
    if absent:
        summary = f"the imported server lacks {len(absent)} tools of INTERFACE: {listed(absent)}"
        out.append(error("SERVE-TOOLS-DIFFER", summary, path=path, hint=hint))
    if foreign:
        summary = f"the imported server has {len(foreign)} tools that INTERFACE does not have: {listed(foreign)}"
        out.append(error("SERVE-TOOLS-DIFFER", summary, path=path, hint=hint))
    return out


def _schema(name: str, wanted: JsonObject, found: Mapping[str, Any], path: str) -> list[Diagnostic]:
    schema = found.get("input_schema")
    if not isinstance(schema, dict) or deeper_than(schema, MAX_DEPTH):
        schema = {}  # nothing that INTERFACE could have promised
    lines = schema_equal(wanted["input_schema"], schema)
    if not lines:
        return []
    return [
        error(
            "SERVE-SCHEMA-DIFFERS",
            f"the input schema of {display(name)} is not the one that INTERFACE promises",
            path=path,
            detail="\n".join(lines[:20]),
            hint="write parameters whose types, ranges, defaults and names give exactly that input_schema",
        )
    ]


def _result(name: str, wanted: JsonObject, found: Mapping[str, Any], path: str) -> list[Diagnostic]:
    schema = found.get("output_schema")
    if not isinstance(schema, dict) or deeper_than(schema, MAX_DEPTH):
        schema = {}
    lines = result_differences(wanted.get("output_schema", {}), schema)
    if not lines:
        return []
    summary = f"the result of {display(name)} is not the one that INTERFACE promises"
    hint = "annotate the function with a dataclass or model whose members are those of output_schema, or register the "
    hint += "tool with output_schema={...} where it returns a ToolResult"
    return [error("SERVE-RESULT-DIFFERS", summary, path=path, detail="\n".join(lines[:20]), hint=hint)]


def _annotations(name: str, wanted: JsonObject, found: Mapping[str, Any], path: str) -> list[Diagnostic]:
    fields = found.get("annotations") or {}
    lines = [
        f"{hint}: {str(wanted['annotations'][hint]).lower()} promised, {str(fields.get(hint, 'nothing')).lower()} found"
        for hint in _HINTS
        if fields.get(hint) is not wanted["annotations"][hint]
    ]
    if not lines:
        return []
    summary = f"the `annotations` of {display(name)} are not the ones that INTERFACE promises"
    hint = "pass annotations={...} to @mcp.tool with the four hints of the INTERFACE artifact"
    return [error("SERVE-ANNOTATIONS-DIFFER", summary, path=path, detail="\n".join(lines), hint=hint)]
