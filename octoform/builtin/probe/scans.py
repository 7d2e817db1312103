"""Runs each scan within its own time, so that one driver that does not answer costs seconds and not the stage.

A scan runs in a thread of its own. When its time is over the thread is left behind (a read that hangs in the kernel
cannot be ended from outside); what it found until then counts, what it would still find does not.
"""

import errno
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from octoform.base import shortage
from octoform.builtin.probe.reader import Abandoned, Reader

SCAN_SECONDS = 5.0
STATUS_OF_ERRNO = {
    errno.ENOENT: "not_found",
    errno.ENOTDIR: "not_found",
    errno.EACCES: "denied",
    errno.EPERM: "denied",
    errno.ETIMEDOUT: "timeout",
    errno.EOPNOTSUPP: "unsupported",
}
DETAIL_CHARS = 400


@dataclass(frozen=True, slots=True)
class Scan:
    """A named look at one part of the system; ``look`` stores what it finds where it was told to.

    ``patience``: how many times as long as others it may take, for what is known to be slow.
    """

    name: str
    look: Callable[[Reader], None]
    patience: float = 1.0


@dataclass(frozen=True, slots=True)
class Report:
    """How a scan went: status is ok, not_found, denied, unsupported, error or timeout."""

    name: str
    status: str
    detail: str
    milliseconds: float

    def as_json(self) -> dict[str, object]:
        """The entry of ``scan_methods``."""
        entry: dict[str, object] = {"name": self.name, "status": self.status}
        if self.detail:
            entry["detail"] = self.detail
        return entry | {"duration_ms": round(self.milliseconds, 1)}


def run_all(scans: list[Scan], reader: Reader, seconds: float = SCAN_SECONDS) -> list[Report]:
    """Run the scans one after the other, each for at most ``seconds``; one report each, in the same order."""
    return [run_one(scan, reader.fresh(), seconds * scan.patience) for scan in scans]


def run_one(scan: Scan, reader: Reader, seconds: float) -> Report:
    """Run one scan; ``reader`` is its own, and is told when its time is over."""
    outcome: list[tuple[str, str]] = []
    started = time.monotonic()
    reader.ends = started + seconds
    thread = threading.Thread(target=_look, args=(scan, reader, outcome), daemon=True)
    shortage.start(thread)
    thread.join(seconds)
    elapsed = (time.monotonic() - started) * 1000
    if thread.is_alive():
        reader.abandoned = True
        return Report(
            scan.name, "timeout", f"no answer within {seconds:g} s; what it found until then is kept", elapsed
        )
    status, detail = outcome[0] if outcome else ("error", "ended without a result")
    return Report(scan.name, status, detail[:DETAIL_CHARS], elapsed)


def _look(scan: Scan, reader: Reader, outcome: list[tuple[str, str]]) -> None:
    try:
        scan.look(reader)
    except Abandoned:
        return
    except OSError as problem:
        status = STATUS_OF_ERRNO.get(problem.errno or 0, "error")
        outcome.append((status, "" if status == "not_found" else problem.strerror or "input/output error"))
    except (ValueError, KeyError, IndexError, RecursionError) as problem:
        # A kernel text of a shape nobody foresaw spoils this one scan and says so.
        outcome.append(("error", f"{type(problem).__name__} while reading"))
    else:
        outcome.append(("ok", reader.note()))
