"""What became of a repair: one value from the decision to the incident's record, its line in a log and its view. Light.

The daemon decides, another process carries the repair out, and facts show whether it helped. Each of them adds a reason
and none takes one away, so why a repair was refused or did not hold is read off one list.
"""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from octoform.base.escaping import escaped
from octoform.diagnostics import Diagnostic, Severity
from octoform.records import dataclass, field, replace

if TYPE_CHECKING:
    from octoform.harness.port import Usage

TEXT_CHARACTERS = 1500
"""Of all reasons of one outcome: they hold words of devices and programs."""
WAITS = "heal.waits"
"""The rule of a repair that a person has to confirm; its text names the command."""
CHECK = "check"
"""The rules of what facts showed after a repair; all other reasons are the repair's own."""
HOPELESS = frozenset(
    {"APPLY-AUTH", "APPLY-MODEL-REFUSED", "APPLY-PRICE-UNKNOWN", "APPLY-PROMPT-TOO-LARGE", "DUTY-NOT-APPLIED"}
)
"""Refusals that another try only meets again; those of a harness (HARNESS-...) too."""


class RepairVerdict(StrEnum):
    """How a repair ended."""

    UNDER_WAY = "under_way"
    DONE = "done"
    REFUSED = "refused"
    """A precondition did not hold, so nothing was changed."""
    FAILED = "failed"
    ROLLED_BACK = "rolled_back"
    """It was carried out, and what it changed was taken back."""


