"""Harness ``codex``: the Codex CLI (@openai/codex), its ``exec`` command with JSON events.

Its events report neither when the model has replied nor what a single reply cost, and nothing at all while a long one
comes in. Its own trace on standard error does, so that is switched on for these lines alone; a version without them
keeps the limits of time only. Requests that failed and will be tried again are read there too: what is printed on the
other stream has no order with the replies.
"""

import json
import shlex
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
from octoform.manifest.credentials import SPOKEN
from octoform.manifest.model import HarnessSpec
from octoform.patterns import regex

REQUEST_RETRIES = 2
STREAM_RETRIES = 5
PROVIDER = "octoform"
ACCOUNT = "CODEX_ACCOUNT_ID"
"""The variable with the account of a subscription; not needed with a key."""
TRACE = "RUST_LOG"
TRACED = "error,codex_otel.log_only[{event.kind}]=info,codex_otel.log_only[{error.message}]=info"
OFF = (
    # What looks things up over the network.
    *("apps", "plugins", "remote_plugin"),
    # It would wait for a network without end instead of giving up.
    "unbounded_connection_retries",
    *("goals", "image_generation", "shell_snapshot", "tool_suggest"),
)
OPTIONS = (
    *("exec", "--json", "--ephemeral", "--skip-git-repo-check"),
    "--dangerously-bypass-approvals-and-sandbox",
)
PIECE = regex(
    rb"\S+ +INFO codex_otel\S*: event\.name=\"codex\.sse_event\" event\.kind=(\S+) (?:duration_ms="
    rb"|input_token_count=(\d{1,15}) output_token_count=(\d{1,15})(?: cached_token_count=(\d{1,15}))?)"
)
FAILED = regex(
    rb"\S+ +INFO codex_otel\S*: event\.name=\"codex\.(?:sse_event|api_request)\" .*?(?:status_code=(\d{3}) )?"
    rb"error\.message=(.*?) (?:event\.timestamp=|attempt=\d+ .*endpoint=\"/responses)"
)
COMPLETED = b"response.completed"
TOOLS = ("command_execution", "file_change", "mcp_tool_call", "web_search")
STATUS = regex(r"\bstatus:? (\d{3})\b")
SIGNS = (
    (ExitReason.AUTH, regex(r"(?i)missing environment variable")),
    (ExitReason.RATE_LIMIT, regex(r"(?i)usage limit")),
    (ExitReason.UNREACHABLE, regex(r"(?i)high demand|at capacity")),
)
"""Messages without a status that only this program has."""


class Codex:
    """The adapter."""

    name: ClassVar[str] = "codex"
    pin: ClassVar[Pin] = Pin("@openai/codex", "0.169.0", "codex", (16, 0))
    apis: ClassVar[tuple[str, ...]] = SPOKEN["codex"]

    def invocation(self, launch: Launch) -> Invocation:
        """See `Adapter.invocation`."""
        home = launch.home / ".codex"
        home.mkdir()
        replace(home / "config.toml", _config(launch).encode(), 0o644, synced=False)
        return Invocation(
            argv=(*launch.program.argv, *OPTIONS, "-C", str(launch.task.workdir), "-"),
            stdin=launch.task.prompt,
            named=tuple(name for name in (*launch.spec.env, launch.access.key, _account(launch)) if name),
            settings={"CODEX_HOME": str(home), TRACE: TRACED, "NO_COLOR": "1"},
            path=launch.program.path,
            dialect=CodexDialect(),
            program=f"codex {launch.program.version}" if launch.program.version else None,
        )


def _config(launch: Launch) -> str:
    """config.toml with the one provider that is used; the key is the name of a variable, never its value.

    What the agent runs gets the agent's own environment (no login shell, which would set another PATH) without the
    key, unless the manifest names it among the variables that the agent may see.
    """
    access = launch.access
    hidden = [TRACE] if access.key is None or access.key in launch.spec.env else [TRACE, access.key]
    key = [f"env_key = {_text(access.key)}"] if access.key else []
    if account := _account(launch):
        key.append(f"env_http_headers = {{ chatgpt-account-id = {_text(account)} }}")
    lines = [
        f"model = {_text(access.model)}",
        f"model_provider = {_text(PROVIDER)}",
        f"web_search = {_text('live' if launch.spec.web_search else 'disabled')}",
        "check_for_update_on_startup = false",
        "project_doc_max_bytes = 0",
        "allow_login_shell = false",
        "[analytics]",
        "enabled = false",
        "[agents]",
        "enabled = false",
        "[features]",
        *(f"{name} = false" for name in OFF),
        "[shell_environment_policy]",
        f"exclude = [{', '.join(map(_text, hidden))}]",
        f"[model_providers.{PROVIDER}]",
        f"name = {_text(PROVIDER)}",
        f"base_url = {_text(access.base_url)}",
        *key,
        'wire_api = "responses"',
        f"request_max_retries = {REQUEST_RETRIES}",
        f"stream_max_retries = {STREAM_RETRIES}",
    ]
    return "\n".join((*lines, ""))


