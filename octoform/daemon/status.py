"""How a deployment is, for a person who asks: from the daemon while it lives and is fresh, else from a look of our own.

A record that outlived its daemon reports how things were, never how they are; so without a daemon everything is looked
at here and now, the reading tools are called, and nothing of it is written down: what the next daemon has not read of
the logs is still new to it.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from octoform.apply.repair_outcome import WAITS
from octoform.base.files import parse
from octoform.base.health_status import FILE, basis, believed
from octoform.claims.ledger import Ledger
from octoform.claims.model import Claim, Signal
from octoform.claims.settings import Settings
from octoform.daemon.health import Health, compose, from_json
from octoform.daemon.model import Cause, Facts, Finding, Kind, Outcome, Repair
from octoform.daemon.notices import Failing, advice, failing
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.observe.observer import open_look
from octoform.daemon.observe.samples import Sensors
from octoform.daemon.signals import current, measured
from octoform.daemon.store import incidents, instance_lock
from octoform.daemon.store.backoff import Backoffs
from octoform.daemon.store.incidents import Incident, described
from octoform.daemon.store.instance_lock import Record
from octoform.daemon.store.json_store import Shelf
from octoform.daemon.store.memory import RECALL
from octoform.daemon.triage import judge, remember
from octoform.daemon.triage.failure_history import Recall
from octoform.daemon.triage.failure_history import from_json as recall_from
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process import record
from octoform.endpoint.process.estop import is_engaged
from octoform.endpoint.process.record import running
from octoform.engine.apply import approval
from octoform.engine.tools import layout_of
from octoform.host import SYSROOT_VARIABLE
from octoform.records import dataclass, field, replace
from octoform.state.files import read_regular
from octoform.state.layout import Layout
from octoform.state.store.lock import myself

_LIMIT = 4_000_000
_FULL = frozenset({Cause.START})


@dataclass(frozen=True, slots=True)
class OpenProblem:
    """One thing that is wrong now. ``episode`` is what the daemon noted of it (None: it was seen just now, by us).

    ``waits`` states why nothing is done about it at the moment, ``do`` is what a person can do, a command where there
    is one; empty where there is nothing to be done.
    """

    target: str
    summary: str
    since: str | None = None
    episode: Incident | None = None
    waits: str = ""
    do: str = ""


@dataclass(frozen=True, slots=True)
class Survey:
    """How a host is. ``watched`` is the daemon that lives; ``looked`` is True where we looked ourselves.

    ``paused`` is since when repairs are paused, empty where that is not known, None when they are not. ``todo`` are
    things that wait for a person and belong to no problem: (command, why). ``untold`` are the notifiers that fail.
    ``recorded`` is the folder of a recorded host.
    """

    health: Health
    watched: Record | None
    looked: bool
    age: float
    problems: tuple[OpenProblem, ...] = ()
    paused: str | None = None
    todo: tuple[tuple[str, str], ...] = ()
    untold: tuple[Failing, ...] = ()
    said: tuple[Diagnostic, ...] = ()
    recorded: str = ""


@dataclass(frozen=True, slots=True)
class _Known:
    """The daemon's stored records, as far as they could be read."""

    shelf: Shelf
    episodes: list[Incident] = field(default_factory=list)
    frozen: Mapping[str, str] = field(default_factory=dict)


def survey(project: Path, environ: Mapping[str, str]) -> tuple[Survey | None, list[Diagnostic]]:
    """How the manifest's host is now; None with the reasons where the project itself cannot be read."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    known = _known(layout)
    watched = instance_lock.alive(layout)
    # A daemon that can write nothing down any more has left what was true before.
    heard = watched is not None and os.access(layout.daemon, os.W_OK)
    result = _bulletin(layout) if heard else None
    if result is None:
        health, troubles = _looked(layout, environ, known)
        age = 0.0
    else:
        health, age, waits = result
        troubles = [_of_episode(each, known, waits.get(each.key, "")) for each in known.episodes if not each.over]
    paused = instance_lock.paused_since(layout)
    made = Survey(
        health,
        watched,
        looked=result is None,
        age=age,
        problems=tuple(troubles),
        paused=paused,
        todo=tuple(_todo(layout, health, watched, paused)),
        untold=failing(layout),
        said=tuple(known.shelf.said),
        recorded=environ.get(SYSROOT_VARIABLE) or "",
    )
    return made, found


def _known(layout: Layout) -> _Known:
    shelf = Shelf(layout)
    if not layout.daemon.is_dir():
        return _Known(shelf)
    breakers = Backoffs(shelf, myself().boot_id)
    breakers.load(SystemClock().uptime())
    frozen = {each.key: each.frozen or "" for each in breakers.frozen()}
    return _Known(shelf, incidents.read(shelf), frozen)


def _bulletin(layout: Layout) -> tuple[Health, float, dict[str, str]] | None:
    """The living daemon's last status, its age in seconds, and why repairs wait; None where it is not fresh."""
    data, _ = read_regular(layout.daemon / FILE, _LIMIT)
    try:
        document = parse(data or b"")
        health = from_json(document)
        waits = {str(key): str(why) for key, why in document.get("waits", {}).items()}
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError):
        return None
    now, process = SystemClock().uptime(), running(layout)
    instance = process.instance if process is not None else None
    here = basis(instance, stopped=record.read(layout) is not None, engaged=is_engaged(layout))
    if health.host != layout.host or believed(document, now, here) is None:
        return None
    return health, now - health.uptime, waits


