"""What happens to claims in the book: carried on, ended, superseded, remembered. Pure but for the book itself. Light.

Tightening is remembered and loosening is not undone: of all conditions that agents' claims on a signal have had, the
loosest that ended is the tightest that agents get from then on.
"""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from octoform.claims import codec
from octoform.claims.admission import Level
from octoform.claims.codec import EVIDENCE, Book
from octoform.claims.conditions import holds, tighter
from octoform.claims.model import Claim, Reading, Signal, State
from octoform.claims.readings import to_json

MOST_ENDED = 200
MOST_CITED = 8
MOST_LEVELS = 256
PENDING_SECONDS = 24 * 3600.0
"""How long a claim waits for a person; a declaration waits for ever."""
ENDED = (State.RETIRED, State.REFUSED)


@dataclass(frozen=True, slots=True)
class Moment:
    """Now: seconds of uptime with the stamp beside, and the seconds that a reading carries a claim at most."""

    uptime: float
    stamp: str
    most: float


def in_force(book: Book, moment: Moment) -> tuple[Claim, ...]:
    """The claims that are believed now, oldest first."""
    return tuple(
        claim for claim in book.claims.values() if claim.state is State.ACTIVE and moment.uptime < claim.expires
    )


def waiting(book: Book) -> tuple[Claim, ...]:
    """The claims that wait for a person."""
    return tuple(claim for claim in book.claims.values() if claim.state is State.PENDING)


def weigh(book: Book, reading: Reading, moment: Moment) -> None:
    """What one reading means to the claims on its signal: it ends them, carries them on, or says nothing."""
    for claim in list(book.claims.values()):
        if claim.signal != reading.signal or claim.irreversible is not None or claim.state in ENDED:
            continue
        evidence = codec.evidence_of(claim)
        if evidence is not None and reading.uptime < evidence.uptime:
            continue
        verdict = holds(claim.condition, reading.value)
        if verdict is False:
            end(book, claim, "contradicted", (reading.id,), reading)
        elif verdict is True and claim.state is State.ACTIVE and moment.uptime < claim.expires:
            book.claims[claim.id] = carried(claim, reading, moment)


def carried(claim: Claim, evidence: Reading, moment: Moment) -> Claim:
    """The claim as this reading carries it on."""
    cites = (*[each for each in claim.cites if each != evidence.id][-MOST_CITED + 1 :], evidence.id)
    expires = min(evidence.uptime, moment.uptime) + codec.seconds_of(claim, moment.most)
    stamp = _later(moment.stamp, expires - moment.uptime)
    data = {**claim.data, EVIDENCE: to_json(evidence)}
    return replace(claim, cites=cites, expires=expires, expires_at=stamp, data=data)


def enter(book: Book, claim: Claim, moment: Moment) -> None:
    """Put a claim into the book as it is from now on."""
    if claim.id not in book.claims:
        book.count += 1
    if claim.state is State.ACTIVE and claim.irreversible is None:
        _supersede(book, claim, moment)
        _spend(book, claim)
    book.claims[claim.id] = claim
    if claim.state is State.RETIRED:
        _remember(book, claim, None)


def expire(book: Book, moment: Moment) -> None:
    """End what is over."""
    now = moment.uptime
    for claim in list(book.claims.values()):
        waits = claim.state is State.PENDING and claim.irreversible is None
        until = claim.made + PENDING_SECONDS if waits else claim.expires
        if claim.state not in ENDED and not now < until:
            end(book, claim, "expired", (), None)
    for signal in [signal for signal, spent in book.spent.items() if spent + moment.most < now]:
        del book.spent[signal]


def trust(book: Book, same_boot: bool, moment: Moment) -> None:
    """End what cannot be justified as it stands in a file: evidence of an earlier start of the machine, or none."""
    for claim in list(book.claims.values()):
        if claim.state in ENDED:
            continue
        if claim.irreversible is None and not same_boot:
            end(book, claim, "expired", ("boot",), None)
        elif claim.state is State.PENDING:
            continue
        elif moment.uptime < claim.expires and not codec.is_justified(claim, moment.most, moment.uptime):
            end(book, claim, "expired", ("unjustified",), None)
    if not same_boot:
        book.spent.clear()


def end(book: Book, claim: Claim, why: str, by: tuple[str, ...], clean: Reading | None) -> None:
    """End a claim; one that was in force is remembered, with the reading at which it was clean."""
    book.claims[claim.id] = ended = as_ended(claim, why, by)
    if claim.state is State.ACTIVE:
        _remember(book, ended, clean)


def as_ended(claim: Claim, why: str, by: tuple[str, ...], state: State = State.RETIRED) -> Claim:
    """The claim as it is when it is over."""
    return replace(claim, state=state, ended=why, ended_by=by)


def prune(book: Book) -> None:
    """Forget the oldest of what is over."""
    ended = [name for name, claim in book.claims.items() if claim.state in ENDED]
    for name in ended[:-MOST_ENDED]:
        del book.claims[name]


def _supersede(book: Book, claim: Claim, moment: Moment) -> None:
    for other in in_force(book, moment):
        same = other.signal == claim.signal and other.target == claim.target
        if same and other.id != claim.id and other.irreversible is None:
            end(book, other, "superseded", (claim.id,), None)


def _spend(book: Book, claim: Claim) -> None:
    evidence = codec.evidence_of(claim)
    if claim.restrictions and evidence is not None:
        signal: Signal = claim.signal
        book.spent[signal] = max(book.spent.get(signal, evidence.uptime), evidence.uptime)


def _remember(book: Book, claim: Claim, clean: Reading | None) -> None:
    if claim.irreversible is not None:
        return
    mine = [level for level in book.levels if level.signal == claim.signal]
    if any(tighter(claim.condition, level.condition) for level in mine):
        return
    equal = [level for level in mine if level.condition == claim.condition]
    if equal and clean is None:
        return
    gone = [level for level in mine if level in equal or tighter(level.condition, claim.condition)]
    book.levels[:] = [level for level in book.levels if level not in gone][-MOST_LEVELS + 1 :]
    book.levels.append(Level(claim.signal, claim.condition, claim.id, clean))


def _later(stamp: str, seconds: float) -> str:
    try:
        moment = datetime.fromisoformat(stamp) + timedelta(seconds=max(0.0, seconds))
    except (ValueError, OverflowError):
        return ""
    return moment.isoformat(timespec="seconds").replace("+00:00", "Z")
