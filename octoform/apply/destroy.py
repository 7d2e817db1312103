"""Destroy: node by node, last first, only what octoform itself has made for this host."""

from octoform import events
from octoform.apply.context import Context, Tally
from octoform.base.files import remove_tree
from octoform.diagnostics import Diagnostic, has_errors, warning
from octoform.endpoint.process.estop import is_engaged
from octoform.endpoint.process.systemd import is_ours, unit_path
from octoform.endpoint.publication import remove, stopped_devices
from octoform.plan.model import Action, Plan
from octoform.state.artifact_cache import INSTANCES, forget
from octoform.state.files import refused
from octoform.state.layout import Layout

_COPIES = {"probe": ("probe", INSTANCES)}
"""Under which names copies of a node's files are kept, where it is not its own."""


def destroy(context: Context, plan: Plan) -> Tally:
    """Remove what each node of the plan has made and forget the node; stops at the first that cannot be removed."""
    tally = Tally()
    for action in plan.work:
        found = take_away(context, action.node)
        tally.diagnostics += found
        if has_errors(found):
            tally.failed = action.node
            return tally
        tally.destroyed += 1
    return tally


def take_away(context: Context, node: str) -> list[Diagnostic]:
    """Remove what one node has made and forget the node; an error is why it is still there."""
    found = context.store.begin(node, {"action": Action.DESTROY.value})
    if not has_errors(found):
        found = [*found, *_remove(context, node)]
    if not has_errors(found):
        found = [*found, *context.store.remove(node)]
    if has_errors(found):
        context.emit(events.NodeFailed(node, tuple(found), 0.0))
    else:
        forget(context.layout, _COPIES.get(node, (node,)))
        context.emit(events.NodeDestroyed(node))
    return found


def left_behind(layout: Layout) -> list[Diagnostic]:
    """Remains of a removed endpoint that a person should know of: its emergency stop, its service."""
    found = []
    if is_engaged(layout):
        found.append(
            warning(
                "DESTROY-ESTOP-KEPT",
                f"the emergency stop of {layout.host} stays engaged, also for the next endpoint",
                path=str(layout.run),
                hint="octoform estop -clear, after the next octoform apply",
            )
        )
    found += [
        warning(
            "DESTROY-STOP-KEPT",
            f"a device of {layout.host} stays stopped, also for the next endpoint",
            path=str(path),
            hint="after the next octoform apply, call the tool that ends its stop; a refused call names it",
        )
        for path in stopped_devices(layout)
    ]
    unit = unit_path(layout)
    if is_ours(layout, unit):
        found.append(
            warning(
                "DESTROY-UNIT-LEFT",
                f"a service of systemd would start the endpoint of {layout.host}, which is gone",
                path=str(unit),
                hint="octoform service uninstall -user takes it away",
            )
        )
    return found


def _remove(context: Context, node: str) -> list[Diagnostic]:
    layout = context.layout
    try:
        if node == "endpoint":
            remove(layout)
            return left_behind(layout)
        folder = layout.output(node).parent
        if folder.is_symlink():
            folder.unlink()
        elif folder.exists():
            remove_tree(folder)
        if folder.parent == layout.steps and layout.steps.is_dir() and not any(layout.steps.iterdir()):
            layout.steps.rmdir()
        if node == "probe":
            layout.instances.unlink(missing_ok=True)
            layout.fingerprint.unlink(missing_ok=True)
    except OSError as problem:
        return [refused(problem, layout.output(node).parent if node != "endpoint" else layout.endpoint)]
    return []
