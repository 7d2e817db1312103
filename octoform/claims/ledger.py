"""The ledger of claims: what is believed of the deployment, why, and until when. Several processes may use it. Light.

Every public operation takes the ledger's lock, reads what another process changed, does its work and writes it down
before it answers. A claim is in force only while the reading that carries it is fresh; a reading that contradicts it
ends it at once, no matter who made it. What a person made true ends by a person alone.
"""

import contextlib
import copy
import itertools
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from octoform.base.escaping import escaped
from octoform.base.files import private_folder
from octoform.base.locks import acquire, lock_file
from octoform.base.processes import PROC
from octoform.claims import codec, lifecycle
from octoform.claims.admission import Level, Proposal, Verdict, View, judge, outranked, problem_of
from octoform.claims.codec import EVIDENCE, SECONDS, Book
from octoform.claims.lifecycle import ENDED, Moment, as_ended, carried, in_force, waiting
from octoform.claims.model import Channel, Claim, Condition, Reading, Signal, State, Value, holds
from octoform.claims.readings import Readings, to_json
from octoform.claims.settings import Clock, Settings
from octoform.conditions import is_number
from octoform.diagnostics import Diagnostic, error, warning
from octoform.records import replace
from octoform.state.files import display
from octoform.state.layout import Layout
from octoform.state.store.lock import myself

# The ledger's diagnostics when it does not do what it was asked, and when somebody has changed its files. Light.


def over_problem(claim: Claim) -> Diagnostic:
    """A pending claim has no fresh reading."""
    return error(
        "CLAIM-STALE",
        f"no reading of the last time bears {claim.id} out any more",
        hint="wait for a reading of its signal, then confirm it",
    )


def unknown_problem(identity: str, how: str) -> Diagnostic:
    """No claim of that id is in such a state."""
    text = f"there is no claim {escaped(identity)[:60]} {how}"
    return error("CLAIM-NOT-FOUND", text, hint="octoform claims shows them")


def taken_problem(path: Path) -> Diagnostic:
    """Another process stands still with the lock."""
    text = "the ledger of claims cannot be locked: another process holds it and does not continue"
    return error("CLAIM-LEDGER-LOCK", text, path=str(path), hint="end that process; fuser shows which one it is")


def no_decider() -> Diagnostic:
    """A decision without a name."""
    return error("CLAIM-NO-PERSON", "no one answers for it", hint="give your name")


def changed_problem(path: Path) -> Diagnostic:
    """A file of the ledger was changed while no one but the daemon may."""
    return warning(
        "CLAIM-LEDGER-CHANGED",
        "the ledger of claims was changed by somebody else while an agent was at work; it is as it was before",
        path=display(path),
        hint="octoform claims and octoform confirm record what a person decides",
    )


CLAIMS, READINGS, LOCK = "claims.json", "readings.jsonl", "claims.lock"
TEXT_CHARS = 300
PATIENCE = 2.0
"""Seconds to wait for anyone who has the lock, and between two looks. Everybody lets go of it in a moment."""
_UNSEEN = (-1, -1, -1)
_NOWHERE = Signal(Channel.LOG, "", "")


