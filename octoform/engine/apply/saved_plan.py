"""A saved plan at apply: what it asked for, and which of its units may still be applied. (Heavy.)"""

from dataclasses import dataclass, field, replace
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.engine.plan.configuration import Compiled
from octoform.engine.plan.plan import Outlook, Request
from octoform.plan import model, planfile
from octoform.plan.model import Plan
from octoform.state.files import read_regular


@dataclass(slots=True)
class SavedRun:
    """One saved plan, being obeyed. ``stale`` and the units that may run are known after `check`."""

    document: planfile.PlanFile
    stale: frozenset[str] = frozenset()
    runnable: frozenset[str] = field(default_factory=frozenset)

    @property
    def plan(self) -> Plan:
        """The plan as it was shown when it was saved."""
        return model.from_json(self.document.plan)

    def request(self, request: Request) -> Request:
        """The request that the plan was made for."""
        targets = tuple(self.document.targets or ())
        document, again = self.document, tuple(self.document.replace)
        return replace(request, targets=targets, replace=again, reuse=document.reuse, tier1=document.tier1)

    def check(self, outlook: Outlook) -> tuple[Diagnostic, ...]:
        """Compare every unit with what is there now; the diagnostics name what moved."""
        situation, graph = outlook.situation, outlook.compiled.graph
        moved = planfile.moved(self.document, graph, situation.prior, situation.observed)
        before, now = self.document.lineage, outlook.plan.lineage
        if before is not None and before != now:
            moved += [planfile.Moved(unit, "lineage", before, now) for unit in self.document.units]
        self.stale = frozenset(item.unit for item in moved)
        self.runnable = planfile.applicable(self.document, graph, moved)
        return tuple(planfile.describe(item) for item in moved)

    def allows(self, node: str) -> bool:
        """Whether a unit may run."""
        return node in self.runnable


def read_saved(path: Path | None, compiled: Compiled) -> tuple[SavedRun | None, list[Diagnostic]]:
    """The saved plan at ``path``, for this host and lineage; None without diagnostics when there is no path."""
    if path is None:
        return None, []
    data, problem = read_regular(path)
    if data is None:
        missing = error("PLAN-NOT-A-PLAN", "there is no such file", path=str(path))
        return None, [problem or missing]
    document, found = planfile.read(data, str(path))
    if document is None:
        return None, found
    if document.host != compiled.layout.host:
        text = f"the plan is for host {document.host}, this folder is host {compiled.layout.host}"
        return None, [error("PLAN-STALE", text, path=str(path), hint="make a plan for this host")]
    return SavedRun(document), []
