"""HEAL: an agent reports what fixes one error, and a server that it rewrote is tried before it counts.

The candidate is judged as text, imported where it will be served, published beside the accepted server, and called.
Only one that passes all of that, and does worse nowhere, takes the accepted one's place. What it replaces is kept,
so that it can be taken back when later readings are worse.
"""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from octoform import events
from octoform.apply import duty
from octoform.apply.context import HEALED, Context, accepted
from octoform.apply.repair_outcome import WAITS, RepairOutcome, RepairVerdict
from octoform.apply.rewrite import pending_rewrite, promotion
from octoform.apply.rewrite.pending_rewrite import Rewrite
from octoform.apply.rewrite.review import Reach, objections, reach_of
from octoform.apply.stage.acceptance import Finished, Verdict, artifacts, digest_of, display
from octoform.apply.stage.artifact_writer import text_of
from octoform.apply.stage.assignment import Judge, Prove
from octoform.apply.stage.attempt_loop import fulfil
from octoform.apply.stage.secret_scan import leaked
from octoform.apply.stage.serve_proof import Judge as CheckJudge
from octoform.apply.watch import ALL, Given, assignment, calls_of, cost_of, judge_of, log_excerpt, paid
from octoform.base import digest
from octoform.base.escaping import display as shown_text
from octoform.base.files import move, read_plain, record
from octoform.base.files import parse as parse_json
from octoform.contracts.artifact_parser import MAX_SOURCE_BYTES, parse
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.report_context import device_facts, tool_facts
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.client.check import CheckReport, SampleCallResult, judge_check
from octoform.endpoint.client.check import check as check_endpoint
from octoform.endpoint.expected_tools import display as promised
from octoform.endpoint.process import estop
from octoform.harness.port import Task
from octoform.records import dataclass, replace
from octoform.state.files import make_folders, read_regular, refused, spending, write_atomic
from octoform.state.layout import Layout

# What a repair has replaced, kept for a rollback until it is of no use: one file for each episode, on this machine
# alone.
#
# The copy is written before anything of the artifacts changes, by octoform and not by the agent. Several repairs of one
# episode are one way back: to the server that was accepted when the episode began.

KEEP = 8
DAMAGED = ".damaged"


@dataclass(frozen=True, slots=True)
class Healed:
    """The repair of an incident: digests of the server before it and after it, and the text of the one before."""

    episode: str
    at: str
    tool: str
    base: str
    digest: str
    source: str


def keep(layout: Layout, healed: Healed) -> Diagnostic | None:
    """Write the copy down; None when it is durable. A former repair of the incident keeps its older way back."""
    former = read(layout, healed.episode)
    if former is not None and former.digest == healed.base:
        healed = Healed(healed.episode, healed.at, healed.tool, former.base, healed.digest, former.source)
    problem = make_folders(layout)
    if problem is not None:
        return problem
    folder = layout.local / HEALED
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        stale = sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime)[: -KEEP + 1]
        for path in stale:
            path.unlink(missing_ok=True)
    except OSError as refusal:
        return refused(refusal, folder)
    path = _path(layout, healed.episode)
    return spending(layout, lambda: write_atomic(path, text_of({"format": 1, **asdict(healed)}), 0o600))


def read(layout: Layout, episode: str) -> Healed | None:
    """The repair of an incident; None where there is none, or what is there is not whole (it is moved away then)."""
    path = _path(layout, episode)
    data, _ = read_regular(path)
    if data is None:
        return None
    try:
        fields = record(parse_json(data), 1)
        names = ("episode", "at", "tool", "base", "digest", "source")
        found = Healed(*(str(fields[name]) for name in names))
        whole = found.episode == episode
    except (ValueError, LookupError, TypeError):
        found, whole = None, False
    if found is not None and whole and digest.of_bytes(found.source.encode()) == found.base:
        return found
    move(path, path.with_suffix(DAMAGED))
    return None


def _path(layout: Layout, episode: str) -> Path:
    """An incident's id comes from outside: it is no part of a path."""
    return layout.local / HEALED / f"{digest.short(digest.of_value(episode))}.json"


# What a check of the endpoint means around a repair: compared with before, and not with perfection.
#
# Another tool may be broken too, and its device may be unplugged: that is no reason to refuse a repair, and still less
# to take an endpoint out of service whose other tools work.

HINT = "the accepted server stays in service; octoform attempts -stage heal shows what was tried"


