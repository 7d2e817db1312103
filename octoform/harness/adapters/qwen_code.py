"""Harness ``qwen-code``: Qwen Code (@qwen-code/qwen-code), its streamed JSON with the pieces of each reply.

It tries again for minutes without a word of it in the stream. Its debug log reports at once, and that log is a file
whose place is known as soon as the session's id is: here that file is its own standard error. It is started in its bare
mode, in which it reads no instructions of its surroundings and asks its model nothing beside the conversation. Its
guard against loops cannot be switched off: the same call five times over is the end of a run.
"""

import json
import uuid
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from octoform.base.files import replace
from octoform.harness.adapters.program import Launch, ProgramHarness
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
from octoform.manifest.credentials import ANTHROPIC, CHAT, GEMINI, RESPONSES
from octoform.manifest.model import HarnessSpec
from octoform.patterns import regex

SPARE_TURNS = 5
"""octoform counts replies itself; the program's own limit only has to hold where no one reads along."""
OPTIONS = ("--yolo", "--output-format", "stream-json", "--include-partial-messages")
WAYS = {
    CHAT: ("openai", "OPENAI_API_KEY", "OPENAI_BASE_URL"),
    RESPONSES: ("openai-responses", "OPENAI_API_KEY", "OPENAI_BASE_URL"),
    ANTHROPIC: ("anthropic", "ANTHROPIC_API_KEY", "ANTHROPIC_BASE_URL"),
    GEMINI: ("gemini", "GEMINI_API_KEY", "GOOGLE_GEMINI_BASE_URL"),
}
"""How it names an API, and the variables with the key and the URL."""
QUIET = {
    "QWEN_USAGE_STATISTICS_ENABLED": "false",
    "QWEN_TELEMETRY_ENABLED": "false",
    "QWEN_CODE_SUPPRESS_YOLO_WARNING": "1",
    "QWEN_CODE_DISABLE_CRON": "1",
    "QWEN_DEBUG_LOG_FILE": "1",
}
SETTINGS: Mapping[str, Any] = {
    "general": {"enableAutoUpdate": False},
    "memory": dict.fromkeys(("enableManagedAutoMemory", "enableManagedAutoDream", "enableAutoSkill"), False),
}
"""Read only where it is not in its bare mode."""
PIECE = b'{"type":"stream_event"'
STOP = b'"event":{"type":"message_stop"}'
LOGGED = regex(rb"\S+ \[(?:WARN|ERROR)\] \[(RETRY|OPENAI_ERROR)\] (.*)")
STATUS = regex(r"(?:with status|Error:) (\d{3})\b")
API_ERROR = "[API Error: "
STOPPED = regex(r"(?i)loop detection halted|reached max session turns")


class QwenCode:
    """The adapter."""

    name: ClassVar[str] = "qwen-code"
    pin: ClassVar[Pin] = Pin("@qwen-code/qwen-code", "0.24.4", "qwen", (22, 0))
    apis: ClassVar[tuple[str, ...]] = (CHAT, RESPONSES, ANTHROPIC, GEMINI)

    def invocation(self, launch: Launch) -> Invocation:
        """See `Adapter.invocation`."""
        session = str(uuid.uuid4())
        _prepare(launch, session)
        way, key, url = WAYS[launch.access.api]
        turns = launch.task.limits.turns
        return Invocation(
            argv=(
                *launch.program.argv,
                *("--auth-type", way, "--model", launch.access.model, "--session-id", session),
                *OPTIONS,
                # Only outside the bare mode does it have its tool for web pages.
                "--safe-mode" if launch.spec.web_search else "--bare",
                *(("--max-session-turns", str(turns + SPARE_TURNS)) if turns is not None else ()),
            ),
            stdin=launch.task.prompt,
            named=tuple(name for name in (*launch.spec.env, launch.access.key) if name),
            # Without any key it does not start, even where none is needed.
            settings={**QUIET, key: launch.key if launch.access.key else "none", url: launch.access.base_url},
            path=launch.program.path,
            dialect=QwenCodeDialect(),
            closes=True,
            program=f"qwen {launch.program.version}" if launch.program.version else None,
        )


