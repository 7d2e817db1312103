"""Reasons and symbols as words: one place that turns the plan's records into what a person reads.

Privileged steps as words: they move hardware, so a plan states what, and why one would be skipped.
"""

from collections.abc import Iterable, Sequence

from octoform.base import digest
from octoform.graph.model import ANSWER, HARDWARE, STEP, input_of
from octoform.patterns import regex
from octoform.plan.model import Action, Cause, Change, Plan, PlannedAction, Reason, Reuse, StepOutlook
from octoform.records import dataclass
from octoform.views.format.values import one_line

# What the kernel announces, for people: one line a device instead of one a modalias, class counts as before -> now.
#
# A modalias is made for a loader of drivers: a device has one for each of its parts, and its numbers stand among a
# dozen others. The kernel documents the fields; only those that distinguish one product from another are kept here.

_CLASS = regex(r"class:([^:]+):(\d+)")
_NUMBERED = (
    ("USB device", regex(r"usb:v([0-9A-F]{4})p([0-9A-F]{4})")),
    ("PCI device", regex(r"pci:v0000([0-9A-F]{4})d0000([0-9A-F]{4})")),
    ("HID device", regex(r"hid:b[0-9A-F]{4}g[0-9A-F]{4}v0000([0-9A-F]{4})p0000([0-9A-F]{4})")),
)
INPUTS = {1: "no input", 2: "label", 3: "profile"}
"""What a person has to give before a device is identified, by tier."""
_WORDS = {"acpi": "ACPI device", "scsi": "SCSI device", "mmc": "memory card", "i2c": "I2C device", "of": "board device"}
_SCSI = {"t-0x00": "disk", "t-0x01": "tape", "t-0x05": "optical drive", "t-0x0d": "enclosure"}
"""By the peripheral device type that the standard gives and the kernel prints."""


@dataclass(frozen=True, slots=True)
class Line:
    """One line: what happened to it, and its words."""

    action: Action
    text: str


def lines(changes: Iterable[Change]) -> list[Line]:
    """The hardware changes as lines, devices first; the parts of one device make one line."""
    devices: dict[Line, None] = {}
    classes: dict[str, dict[Action, str]] = {}
    for change in changes:
        if change.kind != "hardware":
            continue
        counted = _CLASS.fullmatch(change.name)
        if counted:
            classes.setdefault(counted[1], {})[change.action] = counted[2]
        else:
            devices.setdefault(Line(change.action, describe(change.name)))
    return [*devices, *(_counted(name, counts) for name, counts in sorted(classes.items()))]


def _counted(name: str, counts: dict[Action, str]) -> Line:
    text = f"class {name}: {counts.get(Action.DESTROY, '0')} -> {counts.get(Action.CREATE, '0')}"
    action = Action.UPDATE if len(counts) > 1 else next(iter(counts))
    return Line(action, text)


def describe(announced: str) -> str:
    """A device in words: bus and numbers where they are known, else the bus and what it states."""
    for word, pattern in _NUMBERED:
        found = pattern.match(announced)
        if found:
            return f"{word} {found[1].lower()}:{found[2].lower()}"
    bus, _, rest = announced.partition(":")
    if bus == "scsi" and rest in _SCSI:
        return f"SCSI {_SCSI[rest]}"
    return f"{_WORDS.get(bus, f'{bus} device')} {rest.strip(':') or '(unnamed)'}"


WIDTH = 100
_LOOKS = {"reading": ("read", "reads"), "view": ("look at", "looks at")}


def step_text(step: StepOutlook, *, certain: bool) -> str:
    """The action of a step, as the end of a sentence that begins with its name."""
    if step.skipped:
        return _skipped(step)
    plural = not certain
    move, take = ("may move", "may take") if plural else ("moves", "takes")
    after = " (known after apply)" if plural or step.devices is None else ""
    if step.kind == "frame":
        through = one_line(", ".join(step.devices), WIDTH) if step.devices else "the camera that it chooses"
        return f"{take} pictures through {through}{after}"
    infinitive, third = _LOOKS[step.kind]
    return f"{move} {_what(step)} and {infinitive if plural else third} it before and after{after}"


