"""The one wait: woken by the kernel at once, bursts as one, and never by what the daemon writes itself."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from octoform.base.processes import start_of
from octoform.daemon.model import Cause, Facts
from octoform.daemon.observe import file_events as daemon_paths
from octoform.daemon.observe import hardware
from octoform.daemon.observe.clock_jumps import Moments, SystemClock
from octoform.daemon.observe.event_queue import EventSources, Timing, open_sources, wait_readable
from octoform.daemon.observe.process import ProcessEar
from octoform.endpoint.process.record import Running
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

AT_MOST = 5.0
"""Seconds that a busy machine may take where the kernel takes milliseconds."""
QUIET = 0.45


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    """A project with the folders of an applied host, and a tree that stands for its hardware."""
    layout = Layout(tmp_path / "project", "bench")
    for folder in (layout.logs, layout.run, layout.daemon, layout.endpoint / "clients", layout.runtime):
        folder.mkdir(parents=True)
    (tmp_path / "root/sys/bus/usb/devices").mkdir(parents=True)
    (tmp_path / "root/sys/class/tty").mkdir(parents=True)
    return layout


@pytest.fixture
def sources(layout: Layout, tmp_path: Path) -> Iterator[EventSources]:
    found = open_sources(layout, {"OCTOFORM_SYSROOT": str(tmp_path / "root")}, Timing(interval=1000, ping=1000))
    yield found
    found.close()


@pytest.fixture
def child() -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    yield process
    process.kill()
    process.wait()


def running(process: subprocess.Popen[bytes]) -> Running:
    """The record of a process, as the endpoint's own would be."""
    command = Path(f"/proc/{process.pid}/cmdline")
    while not (words := command.read_bytes()):
        time.sleep(0.001)
    began = start_of(process.pid)
    assert began is not None
    argv = tuple(word.decode() for word in words.split(b"\0")[:-1])
    return Running(process.pid, began, argv, "one", "now", "local", None)


def facts(process: Running | None = None) -> Facts:
    return Facts(0.0, "", "bench", process=process)


def test_the_end_of_the_process_is_told_within_milliseconds(
    sources: EventSources, child: subprocess.Popen[bytes]
) -> None:
    sources.follow(facts(running(child)))
    assert sources.wait(0.01) == frozenset()
    ended: list[float] = []

    def end() -> None:
        ended.append(time.monotonic())
        os.kill(child.pid, signal.SIGKILL)

    timer = threading.Timer(0.05, end)
    timer.start()
    assert sources.wait(AT_MOST) == {Cause.PROCESS}
    assert time.monotonic() - ended[0] < 0.5
    timer.join()
    assert sources.wait(0.01) == frozenset()


def test_a_process_that_ended_before_it_was_followed_is_told_too(
    sources: EventSources, child: subprocess.Popen[bytes]
) -> None:
    seen = running(child)
    child.kill()
    child.wait()
    sources.follow(facts(seen))
    assert sources.wait(AT_MOST) == {Cause.PROCESS}


def test_another_process_with_that_number_is_not_followed(
    sources: EventSources, child: subprocess.Popen[bytes]
) -> None:
    seen = running(child)
    other = Running(seen.pid, seen.start - 1, seen.argv, "two", "now", "local", None)
    sources.follow(facts(other))
    assert sources.wait(AT_MOST) == {Cause.PROCESS}
    child.kill()
    assert sources.wait(QUIET) == frozenset()


def test_what_others_write_wakes_it(sources: EventSources, layout: Layout) -> None:
    written = {
        layout.output("serve"): Cause.FILES,
        layout.runtime / "devices.py": Cause.FILES,
        layout.endpoint / "clients" / "client.json": Cause.FILES,
        layout.project / "octopus.yaml": Cause.FILES,
        layout.stop_mark: Cause.FILES,
        layout.instances: Cause.FILES,
        layout.lock: Cause.FILES,
        layout.run / "process.json": Cause.PROCESS,
        layout.daemon / "paused.json": Cause.ASKED,
        layout.call_log: Cause.LOG,
    }
    for path, cause in written.items():
        assert write_atomic(path, b"{}") is None
        assert cause in sources.wait(AT_MOST), path
        sources.follow(facts())
        while sources.wait(0.0):
            pass