def _looked(layout: Layout, environ: Mapping[str, str], known: _Known) -> tuple[Health, list[OpenProblem]]:
    clock = SystemClock()
    facts = open_look(layout, environ, clock, traceless=True)(_FULL)
    recall = remember(_recall(known.shelf), facts)
    ledger = Ledger.open(layout, clock, Settings()) if layout.daemon.is_dir() else Ledger(layout, clock, Settings())
    readings = Sensors(layout, ledger.make)() if facts.process is not None and facts.answers else ()
    # Where a device was last is the daemon's own record: the runtime finds the device anyway, and its tools work.
    found = judge(facts, None, recall, readings, known.frozen)
    findings = [each for each in found if each.repair is not Repair.REBIND]
    claims: tuple[Claim, ...] = ()
    expected: Iterable[Signal] = ()
    if layout.daemon.is_dir():
        claims = (*ledger.active(), *ledger.pending())
        expected = measured(current(ledger.latest(), layout), ledger.readings_of)
    lasting = _lasting(findings, known, facts)
    health = compose(facts, lasting, claims, readings, expected if facts.process is not None else ())
    troubles = [_of_episode(each, known, "") if each.opened else _of_finding(each) for each in lasting]
    return health, troubles


def _lasting(findings: Iterable[Finding], known: _Known, facts: Facts) -> list[Incident]:
    """The problems that our own look finds, each with what the daemon noted of it; and what only an agent knows of."""
    noted = {each.key: each for each in known.episodes if not each.over}
    seen = {each.key: noted.get(each.key) or _episode(each) for each in findings}
    if facts.busy is not None:  # while somebody works on the host nothing is judged
        return [*seen.values(), *(each for key, each in noted.items() if key not in seen)]
    return [*seen.values(), *(each for key, each in noted.items() if key not in seen and each.by == "watch")]


def _episode(finding: Finding) -> Incident:
    """A problem that no one has noted: it has no beginning."""
    person = finding.repair is Repair.PERSON
    return Incident(
        id="",
        kind=finding.kind,
        fault=finding.fault,
        target=finding.target,
        key=finding.key,
        boot="",
        opened="",
        opened_uptime=0.0,
        outcome=Outcome.SURFACED if person else Outcome.OPEN,
        hint=finding.detail if person else "",
        **described(finding),
    )


def incident(project: Path, environ: Mapping[str, str], name: str) -> tuple[OpenProblem | None, list[Diagnostic]]:
    """One incident of the manifest's host, by its id or the number in it; None with the reasons where there is none.

    ``waits`` and ``do`` of one that is over are empty.
    """
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    known = _known(layout)
    episode = next((each for each in known.episodes if name in (each.id, each.id.removeprefix("e"))), None)
    if episode is None:
        last = f"the latest is {known.episodes[-1].id}" if known.episodes else "there is none"
        hint = f"octoform incidents lists them; {last}"
        return None, [error("DAEMON-NO-SUCH-INCIDENT", f"no incident {name[:40]} is kept", hint=hint)]
    if episode.over:
        return OpenProblem(episode.target, episode.summary, episode.opened, episode), known.shelf.said
    watched = instance_lock.alive(layout) is not None
    heard = _bulletin(layout) if watched else None
    waits = heard[2].get(episode.key, "") if heard is not None else ""
    made = _of_episode(episode, known, waits or ("" if watched else "no daemon runs (octoform watch)"))
    last_word = (
        next((each.text for each in episode.tries[-1].reasons if each.rule == WAITS), "") if episode.tries else ""
    )
    return (replace(made, do=last_word) if last_word else made), known.shelf.said


def _of_episode(episode: Incident, known: _Known, waits: str) -> OpenProblem:
    frozen = known.frozen.get(episode.key)
    do = "put it back" if episode.kind is Kind.DEVICE_GONE else ""
    if frozen is not None or episode.outcome is Outcome.FROZEN:
        waits = f"given up: {frozen or episode.hint.partition('; ')[0] or 'its tries did not help'}"
        do = advice(episode.kind, episode.target)
    elif episode.outcome is Outcome.SURFACED:
        waits = "nothing repairs this by itself"
        do = episode.hint or f"look at it, then: octoform heal -retry {episode.target}"
    return OpenProblem(episode.target, episode.summary, episode.opened, episode, waits, do)


def _of_finding(episode: Incident) -> OpenProblem:
    do = episode.hint if episode.outcome is Outcome.SURFACED else ""
    do = do or ("put it back" if episode.kind is Kind.DEVICE_GONE else "")
    waits = "no one watches, so nothing is done about it"
    return OpenProblem(episode.target, episode.summary, None, episode, waits, do)


def _recall(shelf: Shelf) -> Recall:
    """Which tools failed and have not worked since, as the last daemon knew it; nothing where there was none."""
    try:
        return recall_from(shelf.read(RECALL)["recall"])
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError):
        return Recall()


def _todo(layout: Layout, health: Health, watched: Record | None, paused: str | None) -> Iterator[tuple[str, str]]:
    if not layout.endpoint.is_dir():
        yield "octoform apply", "nothing is applied yet"
        return
    if record.is_marked(layout):
        yield "octoform start", "a person stopped the endpoint"
    if is_engaged(layout):
        yield "octoform estop -clear", "the emergency stop is engaged"
    if paused is not None:
        yield "octoform resume", "a person paused repairs"
    for name in health.pending:
        why = next((each.why for each in health.parts if each.why.startswith(f"{name} ")), "it waits for a person")
        yield f"octoform confirm {name}", why.removeprefix(f"{name} ")
    question = approval.read(layout)
    if question is not None:
        yield "octoform apply", f"takes up the hardware that changed; not done by itself: {'; '.join(question.why)}"
    if watched is None:
        yield "octoform watch", "no one watches: what breaks now stays broken"