def _account(launch: Launch) -> str | None:
    """The variable with the account of a login, if it shows one."""
    return ACCOUNT if launch.spec.login and ACCOUNT in launch.task.environment else None


def _text(value: str) -> str:
    """A TOML string: JSON's are, but for one character."""
    return json.dumps(value).replace("\x7f", "\\u007f")


class CodexDialect:
    """One run of ``codex exec --json``."""

    def __init__(self) -> None:
        self._owed = False
        self._tracing = False
        self._over = False
        self._started: set[str] = set()

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        if stream == "stderr":
            return () if self._over else self._traced(line)
        value = json_object(line)
        match field(value, "type"):
            case "item.started":
                return self._started_item(field(value, "item"))
            case "item.completed":
                return self._completed_item(field(value, "item"))
            case "turn.completed":
                return (Totals(_usage(field(value, "usage"))), Closed(ok=True))
            case "turn.failed":
                self._over = True
                return (_problem(field(value, "error", "message"), final=True),)
            case "error":
                found = _problem(field(value, "message"))
                return (found,) if found.final or not self._tracing else ()
        return ()

    def _traced(self, line: bytes) -> Iterable[AgentEvent]:
        """A reply's end is reported twice, the second time with its tokens, if the service reports them."""
        failed = FAILED.match(line)
        if failed is not None:
            self._tracing = True
            yield _failed(failed[1], failed[2].decode("utf-8", "replace").strip('"'))
        found = PIECE.match(line)
        if failed is not None or found is None:
            return
        self._tracing = True
        kind, taken, given, cached = found.groups()
        if kind == COMPLETED and taken is not None:
            self._owed = False
            yield Turn(Usage(int(taken), None if cached is None else int(cached), int(given)))
            return
        if self._owed:
            yield Turn()
        self._owed = kind == COMPLETED
        yield Replying()

    def _started_item(self, item: object) -> Iterable[AgentEvent]:
        if field(item, "type") in TOOLS:
            self._started.add(str(field(item, "id")))
            yield ToolCalled(*_tool(item))

    def _completed_item(self, item: object) -> Iterable[AgentEvent]:
        """Items of type ``error`` are notes, such as on a model that it does not know."""
        kind = field(item, "type")
        if kind == "agent_message":
            yield Output(one_line(field(item, "text") or ""))
        elif kind in TOOLS:
            if str(field(item, "id")) not in self._started:
                yield ToolCalled(*_tool(item))
            self._started.discard(str(field(item, "id")))
            yield ToolReturned(field(item, "status") in ("failed", "declined"))


def _tool(item: object) -> tuple[str, str]:
    """The tool and what it is used for."""
    match field(item, "type"):
        case "command_execution":
            return "shell", one_line(_command(str(field(item, "command") or "")))
        case "file_change":
            changes = field(item, "changes")
            paths = [str(field(change, "path")) for change in changes] if isinstance(changes, list) else []
            return "edit", one_line(", ".join(paths))
        case "mcp_tool_call":
            return one_line(field(item, "tool") or "?"), one_line(field(item, "arguments"))
    return "web_search", one_line(field(item, "query") or "")


def _command(text: str) -> str:
    """The command itself, out of the shell that it is given to."""
    try:
        words = shlex.split(text)
    except ValueError:
        return text
    return words[2] if len(words) == 3 and words[1] in ("-c", "-lc") else text


def _failed(status: bytes | None, message: str) -> ModelProblem:
    """A request that may be tried again; without a status there was no answer, or it broke off."""
    if status is not None:
        message = f"HTTP status {status.decode()}"
    reason = problem(message).reason
    if status is None and reason is ExitReason.CRASHED:
        reason = ExitReason.UNREACHABLE
    return ModelProblem(reason, one_line(message))


def _problem(message: Any, *, final: bool = False) -> ModelProblem:
    text = str(message or "the request failed")
    status = STATUS.search(text)
    if status is None:
        for reason, sign in SIGNS:
            if sign.search(text):
                return ModelProblem(reason, one_line(text), final)
    return problem(text, int(status[1]) if status else None, final=final)


def _usage(value: object) -> Usage:
    """Cached input is counted among the input."""
    return Usage(count(value, "input_tokens"), count(value, "cached_input_tokens"), count(value, "output_tokens"))


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(Codex(), spec)
