"""How a deployment is, for a person who was woken by it: one line that states it, then what is wrong and what to do.

What is stated of each problem stands always in the same order: what, since when, what was tried, why nothing is tried
now, the command that shows all reasons, and the command that helps.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from itertools import groupby
from textwrap import wrap
from typing import Any

from octoform.apply.repair_outcome import Cost, RepairOutcome, RepairVerdict
from octoform.base.clock import parse_stamp
from octoform.base.escaping import escaped_json
from octoform.base.health_status import ORDER, Status
from octoform.daemon.health import Health, Part
from octoform.daemon.model import Outcome, Repair
from octoform.daemon.notices import Failing
from octoform.daemon.status import OpenProblem, Survey
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.incidents import to_json as episode_json
from octoform.diagnostics import Diagnostic, to_json
from octoform.views.daemon.event_log import EXIT, named, seconds_of
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import ago, clock, length, one_line, spent
from octoform.views.plan_text import counted, recorded

UNTOLD = "DAEMON-NOT-NOTIFIED"
"""The page on a way of telling that fails."""
STYLES = {
    Status.HEALTHY: ("green",),
    Status.DEGRADED: ("yellow",),
    Status.ERROR: ("red",),
    Status.DOWN: ("red", "bold"),
    Status.UNKNOWN: ("yellow",),
}
MAX_LENGTH = 110
"""Columns that a person reads in one go, however wide the terminal is."""
MAX_CHARACTERS = 400
"""Most characters of one problem's text about one target."""
MAX_LINES = 12
"""Problems, and silent signals, that are shown; the rest is counted."""


def health(console: Console, found: Survey, *, as_json: bool, now: datetime | None = None) -> int:
    """The exit code states it too: `EXIT`. ``now`` is what times are counted from."""
    if as_json:
        console.raw(escaped_json(json.dumps(document(found), ensure_ascii=False, indent=2)))
        return EXIT[found.health.status]
    now = now or datetime.now(UTC)
    problems.show(console, found.said)
    _first(console, found, now)
    if found.recorded:
        console.wrapped("  ", recorded(found.recorded), indent=4)
    troubles = sorted(found.problems, key=_rank)
    for trouble in troubles[:MAX_LINES]:
        console.line()
        for line in _problem_lines(console, trouble, now):
            console.line(line)
    if len(troubles) > MAX_LINES:
        console.line(f"\n  and {len(troubles) - MAX_LINES} more: octoform incidents")
    for block in (_beside(console, found), _silent(console, found), _todo(console, found)):
        lines = list(block)
        if lines:
            console.line()
            for line in lines:
                console.line(line)
    console.line()
    for line in _basis(console, found, now):
        console.line(console.paint(line, "dim"))
    return EXIT[found.health.status]


def document(found: Survey) -> dict[str, Any]:
    """All of it as data; the format of ``octoform health -json``."""
    watched = found.watched
    return {
        **found.health.as_json(),
        "looked": found.looked,
        "age_seconds": round(found.age, 1),
        "watched": None
        if watched is None
        else {"pid": watched.process.pid, "since": watched.since, "octoform": watched.version},
        "paused": found.paused,
        "troubles": [
            {
                "target": each.target,
                "summary": each.summary,
                "since": each.since,
                "waits": each.waits,
                "do": each.do,
                "episode": episode_json(each.episode) if each.episode is not None and each.episode.id else None,
            }
            for each in found.problems
        ],
        "todo": [{"command": command, "why": why} for command, why in found.todo],
        "recorded": bool(found.recorded),
        "untold": [asdict(each) for each in found.untold],
        "diagnostics": [to_json(problems.near(item)) for item in found.said],
    }


def _first(console: Console, found: Survey, now: datetime) -> None:
    """The line that has to be enough: the host, one word, since when, and the first reason."""
    status = found.health.status
    word = console.paint(str(status) if status is Status.HEALTHY else str(status).upper(), *STYLES[status])
    worst = _worst(found)
    trouble = next((each for each in found.problems if worst is not None and each.target == worst.target), None)
    if worst is None:
        return console.line(f"{found.health.host}: {word}")
    since = _since(trouble.since if trouble is not None else None, now)
    lead = f"{found.health.host}: {word}{f' {since}' if since else ''}: "
    return console.wrapped(lead, one_line(_what(worst), MAX_CHARACTERS), indent=4)


