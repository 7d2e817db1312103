"""A look through the host's camera for the daemon, in a child: it takes far too much for the daemon itself."""

import os
from pathlib import Path
from typing import Any


def look_once(project: Path) -> dict[str, Any]:
    """``{ok, detail, again, camera, picture}``: the device id, and ``{trouble, mean, spread}`` or None with the reason.

    Only where the manifest has perception switched on. The picture is kept as every other look's is.
    """
    from octoform.diagnostics import Diagnostic
    from octoform.engine.look import look, open_eye

    eye, found = open_eye(project, os.environ)
    if eye is None:
        return _nothing(None, found[0].summary if found else "the project cannot be read")
    if not eye.settings.enabled:
        return _nothing(None, "perception is off")
    seen = look(eye)
    camera = seen.camera.device if seen.camera is not None else None
    if isinstance(seen.outcome, Diagnostic):
        return _nothing(camera, ": ".join(filter(None, (seen.outcome.summary, seen.outcome.detail))))
    shown = seen.outcome.picture
    picture = {"trouble": seen.trouble, "mean": shown.mean, "spread": shown.spread}
    return {"ok": True, "detail": "", "again": True, "camera": camera, "picture": picture}


def _nothing(camera: str | None, why: str) -> dict[str, Any]:
    return {"ok": False, "detail": why[:500], "again": True, "camera": camera, "picture": None}