def _what(step: StepOutlook) -> str:
    if step.devices:
        return one_line(" or ".join(step.devices), WIDTH)
    return f"the device that {step.profile} matches" if step.profile else "a device"


def _skipped(step: StepOutlook) -> str:
    if step.profile is None:
        return "is skipped: there is no camera"
    text = f"is skipped: no device is matched by {step.profile}"
    if step.near is None:
        return text
    return f"{text}; {one_line(step.near, WIDTH)} lacks a word such as {one_line(step.word or '', WIDTH)}"


def folder(node: str) -> str:
    """Where the accepted files of a node lie, below ``state/HOST``."""
    return f"steps/{node.removeprefix(STEP)}" if node.startswith(STEP) else node


def spec(node: str) -> str:
    """The file of a node's spec, below ``protocol``."""
    return f"privileged/{node.removeprefix(STEP)}.md" if node.startswith(STEP) else f"{node}.md"


MAX_ANSWER = 120
SYMBOLS = {
    Action.CREATE: "+",
    Action.UPDATE: "~",
    Action.REPLACE: "-/+",
    Action.DESTROY: "-",
    Action.NOOP: "",
}
COLOURS = {Action.CREATE: "green", Action.UPDATE: "yellow", Action.REPLACE: "yellow", Action.DESTROY: "red"}
LEGEND = {
    Action.CREATE: "create",
    Action.UPDATE: "update in place",
    Action.REPLACE: "replace",
    Action.DESTROY: "destroy",
}

_PHRASES = {
    Action.CREATE: "will be created",
    Action.UPDATE: "will be updated in place",
    Action.REPLACE: "will be replaced",
    Action.DESTROY: "will be destroyed",
    Action.NOOP: "stays as it is",
}

_PURPOSES = {
    "probe": "lists every device that the operating system shows",
    "identify": "identifies each device, on evidence",
    "interface": "decides which typed tools there will be",
    "serve": "writes the MCP server",
    "deploy": "decides the exact packages; the server is started and tried",
    "endpoint": "the launcher and the settings for MCP clients",
}

_CAUSES = {
    Cause.INTERRUPTED: "its last run began and never ended",
    Cause.FAILED: "its last run failed",
    Cause.TAINTED: "it is marked as tainted",
    Cause.REQUESTED: "asked for by -replace",
    Cause.ARTIFACT_DELETED: "its accepted artifact {place} is gone",
    Cause.ARTIFACT_EDITED: "its accepted artifact {place} was edited by hand",
    Cause.ARTIFACT_LINK: "its accepted artifact {place} was replaced by a link",
    Cause.CONTRACT: "its accepted artifact no longer passes its contract",
    Cause.INSTANCES_GONE: "this machine does not know its own units (serial numbers, ports); PROBE finds them",
    Cause.ENDPOINT: "drift",
    Cause.REMOVED: "octopus.yaml no longer names it under privileged_steps",
}


def phrase(item: PlannedAction, plan: Plan | None = None) -> str:
    """The action on a node, as the end of a sentence; of a privileged step in ``plan``: what it moves."""
    outlook = outlook_of(plan, item)
    if outlook is not None:
        return step_text(outlook, certain=item.certain)
    return _PHRASES[item.action] if item.certain else "may be updated in place (known after apply)"


def outlook_of(plan: Plan | None, item: PlannedAction) -> StepOutlook | None:
    """The outlook of a step that will be carried out; None for every other node."""
    if plan is None or item.action in (Action.DESTROY, Action.NOOP):
        return None
    return next((one for one in plan.steps if one.node == item.node), None)


def makers(item: PlannedAction) -> str:
    """The agents of a stage: ``builtin``, ``pi, openai/x``, ``builtin, then pi, openai/x`` for the first's unknowns."""
    first, second = agent(item.harness or "", item.model), item.escalate
    return first if second is None else f"{first}, then {agent(second.harness, second.model)}"


