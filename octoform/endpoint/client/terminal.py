"""The endpoint for a person at a terminal: list its tools, call one of them. Light.

A call is judged by the tool's own schemas before it reaches a device, so that a wrong name or value is answered with
a hint and not with a fault. Where the policy wants a call confirmed, the endpoint asks back and the person answers.
"""

import json
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from socket import socket
from typing import Any, Protocol

from octoform.base import files
from octoform.base.clock import stamp
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.endpoint.client.jsonrpc import ToolCall, Wire, WireError, save_media, sender
from octoform.endpoint.dial import down, halted, knock, reach
from octoform.endpoint.expected_tools import hidden
from octoform.endpoint.published_files import CHECK, read_manifest
from octoform.endpoint.scripts.toolschema import as_tool, converted, first_fault, result_text
from octoform.records import dataclass, replace
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

# Keep what was just seen of the live endpoint, so that the next plan knows of it.
#
# A plan starts nothing, so it knows whether the endpoint lives only from the last check. A command that asks the
# endpoint therefore leaves word when it is other than the last check found it: a plan that still reported "no changes"
# after a report that the endpoint is down would lead nowhere.


@dataclass(frozen=True, slots=True)
class EndpointState:
    """The state of an endpoint as just seen: whether it answered, else why not, and the names of its tools."""

    answered: bool
    error: str | None = None
    tools: tuple[str, ...] = ()


def published(layout: Layout) -> str | None:
    """The identity of a published endpoint: the folder of its environment; None when there is none."""
    manifest = read_manifest(layout)
    return str(manifest["environment"]) if manifest and "environment" in manifest else None


def seen_of(tools: Iterable[str]) -> EndpointState:
    """An endpoint that answered with these tools."""
    return EndpointState(True, None, tuple(sorted(tools)))


def record_state(layout: Layout, asked: str | None, state: EndpointState) -> None:
    """Bring the record of the last check up to date where ``state`` differs from it; the test calls stay.

    ``asked`` is what was `published` when it was asked: when another is published meanwhile, its own check is the
    newer word. A record that cannot be written changes nothing for the person who asked, so that is no problem of
    theirs.
    """
    path = layout.endpoint / CHECK
    try:
        known = files.read_json(path)
    except (OSError, ValueError):
        return  # never checked: a plan reports it already
    if not isinstance(known, dict) or published(layout) != asked:
        return
    seen = {"answered": state.answered, "error": state.error, "tools": list(state.tools)}
    if {key: known.get(key) for key in ("answered", "tools")} == {key: seen[key] for key in ("answered", "tools")}:
        return
    document = {**known, **seen, "at": stamp()}
    write_atomic(path, (json.dumps(document, indent=2) + "\n").encode(), 0o600)


__all__ = ["CallResult", "NoTerminal", "Person", "ToolCall", "call", "list_tools", "save_media"]

LIST_SECONDS = 15.0
"""Seconds for the list of tools: the endpoint answers it by itself, whatever its devices do."""
DRY_RUN = "octoform/dry_run"
"""Asks for a dry run in a call's _meta, and marks what was none but that in its result's."""
REFUSED = "octoform/refused"
"""In the _meta of an error: why the endpoint itself did not make the call."""
BEFOREHAND = "octoform -auto-approve"
"""How this client calls itself when no one will read what it is asked."""
MAX_QUESTIONS = 10


@dataclass(frozen=True, slots=True)
class CallResult:
    """A tool's answer: content blocks as MCP has them (media as base64), structured content, duration in ms.

    ``is_error`` is the tool's own word; ``message`` is then its text. ``refused`` is the endpoint's code where it
    did not let the call through (``denied``, ``estop``, ...), else None. ``dry``: nothing was done, only described.
    """

    content: tuple[dict[str, Any], ...]
    structured: dict[str, Any] | None
    is_error: bool
    message: str
    ms: float
    refused: str | None = None
    dry: bool = False


class Person(Protocol):
    """Anyone who waits for a call, as far as they are notified and asked before its result is there."""

    def waiting(self) -> None:
        """The endpoint is being started, and that takes more than a second."""

    def progress(self, done: float, total: float | None, message: str) -> None:
        """How far the tool is, in its own words."""

    def approves(self, tool: str, arguments: Mapping[str, Any], message: str) -> bool | None:
        """Whether the call may be made, as ``message`` asks; None when no one can be asked."""


class NoTerminal:
    """No one waits, no one can be asked."""

    def waiting(self) -> None:
        """No one is notified."""

    def progress(self, done: float, total: float | None, message: str) -> None:
        """No one is notified."""

    def approves(self, tool: str, arguments: Mapping[str, Any], message: str) -> bool | None:
        """No one answers: None."""


