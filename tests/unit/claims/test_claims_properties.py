"""No ratchet, whatever comes in which order: what is restricted always stands on a fresh reading that bears it out."""

import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ledgers import ELBOW_TARGET, SECONDS, STILL, Bench, Clock, heat, load

from octoform.claims import ledger as ledgers
from octoform.claims.admission import DECLARATIONS, Proposal
from octoform.claims.codec import evidence_of
from octoform.claims.model import Claim, Condition, Reading, Restriction, Signal, State, holds, tighter
from octoform.conditions import OPERATORS
from octoform.server.restrictions import Restrictions

SIGNALS = (heat(), load(), heat("gripper"))
RESTRICTIONS = (STILL, Restriction("arm_home"), Restriction("arm_home", effect="confirm"), Restriction("arm_status"))
VALUES = st.sampled_from([20, 50, 59, 60, 62, 65, 68, 69, 70, 75, None])

CITES = st.just(["own"]) | st.just(["own", 0]) | st.lists(st.integers(0, 6), max_size=3)
"""The newest reading of the claim's own signal, or readings by how long ago they were made."""

proposals = st.fixed_dictionaries(
    {
        "signal": st.sampled_from([heat(), heat(), load(), load(), heat("gripper")]),
        "condition": st.builds(Condition, st.sampled_from([*OPERATORS, ">=", ">=", ">="]), VALUES.filter(bool)),
        "cites": CITES,
        "restrictions": st.lists(st.sampled_from(RESTRICTIONS[:3]), max_size=2).map(tuple)
        | st.lists(st.sampled_from(RESTRICTIONS), max_size=3).map(tuple),
        "seconds": st.sampled_from([None, 1.0, 600.0, 1e12]),
    }
)
trouble = st.tuples(st.sampled_from(SIGNALS[:2]), st.sampled_from([69, 70, 75]), proposals)
"""A signal that reads high, and a claim about it: what an agent does that tightens at each episode."""
steps = st.one_of(
    st.tuples(st.just("wait"), st.sampled_from([1.0, 300.0, 900.0, 1799.0, 5000.0])),
    st.tuples(st.just("read"), st.tuples(st.sampled_from(SIGNALS), VALUES)),
    st.tuples(st.just("read"), st.tuples(st.just(heat()), VALUES)),
    st.tuples(st.just("propose"), proposals),
    st.tuples(st.just("propose"), proposals),
    st.tuples(st.just("trouble"), trouble),
    st.tuples(st.just("trouble"), trouble),
    st.tuples(st.just("trouble"), trouble),
    st.tuples(st.just("declare"), st.sampled_from(DECLARATIONS)),
    st.tuples(st.just("confirm"), st.booleans()),
    st.tuples(st.just("retire"), st.none()),
    st.tuples(st.sampled_from(["expire", "restart", "reboot", "lose readings"]), st.none()),
    st.tuples(st.just("damage"), st.sampled_from(["cut", "newer", "gone"])),
)


@dataclass
class Told:
    """What happened, kept apart from the ledger: the judge of it."""

    bench: Bench
    read: list[Reading] = field(default_factory=list)
    confirmed: set[str] = field(default_factory=set)
    carried: dict[Signal, float] = field(default_factory=dict)
    ended: list[Claim] = field(default_factory=list)
    known: dict[str, Claim] = field(default_factory=dict)
    in_force: frozenset[str] = frozenset()

    def newest(self, signal: Signal) -> Reading | None:
        return next((each for each in reversed(self.read) if each.signal == signal), None)

    def cites(self, numbers: list[int | str], signal: Signal) -> tuple[str, ...]:
        """The ids that `CITES` means; an unknown one for readings before the first."""
        own = self.newest(signal)
        known: dict[int | str, str] = {number: each.id for number, each in enumerate(reversed(self.read))}
        known["own"] = "r-none" if own is None else own.id
        return tuple(known.get(number, "r-none") for number in numbers)


@pytest.fixture(autouse=True)
def _no_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.fsync", lambda _: None)


