"""What is believed, what waits for a person, what is refused: each rule has a proposal that breaks it alone."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ledgers import ARM, ELBOW_TARGET, SECONDS, STILL, Bench, heat, load

from octoform.claims.admission import Proposal, of_claim, of_declaration
from octoform.claims.model import Channel, Claim, Condition, Restriction, Signal, State, holds, tighter
from octoform.diagnostics import Diagnostic


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def declared(bench: Bench, kind: str, *cites: str, by: str = "watch") -> Claim | Diagnostic:
    return bench.ledger.propose(Proposal(ELBOW_TARGET, "none", "for good", cites=cites, irreversible=kind), by)


def test_a_claim_that_a_fresh_reading_bears_out_is_believed_until_that_reading_is_old(bench: Bench) -> None:
    reading = bench.read(70)
    claim = bench.claim(reading)
    assert isinstance(claim, Claim) and claim.state is State.ACTIVE
    assert claim.cites == (reading.id,) and claim.expires == reading.uptime + SECONDS
    assert claim.expires_at == "2026-11-22T01:53:20Z" and bench.ledger.active() == (claim,)
    bench.clock.now += SECONDS - 1
    assert bench.ledger.active() and bench.ledger.expire() == ()
    bench.clock.now += 1
    assert bench.ledger.active() == ()
    (ended,) = bench.ledger.expire()
    assert (ended.state, ended.ended) == (State.RETIRED, "expired") and bench.ledger.recent() == (ended,)


def test_an_old_reading_carries_a_claim_for_the_rest_of_its_time_alone(bench: Bench) -> None:
    reading = bench.read(70)
    bench.clock.now += 1000
    claim = bench.claim(reading, seconds=1e12)
    assert isinstance(claim, Claim) and claim.expires == bench.clock.now + SECONDS - 1000
    short = bench.claim(bench.read(71), seconds=60.0)
    assert isinstance(short, Claim) and short.expires == bench.clock.now + 60


def test_no_reading_an_unknown_one_one_of_another_joint_and_an_old_one_carry_nothing(bench: Bench) -> None:
    other = bench.read(70, heat("gripper"))
    assert bench.code() == "CLAIM-NO-READING"
    assert bench.code("r-none") == "CLAIM-UNKNOWN-READING"
    assert bench.code(other) == "CLAIM-OTHER-SIGNAL"
    old = bench.read(70)
    bench.clock.now += SECONDS
    assert bench.code(old) == "CLAIM-STALE"
    assert bench.code(old, other) == "CLAIM-STALE" and bench.ledger.active() == ()


def test_what_does_not_hold_at_the_cited_reading_or_at_a_newer_one_is_refused(bench: Bench) -> None:
    hot = bench.read(70)
    assert bench.code(hot, value=71) == "CLAIM-NOT-SUPPORTED"
    bench.clock.now += 1
    cool = bench.read(50)
    assert bench.code(hot) == "CLAIM-OUTRANKED"
    assert bench.code(hot, cool) == "CLAIM-NOT-SUPPORTED"
    bench.clock.now += 1
    hot = bench.read(70)
    bench.clock.now += 1
    bench.read(None, why="the bus is silent")  # an unreadable value is no evidence
    assert bench.code(hot) == ""


def test_a_reading_that_could_not_be_made_supports_nothing(bench: Bench) -> None:
    silent = bench.read(None, why="the bus is silent")
    assert bench.code(silent) == bench.code(silent, op="!=", value=5) == "CLAIM-NOT-SUPPORTED"
    found = bench.claim(silent)
    assert isinstance(found, Diagnostic) and "the bus is silent" in found.summary
    assert bench.code(bench.read(float("nan"))) == "CLAIM-NOT-SUPPORTED"


@pytest.mark.parametrize(("op", "value"), [(">=", 40), (">", 59), ("!=", 25), (">=", -300)])
def test_a_condition_that_outlives_the_profiles_own_trouble_is_refused(bench: Bench, op: str, value: float) -> None:
    assert bench.code(bench.read(72), op=op, value=value) == "CLAIM-WITHIN-LIMITS"
    assert bench.code(bench.read(72), op=">=", value=60) == ""


def test_a_value_that_the_profile_calls_clean_is_no_trouble(bench: Bench) -> None:
    assert bench.code(bench.read(68), value=62) == "CLAIM-WITHIN-LIMITS"
    assert bench.code(bench.read(68), value=62, restrictions=()) == "CLAIM-WITHIN-LIMITS"
    assert bench.code(bench.read(69), value=62) == ""


def test_bounds_of_a_profile_hold_for_its_own_tools_alone(bench: Bench) -> None:
    elsewhere = replace(heat(), source="rail_position")
    bench.read(40, elsewhere)
    assert bench.code(bench.read(62, elsewhere), signal=elsewhere, value=61) == ""


@pytest.mark.parametrize(
    ("restriction", "code"),
    [
        (Restriction("arm_status"), "CLAIM-RESTRICTS-READING"),
        (Restriction("arm_stop"), "CLAIM-RESTRICTS-READING"),
        (Restriction("arm_move_elbow"), "CLAIM-UNKNOWN-TOOL"),
        (Restriction("arm_move_joint"), "CLAIM-TOO-WIDE"),
        (Restriction("arm_move_joint", {"device": ARM}), "CLAIM-TOO-WIDE"),
        (Restriction("arm_move_joint", {"joint": "gripper"}), "CLAIM-TOO-WIDE"),
        (Restriction("rail_move_x"), "CLAIM-TOO-WIDE"),
        (Restriction("arm_home"), ""),
        (Restriction("arm_move_joint", {"joint": "elbow_flex"}, "confirm"), ""),
    ],
)
def test_only_what_the_claim_is_about_is_restricted(bench: Bench, restriction: Restriction, code: str) -> None:
    assert bench.code(bench.read(70), restrictions=(STILL, restriction)) == code


def test_restrictions_grow_only_with_a_reading_that_carried_none(bench: Bench) -> None:
    first = bench.read(70)
    assert bench.code(first) == ""
    home = (STILL, Restriction("arm_home"))
    assert bench.code(first, restrictions=home) == "CLAIM-SPENT-READING"
    assert bench.code(first, target="device:usb-1a86-55d3", restrictions=(Restriction("arm_home"),)) == (
        "CLAIM-SPENT-READING"
    )
    bench.clock.now += 1
    assert bench.code(bench.read(70), restrictions=home) == ""
    (only,) = bench.ledger.active()  # of one trouble there is one claim
    assert len(only.restrictions) == 2 and bench.ledger.recent()[0].ended == "superseded"


def test_a_reading_that_carried_a_claim_carries_none_after_a_person_ended_that(bench: Bench) -> None:
    hot = bench.read(70)
    claim = bench.claim(hot)
    assert isinstance(claim, Claim)
    bench.ledger.retire(claim.id, "alice")
    assert bench.code(hot) == "CLAIM-SPENT-READING"


def test_nobody_but_a_person_makes_a_rule_tighter_than_one_that_ended(bench: Bench) -> None:
    bench.read(5, load())
    assert bench.code(bench.read(80, load()), signal=load(), value=70) == ""
    bench.clock.now += 1
    assert bench.code(bench.read(80, load()), signal=load(), value=60) == "CLAIM-RATCHET"  # while it is in force
    bench.clock.now += 1
    (waiting,) = bench.ledger.pending()
    bench.read(50, load())
    assert bench.ledger.active() == () and bench.ledger.pending() == ()
    bench.clock.now += 1
    hot = bench.read(80, load())
    assert bench.code(hot, signal=load(), value=60) == "CLAIM-RATCHET"
    assert bench.code(hot, signal=load(), op="!=", value=50) == "CLAIM-RATCHET"
    assert bench.code(hot, signal=load(), op=">", value=79) == ""  # a looser one may come back
    assert bench.ledger.confirm(waiting.id, "alice") != waiting


def test_a_person_may_make_it_tighter_for_as_long_as_readings_bear_it_out(bench: Bench) -> None:
    bench.read(5, load())
    bench.claim(bench.read(80, load()), signal=load(), value=70)
    bench.clock.now += 1
    tight = bench.claim(bench.read(75, load()), signal=load(), value=60)
    assert isinstance(tight, Claim) and tight.state is State.PENDING
    believed = bench.ledger.confirm(tight.id, "alice")
    assert isinstance(believed, Claim) and believed.state is State.ACTIVE and believed.data["confirmed_by"] == "alice"
    bench.clock.now += 1
    (ended,) = bench.ledger.record([bench.ledger.make(load(), 59)])
    assert ended.id == tight.id and bench.ledger.active() == ()


def test_what_has_always_been_so_restricts_nothing_without_a_person(bench: Bench) -> None:
    always = bench.read(30, load())
    assert bench.code(always, signal=load(), value=-1000) == "CLAIM-ALWAYS-SO"
    assert bench.code(always, signal=load(), value=-1000, restrictions=()) == ""
    failing = Signal(Channel.LOG, "arm_move_joint", "/ok")  # defines by itself what is good
    assert bench.code(bench.read(False, failing), signal=failing, op="==", value=False) == ""


@pytest.mark.parametrize("kind", ["terminal_lock", "disable_unit", "fire_risk"])
def test_what_is_for_good_waits_for_a_person_and_is_undone_by_one(bench: Bench, kind: str) -> None:
    hot = bench.read(75)
    claim = declared(bench, kind, hot.id)
    assert isinstance(claim, Claim) and claim.state is State.PENDING and claim.data["because"] == "CLAIM-IRREVERSIBLE"
    assert declared(bench, kind, hot.id) == claim  # asked once
    bench.clock.now += 30 * 24 * 3600
    bench.read(20)
    bench.ledger.expire()
    assert bench.ledger.active() == () and bench.ledger.pending() == (claim,)
    nobody = bench.ledger.confirm(claim.id, "")
    assert isinstance(nobody, Diagnostic) and nobody.code == "CLAIM-NO-PERSON"
    true = bench.ledger.confirm(claim.id, "alice")
    assert isinstance(true, Claim) and bench.again().active() == (true,)
    bench.clock.now += 30 * 24 * 3600
    bench.read(20)
    assert bench.ledger.active() == (true,) and bench.ledger.expire() == ()
    over = bench.ledger.retire(true.id, "alice")
    assert isinstance(over, Claim) and over.ended_by == ("alice",) and bench.ledger.active() == ()


def test_a_declaration_cites_readings_too_and_a_person_may_refuse_it(bench: Bench) -> None:
    found = declared(bench, "fire_risk")
    assert isinstance(found, Diagnostic) and found.code == "CLAIM-NO-READING"
    claim = declared(bench, "fire_risk", bench.read(75).id)
    assert isinstance(claim, Claim)
    refused = bench.ledger.reject(claim.id, "alice")
    assert isinstance(refused, Claim) and (refused.state, refused.ended) == (State.REFUSED, "operator")
    again = bench.ledger.confirm(claim.id, "alice")
    assert isinstance(again, Diagnostic) and again.code == "CLAIM-NOT-FOUND"


def test_their_number_is_bounded(bench: Bench) -> None:
    hot = bench.read(75)
    codes = []
    for number in range(80):
        found = bench.claim(hot, target=f"device:{ARM}/{number}", restrictions=())
        codes.append(found.code if isinstance(found, Diagnostic) else "")
    assert codes[:64] == [""] * 64 and set(codes[64:]) == {"CLAIM-TOO-MANY"}
    for number in range(20):
        found = bench.ledger.propose(
            Proposal(f"device:{number}", "none", "lock", cites=(hot.id,), irreversible="terminal_lock"), "watch"
        )
    assert isinstance(found, Diagnostic) and found.code == "CLAIM-TOO-MANY"


def test_words_that_are_no_claim_are_refused_whole() -> None:
    good: dict[str, Any] = {
        "target": ELBOW_TARGET,
        "fault": "none",
        "statement": "hot",
        "signal": {"channel": "sensor", "source": "arm_status", "path": "/x"},
        "condition": {"op": ">=", "value": 69},
        "cites": ["r1", "r1"],
        "restrictions": [{"tool": "arm_home", "arguments": {}, "effect": "deny"}],
    }
    proposal = of_claim(good)
    assert isinstance(proposal, Proposal) and proposal.cites == ("r1",)
    bad: list[Any] = [
        None,
        [],
        {**good, "target": ""},
        {**good, "statement": "x" * 601},
        {**good, "signal": {"channel": "mind", "source": "a", "path": "/x"}},
        {**good, "condition": {"op": "~", "value": 1}},
        {**good, "condition": {"op": ">=", "value": None}},
        {**good, "condition": {"op": ">=", "value": float("inf")}},
        {**good, "cites": "r1"},
        {**good, "cites": [1]},
        {**good, "seconds": -5},
        {**good, "seconds": True},
        {**good, "restrictions": [{"tool": "a", "effect": "destroy"}]},
        {**good, "restrictions": [{"tool": "a", "arguments": {"joint": ["elbow_flex"]}}]},
        {**good, "restrictions": [{"tool": "a"}] * 33},
    ]
    for document in bad:
        found = of_claim(document)
        assert isinstance(found, Diagnostic) and found.code == "CLAIM-MALFORMED", document
    declaration = {"kind": "fire_risk", "target": "a", "statement": "b", "cites": ["r1"]}
    assert isinstance(of_declaration(declaration), Proposal)
    wrong = of_declaration({**declaration, "kind": "self_destruct"})
    assert isinstance(wrong, Diagnostic) and "self_destruct" in wrong.summary


def test_conditions_compare_like_with_like() -> None:
    assert holds(Condition(">=", 69), 69.0) is True and holds(Condition("<", 69), 69) is False
    assert (
        holds(Condition(">=", 69), None) is holds(Condition(">=", 69), "hot") is holds(Condition(">", 0), True) is None
    )
    assert holds(Condition("==", False), False) is True and holds(Condition("==", 0), False) is None
    assert holds(Condition("!=", "ok"), "TimeoutError") is True and holds(Condition("!=", "ok"), 3) is None
    assert tighter(Condition(">=", 60), Condition(">=", 69)) and not tighter(Condition(">=", 69), Condition(">=", 60))
    assert tighter(Condition(">=", 69), Condition(">", 69)) and not tighter(Condition(">=", 69), Condition(">=", 69))
    assert tighter(Condition("<=", 11), Condition("<=", 10)) and tighter(Condition("!=", 5), Condition(">", 5))
    assert tighter(Condition(">=", 4), Condition("==", 5)) and not tighter(Condition("<", 4), Condition("==", 5))
    assert not tighter(Condition("==", "a"), Condition("==", "b")) and tighter(
        Condition("!=", "a"), Condition("==", "b")
    )
