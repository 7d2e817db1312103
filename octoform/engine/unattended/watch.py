"""WATCH on a host: what the daemon has seen becomes a report, or nothing is known. (Heavy.)"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.apply.duties.watch import WATCH, watch
from octoform.engine.unattended.session import on_duty


def diagnose(project: Path, environ: Mapping[str, str], brief: Mapping[str, Any]) -> dict[str, Any]:
    """Ask the agent of WATCH how the deployment is.

    ``brief`` is ``{causes, readings, failures, claims, summary, since, target, calls}``; ``calls`` bounds the attempts.
    The result is ``{ok, detail, again, spent, report, action, changed}``; ``report`` is the accepted output, None when
    there is none: then how the deployment is stays unknown. Nothing of the host is changed.
    """
    return on_duty(project, environ, WATCH, lambda context: watch(context, brief)).told()
