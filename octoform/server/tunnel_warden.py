"""The process above the tunnel's: it ends all below it when the endpoint's process is gone, however it went.

A tunnel program that is a script starts others, and only the direct child of a process can be made to die with it. So
this small program is between: it is the child, it leads the group, and what leaves the group or loses its parent
becomes a child of this one. Standard library only; started as a program, with the write end of its standard input held
by the endpoint's process.
"""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

GRACE_SECONDS = 2.0
CANNOT_START = 127
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36


class _Terminated(BaseException):
    """SIGTERM came: from the endpoint's process, or because that process is gone."""


def main(command: Sequence[str]) -> int:
    """Run ``command`` until it ends or the endpoint's process is gone; the command's exit status."""
    signal.signal(signal.SIGTERM, _terminate)
    process: subprocess.Popen[bytes] | None = None
    try:
        _die_with_parent(signal.SIGTERM)
        _take_orphans()
        threading.Thread(target=_watch_parent, daemon=True).start()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, preexec_fn=lambda: _die_with_parent(signal.SIGKILL)
        )
        status = _ended(process)
    except _Terminated:
        _end_group(process)
        raise
    except OSError as problem:
        print(f"{command[0]}: {problem.strerror}", file=sys.stderr)
        return CANNOT_START
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    _signal_all(signal.SIGTERM)
    return status if status >= 0 else 128 - status


def _terminate(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _Terminated


def _watch_parent() -> None:
    """The endpoint's process never writes; the end of its side is its end."""
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


def _ended(process: "subprocess.Popen[bytes]") -> int:
    """Wait for the command; what else ends meanwhile is taken away, because it has no other parent any more."""
    while True:
        pid, status = os.wait()
        if pid == process.pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode


def _end_group(process: "subprocess.Popen[bytes] | None") -> None:
    """All that is below this process or in its group, this process too."""
    _signal_all(signal.SIGTERM)
    if process is not None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GRACE_SECONDS)
    _signal_all(signal.SIGKILL)


def _signal_all(number: signal.Signals) -> None:
    for pid in _below(os.getpid()):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, number)
    os.killpg(0, number)


def _below(pid: int) -> set[int]:
    """The processes below one, as Linux lists them; elsewhere none."""
    parents: dict[int, int] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            text = path.read_text(errors="replace")
            parents[int(path.parent.name)] = int(text[text.rindex(")") + 2 :].split()[1])
    found: set[int] = set()
    more = {pid}
    while more:
        found |= more
        more = {child for child, parent in parents.items() if parent in found} - found
    return found - {pid}


def _take_orphans() -> None:
    """Linux: what loses its parent below this process becomes its child, and not that of the first process."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _die_with_parent(number: signal.Signals) -> None:
    """Linux: a signal at the parent's death. Elsewhere only the pipe shows it."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
