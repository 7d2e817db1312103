"""Harness ``claude-code``: Claude Code (@anthropic-ai/claude-code), its streamed JSON.

Asked for, it prints the pieces of each reply too. They show that a long reply has not stalled, and only they hold what
a reply cost: the message itself is printed once for each of its parts, with the count of tokens that it began with. A
request that failed for good is a ``result`` of subtype ``success`` with ``is_error``.
"""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from octoform.base import files
from octoform.harness.adapters.program import Launch, ProgramHarness, command_seconds
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
from octoform.manifest.credentials import SPOKEN
from octoform.manifest.model import HarnessSpec
from octoform.records import replace

RETRIES = 4
SPARE_TURNS = 5
"""octoform counts replies itself; the program's own limit only has to hold where no one reads along."""
TOOLS = ("Bash", "Read", "Write", "Edit", "Glob", "Grep")
WEB_TOOLS = ("WebSearch", "WebFetch")
OPTIONS = (
    "-p",
    *("--output-format", "stream-json", "--include-partial-messages", "--verbose"),
    *("--no-session-persistence", "--dangerously-skip-permissions", "--disable-slash-commands"),
    *("--strict-mcp-config", "--setting-sources", ""),
)
SWITCHES = (
    "CLAUDE_CODE_DISABLE_NONESSENTIAL_TRAFFIC",
    "DISABLE_AUTOUPDATER",
    "DISABLE_TELEMETRY",
    "DISABLE_ERROR_REPORTING",
    # It would wait for what it has moved there long after its last word; a shell can start things all the same.
    "CLAUDE_CODE_DISABLE_BACKGROUND_TASKS",
)
SHELL = "octoform-shell"
COMMAND_LIMITS = ("BASH_DEFAULT_TIMEOUT_MS", "BASH_MAX_TIMEOUT_MS")
BEARER, KEY = "ANTHROPIC_AUTH_TOKEN", "ANTHROPIC_API_KEY"
LOGIN = "CLAUDE_CODE_OAUTH_TOKEN"
"""The token of a subscription, of a login or of `claude setup-token`."""
PIECE = b'{"type":"stream_event","event":{"type":"content_block_'
"""Most of the stream: what a reply is made of, which states nothing that its message does not say again."""
INPUT = ("input_tokens", "cache_read_input_tokens", "cache_creation_input_tokens")
COUNTS = (*INPUT, "output_tokens")
IN_TOTALS = {
    "input_tokens": "inputTokens",
    "cache_read_input_tokens": "cacheReadInputTokens",
    "cache_creation_input_tokens": "cacheCreationInputTokens",
    "output_tokens": "outputTokens",
}


class ClaudeCode:
    """The adapter."""

    name: ClassVar[str] = "claude-code"
    pin: ClassVar[Pin] = Pin("@anthropic-ai/claude-code", "2.1.330", "claude", None, scripts=True)
    apis: ClassVar[tuple[str, ...]] = SPOKEN["claude-code"]

    def invocation(self, launch: Launch) -> Invocation:
        """See `Adapter.invocation`."""
        tools = (*TOOLS, *WEB_TOOLS) if launch.spec.web_search else TOOLS
        turns = launch.task.limits.turns
        bound = ("--max-turns", str(turns + SPARE_TURNS)) if turns is not None else ()
        shells = launch.home / "shells"
        shells.mkdir()
        files.replace(shells / SHELL, _shell(launch).encode(), 0o644, synced=False)
        (shells / SHELL).chmod(0o700)
        return Invocation(
            argv=(
                *launch.program.argv,
                *OPTIONS,
                *("--tools", ",".join(tools)),
                *("--model", launch.access.model),
                *bound,
            ),
            stdin=launch.task.prompt,
            named=tuple(name for name in (*launch.spec.env, launch.access.key) if name),
            settings=_settings(launch),
            path=(str(shells), *launch.program.path),
            dialect=ClaudeCodeDialect(),
            program=f"claude {launch.program.version}" if launch.program.version else None,
        )


def _shell(launch: Launch) -> str:
    """The shell of each command: one that does not get the key, unless the manifest shows it the agent."""
    keys = {KEY, BEARER, LOGIN, launch.access.key or KEY} - set(launch.spec.env)
    return f'#!/bin/sh\nunset {" ".join(sorted(keys))}\nexec bash -c "$1"\n'


def _settings(launch: Launch) -> dict[str, str]:
    """The variables of its own. Only its maker's own service takes the key as such, everybody else as a bearer."""
    native = launch.access.provider == "anthropic"
    settings = {
        **dict.fromkeys(SWITCHES, "1"),
        "ANTHROPIC_BASE_URL": launch.access.base_url,
        # What it uses a smaller model for, the same one does: another may not be there, and has another price.
        "ANTHROPIC_DEFAULT_HAIKU_MODEL": launch.access.model,
        "CLAUDE_CODE_MAX_RETRIES": str(RETRIES),
        "CLAUDE_CONFIG_DIR": str(launch.home / ".claude"),
        # A name to be found on PATH: in a path it would take words for arguments.
        "CLAUDE_CODE_SHELL_PREFIX": SHELL,
        # Empty and not omitted, so that no other key of the caller's is taken for it.
        KEY: launch.key if native else "",
        BEARER: "" if native else launch.key,
        LOGIN: "",
    }
    if launch.access.key == LOGIN:
        settings |= {KEY: "", LOGIN: launch.key}
    if launch.access.key is None:
        settings[BEARER] = "none"
    idle = launch.task.limits.idle_seconds
    if idle is not None:
        # While a command runs there is no sign of progress, so the agent has to hear of a slow one before the limit.
        settings |= dict.fromkeys(COMMAND_LIMITS, str(int(command_seconds(idle) * 1000)))
    if os.geteuid() == 0:
        # It refuses to run without questions as root anywhere else.
        settings["IS_SANDBOX"] = "1"
    return settings


