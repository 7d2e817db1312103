"""The plan for a person and for a program."""

from collections.abc import Iterator, Sequence

from octoform.plan.model import (
    TOOL,
    Action,
    NamedDevice,
    NearProfile,
    OpenQuestion,
    Plan,
    PlannedAction,
    ProfileUse,
    to_json,
)
from octoform.views import plan_text as hardware
from octoform.views import plan_text as plan_text
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream
from octoform.views.format.values import money, one_line

# What is known of the devices, for people: the answers that they needed, which profile serves which, what is asked.

WIDTH = 100
TIERS = {tier: f"a {word}" if tier > 1 else word for tier, word in hardware.INPUTS.items()}
"""A person's input, by tier."""
_USES = {
    Action.NOOP: "matches",
    Action.CREATE: "will match",
    Action.DESTROY: "will no longer match",
}
_MARKS = {Action.NOOP: ("   ", "dim"), Action.CREATE: ("  +", "green"), Action.DESTROY: ("  -", "red")}


def show(plan: Plan, console: Console) -> None:
    """Tiers, profiles and questions of a plan; nothing where no device is known."""
    if plan.devices:
        console.line(f"\n{_counted(plan.devices)}")
    for device in plan.devices:
        if device.tier > 1:
            console.line(f"  {device.device} ({_describe(device)})")
    names = {(device.profile, device.device) for device in plan.devices}
    uses = [
        item for item in plan.profiles if item.action is not Action.NOOP or (item.profile, item.device) not in names
    ]
    if uses or plan.near:
        console.line("\nProfiles:")
    for action, profile, devices in _uses(uses):
        mark, colour = _MARKS[action]
        console.line(f"{console.paint(mark, colour)} {profile} {_USES[action]} {', '.join(devices)}")
    for profile in dict.fromkeys(item.profile for item in plan.near):
        _offer([item for item in plan.near if item.profile == profile], console)
    if plan.questions:
        console.line()
    ask(plan.questions, console)


def _offer(near: Sequence[NearProfile], console: Console) -> None:
    """A profile that lacks a word alone, the devices, and how it is stated."""
    first, devices = near[0], ", ".join(item.device for item in near)
    mark = console.paint("  ?", "cyan")
    console.line(f"{mark} {first.profile} will match {one_line(devices, WIDTH)} after this answer:")
    console.line(f'        octoform answer {first.device} "{one_line(first.word, WIDTH)}"')


def ask(questions: Sequence[OpenQuestion], console: Console) -> None:
    """The open questions, and how one is answered."""
    if not questions:
        return
    console.line("Unidentified devices:")
    for question in questions:
        wanted = console.paint(f", needs {TIERS[question.tier]}", "dim")
        mark = console.paint("  ?", "cyan")
        console.line(f"{mark} {question.device} ({one_line(question.seen_as, WIDTH)}){wanted}")
        console.line(f"        {one_line(question.sentence, 2 * WIDTH)}")
    console.line(console.paint(f'  To answer:  octoform answer {questions[0].device} "..."', "dim"))
    # A name makes no tool of what only a line of its own commands can move: that needs limits and a way to stop.
    text = f"  What acts over a line needs a profile:  octoform profile new {questions[0].device}"
    console.line(console.paint(text, "dim"))


def _counted(devices: Sequence[NamedDevice]) -> str:
    """``Identified devices: 7 without your input, 1 with a label``."""
    words = {tier: f"with {word}" if tier > 1 else "without your input" for tier, word in TIERS.items()}
    counts = ((sum(1 for item in devices if item.tier == tier), word) for tier, word in words.items())
    return f"Identified devices: {', '.join(f'{count} {word}' for count, word in counts if count)}"


def _describe(device: NamedDevice) -> str:
    parts = [one_line(device.name, WIDTH)]
    parts += [f"by profile {device.profile}"] if device.profile else []
    parts += ["by an answer"] if device.answer and not device.profile else []
    return ", ".join(parts)