def _worst(found: Survey) -> Part | None:
    """The content of the first line."""
    return next((part for part in found.health.parts if part.status is found.health.status), None)


def _what(part: Part) -> str:
    """The problem, with the target's name where the sentence does not have it."""
    return named(part.target, part.why)


def _rank(problem: OpenProblem) -> tuple[int, bool, str]:
    """The worst first, of these what waits for a person."""
    episode = problem.episode
    if episode is None:
        return 0, True, ""
    return -ORDER.index(episode.status), episode.outcome is Outcome.OPEN, problem.since or ""


def _wrapped(console: Console, head: str, text: str) -> Iterator[str]:
    """A string behind a head that is indented; foreign text, so it is bounded."""
    width = min(MAX_LENGTH, console.width)
    lines = wrap(one_line(text, MAX_CHARACTERS), max(30, width - len(head)), break_on_hyphens=False) or [""]
    yield f"{head}{lines[0]}"
    yield from (f"{' ' * len(head)}{line}" for line in lines[1:])


def _since(stamp: str | None, now: datetime) -> str:
    if not stamp:
        return ""
    passed = ago(stamp, now)
    return f"since {clock(stamp, now)}{f' ({passed})' if passed else ''}"


def _problem_lines(console: Console, problem: OpenProblem, now: datetime) -> Iterator[str]:
    episode = problem.episode
    style = STYLES[episode.status] if episode is not None else ("yellow",)
    yield f"  {console.paint(one_line(problem.target, 100), *style)}"
    yield from _wrapped(console, "    ", problem.summary)
    if problem.since:
        yield f"    since  {_since(problem.since, now).removeprefix('since ')}"
    if episode is not None and episode.tries:
        yield from _wrapped(console, "    tried  ", _tried(problem, now))
    if problem.waits:
        yield from _wrapped(console, "    now    ", problem.waits)
    if episode is not None and episode.outcomes:
        yield f"    why    octoform incidents show {episode.id}"
    if problem.do:  # a command is not broken: it is copied
        yield f"    do     {console.paint(one_line(problem.do, MAX_CHARACTERS), 'bold')}"


def _tried(problem: OpenProblem, now: datetime) -> str:
    """``restart 3 times, rebuild; the last one 2 min ago failed: no such file``."""
    tries = problem.episode.tries if problem.episode is not None else []
    counts: dict[str, int] = {}
    for each in tries:
        counts[each.repair] = counts.get(each.repair, 0) + 1
    names = ", ".join(name if count == 1 else f"{name} {count} times" for name, count in counts.items())
    last = tries[-1]
    passed = ago(last.at, now)
    how = "failed" if not last.ok else "said" if last.repair == Repair.WATCH else "reported success"
    return f"{names}; the last one{f' {passed} ago' if passed else ''} {how}{f': {last.detail}' if last.detail else ''}"


def _beside(console: Console, found: Survey) -> Iterator[str]:
    """Unhealthy parts without a problem of their own: a device that is not there, a claim, a person's stop."""
    names = {each.target for each in found.problems}
    parts = [each for each in found.health.parts if each is not _worst(found)]
    shown = [each for each in parts if each.target not in names and not each.target.startswith("unit:")]
    for part in shown[:MAX_LINES]:
        yield from _wrapped(console, "  ", _what(part))
    if len(shown) > MAX_LINES:
        yield f"  and {len(shown) - MAX_LINES} more: octoform health -json"


def _silent(console: Console, found: Survey) -> Iterator[str]:
    """Units without data, with the reason where there is one."""
    names = found.health.uncovered
    if not names:
        return
    why = {part.target.removeprefix("unit:"): part.why for part in found.health.parts}
    yield f"  cannot report ({len(names)}), so nothing is known of it:"
    for name in names[:MAX_LINES]:
        reason = why.get(name, "").removeprefix("does not report: ")
        yield from _wrapped(console, f"    {one_line(name, 60)}  ", reason)
    if len(names) > MAX_LINES:
        yield f"    and {len(names) - MAX_LINES} more: octoform health -json"