@dataclass(frozen=True, slots=True)
class Reason:
    """One step to a verdict. ``rule`` is ``where.rule``, or a diagnostic's code, which ``octoform explain`` has."""

    rule: str
    text: str


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of agents: calls as a count, tokens, US dollars (None is unknown)."""

    calls: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    usd: float | None = 0.0

    @classmethod
    def of(cls, calls: int, usage: "Usage") -> "Cost":
        """Of so many runs; a run of unknown price is not free."""
        usd = usage.cost_usd if usage.cost_usd is not None or calls else 0.0
        return cls(calls, usage.input_tokens or 0, usage.output_tokens or 0, usd)

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> "Cost":
        """As `to_json` has it; a member that is missing is nothing."""
        usd = document.get("usd", 0.0)
        calls, given, made = (int(document.get(name) or 0) for name in ("calls", "input_tokens", "output_tokens"))
        return cls(calls, given, made, None if usd is None else float(usd))

    def to_json(self) -> dict[str, Any]:
        """As records and commands have it."""
        tokens = {"input_tokens": self.input_tokens, "output_tokens": self.output_tokens}
        return {"calls": self.calls, **tokens, "usd": self.usd}

    def __add__(self, other: "Cost") -> "Cost":
        """The sum; dollars are unknown when one of them is."""
        usd = None if self.usd is None or other.usd is None else self.usd + other.usd
        given, made = self.input_tokens + other.input_tokens, self.output_tokens + other.output_tokens
        return Cost(self.calls + other.calls, given, made, usd)


@dataclass(frozen=True, slots=True)
class RepairOutcome:
    """One repair from its decision on; each that deals with it gives the next one, with a reason more.

    ``repair`` is its name, which the loop gives that decides on it; a repair itself may leave it empty.
    ``cost`` is None where it ended without reporting it. ``at`` is when it was decided (RFC 3339); ``seconds`` is None
    for one that was not begun. ``again`` False: no further try of this repair can help. ``changed``: another server or
    another set of packages is in service. ``report`` is the agent's accepted output (WATCH's and HEAL's output.json),
    which no record keeps. ``asked``: a question waits for a person that did not wait before.
    """

    verdict: RepairVerdict
    reasons: tuple[Reason, ...] = ()
    repair: str = ""
    cost: Cost | None = field(default_factory=Cost)
    at: str = ""
    seconds: float | None = None
    again: bool = True
    changed: bool = False
    report: Mapping[str, Any] | None = None
    asked: bool = False

    @classmethod
    def done(cls, rule: str, text: str = "", **more: Any) -> "RepairOutcome":
        """It did what it was asked for, by its own word."""
        return cls(RepairVerdict.DONE, _reasons(rule, text), **more)

    @classmethod
    def refused(cls, rule: str, text: str, **more: Any) -> "RepairOutcome":
        """Nothing was tried."""
        return cls(RepairVerdict.REFUSED, _reasons(rule, text), **more)

    @classmethod
    def failed(cls, rule: str, text: str, **more: Any) -> "RepairOutcome":
        """It was tried and did not come to its end."""
        return cls(RepairVerdict.FAILED, _reasons(rule, text), **more)

    @classmethod
    def of_diagnostics(cls, found: Iterable[Diagnostic], cost: Cost | None = None, **more: Any) -> "RepairOutcome":
        """Why there is no accepted output, each error under its code; one that cost nothing was refused."""
        errors = [item for item in found if item.severity is Severity.ERROR]
        reasons = tuple(Reason(item.code, item.summary) for item in errors[:3])
        hopeless = any(item.code in HOPELESS or item.code.startswith("HARNESS-") for item in errors)
        verdict = RepairVerdict.FAILED if cost is not None and cost.calls else RepairVerdict.REFUSED
        given: dict[str, Any] = {"verdict": verdict, "cost": cost or Cost(), "again": not hopeless, **more}
        return cls(reasons=reasons or (Reason("", "nothing was accepted"),), **given)

    @property
    def ok(self) -> bool:
        """The repair's own word, whatever facts showed afterwards."""
        return self.verdict is RepairVerdict.DONE or any(map(_is_check, self.reasons))

    @property
    def spent(self) -> Cost:
        """The cost as far as it is known."""
        return self.cost or Cost()

    @property
    def begun(self) -> bool:
        """False for one that was refused before anything was asked to carry it out."""
        return self.seconds is not None

    @property
    def detail(self) -> str:
        """The repair's own reasons in one sentence; those of a diagnostic with its code."""
        return "; ".join(_sentence(each) for each in self.reasons if each.text and not _is_check(each))

    def because(self, rule: str, text: str, **changed: Any) -> "RepairOutcome":
        """With a reason more, and whatever else that changes."""
        return replace(self, reasons=(*self.reasons, Reason(rule, text)), **changed)

    def after(self, asked: "RepairOutcome") -> "RepairOutcome":
        """This one as what came of a repair that an agent asked for: with its reasons, its report and its cost."""
        cost = None if self.cost is None or asked.cost is None else asked.cost + self.cost
        return replace(self, reasons=(*self.reasons, *asked.reasons), report=asked.report, cost=cost)

    def ended(self, begun: "RepairOutcome", seconds: float) -> "RepairOutcome":
        """This one as the end of what was ``begun``, so many seconds later."""
        return replace(self, repair=begun.repair, reasons=(*begun.reasons, *self.reasons), at=begun.at, seconds=seconds)

    def plain(self) -> "RepairOutcome":
        """As a record may keep it: without its report, with reasons that hide nothing and are bounded."""
        left, kept = TEXT_CHARACTERS, []
        for each in self.reasons:
            text = escaped(each.text)[:left]
            left -= len(text)
            kept.append(Reason(escaped(each.rule)[:80], text))
        return replace(self, reasons=tuple(kept[:20]), report=None)

    def summary(self) -> dict[str, Any]:
        """As a line of a log has it; the incident has the whole of its reasons."""
        return {
            "repair": self.repair,
            "verdict": self.verdict,
            "ok": self.ok,
            "rules": [each.rule for each in self.reasons if each.rule],
            "detail": self.detail[:300],
            "seconds": self.seconds,
        }

    def to_json(self) -> dict[str, Any]:
        """As it crosses to another process, and as records and commands have it."""
        plain = self.plain()
        document = {
            "repair": self.repair,
            "verdict": self.verdict,
            "at": self.at,
            "ok": self.ok,
            "detail": plain.detail,
            "seconds": self.seconds,
            "reasons": [{"rule": each.rule, "text": each.text} for each in plain.reasons],
            "cost": None if self.cost is None else self.cost.to_json(),
            "again": self.again,
            "changed": self.changed,
        }
        passing = {"report": None if self.report is None else dict(self.report), "asked": self.asked}
        return document | {name: value for name, value in passing.items() if value}

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> "RepairOutcome":
        """As `to_json` has it, or as a former version does: with ``ok`` and ``detail`` alone."""
        given, cost, report = document.get("reasons"), document.get("cost"), document.get("report")
        listed = given if isinstance(given, list) else [{"rule": "", "text": document.get("detail") or ""}]
        seconds = document.get("seconds")
        return cls(
            verdict=RepairVerdict(document.get("verdict") or ("done" if document.get("ok") is True else "failed")),
            reasons=tuple(Reason(str(each["rule"]), str(each["text"])) for each in listed if each["text"]),
            repair=str(document.get("repair") or ""),
            cost=Cost.from_json(cost) if isinstance(cost, Mapping) else None,
            at=str(document.get("at") or ""),
            seconds=None if seconds is None else float(seconds),
            again=document.get("again") is not False,
            changed=document.get("changed") is True,
            report=report if isinstance(report, Mapping) else None,
            asked=document.get("asked") is True,
        )


def _reasons(rule: str, text: str) -> tuple[Reason, ...]:
    return (Reason(rule, text),) if text else ()


def _sentence(reason: Reason) -> str:
    return f"{reason.rule}: {reason.text}" if reason.rule.isupper() else reason.text


def _is_check(reason: Reason) -> bool:
    return reason.rule.partition(".")[0] == CHECK
