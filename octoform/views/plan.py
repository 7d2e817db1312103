"""The plan for a person and for a program."""

from octoform.plan.encode import to_json
from octoform.plan.model import Action, Plan, PlannedAction
from octoform.views import sentences
from octoform.views.console import Console
from octoform.views.stream import JsonStream


class PlanHuman:
    """Text in Terraform's manner: legend, nodes with reasons, devices, the line that counts."""

    def __init__(self, console: Console) -> None:
        self._console = console

    def show(self, plan: Plan, saved_as: str | None = None) -> None:
        """Print the plan; ``saved_as`` is the file it was written to."""
        say = self._console.line
        say(self._header(plan))
        if plan.work:
            say()
            self._legend(plan)
            for item in plan.work:
                self._node(item)
        self._devices(plan)
        say()
        first, *rest = sentences.summary(plan).split("\n")
        say(self._console.paint(first, "bold"))
        for line in rest:
            say(line)
        if saved_as:
            say(f"\nSaved as {saved_as}. Apply it with:  octoform apply {saved_as}")

    def _header(self, plan: Plan) -> str:
        text = f"host {plan.host}"
        if plan.revision:
            text += f", revision {plan.revision[:12]}"
            text += f" with uncommitted {', '.join(plan.dirty)}" if plan.dirty else ""
        return self._console.paint(text, "dim")

    def _legend(self, plan: Plan) -> None:
        meanings = {
            Action.CREATE: "create",
            Action.UPDATE: "update in place",
            Action.REPLACE: "destroy and then create replacement",
            Action.DESTROY: "destroy",
        }
        self._console.line("octoform will perform the following actions:")
        for action, meaning in meanings.items():
            if any(item.action is action for item in plan.work):
                self._console.line(f"  {self._symbol(action)} {meaning}")
        self._console.line()

    def _symbol(self, action: Action) -> str:
        symbol = f"{sentences.SYMBOLS[action]:>3}"
        return self._console.paint(symbol, sentences.COLOURS[action])

    def _node(self, item: PlannedAction) -> None:
        say = self._console.line
        maker = f"  [{item.harness}{', ' + item.model if item.model else ''}]" if item.calls_agent else ""
        name = self._console.paint(f"{item.node:<10}", "bold")
        say(f"{self._symbol(item.action)} {name} {sentences.phrase(item)}{self._console.paint(maker, 'dim')}")
        for reason in item.reasons:
            say(f"        {sentences.reason(reason)}")
        if item.calls_agent and item.last:
            say(self._console.paint(f"        last run: {_last(item)}", "dim"))

    def _devices(self, plan: Plan) -> None:
        say = self._console.line
        if plan.changes:
            say("\nWhat is known before apply:")
        for change in plan.changes:
            text = f": {change.text}" if change.text else ""
            say(f"  {self._symbol(change.action)} {change.kind} {change.name}{text}")
        if plan.questions:
            say("\nDevices whose meaning is missing:")
        for question in plan.questions:
            mark = self._console.paint("  ?", "cyan")
            say(f"  {mark} {question.device} ({question.seen_as})\n        {question.sentence}")


def _last(item: PlannedAction) -> str:
    parts = []
    if isinstance(item.last.get("seconds"), int | float):
        parts.append(f"{item.last['seconds']:.1f} s")
    attempts = item.last.get("attempts")
    if attempts:
        parts.append(f"{attempts} attempt{'' if attempts == 1 else 's'}")
    for key, word in (("input_tokens", "tokens in"), ("output_tokens", "tokens out")):
        if item.last.get(key) is not None:
            parts.append(f"{item.last[key]} {word}")
    if item.last.get("cost_usd") is not None:
        parts.append(f"{item.last['cost_usd']:.4f} USD")
    return ", ".join(parts)


class PlanJson:
    """The event stream of a plan: one ``planned_change`` a node, ``open_question``s, one ``change_summary``."""

    def __init__(self, stream: JsonStream) -> None:
        self._stream = stream

    def show(self, plan: Plan, saved_as: str | None = None) -> None:
        """Stream the plan."""
        document = to_json(plan)
        for item, change in zip(plan.actions, document["actions"], strict=True):
            if item.action is not Action.NOOP:
                texts = [sentences.reason(reason) for reason in item.reasons]
                self._stream.emit(
                    "planned_change", f"{item.node}: {sentences.phrase(item)}", change=change, reasons_text=texts
                )
        for change in document["changes"]:
            self._stream.emit("known_change", f"{change['kind']} {change['name']}", change=change)
        for question in document["questions"]:
            self._stream.emit("open_question", f"{question['device']}: {question['sentence']}", question=question)
        add, update, remove = sentences.counts(plan)
        maybe = sum(1 for item in plan.work if not item.certain)
        self._stream.emit(
            "change_summary",
            sentences.summary(plan).split("\n")[0],
            changes={"add": add, "change": update, "remove": remove, "maybe": maybe, "operation": plan.operation},
            agent_runs={
                "at_most": sum(1 for item in plan.work if item.calls_agent),
                "maybe": sum(1 for item in plan.work if item.calls_agent and item.certain),
                "model": sum(1 for item in plan.work if item.calls_model),
            },
            host=plan.host,
            lineage=plan.lineage,
            serial=plan.serial,
            revision=plan.revision,
            dirty=list(plan.dirty),
            saved_as=saved_as,
        )