def test_what_the_daemon_and_the_endpoint_write_every_day_does_not_wake_it(
    sources: EventSources, layout: Layout
) -> None:
    """Else each look would be the reason of the next."""
    names = ("health.json", "episodes.jsonl", "breakers.json", "readings.jsonl", "claims.json", "cursors.json")
    paths = [layout.daemon / name for name in (*names, "daemon.json", "spend.json")]
    paths += [layout.run / name for name in ("limits.json", "restrictions.json", "tokens.json", "tunnel.json")]
    paths += [layout.logs / "audit.jsonl", layout.logs / "audit.seal", layout.runtime / "__pycache__" / "a.pyc"]
    paths += [layout.journal, layout.local / "state.json.backup", layout.attempts / "1" / "prompt.md"]
    for folder in (layout.runtime / "__pycache__", layout.attempts / "1"):
        folder.mkdir(parents=True)
    sources.follow(facts())
    for path in paths:
        assert write_atomic(path, b"{}") is None
    assert sources.wait(QUIET) == frozenset()


def test_a_folder_that_is_replaced_is_listened_to_again(sources: EventSources, layout: Layout) -> None:
    layout.endpoint.rename(layout.local / "elsewhere")
    assert Cause.FILES in sources.wait(AT_MOST)
    sources.follow(facts())
    layout.endpoint.mkdir()
    assert Cause.FILES in sources.wait(AT_MOST)
    sources.follow(facts())
    (layout.endpoint / "launch").write_text("new")
    assert Cause.FILES in sources.wait(AT_MOST)


def test_a_burst_comes_as_one_and_a_talkative_log_seldom(sources: EventSources, layout: Layout) -> None:
    for number in range(200):
        (layout.committed / f"file{number}").write_text("x")
    assert sources.wait(AT_MOST) == {Cause.FILES}
    assert sources.wait(0.0) == frozenset()
    found = 0
    end = time.monotonic() + 0.5
    while (left := end - time.monotonic()) > 0:
        with layout.call_log.open("a") as log:
            log.write("{}\n")
        found += Cause.LOG in sources.wait(min(left, 0.02))
    assert found == 1


def test_hardware_of_a_tree_is_told_also_on_a_bus_that_was_not_there(sources: EventSources, tmp_path: Path) -> None:
    (tmp_path / "root/sys/bus/usb/devices/1-1").symlink_to("nowhere")
    assert sources.wait(AT_MOST) == {Cause.HARDWARE}
    (tmp_path / "root/sys/bus/i2c/devices").mkdir(parents=True)
    assert sources.wait(AT_MOST) == {Cause.HARDWARE}
    (tmp_path / "root/sys/bus/i2c/devices/1-0040").symlink_to("nowhere")
    assert sources.wait(AT_MOST) == {Cause.HARDWARE}
    (tmp_path / "root/sys/bus/usb/devices/1-1").unlink()
    assert sources.wait(AT_MOST) == {Cause.HARDWARE}


@pytest.mark.parametrize(
    ("action", "path", "told"),
    [
        ("add", "/devices/pci0000:00/0000:00:14.0/usb1/1-2", True),
        ("unbind", "/devices/platform/soc/20200000.gpio", True),
        ("change", "/devices/LNXSYSTM:00/PNP0C0A:00/power_supply/BAT0", False),
        ("add", "/devices/virtual/net/veth0", False),
        ("add", "/module/uvcvideo", False),
        ("remove", "/kernel/slab/:a-0000136", False),
    ],
)
def test_only_hardware_that_comes_or_goes_counts(action: str, path: str, told: bool) -> None:
    assert hardware.telling(action, path) is told


