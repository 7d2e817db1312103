"""``git: {commit: true}``: apply commits what it changed, and says in trailers what made it."""

from octoform.diagnostics import Diagnostic
from octoform.state.git.repository import commit
from octoform.state.layout import Layout
from octoform.state.model import Snapshot


def commit_run(layout: Layout, snapshot: Snapshot, operation: str) -> tuple[str | None, list[Diagnostic]]:
    """Commit the host's folder below ``state/`` and nothing else; (None, []) when nothing changed."""
    message = f"octoform {operation} {layout.host}: serial {snapshot.serial}"
    return commit(layout.project, [layout.committed], message, _trailers(snapshot))


def _trailers(snapshot: Snapshot) -> dict[str, str]:
    makers = sorted({state.harness for state in snapshot.nodes.values() if state.harness})
    models = sorted({state.model for state in snapshot.nodes.values() if state.model})
    return {
        "Octoform-Host": snapshot.host,
        "Octoform-Lineage": snapshot.lineage,
        "Octoform-Serial": str(snapshot.serial),
        "Octoform-Harness": ", ".join(makers) or "none",
        "Octoform-Model": ", ".join(models) or "none",
        "Octoform-Usage": _usage(snapshot),
    }


def _usage(snapshot: Snapshot) -> str:
    """Tokens and money of the accepted runs, as far as the agents told; what nobody told is unknown, not zero."""
    usages = [state.usage for state in snapshot.nodes.values()]
    counts = [count for usage in usages for count in (usage.input_tokens, usage.output_tokens) if count is not None]
    costs = [usage.cost_usd for usage in usages if usage.cost_usd is not None]
    tokens = f"{sum(counts)} tokens" if counts else "tokens unknown"
    return f"{tokens}, {sum(costs):.4f} USD" if costs else f"{tokens}, cost unknown"
