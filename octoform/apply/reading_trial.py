"""A test by reading: a unit is read, moved, read again and moved back; what counts is what it really did.

An acknowledged command proves nothing: a servo whose torque is off, whose cable is loose or whose gear is stuck answers
like any other. So octoform itself reads before and after, and every reading stays as evidence.
"""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from octoform.apply.context import Clock
from octoform.apply.trial_tools import Hand, Restoring, ToolAnswer
from octoform.base.escaping import escaped
from octoform.base.shape import resolve
from octoform.diagnostics import Diagnostic, error, warning
from octoform.protocol.model import Proof
from octoform.records import dataclass, field

POLL_SECONDS = 0.1
STEADY_PART = 0.1
"""Two readings that differ by less than this part of the least movement are the same place."""
MAX_CHARACTERS = 600
Trial = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Bench:
    """The shared parts of a step's tests: the proof, the tool client, the tools of INTERFACE by name, the run's clock.

    ``folder`` is where pictures are kept.
    """

    proof: Proof
    hand: Hand
    tools: Mapping[str, Mapping[str, Any]]
    clock: Clock
    folder: Path


@dataclass(slots=True)
class Tried:
    """The result of one test. Readings are in the proof's unit; ``readings`` are [seconds since the test began, value].

    ``noise``, ``moved`` and ``returned`` are differences of pictures: of two before the move, of the one after it and
    of the one after the way back, each from the second before. ``again``: it was tried a second time. ``restored``:
    what the test had changed by the way is as it was before. ``over``: no further test makes sense.
    """

    unit: str
    tool: str
    before: float | None = None
    goal: float | None = None
    after: float | None = None
    back: float | None = None
    noise: float | None = None
    moved: float | None = None
    returned: float | None = None
    readings: list[tuple[float, float]] = field(default_factory=list)
    found: list[Diagnostic] = field(default_factory=list)
    again: bool = False
    restored: bool = False
    over: bool = False

    def to_document(self) -> dict[str, Any]:
        """The test as it is recorded: what was found by its codes, and nothing that was not measured."""
        record = {name: value for name, value in asdict(self).items() if value not in (None, [], False)}
        return {**record, "found": [item.code for item in self.found]}

    def blame(self, code: str, summary: str, where: str, detail: str | None = None, hint: str | None = None) -> None:
        """Add a finding; words of a device in it are shown, never obeyed."""
        shown = escaped(detail[:MAX_CHARACTERS]) if detail else None
        self.found.append(error(code, summary, pointer=where, detail=shown, hint=hint))

    def warn(self, code: str, summary: str, where: str, hint: str) -> None:
        """Add what is odd and refuses nothing."""
        self.found.append(warning(code, summary, pointer=where, hint=hint))


def by_reading(bench: Bench, trial: Trial, where: str) -> Tried:
    """Carry out one test of the kind reading; ``where`` is its JSON pointer in the artifact."""
    attempt = _ByReading(bench, trial, where)
    attempt.carry_out()
    return attempt.tried