@given(st.lists(steps, min_size=5, max_size=40))
def test_nothing_is_restricted_but_for_a_fresh_reading_that_bears_it_out(course: list[tuple[str, Any]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        found = Told(Bench(Path(folder), Clock()))
        for step, what in course:
            made = take(found, step, what)
            check(found, step, made)


def take(told: Told, step: str, what: Any) -> Claim | None:
    """Do one step; the claim that came of it."""
    bench, ledger = told.bench, told.bench.ledger
    made: Any = None
    if step == "wait":
        bench.clock.now += what
    elif step == "read":
        told.read.append(bench.read(what[1], what[0]))
    elif step == "propose":
        made = propose(told, what)
    elif step == "trouble":
        signal, value, how = what
        told.read.append(bench.read(20, signal))
        check(told, "read", None)
        bench.clock.now += 1.0
        told.read.append(bench.read(value, signal))
        check(told, "read", None)
        made = propose(told, {**how, "signal": signal, "cites": ["own"]})
        check(told, "propose", made if isinstance(made, Claim) else None)
        made = None
    elif step == "declare":
        cites = tuple(each.id for each in told.read[-1:])
        made = ledger.propose(Proposal(ELBOW_TARGET, "none", "for good", cites=cites, irreversible=what), "watch")
        assert not isinstance(made, Claim) or made.id in told.confirmed or made.state is State.PENDING
    elif step == "confirm":
        made = confirm(told, declarations=what)
    elif step == "retire":
        made = next((ledger.retire(claim.id, "alice") for claim in ledger.active()), None)
    elif step == "expire":
        ledger.expire()
    else:
        shake(told, step, what)
    return made if isinstance(made, Claim) else None


def propose(told: Told, what: dict[str, Any]) -> Any:
    cites = told.cites(what["cites"], what["signal"])
    return told.bench.claim(*cites, **{key: what[key] for key in what if key != "cites"})


def confirm(told: Told, declarations: bool) -> Any:
    for claim in told.bench.ledger.pending():
        if (claim.irreversible is not None) is declarations:
            made = told.bench.ledger.confirm(claim.id, "alice")
            if isinstance(made, Claim):
                told.confirmed.add(claim.id)
            return made
    return None


def shake(told: Told, step: str, what: str | None) -> None:
    """Restarts and damages."""
    bench = told.bench
    path = bench.layout.daemon / ledgers.CLAIMS
    if step == "reboot":
        bench.boot, bench.clock.now = f"{bench.boot}+", 10.0
        told.read.clear()
        told.carried.clear()
    elif step == "lose readings":
        (bench.layout.daemon / ledgers.READINGS).unlink(missing_ok=True)
        told.read.clear()
    elif step == "damage" and path.exists():
        told.ended.clear()
        told.known.clear()
        if what == "gone":
            path.unlink()
        else:
            data = path.read_bytes()
            path.write_bytes(data[: len(data) // 2] if what == "cut" else data.replace(b'"format":1', b'"format":9'))
    bench.again()


def check(told: Told, step: str, made: Claim | None) -> None:
    bench, now = told.bench, told.bench.clock.now
    active = bench.ledger.active()
    for claim in active:
        if claim.irreversible is not None:
            assert claim.id in told.confirmed  # for good by a person alone
            continue
        evidence = evidence_of(claim)
        assert evidence is not None and evidence.id in claim.cites and evidence.signal == claim.signal
        assert holds(claim.condition, evidence.value) is True
        assert now < claim.expires <= evidence.uptime + SECONDS
        newest = told.newest(claim.signal)
        value = None if newest is None else newest.value
        assert newest is None or holds(claim.condition, value) is not False  # what is measured outranks it
        if claim.signal == heat() and claim.id not in told.confirmed:
            assert (
                newest is None or newest.value is None or float(newest.value) >= 60
            )  # the profile calls the rest clean
    _check_growth(told, step, made, active)
    _check_ratchet(told, made)
    for claim in bench.ledger.recent():
        if claim.id in told.known and claim.state is State.RETIRED and claim.irreversible is None:
            told.ended.append(told.known.pop(claim.id))
    told.known.update({claim.id: claim for claim in active})


def _check_growth(told: Told, step: str, made: Claim | None, active: tuple[Claim, ...]) -> None:
    """What the endpoint would refuse, seen with its own eyes."""
    bench = told.bench
    endpoint = Restrictions(bench.layout.restrictions, clock=bench.clock.uptime, boot=bench.boot)
    entries = [entry for entry in endpoint.in_force() if entry.tool != "arm_status"]
    now = frozenset(
        json.dumps([entry.tool, entry.arguments, entry.device, entry.units, entry.kind, entry.effect])
        for entry in entries
    )
    assert endpoint.problem is None
    assert {entry.claim for entry in entries} == {
        claim.id for claim in active if claim.restrictions or claim.irreversible
    }
    if now - told.in_force:
        assert step in ("propose", "confirm") and made is not None and made.state is State.ACTIVE
        evidence = evidence_of(made)
        if made.irreversible is not None:
            assert step == "confirm" and made.id in told.confirmed
            told.in_force = now
            return
        assert evidence is not None
        if made.id not in told.confirmed:
            assert evidence.uptime > told.carried.get(made.signal, -1.0)
        told.carried[made.signal] = evidence.uptime
    told.in_force = now


def _check_ratchet(told: Told, made: Claim | None) -> None:
    if made is None or made.state is not State.ACTIVE or made.irreversible is not None or made.id in told.confirmed:
        return
    loosest = [each.condition for each in told.ended if each.signal == made.signal and each.id not in told.confirmed]
    assert not any(tighter(made.condition, each) for each in _loosest(loosest))


def _loosest(conditions: list[Condition]) -> Iterator[Condition]:
    """Those that no other one is looser than."""
    for one in conditions:
        if not any(tighter(one, other) for other in conditions):
            yield one