def _prepare(launch: Launch, session: str) -> None:
    """Its settings, the way of its debug log to standard error, and an empty .env.

    It reads the first .env at or above its working directory, whose variables its tools would see; this one is first.
    """
    folder = launch.home / ".qwen"
    (folder / "debug").mkdir(parents=True)
    replace(folder / "settings.json", json.dumps(SETTINGS).encode(), 0o644, synced=False)
    (folder / "debug" / f"{session}.txt").symlink_to("/dev/stderr")
    shield = launch.task.workdir / ".qwen"
    shield.mkdir()
    (shield / ".env").touch()


class QwenCodeDialect:
    """One run of ``qwen --output-format stream-json --include-partial-messages`` with its debug log."""

    def __init__(self) -> None:
        self._reply: Usage | None = None

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        if stream == "stderr":
            return _logged(line)
        if line.startswith(PIECE):
            return self._ended() if STOP in line else (Replying(),)
        value = json_object(line)
        match field(value, "type"):
            case "assistant":
                return self._message(field(value, "message"))
            case "user":
                return _returned(field(value, "message"))
            case "result":
                return _result(value)
        return ()

    def _message(self, message: object) -> Iterable[AgentEvent]:
        """A part of a reply: words and calls come apart, the tokens with the last of them."""
        usage = _usage(field(message, "usage"))
        for part in _parts(message):
            text = field(part, "text")
            if field(part, "type") == "text" and isinstance(text, str):
                if text.startswith(API_ERROR) and not usage.input_tokens:
                    return  # its own words in place of a reply; the result repeats it
                yield Output(one_line(text))
            elif field(part, "type") == "tool_use":
                yield ToolCalled(one_line(field(part, "name") or "?"), _argument(field(part, "input")))
        self._reply = usage if usage.input_tokens else self._reply or Usage()

    def _ended(self) -> Iterable[AgentEvent]:
        """The end of a reply, unless nothing of one came."""
        if self._reply is not None:
            yield Turn(self._reply)
            self._reply = None


def _parts(message: object) -> list[Any]:
    content = field(message, "content")
    return content if isinstance(content, list) else []


def _returned(message: object) -> Iterable[AgentEvent]:
    for part in _parts(message):
        if field(part, "type") == "tool_result":
            yield ToolReturned(field(part, "is_error") is True)


def _logged(line: bytes) -> Iterable[AgentEvent]:
    """A failed request in the debug log; or why it stops, which is then all that it states."""
    found = LOGGED.match(line)
    if found is not None:
        text = found.group(2).decode("utf-8", "replace").removesuffix(" {")
        status = STATUS.search(text)
        if status is None and found.group(1) == b"RETRY":
            yield ModelProblem(ExitReason.UNREACHABLE, one_line(text))
        else:
            yield problem(text, int(status.group(1)) if status else None)
    elif STOPPED.match(line.decode("utf-8", "replace")):
        yield ModelProblem(ExitReason.TURN_LIMIT, one_line(line.decode("utf-8", "replace")), final=True)


def _result(value: object) -> Iterable[AgentEvent]:
    usage = _usage(field(value, "usage"))
    if usage.input_tokens:
        yield Totals(usage)
    if field(value, "is_error") is False:
        yield Closed(ok=True)
        return
    text = str(field(value, "error", "message") or field(value, "subtype") or "")
    if STOPPED.search(text):
        yield ModelProblem(ExitReason.TURN_LIMIT, one_line(text), final=True)
    else:
        yield problem(text, final=True)


def _usage(value: object) -> Usage:
    """The usage of a reply: cached tokens are part of the input; all zeros mean no count."""
    if not count(value, "input_tokens"):
        return Usage()
    return Usage(count(value, "input_tokens"), count(value, "cache_read_input_tokens"), count(value, "output_tokens"))


def _argument(arguments: object) -> str:
    """The one argument that shows what a tool does."""
    for name in ("command", "file_path", "path", "pattern", "query", "url"):
        if field(arguments, name):
            return one_line(field(arguments, name))
    return one_line(arguments)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(QwenCode(), spec)