def no_worse(before: CheckReport, repaired: frozenset[str]) -> CheckJudge:
    """For a candidate: what worked ``before`` works, and the tools that it was to fix answer where they are tried."""
    failed = {(call.tool, call.device) for call in before.calls if _failed(call)}
    worked = {(call.tool, call.device) for call in before.calls if call.ok}

    def judge(report: CheckReport, interface: Mapping[str, Any]) -> list[Diagnostic]:
        still = {(tool, device) for tool, device in failed if tool not in repaired}
        calls = tuple(call for call in report.calls if (call.tool, call.device) not in still)
        found = judge_check(replace(report, calls=calls), interface)
        for call in calls:
            if _failed(call) and call.tool in repaired:
                found.append(_problem("HEAL-NOT-HELPED", f"{shown_text(call.tool)} still fails", call))
            elif _failed(call) and (call.tool, call.device) in worked:
                found.append(_problem("HEAL-WORSE", f"{shown_text(call.tool)} worked before and fails now", call))
        return found

    return judge


def _failed(call: SampleCallResult) -> bool:
    return call.skipped is None and not call.ok


def _problem(code: str, summary: str, call: SampleCallResult) -> Diagnostic:
    text = f"{call.error_class}: {call.message}" if call.message else call.error_class
    return error(code, f"with the rewritten server {summary}", detail=text, hint=HINT)


HEAL = "heal"
SERVER = "server.py"
REWRITE = "rewrite"


@dataclass(frozen=True, slots=True)
class Case:
    """One error to be fixed: as WATCH or triage reported it, in which incident, and what a repair of it may touch."""

    episode: str
    target: str
    error: Mapping[str, Any]
    reach: Reach
    known: Artifacts

    @property
    def tool(self) -> str:
        """The tool concerned; empty where it is not known."""
        return str(self.error.get("tool") or "")


@dataclass(frozen=True, slots=True)
class Proposal:
    """An agent's proposal: its output, and the text of the server where it rewrote that."""

    value: dict[str, Any]
    server: str | None


def heal(context: Context, brief: Mapping[str, Any]) -> RepairOutcome:
    """Ask the agent of HEAL and try what it proposes; blocking, and never raises for what an agent does."""
    case = _case(context, brief)
    given = _given(context, case, brief)
    asked = assignment(context, HEAL, given, _judge_of(case, given), _prove_of(case))
    try:
        finished = fulfil(context, asked)
    except BaseException:
        # The proof is no longer awaited: what was only being tried is not left in service.
        promotion.put_back(context, smoke=False)
        raise
    finished = paid(context, HEAL, finished, given)
    if not finished.verdict.accepted:
        return RepairOutcome.of_diagnostics(finished.verdict.diagnostics, cost_of(finished))
    if finished.verdict.rewritten is not None:
        if moves := _actuated(case, finished.verdict.value):
            return _waiting(context, case, finished, ", ".join(moves))
        found = _stopped(context)
        found += (
            promotion.put_back(context, smoke=False) if found else _adopted(context, case, finished.verdict.rewritten)
        )
        if has_errors(found):
            return RepairOutcome.of_diagnostics(found, cost_of(finished))
    return _answer(finished)


def confirm(context: Context, rewrite: Rewrite) -> RepairOutcome:
    """Put a rewrite in service that a person has read; a server that does not come up with it is taken back."""
    known = artifacts(context, ALL, None)
    if known.serve != rewrite.base:
        text = "the server was made again since; the rewrite is of another one"
        return RepairOutcome.refused("confirm.other-server", text, again=False)
    case = Case(rewrite.episode, rewrite.target, {"tool": rewrite.tool}, Reach(frozenset(), ()), known)
    found = [*_stopped(context)]
    found += [] if found else _adopted(context, case, rewrite.source)
    if has_errors(found):
        return RepairOutcome.of_diagnostics(found)
    problem = pending_rewrite.forget(context.layout, rewrite.id)
    note = "" if problem is None else f"; {problem.summary}"
    return RepairOutcome.done("confirm.served", f"the rewrite {rewrite.id} is in service{note}", changed=True)


