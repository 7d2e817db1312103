"""Reasons and symbols as words: one place that turns the plan's records into what a person reads."""

from octoform import digest
from octoform.plan.model import Action, Cause, Plan, PlannedAction, Reason

SYMBOLS = {
    Action.CREATE: "+",
    Action.UPDATE: "~",
    Action.REPLACE: "-/+",
    Action.DESTROY: "-",
    Action.NOOP: "",
}
COLOURS = {Action.CREATE: "green", Action.UPDATE: "yellow", Action.REPLACE: "yellow", Action.DESTROY: "red"}

_PHRASES = {
    Action.CREATE: "will be created",
    Action.UPDATE: "will be updated in place",
    Action.REPLACE: "must be replaced",
    Action.DESTROY: "will be destroyed",
    Action.NOOP: "stays as it is",
}

_CAUSES = {
    Cause.NEW: "it is not in the state",
    Cause.INTERRUPTED: "its last run began and never ended",
    Cause.FAILED: "its last run failed",
    Cause.TAINTED: "it is tainted",
    Cause.REQUESTED: "-replace asks for it",
    Cause.ARTIFACT_DELETED: "its accepted artifact is gone",
    Cause.ARTIFACT_EDITED: "its accepted artifact was edited by hand",
    Cause.ARTIFACT_LINK: "its accepted artifact was replaced by a link",
    Cause.CONTRACT: "its accepted artifact no longer passes its contract",
    Cause.ENDPOINT: "the endpoint is not as it was left",
}


def phrase(item: PlannedAction) -> str:
    """What happens to the node, as the end of a sentence."""
    if not item.certain:
        return "known after apply"
    return _PHRASES[item.action]


def reason(item: Reason) -> str:
    """One reason as one line, part by part, before and after."""
    if item.cause is Cause.UPSTREAM:
        source = (item.part or "").removeprefix("input.")
        return f"runs only if the output of {source} comes out different"
    if item.cause is Cause.CHANGED:
        return _changed(item)
    text = _CAUSES[item.cause]
    if item.before and item.after:
        text += f" ({show(item.before)} -> {show(item.after)})"
    return f"{text}: {item.text}" if item.text else text


def _changed(item: Reason) -> str:
    part = item.part or ""
    if part == "hardware":
        return f"hardware: {item.text}" if item.text else "hardware: what the kernel announces has changed"
    label = f"output of {part.removeprefix('input.')}" if part.startswith("input.") else part.replace(".", " ", 1)
    return f"{label}: {show(item.before)} -> {show(item.after)}"


def show(value: str | None) -> str:
    """A key part for people: digests are shortened, absence has a word."""
    if value is None:
        return "(none)"
    if value.startswith(digest.PREFIX):
        return digest.short(value)
    return value or "(none)"


def summary(plan: Plan) -> str:
    """The line that counts; certain work first, then what may follow from it."""
    if plan.empty:
        return nothing(plan)
    add, change, destroy = counts(plan)
    line = f"Plan: {add} to add, {change} to change, {destroy} to destroy."
    certain = [item for item in plan.work if item.certain and item.calls_agent]
    maybe = [item for item in plan.work if not item.certain]
    if maybe:
        line += f" {len(maybe)} more known after apply: at most {len(plan.work)}, maybe {len(plan.work) - len(maybe)}."
    agents = sum(1 for item in plan.work if item.calls_agent)
    models = sum(1 for item in plan.work if item.calls_model)
    if agents:
        count = f"{agents}" if agents == len(certain) else f"at most {agents}, maybe {len(certain)}"
        line += f"\nAgent runs: {count}; {_models(models)}."
    return line


def _models(count: int) -> str:
    return "none calls a model" if count == 0 else f"{count} may call a model"


def counts(plan: Plan) -> tuple[int, int, int]:
    """To add, to change, to destroy; certain actions only, a replacement counts as a change in place of its node."""
    changes = plan.count(Action.UPDATE) + plan.count(Action.REPLACE)
    return plan.count(Action.CREATE), changes, plan.count(Action.DESTROY)


def nothing(plan: Plan) -> str:
    """The words for a plan without work."""
    if plan.operation == "destroy":
        return "No changes. No objects need to be destroyed."
    return "No changes. Your infrastructure matches the configuration."