def _todo(console: Console, found: Survey) -> Iterator[str]:
    """Requests to a person that belong to no problem."""
    todo = [(one_line(command, MAX_LENGTH), why) for command, why in found.todo]
    width = max((len(command) for command, _ in todo), default=0)
    for command, why in todo:
        yield f"  {console.paint(command.ljust(width), 'bold')}  {one_line(why, MAX_LENGTH)}"


def _basis(console: Console, found: Survey, now: datetime) -> Iterator[str]:
    """The basis of the view: who looked, when, and how many signals report."""
    claims = f"; claims in force: {_names(found.health.claims)} (octoform claims)" if found.health.claims else ""
    yield f"  {_reporting(found.health)}{claims}"
    if found.watched is None:
        yield "  looked at just now by this command"
    elif found.looked:
        yield f"  looked at just now by this command: the daemon (process {found.watched.process.pid}) is behind"
    else:
        since = clock(found.watched.since, now)
        yield f"  watched by process {found.watched.process.pid} since {since}; last look {length(found.age)} ago"
    for each in found.untold:
        yield from _wrapped(console, "  ", _failing_text(each, now))
    if found.untold:
        yield f"  octoform explain {UNTOLD}  what can be done about that"


def _failing_text(each: Failing, now: datetime) -> str:
    """A way of telling that fails."""
    lost = counted(each.lost, "message")
    return f"no one was notified by the {each.way} since {clock(each.since, now)} ({lost} lost): {each.why}"


def _reporting(health: Health) -> str:
    """How many signals are read; that there is none is no fault, but a person should know what is not looked at."""
    if health.status is Status.DOWN:
        return "no signal is read while the endpoint is down"
    if not health.covered and not health.uncovered:
        return "no signal is read: process, files and devices are looked at"
    return f"{counted(health.covered, 'signal')} {'reports' if health.covered == 1 else 'report'}"