def roll_back(context: Context, brief: Mapping[str, Any]) -> RepairOutcome:
    """Make the server the accepted one again that an incident's repair has replaced; asking twice does it once."""
    episode, reason = str(brief.get("episode") or ""), str(brief.get("reason") or "")
    healed = read(context.layout, episode)
    now = context.store.snapshot.nodes[promotion.MAKER].output_digest
    if healed is None:
        return RepairOutcome.refused("roll_back.unknown", f"no repair of the incident {episode} is known", again=False)
    if now == healed.base:
        return RepairOutcome.done("roll_back.former", "the former server is the accepted one")
    if now != healed.digest:
        text = "the server was made again since the repair; it stays"
        return RepairOutcome.refused("roll_back.other-server", text, again=False)
    context.emit(events.Notice(HEAL, f"the former server comes back: {reason or 'the repair is taken back'}"))
    found = promotion.adopt(context, HEAL, healed.source, smoke=False)
    if has_errors(found):
        changed = context.store.snapshot.nodes[promotion.MAKER].output_digest != now
        return RepairOutcome.of_diagnostics(found, changed=changed)
    return RepairOutcome.done("roll_back.former", "the former server is the accepted one again", changed=True)


def _actuated(case: Case, value: Mapping[str, Any]) -> tuple[str, ...]:
    """The tools that move something and whose code a rewrite changes."""
    interface = case.known.interface or {"tools": []}
    return pending_rewrite.actuated(str(case.known.serve), interface, frozenset(value["functions"]))


def _waiting(context: Context, case: Case, finished: Finished, moves: str) -> RepairOutcome:
    """The rewrite is kept for a person, and nothing of it was tried."""
    source = str(finished.verdict.rewritten)
    rewrite = Rewrite(
        id=pending_rewrite.identity_of(source),
        episode=case.episode,
        target=case.target,
        tool=case.tool,
        moves=moves,
        at=context.clock.stamp(),
        base=str(case.known.serve),
        source=source,
    )
    problem = pending_rewrite.keep(context.layout, rewrite)
    if problem is not None:
        return RepairOutcome.of_diagnostics([problem], cost_of(finished))
    waits = pending_rewrite.waits(rewrite)
    context.emit(events.Notice(HEAL, f"{waits.summary}: {waits.hint}"))
    found = RepairOutcome.of_diagnostics([waits], cost_of(finished), verdict=RepairVerdict.REFUSED, again=False)
    return found.because(WAITS, str(waits.hint))


def _stopped(context: Context) -> list[Diagnostic]:
    """Why nothing is tried or exchanged now: a person has pulled the brake while the agent was thinking."""
    if not estop.is_engaged(context.layout):
        return []
    hint = "octoform estop -clear opens it; the repair is tried again then"
    return [error("HEAL-ESTOPPED", "an emergency stop was given while the repair was made", hint=hint)]


def _case(context: Context, brief: Mapping[str, Any]) -> Case:
    known = artifacts(context, ALL, None)
    found = brief.get("error")
    cause: Mapping[str, Any] = found if isinstance(found, Mapping) else {}
    device = str(cause.get("device") or "").partition("/")[0] or None
    tool = str(cause["tool"]) if cause.get("tool") else None
    reach = reach_of(str(known.serve), known.interface or {"tools": []}, tool, device)
    return Case(str(brief.get("episode") or ""), str(brief.get("target") or ""), cause, reach, known)


def _given(context: Context, case: Case, brief: Mapping[str, Any]) -> Given:
    interface = case.known.interface or {"tools": []}
    log = log_excerpt(context, brief)
    devices = device_facts(interface, case.known.identify)
    tool = next((item for item in tool_facts(interface) if item["name"] == case.tool), None)
    wanted = str(case.error.get("device") or "").partition("/")[0] or next(iter(tool["devices"] if tool else ()), "")
    document = {
        "format": 1,
        "host": context.layout.host,
        "target": case.target,
        "error": duty.plain(case.error),
        "tool": tool,
        "functions": list(case.reach.functions),
        "device": next((item for item in devices if item["id"] == wanted), None),
        "readings": duty.readings_of(brief),
        "failures": duty.failures_of(brief),
        **_packages(case.known.deploy or {}),
        "log": log.text,
        "server": SERVER,
    }
    return Given(document, {SERVER: str(case.known.serve).encode()}, log.usage, calls_of(brief))


def _packages(deploy: Mapping[str, Any]) -> dict[str, Any]:
    """DEPLOY's packages, and those that it found to be incompatible."""
    packages = [{"name": item["name"], "version": item["version"]} for item in deploy.get("requirements") or ()]
    return {
        "packages": duty.plain(packages),
        "conflicts": duty.plain(list(deploy.get("conflicts") or ())),
    }


