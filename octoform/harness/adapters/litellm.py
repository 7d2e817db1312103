"""Harness ``litellm``: octoform's own small agent (`octoform.harness.react`), for any model that litellm can ask.

It needs no program, only the Python package litellm in octoform's own environment. It runs as a process below the
same containment as every program, and nothing of it is believed more.
"""

import sys
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.containment.agent_environment import is_secret
from octoform.harness.event_parser import count, field, json_object, one_line
from octoform.harness.event_parser import problem as model_problem
from octoform.harness.llm.client import BACKOFF_SECONDS, SETTINGS
from octoform.harness.llm.route import Route, route, unusable
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    Outcome,
    Output,
    ProgressSink,
    Replying,
    Task,
    ToolCalled,
    ToolReturned,
    Turn,
    Usage,
)
from octoform.harness.react.config import Config
from octoform.manifest.model import HarnessSpec
from octoform.records import dataclass

MODULE = "octoform.harness.react"
FILE_NAME = "litellm.json"
MISSING = "the Python package litellm is not installed; `octoform install litellm` puts it beside octoform"
SHELL_SECONDS = 60
MAX_SILENCE = 600.0


@dataclass(frozen=True, slots=True)
class LiteLLMHarness:
    """Runs the small agent; ``backoff_seconds`` is its pause after a first failed request."""

    spec: HarnessSpec
    backoff_seconds: float = BACKOFF_SECONDS
    name: str = "litellm"

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """See `Harness.run`."""
        config = self.configuration(task)
        if isinstance(config, Diagnostic):
            return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, f"{config.summary} ({config.hint})")
        problem = unusable(config.route.key, task.environment)
        if problem is not None:
            return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, problem)
        program = installed()
        if program is None:
            return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, MISSING)
        home = task.workdir / "home"
        home.mkdir(mode=0o700, exist_ok=True)
        file = home / FILE_NAME
        config.write(file)
        invocation = Invocation(
            # Isolated: neither the working directory, which the agent writes to, nor the user's site is on its path.
            # Its libraries warn of each other's futures, which does not matter here.
            argv=(sys.executable, "-I", "-W", "ignore", "-m", MODULE, str(file)),
            named=tuple(name for name in self._named(config.route) if name not in config.hidden),
            piped=tuple(name for name in self._named(config.route) if name in config.hidden),
            settings=SETTINGS,
            dialect=ReactDialect(),
            program=program,
            sandbox=self.spec.sandbox,
        )
        return run_contained(task, invocation, progress)

    def configuration(self, task: Task) -> Config | Diagnostic:
        """The configuration of the process, or what is missing; nothing is written."""
        way = route(self.spec, task.model, task.environment)
        if isinstance(way, Diagnostic):
            return way
        limits = task.limits
        silence = min(limits.wall_seconds, limits.idle_seconds or MAX_SILENCE)
        longest = max(1, int(silence * 0.8))
        return Config(
            route=way,
            prompt=str(task.prompt),
            output=str(task.output),
            workdir=str(task.workdir),
            # A reply that stalls is the orchestrator's to end, with a reason; this is for when it has no such limit.
            request_seconds=silence * 1.5,
            shell_seconds=min(SHELL_SECONDS, longest),
            most_shell_seconds=longest,
            backoff_seconds=self.backoff_seconds,
            hidden=(*(name for name in self._named(way) if name == way.key or is_secret(name)), *SETTINGS),
            web_search=self.spec.web_search,
        )

    def _named(self, way: Route) -> tuple[str, ...]:
        return tuple(name for name in (*self.spec.env, way.key) if name)


def installed() -> str | None:
    """The package with its version; None when it is not there."""
    try:
        return f"litellm {version('litellm')}"
    except PackageNotFoundError:
        return None


class ReactDialect:
    """One run of the small agent; its lines are described in `octoform.harness.react.loop`."""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """See `Dialect.read`."""
        value = json_object(line) if stream == "stdout" else None
        text = one_line(field(value, "text") or "")
        match field(value, "type"):
            case "reply":
                if text:
                    yield Output(text)
                into, cached, out = (count(value, "usage", name) for name in ("input", "cached", "output"))
                yield Turn(Usage(into, cached, out))
            case "call":
                yield ToolCalled(one_line(field(value, "tool") or "?"), text)
            case "result":
                yield ToolReturned(field(value, "failed") is True)
            case "alive":
                yield Replying()
            case "trouble":
                yield model_problem(text, count(value, "status"), final=field(value, "final") is True)
            case "closed":
                yield Closed(field(value, "ok") is True, text)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> LiteLLMHarness:
    """The harness."""
    return LiteLLMHarness(spec)