def agent(harness: str, model: str | None) -> str:
    """A harness and its model, where it uses one."""
    return f"{harness}, {model}" if model else harness


_OPENS = {
    "local": "; only clients of this machine, no network socket",
    "intranet": "; opens HTTP without TLS to anyone who is on the network and has a token",
    "internet": "; opens HTTP on the network and a tunnel from the internet, to anyone who has a token",
}
"""The meaning of a scope, where a plan changes it."""


def reasons(plan: Plan, item: PlannedAction) -> list[str]:
    """Why a node is worked on, one line a reason; what it waits for is one line in all."""
    if plan.operation == "destroy":
        return []
    items = [_reason(plan, item, one) for one in item.reasons if one.cause is not Cause.UPSTREAM]
    waits = [input_of(one.part or "") for one in item.reasons if one.cause is Cause.UPSTREAM]
    return [*items, f"only if the output of {listed(waits, 'or')} comes out different"] if waits else items


def _reason(plan: Plan, action: PlannedAction, item: Reason) -> str:
    if item.cause is Cause.NEW:
        outlook = outlook_of(plan, action)
        purpose = _PURPOSES.get(action.node) or (one_line(outlook.about, MAX_ANSWER) if outlook else None)
        return f"not in the state yet: {purpose}" if purpose else "not in the state yet"
    if item.cause is Cause.CHANGED:
        return _changed(plan, action, item)
    if item.cause is Cause.REMOVED and plan.tier1:
        return "privileged steps are off (-tier1)"
    text = _CAUSES[item.cause].format(place=f"state/{plan.host}/{folder(action.node)}")
    if item.before and item.after:
        text += f" ({show(item.before)} -> {show(item.after)})"
    return f"{text}: {item.text}" if item.text else text


def _changed(plan: Plan, action: PlannedAction, item: Reason) -> str:
    part = item.part or ""
    if part == HARDWARE:
        return f"hardware: {_moved(plan)}"
    if part == "spec":
        return f"spec: protocol/{spec(action.node)} changed ({show(item.before)} -> {show(item.after)})"
    if part.startswith(ANSWER):
        return f"answer {part.removeprefix(ANSWER)}: {_answer_text(item)}"
    label = f"output of {made}" if (made := input_of(part)) else part.replace(".", " ", 1)
    if not _is_digest(item.before) and not _is_digest(item.after):
        from octoform.graph.compile import SCOPE, in_force  # only a changed setting pays for it

        scope = next((one for one in action.reasons if one.part == SCOPE), Reason(Cause.CHANGED))
        before = in_force(part, scope.before) if item.before is None else item.before
        after = in_force(part, scope.after) if item.after is None else item.after
        opens = _OPENS.get(str(after), "") if part == SCOPE else ""
        return f"{label}: {show(before)} -> {show(after)}{opens}"
    if item.before and item.after:
        return f"{label}: changed ({show(item.before)} -> {show(item.after)})"
    return f"{label}: new ({show(item.after)})" if item.after else f"{label}: no longer there"


def _answer_text(item: Reason) -> str:
    """A person's present answer about a device, in quotes, and the former answer."""
    before, after = (f'"{one_line(text, MAX_ANSWER)}"' if text else "" for text in (item.before, item.after))
    if before and after:
        return f"{before} -> {after}"
    return f"new: {after}" if after else f"no longer there: {before}"


def _moved(plan: Plan) -> str:
    """How much of the hardware came and went, as far as it is known."""
    found = [line.action for line in lines(plan.changes)]
    words = ((Action.CREATE, "appeared"), (Action.DESTROY, "gone"), (Action.UPDATE, "counted differently"))
    items = [f"{found.count(action)} {word}" for action, word in words if action in found]
    return f"{', '.join(items)} (listed below)" if items else "what the kernel announces has changed"


