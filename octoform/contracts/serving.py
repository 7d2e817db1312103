"""What a server really declares once it is imported, held against what INTERFACE promised. Light."""

from collections.abc import Mapping
from typing import Any

from octoform.contracts.model import JsonObject
from octoform.contracts.parsing import MAX_DEPTH, deeper_than
from octoform.contracts.schemas_alike import result_differences, schema_equal
from octoform.contracts.text import listed, shown
from octoform.diagnostics import Diagnostic, error

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
            f"the input schema of {shown(name)} is not the one that INTERFACE promises",
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
    summary = f"the result of {shown(name)} is not the one that INTERFACE promises"
    hint = "annotate the function with a dataclass or model whose members are those of output_schema, or register the "
    hint += "tool with output_schema={...} where it returns a ToolResult"
    return [error("SERVE-RESULT-DIFFERS", summary, path=path, detail="\n".join(lines[:20]), hint=hint)]


def _annotations(name: str, wanted: JsonObject, found: Mapping[str, Any], path: str) -> list[Diagnostic]:
    said = found.get("annotations") or {}
    lines = [
        f"{hint}: {str(wanted['annotations'][hint]).lower()} promised, {str(said.get(hint, 'nothing')).lower()} found"
        for hint in _HINTS
        if said.get(hint) is not wanted["annotations"][hint]
    ]
    if not lines:
        return []
    summary = f"the annotations of {shown(name)} are not the ones that INTERFACE promises"
    hint = "pass annotations={...} to @mcp.tool with the four hints of the INTERFACE artifact"
    return [error("SERVE-ANNOTATIONS-DIFFER", summary, path=path, detail="\n".join(lines), hint=hint)]