class ClaudeCodeDialect:
    """One run of ``claude -p --output-format stream-json --include-partial-messages``."""

    def __init__(self) -> None:
        self._counted: set[str] = set()
        self._reply: dict[str, int] = {}
        self._whole = False

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        if stream != "stdout":
            return ()
        if line.startswith(PIECE):
            return (Replying(),)
        value = json_object(line)
        match field(value, "type"):
            case "stream_event":
                return self._streamed(field(value, "event"))
            case "assistant":
                return self._message(field(value, "message"))
            case "user":
                return _returned(field(value, "message"))
            case "system" if field(value, "subtype") == "api_retry":
                return (_retry(value),)
            case "result":
                return _result(value)
        return ()

    def _streamed(self, event: object) -> Iterable[AgentEvent]:
        """The frame of a reply: its start and its end each report a part of the tokens, whichever the service knows."""
        match field(event, "type"):
            case "message_start":
                self._counted.add(str(field(event, "message", "id")))
                self._reply, self._whole = {}, False
                self._add(field(event, "message", "usage"))
            case "message_delta":
                self._whole = True
                self._add(field(event, "usage"))
            case "message_stop" if self._whole:
                self._whole = False
                yield Turn(_usage(self._reply))
                return
        yield Replying()

    def _add(self, usage: object) -> None:
        for name in COUNTS:
            found = count(usage, name)
            if found is not None:
                self._reply[name] = max(found, self._reply.get(name, 0))

    def _message(self, message: object) -> Iterable[AgentEvent]:
        """One part of a reply; what the program itself states in place of a model is repeated by the result."""
        if field(message, "model") == "<synthetic>":
            return
        for part in _parts(message):
            if field(part, "type") == "text" and field(part, "text"):
                yield Output(one_line(field(part, "text")))
            elif field(part, "type") == "tool_use":
                yield ToolCalled(one_line(field(part, "name") or "?"), _argument(field(part, "input")))
        identity = field(message, "id")
        if isinstance(identity, str) and identity not in self._counted:
            # A reply that came in one piece.
            self._counted.add(identity)
            yield Turn(_usage(field(message, "usage")))


def _parts(message: object) -> list[Any]:
    content = field(message, "content")
    return content if isinstance(content, list) else []


def _returned(message: object) -> Iterable[AgentEvent]:
    for part in _parts(message):
        if field(part, "type") == "tool_result":
            yield ToolReturned(field(part, "is_error") is True)


def _retry(value: object) -> ModelProblem:
    """Without a status there was no answer at all."""
    status = count(value, "error_status")
    if status is None:
        return ModelProblem(ExitReason.UNREACHABLE, "the request to the model came to nothing")
    return problem(f"{field(value, 'error')}: HTTP status {status}", status)


def _result(value: object) -> Iterable[AgentEvent]:
    yield from _totals(field(value, "modelUsage"))
    subtype = field(value, "subtype")
    text = one_line(field(value, "result") or field(value, "errors") or subtype or "")
    if subtype == "error_max_turns":
        yield ModelProblem(ExitReason.TURN_LIMIT, "the program's own limit of turns was reached", final=True)
    elif field(value, "is_error") is False:
        yield Closed(ok=True, text=text)
    elif field(value, "api_error") == "connection_failed":
        yield ModelProblem(ExitReason.UNREACHABLE, text, final=True)
    elif "/login" in text:
        yield ModelProblem(ExitReason.AUTH, text, final=True)
    else:
        yield problem(text, count(value, "api_error_status"), final=True)


def _totals(models: object) -> Iterable[Totals]:
    """The usage of the whole run, by model; ``usage`` beside it is only that since the last result."""
    if not isinstance(models, dict) or not models:
        return
    counts = dict.fromkeys(COUNTS, 0)
    for used in models.values():
        for name in COUNTS:
            counts[name] += count(used, IN_TOTALS[name]) or 0
    cost = _cost(list(models.values()))
    yield Totals(replace(_usage(counts), cost_usd=cost, cost_source=None if cost is None else ClaudeCode.name))


def _cost(models: Sequence[object]) -> float | None:
    """Dollars at the maker's list prices; None where it does not know a model, whose price it then invents."""
    if any(field(used, "costBasis") != "list" for used in models):
        return None
    costs = [field(used, "costUSD") for used in models]
    numbers = [cost for cost in costs if isinstance(cost, int | float) and not isinstance(cost, bool)]
    known = len(numbers) == len(costs) and all(0 <= cost < 1e9 for cost in numbers)
    return math.fsum(numbers) if known else None


def _usage(value: object) -> Usage:
    """Fresh input, input read from the cache and input written to it are counted apart."""
    parts = [count(value, name) for name in INPUT]
    total = None if parts[0] is None else sum(part or 0 for part in parts)
    return Usage(total, parts[1], count(value, "output_tokens"))


def _argument(arguments: object) -> str:
    """The one argument that shows what a tool does."""
    for name in ("command", "file_path", "pattern", "query", "url"):
        if field(arguments, name):
            return one_line(field(arguments, name))
    return one_line(arguments)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(ClaudeCode(), spec)