def _is_digest(value: str | None) -> bool:
    return value is not None and value.startswith(digest.PREFIX)


def show(value: str | None) -> str:
    """A key part for people: digests are shortened, absence has a word."""
    if value is None:
        return "(none)"
    if _is_digest(value):
        return digest.short(value)
    return value or "(none)"


def listed(words: Sequence[str], last: str) -> str:
    """``a, b or c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def summary(plan: Plan) -> str:
    """The line that counts; certain work first, then what may follow from it. A second line counts agents."""
    if plan.empty:
        return nothing(plan)
    add, change, destroy = counts(plan)
    line = f"Plan: {add} to add, {change} to change, {destroy} to destroy."
    maybe = sum(1 for item in plan.work if not item.certain)
    if maybe:
        line += f" {maybe} more may change, known after apply."
    return line if plan.operation == "destroy" else f"{line}\n{_agents(plan)}"


def moving(plan: Plan) -> str:
    """Which steps of the plan move hardware, as a warning to who is near it; empty where nothing moves."""
    known = [(item, outlook_of(plan, item)) for item in plan.work]
    found = [(item, step) for item, step in known if step is not None and step.kind != "frame" and not step.skipped]
    if not found:
        return ""
    verb = "will" if any(item.certain and step.devices for item, step in found) else "may"
    return f"Hardware {verb} move: {listed([item.node for item, _ in found], 'and')}. Keep clear of it."


def _agents(plan: Plan) -> str:
    runs = [item for item in plan.work if item.calls_agent]
    certain = sum(1 for item in runs if surely_runs(item))
    models = sum(1 for item in runs if item.calls_model)
    if not runs:
        return "Agent runs: none." if not any(item.loan for item in plan.work) else "Agent runs: none; all is reused."
    count = f"{certain}" if certain == len(runs) else f"at most {len(runs)}, maybe {certain}"
    who = f"{models} of them" if models < len(runs) else "each" if len(runs) > 1 else "it"
    return f"Agent runs: {count}; {f'{who} may call a model' if models else 'no model is called'}."


def surely_runs(item: PlannedAction) -> bool:
    """True when the node's agent will run whatever comes out of the nodes before."""
    return item.calls_agent and item.certain and item.loan is None


def reuse(reused: Reuse) -> str:
    """The effect of another host's output on a node."""
    if reused.certain:
        return f"reused from host {reused.host}, verified here; no agent runs"
    return f"reused from host {reused.host} if its inputs come out the same"


def counts(plan: Plan) -> tuple[int, int, int]:
    """To add, to change, to destroy; certain actions only, a replacement counts as a change in place of its node."""
    changes = plan.count(Action.UPDATE) + plan.count(Action.REPLACE)
    return plan.count(Action.CREATE), changes, plan.count(Action.DESTROY)


def nothing(plan: Plan) -> str:
    """The words for a plan without work."""
    if plan.operation == "destroy":
        return "No changes. No objects need to be destroyed."
    if plan.targets:
        return f"No changes. As far as {listed(plan.targets, 'and')}, your infrastructure matches the configuration."
    return "No changes. Your infrastructure matches the configuration."


def adoptable(plan: Plan) -> tuple[str, ...]:
    """The nodes whose artifacts a person may want to keep instead of running their agents again.

    That is so where nothing but a string that the agent reads, or the artifact itself, was edited.
    """
    return tuple(
        item.node
        for item in plan.work
        if item.certain and item.calls_agent and item.action is Action.UPDATE and all(map(_edited, item.reasons))
    )


def _edited(item: Reason) -> bool:
    if item.cause is Cause.CHANGED:
        return item.part == "spec" or (item.part or "").startswith("profile.")
    return item.cause is Cause.ARTIFACT_EDITED


def counted(number: int, what: str) -> str:
    """``1 tool``, ``2 tools``."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def recorded(folder: str) -> str:
    """The note on every recorded host."""
    return f"The host is the recorded or simulated one in {folder} (OCTOFORM_SYSROOT), not this machine."
