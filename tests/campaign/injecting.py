"""One injection of a case from calm to calm, timed and judged from outside."""

import os
import time
from typing import Any

from campaign.bench import Bench, until
from campaign.model import QUIET, REPAIRED, SURFACED, WAITS, Case, Result

from octoform.daemon.model import Repair

PATIENCE = 4.0
"""A fault that takes longer than its target is still waited for, so many times as long, so that its time is known."""
HEALTH = 3.0
"""Seconds in which the record of health must have the report."""
EXCHANGING = frozenset(set(Repair) - {Repair.REBIND, Repair.ROTATE, Repair.WATCH, Repair.RESTORE})
"""Repairs behind which another process may serve."""
CLOSING = 30.0
"""Seconds after all is well in which the daemon must have seen it too."""


def injected(case: Case, bench: Bench) -> Result:
    """Make the fault once, see what comes of it, and leave the bench as it was."""
    result = Result(case.name)
    bench.unwritten = False
    bench.reset()
    known, before, daemon = {*bench.episodes(), *bench.printed()}, bench.protected(), bench.daemon
    bench.before, bench.nodes = before, bench.state()
    starts, attempts = bench.starts(), bench.attempts()
    bench.unwritten = case.unwritten
    case.inject(bench)
    began, served = time.monotonic(), bench.process()
    if case.ends == QUIET:
        _quiet(case, bench, result, known)
    else:
        _noticed(case, bench, result, known, began)
        {REPAIRED: _repaired, WAITS: _waits, SURFACED: _surfaced}[case.ends](case, bench, result, known, began)
    _judge(case, bench, result, known, before)
    _unsaid(result, bench.starts() - starts, bench.attempts() - attempts - case.untold)
    exchanged = served is not None and bench.process() != served
    if exchanged and not EXCHANGING.intersection(result.repairs) and case.ends != QUIET:
        result.wrong.append("another process serves, and no repair tells why")
    if case.after is not None:
        result.wrong += case.after(bench)
    if bench.daemon is daemon and (daemon is None or daemon.poll() is not None):
        result.missed.append("the daemon is gone")
    result.survivors = len(bench.strangers())
    result.load = round(os.getloadavg()[0], 1)
    return result


def _fresh(bench: Bench, known: set[str]) -> list[dict[str, Any]]:
    return [each for name, each in bench.episodes().items() if name not in known]


def _noticed(case: Case, bench: Bench, result: Result, known: set[str], began: float) -> None:
    seen = until(lambda: any(each["kind"] in case.kinds for each in _fresh(bench, known)), case.detect * PATIENCE)
    took = time.monotonic() - began
    if not seen:
        result.missed.append(f"not noticed in {took:.1f} s")
        return
    result.detected = took
    if took > case.detect:
        result.slow.append(f"noticed after {took:.1f} s, not within {case.detect:g} s")


def _repaired(case: Case, bench: Bench, result: Result, known: set[str], began: float) -> None:
    right = case.right or Bench.serves
    if not until(lambda: right(bench), case.repair * PATIENCE):
        result.missed.append(f"not repaired in {time.monotonic() - began:.1f} s")
        return
    result.repaired = time.monotonic() - began
    if result.repaired > case.repair:
        result.slow.append(f"repaired after {result.repaired:.1f} s, not within {case.repair:g} s")
    _closes(bench, result, known)


def _waits(case: Case, bench: Bench, result: Result, known: set[str], began: float) -> None:
    """The daemon must do nothing until the world has mended it, and see then that it has."""
    time.sleep(case.hold)
    assert case.mend is not None
    case.mend(bench)
    mended = time.monotonic()
    right = case.right or Bench.serves
    if not until(lambda: right(bench), case.repair * PATIENCE):
        result.missed.append("it does not work although the world fixed it")
        return
    result.repaired = time.monotonic() - mended
    _closes(bench, result, known)


def _surfaced(case: Case, bench: Bench, result: Result, known: set[str], began: float) -> None:
    def told() -> bool:
        return any(each["outcome"] in ("surfaced", "frozen") for each in _fresh(bench, known))

    if not until(told, case.repair * PATIENCE):
        result.missed.append("no person was told")
    if not until(lambda: bench.health().get("status") != "healthy", HEALTH):
        result.missed.append("health says healthy")
    if case.mend is not None:
        case.mend(bench)
        _closes(bench, result, known)


def _quiet(case: Case, bench: Bench, result: Result, known: set[str]) -> None:
    process = bench.process()
    time.sleep(case.hold)
    if case.right is not None and not case.right(bench):
        result.missed.append("it is not as it was left")
    if bench.process() != process:
        result.wrong.append("a process was started or ended")
    result.wrong += [f"an episode {each['kind']} was opened" for each in _fresh(bench, known)]
    if case.mend is not None:
        case.mend(bench)


def _unsaid(result: Result, starts: int, attempts: int) -> None:
    """What was done and stands in no episode."""
    found = result.repairs.count(Repair.RESTART)
    if starts > found:
        result.wrong.append(f"{starts} starts, and {found} of them in episodes")
    if attempts > result.calls:
        result.wrong.append(f"{attempts} runs of agents, and {result.calls} of them in episodes")


def _closes(bench: Bench, result: Result, known: set[str]) -> None:
    if not until(lambda: all(each["closed"] for each in _fresh(bench, known)), CLOSING):
        kinds = ", ".join(each["kind"] for each in _fresh(bench, known) if not each["closed"])
        result.missed.append(f"still open although all is well: {kinds}")


def _judge(case: Case, bench: Bench, result: Result, known: set[str], before: dict[str, str]) -> None:
    for episode in _fresh(bench, known):
        result.calls += episode["spent"]["calls"]
        result.tokens += episode["spent"]["input_tokens"] + episode["spent"]["output_tokens"]
        for made in episode["tries"]:
            result.repairs.append(made["repair"])
            if made["repair"] not in case.repairs:
                result.wrong.append(f"{made['repair']} for {episode['kind']}")
    if result.calls > case.calls:
        result.wrong.append(f"{result.calls} agent calls")
    after = bench.protected()
    moved = [path for path in sorted({*before, *after}) if before.get(path) != after.get(path)]
    result.wrong += [f"{path} is not as it was" for path in moved if not path.startswith(case.may_change or ("\0",))]
