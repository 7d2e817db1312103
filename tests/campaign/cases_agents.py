"""Agents of WATCH and HEAL that go too far or rest on nothing, and what happens to them while they work."""

import json
import os
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from campaign.bench import Bench, until
from campaign.cases_discovery import appears, kept, served
from campaign.cases_tools import BROKEN, FAILING, HEALING, MAX_CALLS, broken, heal, mended, told, watch
from campaign.model import WAITS, Case
from campaign.rig import SENSOR, report

from octoform.apply.context import CANDIDATE
from octoform.daemon.model import Kind, Repair
from octoform.state.store.lock import Holder, read_holder

LONG = 30.0
WORKER = b"octoform.daemon.repair.worker"
SETTLED = 20.0
"""Seconds after which what a killed worker has left must be settled."""
PAUSE = 3.0
"""Seconds that an agent takes in which a person does something."""
CLAIM = {
    "target": f"device:{SENSOR}",
    "fault": "none",
    "statement": "it is too hot to be asked",
    "signal": {"channel": "sensor", "source": "read_temperature", "path": "/text"},
    "condition": {"op": "!=", "value": "0"},
    "seconds": 86400,
    "restrictions": [{"tool": "weigh", "arguments": {}, "effect": "deny"}],
}


def _claims(cites: list[str]) -> dict[str, Any]:
    document = report("error", dict(BROKEN))
    return {"report": {**document, "claims": [{**CLAIM, "cites": cites}]}}


def _no_claims(bench: Bench) -> list[str]:
    """Nothing is claimed, and nothing waits for a yes."""
    try:
        known = json.loads((bench.layout.daemon / "claims.json").read_bytes())["claims"]
    except FileNotFoundError:
        return []
    return [
        f"a claim is {each['state']}: {each['statement']}" for each in known if each["state"] in ("active", "pending")
    ]


def _workers(bench: Bench) -> list[int]:
    """The daemon's children that do a job."""
    assert bench.daemon is not None
    listed = Path(f"/proc/{bench.daemon.pid}/task").glob("*/children")
    children = [int(pid) for each in listed for pid in each.read_text().split()]
    return [pid for pid in children if WORKER in Path(f"/proc/{pid}/cmdline").read_bytes()]


def _kill_worker(bench: Bench, when: Callable[[Bench], bool]) -> None:
    """The child that does the daemon's work is killed, as by a kernel without memory."""
    assert until(lambda: when(bench) and bool(_workers(bench)), LONG), "there was nothing to kill"
    for pid in _workers(bench):
        os.kill(pid, signal.SIGKILL)


def _tries_candidate(bench: Bench) -> bool:
    return (bench.layout.local / CANDIDATE / "server.py").exists()


def _killed_in_trial(bench: Bench) -> None:
    broken(bench, watch=watch(), heal=heal("mended"))
    _kill_worker(bench, _tries_candidate)


def _rediscovers(known: int, bench: Bench) -> bool:
    """Re-discovery holds the state, and has begun to make something."""
    holder = read_holder(bench.layout)
    return isinstance(holder, Holder) and bench.attempts() > known + 1


def _killed_in_discovery(bench: Bench) -> None:
    known = bench.attempts()
    appears(bench)
    _kill_worker(bench, partial(_rediscovers, known))


def _whole(bench: Bench) -> None:
    """What was begun is taken back, the former endpoint serves, and status commands report that something is wrong.

    How often agents were asked was known to the worker alone, so the hour counts as spent and nothing more is tried.
    """
    assert not (bench.layout.local / CANDIDATE).exists(), "a server that was only tried is still there"
    changed = [name for name, node in bench.nodes.items() if bench.state().get(name) != node]
    assert not changed, f"the state of {changed} is another one"
    assert bench.serves() and bench.call("read_temperature")[0], "the former endpoint does not serve"
    assert bench.health()["status"] != "healthy", "health says healthy"


