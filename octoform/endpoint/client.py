"""The endpoint for a person at a terminal: list its tools, call one of them."""

import base64
import binascii
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.endpoint.errand import Call, Report, recorded_environment, send
from octoform.endpoint.files import private_folder
from octoform.endpoint.sighting import record_sight
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

_MEDIA = {"image": "image", "audio": "audio"}
_ENDINGS = {"image/jpeg": "jpg", "image/png": "png", "audio/wav": "wav", "audio/x-wav": "wav"}


@dataclass(frozen=True, slots=True)
class CallResult:
    """A tool's answer: content blocks as MCP has them (media as base64), structured content, duration in ms.

    ``is_error`` is the tool's own word; ``message`` is then what it said.
    """

    content: tuple[dict[str, Any], ...]
    structured: dict[str, Any] | None
    is_error: bool
    message: str
    ms: float


Tools = tuple[tuple[dict[str, Any], ...], tuple[Diagnostic, ...]]
Called = tuple[CallResult | None, tuple[Diagnostic, ...]]


def list_tools(layout: Layout, mode: str = "auto") -> Tools:
    """The tools of the live endpoint (name, description, input_schema, output_schema, annotations), by name."""
    report = _ask(layout, (), mode)
    if isinstance(report, Diagnostic):
        return (), (report,)
    return tuple(sorted(report.tools, key=lambda tool: str(tool["name"]))), ()


def call(
    layout: Layout,
    tool: str,
    arguments: Mapping[str, Any],
    texts: Mapping[str, str] | None = None,
    timeout: float = 60.0,
) -> Called:
    """Call a tool of the live endpoint; at most ``timeout`` seconds for its answer.

    ``texts`` are arguments as a command line has them (``channel=2``); they are converted by the tool's own input
    schema. What the tool says of itself is in the result; a wrong name, a wrong argument or a dead endpoint are
    diagnostics.
    """
    report = _ask(layout, (Call(tool, arguments, texts or {}, timeout),), "auto")
    if isinstance(report, Diagnostic):
        return None, (report,)
    if not report.calls:
        return None, (_down(report),)
    answer = report.calls[0]
    if answer["problem"] is not None:
        return None, (_problem(answer, report, timeout),)
    result = CallResult(
        tuple(answer["content"]), answer["structured"], answer["is_error"], answer["message"], answer["ms"]
    )
    return result, ()


def save_media(result: CallResult, folder: Path, stem: str) -> tuple[list[Path], list[Diagnostic]]:
    """Write the answer's pictures and sounds as ``<stem>-<n>.<ending>`` (mode 0600); gives the files."""
    saved: list[Path] = []
    for block in result.content:
        if block.get("type") not in _MEDIA:
            continue
        try:
            data = base64.b64decode(block.get("data", ""), validate=True)
        except binascii.Error as fault:
            return saved, [
                error("ENDPOINT-OUTPUT-INVALID", "the answer holds media that are not base64", detail=str(fault))
            ]
        ending = _ENDINGS.get(str(block.get("mimeType")), "bin")
        path = private_folder(folder) / f"{stem}-{len(saved) + 1}.{ending}"
        if problem := write_atomic(path, data, 0o600):
            return saved, [problem]
        saved.append(path)
    return saved, []


def _ask(layout: Layout, calls: tuple[Call, ...], mode: str) -> Report | Diagnostic:
    environment = recorded_environment(layout)
    if environment is None:
        return error(
            "ENDPOINT-NOT-APPLIED", f"{layout.host} has no endpoint yet", hint="run octoform apply, which builds it"
        )
    report = send(layout, environment, calls, mode=mode, keep_content=True)
    record_sight(layout, environment, report)
    return report if report.answered else _down(report)


def _down(report: Report) -> Diagnostic:
    return error(
        "ENDPOINT-DOWN",
        "the endpoint does not answer",
        detail=report.error or "the connection ended",
        hint="octoform plan tells what differs from what was applied; octoform apply repairs it",
    )


def _problem(answer: Mapping[str, Any], report: Report, timeout: float) -> Diagnostic:
    tool, kind = answer["tool"], answer["problem"]
    if kind == "unknown_tool":
        meant = did_you_mean(tool, [str(item["name"]) for item in report.tools])
        hint = f"did you mean {meant!r}?" if meant else "octoform tools lists them"
        return error("ENDPOINT-UNKNOWN-TOOL", f"the endpoint has no tool {tool!r}", hint=hint)
    if kind == "bad_argument":
        return _bad_argument(answer, report)
    if kind == "timeout":
        summary = f"{tool} gave no answer within {timeout:g} s"
        return error(
            "ENDPOINT-CALL-TIMEOUT", summary, hint="the device may be busy or gone; octoform status tells more"
        )
    if kind == "output_schema":
        summary = f"{tool} gives a result that its own output schema refuses"
        return error("ENDPOINT-OUTPUT-INVALID", summary, detail=answer["message"])
    return error("ENDPOINT-DOWN", f"the endpoint broke off during {tool}", detail=answer["message"] or report.error)


def _bad_argument(answer: Mapping[str, Any], report: Report) -> Diagnostic:
    tool, field = answer["tool"], answer["field"]
    schema = next(item["input_schema"] for item in report.tools if item["name"] == tool)
    known = list(schema.get("properties", {}))
    where = f"argument {field!r}" if field else "the arguments"
    hint = f"{tool} takes {', '.join(known)}" if known else f"{tool} takes no arguments"
    if field and field not in known and (meant := did_you_mean(field, known)):
        hint = f"did you mean {meant!r}?"
    elif isinstance(schema.get("properties", {}).get(field), dict):
        hint = schema["properties"][field].get("description") or hint
    return error("ENDPOINT-BAD-ARGUMENT", f"{where} of {tool}: {answer['message']}", hint=hint)
