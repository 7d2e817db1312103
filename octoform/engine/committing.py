"""``git: {commit: true}``: apply commits what it changed, and says in trailers what made it."""

from octoform.diagnostics import Diagnostic
from octoform.state.history import commit
from octoform.state.layout import Layout
from octoform.state.model import Snapshot


def commit_run(layout: Layout, snapshot: Snapshot, operation: str) -> tuple[str | None, list[Diagnostic]]:
    """Commit the host's folder below ``state/`` and nothing else; (None, []) when nothing changed."""
    message = f"octoform {operation} {layout.host}: serial {snapshot.serial}"
    return commit(layout.project, [layout.committed], message, _trailers(snapshot))


def _trailers(snapshot: Snapshot) -> dict[str, str]:
    makers = sorted({state.harness for state in snapshot.nodes.values() if state.harness})
    models = sorted({state.model for state in snapshot.nodes.values() if state.model})
    usages = [state.usage for state in snapshot.nodes.values()]
    tokens = [sum(filter(None, (usage.input_tokens, usage.output_tokens))) for usage in usages]
    cost = sum(usage.cost_usd or 0.0 for usage in usages)
    return {
        "Octoform-Host": snapshot.host,
        "Octoform-Lineage": snapshot.lineage,
        "Octoform-Serial": str(snapshot.serial),
        "Octoform-Harness": ", ".join(makers) or "none",
        "Octoform-Model": ", ".join(models) or "none",
        "Octoform-Usage": f"{sum(tokens)} tokens, {cost:.4f} USD",
    }
