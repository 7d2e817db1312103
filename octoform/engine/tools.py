"""The live endpoint for a person: its tools, one call. Light where apply's memo knows the host."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import CallResult, Person, list_tools, save_media, unknown_tool
from octoform.endpoint.client.terminal import call as call_tool
from octoform.endpoint.expected_tools import promised
from octoform.endpoint.published_files import CHECK, read_policy
from octoform.engine.plan import memo
from octoform.records import dataclass, replace
from octoform.state.files import foreign, read_regular
from octoform.state.layout import Layout


@dataclass(frozen=True, slots=True)
class SavedAnswer:
    """A tool's answer and the files that its pictures and sounds were written to."""

    result: CallResult
    files: tuple[Path, ...]


def tools(
    project: Path,
    environ: Mapping[str, str],
    waiting: Callable[[], None] | None = None,
    *,
    names: Sequence[str] = (),
    revive: bool = False,
) -> tuple[list[dict[str, Any]] | None, list[Diagnostic]]:
    """The tools that the endpoint lists, with effect and devices from INTERFACE and the decision of the policy.

    With ``names`` those alone; ENDPOINT-UNKNOWN-TOOL for one that is not there. The endpoint is started when nothing
    runs, and with ``revive`` also when a person stopped it; ``waiting`` is called when that takes more than a second.
    """
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    listed, problems = list_tools(layout, waiting, revive=revive)
    if has_errors(problems):
        return None, list(problems)
    served = [tool["name"] for tool in listed]
    absent = [unknown_tool(name, served) for name in names if name not in served]
    if absent:
        return None, absent
    known, decided = promised(layout), (read_policy(layout) or {"tools": {}})["tools"]
    out = []
    for tool in listed:
        if names and tool["name"] not in names:
            continue
        name, extra = tool["name"], ("effect", "devices")
        fields = {key: known.get(name, {}).get(key) for key in extra}
        out.append({**tool, **fields, "decision": decided.get(name, {}).get("decision")})
    return out, []


def call(
    project: Path,
    environ: Mapping[str, str],
    wanted: ToolCall,
    person: Person | None = None,
    *,
    pairs: Sequence[str] = (),
    document: str | None = None,
) -> tuple[SavedAnswer | None, list[Diagnostic]]:
    """Call a tool, with arguments as a command line has them: ``name=value`` pairs and one JSON object.

    Media go to files in the working folder's .octoform.
    """
    given, texts, found = _arguments(pairs, document)
    layout, more = layout_of(project, environ)
    if layout is None or found:
        return None, [*found, *more]
    result, problems = call_tool(layout, replace(wanted, arguments=given, texts=texts), person)
    if result is None:
        return None, list(problems)
    saved, more = save_media(result.content, layout.local / "results", wanted.tool)
    return SavedAnswer(result, tuple(saved)), more


def answered(project: Path, environ: Mapping[str, str]) -> frozenset[str]:
    """The reading tools that answered well when DEPLOY tried them; empty where that is not known."""
    layout, _ = layout_of(project, environ)
    data = read_regular(layout.endpoint / CHECK)[0] if layout is not None else None
    try:
        calls = parse(data or b"{}").get("calls", ())
        return frozenset(each["tool"] for each in calls if each.get("ok"))
    except (ValueError, LookupError, TypeError, AttributeError):  # it only chooses an example
        return frozenset()


def example(listed: Sequence[Mapping[str, Any]], good: frozenset[str]) -> tuple[str, list[str]] | None:
    """Name and arguments (``NAME=VALUE``) of a call that only reads; None where each needs what no one can guess.

    One of the ``good`` tools goes first. A required argument that is a choice gets its first value.
    """
    for tool in sorted(listed, key=lambda each: each["name"] not in good):
        properties = tool["input_schema"].get("properties", {})
        required = tool["input_schema"].get("required", ())
        if tool.get("effect") == "read" and all(properties.get(name, {}).get("enum") for name in required):
            return tool["name"], [f"{name}={properties[name]['enum'][0]}" for name in required]
    return None


def layout_of(project: Path, environ: Mapping[str, str]) -> tuple[Layout | None, list[Diagnostic]]:
    """The paths of the project's host, from the memo where it holds; the diagnostics where there is none.

    What another user keeps to himself is such a problem: nothing that is in there can be distinguished from what is not
    there.
    """
    host = memo.host_of(project)
    if host is not None:
        return _open(Layout(project, host))
    from octoform.engine.plan.configuration import compile_project  # the one heavy import that the memo saves

    compiled, found = compile_project(project, environ)
    return (None, found) if compiled is None else _open(compiled.layout, found)


def _open(layout: Layout, found: Sequence[Diagnostic] = ()) -> tuple[Layout | None, list[Diagnostic]]:
    closed = foreign(layout)
    return (layout, list(found)) if closed is None else (None, [*found, closed])


def _arguments(pairs: Sequence[str], document: str | None) -> tuple[dict[str, Any], dict[str, str], list[Diagnostic]]:
    hint = "write -arg name=value, or -json '{\"name\": value}'"
    names = [pair.partition("=")[0] for pair in pairs]
    bad = [pair for pair in pairs if not pair.partition("=")[0] or "=" not in pair]
    if bad:
        return {}, {}, [error("CALL-BAD-ARGUMENT", f"{bad[0]!r} is not name=value", hint=hint)]
    try:
        given = parse(document or "{}")
    except ValueError as problem:
        return {}, {}, [error("CALL-BAD-ARGUMENT", f"the arguments are not JSON: {problem}", hint=hint)]
    if not isinstance(given, dict):
        return {}, {}, [error("CALL-BAD-ARGUMENT", "the arguments must be one JSON object", hint=hint)]
    twice = [name for name in names if names.count(name) > 1 or name in given]
    if twice:
        return {}, {}, [error("CALL-BAD-ARGUMENT", f"{twice[0]!r} is given twice", hint="give each argument once")]
    return given, dict(pair.split("=", 1) for pair in pairs), []
