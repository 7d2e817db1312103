"""Harness ``pi``: the pi coding agent (@earendil-works/pi-coding-agent), its JSON mode.

It leaves with status 0 whatever happened, so only its stream is read: an assistant message that ends with
``stopReason: error`` is what the model's side failed with, and it tries again by itself a few times.
"""

import json
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from octoform.base.files import replace
from octoform.harness.adapters.program import Launch, ProgramHarness, command_seconds
from octoform.harness.contained_attempt import Invocation
from octoform.harness.event_parser import count, field, json_object, one_line, problem
from octoform.harness.llm.route import Access
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Replying,
    ToolCalled,
    ToolReturned,
    Turn,
    Usage,
)
from octoform.harness.program_location import Pin
from octoform.manifest.credentials import ANTHROPIC, CHAT, GEMINI, RESPONSES
from octoform.manifest.model import HarnessSpec

CONTEXT_TOKENS = 128_000
OUTPUT_TOKENS = 16_000
RETRIES = 4
"""With its pauses of 2, 4, 8 and 16 seconds as long as the usual patience of a task."""
PROVIDER = "octoform"
PIECES = (b'{"type":"message_update"', b'{"type":"tool_execution_update"')
"""Most of the stream: each piece of a reply or of what a tool prints, of which the end has all that is needed."""
NO_KEY = b"No API key"
NAMES = {CHAT: CHAT, RESPONSES: RESPONSES, ANTHROPIC: ANTHROPIC, GEMINI: "google-generative-ai"}


class Pi:
    """The adapter."""

    name: ClassVar[str] = "pi"
    pin: ClassVar[Pin] = Pin("@earendil-works/pi-coding-agent", "0.87.1", "pi", (22, 19))
    apis: ClassVar[tuple[str, ...]] = (CHAT, RESPONSES, ANTHROPIC, GEMINI)

    def invocation(self, launch: Launch) -> Invocation:
        """See `Adapter.invocation`."""
        agent = launch.home / ".pi" / "agent"
        agent.mkdir(parents=True)
        replace(agent / "models.json", json.dumps(_models(launch.access)).encode(), 0o644, synced=False)
        shell = agent / "shell"
        replace(shell, _shell(launch).encode(), 0o644, synced=False)
        shell.chmod(0o700)
        settings = {"retry": {"maxRetries": RETRIES}, "shellPath": str(shell)}
        replace(agent / "settings.json", json.dumps(settings).encode(), 0o644, synced=False)
        model = f"{PROVIDER}/{launch.access.model}"
        options = ("--offline", "--no-extensions", "--no-skills", "--no-prompt-templates", "--no-context-files")
        return Invocation(
            argv=(*launch.program.argv, "-p", "--mode", "json", "--no-session", "--model", model, *options),
            stdin=launch.task.prompt,
            named=tuple(name for name in (*launch.spec.env, launch.access.key) if name),
            settings={"PI_OFFLINE": "1", "PI_TELEMETRY": "0"},
            path=launch.program.path,
            dialect=PiDialect(),
            program=f"pi {launch.program.version}" if launch.program.version else None,
        )


def _shell(launch: Launch) -> str:
    """The shell that it runs commands with, as a script of one.

    A command without an end would be a run without a sign of progress: it has to end before, so that the agent hears
    of it. And it does not get the key, unless the manifest shows it the agent.
    """
    key, idle = launch.access.key, launch.task.limits.idle_seconds
    path = launch.task.environment.get("PATH")
    lines = ["#!/bin/sh"]
    if key and key not in launch.spec.env:
        lines.append(f"unset {key}")
    bound = f"timeout --kill-after=2 {command_seconds(idle):g} " if idle and shutil.which("timeout", path=path) else ""
    lines.append(f'exec {bound}{"bash" if shutil.which("bash", path=path) else "sh"} "$@"')
    return "\n".join(lines) + "\n"


def _models(access: Access) -> dict[str, Any]:
    """pi's models.json with the one provider that is used; the key is the name of a variable, never its value."""
    model = {"id": access.model, "input": ["text"], "contextWindow": CONTEXT_TOKENS, "maxTokens": OUTPUT_TOKENS}
    base_url = f"{access.base_url}/v1beta" if access.api == GEMINI else access.base_url
    key = f"${access.key}" if access.key else "none"
    provider = {"baseUrl": base_url, "api": NAMES[access.api], "apiKey": key, "models": [model]}
    return {"providers": {PROVIDER: provider}}


class PiDialect:
    """One run of ``pi --mode json``."""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        if stream != "stdout":
            if line.startswith(NO_KEY):
                yield ModelProblem(ExitReason.AUTH, one_line(line.decode("utf-8", "replace")), final=True)
            return
        if line.startswith(PIECES):
            yield Replying()
            return
        value = json_object(line)
        kind = field(value, "type")
        if kind == "message_end" and field(value, "message", "role") == "assistant":
            yield from _reply(field(value, "message"))
        elif kind == "tool_execution_start":
            yield ToolCalled(one_line(field(value, "toolName") or "?"), _argument(field(value, "args")))
        elif kind == "tool_execution_end":
            yield ToolReturned(field(value, "isError") is True)
        elif kind == "agent_settled":
            yield Closed(ok=True)


def _reply(message: Mapping[str, Any]) -> Iterable[AgentEvent]:
    if field(message, "stopReason") == "error":
        yield problem(str(field(message, "errorMessage") or "the request failed"))
        return
    for part in field(message, "content") or ():
        if field(part, "type") == "text" and field(part, "text"):
            yield Output(one_line(field(part, "text")))
    # Fresh and cached input are counted apart.
    parts = [count(message, "usage", name) for name in ("input", "cacheRead", "cacheWrite")]
    fresh = parts[0]
    total = None if fresh is None else sum(item or 0 for item in parts)
    yield Turn(Usage(total, parts[1], count(message, "usage", "output")))


def _argument(args: object) -> str:
    """The one argument that shows what a tool does."""
    for name in ("command", "path", "pattern", "query"):
        if field(args, name):
            return one_line(field(args, name))
    return one_line(args)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(Pi(), spec)
