"""An endpoint of this folder's own, where the one that is there was written for another: a copy, a moved one. (Heavy.)

What was applied is carried over as it is: no agent is asked, no tool is called, and nothing of an edited manifest comes
into service by the way. The original keeps its process, its sockets and its units.
"""

from collections.abc import Mapping
from dataclasses import replace

from octoform.apply.context import Context
from octoform.apply.duties.outcome import DutyOutcome, refusal
from octoform.apply.rewrite import promotion
from octoform.apply.stage.serve_proof import service_of
from octoform.diagnostics import Diagnostic, has_errors
from octoform.endpoint.publication import tells_of
from octoform.engine.unattended.session import on_duty
from octoform.state.layout import Layout


def take_over(layout: Layout, environ: Mapping[str, str], foreign: Diagnostic) -> Diagnostic | None:
    """Write the endpoint for this folder and start it; ``foreign`` with the reason where that cannot be."""
    done = on_duty(layout.project, environ, "start", _published)
    return None if done.ok else replace(foreign, detail=done.detail)


def _published(context: Context) -> DutyOutcome:
    if not tells_of(context.layout, service_of(context), context.environ):
        return DutyOutcome(
            ok=False, detail="the manifest was edited since it was applied, or the endpoint's files were"
        )
    found = promotion.published(context, smoke=False)
    return refusal(found) if has_errors(found) else DutyOutcome(ok=True, detail="the endpoint is this folder's own")