def test_where_the_kernel_announces_nothing_the_names_are_looked_at(tmp_path: Path) -> None:
    devices = tmp_path / "sys/bus/usb/devices"
    devices.mkdir(parents=True)
    ear = hardware.Glance(tmp_path)
    assert ear.hear() == frozenset()
    (devices / "1-1").mkdir()
    assert ear.hear() == {Cause.HARDWARE}
    assert ear.hear() == frozenset()


def test_somebody_else_can_end_the_wait(sources: EventSources) -> None:
    threading.Timer(0.05, sources.rouse).start()
    began = time.monotonic()
    assert sources.wait(None) == frozenset()
    assert time.monotonic() - began < AT_MOST


class Clock(SystemClock):
    """Clocks that a test sets; a wait only moves them."""

    def __init__(self) -> None:
        self.now, self.slept, self.set = 100.0, 0.0, 0.0
        self.waits: list[float] = []

    def uptime(self) -> float:
        return self.now

    def awake(self) -> float:
        return self.now - self.slept

    def wall(self) -> float:
        return 1e9 + self.now + self.set

    def poll(self, numbers: Sequence[int], seconds: float | None) -> set[int]:
        assert seconds is not None
        self.waits.append(seconds)
        self.now += seconds
        return set()


def timed(clock: Clock, *ears: hardware.Glance) -> EventSources:
    return EventSources(ProcessEar(), ears, Timing(interval=300, ping=3), clock, clock.poll)


def test_without_a_process_there_is_one_wait_for_the_whole_interval() -> None:
    clock = Clock()
    sources = timed(clock)
    assert sources.wait(None) == {Cause.INTERVAL}
    assert clock.waits == [300.0]
    assert sources.wait(10) == frozenset()
    sources.close()


def test_a_process_is_asked_every_few_seconds(child: subprocess.Popen[bytes]) -> None:
    clock = Clock()
    sources = timed(clock)
    sources.follow(facts(running(child)))
    lines = [sources.wait(None) for _ in range(100)]
    assert lines == [frozenset((Cause.PING,))] * 99 + [frozenset((Cause.PING, Cause.INTERVAL))]
    sources.close()


def test_a_machine_that_slept_and_a_clock_that_was_set_are_noticed() -> None:
    clock = Clock()
    sources = timed(clock)
    clock.slept, clock.now = 3600.0, clock.now + 3600.0
    assert Cause.RESUMED in sources.wait(None)
    clock.set = -86400.0
    assert sources.wait(None) == {Cause.RESUMED}
    assert sources.wait(1.0) == frozenset()
    sources.close()


def test_a_clock_that_is_only_corrected_says_nothing() -> None:
    clock = Clock()
    moments = Moments(clock)
    for _ in range(100):
        clock.now += 10.0
        clock.set += 0.1
        assert not moments.moved()


def test_an_ear_without_a_descriptor_is_looked_at_in_its_time(tmp_path: Path) -> None:
    clock = Clock()
    (tmp_path / "sys/bus/usb/devices").mkdir(parents=True)
    sources = timed(clock, hardware.Glance(tmp_path))
    assert sources.wait(11.0) == frozenset()
    assert clock.waits == [2.0, 2.0, 2.0, 2.0, 2.0, 1.0]
    (tmp_path / "sys/bus/usb/devices/1-1").mkdir()
    assert sources.wait(11.0) == {Cause.HARDWARE}
    sources.close()


def test_nothing_is_watched_that_the_daemon_writes(layout: Layout) -> None:
    own = next(each for each in daemon_paths.signs(layout) if each.folder == layout.daemon)
    assert set(own.names) == set(daemon_paths.ASKED)


def test_waiting_ends_when_a_descriptor_can_be_read() -> None:
    read, write = os.pipe()
    assert wait_readable([read], 0.0) == set()
    os.write(write, b"x")
    assert wait_readable([read], 5.0) == {read}
    os.close(read)
    os.close(write)
