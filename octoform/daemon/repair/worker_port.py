"""Heavy work in a child process: the daemon stays small, and what the child loads goes with it.

A job is one JSON object on the child's standard input, its result one JSON object in the last line of its standard
output. The child is ended with its daemon in every case: by SIGTERM when the daemon is instructed to stop, by the
kernel's parent-death signal when the daemon is killed (the child asks for that itself), and by its time limit. Light.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from octoform.base import shortage
from octoform.base.files import parse
from octoform.base.processes import signal_group

COMMAND = (sys.executable, "-P", "-m", "octoform.daemon.repair.worker")
FORMAT = 1
GRACE_SECONDS = 15.0
"""Seconds that a child may take to end its agent and release its lock before it is killed."""
RESULT_LIMIT = 4_000_000
SAID_LIMIT = 1500
"""Characters of a failed child's output that its result quotes."""


class Workers:
    """Starts children of one project; `run` may be called in several threads, `end` in any."""

    def __init__(self, project: Path, environ: Mapping[str, str], command: Sequence[str] = COMMAND) -> None:
        """``environ`` is what every child gets: its agents need what an apply in this place would have."""
        self._project = project
        self._environ = dict(environ)
        self._command = list(command)
        self._guard = threading.Lock()
        self._live: set[subprocess.Popen[bytes]] = set()
        self._ended = False

    def run(self, job: str, brief: Mapping[str, Any], seconds: float) -> dict[str, Any]:
        """The result of a job, within ``seconds``; what fails is ``{"ok": False, "detail": ...}``, never an exception.

        The child reads ``{format, job, project, parent, brief}``; ``parent`` is the process that must be alive. A child
        that ended without a result of its own has ``untold``: no one knows what it has used.
        """
        asked = {"format": FORMAT, "job": job, "project": str(self._project), "parent": os.getpid(), "brief": brief}
        with tempfile.TemporaryFile() as feed, tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            feed.write(json.dumps(asked).encode())
            feed.seek(0)
            try:
                process = self._started(feed, out, err)
            except BlockingIOError:
                return _failed(f"{job}: {shortage.TEXT}")
            if process is None:
                return _failed(f"{job}: the daemon is being stopped")
            why = self._waited(process, seconds)
            if why is not None:
                return _lost(f"{job}: {why}")
            return _result(job, process.returncode, _head(out), _head(err))

    def end(self) -> None:
        """End every child, and let none be started again; returns when none is left."""
        with self._guard:
            self._ended = True
            live = list(self._live)
        for process in live:
            _signal(process, signal.SIGTERM)
        for process in live:
            _gone(process)

    def _started(self, feed: IO[bytes], out: IO[bytes], err: IO[bytes]) -> "subprocess.Popen[bytes] | None":
        with self._guard:  # so that no child is started after the last one was ended
            if self._ended:
                return None
            process = subprocess.Popen(
                self._command,
                cwd=self._project,
                env=self._environ,
                stdin=feed,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
            self._live.add(process)
            return process

    def _waited(self, process: "subprocess.Popen[bytes]", seconds: float) -> str | None:
        """Why the child has no result; None when it came to its end by itself."""
        try:
            process.wait(seconds)
        except subprocess.TimeoutExpired:
            _signal(process, signal.SIGTERM)
            return f"it took more than {seconds:.0f} s and was ended"
        finally:
            _gone(process)
            with self._guard:
                self._live.discard(process)
        return "it was ended with the daemon" if self._ended else None


def _signal(process: "subprocess.Popen[bytes]", number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.send_signal(number)


def _gone(process: "subprocess.Popen[bytes]") -> None:
    """Wait for the end of a child that was instructed to end; kill it and its group when that does not come."""
    try:
        process.wait(GRACE_SECONDS)
    except subprocess.TimeoutExpired:
        signal_group(process)
        process.wait()


def _head(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read(RESULT_LIMIT).decode("utf-8", "replace")


def _result(job: str, status: int, out: str, err: str) -> dict[str, Any]:
    last = out.strip().rpartition("\n")[2]
    with contextlib.suppress(ValueError):
        found = parse(last)
        if isinstance(found, dict):
            return found
    return _lost(f"{job}: the child ended with status {status} and without a result: {err.strip()[-SAID_LIMIT:]}")


def _lost(detail: str) -> dict[str, Any]:
    return {**_failed(detail), "untold": True}


def _failed(detail: str) -> dict[str, Any]:
    return {"ok": False, "detail": detail, "again": True}
