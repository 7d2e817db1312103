"""What the daemon remembers: never half written, never silently lost, and never tried for ever."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Outcome, Repair
from octoform.daemon.store import incidents
from octoform.daemon.store.agent_budget import AgentBudget
from octoform.daemon.store.backoff import FLAPS, Backoffs
from octoform.daemon.store.incidents import Incidents
from octoform.daemon.store.json_store import Shelf
from octoform.daemon.store.memory import Memory
from octoform.manifest.model import Daemon
from octoform.state.layout import Layout

FORMER = Path(__file__).with_name("former_incidents.jsonl")
"""Incidents as the first version of the format had them; never written again."""
STAMP = "2026-11-22T12:00:00.000Z"
FINDING = Finding(Kind.FILE_DAMAGED, FaultClass.CORRUPTED_FILE, "file:a", "a is gone", ("a", "gone"), Repair.RESTORE)


def at(uptime: float) -> Facts:
    """A look at this time."""
    return Facts(uptime, STAMP, "bench")


@pytest.fixture
def shelf(tmp_path: Path) -> Shelf:
    layout = Layout(tmp_path, "bench")
    layout.daemon.mkdir(parents=True)
    return Shelf(layout)


def breakers(shelf: Shelf, boot: str = "b1", now: float = 0.0) -> Backoffs:
    found = Backoffs(shelf, boot)
    found.load(now)
    return found


def fail(found: Backoffs, now: float, *, again: bool = True, chain: int = 1) -> None:
    found.begin("k", "t", now)
    repairs = [Repair.RESTORE, Repair.REBUILD][:chain]
    hopeless = None if again else found.of("k").next_of(repairs)
    found.failed("k", now, chain=repairs, limit=3, stamp=STAMP, hopeless=hopeless)


def test_three_tries_then_frozen_over_restarts_and_reboots(shelf: Shelf) -> None:
    for number, now in enumerate((0.0, 5.0, 25.0)):
        found = breakers(shelf, now=now)
        assert found.of("k").frozen is None and found.of("k").tries == number
        fail(found, now)
    assert breakers(shelf).of("k").frozen == "3 tries did not help"
    after = breakers(shelf, boot="b2", now=3.0)
    assert [item.key for item in after.frozen()] == ["k"]
    assert after.thaw("other") == () and after.thaw("t") == ("k",)
    assert breakers(shelf, boot="b2").of("k").tries == 0


@pytest.mark.parametrize(("target", "left"), [("t", (0, 0, 1)), ("u", (1, 1, 0)), ("*", (0, 0, 0)), ("v", (1, 1, 1))])
def test_a_person_who_asks_for_a_target_gets_the_tries_of_its_hour_again(
    shelf: Shelf, target: str, left: tuple[int, int, int]
) -> None:
    found = breakers(shelf)
    found.begin("t tool e", "t", 0.0)
    found.begin("t tool e", "t", 0.0, quick=True)
    found.begin("u tool e", "u", 0.0)
    found.thaw(target)
    for each in (found, breakers(shelf)):
        hours = [
            each.in_hour("t tool e", 1.0),
            each.in_hour("t tool e", 1.0, quick=True),
            each.in_hour("u tool e", 1.0),
        ]
        assert tuple(map(len, hours)) == left


def test_a_repair_that_cannot_help_is_not_tried_again(shelf: Shelf) -> None:
    found = breakers(shelf)
    fail(found, 0.0, again=False, chain=2)
    assert (found.of("k").step, found.of("k").next, found.of("k").frozen) == (1, 0.0, None)
    fail(found, 0.0, again=False, chain=2)
    assert found.of("k").frozen == "2 tries did not help"


def test_what_said_that_it_cannot_help_and_the_tries_of_an_hour_are_known_after_a_reboot(shelf: Shelf) -> None:
    chain = [Repair.RESTART, Repair.REBUILD, Repair.RESTART]
    found = breakers(shelf)
    for now in (100.0, 200.0):
        found.begin("t dependency abc", "t", now)
    found.begin("t dependency def", "t", 300.0, quick=True)
    found.failed("t dependency abc", 200.0, chain=chain, limit=9, stamp=STAMP, hopeless=Repair.RESTART)
    again = breakers(shelf, boot="b2", now=7.0)
    assert again.in_hour("t dependency ghi", 8.0) == (7.0, 7.0), "an uptime of another boot counts from its end"
    assert again.in_hour("t dependency ghi", 8.0, quick=True) == (7.0,)
    assert again.in_hour("t dependency ghi", 3607.0) == again.in_hour("t broken_tool abc", 8.0) == ()
    assert again.of("t dependency abc").next_of(chain) is Repair.REBUILD
    again.failed("t dependency abc", 9.0, chain=chain, limit=9, stamp=STAMP)
    assert again.of("t dependency abc").next_of(chain) is Repair.REBUILD, "the last that is left, and not the first"


def test_what_is_forgotten_is_so_for_the_next_daemon_too(shelf: Shelf) -> None:
    found = breakers(shelf)
    fail(found, 0.0)
    found.forget("other")
    assert breakers(shelf).of("k").tries == 1
    found.forget("k")
    assert breakers(shelf).of("k").tries == found.of("k").tries == 0


def test_what_waits_does_not_wait_for_an_uptime_of_another_boot(shelf: Shelf) -> None:
    found = breakers(shelf)
    fail(found, 1_000_000.0)
    again = breakers(shelf, boot="b2", now=7.0)
    assert (again.of("k").tries, again.of("k").next) == (1, 7.0)


def test_how_long_a_trouble_is_away_counts_over_a_restart_and_begins_again_with_a_boot(shelf: Shelf) -> None:
    found = breakers(shelf)
    fail(found, 0.0)
    found.away("k", 100.0, repaired=True)
    assert breakers(shelf, now=120.0).of("k").gone == 100.0
    assert breakers(shelf, boot="b2", now=7.0).of("k").gone == 7.0, "an uptime of another boot counts from its end"
    there = breakers(shelf)
    there.begin("k", "t", 130.0)
    assert breakers(shelf, now=140.0).of("k").gone is breakers(shelf, boot="b2").of("k").gone is None


@given(st.lists(st.floats(0.1, 4000), min_size=1, max_size=60))
def test_whatever_the_times_a_trouble_that_returns_at_once_is_frozen_after_three(gaps: list[float]) -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        shelf = _Quiet(Layout(Path(folder), "bench"))
        found = breakers(shelf)
        now, tries = 0.0, 0
        for gap in gaps:
            now += gap
            if found.seen("k", "t", now, STAMP).frozen is None and now >= found.of("k").next:
                found.begin("k", "t", now)
                found.away("k", now + 0.01, repaired=True)
                tries += 1
                now += 1.0  # it comes back a second later
        assert tries <= 3 or max(gaps) + 1.0 >= found.hold


class _Quiet(Shelf):
    def write(self, name: str, document: object) -> None:  # type: ignore[override]
        """Not on the disk: this is about times."""


def test_what_comes_back_again_and_again_is_frozen_in_the_end(shelf: Shelf) -> None:
    found = breakers(shelf)
    now, tries = 0.0, 0
    for _ in range(FLAPS * 2):
        if found.seen("k", "t", now, STAMP).frozen is not None:
            break
        found.begin("k", "t", now)
        found.away("k", now + 1, repaired=True)
        tries += 1
        now += 90
    assert tries == FLAPS
    assert "times in an hour" in str(found.of("k").frozen)


def test_what_stayed_away_for_long_is_forgotten(shelf: Shelf) -> None:
    found = breakers(shelf)
    for now in (0.0, 5.0, 25.0):
        fail(found, now)
    found.away("k", 30.0, repaired=False)
    found.forgive(929.0)
    assert found.of("k").frozen is not None
    found.forgive(930.0)
    assert found.of("k").frozen is None and breakers(shelf).of("k").tries == 0


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b'{"format": 2}', b"\xff\xfe", b'{"format":1,"breakers":[1,{}]}'])
def test_a_damaged_file_is_set_aside_and_said(shelf: Shelf, data: bytes) -> None:
    path = shelf.path("breakers.json")
    path.write_bytes(data)
    found = breakers(shelf)
    assert found.all() == ()
    good = data.startswith(b'{"format":1')
    assert [item.code for item in shelf.new_diagnostics()] == ([] if good else ["DAEMON-MEMORY-DAMAGED"])
    assert path.with_name("breakers.json.damaged").exists() == (not good)
    fail(found, 0.0)
    assert breakers(shelf).of("k").tries == 1


def test_a_link_is_neither_read_nor_written_through(shelf: Shelf, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.write_text('{"format": 1, "breakers": []}')
    for name in ("breakers.json", "episodes.jsonl"):
        shelf.path(name).symlink_to(outside)
    before = outside.read_bytes()
    found = Memory.open(shelf.layout, "b1", 0.0, Daemon())
    found.breakers.freeze("k", "t", "why", STAMP)
    found.episodes.begin(FINDING, at(1.0))
    assert outside.read_bytes() == before
    assert len(found.shelf.said) == 2


def test_episodes_survive_a_torn_line_and_go_on_counting(shelf: Shelf) -> None:
    kept = Incidents(shelf, "b1")
    first = kept.begin(FINDING, at(1.0))
    made = RepairOutcome.done("restore.put-back", "\x1b[31mdone", cost=Cost(1, 2, 3, 0.5), seconds=0.5)
    made = replace(made, repair="restore", at=STAMP)
    kept.tried(first, made)
    with shelf.path("episodes.jsonl").open("ab") as file:
        file.write(b'{"format":1,"id":"e2","ki')
    later = Incidents(shelf, "b1")
    later.load()
    assert [item.code for item in shelf.new_diagnostics()] == ["DAEMON-MEMORY-DAMAGED"]
    assert list(later.open) == [FINDING.key]
    assert later.open[FINDING.key].tries == [made.plain()]
    second = later.begin(replace(FINDING, target="file:b"), at(2.0))
    later.end(later.open[FINDING.key], Outcome.REPAIRED, STAMP, 3.0)
    found = incidents.read(shelf)
    assert [(item.id, item.over) for item in found] == [("e1", True), (second.id, False)]
    assert found[0].spent == Cost(1, 2, 3, 0.5)
    for line in shelf.path("episodes.jsonl").read_bytes().splitlines():
        assert line.startswith(b'{"format":1')


def test_a_grown_file_of_episodes_is_cut_and_keeps_what_lasts(shelf: Shelf, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incidents, "GROWN", 5000)
    monkeypatch.setattr(incidents, "KEPT", 3)
    kept = Incidents(shelf, "b1")
    kept.begin(FINDING, at(0.0))
    for number in range(20):
        other = kept.begin(replace(FINDING, target=f"file:{number}"), at(1.0))
        kept.end(other, Outcome.CLEARED, STAMP, 2.0)
    again = Incidents(shelf, "b1")
    again.load()
    assert [item.id for item in incidents.read(shelf)] == ["e1", "e19", "e20", "e21"]
    assert again.begin(replace(FINDING, target="new"), at(3.0)).id == "e22"


def run(purse: AgentBudget, now: float, spent: Cost) -> None:
    entry = purse.begin(now, STAMP)
    assert entry is not None
    purse.settle(entry, spent)


def test_the_purse_counts_a_run_before_it_is_made_and_over_boots_whatever_the_wall_clock_says(shelf: Shelf) -> None:
    purse = AgentBudget(shelf, "b1", 2, None)
    run(purse, 100.0, Cost(1, 0, 0, 0.1))
    purse.begin(200.0, STAMP)  # its daemon is killed here
    again = AgentBudget(shelf, "b1", 2, None)
    again.load()
    assert again.free_at(201.0, STAMP) == 201.0 + 3600.0 - 101.0
    rebooted = AgentBudget(shelf, "b2", 2, None)
    rebooted.load()
    assert rebooted.free_at(10.0, "2020-01-01T00:00:00Z") is not None, "set back: still counted"
    assert rebooted.free_at(3601.0, "2020-01-01T00:00:00Z") is None, "and never for longer than an hour"
    assert rebooted.free_at(10.0, "2026-11-22T13:00:00.000Z") is None


def test_an_agent_that_was_not_called_after_all_costs_nothing(shelf: Shelf) -> None:
    purse = AgentBudget(shelf, "b1", 1, None)
    run(purse, 0.0, Cost())
    assert purse.free_at(1.0, STAMP) is None
    assert json.loads(shelf.path("spend.json").read_bytes())["spent"] == []


def test_a_run_whose_daemon_is_killed_counts_with_all_its_attempts(shelf: Shelf) -> None:
    AgentBudget(shelf, "b1", 4, None).begin(0.0, STAMP)
    again = AgentBudget(shelf, "b1", 4, None)
    again.load()
    assert again.left(1.0, STAMP) == 1


def test_what_nobody_can_tell_counts_as_spent(shelf: Shelf) -> None:
    run(AgentBudget(shelf, "b1", 6, None), 0.0, Cost(1, 0, 0, 0.1))
    shelf.path("spend.json").write_bytes(b'{"format": 1, "spent": [')
    for _ in range(2):  # and over restarts
        again = AgentBudget(shelf, "b1", 6, None)
        again.load(10.0)
        assert again.left(11.0, STAMP) == 0 and again.free_at(11.0, STAMP) == 3610.0
    dear = AgentBudget(shelf, "b2", 6, 1.0)
    run(dear, 5000.0, Cost(1, 0, 0, None))
    assert dear.free_at(5001.0, STAMP) is not None, "no one knows what it cost"


def test_no_agent_is_asked_where_that_cannot_be_written_down(shelf: Shelf) -> None:
    shelf.path("spend.json").mkdir()
    purse = AgentBudget(shelf, "b1", 6, None)
    assert purse.begin(0.0, STAMP) is None and shelf.said
    assert purse.left(0.0, STAMP) == 6


def test_numbers_that_are_none_and_lines_without_end_end_nobody(shelf: Shelf) -> None:
    numbers = '{"key": "k", "target": "t", "tries": 1e999, "step": NaN, "calls": 1e999, "at": NaN}'
    shelf.path("breakers.json").write_text(f'{{"format": 1, "breakers": [{numbers}]}}')
    shelf.path("spend.json").write_text(f'{{"format": 1, "spent": [{numbers}]}}')
    shelf.path("recall.json").write_text('{"format": 1, "recall": {"failing": {"t": ["e", "s", "m", 1e999]}}}')
    shelf.path("episodes.jsonl").write_text("[" * 100_000 + "\n")
    memory = Memory.open(shelf.layout, "b1", 10.0, Daemon())
    assert memory.episodes.open == {}
    assert memory.purse.spent(10.0, STAMP).calls == Daemon().calls_per_hour  # unknown, so all of it
    assert memory.breakers.of("k").tries == 0


def holds(now: Any, former: Any) -> bool:
    """Whether a value has all that the former one had; members may have come."""
    if isinstance(former, dict):
        return isinstance(now, dict) and all(name in now and holds(now[name], value) for name, value in former.items())
    if isinstance(former, list):
        return len(now) == len(former) and all(map(holds, now, former))
    return bool(now == former)


def test_a_record_of_a_former_version_is_read_and_written_with_all_that_it_has(shelf: Shelf) -> None:
    former = FORMER.read_bytes()
    shelf.path("episodes.jsonl").write_bytes(former)
    found = incidents.read(shelf)
    assert shelf.new_diagnostics() == ()
    kept = [json.loads(json.dumps(incidents.to_json(each))) for each in found]
    assert all(map(holds, kept, map(json.loads, former.splitlines()))) and len(kept) == 4
    assert [(made.repair, made.ok) for made in found[2].tries] == [("watch", True), *[("heal", False)] * 3]
    later = Incidents(shelf, "b1")
    later.load()
    later.save()
    assert incidents.read(shelf) == found


@pytest.mark.parametrize(
    ("member", "value", "is_read"),
    [
        ("seconds", 1e999, False),
        ("seconds", "long", False),
        ("verdict", "mended", False),
        ("verdict", "rolled_back", True),
        ("reasons", [["rule", "text"]], False),
        ("reasons", [{"rule": 1, "text": 2}], True),
        ("cost", {"calls": 1e999}, False),
        ("cost", {"calls": 1, "usd": None}, True),
        ("cost", [], True),
        ("at", None, True),
    ],
)
def test_a_damaged_outcome_is_reported_or_read_as_what_can_be_shown(
    shelf: Shelf, member: str, value: Any, is_read: bool
) -> None:
    line = json.loads(FORMER.read_text().splitlines()[0])
    line["tries"][0][member] = value
    shelf.path("episodes.jsonl").write_text(json.dumps(line).replace("Infinity", "1e999") + "\n")
    found = incidents.read(shelf)
    assert (len(found), len(shelf.new_diagnostics())) == ((1, 0) if is_read else (0, 1))
    for each in found:
        text = json.dumps(incidents.to_json(each))
        assert "Infinity" not in text and json.loads(text)["tries"][0]["repair"] == "restart"


def test_what_no_repair_can_help_is_given_up_after_one_try(shelf: Shelf) -> None:
    found = breakers(shelf)
    fail(found, 0.0, again=False)
    assert found.of("k").frozen == "one try did not help"
