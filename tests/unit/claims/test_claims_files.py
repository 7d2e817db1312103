"""The ledger's files: what is damaged is said and not believed, and several processes see the same ledger."""

import fcntl
import json
import multiprocessing
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ledgers import ELBOW_TARGET, SECONDS, STILL, Bench, Clock, heat, load

from octoform.claims import ledger as ledgers
from octoform.claims.admission import Proposal
from octoform.claims.model import Claim, Restriction, State
from octoform.claims.readings import MAX_SIGNALS, OF_ONE
from octoform.diagnostics import Diagnostic


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def claims_file(bench: Bench) -> Path:
    return bench.layout.daemon / ledgers.CLAIMS


def restricted(bench: Bench) -> list[dict[str, Any]]:
    found = json.loads(bench.layout.restrictions.read_bytes())
    assert found["format"] == 1 and found["boot"] == bench.boot
    return list(found["restrictions"])


def change(path: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    document = json.loads(path.read_bytes())
    edit(document)
    path.write_text(json.dumps(document))


def test_nothing_is_written_where_there_is_nothing_to_keep(bench: Bench) -> None:
    assert bench.ledger.active() == () and bench.ledger.new_diagnostics() == ()
    assert [path.name for path in bench.layout.daemon.iterdir()] == [ledgers.LOCK]
    assert bench.ledger.expire() == () and not bench.layout.restrictions.exists()


def test_all_of_it_is_there_again_after_a_restart(bench: Bench) -> None:
    hot = bench.read(70)
    bench.read(None, load(), why="silent")
    claim = bench.claim(hot)
    held, known = bench.ledger.active(), bench.ledger.latest()
    again = bench.again()
    assert again.active() == held == (claim,) and set(again.latest()) == set(known) and again.new_diagnostics() == ()
    assert again.find(hot.id) == hot and again.readings_of(heat()) == (hot,)
    for path in bench.layout.daemon.iterdir():
        assert path.stat().st_mode & 0o077 == 0


def test_the_endpoint_is_told_and_told_again_when_it_is_over(bench: Bench) -> None:
    claim = bench.claim(bench.read(70))
    assert isinstance(claim, Claim)
    (found,) = restricted(bench)
    assert found["tool"] == "arm_move_joint" and found["effect"] == "deny" and found["claim"] == claim.id
    assert found["expires"] == claim.expires and found["expires_at"] == claim.expires_at
    bench.clock.now += 10
    bench.read(71)
    assert restricted(bench)[0]["expires"] == claim.expires + 10
    bench.clock.now += 10
    bench.read(50)
    assert restricted(bench) == []


def test_a_joint_is_restricted_by_each_of_its_names(bench: Bench) -> None:
    for number, name in ((1, "shoulder_pan"), (3, "elbow_flex")):
        bench.read(number, replace(heat(name), path=f"/joints/{name}/id"))
    bench.read(1, replace(heat(), path="/joints/elbow_flex/moving"))  # a value, no name
    bench.claim(bench.read(70))
    assert restricted(bench)[0]["units"] == ["elbow_flex", "3"]


def test_a_joint_that_stands_under_its_number_is_restricted_by_its_name_too(bench: Bench) -> None:
    numbered = replace(heat(), path="/joints/3/temperature")
    bench.read("elbow_flex", replace(heat(), path="/joints/3/joint"))
    bench.claim(bench.read(70, numbered), signal=numbered)
    assert restricted(bench)[0]["units"] == ["elbow_flex", "3"]


def test_what_another_changed_in_the_endpoints_file_is_put_right(bench: Bench) -> None:
    bench.claim(bench.read(70))
    right = bench.layout.restrictions.read_bytes()
    change(bench.layout.restrictions, lambda told: told["restrictions"].append(told["restrictions"][0]))
    bench.ledger.expire()
    assert bench.layout.restrictions.read_bytes() == right
    bench.layout.restrictions.unlink()
    bench.ledger.expire()
    assert bench.layout.restrictions.read_bytes() == right


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "cut": lambda data: data[: len(data) // 2],
    "newer": lambda data: data.replace(b'"format":1', b'"format":2', 1),
    "foreign": lambda _: b'{"some": "other file"}',
    "list": lambda _: b"[]",
    "deep": lambda _: b"[" * 100_000,
    "bytes": lambda data: b"\xff\xfe" + data,
    "claims": lambda data: data.replace(b'"op":">="', b'"op":"~"'),
    "state": lambda data: data.replace(b'"state":"active"', b'"state":"eternal"'),
}


@pytest.mark.parametrize("how", DAMAGES)
def test_a_ledger_that_cannot_be_read_is_said_set_aside_and_restricts_nothing(bench: Bench, how: str) -> None:
    hot = bench.read(70)
    bench.claim(hot)
    assert restricted(bench)
    path = claims_file(bench)
    damaged = DAMAGES[how](path.read_bytes())
    path.write_bytes(damaged)
    ledger = bench.again()
    assert [item.code for item in ledger.new_diagnostics()] == ["CLAIM-LEDGER-DAMAGED"]
    assert ledger.active() == () and restricted(bench) == []
    assert path.with_name(f"{path.name}.aside").read_bytes() == damaged
    assert bench.again().new_diagnostics() == ()
    bench.clock.now += 1
    assert bench.code(bench.read(70)) == ""  # trouble that lasts is claimed anew


def test_a_ledger_that_is_a_link_or_vanishes_restricts_nothing(bench: Bench) -> None:
    bench.claim(bench.read(70))
    path = claims_file(bench)
    path.rename(path.with_name("elsewhere"))
    assert bench.ledger.active() == () and restricted(bench) == []
    path.symlink_to("elsewhere")
    assert bench.ledger.active() == () and [item.code for item in bench.ledger.new_diagnostics()] == ["STATE-LINK"]


def test_what_a_person_made_true_survives_the_loss_of_the_ledger(bench: Bench) -> None:
    hot = bench.read(75)
    claim = bench.ledger.propose(
        Proposal(ELBOW_TARGET, "none", "bent", cites=(hot.id,), irreversible="disable_unit", restrictions=(STILL,)),
        "watch",
    )
    assert isinstance(claim, Claim)
    bench.ledger.confirm(claim.id, "alice")
    claims_file(bench).write_bytes(b"damaged")
    (kept,) = bench.again().active()
    assert kept.id == claim.id and kept.irreversible == "disable_unit" and restricted(bench)[0]["expires"] is None
    claims_file(bench).unlink()
    assert bench.again().active() == (kept,)
    bench.boot = "boot-2"
    bench.clock.now = 10.0
    assert bench.again().active() == (kept,)


LOSSES: dict[str, Callable[[Path], object]] = {
    "gone": lambda path: path.unlink(),
    "damaged": lambda path: path.write_bytes(b"{"),
    "replaced": lambda path: path.write_bytes(b'{"format": 1, "boot": "boot-1", "claims": [], "restrictions": []}'),
}


@pytest.mark.parametrize("how", LOSSES)
def test_where_both_files_are_lost_nothing_moves_until_a_person_says_so(bench: Bench, how: str) -> None:
    hot = bench.read(75)
    proposal = Proposal(ELBOW_TARGET, "none", "bent", cites=(hot.id,), irreversible="disable_unit")
    claim = bench.ledger.propose(proposal, "watch")
    assert isinstance(claim, Claim) and isinstance(bench.ledger.confirm(claim.id, "alice"), Claim)
    for path in (claims_file(bench), bench.layout.restrictions):
        LOSSES[how](path)
    ledger = bench.again()
    (lost,) = ledger.active()
    assert lost.id == claim.id and "is lost" in lost.statement
    (found,) = restricted(bench)
    assert (found["tool"], found["arguments"], found["effect"], found["expires"]) == ("", {}, "deny", None)
    assert "device" not in found
    assert bench.again().active() == (lost,)
    waiting = bench.ledger.propose(proposal, "watch")
    assert isinstance(waiting, Claim) and waiting.id != claim.id, "the number of a lost one is given to no other"
    assert isinstance(bench.ledger.retire(lost.id, "alice"), Claim)
    assert restricted(bench) == [] and bench.again().active() == ()
    assert json.loads(bench.layout.forbidden.read_bytes())["claims"] == []


@pytest.mark.parametrize(
    "edit",
    [
        {"expires": 1e9},
        {"expires": None},
        {"condition": {"op": ">=", "value": 80}},
        {"data": {}},
        {"cites": []},
        {"irreversible": "terminal_lock", "expires": None},
    ],
)
def test_a_claim_of_the_file_that_its_evidence_does_not_carry_is_not_believed(
    bench: Bench, edit: dict[str, Any]
) -> None:
    bench.claim(bench.read(70))
    change(claims_file(bench), lambda document: document["claims"][0].update(edit))
    ledger = bench.again()
    assert ledger.active() == () and ledger.recent()[0].ended_by == ("unjustified",) and restricted(bench) == []


def test_readings_of_an_earlier_start_of_the_machine_carry_nothing(bench: Bench) -> None:
    hot = bench.read(70)
    claim = bench.claim(hot)
    bench.boot = "boot-2"
    bench.clock.now = 30.0
    ledger = bench.again()
    assert ledger.active() == () and ledger.find(hot.id) is None and ledger.latest() == ()
    (ended,) = ledger.recent()
    assert isinstance(claim, Claim) and ended.id == claim.id and ended.ended_by == ("boot",)
    assert bench.code(hot) == "CLAIM-UNKNOWN-READING"


def test_a_wall_clock_that_jumps_changes_nothing(bench: Bench) -> None:
    claim = bench.claim(bench.read(70))
    for jump in (-1e8, 1e8):
        bench.clock.jumped = jump
        assert bench.ledger.expire() == () and bench.ledger.active() == (claim,) and bench.again().active() == (claim,)


def test_damaged_readings_are_left_out_and_said(bench: Bench) -> None:
    first, second = bench.read(65), bench.read(70)
    path = bench.layout.daemon / ledgers.READINGS
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b"\xff" + lines[1] + lines[2] + b'{"id": "torn')
    ledger = bench.again()
    assert [item.code for item in ledger.new_diagnostics()] == ["CLAIM-READINGS-DAMAGED"]
    assert ledger.find(first.id) is None and ledger.find(second.id) == second
    bench.read(71)  # is not glued to the torn line
    assert bench.again().find(second.id) == second and len(bench.ledger.readings_of(heat())) == 2
    path.write_bytes(b"no readings")
    assert [item.code for item in bench.again().new_diagnostics()] == ["CLAIM-READINGS-DAMAGED"]
    assert bench.ledger.latest() == () and path.with_name(f"{path.name}.aside").read_bytes() == b"no readings"
    assert bench.code(bench.read(70)) == ""


