"""The gate of a privileged step: its artifact, a server that it rewrote, and then the trials on the hardware itself.

Cheap judgement comes first: schema and rules, then the rewritten server as text, its import, the endpoint with it.
Only what passes all of that may move anything.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from octoform import events
from octoform.apply import adopting
from octoform.apply.assignment import Judge, Prove
from octoform.apply.confining import beyond, others, own_tools
from octoform.apply.context import Context
from octoform.apply.gate import Verdict, digest_of, fresh, read_value, shown
from octoform.apply.hand import Hand, LiveHand
from octoform.apply.leaks import leaked
from octoform.apply.settling import counted, text_of
from octoform.apply.sights import by_frame, by_view
from octoform.apply.trials import Bench, Tried, by_reading
from octoform.contracts.checking import check
from octoform.contracts.model import Artifacts
from octoform.contracts.parsing import MAX_SOURCE_BYTES, parse
from octoform.contracts.text import pointer
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.harness.plainfile import read_plain
from octoform.harness.port import Task
from octoform.protocol.steps import READING, Step
from octoform.state.files import write_atomic

SERVER = "server.py"
TRIALS = "trials.json"
PICTURES = "pictures"


@dataclass(frozen=True, slots=True)
class Proposal:
    """What an agent proposes: the artifact, and the text of the server where it rewrote that."""

    value: dict[str, Any]
    server: str | None


def judge_of(known: Artifacts) -> Judge:
    """The judge of a step's output: all that needs nothing but values and text."""

    def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
        value: Any
        value, found = read_value(task, data)
        if value is None:
            return None, found
        found += check(task.stage, value, known, context.schemas, shown(task.output))
        if has_errors(found) or value["server"] is None:
            return Proposal(value, None), found
        text, more = _rewritten(context, task, known, value)
        return Proposal(value, text), found + more

    return judge


def prove_of(step: Step, known: Artifacts, hand: Callable[[Context], Hand] | None = None) -> Prove:
    """The proof of a step: the trials, through the live endpoint unless a test gives another hand."""

    def prove(context: Context, task: Task, proposal: Proposal, found: list[Diagnostic]) -> Verdict:
        if proposal.server is not None:
            found = [*found, *adopting.offer(context, task, proposal.server)]
        if has_errors(found):
            return Verdict((*found, *adopting.put_back(context)))
        tools = {tool["name"]: tool for tool in (known.interface or {"tools": []})["tools"]}
        means = hand(context) if hand is not None else LiveHand(context.layout)
        bench = Bench(step.proof, means, tools, context.clock, fresh(task.workdir / PICTURES))
        tried = list(carried_out(context, step, bench, proposal.value))
        problem = write_atomic(task.workdir / TRIALS, text_of({"format": 1, "trials": [one.told() for one in tried]}))
        found = [*found, *([problem] if problem is not None else []), *(item for one in tried for item in one.found)]
        if has_errors(found):
            return Verdict((*found, *adopting.put_back(context)))
        return _accepted(context, step, proposal, tried, found)

    return prove


def carried_out(context: Context, step: Step, bench: Bench, value: Mapping[str, Any]) -> Iterator[Tried]:
    """Each trial in turn; ends where no further one makes sense."""
    if value["camera"] is not None:
        context.emit(events.Checking(step.node, f"looking through {value['camera']['device']}"))
        one = by_frame(bench, value["camera"])
        context.emit(events.StepTried(step.node, one.unit, not has_errors(one.found), told(step, one)))
        yield one
        return
    way = by_reading if step.proof.kind == READING else by_view
    for index, trial in enumerate(value["trials"]):
        context.emit(events.Checking(step.node, f"moving {trial['unit']} with {trial['move']['tool']}, and back"))
        one = way(bench, trial, pointer("trials", index))
        if one.over and not has_errors(one.found):
            hint = "the emergency stop was given, or the endpoint went away, while the units were tried; apply again"
            one.blame(
                "STEP-CALL-REFUSED", "the trials ended early: no call is taken now", pointer("trials", index), hint=hint
            )
        context.emit(events.StepTried(step.node, one.unit, not has_errors(one.found), told(step, one)))
        yield one
        if one.over:
            return


def told(step: Step, tried: Tried) -> str:
    """What a trial showed, on one line: the readings, the differences of the pictures, or why there is nothing."""
    if has_errors(tried.found):
        return next(item.summary for item in tried.found if item.severity == "error")
    if tried.moved is not None and tried.returned is not None:
        seen = f"the picture differs by {tried.moved:g} after the move, by {tried.returned:g} after the way back"
        return f"{seen}, by {tried.noise or 0:g} while nothing moves"
    if tried.before is not None and tried.after is not None and tried.back is not None:
        return f"{tried.before:g} -> {tried.after:g} -> {tried.back:g} {step.proof.unit}".rstrip()
    return f"{tried.tool} shows something"


def _rewritten(
    context: Context, task: Task, known: Artifacts, value: Mapping[str, Any]
) -> tuple[str | None, list[Diagnostic]]:
    """The rewritten server, or what is wrong with it; None when it is the accepted one, byte for byte."""
    path = shown(task.workdir / SERVER)
    data = read_plain(task.workdir / SERVER, MAX_SOURCE_BYTES + 1)
    if data is None:
        return None, [error("ARTIFACT-LINK", "the rewritten server is not a plain file of its own", path=path)]
    text, found = parse("serve", data, path)
    if not isinstance(text, str) or text == known.serve:
        return None, found
    found += leaked(replace(task, stage="serve"), data)
    found += check("serve", text, known, context.schemas, SERVER)
    if has_errors(found):
        return None, found
    device = value["device"] or (value["camera"] or {}).get("device", "")
    deploy = known.deploy or {"imports": []}
    interface = known.interface or {"tools": []}
    found += beyond(str(known.serve), text, own_tools(interface, device), deploy, others(interface, device))
    found += check("deploy", deploy, replace(known, serve=text), context.schemas)
    return text, found


def _accepted(context: Context, step: Step, proposal: Proposal, tried: list[Tried], found: list[Diagnostic]) -> Verdict:
    value = proposal.value
    said = counted(len(value["trials"]), "unit") + " moved" if value["trials"] else f"camera {tried[0].unit}"
    said += f", {len(value['skipped'])} skipped" if value["skipped"] else ""
    said += ", with a rewritten server" if proposal.server is not None else ""
    trials = [{name: part for name, part in one.told().items() if name != "readings"} for one in tried]
    return Verdict(
        diagnostics=tuple(found),
        value=value,
        digest=digest_of(context, step.node, value),
        files={"output.json": text_of(value)},
        found=said,
        detail={"device": value["device"] or tried[0].unit, "trials": trials, "skipped_units": value["skipped"]},
        rewritten=proposal.server,
    )
