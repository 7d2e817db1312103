"""The end of the endpoint's process is reported at once, whatever else is being looked at, and the rest is kept.

Which device is which is asked of the runtime, for seconds on a slow computer. Here that takes a minute, and no test
waits for it.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from daemon_world import DaemonWorld

from octoform.base.processes import start_of
from octoform.daemon.model import Cause, Facts
from octoform.daemon.observe.altered_files import Standing
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.observe.event_queue import EventSources, Timing
from octoform.daemon.observe.log_events import Hearing
from octoform.daemon.observe.observer import Looker, Senses
from octoform.daemon.observe.presence import Asked, Presence
from octoform.daemon.observe.process import Answering, ProcessEar
from octoform.endpoint.process.record import Running, running
from octoform.state.artifact_cache import write_instances
from octoform.state.layout import Layout
from octoform.state.store.lock import myself

DEVICE = "usb-1a86-55d3"
AT_MOST = 20.0
"""Seconds that a busy machine may take for what takes milliseconds; the runtime takes three times as long."""
HARDWARE, PROCESS, FILES = (frozenset((each,)) for each in (Cause.HARDWARE, Cause.PROCESS, Cause.FILES))


@pytest.fixture
def endpoint() -> Iterator[subprocess.Popen[bytes]]:
    """Stands for the process that serves the endpoint."""
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    yield process
    process.kill()
    process.wait()


@pytest.fixture
def layout(tmp_path: Path, endpoint: subprocess.Popen[bytes]) -> Layout:
    """A host with one device and that process."""
    layout = Layout(tmp_path / "project", "bench")
    for folder in (layout.endpoint, layout.run, layout.logs):
        folder.mkdir(parents=True)
    tools = [{"name": "turn", "effect": "actuate", "devices": [DEVICE]}]
    (layout.endpoint / "connection.json").write_text(json.dumps({"tools": tools}))
    write_instances(layout, {DEVICE: {"sysfs": "/sys/devices/usb1/1-5", "port": "1-5", "strength": "positional"}})
    while not (words := Path(f"/proc/{endpoint.pid}/cmdline").read_bytes()):
        time.sleep(0.001)
    argv = [word.decode() for word in words.split(b"\0")[:-1]]
    record = {"pid": endpoint.pid, "start": start_of(endpoint.pid), "argv": argv, "instance": "one"}
    fields = {"boot": myself().boot_id, "since": "2026-11-22T12:00:00Z", "scope": "local", "url": None}
    (layout.run / "process.json").write_text(json.dumps({**record, **fields}))
    return layout


def slow(layout: Layout, endpoint: subprocess.Popen[bytes]) -> Sequence[str]:
    """A runtime in whose time the process ends; its own number stands in a file."""
    lines = ("import os, pathlib, time", f"pathlib.Path({str(layout.run / 'asked')!r}).write_text(str(os.getpid()))")
    return (sys.executable, "-c", "\n".join((*lines, f"os.kill({endpoint.pid}, {signal.SIGKILL})", "time.sleep(60)")))


def answering(*, attached: bool) -> Sequence[str]:
    """A runtime that answers at once."""
    answer = json.dumps({DEVICE: {"attached": attached, "sysfs": "/sys/devices/usb1/1-5"}})
    return (sys.executable, "-c", f"print({answer!r})")


def served(layout: Layout) -> Running:
    found = running(layout)
    assert found is not None
    return found


def test_nobody_waits_for_the_runtime_once_the_process_has_ended(
    layout: Layout, endpoint: subprocess.Popen[bytes]
) -> None:
    process = served(layout)
    began = time.monotonic()
    assert Asked(layout, {}, slow(layout, endpoint))([DEVICE], process) is None
    assert Asked(layout, {}, ("sleep", "60"))([DEVICE], process) is None
    assert time.monotonic() - began < AT_MOST
    assert start_of(int((layout.run / "asked").read_text())) is None, "what was asked is still there"


def test_a_runtime_that_answers_and_one_that_fails(layout: Layout) -> None:
    process = served(layout)
    fields = {DEVICE: {"attached": True, "sysfs": "/sys/devices/usb1/1-5"}}
    assert Asked(layout, {}, answering(attached=True))([DEVICE], process) == fields
    assert Asked(layout, {}, ("false",))([DEVICE], process) is None
    assert Asked(layout, {}, ("/nowhere",))([DEVICE], process) is None


def test_a_look_at_the_hardware_is_cut_short_and_made_again(
    layout: Layout, endpoint: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    runtime = [answering(attached=True)]

    def where(ids: Sequence[str], process: Running | None) -> Mapping[str, Mapping[str, Any]] | None:
        return Asked(layout, {}, runtime[0])(ids, process)

    clock = SystemClock()
    presence = Presence(layout, {"OCTOFORM_SYSROOT": str(tmp_path)}, where)
    senses = Senses(Answering(layout, clock.uptime), Standing(layout), presence, Hearing(layout, clock.uptime))
    look = Looker(layout, clock, senses)
    sources = EventSources(ProcessEar(), (), Timing(interval=1000, ping=1000), clock)
    facts = look(frozenset((Cause.START,)))
    sources.follow(facts)
    assert facts.devices[DEVICE].there
    runtime[0] = slow(layout, endpoint)
    facts = look(HARDWARE)
    assert (facts.put_off, facts.devices[DEVICE].there) == (HARDWARE, True)
    sources.follow(facts)
    assert sources.wait(AT_MOST) == PROCESS
    facts = look(PROCESS)
    assert (facts.process, facts.put_off) == (None, frozenset())
    sources.follow(facts)
    runtime[0] = answering(attached=False)
    assert sources.wait(AT_MOST) == HARDWARE
    assert look(HARDWARE).devices[DEVICE].there is False
    assert sources.wait(0.0) == frozenset()
    sources.close()


def test_a_process_that_ends_while_it_is_asked_is_told_by_the_kernel(
    layout: Layout, endpoint: subprocess.Popen[bytes], tmp_path: Path
) -> None:
    clock = SystemClock()
    asked = Answering(layout, clock.uptime)
    presence = Presence(layout, {"OCTOFORM_SYSROOT": str(tmp_path)}, lambda _ids, _process: {})
    look = Looker(layout, clock, Senses(asked, Standing(layout), presence, Hearing(layout, clock.uptime)))
    sources = EventSources(ProcessEar(), (), Timing(interval=1000, ping=1000), clock)
    sources.follow(look(frozenset((Cause.START,))))

    def ask(_layout: Layout, _seconds: float) -> None:
        endpoint.kill()
        endpoint.wait()

    asked.ask = ask
    facts = look(FILES)
    assert (facts.process is None, facts.answers, facts.put_off) == (False, None, FILES)
    sources.follow(facts)
    assert sources.wait(AT_MOST) == PROCESS
    facts = look(PROCESS)
    assert (facts.process, facts.put_off) == (None, frozenset())
    sources.follow(facts)
    assert sources.wait(AT_MOST) == FILES
    sources.close()


class Bell:
    """An ear that hears hardware once."""

    hold = 0.0
    every = None

    def __init__(self) -> None:
        self._number = os.eventfd(1)

    def fileno(self) -> int:
        return self._number

    def hear(self) -> frozenset[Cause]:
        os.eventfd_read(self._number)
        return HARDWARE

    def close(self) -> None:
        os.close(self._number)


def test_what_comes_together_with_the_end_of_the_process_is_told_after_it(
    layout: Layout, endpoint: subprocess.Popen[bytes]
) -> None:
    sources = EventSources(ProcessEar(), (Bell(),), Timing(interval=1000, ping=1000), SystemClock())
    sources.follow(Facts(0.0, "", "bench", process=served(layout)))
    endpoint.kill()
    endpoint.wait()
    assert sources.wait(AT_MOST) == PROCESS
    assert sources.wait(AT_MOST) == HARDWARE
    assert sources.wait(0.0) == frozenset()
    sources.close()


class Cut(DaemonWorld):
    """A world whose first look is cut short."""

    def look(self, causes: frozenset[Cause]) -> Facts:
        facts = super().look(causes)
        return replace(facts, put_off=HARDWARE) if Cause.START in causes else facts

    def follow(self, facts: Facts) -> None:
        self.at(0.0, lambda: None, *facts.put_off)


def test_a_single_look_does_not_leave_out_what_was_put_off(tmp_path: Path) -> None:
    world = Cut(tmp_path)
    world.supervisor.run(once=True)
    assert [made.causes for made in world.rounds] == [{Cause.START}, HARDWARE]
