"""RESTART: start the endpoint again, and know when starting it is no help. Light.

The process may come up and end again a moment later. Each start by itself looks like a repair that worked, so the
loop's own breakers do not see it: the starts are remembered here. The more of the last ones were short, the longer the
next one waits, and after a few of them the endpoint counts as crashing in a loop, which a person has to look at. A
person who asks for another try gets one: a start loop that was reported is forgotten.
"""

import json
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from itertools import takewhile
from pathlib import Path
from typing import Any

from octoform.apply.repair_outcome import Reason, RepairOutcome, RepairVerdict
from octoform.base import clock
from octoform.base.files import parse, private_folder, record
from octoform.diagnostics import Diagnostic
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import Running, ask, is_it, is_marked, running
from octoform.records import dataclass, replace
from octoform.state.files import read_regular, refused, write_atomic
from octoform.state.layout import Layout

FORMAT = 1
RECORD = "starts.json"
SHORT_SECONDS = 10.0
"""A process that ended within so long of its start did not serve."""
MAX_SHORT = 5
"""Starts in a row that did not last, behind which it is a loop."""
FIRST_PAUSE, MAX_PAUSE = 0.5, 8.0
"""Seconds before the second start in a row, and before any: twice as long each time."""
SETTLE_SECONDS = 0.3
"""How long a process has to stay to count as started: what fails on its first breath is gone by then."""
ANSWER_SECONDS = 5.0
_KEPT = 20
_WORDS = 1000


@dataclass(frozen=True, slots=True)
class Start:
    """A start that was tried: ``uptime`` is in seconds of CLOCK_BOOTTIME in that ``boot``; ``why`` it failed, or None.

    ``until`` is when its process was found to be no use any more; None for the last one as long as it is.
    """

    boot: str
    uptime: float
    why: str | None
    until: float | None = None

    @property
    def short(self) -> bool:
        """True when it did not last."""
        return self.why is not None or (self.until is not None and self.until - self.uptime <= SHORT_SECONDS)


@dataclass(frozen=True, slots=True)
class World:
    """The machine as a restart sees it, so that tests can replace it."""

    uptime: Callable[[], float] = clock.boottime
    boot: Callable[[], str] = clock.boot_id
    sleep: Callable[[float], None] = time.sleep
    start: Callable[[Layout, float], tuple[Running | None, Diagnostic | None]] = start_stop.start
    stop: Callable[[Layout], object] = start_stop.stop
    lives: Callable[[Running], bool] = is_it


def restart(layout: Layout, world: World | None = None, *, hung: bool = False) -> RepairOutcome:
    """Start the endpoint unless a person stopped it; with ``hung`` a process that is still not well is ended first.

    Blocks for as long as the start takes and a pause of up to ``MAX_PAUSE`` seconds before it.
    """
    world = world or World()
    if is_marked(layout):
        text = "a person has stopped the endpoint; octoform start starts it"
        return RepairOutcome.refused("restart.stopped", text, again=False)
    there = running(layout)
    if there is not None and not hung and start_stop.accepts(layout):
        return RepairOutcome.done("restart.runs", f"it runs already (process {there.pid})")
    if there is not None and hung and _well(layout):
        return RepairOutcome.done("restart.answers", f"it answers again by itself (process {there.pid})")
    starts = _ended(_of_this_boot(read(layout), world), world.uptime())
    short = len(list(takewhile(lambda one: one.short, reversed(starts))))
    if short >= MAX_SHORT:
        _write(layout, [])
        text = f"it crashes in a loop: {_describe(starts[-short:])}"
        return RepairOutcome.refused("restart.loop", text, again=False)
    if short:
        world.sleep(min(MAX_PAUSE, FIRST_PAUSE * 2 ** (short - 1)))
    if there is not None:
        world.stop(layout)
    return _started(layout, world, starts)


