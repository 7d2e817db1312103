"""The lock: one holder at a time, a dead one's clears itself once, a live one's never."""

import fcntl
import json
import os
import select
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from octoform.base.processes import start_of
from octoform.state.layout import Layout
from octoform.state.store.lock import (
    Holder,
    Liveness,
    Lock,
    Process,
    Waiting,
    acquire,
    force_unlock,
    liveness,
    myself,
    read_holder,
)


def taken(layout: Layout, operation: str = "apply", waiting: Waiting | None = None) -> Lock:
    outcome = acquire(layout, operation, waiting)
    assert outcome.lock is not None, outcome.diagnostics
    return outcome.lock


def rewrite(layout: Layout, **changes: object) -> None:
    """Change the lock file in place."""
    document = json.loads(layout.lock.read_bytes())
    layout.lock.write_text(json.dumps({**document, **changes}))


def child(work: Callable[[], None]) -> int:
    pid = os.fork()
    if pid == 0:
        try:
            work()
        finally:
            os._exit(1)
    return pid


def test_a_second_one_is_refused_and_told_who_holds_it(layout: Layout) -> None:
    with taken(layout, "destroy") as lock:
        outcome = acquire(layout, "apply")
        assert outcome.lock is None
        [problem] = outcome.diagnostics
        assert problem.code == "STATE-LOCKED"
        assert f"destroy by pid {os.getpid()} on {os.uname().nodename}" in problem.summary
        assert lock.holder.id in (problem.detail or "") and lock.holder.created in (problem.detail or "")
    assert not layout.lock.exists()
    taken(layout).release()


def test_the_lock_file_tells_all(layout: Layout) -> None:
    with taken(layout) as lock:
        document = json.loads(layout.lock.read_bytes())
        assert document["pid"] == os.getpid()
        assert document["start_time"] == start_of(os.getpid())
        assert document["boot_id"] == Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        assert (document["host"], document["operation"]) == (os.uname().nodename, "apply")
        assert (document["id"], lock.held()) == (lock.holder.id, True)
        assert layout.lock.stat().st_mode & 0o777 == 0o600


def test_two_hosts_do_not_lock_each_other(layout: Layout) -> None:
    with taken(layout), taken(Layout(layout.project, "attic")):
        pass


def test_a_killed_holder_s_lock_clears_itself_with_a_notice(layout: Layout) -> None:
    reader, writer = os.pipe()

    def hold() -> None:
        taken(layout, "apply")
        os.write(writer, b"x")
        signal.pause()

    pid = child(hold)
    os.read(reader, 1)
    assert acquire(layout, "apply").lock is None
    os.kill(pid, signal.SIGKILL)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)  # dead, and still a zombie
    outcome = acquire(layout, "apply")
    assert outcome.lock is not None
    assert len(outcome.notices) == 1 and f"pid {pid}" in outcome.notices[0]
    outcome.lock.release()
    os.waitpid(pid, 0)
    os.close(reader)
    os.close(writer)


def test_a_pid_that_was_given_again_does_not_keep_the_lock(layout: Layout) -> None:
    taken(layout)
    rewrite(layout, start_time=json.loads(layout.lock.read_bytes())["start_time"] - 1)
    outcome = acquire(layout, "apply")
    assert outcome.lock is not None and len(outcome.notices) == 1


def test_a_reboot_frees_the_lock(layout: Layout) -> None:
    taken(layout)
    rewrite(layout, boot_id="11111111-2222-3333-4444-555555555555")
    assert acquire(layout, "apply").lock is not None


@pytest.mark.parametrize("what", [{"host": "elsewhere"}, {"machine": "0123456789ab"}, {"boot_id": ""}])
def test_another_machine_s_lock_is_never_broken(layout: Layout, what: dict[str, str]) -> None:
    taken(layout)
    rewrite(layout, **{"boot_id": "11111111-2222-3333-4444-555555555555", "pid": 4_000_000, **what})
    before = layout.lock.read_bytes()
    outcome = acquire(layout, "apply")
    assert outcome.lock is None and layout.lock.read_bytes() == before
    [problem] = outcome.diagnostics
    assert "from another machine" in problem.summary
    assert f"force-unlock {json.loads(before)['id']}" in (problem.hint or "")


def test_a_holder_in_another_container_is_judged_by_the_kernel_s_lock(layout: Layout) -> None:
    """Its pid means nothing here; but it keeps a kernel lock on the file for as long as it lives."""
    lock = taken(layout)
    rewrite(layout, namespace="pid:[1]", pid=4_000_000)
    assert acquire(layout, "apply").lock is None
    os.close(lock._descriptor or 0)
    lock._descriptor = None
    assert acquire(layout, "apply").lock is not None


