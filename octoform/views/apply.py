"""Apply and destroy for a person: what is done while it is done, and how it ended.

On a terminal the node at work is one moving line (stage, attempt, elapsed time, what the agent reports); elsewhere the
same facts come as plain lines, with a sign of life every ten seconds. The end is a funnel, the endpoint and the next
command. (Heavy only on a terminal: the moving line is drawn by rich.)
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

from octoform import events
from octoform.base.escaping import escaped
from octoform.diagnostics import Diagnostic, to_json
from octoform.engine.results import RunResult
from octoform.plan.model import Plan
from octoform.state.layout import STAGES, STEP
from octoform.views import plan as knowledge
from octoform.views import plan_text as plan_text
from octoform.views.format.console import Console, broken
from octoform.views.format.output import JsonStream
from octoform.views.format.problems import near, render
from octoform.views.format.values import one_line, spent
from octoform.views.plan import PlanHuman, PlanJson

if TYPE_CHECKING:
    from rich.spinner import Spinner
    from rich.text import Text


PULSE_SECONDS = 9.0
INDENT = 24
"""Columns before the text of a line that shows what an agent does, the widest of them."""
STAYS = "APPLY-OUTSIDE-WRITE"
"""Reports, as a warning, what an attempt has left standing, also one whose output is not used."""
MAX_PATHS = 5
"""Files that are named beside a reason why an attempt was rejected."""


def _visible(event: events.Event) -> events.Event:
    """The event with each text on one line and nothing hidden in it; `render` does the same for diagnostics."""
    texts = {item.name: getattr(event, item.name) for item in fields(event)}
    return replace(event, **{name: escaped(text) for name, text in texts.items() if isinstance(text, str)})


@dataclass(slots=True)
class _Running:
    """The node at work, for the sign of life."""

    node: str = ""
    attempt: str = ""
    spent: str = ""
    last_pulse: float = 0.0


class _MovingLine:
    """The moving line of a run on a terminal: spinner, node, what it does, elapsed time.

    Finished lines scroll above it. rich is paid for only where a person looks.
    """

    def __init__(self, out: TextIO) -> None:
        from rich.console import Console as RichConsole
        from rich.live import Live
        from rich.spinner import Spinner
        from rich.text import Text

        self._text = Text
        self._console = RichConsole(file=out, highlight=False, soft_wrap=True)
        self._node = ""
        self._what = ""
        self._since = time.monotonic()
        self._spinner = Spinner("dots")
        self._live = Live(get_renderable=self._draw, console=self._console, refresh_per_second=8, transient=True)

    def __enter__(self) -> Self:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._node = ""
        self._live.stop()

    def update(self, node: str, what: str) -> None:
        """Another node, or the same at something else; the clock restarts with the node."""
        if node != self._node:
            self._since = time.monotonic()
        self._node, self._what = node, what

    def above(self, text: str) -> None:
        """A finished line (it may hold colour codes)."""
        self._console.print(self._text.from_ansi(text))

    def _draw(self) -> "Text | Spinner":
        if not self._node:
            return self._text("")
        elapsed = time.monotonic() - self._since
        room = max(20, self._console.width - 30)
        self._spinner.update(text=f"{self._node:<10} {elapsed:5.1f} s  {one_line(self._what, room)}")
        return self._spinner


class RunHuman:
    """The human view of a run."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._running = _Running()
        self._moving: _MovingLine | None = None

    def plan(self, plan: Plan) -> None:
        """Show what is going to be done."""
        PlanHuman(self._console).show(plan)

    def approve(self) -> bool:
        """Ask on the terminal; only ``yes`` is yes."""
        self._console.line("\nDo you want to perform these actions? Only 'yes' will be accepted to approve.")
        self._console.out.write("  Enter a value: ")
        self._console.out.flush()
        try:
            answer = input() if sys.stdin is not None else ""
        except (EOFError, UnicodeDecodeError):
            answer = ""
        self._console.line()
        return answer.strip() == "yes"

    @contextmanager
    def watching(self) -> Iterator[Callable[[events.Event], None]]:
        """The sink for events; on a terminal the moving line lives as long as this context."""
        self._console.line()
        if not (self._console.out.isatty() and self._console.colour):
            yield self.event
            return
        with _MovingLine(self._console.out) as moving:
            self._moving = moving
            try:
                yield self.event
            finally:
                self._moving = None

    def event(self, event: events.Event) -> None:
        """One event, as a line or as a change of the moving line; words in it may come from anywhere."""
        event = _visible(event)
        match event:
            case events.NodeStarted():
                self._running = _Running(node=event.node)
                if self._moving is not None:
                    self._moving.update(event.node, "starting")
            case events.AttemptStarted():
                self._running = _Running(event.node, f"attempt {event.number} of {event.of}, {event.harness}")
                self._work(event.node, self._running.attempt)
            case events.AttemptProgress():
                self._progress(event)
            case events.AgentActed():
                self._acted(event)
            case events.AgentSpent():
                self._running.spent = spent(event.input_tokens, event.output_tokens, event.cost_usd)
                self._move("")
            case events.Checking():
                self._work(event.node, event.what)
            case events.AttemptFailed():
                self._attempt_failed(event)
            case _:
                self._finished(event)

    def _finished(self, event: events.Event) -> None:
        paint = self._console.paint
        match event:
            case events.NodeAccepted():
                tail = "" if event.changed else paint("  same output as before", "dim")
                facts = [f"{event.seconds:.1f} s"]
                facts += [f"{event.attempts} attempts"] if event.attempts > 1 else []
                used = spent(event.input_tokens, event.output_tokens, event.cost_usd)
                facts += [used] if used else []
                self._print(f"{paint('✓', 'green')} {event.node:<10} {event.found}  ({', '.join(facts)}){tail}")
            case events.NodeUnchanged():
                self._print(paint(f"= {event.node:<10} {event.reason}", "dim"))
            case events.NodeFailed():
                self._print(f"{paint('✗', 'red')} {event.node:<10} failed after {event.seconds:.1f} s")
            case events.NodeDestroyed():
                self._print(f"{paint('-', 'red')} {event.node:<10} destroyed")
            case events.SpecEdited():
                self._edited(event)
            case events.StepTried():
                mark = paint("·", "dim") if event.well else paint("!", "yellow")
                text = one_line(
                    f"{event.unit}  {event.text}" if event.well else event.text, self._console.width - INDENT
                )
                self._print(f"{mark} {event.node:<10} {text}")
            case events.Notice():
                self._print(paint(f"  {event.text}", "dim"))

    def _progress(self, event: events.AttemptProgress) -> None:
        if self._moving is not None:
            self._move(event.text)
        elif event.elapsed - self._running.last_pulse >= PULSE_SECONDS:
            self._running.last_pulse = event.elapsed
            used = f", {self._running.spent}" if self._running.spent else ""
            text = f": {one_line(event.text, self._console.width - INDENT)}" if event.text else ""
            self._print(f"  {event.node:<10} still running, {event.elapsed:.0f} s elapsed{used}{text}")

    def _acted(self, event: events.AgentActed) -> None:
        """One line for each use of a tool, as it happens."""
        self._running.last_pulse = event.elapsed
        text = one_line(f"{event.tool}  {event.text}", self._console.width - INDENT)
        self._print(self._console.paint(f"    {event.node:<9} {event.elapsed:6.1f} s  {text}", "dim"))
        self._move(f"{event.tool} {event.text}")

    def _move(self, text: str) -> None:
        if self._moving is not None:
            parts = (self._running.attempt, self._running.spent, text)
            self._moving.update(self._running.node, "  ".join(part for part in parts if part))

    def _edited(self, event: events.SpecEdited) -> None:
        """The agent's edit of its copy of the spec, as a diff."""
        paint = self._console.paint
        what = "corrected its copy of the spec" if event.permitted else "changed its copy of the spec unasked"
        self._print(f"{paint('~', 'yellow')} {event.node:<10} the agent {what} (attempt {event.number})")
        styles = {"+": "green", "-": "red", "@": "cyan"}
        for line in event.diff[2:]:
            self._print(
                "             " + paint(one_line(line, self._console.width - INDENT), styles.get(line[:1], "dim"))
            )
        if event.permitted:
            self._print(f"             it holds for this run only; `octoform spec diff {event.node}` shows it again")

    def _work(self, node: str, what: str) -> None:
        if self._moving is not None:
            self._moving.update(node, what)
        else:
            self._print(f"  {node:<10} {what}")

    def _attempt_failed(self, event: events.AttemptFailed) -> None:
        self._print(f"{self._console.paint('!', 'yellow')} {event.node:<10} attempt {event.number} refused")
        document: dict[str, list[str]] = {}
        for item in event.diagnostics:
            if item.severity == "error" or item.code == STAYS:
                document.setdefault(f"{item.code}: {item.summary}", []).extend([item.path] if item.path else [])
        for text, paths in document.items():
            more = [f"and {len(paths) - MAX_PATHS} more, which `octoform attempts show` lists"]
            where = [f"--> {path}" for path in paths[:MAX_PATHS]] + (more if len(paths) > MAX_PATHS else [])
            for line in (text, *where):
                self._print(f"             {one_line(line, self._console.width - INDENT)}")

    def _print(self, text: str) -> None:
        if self._moving is not None:
            self._moving.above(broken(text, self._console.width))
        else:
            self._console.line(text)

    def ended(self, result: RunResult) -> None:
        """The closing lines."""
        say, paint = self._console.line, self._console.paint
        for item in dict.fromkeys(result.diagnostics):
            self._console.problem(
                render(near(item), colour=self._console.colour_err, width=self._console.width_err) + "\n"
            )
        say()
        style = "red" if result.failed else "yellow" if result.incomplete or result.silent else "green"
        say(paint(closing(result), "bold", style))
        if result.recorded:
            say(plan_text.recorded(result.recorded))
        if _is_made(result.failed) and result.operation == "apply":
            say("What was accepted stays accepted; the next apply goes on from there.")
        used = spent(result.usage.input_tokens, result.usage.output_tokens, result.usage.cost_usd)
        if used:
            source = f" (priced by {result.usage.cost_source})" if result.usage.cost_source else ""
            say(f"{plan_text.counted(result.agent_runs, 'agent run')}: {used}{source}")
        if result.funnel is not None:
            say()
            self._funnel(result)
        self._questions(result)
        if result.commit:
            say(f"  committed   {result.commit[:12]}")
        if result.endpoint is not None:
            self._endpoint(result)

    def _questions(self, result: RunResult) -> None:
        """The open questions, and how to answer them."""
        if result.questions:
            self._console.line()
        knowledge.ask(result.questions, self._console)

    def _funnel(self, result: RunResult) -> None:
        funnel = result.funnel
        if funnel is None:
            return
        rows = [("discovered", funnel.seen, "devices that the operating system shows")]
        rows.append(("identified", funnel.annotated - funnel.unknown, "of them, what each is, on evidence"))
        rows.append(("unknown", funnel.unknown, "of them, which no evidence identifies"))
        rows.append(("skipped", funnel.left_out, "the others, each with its reason: octoform devices -v"))
        rows.append(("tools", funnel.tools, "typed tools of the endpoint"))
        for name, count, meaning in rows:
            self._console.line(f"  {name:<10} {count:>5}   {self._console.paint(meaning, 'dim')}")

    def _endpoint(self, result: RunResult) -> None:
        endpoint = result.endpoint
        if endpoint is None:
            return
        say = self._console.line
        say(f"\n  endpoint    {endpoint.command}")
        if endpoint.url:
            opened = (
                f"octoform token show {endpoint.token}" if endpoint.token else "none yet: octoform token create NAME"
            )
            say(f"              {endpoint.url}, with a token ({opened})")
        if endpoint.public:
            say(f"              {endpoint.public} from the internet, until the tunnel starts again")
        offered = plan_text.counted(len(endpoint.tools), "tool")
        offered += f", {endpoint.denied} more denied by the policy" if endpoint.denied else ""
        say(f"              scope {endpoint.scope}, {offered}")
        if endpoint.answered:
            say(f"  answered    {endpoint.answered}")
        say("  next        octoform tools")
        if endpoint.example:
            say(f"              octoform call {endpoint.example}")
        say("              octoform clients install claude-code")


