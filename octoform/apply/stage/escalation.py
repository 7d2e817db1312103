"""Escalation: what the embedded agent left ``unknown`` goes to another agent, all of it in one assignment.

So does what a person's answer alone has named and with which it can do nothing: another agent may know the product.

The second agent reads a PROBE artifact that lists those devices only, so it can neither spend on nor change what was
already certain. What it states is held to the same contract twice: on its own against what it was given, and merged
with the first answer against the whole host.
"""

from collections.abc import Mapping
from typing import Any

from octoform.apply.context import Context, accepted
from octoform.apply.stage.acceptance import Verdict, artifacts, display, read_value
from octoform.apply.stage.artifact_writer import text_of
from octoform.apply.stage.assignment import Assignment
from octoform.contracts.contract_check import check
from octoform.contracts.rules.identify.answer_rules import METHOD as ANSWERED
from octoform.diagnostics import Diagnostic, has_errors
from octoform.harness.port import Task
from octoform.records import replace

UNKNOWN = "unknown"


def of_unknown(context: Context, stage: str, verdict: Verdict) -> Assignment | None:
    """The assignment for what an accepted first answer left unknown; None when nothing is, or no one is to be asked."""
    settings = context.manifest.stages[stage].escalate
    left = undecided(verdict.value) if settings is not None else []
    if settings is None or not left:
        return None
    probe = accepted(context, "probe")
    reduced = {**probe, "devices": [device for device in probe["devices"] if device["id"] in left]}

    def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
        return _judge(context, task, data, first=verdict.value, probe=reduced)

    return Assignment(
        stage=stage,
        harness=settings.harness,
        model=settings.model,
        budget=context.manifest.budget_for(stage),
        role="escalate",
        given=text_of(reduced),
        judge=judge,
    )


def unknown(identify: Mapping[str, Any]) -> list[str]:
    """The ids of the devices that are unidentified."""
    return [device["id"] for device in identify["devices"] if device["category"] == UNKNOWN]


def undecided(identify: Mapping[str, Any]) -> list[str]:
    """The ids that another agent may know more of: what is unknown, and what only a person's word has named so far."""
    return [
        device["id"]
        for device in identify["devices"]
        if device["category"] == UNKNOWN or (device["method"] == ANSWERED and not device["capabilities"])
    ]


def detail(first: Verdict, second: Verdict, more: Assignment) -> dict[str, object]:
    """The state's facts of an escalation: the agent, about how many devices, how many are still unknown."""
    asked, left = undecided(first.value), unknown(second.value)
    return {"harness": more.harness.name, "model": more.model, "asked": len(asked), "still_unknown": len(left)}


def _judge(
    context: Context, task: Task, data: bytes, *, first: Mapping[str, Any], probe: Mapping[str, Any]
) -> tuple[Any, list[Diagnostic]]:
    value, found = read_value(task, data)
    if value is None:
        return None, found
    path = display(task.output)
    whole = artifacts(context, task.stage, value)
    found = check(task.stage, value, replace(whole, probe=dict(probe)), context.schemas, path)
    if has_errors(found):
        return None, found
    both = merged(first, value)
    return both, check(task.stage, both, whole, context.schemas, path)


def merged(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    """The first answer with every device that the second speaks of in the second's words, in the first's order."""
    annotated = {device["id"]: device for device in second["devices"]}
    out = {item["id"] for item in second["left_out"]}
    devices = [annotated.get(device["id"], device) for device in first["devices"] if device["id"] not in out]
    return {**first, "devices": devices, "left_out": [*first["left_out"], *second["left_out"]]}
