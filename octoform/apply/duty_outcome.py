"""How an agent of the daemon ended, in the words of anyone who asked: the result that crosses to the other process."""

from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import Any

from octoform.apply.stage.acceptance import Finished
from octoform.base.escaping import escaped
from octoform.diagnostics import Diagnostic, Severity
from octoform.harness.port import Usage
from octoform.records import dataclass

DETAIL_CHARACTERS = 600
HOPELESS = frozenset(
    {"APPLY-AUTH", "APPLY-MODEL-REFUSED", "APPLY-PRICE-UNKNOWN", "APPLY-PROMPT-TOO-LARGE", "DUTY-NOT-APPLIED"}
)
"""Refusals that another try only meets again; those of a harness (HARNESS-...) too."""


@dataclass(frozen=True, slots=True)
class DutyOutcome:
    """``ok``: it did what it was asked. ``again``: another try may end otherwise. ``detail`` is for a person.

    ``report`` is the accepted output (None: there is none, and nothing is known), ``action`` what HEAL wants done by
    others, ``changed``: another server is accepted than before. ``calls`` counts the agent's runs.
    """

    ok: bool
    detail: str
    again: bool = True
    report: Mapping[str, Any] | None = None
    action: str | None = None
    changed: bool = False
    calls: int = 0
    usage: Usage = field(default_factory=Usage)

    def to_document(self) -> dict[str, Any]:
        """As JSON."""
        usage = self.usage
        spent = {
            "calls": self.calls,
            "input_tokens": usage.input_tokens or 0,
            "output_tokens": usage.output_tokens or 0,
            # A call of unknown price is not free.
            "usd": usage.cost_usd if usage.cost_usd is not None or self.calls else 0.0,
        }
        return {
            "ok": self.ok,
            "detail": escaped(self.detail)[:DETAIL_CHARACTERS],
            "again": self.again,
            "spent": spent,
            "report": dict(self.report) if self.report is not None else None,
            "action": self.action,
            "changed": self.changed,
        }


def refusal(found: Iterable[Diagnostic], finished: Finished | None = None) -> DutyOutcome:
    """Why there is no accepted output."""
    errors = [item for item in found if item.severity is Severity.ERROR]
    text = "; ".join(f"{item.code}: {item.summary}" for item in errors[:3]) or "nothing was accepted"
    again = not any(item.code in HOPELESS or item.code.startswith("HARNESS-") for item in errors)
    calls, usage = (finished.attempts, finished.usage) if finished is not None else (0, Usage())
    return DutyOutcome(ok=False, detail=text, again=again, calls=calls, usage=usage)
