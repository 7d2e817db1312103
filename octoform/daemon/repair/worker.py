"""The daemon's child: one job, one result, and gone. What is heavy is loaded here and never in the daemon.

``python -m octoform.daemon.repair.worker`` reads ``{format, job, project, parent, brief}`` from standard input;
``brief`` holds at least ``host``. The last line of its standard output is ``{"ok", "detail", "again", ...}``. It asks
the kernel to end it with its parent, and SIGTERM ends it in order: an agent is ended, a journal closed, a lock given
back.

Every job takes the project's folder and its brief, imports its modules when it runs, and gives a JSON object with
``ok``, ``detail`` (plain sentences) and ``again`` (False: no further try can help).
"""

import ctypes
import json
import os
import signal
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from types import FrameType
from typing import Any

from octoform.base.files import OtherFormatError, parse, record
from octoform.daemon.model import Done
from octoform.state.layout import Layout

FORMAT = 1
LIMIT = 4_000_000
_PR_SET_PDEATHSIG = 1
BAD_JOB, STOPPED = 64, 143
Brief = Mapping[str, Any]
Job = Callable[[str, Brief], dict[str, Any]]


def _settings(project: str, _: Brief) -> dict[str, Any]:
    """How the manifest wants the deployment kept alive: ``host``, ``scope``, ``daemon``, ``perception``, and ``bounds``
    that the profiles set (`octoform.claims.settings.bound_documents`)."""
    from octoform.engine.unattended.session import bounds
    from octoform.manifest.loader import load
    from octoform.manifest.model import FILE_NAME

    manifest, found = load(Path(project) / FILE_NAME, os.environ)
    if manifest is None:
        first = next(item for item in found if item.severity == "error")
        return _plain(False, f"the manifest has errors: {first.summary}", again=False)
    daemon = asdict(manifest.daemon)
    daemon["metrics"] = None if manifest.daemon.metrics is None else str(manifest.daemon.metrics)
    fields = {
        "host": manifest.host,
        "scope": manifest.scope,
        "daemon": daemon,
        "perception": asdict(manifest.perception),
    }
    return {**_plain(True, ""), **fields, "bounds": bounds(Path(project), os.environ)}


def _restart(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.daemon.repair.restart import restart

    return _done(restart(_layout(project, brief), hung=bool(brief.get("hung"))))


def _restore(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.repairs import restore

    return asdict(restore(_layout(project, brief)))


def _republish(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.heal import settle
    from octoform.engine.unattended.repairs import republish

    layout = _layout(project, brief)
    return settle(layout, os.environ) or asdict(republish(layout))


def _settle(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.heal import settle

    nothing = _plain(True, "nothing was left unfinished")
    return settle(_layout(project, brief), os.environ) or nothing


def _rebuild(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.repairs import rebuild

    return asdict(rebuild(_layout(project, brief)))


def _rediscover(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.rediscover import Left, rediscover

    apply = str(brief.get("apply") or "ask")
    return rediscover(_layout(project, brief), os.environ, apply=apply, left=Left.of(brief))


def _rebind(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.daemon.repair.device_binding import rebind

    return _done(rebind(_layout(project, brief), str(brief["device"])))


def _rotate(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.daemon.repair.disk_cleanup import rotate

    return _done(rotate(_layout(project, brief), str(brief["log"])))


def _free(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.daemon.repair.disk_cleanup import free

    return _done(free(_layout(project, brief)))


def _watch(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.session import diagnose

    return diagnose(Path(project), os.environ, brief)


def _heal(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.heal import heal

    return heal(Path(project), os.environ, brief)


def _roll_back(project: str, brief: Brief) -> dict[str, Any]:
    from octoform.engine.unattended.heal import roll_back

    return roll_back(Path(project), os.environ, brief)


def _look(project: str, _: Brief) -> dict[str, Any]:
    """``{ok, detail, again, camera, picture}``: the device id, and ``{trouble, mean, spread}`` or None with the reason.

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
    return {"ok": True, "detail": "", "again": True, "camera": camera, "picture": picture}


def _unseen(camera: str | None, why: str) -> dict[str, Any]:
    return {"ok": False, "detail": why[:500], "again": True, "camera": camera, "picture": None}


def _layout(project: str, brief: Brief) -> Layout:
    return Layout(Path(project), str(brief["host"]))


def _done(done: Done) -> dict[str, Any]:
    return _plain(done.ok, done.detail, again=done.again)


def _plain(ok: bool, detail: str, *, again: bool = True) -> dict[str, Any]:
    return {"ok": ok, "detail": detail, "again": again}


JOBS: Mapping[str, Job] = {
    "settings": _settings,
    "restart": _restart,
    "restore": _restore,
    "republish": _republish,
    "rebuild": _rebuild,
    "settle": _settle,
    "rebind": _rebind,
    "rotate": _rotate,
    "free": _free,
    "rediscover": _rediscover,
    "watch": _watch,
    "heal": _heal,
    "roll_back": _roll_back,
    "look": _look,
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
