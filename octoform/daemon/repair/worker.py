"""Heavy work in a child process, both ends of it: the daemon stays small, and what a child loads goes with it.

``python -m octoform.daemon.repair.worker`` reads a job from standard input: ``{format, job, project, parent, brief}``,
``brief`` holds at least ``host``. The last line of its standard output is the result: a `RepairOutcome` as JSON, with
the members beside it that a job has. A child is ended with its daemon in every case: by SIGTERM when the daemon is
instructed to stop, by the kernel's parent-death signal when the daemon is killed (the child asks for that itself), and
by its time limit. SIGTERM ends it in order: an agent is ended, a journal closed, a lock given back. Light.
"""

import contextlib
import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import FrameType
from typing import IO, Any

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base import shortage
from octoform.base.files import OtherFormatError, parse, record
from octoform.base.processes import signal_group
from octoform.daemon.repair.playbook import PLAYBOOK, SETTLE, Order, RepairKind
from octoform.state.layout import Layout

COMMAND = (sys.executable, "-P", "-m", "octoform.daemon.repair.worker")
FORMAT = 1
LIMIT = 4_000_000
"""Bytes of a job, and of a result."""
GRACE_SECONDS = 15.0
"""Seconds that a child may take to end its agent and release its lock before it is killed."""
SAID_LIMIT = 1500
"""Characters of a failed child's output that its result quotes."""
_PR_SET_PDEATHSIG = 1
BAD_JOB, STOPPED = 64, 143
Brief = Mapping[str, Any]
Job = Callable[[str, Brief], dict[str, Any]]


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
        """The result of a job, within ``seconds``; what fails is an outcome too, never an exception.

        ``parent`` of a job is the process that must be alive. A child that ended without a result of its own has no
        ``cost``: no one knows what it has used.
        """
        asked = {"format": FORMAT, "job": job, "project": str(self._project), "parent": os.getpid(), "brief": brief}
        with tempfile.TemporaryFile() as feed, tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            feed.write(json.dumps(asked).encode())
            feed.seek(0)
            try:
                process = self._started(feed, out, err)
            except BlockingIOError:
                return RepairOutcome.failed("worker.shortage", f"{job}: {shortage.TEXT}").to_json()
            if process is None:
                return RepairOutcome.refused("worker.stopping", f"{job}: the daemon is being stopped").to_json()
            why = self._waited(process, seconds)
            if why is not None:
                return _lost("worker.ended", f"{job}: {why}")
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
    return file.read(LIMIT).decode("utf-8", "replace")


def _result(job: str, status: int, out: str, err: str) -> dict[str, Any]:
    last = out.strip().rpartition("\n")[2]
    with contextlib.suppress(ValueError):
        found = parse(last)
        if isinstance(found, dict):
            return found
    text = f"{job}: the child ended with status {status} and without a result: {err.strip()[-SAID_LIMIT:]}"
    return _lost("worker.no-result", text)


def _lost(rule: str, text: str) -> dict[str, Any]:
    return RepairOutcome.failed(rule, text, cost=None).to_json()


# The child's end. Every job takes the project's folder and its brief, and imports its modules when it runs.


def _settings(project: str, _: Brief) -> dict[str, Any]:
    """How the manifest wants the deployment kept alive: ``host``, ``scope``, ``daemon``, ``perception``, and ``bounds``
    that the profiles set (`octoform.claims.settings.bound_documents`)."""
    from octoform.engine.unattended.session import bounds
    from octoform.manifest.loader import load
    from octoform.manifest.model import FILE_NAME

    manifest, found = load(Path(project) / FILE_NAME, os.environ)
    if manifest is None:
        first = next(item for item in found if item.severity == "error")
        text = f"the manifest has errors: {first.summary}"
        return RepairOutcome.refused("settings.errors", text, again=False).to_json()
    daemon = asdict(manifest.daemon)
    daemon["metrics"] = None if manifest.daemon.metrics is None else str(manifest.daemon.metrics)
    fields = {
        "host": manifest.host,
        "scope": manifest.scope,
        "daemon": daemon,
        "perception": asdict(manifest.perception),
    }
    return {**RepairOutcome.done("settings").to_json(), **fields, "bounds": bounds(Path(project), os.environ)}


def _settle(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.heal import settle

    nothing = RepairOutcome.done("settle.nothing", "nothing was left unfinished")
    return (settle(_layout(project, brief), os.environ) or nothing).to_json()


def _look(project: str, _: Brief) -> dict[str, Any]:
    """With ``camera`` and ``picture``: the device id, and ``{trouble, mean, spread}`` or None with the reason.

    Only where the manifest has perception switched on. The picture is kept as every other look's is.
    """
    from octoform.diagnostics import Diagnostic
    from octoform.engine.look import look, open_eye

    eye, found = open_eye(Path(project), os.environ)
    if eye is None:
        return _unseen(None, found[0].summary if found else "the project cannot be read")
    if not eye.settings.enabled:
        return _unseen(None, "perception is off")
    seen = look(eye)
    camera = seen.camera.device if seen.camera is not None else None
    if isinstance(seen.outcome, Diagnostic):
        return _unseen(camera, ": ".join(filter(None, (seen.outcome.summary, seen.outcome.detail))))
    shown = seen.outcome.picture
    picture = {"trouble": seen.problem, "mean": shown.mean, "spread": shown.spread}
    return {**RepairOutcome.done("look.seen").to_json(), "camera": camera, "picture": picture}


def _unseen(camera: str | None, why: str) -> dict[str, Any]:
    return {**RepairOutcome.failed("look.unseen", why[:500]).to_json(), "camera": camera, "picture": None}


def _layout(project: str, brief: Brief) -> Layout:
    return Layout(Path(project), str(brief["host"]))


def _job_of(kind: RepairKind) -> Job:
    return lambda project, brief: kind.work(Order(_layout(project, brief), os.environ, brief)).to_json()


JOBS: Mapping[str, Job] = {
    "settings": _settings,
    "look": _look,
    SETTLE: _settle,
    **{name.value: _job_of(kind) for name, kind in PLAYBOOK.items()},
}


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
        refused = RepairOutcome.refused("worker.version", "the job is of another version", again=False)
        return _send(out, refused.to_json(), BAD_JOB)
    except (ValueError, LookupError, TypeError) as problem:
        refused = RepairOutcome.refused("worker.no-job", f"this is no job: {problem!r}", again=False)
        return _send(out, refused.to_json(), BAD_JOB)
    try:
        _bind_to(parent)
        result = work(project, brief)
    except _Ended:
        return _send(out, _lost("worker.stopped", f"{job}: it was asked to end"), STOPPED)
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