class Mover:
    """The movement of a test, there and back, whatever shows it."""

    def __init__(self, bench: Bench, trial: Trial, where: str) -> None:
        self.bench, self.trial, self.where = bench, trial, where
        self.move: Mapping[str, Any] = trial["move"]
        self.tried = Tried(trial["unit"], self.move["tool"])
        self.began = bench.clock.monotonic()
        self._sent: float | None = None

    @property
    def now(self) -> float:
        """Seconds since the test began."""
        return self.bench.clock.monotonic() - self.began

    def values(self) -> list[float]:
        """The values for the varied parameter, the direction with more room first; empty where there is none."""
        low, high, whole = bounds(self.bench.tools[self.move["tool"]], self.move["vary"])
        least = self.bench.proof.minimum if self.bench.proof.kind == "reading" else 0.0
        by = float(self.move["by"])
        if self.move["relative"]:
            wanted, origin = [by, -by], 0.0
        else:
            origin = self.tried.before or 0.0
            up, down = high - origin, origin - low
            first = -abs(by) if down > up or (down == up and by < 0) else abs(by)
            wanted = [origin + first, origin - first]
        kept = [min(high, max(low, value)) for value in wanted]
        kept = [float(round(value)) for value in kept] if whole else kept
        return [value for value in kept if abs(value - origin) >= max(least, 1e-9)]

    def set(self, value: float) -> ToolAnswer:
        """Send the movement."""
        whole = bounds(self.bench.tools[self.move["tool"]], self.move["vary"])[2]
        given = {**self.move["arguments"], self.move["vary"]: round(value) if whole else value}
        answer = self.bench.hand.call(self.move["tool"], given)
        self.tried.over = self.tried.over or answer.over
        return answer

    def go(self) -> bool:
        """Move away; True when the tool took it. Where it refuses one direction, the other is tried once."""
        values, refusal = self.values(), ToolAnswer(None)
        if not values:
            self._no_room()
            return False
        origin = (self.tried.before or 0.0) if self.move["relative"] else 0.0
        for value in values:
            self.tried.goal = value + origin
            answer = self.set(value)
            if answer.value is not None:
                self._sent = value
                return not self._is_skipped(answer.value)
            refusal = refusal if refusal.words else answer
            if not (answer.refused or self.move["relative"]):
                self._sent = value  # it may have moved, or may still go there
            if answer.over or not self.is_where_it_was():
                break
        self.tried.goal = values[0] + origin
        self._not_done(refusal)
        return False

    def go_back(self) -> ToolAnswer | None:
        """Move back to where it was; None when nothing had been sent."""
        if self._sent is None or self.tried.over:
            return None
        if self.move["relative"]:
            return self.set(-self._sent)
        low, high, _ = bounds(self.bench.tools[self.move["tool"]], self.move["vary"])
        return self.set(min(high, max(low, self.tried.before or 0.0)))

    def is_where_it_was(self) -> bool:
        """Whether it is known not to have moved; then the other direction may be tried."""
        return False

    def _is_skipped(self, value: Mapping[str, Any], pointer: str = "") -> bool:
        reason = skipped(value) or skipped(resolve(value, pointer.rpartition("/")[0]))
        if reason is None:
            return False
        self.tried.blame(
            "STEP-UNIT-SKIPPED",
            f"{self.tried.unit} was to be tried, and {self.tried.tool} skips it",
            self.where,
            reason,
            "name it under skipped with this reason; a unit that works is enabled in the profile's rig",
        )
        return True

    def _no_room(self) -> None:
        low, high, _ = bounds(self.bench.tools[self.move["tool"]], self.move["vary"])
        least, unit = self.bench.proof.minimum, self.bench.proof.unit
        text = f"{self.tried.unit} has no room to move by {least:g} {unit}".rstrip()
        hint = "raise `by`, or try another unit: the goal must keep to the tool's own bounds"
        self.tried.blame("STEP-NO-ROOM", text, self.where, f"{self.move['vary']} is from {low:g} to {high:g}", hint)

    def _not_done(self, answer: ToolAnswer) -> None:
        if answer.refused:
            hint = "a policy, a limit or the emergency stop is in the way; octoform audit shows which"
            text = f"the endpoint did not let {self.tried.tool} move {self.tried.unit}"
            self.tried.blame("STEP-CALL-REFUSED", text, self.where, answer.words, hint)
        else:
            text = f"{self.tried.tool} could not move {self.tried.unit}"
            self.tried.blame("STEP-CALL-FAILED", text, self.where, answer.words)


