"""Harness ``pi``: the pi coding agent (@earendil-works/pi-coding-agent), its JSON mode.

It leaves with status 0 whatever happened, so only its stream is read: an assistant message that ends with
``stopReason: error`` is what the model's side failed with, and it tries again by itself a few times.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from octoform.harness.access import Access
from octoform.harness.adapters.program import Launch, ProgramHarness
from octoform.harness.attempt import Invocation
from octoform.harness.dialect import count, field, json_object, one_line, trouble
from octoform.harness.installed import Pin
from octoform.harness.port import AgentEvent, Closed, Replying, Said, ToolCalled, ToolReturned, Turn, Usage
from octoform.manifest.model import HarnessSpec
from octoform.manifest.providers import ANTHROPIC, CHAT, GEMINI, RESPONSES

CONTEXT_TOKENS = 128_000
OUTPUT_TOKENS = 16_000
RETRIES = 2
PROVIDER = "octoform"
UPDATE = b'{"type":"message_update"'
"""Most of the stream: each piece of a reply, which says nothing that its end does not say again."""
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
        (agent / "models.json").write_text(json.dumps(_models(launch.access)), encoding="utf-8")
        (agent / "settings.json").write_text(json.dumps(_settings(launch)), encoding="utf-8")
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


def _settings(launch: Launch) -> dict[str, Any]:
    """pi's settings.json; what it runs for the model does not get the key, unless the manifest shows it the agent."""
    key = launch.access.key
    withheld = {"shellCommandPrefix": f"unset {key}"} if key and key not in launch.spec.env else {}
    return {"retry": {"maxRetries": RETRIES}, **withheld}


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
            return
        if line.startswith(UPDATE):
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
        yield trouble(str(field(message, "errorMessage") or "the request failed"))
        return
    for part in field(message, "content") or ():
        if field(part, "type") == "text" and field(part, "text"):
            yield Said(one_line(field(part, "text")))
    # Fresh and cached input are counted apart.
    parts = [count(message, "usage", name) for name in ("input", "cacheRead", "cacheWrite")]
    fresh = parts[0]
    total = None if fresh is None else sum(item or 0 for item in parts)
    yield Turn(Usage(total, parts[1], count(message, "usage", "output")))


def _argument(args: object) -> str:
    """The one argument that tells what a tool does."""
    for name in ("command", "path", "pattern", "query"):
        if field(args, name):
            return one_line(field(args, name))
    return one_line(args)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(Pi(), spec)