class Ledger:
    """The ledger of one host; made with `Ledger.open`.

    ``said`` holds what was wrong with its files; `new_diagnostics` empties it. While ``guarded`` is set, or the
    settings say so, no other process may change it; ``strange`` counts how often one did so all the same.
    """

    def __init__(self, layout: Layout, clock: Clock, settings: Settings) -> None:
        self._layout, self._clock, self._settings = layout, clock, settings
        self._boot = settings.boot or myself(PROC).boot_id
        self._readings = Readings(layout.daemon / READINGS, self._boot)
        self._path, self._lock = layout.daemon / CLAIMS, layout.daemon / LOCK
        self._book = Book()
        self._seen: tuple[int, int, int] | None = _UNSEEN
        self._unwritten = False
        self._alone = self._standing_still = False
        self._run, self._made = os.urandom(3).hex(), itertools.count(1)
        self.said: list[Diagnostic] = []
        self.guarded, self.strange = False, 0

    @classmethod
    def open(cls, layout: Layout, clock: Clock, settings: Settings) -> "Ledger":
        """The ledger of a host, empty when there is none yet; what is wrong with it is in ``said``."""
        ledger = cls(layout, clock, settings)
        with ledger._held():
            return ledger

    def new_diagnostics(self) -> tuple[Diagnostic, ...]:
        """The diagnostics about the ledger's files since the last call."""
        found, self.said = tuple(dict.fromkeys(self.said)), []
        return found

    def use(self, settings: Settings) -> None:
        """Go on with other settings: the manifest or the tools changed. Claims in force are held to them at once."""
        self._settings = replace(settings, boot=self._boot)
        with self._held():
            before = self._copy()
            lifecycle.trust(self._book, True, self._moment())
            self._keep(before, publish=True)

    def make(self, signal: Signal, value: Value, why: str = "") -> Reading:
        """A reading of now, with an id of its own; `record` makes it evidence. What is no finite number is no value.

        May be called from any thread; everything else is for one alone.
        """
        if isinstance(value, float) and not is_number(value):
            value, why = None, f"{value} is no number"
        elif isinstance(value, str):
            value = value[:TEXT_CHARS]
        identity = f"r{self._run}-{next(self._made)}"
        return Reading(identity, self._clock.stamp(), self._clock.uptime(), signal, value, why[:TEXT_CHARS])

    def record(self, readings: Iterable[Reading]) -> tuple[Claim, ...]:
        """Remember readings; the claims that they ended come back, those that they bear out hold on."""
        given = tuple(readings)
        with self._held():
            before, moment = self._copy(), self._moment()
            self.said.extend(self._readings.add(given, self._cited()))
            for reading in sorted(given, key=lambda each: each.uptime):
                lifecycle.weigh(self._book, reading, moment)
            return self._keep(before)

    def propose(self, proposal: Proposal, by: str) -> Claim | Diagnostic:
        """Judge a claim of ``by`` (``watch``, ``heal`` or ``person``).

        An active claim is believed from now on; a pending one waits for a person (``data["because"]`` is the code,
        ``data["words"]`` a sentence). A diagnostic states why it is not believed.
        """
        if (malformed := problem_of(proposal)) is not None:
            return malformed
        with self._held():
            before = self._copy()
            lifecycle.expire(self._book, self._moment())
            verdict = judge(proposal, by, self._view())
            claim = verdict.refused or self._made_of(proposal, by, verdict)
            if isinstance(claim, Claim) and self._book.claims.get(claim.id) != claim:
                return self._accept(claim, before)
            self._keep(before)
            return claim

    def expire(self) -> tuple[Claim, ...]:
        """End what is over; these claims come back.

        Corrects what the endpoint was given, should it be otherwise.
        """
        with self._held():
            before = self._copy()
            lifecycle.expire(self._book, self._moment())
            return self._keep(before, publish=True)

    def confirm(self, identity: str, person: str) -> Claim | Diagnostic:
        """A person makes a pending claim true. One that readings contradict by now is refused: CLAIM-OUTRANKED."""
        with self._held():
            claim = self._pending(identity, person)
            if isinstance(claim, Diagnostic):
                return claim
            believed = replace(claim, state=State.ACTIVE, data={**claim.data, "confirmed_by": person[:TEXT_CHARS]})
            if claim.irreversible is None:
                if (refused := outranked(claim, self._view())) is not None:
                    return refused
                evidence = self._evidence(claim)
                if evidence is None:
                    return over_problem(claim)
                believed = carried(believed, evidence, self._moment())
            return self._accept(believed, self._copy())

    def reject(self, identity: str, person: str) -> Claim | Diagnostic:
        """A person refuses a pending claim."""
        with self._held():
            claim = self._pending(identity, person)
            if isinstance(claim, Diagnostic):
                return claim
            return self._accept(as_ended(claim, "operator", (person,), State.REFUSED), self._copy())

    def retire(self, identity: str, person: str) -> Claim | Diagnostic:
        """A person takes a claim back that is in force."""
        with self._held():
            claim = self._book.claims.get(identity)
            if claim is None or claim.state is not State.ACTIVE:
                return unknown_problem(identity, "in force")
            if not person:
                return no_decider()
            return self._accept(as_ended(claim, "operator", (person,)), self._copy())

    def active(self) -> tuple[Claim, ...]:
        """The claims in force now, oldest first."""
        with self._held():
            return in_force(self._book, self._moment())

    def pending(self) -> tuple[Claim, ...]:
        """The claims that wait for a person, oldest first."""
        with self._held():
            return waiting(self._book)

    def recent(self) -> tuple[Claim, ...]:
        """The claims that ended or were refused, oldest first; a bounded number."""
        with self._held():
            return tuple(claim for claim in self._book.claims.values() if claim.state in ENDED)

    def latest(self) -> tuple[Reading, ...]:
        """The newest reading of every signal."""
        with self._held():
            return self._readings.newest()

    def readings_of(self, signal: Signal) -> tuple[Reading, ...]:
        """The last readings of a signal, oldest first."""
        with self._held():
            return self._readings.of(signal)

    def find(self, identity: str) -> Reading | None:
        """A reading by its id; None when it is not remembered."""
        with self._held():
            return self._readings.find(identity)

    def _made_of(self, proposal: Proposal, by: str, verdict: Verdict) -> Claim:
        """The claim that a verdict makes of a proposal."""
        evidence, waits, most = verdict.evidence, verdict.waits, self._settings.claim_seconds
        data = {SECONDS: min(proposal.seconds or most, most)}
        claim = Claim(
            id=f"c{self._book.count + 1}",
            target=proposal.target,
            fault=proposal.fault,
            statement=proposal.statement,
            signal=proposal.signal or (evidence.signal if evidence is not None else _NOWHERE),
            condition=proposal.condition or Condition("==", None),
            cites=proposal.cites,
            by=by,
            made_at=self._clock.stamp(),
            made=self._clock.uptime(),
            expires_at="",
            expires=float("inf"),
            restrictions=proposal.restrictions,
            irreversible=proposal.irreversible,
            data=data if evidence is None else {**data, EVIDENCE: to_json(evidence)},
        )
        if waits is not None:
            return self._waiting(claim, waits)
        if evidence is None or proposal.irreversible is not None:
            return replace(claim, data={**claim.data, "confirmed_by": by})
        same = (claim.target, claim.signal, claim.condition, claim.restrictions)
        for other in in_force(self._book, self._moment()):
            if (other.target, other.signal, other.condition, other.restrictions) == same and other.by == by:
                claim = replace(other, data={**other.data, SECONDS: data[SECONDS]})  # repeated, with another reading
        return carried(claim, evidence, self._moment())

    def _waiting(self, claim: Claim, waits: Diagnostic) -> Claim:
        """The claim as it waits for a person; where one about the same waits already, that one."""
        for other in waiting(self._book):
            if (other.target, other.signal, other.irreversible) == (claim.target, claim.signal, claim.irreversible):
                return other
        return replace(claim, state=State.PENDING, data={**claim.data, "because": waits.code, "words": waits.summary})

    def _accept(self, claim: Claim, before: Book) -> Claim | Diagnostic:
        """Put a claim into the book; what would restrict or wait counts only once it is on the disk."""
        lifecycle.enter(self._book, claim, self._moment())
        problems = len(self.said)
        self._keep(before)
        if claim.state in ENDED or len(self.said) == problems:
            return claim
        self._book = before
        self._keep(Book())
        return self.said[problems]

    def _moment(self) -> Moment:
        return Moment(self._clock.uptime(), self._clock.stamp(), self._settings.claim_seconds)

    def _copy(self) -> Book:
        book = self._book
        return Book(dict(book.claims), list(book.levels), dict(book.spent), book.count)

    def _view(self) -> View:
        active = in_force(self._book, self._moment())
        mine = (Level(claim.signal, claim.condition, claim.id) for claim in active if claim.irreversible is None)
        levels, spent = (*self._book.levels, *mine), copy.copy(self._book.spent)
        now = self._clock.uptime()
        return View(now, self._settings, self._readings, active, waiting(self._book), levels, spent)

    def _evidence(self, claim: Claim) -> Reading | None:
        """The newest fresh reading that bears a pending claim out."""
        since = self._clock.uptime() - self._settings.claim_seconds
        found = [each for each in self._readings.of(claim.signal) if holds(claim.condition, each.value) is True]
        return found[-1] if found and found[-1].uptime > since else None

    def _pending(self, identity: str, person: str) -> Claim | Diagnostic:
        claim = self._book.claims.get(identity)
        if claim is None or claim.state is not State.PENDING:
            return unknown_problem(identity, "waiting for a person")
        return claim if person else no_decider()

    def _cited(self) -> frozenset[str]:
        alive = (claim for claim in self._book.claims.values() if claim.state not in ENDED)
        return frozenset(name for claim in alive for name in claim.cites)

    def _keep(self, before: Book, publish: bool = False) -> tuple[Claim, ...]:
        """Write what changed, for this ledger and for the endpoint; the claims that ended since come back."""
        claims = self._book.claims
        if changed := claims != before.claims or self._unwritten:
            lifecycle.prune(self._book)
            problem = codec.write(self._path, self._book, self._boot) if self._alone else taken_problem(self._lock)
            self._unwritten = problem is not None
            self.said.extend([problem] if problem is not None else [])
            self._seen = _stamp(self._path)
        known = before.claims
        if changed or publish:
            self._publish(in_force(before if self._unwritten else self._book, self._moment()))
        ended = [claim for claim in claims.values() if claim.state is State.RETIRED]
        return tuple(claim for claim in ended if claim.id in known and known[claim.id].state is not State.RETIRED)

    def _publish(self, known: tuple[Claim, ...]) -> None:
        """Report to the endpoint which of these are still in force; nothing is written where nothing ever was."""
        names = {claim.id for claim in known}
        active = tuple(claim for claim in in_force(self._book, self._moment()) if claim.id in names)
        path = self._layout.restrictions
        if active or path.exists():
            data = lifecycle.document(active, self._boot, self._settings, self._readings)
            problem = lifecycle.publish(path, data)
            self.said.extend([problem] if problem is not None else [])
        standing = {claim.id for claim in active if claim.irreversible is not None}
        over = {claim.id for claim in self._book.claims.values() if claim.state in ENDED}
        ids = lifecycle.forbidden(self._layout.forbidden) - over | standing
        problem = lifecycle.forbid(self._layout.forbidden, frozenset(ids))
        self.said.extend([problem] if problem is not None else [])

    @contextlib.contextmanager
    def _held(self) -> Iterator[None]:
        """The ledger's lock, with everything as it is on the disk now.

        Where there can be no lock (a folder that no one may write) nothing can be written either: it is stated, and the
        ledger can still be read. So it is while another process stands still with the lock: no one waits for it for
        ever, least of all the daemon, and what is new is written once the lock is free.
        """
        lock = None
        try:
            lock = _opened(self._lock)
        except OSError as problem:
            text = f"the ledger of claims cannot be locked: {problem.strerror}"
            self.said.append(error("CLAIM-LEDGER-LOCK", text, path=str(self._lock)))
        try:
            self._alone = lock is None or self._turn(lock)
            self._refresh()
            yield
        finally:
            if lock is not None:
                os.close(lock)

    def _turn(self, lock: int) -> bool:
        """Whether the lock is had; who did not get it before does not wait for it again."""
        had = acquire(lock, 0.0 if self._standing_still else PATIENCE)
        if not had and not self._standing_still:
            self.said.append(taken_problem(self._lock))
        self._standing_still = not had
        return had

    def _refresh(self) -> None:
        """Read what another process wrote."""
        strange = self._seen is not _UNSEEN and self._strangers()
        self.said.extend(self._readings.refresh(shut=bool(strange)))
        seen = _stamp(self._path)
        if self._unwritten or (seen == self._seen and (seen is not None or not self._book.claims)):
            return
        found = codec.read(self._path)
        self.said.extend(found.said)
        self._book, self._seen = found.book, _stamp(self._path)
        before = self._copy()
        lost = bool(found.said) or (seen is None and self._layout.restrictions.exists())
        if lost:
            self._lost()
        self._miss()
        lifecycle.trust(self._book, lost or found.boot == self._boot, self._moment())
        self._keep(before, publish=True)

    def _miss(self) -> None:
        """Take it that nothing may move where a permanent restriction is in neither of its files any more."""
        book = self._book
        missing = lifecycle.forbidden(self._layout.forbidden) - set(book.claims)
        for identity in sorted(missing):
            book.claims[identity] = lifecycle.unknown(identity, (self._clock.uptime(), self._clock.stamp()))
        numbers = [int(name[1:]) for name in missing if name[1:].isdigit()]
        book.count = max(book.count, *numbers) if numbers else book.count

    def _strangers(self) -> list[Diagnostic]:
        """Report, count and ignore a change of the files by another process."""
        mine = {self._path.name: _stamp(self._path) == self._seen, READINGS: self._readings.is_mine()}
        if all(mine.values()) or not (self.guarded or self._settings.shut()):
            return []
        found = [changed_problem(self._path.with_name(name)) for name, same in mine.items() if not same]
        self.strange += len(found)
        self.said.extend(found)
        self._unwritten = not mine[self._path.name]
        return found

    def _lost(self) -> None:
        """Go on without the book: with what a person made true, and with readings that are yet to come."""
        book = self._book
        book.claims = {claim.id: claim for claim in lifecycle.standing(self._layout.restrictions)}
        book.count = max((int(name[1:]) for name in book.claims if name[1:].isdigit()), default=0)
        book.spent = {reading.signal: reading.uptime for reading in self._readings.newest()}


def _opened(path: Path) -> int:
    try:
        return lock_file(path)
    except FileNotFoundError:
        private_folder(path.parent)
        return lock_file(path)


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size
