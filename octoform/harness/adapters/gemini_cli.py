"""Harness ``gemini-cli``: the Gemini CLI (@google/gemini-cli), its streamed JSON.

That stream shows what a reply cost only at the very end. The program can also record each reply, with its tokens, to a
file; here that file is its own standard error, so that the limits of turns and money hold while it runs. Its exit
status is an HTTP status modulo 256 and is not read. It reports retries on standard error alone.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from octoform.base.files import replace
from octoform.harness.adapters.program import Launch, ProgramHarness, bounded
from octoform.harness.contained_attempt import Invocation
from octoform.harness.event_parser import count, field, json_object, one_line, problem
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Replying,
    ToolCalled,
    ToolReturned,
    Totals,
    Turn,
    Usage,
)
from octoform.harness.program_location import Pin
from octoform.harness.watcher import added
from octoform.manifest.credentials import SPOKEN
from octoform.manifest.model import HarnessSpec
from octoform.patterns import regex

ATTEMPTS = 4
SPARE_TURNS = 5
"""octoform counts replies itself; the program's own limit only has to hold where no one reads along."""
WEB_TOOLS = ("google_web_search", "web_fetch")
OPTIONS = (
    *("--yolo", "--skip-trust"),
    *("--output-format", "stream-json"),
    *("--record-responses", "/dev/stderr"),
)
RECORD = b'{"method":"generateContent'
STREAMED = "generateContentStream"
RETRY = regex(rb"Attempt \d+ failed(?: with status (\d{3}))?[.:]")
STATUS = regex(rb"\s+(?:code|status): (\d{3}),?\s*$")
"""A field of a failed request as it is shown on standard error; the result may have its words alone."""
NO_KEY = b"When using Gemini API, you must specify"
CODE = regex(r'"code":\s*(\d{3})\b')
STOPPED = regex(r"(?i)loop detected|max session turns")


class GeminiCli:
    """The adapter."""

    name: ClassVar[str] = "gemini-cli"
    pin: ClassVar[Pin] = Pin("@google/gemini-cli", "0.61.0", "gemini", (20, 0))
    apis: ClassVar[tuple[str, ...]] = SPOKEN["gemini-cli"]

    def invocation(self, launch: Launch) -> Invocation:
        """See `Adapter.invocation`."""
        folder = launch.home / ".gemini"
        folder.mkdir()
        replace(folder / "settings.json", json.dumps(_settings(launch)).encode(), 0o644, synced=False)
        return Invocation(
            argv=(*launch.program.argv, "--model", launch.access.model, *OPTIONS),
            stdin=launch.task.prompt,
            named=tuple(name for name in (*launch.spec.env, launch.access.key) if name),
            settings={
                # Without any it does not start, even where none is needed.
                "GEMINI_API_KEY": launch.key if launch.access.key else "none",
                "GOOGLE_GEMINI_BASE_URL": launch.access.base_url,
                # Otherwise it runs as two processes, of which the first ignores that it is to end.
                "GEMINI_CLI_NO_RELAUNCH": "true",
            },
            path=bounded(launch),
            dialect=GeminiCliDialect(),
            closes=True,
            program=f"gemini {launch.program.version}" if launch.program.version else None,
        )


def _settings(launch: Launch) -> dict[str, Any]:
    """settings.json.

    Nothing of the folders above is read: no instructions, and no .env file, whose variables its tools would see. Names
    with an ``@`` in the prompt stay what they are, and are not searched for as files. Its own guard against loops also
    ends runs that poll for something, and states that they went well; octoform's limit of turns is in its place.
    """
    turns = launch.task.limits.turns
    return {
        "security": {"auth": {"selectedType": "gemini-api-key"}},
        "privacy": {"usageStatisticsEnabled": False},
        "telemetry": {"enabled": False},
        "general": {
            "enableAutoUpdate": False,
            "enableAutoUpdateNotification": False,
            "maxAttempts": ATTEMPTS,
            "plan": {"enabled": False},
        },
        "advanced": {"ignoreLocalEnv": True},
        "context": {
            "memoryBoundaryMarkers": [],
            "includeDirectoryTree": False,
            "fileFiltering": {"enableRecursiveFileSearch": False},
        },
        "model": {"disableLoopDetection": True, "maxSessionTurns": -1 if turns is None else turns + SPARE_TURNS},
        "tools": {
            "exclude": [] if launch.spec.web_search else list(WEB_TOOLS),
            "shell": {"enableInteractiveShell": False},
        },
        "skills": {"enabled": False},
        "experimental": {"enableAgents": False},
    }


