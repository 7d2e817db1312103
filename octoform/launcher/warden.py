"""The leader of the tunnel's process group: it ends the group when the endpoint's process is gone, however it went.

A tunnel program that is a script starts others, and only the direct child of a process can be made to die with it. So
this small program stands between: it is the child, and whatever runs below it is in its group. Standard library only;
started as a program, with the write end of its standard input held by the endpoint's process.
"""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence

GRACE_SECONDS = 2.0
CANNOT_START = 127
_PR_SET_PDEATHSIG = 1


class _Told(BaseException):
    """SIGTERM came: from the endpoint's process, or because that process is gone."""


def main(command: Sequence[str]) -> int:
    """Run ``command`` until it ends or the endpoint's process is gone; the command's exit status."""
    signal.signal(signal.SIGTERM, _told)
    process: subprocess.Popen[bytes] | None = None
    try:
        _die_with_parent(signal.SIGTERM)
        threading.Thread(target=_watch_parent, daemon=True).start()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, preexec_fn=lambda: _die_with_parent(signal.SIGKILL)
        )
        status = process.wait()
    except _Told:
        _end_group(process)
        raise
    except OSError as problem:
        print(f"{command[0]}: {problem.strerror}", file=sys.stderr)
        return CANNOT_START
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.killpg(0, signal.SIGTERM)
    return status if status >= 0 else 128 - status


def _told(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _Told


def _watch_parent() -> None:
    """The endpoint's process never writes; the end of its side is its end."""
    while os.read(0, 1):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


def _end_group(process: "subprocess.Popen[bytes] | None") -> None:
    """All that is in the group, this process too."""
    os.killpg(0, signal.SIGTERM)
    if process is not None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GRACE_SECONDS)
    os.killpg(0, signal.SIGKILL)


def _die_with_parent(number: signal.Signals) -> None:
    """Linux: a signal at the parent's death. Elsewhere the pipe alone tells of it."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(number), 0, 0, 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