class _NoOneToAsk(Exception):
    """A question came, and there is no one to ask: no answer is sent, since every one would be a person's word."""


Tools = tuple[tuple[dict[str, Any], ...], tuple[Diagnostic, ...]]
Called = tuple[CallResult | None, tuple[Diagnostic, ...]]


def list_tools(
    layout: Layout, waiting: Callable[[], None] | None = None, *, start: bool = True, revive: bool = False
) -> Tools:
    """The tools of the live endpoint (name, description, input_schema, output_schema, annotations), by name.

    With ``start`` it is started when nothing runs; ``waiting`` is called when that takes more than a second. With
    ``revive`` it is started although a person stopped it.
    """
    connect = partial(reach, layout, waiting, revive=revive) if start else partial(knock, layout)
    found = _opened(layout, connect)
    if isinstance(found, Diagnostic):
        return (), (found,)
    wire, tools = found
    wire.close()
    return tools, ()


def call(layout: Layout, wanted: ToolCall, person: Person | None = None) -> Called:
    """Call a tool of the live endpoint, which is started when nothing runs.

    What the tool reports of itself is in the result; a wrong name, a wrong argument, a call that is not approved or a
    dead endpoint are diagnostics.
    """
    somebody = person or NoTerminal()
    found = _opened(layout, partial(reach, layout, somebody.waiting, revive=wanted.revive))
    if isinstance(found, Diagnostic):
        return None, (found,)
    wire, tools = found
    try:
        known = next((tool for tool in tools if tool["name"] == wanted.tool), None)
        if known is None and wanted.tool in hidden(layout):
            # No client is shown it. The endpoint gives the reason, and its log has the attempt.
            known = {"name": wanted.tool, "input_schema": {}}
        if known is None:
            return None, (unknown_tool(wanted.tool, [str(tool["name"]) for tool in tools]),)
        return _Call(wire, wanted, somebody).made(known)
    except _NoOneToAsk:
        words = "no one could be asked: there is no terminal; -auto-approve approves"
        return None, (error("ENDPOINT-CALL-NOT-APPROVED", f"{wanted.tool} wants an approval", detail=words),)
    except WireError as problem:
        return None, (_broken(wanted, problem),)
    finally:
        wire.close()


def _opened(
    layout: Layout, connect: Callable[[], socket | Diagnostic]
) -> tuple[Wire, tuple[dict[str, Any], ...]] | Diagnostic:
    """A connection to the endpoint and its tools by name; what was seen of it is kept for the next plan."""
    asked = published(layout)
    found = halted(layout) or _answered(connect)
    if isinstance(found, WireError) and found.kind == "closed":
        # It may just have been ending: a list may be asked for twice, and what is started answers.
        found = _answered(connect)
    if isinstance(found, WireError):
        found = down(str(found))
    if not isinstance(found, Diagnostic):
        record_state(layout, asked, seen_of(tool["name"] for tool in found[1]))
    elif found.code not in ("ENDPOINT-NOT-APPLIED", "ENDPOINT-STOPPED"):
        record_state(layout, asked, EndpointState(False, found.detail or found.summary))
    return found


def _answered(
    connect: Callable[[], socket | Diagnostic],
) -> tuple[Wire, tuple[dict[str, Any], ...]] | Diagnostic | WireError:
    connection = connect()
    if isinstance(connection, Diagnostic):
        return connection
    wire = Wire(connection)
    try:
        return wire, _listed(wire)
    except WireError as fault:
        wire.close()
        return fault
    except BaseException:
        wire.close()
        raise


def _listed(wire: Wire) -> tuple[dict[str, Any], ...]:
    found: list[dict[str, Any]] = []
    params: dict[str, Any] = {}
    while True:
        result = wire.ask("tools/list", params, LIST_SECONDS)
        try:
            found += [as_tool(tool) for tool in result["tools"]]
        except (LookupError, TypeError) as problem:
            raise WireError("refused", f"its list of tools is none ({problem!r})") from problem
        if not result.get("nextCursor"):
            return tuple(sorted(found, key=lambda tool: str(tool["name"])))
        params = {"cursor": result["nextCursor"]}


