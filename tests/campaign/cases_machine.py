"""Faults of the machine around a deployment: disks that refuse, events by the hundred or none at all, a wrong clock."""

import json
import os
import re
import signal
import subprocess
import time
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from campaign.bench import Bench
from campaign.cases_files import whole
from campaign.cases_process import end
from campaign.cases_tools import MAX_CALLS, broken, mended
from campaign.model import SURFACED, WAITS, Case

from octoform.daemon.model import Kind, Repair

PLUGS = 100
BUSY_SECONDS = 6.0
"""What the daemon's processes may use of a core for the whole storm."""
FEW_WATCHES = 12
"""Inotify watches of a user that has used up the rest."""
WRONG_TIME = re.compile(r"^(\S+) ERROR a word of the wrong time", re.MULTILINE)


def _read_only(bench: Bench, *places: Path) -> None:
    """These folders refuse every write, as a disk does that the kernel has given up; who has a file open keeps it."""
    for place in places:
        subprocess.run(["mount", "--bind", place, place], check=True)
        bench.undo.append(partial(subprocess.run, ["umount", "--lazy", place], check=False))
        subprocess.run(["mount", "-o", "remount,bind,ro", place], check=True)


def _state_read_only(bench: Bench) -> None:
    """Nothing can be kept any more; then the endpoint dies, which cannot be started there."""
    _read_only(bench, bench.layout.local)
    end(bench)


def _project_read_only(bench: Bench) -> None:
    """An accepted file is lost, and its folder refuses to have it back."""
    (bench.layout.committed / "serve" / "server.py").unlink()
    _read_only(bench, bench.layout.committed)


def _writable(bench: Bench) -> None:
    """Status commands report it; then the disk is well again, and a person confirms it."""
    assert bench.project.run("health").status != 0, "health says healthy"
    while bench.undo:
        bench.undo.pop()()
    for each in bench.open_episodes():
        bench.project.run("heal", "-retry", each["target"])
    bench.project.run("heal", status=0)


def _storm(bench: Bench) -> None:
    """A plug that makes and loses contact a hundred times within seconds, and in the end the camera is elsewhere."""
    bench.spent = spent(bench)
    for _ in range(PLUGS):
        bench.host.unplug("1-1")
        bench.host.camera("1-1", 0)
        time.sleep(0.02)
    bench.host.unplug("1-1")
    bench.host.camera("1-7", 5)


def spent(bench: Bench) -> float:
    """Seconds of a core that the daemon and its ended children have used."""
    assert bench.daemon is not None
    fields = Path(f"/proc/{bench.daemon.pid}/stat").read_text().rpartition(") ")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def _cheap(bench: Bench) -> list[str]:
    used = spent(bench) - bench.spent
    return [] if used <= BUSY_SECONDS else [f"the daemon used {used:.1f} s of a core for it"]


def _overflow(bench: Bench) -> None:
    """More events than the kernel keeps while the daemon does not come to reading them; the fault is among the lost."""
    assert bench.daemon is not None
    most = int(Path("/proc/sys/fs/inotify/max_queued_events").read_text())
    bench.daemon.send_signal(signal.SIGSTOP)
    bench.undo.append(partial(bench.daemon.send_signal, signal.SIGCONT))
    for folder in (bench.layout.committed / "serve", bench.layout.logs):
        for number in range(most // 2 + 100):
            path = folder / f".noise{number % 2}"
            path.touch()
            path.unlink()
    (bench.layout.committed / "serve" / "server.py").unlink()
    bench.daemon.send_signal(signal.SIGCONT)


def _unwatched(bench: Bench) -> None:
    """The user's watches are used up when the daemon starts: most of its folders cannot be watched."""
    bench.end_daemon()
    limit = f'echo {FEW_WATCHES} > /proc/sys/user/max_inotify_watches; exec "$@"'
    bench.watch("unshare", "--user", "--map-root-user", "sh", "-c", limit, "sh")
    (bench.layout.committed / "serve" / "server.py").unlink()
    (bench.layout.committed / "serve" / "runtime" / "devices.py").unlink()


def _told_of_watches(bench: Bench) -> list[str]:
    """A daemon that sees less reports it."""
    found = [] if "DAEMON-FEW-WATCHES" in bench.log.read_text() else ["no one was told that folders are not watched"]
    bench.end_daemon()
    bench.watch()
    return found


def _clock_ahead(bench: Bench) -> None:
    """The logs are full of lines of a clock that was years ahead; then a tool fails in its own code."""
    ahead = (datetime.now(UTC) + timedelta(days=1000)).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    line = {"time": ahead, "event": "result", "id": "aa", "tool": "capture_image", "ok": True, "ms": 1.0}
    with bench.layout.call_log.open("a") as log:
        log.write((json.dumps(line) + "\n") * 5000)
    with bench.layout.server_log.open("a") as log:
        log.writelines(f"{ahead} ERROR a word of the wrong time, {number:c}\n" for number in range(65, 91))
    broken(bench)


def _agent_saw(bench: Bench) -> list[str]:
    """WATCH's input has the call that failed, beside the lines of the wrong time."""
    ahead = WRONG_TIME.findall(bench.layout.server_log.read_text(errors="replace"))[-1]
    logs = [json.loads(path.read_bytes())["log"] for path in bench.layout.attempts.glob("*watch*/input.json")]
    seen = any("the tool weigh failed" in log and ahead in log for log in logs)
    return [] if seen else ["the log that WATCH was given says nothing of the tool that failed"]


_DEAD = frozenset({Kind.PROCESS_DEAD, Kind.CRASH_LOOP})
_FILE = frozenset({Kind.FILE_DAMAGED})
CASES = (
    Case(
        "nothing can be written, and the endpoint dies",
        _state_read_only,
        frozenset({Kind.STATE_DAMAGED}) | _DEAD,
        frozenset({Repair.RESTART, Repair.REBUILD}),
        WAITS,
        mend=_writable,
        hold=8.0,
        # No incident can be written there: it is in the daemon's output, and health is another word at once.
        unwritten=True,
    ),
    Case(
        "accepted files cannot be put back",
        _project_read_only,
        _FILE,
        frozenset({Repair.RESTORE}),
        WAITS,
        right=whole,
        mend=_writable,
        hold=8.0,
    ),
    Case(
        "a hundred plugs within seconds",
        _storm,
        frozenset({Kind.DEVICE_GONE, Kind.DEVICE_MOVED, Kind.DEVICE_BACK}),
        frozenset({Repair.REBIND, Repair.WAIT}),
        right=lambda bench: bench.call("capture_image") == (True, "a frame"),
        may_change=(".octoform/bench/instances.json",),
        after=_cheap,
    ),
    Case("more events than the kernel keeps", _overflow, _FILE, frozenset({Repair.RESTORE}), right=whole),
    Case(
        "watches are used up",
        _unwatched,
        _FILE,
        frozenset({Repair.RESTORE}),
        right=whole,
        after=_told_of_watches,
    ),
    Case(
        "the clock of the logs was ahead",
        _clock_ahead,
        frozenset({Kind.TOOL_FAILING}),
        frozenset({Repair.WATCH, Repair.PERSON}),
        SURFACED,
        mend=mended,
        repair=60.0,
        calls=MAX_CALLS,
        after=_agent_saw,
    ),
)
