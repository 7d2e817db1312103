"""How each run ends when something goes wrong: in time, for the right reason, and with nothing left running."""

import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from agent_runs import NOWHERE, WRITE, Ran, spec_for
from harness.matrix import PATIENT_PROGRAMS, PROGRAMS, Expected, Subject
from model_server import serve

from octoform.harness.containment import orphans
from octoform.harness.port import ExitReason, Task

DONE = {"text": "done"}
WORK: list[dict[str, Any]] = [{"shell": WRITE}, DONE]
FINISHED = Expected(ExitReason.FINISHED, output=True)
UNREACHABLE = Expected(ExitReason.UNREACHABLE)


@dataclass(frozen=True)
class Case:
    """What the model's side does, what has to come of it, and limits of the task that differ from the usual.

    ``waits``: the run goes on for seconds, because somebody's patience has to come to its end.
    """

    turns: Sequence[dict[str, Any]]
    expected: Expected
    limits: dict[str, float] = field(default_factory=dict)
    waits: bool = False


CASES = {
    "401": Case([{"status": 401}], Expected(ExitReason.AUTH)),
    "402": Case([{"status": 402}], Expected(ExitReason.REFUSED)),
    "404": Case([{"status": 404}], Expected(ExitReason.REFUSED)),
    "429": Case([{"status": 429}], Expected(ExitReason.RATE_LIMIT), waits=True),
    "500": Case([{"status": 500}], UNREACHABLE, waits=True),
    "500, 429, ok": Case(
        [{**WORK[0], "fail_first": [{"status": 500}, {"status": 429}]}, DONE],
        FINISHED,
        {"patience_seconds": 30.0},
        waits=True,
    ),
    "broken arguments": Case([{"malformed": "json"}, *WORK], FINISHED),
    "unknown tool": Case([{"malformed": "unknown_tool"}, *WORK], FINISHED),
    "missing arguments": Case([{"malformed": "missing_args"}, *WORK], FINISHED),
    "same call permanently": Case([{"shell": "true"}], Expected(ExitReason.TURN_LIMIT), {"turns": 6}),
    "cut": Case([{"text": "half of this is lost", "drop": "mid"}], UNREACHABLE, waits=True),
    "words only": Case([{"text": "All is well."}], Expected(ExitReason.FINISHED)),
}
CELLS = [
    pytest.param(*program.values, name, id=f"{name}-{program.id}", marks=program.marks)
    for name, case in CASES.items()
    for program in (PATIENT_PROGRAMS if case.waits else PROGRAMS)
]


def settled(ran: Ran, expected: Expected) -> None:
    """The run ended as it had to; the log has the reason otherwise."""
    log = ran.task.log.read_text("utf-8", "replace")
    assert ran.outcome.reason == expected.reason, (ran.outcome, log[-4000:])
    if expected.output is not None:
        assert ran.task.output.exists() is expected.output, (ran.outcome, log[-4000:])
    assert ran.outcome.seconds < ran.task.limits.wall_seconds


@pytest.mark.parametrize(("subject", "name"), CELLS)
def test_what_the_model_does(
    subject: Subject, name: str, task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    case = CASES[name]
    with serve(case.turns) as server:
        ran = run(spec_for(subject.name, server, api=subject.api), task_for(subject.model, **case.limits))
        assert server.replies, "the program never asked its model"
    settled(ran, subject.differs.get(name, case.expected))


@pytest.mark.parametrize("subject", PATIENT_PROGRAMS)
def test_a_model_that_is_down(subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    ran = run(spec_for(subject.name, NOWHERE, api=subject.api), task_for(subject.model))
    settled(ran, subject.differs.get("down", UNREACHABLE))


@pytest.mark.parametrize("subject", PATIENT_PROGRAMS)
def test_a_reply_that_stalls(subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    with serve([{"text": "half of this, and then nothing", "stall": 600}]) as server:
        task = task_for(subject.model, idle_seconds=subject.start_seconds)
        ran = run(spec_for(subject.name, server, api=subject.api), task)
        assert server.replies, "the program never asked its model"
    settled(ran, subject.differs.get("stall", Expected(ExitReason.IDLE)))


@pytest.mark.parametrize("subject", PROGRAMS)
def test_a_program_that_is_ended_during_a_tool(
    subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    task = task_for(subject.model)
    sleeping = task.workdir / "sleeping"
    with serve([{"shell": f"touch '{sleeping}'; sleep 600"}]) as server:
        ending = threading.Thread(target=end_program, args=(task.workdir, sleeping))
        ending.start()
        ran = run(spec_for(subject.name, server, api=subject.api), task)
        ending.join()
    settled(ran, subject.differs.get("ended", Expected(ExitReason.CRASHED)))


def end_program(workdir: Path, sleeping: Path) -> None:
    """SIGTERM to the program itself (the child of its supervisor) once its tool is at work."""
    deadline = time.monotonic() + 50
    while not sleeping.exists():
        if time.monotonic() > deadline:
            return  # the run ends by its own limit, and the test checks how
        time.sleep(0.02)
    record = orphans.read(workdir)
    assert record is not None
    for process in orphans.own():
        if process.parent == record.pid:
            handle = os.pidfd_open(process.pid)
            signal.pidfd_send_signal(handle, signal.SIGTERM)
            os.close(handle)


@pytest.mark.parametrize("subject", PROGRAMS)
def test_what_a_tool_leaves_running(subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    # One that closes what it writes to, and one that keeps it: its program may not wait for that.
    leave = "nohup sleep 300 >/dev/null 2>&1 & (setsid sleep 300 &); "
    with serve([{"shell": leave + WRITE}, DONE]) as server:
        ran = run(spec_for(subject.name, server, api=subject.api), task_for(subject.model))
    settled(ran, subject.differs.get("leaves", FINISHED))
