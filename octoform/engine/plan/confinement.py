"""Which agents of a run no sandbox will hold, or one that lacks a wall: said before they run, and when the run ends."""

from collections.abc import Iterator, Mapping
from functools import cache

from octoform.diagnostics import Diagnostic, warning
from octoform.harness import walls
from octoform.harness.sandbox import unconfined
from octoform.manifest.model import MODEL_FREE, STEP, HarnessSpec, Manifest
from octoform.plan.model import Plan


def without_sandbox(manifest: Manifest, plan: Plan, environ: Mapping[str, str]) -> Iterator[Diagnostic]:
    """A warning for each reason why an agent runs without a sandbox, and for each wall that a sandbox lacks here.

    A recording and the embedded agent, which is a part of octoform, are not spoken of. Asks bubblewrap once for each
    setting, and only where an agent is called at all.
    """
    why = cache(lambda sandbox: unconfined(environ, sandbox))
    reasons: dict[str, list[str]] = {}
    for item in plan.work:
        for spec in _agents(manifest, item.node) if item.calls_agent else ():
            if spec.name not in MODEL_FREE:
                nodes = reasons.setdefault(why(spec.sandbox), [])
                nodes += [] if item.node in nodes else [item.node]
    confined = reasons.pop("", [])
    for wall in walls.missing(walls.kernel()) if confined else ():
        yield warning(
            "HARNESS-WALL-MISSING",
            f"the sandbox of {', '.join(confined)} lacks a wall: {wall}",
            hint="octoform explain HARNESS-WALL-MISSING tells what closes it",
        )
    for reason, nodes in reasons.items():
        yield warning(
            "HARNESS-UNCONFINED",
            f"the agent of {', '.join(nodes)} runs without a sandbox: {reason}",
            hint="it may write whatever you may write; octoform explain HARNESS-UNCONFINED",
        )


def _agents(manifest: Manifest, node: str) -> Iterator[HarnessSpec]:
    settings = manifest.step if node.startswith(STEP) else manifest.stages.get(node)
    if settings is not None:
        yield settings.harness
        if settings.escalate is not None:
            yield settings.escalate.harness
