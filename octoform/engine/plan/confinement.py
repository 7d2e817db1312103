"""Which agents of a run no sandbox will hold, and why: said before they run, and again when the run ends."""

from collections.abc import Iterator, Mapping
from functools import cache

from octoform.diagnostics import Diagnostic, warning
from octoform.harness.sandbox import unconfined
from octoform.manifest.model import MODEL_FREE, STEP, HarnessSpec, Manifest
from octoform.plan.model import Plan


def without_sandbox(manifest: Manifest, plan: Plan, environ: Mapping[str, str]) -> Iterator[Diagnostic]:
    """A warning for each reason, with the stages whose agent runs without a sandbox for it.

    A recording and the embedded agent, which is a part of octoform, are not spoken of. Asks bubblewrap once for each
    setting, and only where an agent is called at all.
    """
    why = cache(lambda sandbox: unconfined(environ, sandbox))
    reasons: dict[str, list[str]] = {}
    for item in plan.work:
        for spec in _agents(manifest, item.node) if item.calls_agent else ():
            reason = why(spec.sandbox) if spec.name not in MODEL_FREE else ""
            if reason and item.node not in reasons.setdefault(reason, []):
                reasons[reason].append(item.node)
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