def _mended_after_kill(bench: Bench) -> None:
    _whole(bench)
    mended(bench)


def _applied_after_kill(bench: Bench) -> None:
    _whole(bench)
    bench.project.apply(status=0)


def _asked(bench: Bench, stage: str) -> int:
    """How often the agent of a stage was begun, as it has written down itself."""
    log = bench.project.outside / "repairer.log"
    lines = log.read_text().splitlines() if log.exists() else []
    return sum(json.loads(line)["stage"] == stage for line in lines)


def _stopped_while(stage: str, bench: Bench) -> None:
    """An emergency stop while this agent thinks: its report is not carried out before the stop is cleared."""
    before = {each: _asked(bench, each) for each in ("watch", "heal")}
    pausing = {"sleep": PAUSE}
    broken(
        bench,
        watch={**watch(), **(pausing if stage == "watch" else {})},
        heal={**heal("mended"), **(pausing if stage == "heal" else {})},
    )
    assert until(lambda: _asked(bench, stage) > before[stage], LONG), f"{stage} is not asked"
    healed = _asked(bench, "heal")
    bench.project.run("estop", "-reason", "campaign", status=0)
    bench.undo.append(partial(bench.project.run, "estop", "-clear"))
    time.sleep(PAUSE + 4.0)
    assert (bench.layout.run / "estop.json").exists(), "the emergency stop is gone"
    assert _asked(bench, "heal") == healed, "HEAL is asked while an emergency stop is engaged"
    assert bench.protected() == bench.before, "something is exchanged while an emergency stop is engaged"
    bench.project.run("estop", "-clear", status=0)


def _settled(bench: Bench) -> bool:
    """The mended server is the accepted one, nothing is being tried any more, and the tool works."""
    if (bench.layout.local / CANDIDATE).exists() or "something" not in bench.layout.output("serve").read_text():
        return False  # not asked of the tool itself: each call is one more failure
    return bench.call("weigh")[0]


_HEALED = partial(
    Case,
    kinds=FAILING,
    repairs=HEALING,
    right=_settled,
    repair=60.0,
    may_change=("state/bench/", ".octoform/bench/endpoint/"),
    calls=MAX_CALLS,
    spoils=True,
)
_LEFT = frozenset({Repair.RESTORE, Repair.REPUBLISH, Repair.RESTART})
"""What may be needed after a worker that was killed in the middle of an exchange."""
CASES = (
    told("HEAL weakens a limit", repairs=HEALING, watch=watch(), heal=heal("weaker")),
    told("a claim without a reading", watch=_claims([]), after=_no_claims),
    told("a claim that cites what does not exist", watch=_claims(["r999999"]), after=_no_claims),
    told("a report that cites readings that do not exist", watch=watch(cites=["r999999"])),
    Case(
        "worker killed in the trial of HEAL",
        _killed_in_trial,
        FAILING,
        frozenset({Repair.WATCH, Repair.HEAL}) | _LEFT,
        WAITS,
        mend=_mended_after_kill,
        hold=SETTLED,
        may_change=("state/bench/state.json", ".octoform/bench/endpoint/"),
        calls=MAX_CALLS,
        untold=1,
    ),
    _HEALED("emergency stop while WATCH works", partial(_stopped_while, "watch")),
    _HEALED("emergency stop while HEAL works", partial(_stopped_while, "heal")),
    Case(
        "worker killed in re-discovery",
        _killed_in_discovery,
        frozenset({Kind.HARDWARE_CHANGED}),
        frozenset({Repair.REDISCOVER, Repair.WAIT, Repair.REBIND}) | _LEFT,
        WAITS,
        right=partial(served, "usb-1f00-00a7"),
        mend=_applied_after_kill,
        hold=SETTLED,
        may_change=("state/", ".octoform/"),
        after=kept,
        untold=10,  # of the worker that was killed, and of the person's apply
        bench="builtin",
    ),
)