def test_liveness_in_every_case(tmp_path: Path) -> None:
    (tmp_path / "7").mkdir()
    stat = tmp_path / "7/stat"
    stat.write_text("7 (a) b (c) S " + " ".join(["0"] * 18) + " 500 0 0\n")
    me = Process(1, 5, "boot", "machine", "ns", "host")
    holder = replace(me, pid=7, start_time=500)
    cases = [
        (holder, Liveness.ALIVE),
        (replace(holder, start_time=499), Liveness.DEAD),
        (replace(holder, start_time=None), Liveness.DEAD),
        (replace(holder, pid=8), Liveness.DEAD),
        (replace(holder, boot_id="other"), Liveness.DEAD),
        (replace(holder, boot_id="other", host="x"), Liveness.ELSEWHERE),
        (replace(holder, boot_id="other", machine="x"), Liveness.ELSEWHERE),
        (replace(holder, boot_id=""), Liveness.ELSEWHERE),
        (replace(holder, host="renamed"), Liveness.ALIVE),
        (replace(holder, namespace="x"), Liveness.HIDDEN),
    ]
    for process, wanted in cases:
        assert liveness(process, me, tmp_path) is wanted, process
    stat.write_text(stat.read_text().replace(" S ", " Z "))
    assert liveness(holder, me, tmp_path) is Liveness.DEAD
    no_boot = replace(me, boot_id="")
    assert liveness(replace(holder, boot_id=""), no_boot, tmp_path) is Liveness.HIDDEN
    assert liveness(replace(holder, boot_id="", host="x"), no_boot, tmp_path) is Liveness.ELSEWHERE


class Time:
    """A clock that moves only when somebody sleeps."""

    def __init__(self, at: dict[int, Callable[[], None]] | None = None) -> None:
        self.now = 1000.0
        self.naps: list[float] = []
        self._at = at or {}

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.naps.append(seconds)
        self.now += seconds
        self._at.get(len(self.naps), lambda: None)()


def test_waiting_ends_at_the_timeout(layout: Layout) -> None:
    time, found = Time(), list[Holder]()
    with taken(layout) as lock:
        outcome = acquire(layout, "apply", Waiting(10.0, time.clock, time.sleep, found.append))
    assert outcome.lock is None and outcome.diagnostics[0].code == "STATE-LOCKED"
    assert time.now == pytest.approx(1010.0)
    assert time.naps[:4] == [0.1, 0.2, 0.4, 0.8] and max(time.naps) <= 2.0
    assert [holder.id for holder in found] == [lock.holder.id]


def test_waiting_ends_when_the_holder_does(layout: Layout) -> None:
    lock = taken(layout)
    time = Time({3: lock.release})
    outcome = acquire(layout, "apply", Waiting(60.0, time.clock, time.sleep))
    assert outcome.lock is not None and outcome.notices == ()
    assert len(time.naps) == 3


def test_no_waiting_without_a_timeout(layout: Layout) -> None:
    time = Time()
    with taken(layout):
        assert acquire(layout, "apply", Waiting(0.0, time.clock, time.sleep)).lock is None
    assert time.naps == []


def test_force_unlock_needs_the_right_id(layout: Layout) -> None:
    assert [item.code for item in force_unlock(layout, "x")] == ["STATE-NOT-LOCKED"]
    lock = taken(layout)
    [problem] = force_unlock(layout, "x")
    assert problem.code == "STATE-LOCK-ID" and lock.holder.id in (problem.hint or "")
    assert lock.held()
    assert force_unlock(layout, lock.holder.id) == []
    assert not lock.held()


def test_a_forced_lock_that_another_took_is_not_released_by_the_first(layout: Layout) -> None:
    first = taken(layout)
    force_unlock(layout, first.holder.id)
    with taken(layout) as second:
        first.release()
        assert second.held()


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"pid": "x"}', b'{"id": 1}'])
def test_a_file_that_is_no_lock_is_neither_taken_nor_removed(layout: Layout, content: bytes) -> None:
    taken(layout).release()
    layout.lock.write_bytes(content)
    outcome = acquire(layout, "apply")
    assert outcome.lock is None and outcome.diagnostics[0].code == "STATE-LOCK-UNREADABLE"
    assert force_unlock(layout, "x")[0].code == "STATE-LOCK-UNREADABLE"
    assert layout.lock.read_bytes() == content


