"""WATCH: an agent reports how a deployment is, from what the daemon has seen. It reads, and changes nothing.

What it may go by is put together here, bounded in bytes. Its report is believed as far as its contract holds, which
binds each word to the readings that were given; without an accepted report nothing is known.
"""

import json
from collections.abc import Mapping
from typing import Any

from octoform import events
from octoform.apply import duty
from octoform.apply.context import Context
from octoform.apply.duty import LogSlice, camera_frames, slice_of
from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.apply.stage.acceptance import Finished, Verdict, artifacts, digest_of, display, read_value
from octoform.apply.stage.artifact_writer import text_of
from octoform.apply.stage.assignment import Assignment, Judge, Prove, of_stage
from octoform.apply.stage.attempt_loop import fulfil
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.report_context import DutyFacts, device_facts, tool_facts
from octoform.diagnostics import Diagnostic
from octoform.harness.containment import agent_environment
from octoform.harness.llm.completion import LiteLLMCompletion
from octoform.harness.port import Task, Usage
from octoform.harness.watcher import added
from octoform.manifest.model import MODEL_FREE
from octoform.records import dataclass, field, replace

WATCH = "watch"
RAW_LOG = "log.txt"
"""Beside an attempt: the lines that a model summed up."""
ALL = "endpoint"
"""The node that comes after all stages: all that was accepted is known to a background task."""


@dataclass(frozen=True, slots=True)
class Given:
    """An agent's input: the value, the files beside it, and the cost of preparing it.

    ``calls`` is how often it may be asked, however much its budget allows; None: as often as that.
    """

    document: dict[str, Any]
    beside: Mapping[str, bytes] = field(default_factory=dict)
    usage: Usage = field(default_factory=Usage)
    calls: int | None = None


def watch(context: Context, brief: Mapping[str, Any]) -> RepairOutcome:
    """Ask the agent of WATCH; blocking, within its budget, and never raises for what an agent does."""
    known = artifacts(context, ALL, None)
    given = _given(context, known, brief)
    finished = fulfil(context, assignment(context, WATCH, given, judge_of(known, given), _prove))
    finished = paid(context, WATCH, finished, given)
    if not finished.verdict.accepted:
        return RepairOutcome.of_diagnostics(finished.verdict.diagnostics, cost_of(finished))
    report = finished.verdict.value
    text = f"{report['status']}: {report['summary']}"
    return RepairOutcome.done("watch.report", text, report=report, cost=cost_of(finished))


def cost_of(finished: Finished) -> Cost:
    """What the runs of an agent have cost."""
    return Cost.of(finished.attempts, finished.usage)


def assignment(context: Context, duty: str, given: Given, judge: Judge, prove: Prove) -> Assignment:
    """The assignment of a background task with this input; its agent corrects no spec."""
    text = json.dumps(given.document, indent=1, ensure_ascii=False).encode("utf-8", "surrogatepass") + b"\n"
    asked = of_stage(context, duty)
    attempts = asked.budget.attempts if given.calls is None else min(asked.budget.attempts, given.calls)
    budget = replace(asked.budget, edit_specs=False, attempts=attempts)
    return replace(asked, budget=budget, given=text, beside={**asked.beside, **given.beside}, judge=judge, prove=prove)


def paid(context: Context, duty: str, finished: Finished, given: Given) -> Finished:
    """With what its input has cost; an agent without a model costs nothing."""
    usage = added(finished.usage, given.usage)
    if usage.cost_usd is None and context.manifest.harness_for(duty).name in MODEL_FREE:
        usage = replace(usage, cost_usd=0.0)
    return replace(finished, usage=usage)


def judge_of(known: Artifacts, given: Given) -> Judge:
    """The judge of a background task's output: schema and rules, held to the very input that was given."""
    held = replace(known, duty=DutyFacts.of(given.document))

    def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
        value: Any
        value, found = read_value(task, data)
        if value is None:
            return None, found
        return value, found + check(task.stage, value, held, context.schemas, display(task.output))

    return judge


def calls_of(brief: Mapping[str, Any]) -> int | None:
    """How many calls the hour has left, as reported by the daemon that asks, if there is one; None: no one counts."""
    calls = brief.get("calls")
    return max(1, calls) if isinstance(calls, int) and not isinstance(calls, bool) else None


def log_excerpt(context: Context, brief: Mapping[str, Any]) -> LogSlice:
    """The slice of the logs; summed up by a model only where the manifest has one for housekeeping."""
    manifest = context.manifest
    secrets = agent_environment.secrets(context.environ, manifest.variables)
    settings = manifest.housekeeping
    completion = LiteLLMCompletion(settings, context.environ) if settings is not None else None
    found = slice_of(context.layout, duty.since_of(brief), secrets, completion)
    if found.reason:
        context.emit(events.Notice(WATCH, f"the log is not summarised, WATCH gets its newest lines: {found.reason}"))
    return found


def _given(context: Context, known: Artifacts, brief: Mapping[str, Any]) -> Given:
    readings = duty.readings_of(brief)
    log = log_excerpt(context, brief)
    seen = camera_frames(context.layout, context.manifest.perception, readings)
    interface = known.interface or {"tools": []}
    document = {
        "format": 1,
        "host": context.layout.host,
        "since": str(brief.get("since") or "")[:64],
        "readings": readings,
        "failures": duty.failures_of(brief),
        "log": log.text,
        "claims": duty.claims_of(brief),
        "summary": duty.summary_of(brief),
        "devices": device_facts(interface, known.identify),
        "tools": tool_facts(interface),
        "frames": [dict(frame) for frame in seen.frames],
        "perception": seen.perception,
    }
    beside = {**seen.files, **({RAW_LOG: log.raw} if log.raw is not None else {})}
    return Given(document, beside, log.usage, calls_of(brief))


def _prove(context: Context, task: Task, value: Any, found: list[Diagnostic]) -> Verdict:
    """The proof of a report: nothing is run, since the contract has checked all."""
    return Verdict(
        diagnostics=tuple(found),
        value=value,
        digest=digest_of(context, task.stage, value),
        files={"output.json": text_of(value)},
        found=str(value["status"]),
    )
