"""The live endpoint for a person: status on two axes, tools, one call. (Heavy.)"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.client import CallResult, list_tools, save_media
from octoform.endpoint.client import call as call_tool
from octoform.endpoint.observing import observe
from octoform.engine import memo
from octoform.engine.compiling import compile_project
from octoform.engine.planning import Request, prepare
from octoform.plan.model import Plan
from octoform.state.layout import Layout


@dataclass(frozen=True, slots=True)
class Status:
    """In sync or not, and healthy, unhealthy or unknown: two separate things.

    ``health`` is ``healthy`` only when the endpoint answered just now with the tools of INTERFACE.
    """

    host: str
    sync: bool | None
    health: str
    reasons: tuple[str, ...] = ()
    plan: Plan | None = None
    tools: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True)
class Answer:
    """A tool's answer and the files that its pictures and sounds were written to."""

    result: CallResult
    files: tuple[Path, ...]


def status(project: Path, environ: Mapping[str, str]) -> Status:
    """Compare with the manifest, and ask the endpoint; starts the launcher once."""
    plan = memo.recall(project, environ)
    if plan is None:
        outlook, found = prepare(Request(project, environ))
        if outlook is None:
            return Status("", None, "unknown", diagnostics=tuple(found))
        plan = outlook.plan
    layout = Layout(project, plan.host)
    facts = observe(layout)
    if not facts.present:
        return Status(plan.host, plan.empty, "unknown", ("there is no endpoint yet",), plan)
    listed, problems = list_tools(layout)
    reasons = [*facts.reasons, *(_told(item) for item in problems)]
    names = tuple(tool["name"] for tool in listed)
    if not problems and set(names) != set(_promised(layout)):
        reasons.append("the endpoint's tools are not those of INTERFACE")
    health = "unhealthy" if reasons else "healthy"
    return Status(plan.host, plan.empty, health, tuple(reasons), plan, names, problems)


def _told(item: Diagnostic) -> str:
    return f"{item.summary}: {item.detail.splitlines()[0]}" if item.detail else item.summary


def _promised(layout: Layout) -> dict[str, Any]:
    """The tools of the INTERFACE artifact by name; none when it can be read no more, which the plan tells."""
    try:
        return {tool["name"]: tool for tool in json.loads(layout.output("interface").read_bytes())["tools"]}
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def tools(project: Path, environ: Mapping[str, str]) -> tuple[list[dict[str, Any]] | None, list[Diagnostic]]:
    """The tools that the endpoint lists, with effect and devices from the INTERFACE artifact."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    listed, problems = list_tools(layout)
    if has_errors(problems):
        return None, list(problems)
    promised = _promised(layout)
    extra = ("effect", "devices")
    return [{**tool, **{key: promised.get(tool["name"], {}).get(key) for key in extra}} for tool in listed], []


def call(
    project: Path, environ: Mapping[str, str], tool: str, pairs: Sequence[str], document: str | None, seconds: float
) -> tuple[Answer | None, list[Diagnostic]]:
    """Call a tool with ``name=value`` pairs or one JSON object; media go to files in the working folder's .octoform."""
    given, texts, found = _arguments(pairs, document)
    layout, more = layout_of(project, environ)
    if layout is None or found:
        return None, [*found, *more]
    result, problems = call_tool(layout, tool, given, texts, seconds)
    if result is None:
        return None, list(problems)
    saved, more = save_media(result, layout.local / "results", tool)
    return Answer(result, tuple(saved)), more


def layout_of(project: Path, environ: Mapping[str, str]) -> tuple[Layout | None, list[Diagnostic]]:
    """The paths of the project's host, from the memo where it holds; the diagnostics where there is none."""
    plan = memo.recall(project, environ)
    if plan is not None:
        return Layout(project, plan.host), []
    compiled, found = compile_project(project, environ)
    return (compiled.layout if compiled else None), found


def _arguments(pairs: Sequence[str], document: str | None) -> tuple[dict[str, Any], dict[str, str], list[Diagnostic]]:
    hint = "write -arg name=value, or -json '{\"name\": value}'"
    names = [pair.partition("=")[0] for pair in pairs]
    bad = [pair for pair in pairs if not pair.partition("=")[0] or "=" not in pair]
    if bad:
        return {}, {}, [error("CALL-BAD-ARGUMENT", f"{bad[0]!r} is not name=value", hint=hint)]
    try:
        given = json.loads(document or "{}")
    except ValueError as problem:
        return {}, {}, [error("CALL-BAD-ARGUMENT", f"the arguments are not JSON: {problem}", hint=hint)]
    if not isinstance(given, dict):
        return {}, {}, [error("CALL-BAD-ARGUMENT", "the arguments must be one JSON object", hint=hint)]
    twice = [name for name in names if names.count(name) > 1 or name in given]
    if twice:
        return {}, {}, [error("CALL-BAD-ARGUMENT", f"{twice[0]!r} is given twice", hint="give each argument once")]
    return given, dict(pair.split("=", 1) for pair in pairs), []
