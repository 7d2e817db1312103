"""The daemon's child: one job, one result, and gone. What is heavy is loaded here and never in the daemon.

``python -m octoform.daemon.repair.worker`` reads ``{format, job, project, parent, brief}`` from standard input;
``brief`` holds at least ``host``. The last line of its standard output is ``{"ok", "detail", "again", ...}``. It asks
the kernel to end it with its parent, and SIGTERM ends it in order: an agent is ended, a journal closed, a lock given
back.
"""

import ctypes
import json
import os
import signal
import sys
from collections.abc import Mapping
from types import FrameType
from typing import Any

from octoform.base.files import OtherFormatError, parse, record
from octoform.daemon.repair.jobs import JOBS

FORMAT = 1
LIMIT = 4_000_000
_PR_SET_PDEATHSIG = 1
BAD_JOB, STOPPED = 64, 143


class _Ended(KeyboardInterrupt):
    """The daemon has asked this child to end; whatever lets an interrupt pass lets this pass too."""


def main() -> int:
    """Do the job on standard input; the exit status."""
    signal.signal(signal.SIGTERM, _end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to the daemon, which decides
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever prints meanwhile is no result
    try:
        asked = record(parse(sys.stdin.buffer.read(LIMIT)), FORMAT)
        job, brief, parent = asked["job"], asked["brief"], int(asked["parent"])
        work, project = JOBS[job], str(asked["project"])
    except OtherFormatError:
        return _send(out, {"ok": False, "detail": "the job is of another version", "again": False}, BAD_JOB)
    except (ValueError, LookupError, TypeError) as problem:
        return _send(out, {"ok": False, "detail": f"this is no job: {problem!r}", "again": False}, BAD_JOB)
    try:
        _bind_to(parent)
        result = work(project, brief)
    except _Ended:
        return _send(
            out, {"ok": False, "detail": f"{job}: it was asked to end", "again": True, "untold": True}, STOPPED
        )
    return _send(out, result, 0)


def _end(_number: int, _frame: FrameType | None) -> None:
    """Roll the work back in order; a second signal does not interrupt that, only SIGKILL does."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _Ended


def _bind_to(parent: int) -> None:
    """End with the daemon, however it ends; one that has ended already has no one who waits for a result."""
    libc = ctypes.CDLL(None, use_errno=True)
    if sys.platform == "linux":
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if os.getppid() != parent:
        raise _Ended


def _send(out: Any, result: Mapping[str, Any], status: int) -> int:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    out.write(json.dumps(result, ensure_ascii=True) + "\n")
    out.flush()
    return status


if __name__ == "__main__":
    sys.exit(main())