def _is_made(node: str | None) -> bool:
    """True for a node that an agent makes."""
    return node is not None and (node in STAGES or node.startswith(STEP))


def closing(result: RunResult) -> str:
    """The one line that states how it ended."""
    operation = result.operation.capitalize()
    if result.failed == "approval":
        return f"{operation} cancelled: nothing was done."
    if result.refused:
        return f"{operation} stopped: the saved plan is no longer valid for {plan_text.listed(result.refused, 'and')}."
    if result.failed == "commit":
        return f"{operation} done, but not committed: see the error above."
    if result.failed == "endpoint" or _is_made(result.failed):
        return f"{operation} stopped: {result.failed} failed."
    if result.failed:
        return f"{operation} stopped: see the error above."
    if result.operation == "destroy":
        return f"Destroy complete! Resources: {result.destroyed} destroyed."
    alike = f" {result.alike} made again with the same output," if result.alike else ""
    counts = f"{result.added} added, {result.changed} changed,{alike} {result.destroyed} destroyed"
    if result.incomplete:
        shut = plan_text.counted(len(result.incomplete), "device")
        return f"Apply incomplete: this user may not use {shut}, see above. Resources: {counts}."
    if result.silent:
        return f"Apply incomplete: {result.silent}, see above. Resources: {counts}."
    return f"Apply complete! Resources: {counts}."


# Apply and destroy for a program: the events as a stream of JSON lines.

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
        """No one can be asked in a stream."""
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
