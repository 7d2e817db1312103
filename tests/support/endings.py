"""Processes of endpoints in tests: end what was left running, exactly in the tests' own folders; stand for one."""

import atexit
import json
import os
import signal
import subprocess
from pathlib import Path

PROGRAM = b"endpoint/serve.py"
FORKED = b"fork_server.py"
LOOKED_INTO = 20
"""Folders: to look into so many takes about half as long as to look at all processes."""
PROJECT = ".octoform"
SLEEP = ["sleep", "86400"]
_sleeping: list["subprocess.Popen[bytes]"] = []


def end_endpoints(folder: Path) -> None:
    """Kill every process that serves an endpoint below ``folder``. Thousands of tests end with it: it reads bytes."""
    with os.scandir("/proc") as entries:
        names = [entry.name for entry in entries]
    for name in names:
        if name.isdigit() and _serves_below(folder, name):
            try:
                os.kill(int(name), signal.SIGKILL)
            except ProcessLookupError:
                continue


def may_have_endpoints(folder: Path) -> bool:
    """False if it has no project below; large trees are not looked through."""
    folders = [str(folder)]
    for place in folders:
        if len(folders) > LOOKED_INTO:
            return True
        with os.scandir(place) as entries:
            below = [entry for entry in entries if entry.is_dir(follow_symlinks=False)]
        if any(entry.name == PROJECT for entry in below):
            return True
        folders += [entry.path for entry in below]
    return False


def _serves_below(folder: Path, process: str) -> bool:
    """Whether it runs an endpoint's program, or is the fork of a fork server that works where an endpoint does."""
    try:
        descriptor = os.open(f"/proc/{process}/cmdline", os.O_RDONLY)
        try:
            line = os.read(descriptor, 1 << 16)
        finally:
            os.close(descriptor)
        if PROGRAM not in line and FORKED not in line:
            return False
        place = Path(f"/proc/{process}/cwd").readlink()
    except OSError:
        return False
    words = line.split(b"\0")[1:3]
    forked = any(word.endswith(FORKED) for word in words) and place.name == "run" and place.is_relative_to(folder)
    return forked or any(word.endswith(PROGRAM) and Path(os.fsdecode(word)).is_relative_to(folder) for word in words)


def record_running(run: Path) -> None:
    """The record of a running endpoint, with a sleeping process in its place, for tests that start none."""
    run.mkdir(mode=0o700, parents=True, exist_ok=True)
    pid = _stand_in()
    stat = Path(f"/proc/{pid}/stat").read_text()
    record = {
        "format": 1,
        "pid": pid,
        "start": int(stat[stat.rindex(")") + 2 :].split()[19]),
        "boot": Path("/proc/sys/kernel/random/boot_id").read_text().strip(),
        "argv": SLEEP,
        "instance": "0",
        "since": "2026-01-01T00:00:00+00:00",
        "scope": "local",
        "url": None,
    }
    (run / "process.json").write_text(json.dumps(record))


def _stand_in() -> int:
    """A process that does nothing until the tests end, or one of them stops it."""
    if not _sleeping or _sleeping[-1].poll() is not None:
        _sleeping.append(subprocess.Popen(SLEEP))
        atexit.register(_sleeping[-1].kill)
        while Path(f"/proc/{_sleeping[-1].pid}/cmdline").read_bytes().split(b"\0")[0] != os.fsencode(SLEEP[0]):
            continue  # between fork and exec it is still a copy of this one
    return _sleeping[-1].pid