class _ByReading(Mover):
    """A movement that a value of the device shows."""

    def carry_out(self) -> None:
        tried = self.tried
        tried.before = self.read()
        if tried.before is None:
            return
        restoring = Restoring(self.bench.hand, self.bench.tools, self.trial.get("restore"))
        restoring.remember()
        if self.go():
            tried.after = self.settled(tried.before)
            if self._is_still(tried.before, tried.after):
                self._stuck(tried.before, tried.after, f"{tried.tool} answered that all is well")
        self._return()
        if not tried.over:
            self._restore(restoring)

    def _restore(self, restoring: Restoring) -> None:
        problem, tried = restoring.put_back(), self.tried
        tried.restored, tried.over = restoring.done, restoring.over
        if problem is not None:
            text = f"not all is known to be restored after the hardware test of {tried.unit}: {problem}"
            hint = "see what it means for the device, and set it by hand"
            shown = escaped(restoring.words[:MAX_CHARACTERS]) or None
            tried.found.append(
                warning("STEP-NOT-RESTORED", text, pointer=f"{self.where}/restore", detail=shown, hint=hint)
            )

    def read(self) -> float | None:
        """The unit's value now; None with a finding when there is none."""
        reading = self.trial["read"]
        answer = self.bench.hand.call(reading["tool"], reading["arguments"])
        self.tried.over = self.tried.over or answer.over
        if answer.value is None:
            code = "STEP-CALL-REFUSED" if answer.refused else "STEP-CALL-FAILED"
            self.tried.blame(code, f"{reading['tool']} could not read {self.tried.unit}", self.where, answer.words)
            return None
        if self._is_skipped(answer.value, reading["value"]):
            return None
        value = resolve(answer.value, reading["value"])
        if isinstance(value, bool) or not isinstance(value, int | float):
            text = f"the result of {reading['tool']} has no number at {reading['value'] or 'its top'}"
            hint = f"the result has: {', '.join(answer.value)}" if answer.value else "the result is empty"
            self.tried.blame("STEP-NO-READING", text, f"{self.where}/read/value", hint=escaped(hint[:MAX_CHARACTERS]))
            return None
        self.tried.readings.append((round(self.now, 2), float(value)))
        return float(value)

    def settled(self, origin: float) -> float | None:
        """The value once it is steady away from ``origin``, or as it is when the time for that is over."""
        least = self.bench.proof.minimum
        end = self.now + self.bench.proof.settle
        last = self.read()
        while last is not None and self.now < end:
            self.bench.clock.sleep(POLL_SECONDS)
            value = self.read()
            if value is None:
                return None
            if abs(value - last) <= least * STEADY_PART and abs(value - origin) >= least:
                return value
            last = value
        return last

    def is_where_it_was(self) -> bool:
        """Read it again after a move that was refused."""
        tried = self.tried
        tried.after = self.read()
        return self._is_still(tried.before, tried.after)

    def _not_done(self, answer: ToolAnswer) -> None:
        before, after = self.tried.before, self.tried.after
        if answer.refused or not self._is_still(before, after):
            super()._not_done(answer)
        else:
            text = f"{self.tried.tool} answered: {answer.words}"
            self._stuck(before, after, text, "read the tool's answer; if it does not give the reason, ")

    def _is_still(self, before: float | None, after: float | None) -> bool:
        return before is not None and after is not None and abs(after - before) < self.bench.proof.minimum

    def _stuck(self, before: float | None, after: float | None, message: str, first: str = "") -> None:
        proof, tried = self.bench.proof, self.tried
        self.tried.blame(
            "STEP-NOT-MOVED",
            f"{tried.unit} did not move: {before:g} {proof.unit} before, goal {tried.goal:g}, {after:g} after; "
            f"at least {proof.minimum:g} were wanted",
            self.where,
            message,
            f"{first}look at its power, its cable, its torque and at what blocks it; a unit that is known to be broken "
            "is named as disabled in the profile's rig",
        )

    def _return(self) -> None:
        tried = self.tried
        answer = self.go_back()
        if answer is None or tried.after is None or tried.found:
            return
        if answer.value is not None:
            tried.back = self.settled(tried.after)
        returned = tried.back is not None and abs(tried.back - tried.after) >= self.bench.proof.minimum
        if not returned:
            where = f"{tried.back:g}" if tried.back is not None else "unknown"
            text = f"{tried.unit} did not move back: {tried.before:g} {self.bench.proof.unit} at first, "
            text += f"{tried.after:g} after the move, {where} at the end"
            tried.blame("STEP-NOT-BACK", text, self.where, answer.words or None)


def bounds(tool: Mapping[str, Any], parameter: str) -> tuple[float, float, bool]:
    """(minimum, maximum, integers only) of a tool's parameter; infinite where its schema has no bound."""
    schema = tool["input_schema"].get("properties", {}).get(parameter, {})
    low, high = schema.get("minimum", float("-inf")), schema.get("maximum", float("inf"))
    for limit in tool.get("limits", ()):
        if limit["parameter"] == parameter:
            low, high = max(low, limit.get("minimum", low)), min(high, limit.get("maximum", high))
    return low, high, schema.get("type") == "integer"


def skipped(value: object) -> str | None:
    """Why a tool has left a unit alone; None when it has not."""
    reason = value.get("skipped") if isinstance(value, Mapping) else None
    return reason if isinstance(reason, str) and reason else None