class _Call:
    """One call with the questions that the endpoint has before it makes it."""

    def __init__(self, wire: Wire, wanted: ToolCall, person: Person) -> None:
        self._wire = wire
        self._wanted = wanted
        self._person = person
        self._answer = True
        """The person's last answer; True while nothing was asked."""

    def made(self, tool: Mapping[str, Any]) -> Called:
        """The result, or what is wrong with the call or with the answer."""
        wanted = self._wanted
        schema = tool["input_schema"]
        wanted = self._wanted = replace(
            wanted, arguments={**wanted.arguments, **converted(wanted.texts, schema)}, texts={}
        )
        if fault := first_fault(wanted.arguments, schema):
            return None, (_bad_argument(wanted.tool, schema, fault["field"], fault["message"]),)
        began = time.monotonic()
        result = self._asked()
        ms = round((time.monotonic() - began) * 1000, 1)
        if not self._answer:
            summary = f"{wanted.tool} was not approved"
            return None, (error("ENDPOINT-CALL-NOT-APPROVED", summary, detail=result_text(result) or None),)
        # A tool whose schema has no room for it can only report a dry run as an error.
        dry = (result.get("_meta") or {}).get(DRY_RUN) is True
        content, structured = tuple(result.get("content", ())), result.get("structuredContent")
        is_error = bool(result.get("isError")) and not (dry and wanted.dry_run)
        refused = (result.get("_meta") or {}).get(REFUSED)
        return CallResult(
            content, structured, is_error, result_text(result), ms, refused if is_error else None, dry
        ), ()

    def _asked(self) -> dict[str, Any]:
        """The final result, after every question was answered."""
        params = self._wanted.params
        meta: dict[str, Any] = {DRY_RUN: True} if self._wanted.dry_run else {}
        if self._wanted.approved:
            meta |= sender(BEFOREHAND)
        more: dict[str, Any] = {}
        for _ in range(MAX_QUESTIONS):
            seconds, progress = self._wanted.seconds, self._person.progress
            result = self._wire.ask("tools/call", params | more, seconds, progress=progress, meta=meta)
            if result.get("resultType") != "input_required":
                return result
            questions = result.get("inputRequests") or {}
            more = {"inputResponses": {key: self._response(asked) for key, asked in questions.items()}}
            if "requestState" in result:
                more["requestState"] = result["requestState"]
        raise WireError("refused", f"it asked more than {MAX_QUESTIONS} times")

    def _response(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """The person's answer to a question that can be answered with yes or no."""
        params = request.get("params", {})
        fields = params.get("requestedSchema", {}).get("properties", {})
        simple = all(given.get("type") == "boolean" for given in fields.values())
        if request.get("method") != "elicitation/create" or not simple:
            raise WireError("refused", "it asked for what cannot be answered with yes or no")
        answer = self._person.approves(self._wanted.tool, self._wanted.arguments, str(params.get("message", "")))
        if answer is None:
            raise _NoOneToAsk
        self._answer = answer
        if not answer:
            return {"action": "decline"}
        return {"action": "accept", "content": dict.fromkeys(fields, True)}


def unknown_tool(tool: str, known: list[str]) -> Diagnostic:
    """The error for the name of a tool that the endpoint does not have."""
    meant = did_you_mean(tool, known)
    hint = f"did you mean {meant!r}?" if meant else "octoform tools lists them"
    return error("ENDPOINT-UNKNOWN-TOOL", f"the endpoint has no tool {tool!r}", hint=hint)


def _bad_argument(tool: str, schema: Mapping[str, Any], field: str | None, message: str) -> Diagnostic:
    known = schema.get("properties", {})
    where = f"argument {field!r}" if field else "the arguments"
    hint = f"{tool} takes {', '.join(known)}" if known else f"{tool} takes no arguments"
    if field and field not in known and (meant := did_you_mean(field, list(known))):
        hint = f"did you mean {meant!r}?"
    elif field and isinstance(known.get(field), dict):
        hint = _about(field, known[field]) or hint
    return error("ENDPOINT-BAD-ARGUMENT", f"{where} of {tool}: {message}", hint=hint)


def _about(name: str, given: Mapping[str, Any]) -> str:
    """The description of a parameter, and the values that it may have where they can be counted."""
    lines = [str(given["description"])] if given.get("description") else []
    ways = given.get("anyOf", [given])
    values = [value for way in ways for value in way.get("enum", [way["const"]] if "const" in way else [])]
    return "; ".join([*lines, f"{name} is one of {', '.join(map(str, values))}"] if values else lines)


def _broken(wanted: ToolCall, problem: WireError) -> Diagnostic:
    tool = wanted.tool
    if problem.kind == "timeout":
        summary = f"{tool} gave no answer within {wanted.seconds:g} s"
        hint = "the device may be busy or gone; octoform status shows more"
        return error("ENDPOINT-CALL-TIMEOUT", summary, hint=hint)
    if problem.kind == "refused":
        return error("ENDPOINT-CALL-REFUSED", f"the endpoint refused the call of {tool}", detail=str(problem))
    hint = "octoform logs shows what the endpoint printed last"
    return error("ENDPOINT-DOWN", f"the endpoint broke off during {tool}", detail=str(problem), hint=hint)
