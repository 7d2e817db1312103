"""Destroy: node by node, last first, only what octoform itself has made for this host."""

import shutil

from octoform import events
from octoform.apply.context import Context
from octoform.apply.runner import Tally
from octoform.diagnostics import Diagnostic, has_errors
from octoform.endpoint.removing import remove
from octoform.plan.model import Plan
from octoform.state.files import refused


def destroy(context: Context, plan: Plan) -> Tally:
    """Remove what each node of the plan has made and forget the node; stops at the first that cannot be removed."""
    tally = Tally()
    for action in plan.work:
        found = context.store.begin(action.node, {"action": action.action.value})
        if not has_errors(found):
            found = [*found, *_remove(context, action.node)]
        if not has_errors(found):
            found = [*found, *context.store.remove(action.node)]
        tally.diagnostics += found
        if has_errors(found):
            tally.failed = action.node
            context.emit(events.NodeFailed(action.node, tuple(found), 0.0))
            return tally
        tally.destroyed += 1
        context.emit(events.NodeDestroyed(action.node))
    return tally


def _remove(context: Context, node: str) -> list[Diagnostic]:
    layout = context.layout
    try:
        if node == "endpoint":
            remove(layout)
        else:
            folder = layout.output(node).parent
            if folder.is_symlink():
                folder.unlink()
            elif folder.exists():
                shutil.rmtree(folder)
            if node == "probe":
                layout.instances.unlink(missing_ok=True)
                layout.fingerprint.unlink(missing_ok=True)
    except OSError as problem:
        return [refused(problem, layout.output(node).parent if node != "endpoint" else layout.endpoint)]
    return []
