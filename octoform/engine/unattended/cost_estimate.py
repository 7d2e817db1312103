"""What a run with nobody there may cost at most, against what the hour has left for agents. (Heavy.)

The daemon's caps hold for everything that it starts, and a run of several stages would be stopped in its middle. So all
of it is reckoned before it begins: every attempt that each agent has, SERVE's second round where a trial sends it back.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from octoform.apply.rewrite.promotion import MAKER
from octoform.engine.plan.plan import Outlook
from octoform.manifest.model import MODEL_FREE, Manifest
from octoform.plan.model import PlannedAction


@dataclass(frozen=True, slots=True)
class Left:
    """What agents may still cost in this hour: runs as a count, US dollars; None: nobody counts."""

    calls: int | None = None
    usd: float | None = None

    @classmethod
    def of(cls, brief: Mapping[str, Any], calls: int = 0, usd: float | None = 0.0) -> "Left":
        """As the daemon tells it, less what was spent since; of an unknown price nothing is left."""
        told, money = brief.get("calls"), brief.get("usd")
        rest = None if not isinstance(money, int | float) else 0.0 if usd is None else max(0.0, money - usd)
        return cls(max(0, told - calls) if isinstance(told, int) else None, rest)


def shortages(outlook: Outlook, left: Left) -> tuple[str, ...]:
    """Why this plan is not begun with what is left, each with the cap that is in the way; empty when it may be."""
    manifest = outlook.compiled.manifest
    asked = [item for item in outlook.plan.work if item.calls_agent]
    found = []
    most = sum(_runs(manifest, item) for item in asked)
    if left.calls is not None and most > left.calls:
        words = f"it may take {most} agent runs and the hour has {left.calls} left"
        found.append(f"{words} (daemon.calls_per_hour)")
    dear = [item for item in asked if item.calls_model]
    if left.usd is not None and dear:
        bound = _dollars(manifest, dear)
        if bound is None or bound > left.usd:
            words = (
                "what it costs has no bound (budget.usd)" if bound is None else f"it may cost {bound:.2f} US dollars"
            )
            found.append(f"{words} and the hour has {left.usd:.2f} left (daemon.usd_per_hour)")
    return tuple(found)


def _runs(manifest: Manifest, item: PlannedAction) -> int:
    settings = manifest.settings_of(item.node)
    attempts = settings.budget.attempts
    runs = 1 if settings.harness.name in MODEL_FREE else attempts
    runs += attempts if settings.escalate is not None else 0
    return 2 * runs if item.node == MAKER else runs


def _dollars(manifest: Manifest, dear: list[PlannedAction]) -> float | None:
    """What these may cost together; None where nothing bounds it."""
    each = [manifest.budget_for(item.node).usd for item in dear]
    known = [usd for usd in each if usd is not None]
    bounds = [sum(known)] if len(known) == len(each) else []
    bounds += [manifest.run_usd] if manifest.run_usd is not None else []
    return min(bounds, default=None)