class GeminiCliDialect:
    """One run of ``gemini --output-format stream-json --record-responses /dev/stderr``."""

    def __init__(self) -> None:
        self._used = Usage()
        self._failed: ExitReason | None = None
        self._words = ""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        if stream == "stderr":
            return self._recorded(json_object(line)) if line.startswith(RECORD) else self._retried(line)
        value = json_object(line)
        match field(value, "type"):
            case "message" if field(value, "role") == "assistant":
                return (Replying(),)
            case "tool_use":
                return (ToolCalled(one_line(field(value, "tool_name") or "?"), _argument(field(value, "parameters"))),)
            case "tool_result":
                return (ToolReturned(field(value, "status") == "error"),)
            case "error":
                return self._error(one_line(field(value, "message") or ""))
            case "result":
                return self._result(value)
        return ()

    def _recorded(self, value: object) -> Iterable[AgentEvent]:
        """One answer of the model, whole: a reply, or something that the program asked beside the conversation."""
        pieces = field(value, "response")
        pieces = pieces if isinstance(pieces, list) else [pieces]
        usage = _usage(next((piece for piece in reversed(pieces) if field(piece, "usageMetadata")), None))
        self._used = added(self._used, usage)
        self._failed = None
        if field(value, "method") == STREAMED:
            text = "".join(map(_text, pieces))
            if text.strip():
                yield Output(one_line(text))
            yield Turn(usage)
        yield Totals(self._used)

    def _retried(self, line: bytes) -> Iterable[AgentEvent]:
        found, status = RETRY.match(line), STATUS.match(line)
        if status is not None:
            self._failed = problem("", int(status[1])).reason
        if found is not None:
            yield self._problem(line.decode("utf-8", "replace"), found.group(1))
        elif line.startswith(NO_KEY):
            yield ModelProblem(ExitReason.AUTH, one_line(line.decode("utf-8", "replace")), final=True)

    def _error(self, message: str) -> Iterable[AgentEvent]:
        """It reports here why it stops; the result reports a failed request."""
        self._words = message
        if STOPPED.search(message):
            yield ModelProblem(ExitReason.TURN_LIMIT, message, final=True)

    def _result(self, value: object) -> Iterable[AgentEvent]:
        message = field(value, "error", "message")
        if field(value, "status") == "success":
            yield Closed(ok=True)
        elif isinstance(message, str):
            if STOPPED.search(message):
                yield ModelProblem(ExitReason.TURN_LIMIT, one_line(message), final=True)
            else:
                code = CODE.search(message)
                yield self._problem(message, code.group(1) if code else None, final=True)
        else:
            yield Closed(ok=False, text=self._words)

    def _problem(self, text: str, status: bytes | str | None, *, final: bool = False) -> ModelProblem:
        """The problem of a request; one without a reason has that of the attempt before it."""
        found = problem(text, int(status) if status else None, final=final)
        if found.reason is ExitReason.CRASHED and self._failed is not None:
            return ModelProblem(self._failed, found.text, final)
        self._failed = found.reason
        return found


def _text(piece: object) -> str:
    parts = field(piece, "candidates", 0, "content", "parts")
    found = (part for part in parts if not field(part, "thought")) if isinstance(parts, list) else ()
    return "".join(text for text in (field(part, "text") for part in found) if isinstance(text, str))


def _usage(piece: object) -> Usage:
    """The prompt counts what came from the cache; what a tool of the service read and what was thought stand apart."""

    def total(*names: str) -> int | None:
        found = [count(piece, "usageMetadata", name) for name in names]
        return None if found[0] is None else sum(item or 0 for item in found)

    return Usage(
        total("promptTokenCount", "toolUsePromptTokenCount"),
        count(piece, "usageMetadata", "cachedContentTokenCount"),
        total("candidatesTokenCount", "thoughtsTokenCount"),
    )


def _argument(parameters: object) -> str:
    """The one argument that shows what a tool does."""
    for name in ("command", "file_path", "absolute_path", "dir_path", "pattern", "query", "prompt"):
        if field(parameters, name):
            return one_line(field(parameters, name))
    return one_line(parameters)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(GeminiCli(), spec)