def _judge_of(case: Case, given: Given) -> Judge:
    """All that needs nothing but values and text."""
    contract = judge_of(case.known, given)

    def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
        value, found = contract(context, task, data)
        if value is None or has_errors(found):
            return (None if value is None else Proposal(value, None)), found
        if value["action"] != REWRITE:
            return Proposal(value, None), found
        text, more = _rewritten(context, task, case, value)
        return Proposal(value, text), found + more

    return judge


def _rewritten(
    context: Context, task: Task, case: Case, value: Mapping[str, Any]
) -> tuple[str | None, list[Diagnostic]]:
    """The rewritten server, or what is wrong with it as a string."""
    path, known = display(task.workdir / SERVER), case.known
    data = read_plain(task.workdir / SERVER, MAX_SOURCE_BYTES + 1)
    if data is None:
        return None, [error("ARTIFACT-LINK", "the rewritten server is not a separate plain file", path=path)]
    text, found = parse("serve", data, path)
    if not isinstance(text, str):
        return None, found
    if text == known.serve:
        hint = "correct the copy of server.py in the working directory, or write failed"
        return None, [error("HEAL-UNCHANGED", "the rewritten server is the accepted one", path=path, hint=hint)]
    found += leaked(replace(task, stage="serve"), data)
    found += check("serve", text, known, context.schemas, SERVER)
    if has_errors(found):
        return None, found
    deploy = known.deploy or {"imports": []}
    found += objections(str(known.serve), text, case.reach, frozenset(value["functions"]), deploy)
    found += check("deploy", deploy, replace(known, serve=text), context.schemas)
    return text, found


def _prove_of(case: Case) -> Prove:
    """The test: the candidate in the place of the accepted server, compared with how that one does just before."""
    known: list[CheckReport] = []

    def before(context: Context) -> CheckReport:
        if not known:
            context.emit(events.Checking(HEAL, "calling the read tools of the accepted server"))
            known.append(check_endpoint(context.layout, promised(context.layout, accepted(context, "interface"))))
        return known[0]

    def prove(context: Context, task: Task, proposal: Proposal, found: list[Diagnostic]) -> Verdict:
        tries = proposal.server is not None and not _actuated(case, proposal.value)
        if proposal.server is not None and (stopped := _stopped(context)):
            return Verdict((*found, *stopped), last=True)
        if proposal.server is not None and tries:
            judge = no_worse(before(context), case.reach.tools)
            found = [*found, *promotion.offer(context, task, proposal.server, judge)]
        if has_errors(found):
            return Verdict((*found, *promotion.put_back(context, smoke=False)))
        value = proposal.value
        return Verdict(
            diagnostics=tuple(found),
            value=value,
            digest=digest_of(context, task.stage, value),
            files={"output.json": text_of(value)},
            found=f"{value['status']}: {value['action']}",
            rewritten=proposal.server,
        )

    return prove


def _adopted(context: Context, case: Case, source: str) -> list[Diagnostic]:
    """Keep what is replaced, then replace it; a server that does not come up after all is taken back at once."""
    base, text = str(case.known.serve), source
    healed = Healed(
        episode=case.episode,
        at=context.clock.stamp(),
        tool=case.tool,
        base=digest.of_bytes(base.encode()),
        digest=digest.of_bytes(text.encode()),
        source=base,
    )
    problem = keep(context.layout, healed)
    if problem is not None:
        return [problem, *promotion.put_back(context, smoke=False)]
    context.checkpoint("healing.kept")
    context.emit(events.Checking(HEAL, "the rewritten server takes the place of the accepted one"))
    found = promotion.adopt(context, HEAL, text, smoke=False)
    if has_errors(found) and context.store.snapshot.nodes[promotion.MAKER].output_digest == healed.digest:
        found += promotion.adopt(context, HEAL, base, smoke=False)
    return found


def _answer(finished: Finished) -> RepairOutcome:
    verdict = finished.verdict
    value = verdict.value
    made = RepairOutcome.done if value["status"] == "repaired" else RepairOutcome.failed
    return made(
        f"heal.{value['action']}",
        f"{value['status']}: {value['reason']}",
        again=value["status"] == "repaired",
        report=value,
        changed=verdict.rewritten is not None,
        cost=cost_of(finished),
    )