def _started(layout: Layout, world: World, starts: list[Start]) -> RepairOutcome:
    before = _address(layout)
    process, problem = (None, None) if is_marked(layout) else _brought_up(layout, world)
    if is_marked(layout):  # a person was faster than the process, and found none to stop
        world.stop(layout)
        text = "a person has stopped the endpoint meanwhile"
        return RepairOutcome(RepairVerdict.ROLLED_BACK, (Reason("restart.stopped", text),), again=False)
    if process is not None and not _stays(process, world):
        process, why = None, "it ended as soon as it had started"
    elif problem is not None:
        why = ": ".join(filter(None, (problem.summary, problem.detail)))
    else:
        why = ""
    _write(layout, [*starts, Start(world.boot(), world.uptime(), None if process is not None else why[:_WORDS])])
    if process is None:
        return RepairOutcome.failed("restart.start", why[:_WORDS])
    return RepairOutcome.done("restart.serves", f"process {process.pid} serves it{_moved(before, process)}")


def _brought_up(layout: Layout, world: World) -> tuple[Running | None, Diagnostic | None]:
    try:
        return world.start(layout, start_stop.START_SECONDS)
    except OSError as problem:  # a full disk or one that is read-only: no start, and reported as every other failed one
        return None, refused(problem, Path(problem.filename or layout.run))


def _well(layout: Layout) -> bool:
    """True when both doors are answered, the control thread's and the one to the loop that serves clients.

    And when no tool's code holds a device although it was instructed to end: only another process sets that free.
    """
    found = ask(layout, {"op": "status"}, ANSWER_SECONDS)
    gate = found.get("gate") if found is not None else None
    stuck = gate.get("stuck") if isinstance(gate, dict) else None
    return found is not None and not stuck and start_stop.accepts(layout)


def _stays(process: Running, world: World) -> bool:
    world.sleep(SETTLE_SECONDS)
    return world.lives(process)


def read(layout: Layout) -> list[Start]:
    """The starts that are remembered, oldest first; what is no record of ours counts as none."""
    data, _ = read_regular(layout.daemon / RECORD)
    try:
        document = record(parse(data or b""), FORMAT)
        return [_start(each) for each in document["starts"]]
    except (ValueError, LookupError, TypeError):
        return []


def _start(record: Mapping[str, Any]) -> Start:
    until = None if record["until"] is None else float(record["until"])
    why = None if record.get("ok") or record["why"] is None else str(record["why"])  # "ok" is a former version's
    return Start(str(record["boot"]), float(record["uptime"]), why, until)


def _write(layout: Layout, starts: Iterable[Start]) -> None:
    """Remember them; on a full disk the loop's own breakers are what is left."""
    private_folder(layout.daemon)
    document = {"format": FORMAT, "starts": [asdict(one) for one in [*starts][-_KEPT:]]}
    write_atomic(layout.daemon / RECORD, json.dumps(document, indent=1).encode(), 0o600)


def _of_this_boot(starts: list[Start], world: World) -> list[Start]:
    boot = world.boot()
    return [one for one in starts if one.boot == boot]


def _ended(starts: list[Start], now: float) -> list[Start]:
    """The starts with the end of the last one."""
    return [*starts[:-1], replace(starts[-1], until=now)] if starts and starts[-1].until is None else starts


def _describe(starts: list[Start]) -> str:
    why = next((one.why for one in reversed(starts) if one.why), "")
    seconds = starts[-1].uptime - starts[0].uptime
    return f"{len(starts)} starts within {seconds:.0f} s did not last" + (
        f"; the last words were: {why}" if why else ""
    )


def _address(layout: Layout) -> str | None:
    """Where it listened last; None without a network."""
    data, _ = read_regular(layout.run / "network.json")
    try:
        return str(parse(data or b"")["url"])
    except (ValueError, LookupError, TypeError):
        return None


def _moved(before: str | None, process: Running) -> str:
    if before is None or process.url is None or process.url.startswith(before):
        return ""
    return f"; another program has its port, so clients of the network find it at {process.url} (before: {before})"