def _uses(uses: Sequence[ProfileUse]) -> Iterator[tuple[Action, str, list[str]]]:
    """One line for each profile and what becomes of it: those that stay, those that come, those that go."""
    for action in _USES:
        for profile in dict.fromkeys(item.profile for item in uses if item.action is action):
            yield action, profile, [item.device for item in uses if item.action is action and item.profile == profile]


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
                self._node(plan, item)
        self._hardware(plan)
        self._tools(plan)
        show(plan, self._console)
        say()
        first, *rest = plan_text.summary(plan).split("\n")
        say(self._console.paint(first, "bold"))
        for line in rest:
            say(line)
        if warning := plan_text.moving(plan):
            say(self._console.paint(warning, "bold", "yellow"))
        self._advice(plan, saved_as)

    def _header(self, plan: Plan) -> str:
        text = f"host {plan.host}"
        if plan.targets:
            text += f", only {plan_text.listed(plan.targets, 'and')} (-target)"
        text += ", without profiles and answers (-tier1)" if plan.tier1 else ""
        if plan.revision:
            text += f", revision {plan.revision[:12]}"
            text += f" with uncommitted {', '.join(plan.dirty)}" if plan.dirty else ""
        return self._console.paint(text, "dim")

    def _legend(self, plan: Plan) -> None:
        self._console.line("octoform will perform the following actions:")
        for action, meaning in plan_text.LEGEND.items():
            if any(item.action is action for item in plan.work):
                self._console.line(f"{self._symbol(action)} {meaning}")
        self._console.line()

    def _symbol(self, action: Action) -> str:
        symbol = f"{plan_text.SYMBOLS[action]:>3}"
        return self._console.paint(symbol, plan_text.COLOURS[action])

    def _node(self, plan: Plan, item: PlannedAction) -> None:
        say = self._console.line
        maker = f"  [{one_line(plan_text.makers(item), WIDTH)}]" if item.calls_agent else ""
        width = max(10, *(len(one.node) for one in plan.work))
        name = self._console.paint(f"{item.node:<{width}}", "bold")
        say(f"{self._symbol(item.action)} {name} {plan_text.phrase(item, plan)}{self._console.paint(maker, 'dim')}")
        for reason in plan_text.reasons(plan, item):
            say(f"        {reason}")
        if item.loan is not None:
            say(self._console.paint(f"        {one_line(plan_text.reuse(item.loan), WIDTH)}", "cyan"))
        if item.calls_agent and item.last.get("attempts"):
            say(self._console.paint(f"        the accepted run took {_last(item)}", "dim"))

    def _hardware(self, plan: Plan) -> None:
        found = hardware.lines(plan.changes)
        if found:
            self._console.line("\nHardware that came or went since the last apply, as the kernel announces it:")
        for line in found:
            self._console.line(f"{self._symbol(line.action)} {one_line(line.text, WIDTH)}")

    def _tools(self, plan: Plan) -> None:
        found = [change for change in plan.changes if change.kind == TOOL]
        if found:
            self._console.line("\nTools of the endpoint that INTERFACE has otherwise now:")
        for change in found:
            text = f"{change.name}, {change.text}" if change.text else change.name
            self._console.line(f"{self._symbol(change.action)} {one_line(text, 2 * WIDTH)}")

    def _advice(self, plan: Plan, saved_as: str | None) -> None:
        first, *more = plan_text.adoptable(plan) or ("",)
        if first:
            text = f"To keep an artifact that is still right, without a new run:  octoform state adopt {first}"
            text += f"  (and so {plan_text.listed(more, 'and')})" if more else ""
            self._console.line(self._console.paint(text, "dim"))
        if saved_as:
            self._console.line(f"\nSaved as {saved_as}. Apply it with:  octoform apply {saved_as}")


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
    cost = item.last.get("cost_usd")
    if isinstance(cost, int | float):
        parts.append(money(cost))
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
                texts = plan_text.reasons(plan, item)
                self._stream.emit(
                    "planned_change", f"{item.node}: {plan_text.phrase(item, plan)}", change=change, reasons_text=texts
                )
        for change in document["changes"]:
            self._stream.emit("known_change", f"{change['kind']} {change['name']}", change=change)
        for device in document["devices"]:
            self._stream.emit("known_device", f"{device['device']}: tier {device['tier']}", known=device)
        for use in document["profiles"]:
            self._stream.emit("profile_use", f"profile {use['profile']}: {use['device']}", use=use)
        for item in document["near"]:
            self._stream.emit("profile_near", f"profile {item['profile']}: {item['device']} lacks a word", near=item)
        for step in document.get("steps", ()):
            self._stream.emit("privileged_step", f"{step['node']}: {step['about']}", step=step)
        for question in document["questions"]:
            self._stream.emit("open_question", f"{question['device']}: {question['sentence']}", question=question)
        add, update, remove = plan_text.counts(plan)
        maybe = sum(1 for item in plan.work if not item.certain)
        self._stream.emit(
            "change_summary",
            plan_text.summary(plan).split("\n")[0],
            changes={"add": add, "change": update, "remove": remove, "maybe": maybe, "operation": plan.operation},
            agent_runs={
                "at_most": sum(1 for item in plan.work if item.calls_agent),
                "maybe": sum(1 for item in plan.work if plan_text.surely_runs(item)),
                "model": sum(1 for item in plan.work if item.calls_model),
            },
            host=plan.host,
            lineage=plan.lineage,
            serial=plan.serial,
            revision=plan.revision,
            dirty=list(plan.dirty),
            tier1=plan.tier1,
            saved_as=saved_as,
        )
