"""Apply and destroy for a program: the events as a stream of JSON lines."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import Any

from octoform import events
from octoform.diagnostics import Diagnostic, to_json
from octoform.engine.results import RunResult
from octoform.plan.model import Plan
from octoform.views.format.stream import JsonStream
from octoform.views.plan.plan import PlanJson
from octoform.views.run.apply import closing

_KINDS = {
    events.NodeStarted: "apply_start",
    events.AttemptStarted: "attempt_start",
    events.AttemptProgress: "apply_progress",
    events.AgentActed: "agent_acted",
    events.AgentSpent: "agent_spent",
    events.SpecEdited: "spec_edited",
    events.AttemptFailed: "attempt_errored",
    events.Checking: "checking",
    events.StepTried: "step_tried",
    events.NodeAccepted: "apply_complete",
    events.NodeUnchanged: "apply_unchanged",
    events.NodeFailed: "apply_errored",
    events.NodeDestroyed: "destroy_complete",
    events.Notice: "log",
}


class RunJson:
    """The JSON view of a run; it cannot ask, so it never approves."""

    def __init__(self, stream: JsonStream) -> None:
        self._stream = stream

    def plan(self, plan: Plan) -> None:
        """Stream the plan."""
        PlanJson(self._stream).show(plan)

    def approve(self) -> bool:
        """Nobody can be asked in a stream."""
        return False

    @contextmanager
    def watching(self) -> Iterator[Callable[[events.Event], None]]:
        """The sink for events."""
        yield self.event

    def event(self, event: events.Event) -> None:
        """One line an event; the fields are those of the event."""
        kind = _KINDS[type(event)]
        level = "error" if kind in ("apply_errored", "attempt_errored") else "info"
        self._stream.emit(kind, f"{event.node}: {kind}", level=level, **_fields(event))

    def ended(self, result: RunResult) -> None:
        """Diagnostics, then one ``run_summary``."""
        self._stream.diagnostics(result.diagnostics)
        fields = asdict(result)
        del fields["diagnostics"]
        level = "error" if result.failed else "info"
        self._stream.emit("run_summary", closing(result), level=level, result=fields)


def _fields(event: events.Event) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name in event.__dataclass_fields__:
        value = getattr(event, name)
        if name == "diagnostics":
            value = [to_json(item) for item in value if isinstance(item, Diagnostic)]
        out[name] = value
    return out
