"""Restarts: a loop of crashes is known for what it is, waited for, reported, and forgiven when a person asks."""

import errno
import json
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from octoform.daemon.repair import restart as daemon_restart
from octoform.daemon.repair.restart import MAX_PAUSE, MAX_SHORT, SHORT_SECONDS, World, read, restart
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process import record as desired_state
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import Running
from octoform.state.layout import Layout


@dataclass
class Machine:
    """A machine in virtual time, whose endpoint lives ``life`` seconds after each start (None: it does not come up)."""

    layout: Layout
    life: float | None = 3600.0
    now: float = 1000.0
    boot: str = "one"
    settled: bool = True
    slept: list[float] = field(default_factory=list)
    started: int = 0
    stopped: int = 0
    person: bool = False

    def restart(self) -> tuple[bool, bool, str]:
        done = restart(
            self.layout,
            World(lambda: self.now, lambda: self.boot, self._sleep, self._start, self._stop, lambda _: self.settled),
        )
        self.now += self.life or 0.0
        return done.ok, done.again, done.detail

    def _sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds

    def _start(self, layout: Layout, _: float) -> tuple[Running | None, Diagnostic | None]:
        self.started += 1
        if self.person:
            desired_state.mark(layout)
        if self.life is None:
            return None, error("ENDPOINT-START-FAILED", "the endpoint did not start", detail="ImportError: nothing")
        return Running(self.started, 1, (), str(self.started), "", "intranet", "http://192.0.2.1:7778/mcp"), None

    def _stop(self, _: Layout) -> None:
        self.stopped += 1


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(Layout(tmp_path, "bench"))


def test_a_disk_that_refuses_a_start_is_a_start_that_failed(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(layout: Layout, _: float) -> tuple[Running | None, Diagnostic | None]:
        raise OSError(errno.EROFS, "Read-only file system", str(layout.run))

    monkeypatch.setattr(machine, "_start", full)
    ok, again, why = machine.restart()
    assert not ok and again and "Read-only file system" in why


def test_a_start_that_lasts_costs_no_pause_however_often_it_is_needed(machine: Machine) -> None:
    for _ in range(3 * MAX_SHORT):
        assert machine.restart()[0]
    assert max(machine.slept) < 1.0
    assert machine.started == 3 * MAX_SHORT


@pytest.mark.parametrize("life", [0.5, SHORT_SECONDS - 2, None])
def test_crashes_one_after_the_other_are_a_loop_after_a_few_ever_longer_pauses(
    machine: Machine, life: float | None
) -> None:
    machine.life = life
    ends = [machine.restart() for _ in range(MAX_SHORT)]
    assert [ok for ok, _, _ in ends] == [life is not None] * MAX_SHORT
    pauses = [seconds for seconds in machine.slept if seconds >= 0.5]
    assert pauses == sorted(pauses) and max(pauses) <= MAX_PAUSE and len(pauses) == MAX_SHORT - 1
    ok, again, detail = machine.restart()
    assert (ok, again) == (False, False)
    assert "crashes in a loop" in detail and f"{MAX_SHORT} starts" in detail
    assert ("ImportError: nothing" in detail) == (life is None)
    assert machine.started == MAX_SHORT


def test_a_person_who_asks_again_gets_new_tries_after_a_loop(machine: Machine) -> None:
    machine.life = None
    for _ in range(MAX_SHORT + 1):
        machine.restart()
    machine.life = 3600.0
    assert machine.restart()[0]


def test_starts_of_another_boot_and_a_damaged_record_count_for_nothing(machine: Machine) -> None:
    machine.life = 1.0
    for _ in range(MAX_SHORT):
        machine.restart()
    machine.boot = "two"
    assert machine.restart()[0]
    for text in ('{"format": 2, "starts": []}', "[", '{"format": 1, "starts": [{}]}', "null"):
        (machine.layout.daemon / "starts.json").write_text(text)
        assert read(machine.layout) == []
        assert machine.restart()[0]


def test_starts_as_a_former_version_wrote_them_count(machine: Machine) -> None:
    machine.layout.daemon.mkdir(parents=True)
    known = [
        {"boot": machine.boot, "uptime": 1.0, "ok": True, "why": "", "until": 90.0},
        {"boot": machine.boot, "uptime": 99.0, "ok": False, "why": "no such file", "until": None},
    ]
    (machine.layout.daemon / "starts.json").write_text(json.dumps({"format": 1, "starts": known}))
    assert [(each.why, each.short) for each in read(machine.layout)] == [(None, False), ("no such file", True)]
    assert machine.restart()[0]
    assert [each.why for each in read(machine.layout)] == [None, "no such file", None]


def test_what_ends_on_its_first_breath_was_not_started(machine: Machine) -> None:
    machine.settled = False
    assert machine.restart() == (False, True, "it ended as soon as it had started")


def test_a_stop_by_a_person_holds_before_a_start_and_during_one(machine: Machine) -> None:
    machine.person = True
    assert machine.restart() == (False, False, "a person has stopped the endpoint meanwhile")
    assert (machine.started, machine.stopped) == (1, 1)
    ok, again, _ = machine.restart()
    assert (ok, again, machine.started) == (False, False, 1)
    desired_state.unmark(machine.layout)
    machine.person = False
    assert machine.restart()[0]


def test_another_port_is_told_with_the_one_before(machine: Machine) -> None:
    machine.layout.run.mkdir(parents=True)
    record = {"format": 1, "url": "http://192.0.2.1:7777"}
    (machine.layout.run / "network.json").write_text(json.dumps(record))
    assert "http://192.0.2.1:7778/mcp (before: http://192.0.2.1:7777)" in machine.restart()[2]


@pytest.mark.parametrize(
    ("told", "accepts", "restarted"),
    [
        ({"gate": {"stuck": []}}, True, False),
        ({"gate": {"stuck": [{"tool": "move"}]}}, True, True),
        ({"gate": {"stuck": []}}, False, True),
        (None, True, True),
    ],
)
def test_a_hung_process_is_ended_only_if_it_is_not_well_by_now(
    machine: Machine, monkeypatch: pytest.MonkeyPatch, told: object, accepts: bool, restarted: bool
) -> None:
    there = Running(7, 1, (), "seven", "", "local", None)
    monkeypatch.setattr(daemon_restart, "running", lambda _: there)
    monkeypatch.setattr(daemon_restart, "ask", lambda *_: told)
    monkeypatch.setattr(start_stop, "accepts", lambda _: accepts)
    world = World(lambda: 0.0, lambda: "one", machine._sleep, machine._start, machine._stop, lambda _: True)
    assert restart(machine.layout, world, hung=True).ok
    assert (machine.stopped, machine.started) == (int(restarted), int(restarted))
