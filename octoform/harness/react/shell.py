"""The tool ``shell``: one command in a process group of its own, bounded in time and output.

What it leaves in the background may go on, a server on trial for example; the end of the run ends it.
"""

import os
import selectors
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from octoform.harness.react.bounded import HeadAndTail

OUTPUT_BYTES = 24 << 10
PIECE_BYTES = 64 << 10
STEP_SECONDS = 0.02
GRACE_SECONDS = 1.0


@dataclass(frozen=True, slots=True)
class Said:
    """What a tool gives back to the model; ``failed`` when it did not do what was asked."""

    text: str
    failed: bool = False


@dataclass(frozen=True, slots=True)
class Shell:
    """Runs commands in ``workdir`` with that environment; seconds when nothing is said, and at most."""

    workdir: Path
    environment: Mapping[str, str]
    seconds: int
    most_seconds: int

    def run(self, command: str, timeout_seconds: int | None = None) -> Said:
        """Run it; a command that takes longer is ended with its whole group."""
        limit = min(self.most_seconds, max(1, timeout_seconds or self.seconds))
        program = shutil.which("bash", path=self.environment.get("PATH")) or "/bin/sh"
        try:
            process = subprocess.Popen(
                [program, "-c", command],
                cwd=self.workdir,
                env=dict(self.environment),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except (OSError, ValueError) as problem:
            return Said(f"the command could not be started: {problem}", failed=True)
        kept = HeadAndTail(OUTPUT_BYTES)
        with process:
            ended = _follow(process, kept, limit)
            # The pipe may stay open in what runs on in the background; nobody reads it any more.
        return _told(kept.text(), process.returncode, None if ended else limit)


def _follow(process: subprocess.Popen[bytes], kept: HeadAndTail, seconds: float) -> bool:
    """Read until the command has ended; False when it had to be ended."""
    assert process.stdout is not None
    descriptor = process.stdout.fileno()
    os.set_blocking(descriptor, False)
    deadline = time.monotonic() + seconds
    with selectors.DefaultSelector() as selector:
        selector.register(descriptor, selectors.EVENT_READ)
        while process.poll() is None and time.monotonic() < deadline:
            if selector.get_map() and selector.select(STEP_SECONDS):
                if not _read(descriptor, kept):
                    selector.unregister(descriptor)
            elif not selector.get_map():
                with suppress(subprocess.TimeoutExpired):
                    process.wait(deadline - time.monotonic())
    ended = process.poll() is not None
    if not ended:
        _end(process)
    rounds = 64
    while rounds and _read(descriptor, kept):
        rounds -= 1
    return ended


def _read(descriptor: int, kept: HeadAndTail) -> bool:
    """Take one piece; False when there is none now, or never again."""
    try:
        data = os.read(descriptor, PIECE_BYTES)
    except BlockingIOError:
        return False
    kept.feed(data)
    return bool(data)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the command's group, whose first process has not been waited for: its id cannot be another's."""
    for number, patience in ((signal.SIGTERM, GRACE_SECONDS), (signal.SIGKILL, None)):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return


def _told(output: str, status: int, limit: float | None) -> Said:
    output = output.rstrip("\n")
    if limit is not None:
        return Said(f"{output}\n[ended after {limit:g} seconds, its limit]".lstrip("\n"), failed=True)
    if status:
        how = f"exit status {status}" if status > 0 else f"ended by signal {-status}"
        return Said(f"{output}\n[{how}]".lstrip("\n"), failed=True)
    return Said(output or "[no output, exit status 0]")
