"""One short program beside the agents (npm, ``node --version``), run under the same containment as an agent.

An installer runs scripts of strangers and a program asked for its version may start a daemon, so neither is trusted
to end by itself or to leave nothing behind.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from octoform.harness.containment import agent_environment
from octoform.harness.containment.contained_run import Ended, Limits, Program, run
from octoform.harness.program_location import Located
from octoform.patterns import regex
from octoform.records import dataclass

FILE_BYTES = 4 << 30
KEPT_BYTES = 64 << 10
REPORT_SECONDS = 10.0


@dataclass(frozen=True, slots=True)
class ShortRun:
    """How it ended: ``status`` as `Ended.status`; ``stdout`` and ``stderr`` are the last 64 KiB of each, as text."""

    ended: Ended
    stdout: str
    stderr: str

    @property
    def ok(self) -> bool:
        """True when it ended by itself with status 0."""
        return self.ended.reason == "ended" and self.ended.status == 0

    @property
    def ending(self) -> str:
        """How it ended, in words for a person."""
        if self.ended.reason == "wall":
            return f"no end within {self.ended.seconds:.0f} s"
        if self.ended.reason == "not_started":
            return "could not be started"
        if self.ended.reason != "ended" or self.ended.status is None:
            return "was stopped from outside"
        return f"signal {-self.ended.status}" if self.ended.status < 0 else f"exit status {self.ended.status}"


def short_run(
    argv: Sequence[str],
    environment: Mapping[str, str],
    seconds: float,
    waiting: Callable[[float], None] | None = None,
) -> ShortRun:
    """Run it in an empty folder of its own, which is removed, with an empty standard input.

    ``seconds`` bound the run; ``waiting`` gets the seconds so far every ten seconds. OSError only for what octoform
    itself cannot write or start; an interrupt by the person ends the whole tree.
    """
    keeper = _Keeper(waiting)
    with TemporaryDirectory(prefix="octoform-run-") as name:
        folder = Path(name)
        program = Program(tuple(argv), folder, environment, folder / "output.log")
        ended = run(program, Limits(wall_seconds=seconds, file_bytes=FILE_BYTES), keeper)
    return ShortRun(ended, *(keeper.text(stream) for stream in ("stdout", "stderr")))


class _Keeper:
    """Keeps the end of both streams."""

    def __init__(self, waiting: Callable[[float], None] | None) -> None:
        self._kept = {"stdout": b"", "stderr": b""}
        self._waiting = waiting
        self._began = time.monotonic()
        self._reports = 0

    def feed(self, stream: str, data: bytes) -> None:
        """See `Observer.feed`."""
        self._kept[stream] = (self._kept[stream] + data)[-KEPT_BYTES:]

    def tick(self) -> bool:
        """See `Observer.tick`."""
        passed = time.monotonic() - self._began
        if self._waiting is not None and passed >= REPORT_SECONDS * (self._reports + 1):
            self._reports += 1
            self._waiting(passed)
        return False

    def finish(self) -> None:
        """See `Observer.finish`."""

    def text(self, stream: str) -> str:
        """The kept part of a stream."""
        return self._kept[stream].decode("utf-8", "replace")


# Ask an agent program for its version: the cheapest proof that it is there, whole, and starts.

SECONDS = 60.0
REASON_CHARS = 300
_VERSION = regex(r"\d+\.\d+(?:\.\d+)?[0-9A-Za-z.+-]*")


@dataclass(frozen=True, slots=True)
class Stated:
    """A program's answer about itself: its version, or why there is none."""

    version: str | None
    problem: str = ""


def stated_version(located: Located, environ: Mapping[str, str]) -> Stated:
    """The version that ``--version`` prints, started as an agent would be: minimal environment, empty home folder."""
    with TemporaryDirectory(prefix="octoform-home-") as name:
        variables = agent_environment.minimal(Path(name), environ)
        variables["PATH"] = os.pathsep.join((*located.path, variables["PATH"]))
        done = short_run((*located.argv, "--version"), variables, SECONDS)
    if not done.ok:
        text = " ".join((done.stderr or done.stdout).split())
        return Stated(None, f"{done.ending}{f': {text[-REASON_CHARS:]}' if text else ''}")
    found = _VERSION.search(done.stdout)
    return Stated(found.group()) if found else Stated(None, "reported no version")
