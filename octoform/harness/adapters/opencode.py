"""Harness ``opencode``: the opencode coding agent (opencode-ai), its JSON output and what a plugin of ours adds to it.

Its own output has a part only when it is whole, and nothing at all of a request that failed and is tried again, which
it does permanently. The plugin, which lies in the private home folder, reports these on standard error.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from octoform.base.files import replace
from octoform.harness.adapters.program import Launch, ProgramHarness, bounded, command_seconds
from octoform.harness.contained_attempt import Invocation
from octoform.harness.event_parser import count, field, json_object, one_line, problem
from octoform.harness.llm.route import Access
from octoform.harness.port import (
    AgentEvent,
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
PROVIDER = "octoform"
PLUGIN = Path(__file__).with_name("opencode_watch.js")
CLIENTS = {
    CHAT: ("@ai-sdk/openai-compatible", ""),
    RESPONSES: ("@ai-sdk/openai", ""),
    ANTHROPIC: ("@ai-sdk/anthropic", "/v1"),
    GEMINI: ("@ai-sdk/google", "/v1beta"),
}
"""The client library for each API, all of them part of the program, and what it wants at the end of a base URL."""
OFF = (
    "AUTOUPDATE",
    "CLAUDE_CODE",
    "DEFAULT_PLUGINS",
    "EXTERNAL_SKILLS",
    "LSP_DOWNLOAD",
    "MODELS_FETCH",
    "PROJECT_CONFIG",
    "SHARE",
)
WEB = ("webfetch", "websearch")
OTHERS = ("task", "skill")
"""Tools that it never has: the actions of a subagent are not reported, and there are no skills."""
INVALID = "invalid"
"""Its tool for a call of no tool, or with arguments that cannot be read."""
WITHHELD, COMMAND_MS = "OPENCODE_WATCH_WITHHELD", "OPENCODE_WATCH_COMMAND_MS"
NPM = "registry=http://127.0.0.1:9/\nfetch-retries=0\n"
"""It looks a package of its own up in the registry of npm whenever it starts; here that fails at once."""


class OpenCode:
    """The adapter."""

    name: ClassVar[str] = "opencode"
    pin: ClassVar[Pin] = Pin("opencode-ai", "1.18.33", "opencode", None, scripts=True)
    apis: ClassVar[tuple[str, ...]] = (CHAT, RESPONSES, ANTHROPIC, GEMINI)

    def invocation(self, launch: Launch) -> Invocation:
        """See `Adapter.invocation`."""
        settings = launch.home / ".config" / "opencode"
        (settings / "plugin").mkdir(parents=True)
        replace(settings / "plugin" / PLUGIN.name, PLUGIN.read_bytes(), 0o644, synced=False)
        replace(settings / ".npmrc", NPM.encode(), 0o644, synced=False)
        model = f"{PROVIDER}/{launch.access.model}"
        web = launch.spec.web_search
        config = json.dumps(_config(launch.access, model, web))
        replace(settings / "opencode.json", config.encode(), 0o644, synced=False)
        return Invocation(
            argv=(*launch.program.argv, "run", "--format", "json", "--model", model, "--auto", "--title", "octoform"),
            stdin=launch.task.prompt,
            named=tuple(name for name in (*launch.spec.env, launch.access.key) if name),
            settings=_settings(launch),
            path=bounded(launch),
            dialect=OpenCodeDialect(),
            program=f"opencode {launch.program.version}" if launch.program.version else None,
        )


def _settings(launch: Launch) -> dict[str, str]:
    """Its variables and those of the plugin.

    That takes the key away again, once it is read, unless the manifest shows it the agent; and no command may run for
    so long that the run would seem to stand still.
    """
    key, idle = launch.access.key, launch.task.limits.idle_seconds
    folders = {"CONFIG": ".config", "DATA": ".local/share", "STATE": ".local/state", "CACHE": ".cache"}
    return {
        **{f"OPENCODE_DISABLE_{name}": "1" for name in OFF},
        **{f"XDG_{name}_HOME": str(launch.home / folder) for name, folder in folders.items()},
        "OPENCODE_EXPERIMENTAL_DISABLE_FILEWATCHER": "1",
        **({"OPENCODE_ENABLE_EXA": "1"} if launch.spec.web_search else {}),
        **({WITHHELD: key} if key and key not in launch.spec.env else {}),
        **({COMMAND_MS: str(int(command_seconds(idle) * 1000))} if idle else {}),
    }


def _config(access: Access, model: str, web: bool) -> dict[str, Any]:
    """Its opencode.json with the one provider that is used; the key is the name of a variable, never its value."""
    package, suffix = CLIENTS[access.api]
    provider = {
        "npm": package,
        "options": {
            "baseURL": f"{access.base_url}{suffix}",
            "apiKey": f"{{env:{access.key}}}" if access.key else "none",
        },
        "models": {access.model: {"limit": {"context": CONTEXT_TOKENS, "output": OUTPUT_TOKENS}}},
    }
    return {
        "provider": {PROVIDER: provider},
        "model": model,
        "small_model": model,
        "permission": {"*": "allow", **dict.fromkeys(OTHERS if web else (*OTHERS, *WEB), "deny")},
        # It would copy the whole of a surrounding repository before each step.
        "snapshot": False,
        "autoupdate": False,
        "share": "disabled",
    }


class OpenCodeDialect:
    """One run of ``opencode run --format json`` with the plugin."""

    def __init__(self) -> None:
        self._called: set[object] = set()
        self._failed = False

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        value = json_object(line)
        if value is None:
            return
        if stream == "stderr":
            yield from self._watched(value)
            return
        part = field(value, "part")
        kind = field(value, "type")
        if kind == "tool_use":
            yield from self._call(field(part, "callID"), field(part, "tool"), field(part, "state", "input"))
            yield ToolReturned(field(part, "state", "status") == "error" or field(part, "tool") == INVALID)
        elif kind == "text" and field(part, "text"):
            yield Output(one_line(field(part, "text")))
        elif kind == "step_finish":
            yield Turn(_usage(field(part, "tokens")))
        elif kind == "error":
            self._failed = True
            yield _error(field(value, "error"))

    def _watched(self, value: Mapping[str, Any]) -> Iterable[AgentEvent]:
        """The events that the plugin reported."""
        kind = value.get("octoform")
        if kind == "piece":
            yield Replying()
        elif kind == "tool":
            yield from self._call(value.get("id"), value.get("tool"), value.get("input"))
        elif kind == "retry" and not self._failed:
            found = problem(str(value.get("text") or "the request failed"), count(value, "status"))
            # It tries again only what may be a passing fault.
            passing = found.reason is ExitReason.CRASHED
            yield ModelProblem(ExitReason.UNREACHABLE, found.text) if passing else found

    def _call(self, call: object, tool: object, given: object) -> Iterable[AgentEvent]:
        """One call, which both the plugin and the program itself report."""
        if call not in self._called:
            self._called.add(call)
            yield ToolCalled(one_line(tool or "?"), _argument(given))


def _error(error: object) -> ModelProblem:
    """After an error it ends."""
    text = field(error, "data", "message") or field(error, "name") or "the request failed"
    return problem(str(text), count(error, "data", "statusCode"), final=True)


def _usage(tokens: object) -> Usage:
    """Input from a cache and output that is reasoning are counted apart."""
    parts = (count(tokens, "input"), count(tokens, "cache", "read"), count(tokens, "cache", "write"))
    fresh, cached, _ = parts
    found = count(tokens, "output")
    return Usage(
        None if fresh is None else sum(item or 0 for item in parts),
        cached,
        None if found is None else found + (count(tokens, "reasoning") or 0),
    )


def _argument(given: object) -> str:
    """The one argument that shows what a tool does."""
    for name in ("command", "filePath", "pattern", "query", "url", "error"):
        if field(given, name):
            return one_line(field(given, name))
    return one_line(given)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ProgramHarness:
    """The harness."""
    return ProgramHarness(OpenCode(), spec)