def test_a_lock_that_is_a_link_is_refused(layout: Layout, tmp_path: Path) -> None:
    taken(layout).release()
    layout.lock.symlink_to(tmp_path / "foreign")
    assert acquire(layout, "apply").diagnostics[0].code == "STATE-LINK"
    assert layout.lock.is_symlink()


def test_a_guard_that_is_never_let_go_is_an_error_and_no_hang(layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    taken(layout).release()
    monkeypatch.setattr("octoform.state.store.lock._GUARD_SECONDS", 0.01)
    with layout.lock.with_name("lock.guard").open("rb+") as guard:
        fcntl.flock(guard, fcntl.LOCK_EX)
        outcome = acquire(layout, "apply")
    assert outcome.lock is None and "guard" in outcome.diagnostics[0].summary


def test_many_that_find_one_dead_holder_end_with_one_lock(layout: Layout) -> None:
    """Eight processes start at one signal, each finds the dead lock; exactly one has the lock at the end."""
    racers = 8
    for _ in range(6):
        taken(layout)
        rewrite(layout, start_time=1)
        go_reader, go_writer = os.pipe()
        answer_reader, answer_writer = os.pipe()

        def race(go: int = go_reader, other: int = go_writer, answers: int = answer_writer) -> None:
            os.close(other)
            os.read(go, 1)
            outcome = acquire(layout, "apply")
            os.write(answers, b"1" if outcome.lock is not None else b"0")
            signal.pause()  # what it has it keeps until it is killed

        pids = [child(race) for _ in range(racers)]
        os.close(go_reader)
        os.close(go_writer)  # the signal: end of file for all at once
        answers = b""
        while len(answers) < racers:
            answers += os.read(answer_reader, racers)
        holder = read_holder(layout)
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        os.close(answer_reader)
        os.close(answer_writer)
        assert answers.count(b"1") == 1
        assert isinstance(holder, Holder) and holder.process.pid in pids
        taken(layout).release()


class Racer:
    """A process that takes the lock and sees a dead holder only when it is let: its /proc has a pipe for that one."""

    def __init__(self, layout: Layout, proc: Path, dead: int, other: tuple[int, int] | None) -> None:
        """``other`` is the racer before this one: its pid, and its gate as this process holds it open."""
        self.gate = proc / str(dead) / "stat"
        self.gate.parent.mkdir(parents=True)
        os.mkfifo(self.gate)
        for name in ("sys", "self", *([str(other[0])] if other else [])):
            (proc / name).symlink_to(Path("/proc") / name)
        self.says, writer = os.pipe()

        def race() -> None:
            if other is not None:
                os.close(other[1])
            (proc / str(os.getpid())).symlink_to(f"/proc/{os.getpid()}")
            flock = fcntl.flock

            def telling(descriptor: Any, operation: int) -> None:
                try:
                    flock(descriptor, operation)
                except BlockingIOError:
                    os.write(writer, b"w")
                    raise

            fcntl.flock = telling
            outcome = acquire(layout, "apply", proc=proc)
            os.write(writer, b"1" if outcome.lock is not None else b"0")
            signal.pause()  # what it has it keeps until it is killed

        self.pid = child(race)
        os.close(writer)

    def at_the_gate(self) -> int | None:
        """The open gate, once the racer asks whether the holder lives."""
        try:
            return os.open(self.gate, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            return None

    def waits(self) -> bool:
        """Whether it has been kept off by another racer."""
        return bool(select.select([self.says], [], [], 0)[0])

    def answer(self) -> str:
        while (found := os.read(self.says, 1)) == b"w":
            pass
        return found.decode()

    def end(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        os.close(self.says)


def test_of_two_that_found_the_same_dead_holder_the_second_does_not_clear_the_first_s_lock(
    layout: Layout, tmp_path: Path
) -> None:
    """Both have the dead holder before them; the first clears it and takes the lock; then the second goes on."""
    dead = 4_000_000
    taken(layout)
    rewrite(layout, pid=dead)
    first = Racer(layout, tmp_path / "a", dead, None)
    while (gate := first.at_the_gate()) is None:
        os.sched_yield()
    second = Racer(layout, tmp_path / "b", dead, (first.pid, gate))
    second_gate = None
    while second_gate is None and not second.waits():
        second_gate = second.at_the_gate()
    os.close(gate)
    answers = first.answer()
    if second_gate is not None:
        os.close(second_gate)
    answers += second.answer()
    holder = read_holder(layout)
    first.end()
    second.end()
    assert answers == "10"
    assert isinstance(holder, Holder) and holder.process.pid == first.pid


def test_myself_is_alive() -> None:
    assert liveness(myself(), myself()) is Liveness.ALIVE
