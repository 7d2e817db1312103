"""What one agent is asked for: the stage, who does it with which budget, what it may read, and who judges its output.

Most stages are one assignment. IDENTIFY with ``escalate`` is two: the second goes to another agent, reads only what
the first left unknown, and its output is judged merged with that of the first.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.apply import scan
from octoform.apply.context import Context
from octoform.apply.gate import Verdict, judge
from octoform.apply.reading import predecessor
from octoform.apply.settling import runtime_files
from octoform.diagnostics import Diagnostic, error
from octoform.harness.port import Price, Task
from octoform.harness.pricing import OWNERS, price_of
from octoform.manifest.model import MODEL_FREE, Budget, HarnessSpec
from octoform.manifest.references import resolve

UNMEASURED = (*MODEL_FREE, "command")
"""Harnesses whose output tells nothing while they run: a command reports what it has used when it has ended."""

Judge = Callable[[Context, Task, bytes], tuple[Any, list[Diagnostic]]]
"""(context, task, bytes of the output) -> (value, diagnostics); the value is None when it cannot be read."""
Prove = Callable[[Context, Task, Any, list[Diagnostic]], Verdict]
"""(context, task, value, what was found so far) -> the verdict on a value that passed its contract."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """``role`` is ``stage`` or ``escalate``; ``given`` is the content of an input other than the accepted artifact.

    ``beside`` are more files that its folder begins with, by name. ``prove`` takes the place of a stage's own proof.
    ``model`` is the name of the manifest, reference unresolved.
    """

    stage: str
    harness: HarnessSpec
    model: str | None
    budget: Budget
    role: str = "stage"
    given: bytes | None = None
    judge: Judge = judge
    prove: Prove | None = None
    beside: Mapping[str, bytes] = field(default_factory=dict)

    def input(self, context: Context, workdir: Path) -> Path | None:
        """The one artifact that the agent may read."""
        return workdir / "input.json" if self.given is not None else predecessor(context, self.stage)

    def model_name(self, context: Context) -> str | None:
        """The model with its references replaced; for the agent's arguments alone, never for a file."""
        return None if self.model is None else resolve(self.model, context.environ)

    def price(self, context: Context) -> Price | None:
        """What its model costs; None when it uses none or nobody knows."""
        name = self.model_name(context)
        if name is None or self.harness.name in MODEL_FREE:
            return None
        listed = context.manifest.prices.get(self.model or "")
        known = {name: Price(listed.input, listed.cached, listed.output, OWNERS)} if listed is not None else {}
        return price_of(name, known)


def unaffordable(context: Context, assignment: Assignment, left: float | None) -> Diagnostic | None:
    """Why the next attempt may not start for want of money or of a price; None when it may.

    A limit that cannot be measured is no limit, so a model without a known price is not started under one.
    """
    if left is None or assignment.harness.name in MODEL_FREE:
        return None
    if left <= 0:
        return error(
            "APPLY-COST-LIMIT",
            f"the budget in dollars is spent before {assignment.stage} has an accepted output",
            hint="raise budget.usd in octopus.yaml, or look at `octoform attempts` to see what cost so much",
        )
    if assignment.harness.name not in UNMEASURED and assignment.price(context) is None:
        return error(
            "APPLY-PRICE-UNKNOWN",
            f"budget.usd is set, and nobody knows what {assignment.model} costs",
            hint=f"add it to octopus.yaml: prices: {{{assignment.model}: {{input: ..., output: ...}}}}",
        )
    return None


def of_stage(context: Context, stage: str) -> Assignment:
    """The assignment of a stage as the manifest gives it."""
    manifest = context.manifest
    harness, budget = manifest.harness_for(stage), manifest.budget_for(stage)
    # The embedded agent's PROBE is the host's own scan; a recorded run may be that of another host.
    by_another = stage == "probe" and harness.name not in MODEL_FREE
    # Who writes a server reads what it stands on; the embedded agent knows it.
    beside = runtime_files() if stage == "serve" and harness.name not in MODEL_FREE else {}
    judged = scan.judge if by_another else judge
    return Assignment(stage, harness, manifest.model_for(stage), budget, judge=judged, beside=beside)