def test_readings_are_bounded_but_for_those_that_carry_a_claim(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("octoform.claims.readings.COMPACT_BYTES", 20_000)
    hot = bench.read(70)
    bench.claim(hot, seconds=SECONDS)
    path = bench.layout.daemon / ledgers.READINGS
    for round_ in range(60):
        bench.clock.now += 1
        bench.ledger.record([bench.ledger.make(load(f"j{number}"), number + round_) for number in range(10)])
    assert path.stat().st_size < 60_000 and bench.again().find(hot.id) == hot
    kept = bench.ledger.readings_of(load("j1"))
    assert len(kept) == OF_ONE and kept[-1].value == 60
    bench.ledger.record([bench.ledger.make(load(f"k{number}"), 1) for number in range(MAX_SIGNALS + 5)])
    assert len(bench.ledger.latest()) == MAX_SIGNALS


def test_an_extreme_is_not_forgotten(bench: Bench) -> None:
    bench.read(5, load())
    for _ in range(3 * OF_ONE):
        bench.clock.now += 1
        bench.read(80, load())
    assert bench.code(bench.ledger.readings_of(load())[-1], signal=load(), value=70) == ""


def test_a_claim_that_cannot_be_written_is_none(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    hot = bench.read(70)
    full = Diagnostic(severity="error", code="STATE-DISK-FULL", summary="no space left")  # type: ignore[arg-type]
    with monkeypatch.context() as patch:
        patch.setattr("octoform.claims.codec.write_atomic", lambda *_: full)
        assert bench.claim(hot) == full
        assert bench.ledger.active() == () and full in bench.ledger.new_diagnostics()
    assert not claims_file(bench).exists() and bench.again().active() == ()
    claim = bench.claim(hot)
    assert isinstance(claim, Claim)
    with monkeypatch.context() as patch:
        patch.setattr("octoform.claims.codec.write_atomic", lambda *_: full)
        bench.clock.now += 1
        bench.read(50)  # letting go needs no room
        assert bench.ledger.active() == () and restricted(bench) == []
    bench.ledger.expire()
    assert bench.again().recent()[-1].state is State.RETIRED


def test_a_folder_that_nobody_may_write_is_said_and_can_still_be_read(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    claim = bench.claim(bench.read(70))
    opened = os.open

    def refused(path: Any, flags: int, *more: Any, **named: Any) -> int:
        if str(path).endswith(ledgers.LOCK):
            raise PermissionError(13, "Permission denied")
        return opened(path, flags, *more, **named)

    monkeypatch.setattr(os, "open", refused)
    ledger = bench.again()
    assert ledger.active() == (claim,) and {item.code for item in ledger.new_diagnostics()} == {"CLAIM-LEDGER-LOCK"}


def test_nobody_waits_for_ever_for_a_process_that_stands_still_with_the_lock(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a leftover one stops the daemon, and all of its repairs."""
    monkeypatch.setattr(ledgers, "PATIENCE", 0.02)
    claim = bench.claim(bench.read(70))
    assert isinstance(claim, Claim)
    kept = claims_file(bench).read_bytes()
    with (bench.layout.daemon / ledgers.LOCK).open() as stuck:
        fcntl.flock(stuck, fcntl.LOCK_EX)
        bench.clock.now += 1
        bench.read(50)  # letting go needs no lock
        assert bench.ledger.active() == () and restricted(bench) == [] and claims_file(bench).read_bytes() == kept
    assert {item.code for item in bench.ledger.new_diagnostics()} == {"CLAIM-LEDGER-LOCK"}
    bench.ledger.expire()
    assert bench.again().recent()[-1].state is State.RETIRED and bench.ledger.new_diagnostics() == ()


def test_two_processes_see_what_the_other_did(bench: Bench) -> None:
    daemon = bench.ledger
    person = bench.again()
    hot = daemon.make(heat(), 75)
    daemon.record([hot])
    waiting = daemon.propose(
        Proposal(ELBOW_TARGET, "none", "lock", cites=(hot.id,), irreversible="terminal_lock"), "watch"
    )
    assert isinstance(waiting, Claim) and person.pending() == (waiting,)
    true = person.confirm(waiting.id, "alice")
    assert daemon.active() == (true,) and daemon.pending() == ()
    daemon.retire(waiting.id, "bob")
    assert person.active() == () and person.recent()[-1].ended_by == ("bob",)


def _many(project: Path, number: int, start: Any) -> None:
    bench = Bench(project, Clock())
    start.wait()
    for index in range(8):
        reading = bench.read(70 + index, load(f"p{number}"))
        bench.claim(reading, signal=load(f"p{number}"), target=f"device:x/{number}-{index}", restrictions=())


def test_processes_that_write_at_once_lose_nothing(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    start = context.Event()
    workers = [context.Process(target=_many, args=(tmp_path, number, start)) for number in range(3)]
    for worker in workers:
        worker.start()
    start.set()
    for worker in workers:
        worker.join(30)
    assert [worker.exitcode for worker in workers] == [0, 0, 0]
    bench = Bench(tmp_path)
    assert bench.ledger.new_diagnostics() == () and len(bench.ledger.active()) == 24
    assert len({claim.id for claim in bench.ledger.active()}) == 24
    assert all(len(bench.ledger.readings_of(load(f"p{number}"))) == 8 for number in range(3))


@pytest.mark.parametrize("anew", [False, True])
def test_a_shorter_time_counts_at_once_for_what_is_in_force(bench: Bench, anew: bool) -> None:
    assert bench.code(bench.read(70)) == ""
    assert len(bench.ledger.active()) == 1
    bench.clock.now += 700
    shorter = replace(bench.settings(), claim_seconds=600.0)
    if anew:  # the daemon takes up another manifest
        bench.ledger = ledgers.Ledger.open(bench.layout, bench.clock, shorter)
    else:
        bench.ledger.use(shorter)
    assert bench.ledger.active() == ()
    assert bench.ledger.recent()[-1].ended == "expired"
    assert bench.code(bench.read(70)) == ""
    bench.clock.now += 601
    bench.ledger.expire()
    assert bench.ledger.active() == ()


def test_other_tools_count_from_then_on(bench: Bench) -> None:
    restrictions = (Restriction("arm_dance"),)
    assert bench.code(bench.read(70), restrictions=restrictions) == "CLAIM-UNKNOWN-TOOL"
    settings = bench.settings()
    tools = {**settings.tools, "arm_dance": settings.tools["arm_home"]}
    bench.ledger.use(replace(settings, tools=tools))
    assert bench.code(bench.read(70), restrictions=restrictions) == ""
