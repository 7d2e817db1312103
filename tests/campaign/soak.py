"""An hour of faults at a high rate, at random and on top of each other: nothing may grow, and nothing may be left over.

``python -m campaign.soak --seconds 3600 [--seed N]``. Faults come every second or so whether or not the one before is
repaired. Once a minute the world is put right and calm must come back; then everything is counted. A trouble that was
frozen because it came too often is thawed, as a person would do it.
"""

import argparse
import json
import random
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from campaign import cases_devices, cases_files, cases_process, cases_room
from campaign.bench import Bench, until
from campaign.making import made, plug_in

from octoform.daemon.store import instance_lock
from octoform.state.artifact_cache import MAX_ASIDE

MINUTE = 60.0
CALM = 90.0
"""Seconds in which all must be well again once no more faults come."""
LEAN = 60 * 1024
"""KiB that the daemon may have resident at any time."""
GROWTH = 0.1
LEAST = 6
"""Counts from which growth is measured."""
BEYOND = (
    *(("resident", 3072), ("descriptors", 3), ("threads", 2), ("watches", 8), ("locks", 1)),
    *(("children", 1), ("strangers", 0), ("files", MAX_ASIDE)),
)
"""What may not grow, and by how much it may differ from moment to moment."""
NAMES = (
    *("killed", "ended by SIGTERM of another", "segmentation fault", "server.py cut in half", "server.py deleted"),
    *("server.py is a link", "runtime module changed", "launcher deleted", "connection descriptor edited"),
    *("policy deleted", "package removed", "two distributions provide one module", "camera pulled, and back"),
    *("camera moved at once", "board without serial number moved", "one of two twins pulled, and back", "a loose plug"),
    *("call log overgrown", "bytes that are no text in the logs", "twenty thousand lines", "logs deleted"),
    "a log with instructions in it",
)


@dataclass(frozen=True)
class Count:
    """What there is of what may not grow: KiB resident, open files, children, files and bytes of the daemon's own."""

    at: float
    resident: int
    descriptors: int
    threads: int
    watches: int
    """What inotify watches for the daemon."""
    locks: int
    """Locks of files that the daemon holds."""
    children: int
    strangers: int
    files: int
    bytes: int
    endpoint: int
    """KiB resident of the endpoint's process, which is another one after each restart."""


def counted(bench: Bench, at: float) -> Count:
    """Everything now."""
    assert bench.daemon is not None
    pid = bench.daemon.pid
    served = bench.process()
    own = [path for path in bench.layout.daemon.rglob("*") if path.is_file()]
    return Count(
        at,
        _status(pid, "VmRSS"),
        len(list(Path(f"/proc/{pid}/fd").iterdir())),
        _status(pid, "Threads"),
        sum(_lines(path, "inotify ") for path in Path(f"/proc/{pid}/fdinfo").iterdir()),
        sum(f" {pid} " in line for line in Path("/proc/locks").read_text().splitlines()),
        len(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()),
        len(bench.strangers()),
        len(own),
        sum(map(_size, own)),
        _status(served.pid, "VmRSS") if served else 0,
    )


def _size(path: Path) -> int:
    with suppress(FileNotFoundError):  # a temporary one, which has its name by now
        return path.stat().st_size
    return 0


def _lines(path: Path, beginning: str) -> int:
    with suppress(FileNotFoundError):
        return sum(line.startswith(beginning) for line in path.read_text().splitlines())
    return 0


def _status(pid: int, name: str) -> int:
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith(f"{name}:"):
                return int(line.split()[1])
    return 0


def faults() -> Mapping[str, Callable[[Bench], None]]:
    """What may be done to a bench at any time, in whatever state it is."""
    modules = (cases_process, cases_files, cases_devices, cases_room)
    known = {case.name: case.inject for module in modules for case in module.CASES}
    return {name: known[name] for name in NAMES}


def soaked(bench: Bench, seconds: float, seed: int) -> tuple[list[Count], dict[str, int], list[str]]:
    """(a count for each minute, how often each fault was made, what was not as it should be)."""
    chance, known, made_of, wrong = random.Random(seed), faults(), dict.fromkeys(NAMES, 0), []
    counts: list[Count] = []
    began = time.monotonic()
    while time.monotonic() - began < seconds:
        until_calm = min(time.monotonic() + min(MINUTE, seconds / LEAST), began + seconds)
        while time.monotonic() < until_calm:
            name = chance.choice(NAMES)
            # A fault needs something that is whole; what is broken already cannot be broken in this way.
            with suppress(OSError, AssertionError, StopIteration):
                known[name](bench)
                made_of[name] += 1
            time.sleep(chance.uniform(0.1, 2.0))
        wrong += calm(bench)
        counts.append(counted(bench, time.monotonic() - began))
        print(json.dumps(asdict(counts[-1])), flush=True)
    return counts, made_of, wrong


def calm(bench: Bench) -> list[str]:
    """Put the world right, thaw what was frozen, and wait until all is well; what is not, in words."""
    while bench.undo:
        bench.undo.pop()()
    plug_in(bench.host)
    instance_lock.ask(bench.layout, ["*"])
    if until(bench.ready, CALM):
        return []
    if bench.daemon is None or bench.daemon.poll() is not None:
        return [f"the daemon ended: {bench.said()[-500:]}"]
    return [f"not well after {CALM:g} s: {[each['summary'] for each in bench.open_episodes()] or 'it does not serve'}"]


def grown(counts: list[Count]) -> list[str]:
    """What became more from the first third to the last, beyond a tenth and what one trouble costs."""
    if len(counts) < LEAST:
        return []
    third = len(counts) // 3
    found = []
    for name, least in BEYOND:
        first, last = (
            statistics.median(getattr(each, name) for each in part) for part in (counts[:third], counts[-third:])
        )
        if last > first * (1 + GROWTH) + least:
            found.append(f"{name} grew from {first:g} to {last:g}")
    most = max(each.resident for each in counts)
    return [*found, *([f"{most} KiB resident, not {LEAN}"] if most > LEAN else [])]


def main() -> int:
    """0 when nothing grew, nothing was left over, and calm came back each time."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that the bench is closed
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--seed", type=int, default=7)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="octoform-soak-") as folder:
        bench = made("scripted", Path(folder))
        try:
            counts, made_of, wrong = soaked(bench, given.seconds, given.seed)
        finally:
            bench.close()
        wrong += [f"{len(left)} processes are left over" for left in [bench.strangers()] if left]
        locked = [path.name for path in (bench.layout.lock, bench.layout.daemon / "daemon.json") if path.exists()]
        wrong += [f"{name} is left over" for name in locked]
    wrong += grown(counts)
    print(f"{sum(made_of.values())} faults in {given.seconds:g} s: {made_of}")
    print("\n".join(wrong) or "nothing grew, nothing is left over")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