def _names(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


# One incident: what was noticed, each repair that was considered with the reasons of its outcome, what is left to do.

_VERDICTS = {
    RepairVerdict.DONE: "green",
    RepairVerdict.REFUSED: "yellow",
    RepairVerdict.FAILED: "red",
    RepairVerdict.ROLLED_BACK: "red",
}
_PASSIVE = {
    Repair.WAIT.value: "none: only the hardware can change it",
    Repair.PERSON.value: "a person",
}
_ENDS = {
    Outcome.OPEN: "lasts",
    Outcome.FROZEN: "given up",
    Outcome.SURFACED: "waits for a person",
    Outcome.REPAIRED: "repaired",
    Outcome.CLEARED: "resolved by itself",
}
HEAD, MAX_RULE = 12, 26
"""Columns of a heading, and of the rules of reasons at most."""


def incident(
    console: Console,
    found: OpenProblem,
    diagnostics: Sequence[Diagnostic],
    *,
    as_json: bool,
    now: datetime | None = None,
) -> int:
    """The whole of an incident, in the order in which it went; ``now`` is what times are counted from."""
    episode = found.episode
    assert episode is not None
    if as_json:
        whole = {**episode_json(episode), "seconds": seconds_of(episode)}
        shown = {"format": 1, "episode": whole, "waits": found.waits, "do": found.do}
        console.raw(escaped_json(json.dumps(shown, ensure_ascii=False, indent=2)))
        return 0
    problems.show(console, diagnostics)
    for line in _incident_lines(console, found, episode, now or datetime.now(UTC)):
        console.line(line)
    return 0


def _incident_lines(console: Console, found: OpenProblem, episode: Incident, now: datetime) -> Iterator[str]:
    style = STYLES[Status.HEALTHY if episode.over else episode.status]
    took = seconds_of(episode)
    times = f" after {length(took)}" if took is not None else "" if episode.over else f" {_since(episode.opened, now)}"
    yield from _wrapped(console, f"incident {episode.id}: ", named(episode.target, episode.summary))
    yield f"  {console.paint(_ENDS[episode.outcome], *style)}{times}"
    yield ""
    for head, text in _noticed(episode, now):
        yield from _wrapped(console, f"  {head:{HEAD}}", text)
    rules = [len(reason.rule) for outcome in episode.outcomes for reason in outcome.reasons]
    if episode.outcomes:
        yield ""
    for outcome in episode.outcomes:
        yield from _outcome_lines(console, outcome, parse_stamp(episode.opened), min(MAX_RULE, max(rules, default=0)))
    lines = list(_left(found, episode))
    if lines:
        yield ""
    for head, text in lines:
        if head in ("to do", ""):  # a command is not broken: it is copied
            yield f"  {head:{HEAD}}{console.paint(one_line(text, MAX_CHARACTERS), 'bold')}"
        else:
            yield from _wrapped(console, f"  {head:{HEAD}}", text)


def _noticed(episode: Incident, now: datetime) -> Iterator[tuple[str, str]]:
    """What was seen, and the repairs that there are for it."""
    because = f" ({', '.join(episode.causes)})" if episode.causes else ""
    yield "about", episode.target
    yield "noticed", f"{clock(episode.opened, now)} by {episode.by}{because}: {episode.kind.replace('_', ' ')}"
    if episode.evidence:
        yield "evidence", "; ".join(episode.evidence)
    yield "considered", _chain(episode.chain)
    if (diagnosis := episode.diagnosis) is not None:
        yield "diagnosis", f"by WATCH, {diagnosis.fault.replace('_', ' ')}: {diagnosis.summary}"
        yield "considered", _chain((diagnosis.repair.value, *diagnosis.then))


def _chain(names: Sequence[str]) -> str:
    counts = [(_PASSIVE.get(name, name), len(list(same))) for name, same in groupby(names)]
    return ", then ".join(f"{name} up to {count} times" if count > 1 else name for name, count in counts)


def _outcome_lines(console: Console, outcome: RepairOutcome, day: datetime | None, width: int) -> Iterator[str]:
    """When and what, how it ended and what it cost; below it one line for each reason, behind its rule.

    ``day`` is the one that the incident began on, which no line repeats.
    """
    verdict = console.paint(outcome.verdict.replace("_", " "), _VERDICTS.get(outcome.verdict, "dim"))
    facts = [f"in {length(outcome.seconds)}"] if outcome.seconds is not None else []
    facts += [_cost(outcome.cost)] if outcome.cost is not None and outcome.cost.calls else []
    what = f"{outcome.repair} {verdict}" if outcome.repair not in _PASSIVE else verdict
    yield f"  {clock(outcome.at, day)}  {what} {', '.join(facts)}".rstrip()
    for reason in outcome.reasons:
        rule = one_line(reason.rule, 60)
        first, *more = _wrapped(console, f"    {rule:{width}}  ", reason.text)
        yield f"    {console.paint(rule, 'dim')}{first[4 + len(rule) :]}"
        yield from more


def _cost(cost: Cost) -> str:
    return f"{counted(cost.calls, 'agent call')} ({spent(cost.input_tokens, cost.output_tokens, cost.usd)})"


def _left(found: OpenProblem, episode: Incident) -> Iterator[tuple[str, str]]:
    """What was not reached, what it cost, how it stands, and what a person can do."""
    known = {each.repair for each in episode.outcomes} | _PASSIVE.keys()
    if rest := [name for name in dict.fromkeys(episode.chain) if name not in known]:
        yield "not tried", ", ".join(rest)
    if episode.spent.calls:
        yield "cost", _cost(episode.spent)
    if found.waits:
        yield "now", found.waits
    if not episode.over:
        yield "to do", found.do or "nothing: the daemon goes on by itself"
        for code in dict.fromkeys(each.rule for made in episode.outcomes for each in made.reasons):
            if code.isupper():
                yield "", f"octoform explain {code}"
