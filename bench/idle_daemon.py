"""The daemon beside a deployment at which nothing happens: its weight and its cost. (python bench/idle_daemon.py)

The embedded agent onboards this machine; then `octoform watch` is left alone. Its first look is not counted, its
questions whether the endpoint answers are, and so is the work of its children.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from measuring import OCTOFORM, Command, Row, cost, environment, report, scratch
from subjects import embedded

MEMORY_BOUND, SHARE_BOUND = 60.0, 0.2
SETTLING_SECONDS, SECONDS = 20.0, float(os.environ.get("SECONDS", "120"))


def resident(pid: int) -> float:
    """MiB that a process has in memory."""
    return int(Path(f"/proc/{pid}/status").read_text().partition("VmRSS:")[2].split()[0]) / 1024


def spent(pid: int) -> float:
    """CPU seconds of a process so far, with those of the children that it waited for."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def woken(pid: int) -> int:
    """How often all threads of a process gave up the processor by themselves."""
    files = Path(f"/proc/{pid}/task").glob("*/status")
    return sum(int(file.read_text().partition("\nvoluntary_ctxt_switches:")[2].split()[0]) for file in files)


def served(folder: Path) -> int:
    """The pid of the endpoint."""
    record = next(folder.glob(".octoform/*/run/process.json"))
    return int(json.loads(record.read_bytes())["pid"])


def main() -> int:
    """Measure and report."""
    with scratch() as above:
        folder = embedded(above)
        applied = cost(Command("apply", [OCTOFORM, "apply", "-auto-approve"], folder))
        if applied.status != 0:
            raise SystemExit(f"octoform apply: exit status {applied.status}")
        watch = subprocess.Popen(
            [OCTOFORM, "watch"], cwd=folder, env=environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        try:
            time.sleep(SETTLING_SECONDS)
            pids = (watch.pid, served(folder))
            before, wakes = [spent(pid) for pid in pids], woken(watch.pid)
            time.sleep(SECONDS)
            own, endpoint = (100 * (spent(pid) - was) / SECONDS for pid, was in zip(pids, before, strict=True))
            note = f"{(woken(watch.pid) - wakes) / SECONDS:.1f} wakes/s"
            rows = [
                Row("the daemon in memory", resident(watch.pid), "MiB", MEMORY_BOUND),
                Row("the daemon, of a core", own, "%", SHARE_BOUND, note),
                Row("the endpoint that it asks, of a core", endpoint, "%"),
            ]
        finally:
            watch.terminate()
            status = watch.wait(30)
    rows.append(Row("it did not end when it was told to", float(status not in (0, 143, -15)), "", 0))
    return report(f"idle_daemon: {SECONDS:.0f} s at which nothing happens", rows, Row("", 1.0))


if __name__ == "__main__":
    sys.exit(main())
