"""The limits on calls: judged and counted in one step, outside the generated code, for every caller.

Numbers are compared as they are written: ten times 0.1 is 1, whatever a binary fraction makes of it. What is counted
(sums, last values, times of calls) survives a restart in ``limits.json``, and a call counts before the device moves:
one that fails may have moved it. A file that cannot be trusted never means "nothing counted": the tools concerned are
refused until a person sets them back.
"""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from fractions import Fraction
from pathlib import Path
from typing import Any

from octoform.server.limit_counters import Counters, CountersUnwritable, Used
from octoform.server.tool_policy import Limit, Policy, ToolPolicy, Units

# What limits in time say of a call: rates, pauses between calls, quiet hours. An empty text lets it pass.


def rate(tool: str, limit: Limit, used: Used, now: float) -> str:
    """Whether a call is one too many in its time; empty when it is not."""
    recent = [moment for moment in used.calls if now - moment < limit.seconds]
    if len(recent) < limit.calls:
        return ""
    wait = limit.seconds - (now - recent[-limit.calls])
    return (
        f"{tool} was called {len(recent)} times in the last {_seconds(limit.seconds)}; {limit.calls} are allowed "
        f"({limit.source}). The next call is allowed in {_seconds(wait)}."
    )


def cooldown(tool: str, limit: Limit, used: Used, now: float) -> str:
    """Whether a call comes too soon after the last one; empty when it does not."""
    if not used.calls or now - used.calls[-1] >= limit.seconds:
        return ""
    gone = now - used.calls[-1]
    return (
        f"{tool} was called {_seconds(gone)} ago; {_seconds(limit.seconds)} have to lie between two calls "
        f"({limit.source}). The next call is allowed in {_seconds(limit.seconds - gone)}."
    )


def quiet_hours(tool: str, limit: Limit, now: datetime) -> str:
    """Whether a call comes in quiet hours; empty when it does not."""
    minute, begin, end = now.hour * 60 + now.minute, limit.begin, limit.end
    inside = begin <= minute < end if begin < end else minute >= begin or minute < end
    if not inside:
        return ""
    if begin == end:
        return f"{tool} has quiet hours all day ({limit.source})."
    return (
        f"{tool} has quiet hours from {_time(begin)} to {_time(end)} ({limit.source}), and it is {_time(minute)} on "
        f"this host. It is allowed from {_time(end)} on."
    )


def _seconds(value: float) -> str:
    return f"{value:.1f} s" if value % 1 else f"{value:.0f} s"


def _time(minutes: int) -> str:
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


_COUNTED = frozenset({"step", "cumulative", "rate", "cooldown"})
_SHOWN = 60
_BITS = 1000


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a call is not let through: ``code`` for a program, ``text`` for anyone who called and for a person.

    Codes are the kinds of limits, and no_number, unknown_tool, counters_damaged, counters_unwritable, reported.
    """

    code: str
    text: str


class Ledger:
    """The limits of a policy and what is used of them. Safe to use from threads.

    ``path`` is the file of the counters. ``clock`` gives seconds that never jump back, ``now`` the local wall clock.
    """

    def __init__(
        self,
        policy: Policy,
        path: Path,
        clock: Callable[[], float] = time.monotonic,
        now: Callable[[], datetime] = datetime.now,
    ) -> None:
        self._tools, self._shadow = policy.tools, policy.mode == "shadow"
        self._clock, self._now = clock, now
        self._lock = threading.Lock()
        counted = {name for name, tool in policy.tools.items() if any(item.kind in _COUNTED for item in tool.limits)}
        counted |= {name for name, tool in policy.tools.items() if tool.places}
        self._counters = Counters(path, counted, clock, lambda: now().timestamp())
        self._summing = {
            name for name, tool in policy.tools.items() if any(item.kind == "cumulative" for item in tool.limits)
        }
        self._outside = {name: dict(self._counters.of(name).outside) for name in sorted(counted)}
        """By the tool that moved them: the units whose device reports a place outside of their range, in words."""
        self._zeroed: dict[str, set[tuple[str, str]]] = {}
        """Tool to the (tool, sum) pairs that begin again at zero once a call of it went well."""
        for name, item in policy.tools.items():
            for limit in item.limits:
                if limit.zero:
                    self._zeroed.setdefault(limit.zero, set()).add((name, limit.sum))

    def judge(self, tool: str, arguments: Mapping[str, Any]) -> Refusal | None:
        """Whether the call would be let through now; counts nothing."""
        with self._lock:
            return self._judged(tool, arguments)

    def reserve(self, tool: str, arguments: Mapping[str, Any]) -> Refusal | None:
        """Judge the call and, where it is let through, count it: None means that it may go on, and has counted."""
        with self._lock:
            refusal = self._judged(tool, arguments)
            if refusal is not None:
                return refusal
            limits = self._tools[tool].limits
            if all(limit.kind not in _COUNTED for limit in limits):
                return None
            try:
                self._counters.put(tool, self._after(self._counters.of(tool), limits, arguments))
            except CountersUnwritable as problem:
                return Refusal("counters_unwritable", f"{tool} is refused: {problem}. Its limits could not be kept.")
            return None

    def hold(self, tool: str, outside: Mapping[str, str]) -> bool:
        """Let nothing move these units of a tool any more until a person sets the tool back; it has moved them.

        False in shadow mode, which holds nothing. What cannot be written holds as long as this process lives.
        """
        if self._shadow:
            return False
        with self._lock, suppress(CountersUnwritable):
            self._outside.setdefault(tool, {}).update(outside)
            self._counters.put(tool, replace(self._counters.of(tool), outside=dict(self._outside[tool])))
        return True

    def settle(self, tool: str, arguments: Mapping[str, Any], *, well: bool) -> None:
        """A call that counted has ended. After one that went well, sums that it brings to their origin are zero.

        One that failed may have moved the device, wholly or in part, or not at all, and from then on all of it is
        reckoned with, also on the way to the origin. What cannot be written stays as it was for a sum that should be
        zero: that refuses too much rather than too little.
        """
        if tool not in self._zeroed and (well or tool not in self._summing):
            return
        with self._lock, suppress(CountersUnwritable):
            if not well and tool in self._summing:
                self._counters.put(tool, self._doubted(self._counters.of(tool), self._tools[tool].limits, arguments))
            for name, key in sorted(self._zeroed.get(tool, ())):
                used = self._counters.of(name)
                if not used.damaged and (used.sums.get(key) or key in used.doubts):
                    self._counters.put(name, _at_zero(used, key) if well else _near_zero(used, key))

    @staticmethod
    def _doubted(used: Used, limits: tuple[Limit, ...], arguments: Mapping[str, Any]) -> Used:
        doubts = dict(used.doubts)
        summed = [limit for limit in limits if limit.kind == "cumulative"]
        # Shadow mode lets calls run that no sum has counted, with arguments that are no numbers.
        counted = [limit for limit in summed if is_number(arguments.get(limit.parameter, 0))]
        for key, value in {(limit.sum, _value(limit, arguments)) for limit in counted}:
            low, high = doubts.get(key, (Fraction(0), Fraction(0)))
            if value is not None:
                doubts[key] = (low + max(value, Fraction(0)), high - min(value, Fraction(0)))
        return replace(used, doubts=doubts)

    def reset(self, tool: str | None) -> None:
        """Forget what was counted for a tool, or for all: sums, last values, times. Makes a damaged file good.

        KeyError for a tool that is not in the policy; OSError when the file cannot be written.
        """
        if tool is not None and tool not in self._tools:
            raise KeyError(tool)
        with self._lock:
            self._counters.reset(tool)
            for name in self._outside if tool is None else (tool,):
                self._outside[name] = {}

    def used(self) -> dict[str, dict[str, Any]]:
        """For each tool with counted limits, as plain values: ``sums`` and ``last`` by parameter, ``calls`` (the ages
        of its counted calls in seconds), ``damaged``."""
        with self._lock:
            return {name: self._counters.of(name).shown(self._clock()) for name in sorted(self._counters.names)}

    def held(self) -> dict[str, dict[str, str]]:
        """By tool: the units that nothing moves, because the device reported them outside of their range."""
        with self._lock:
            return {name: dict(units) for name, units in self._outside.items() if units}

    def _judged(self, tool: str, arguments: Mapping[str, Any]) -> Refusal | None:
        policy = self._tools.get(tool)
        if policy is None:
            return Refusal("unknown_tool", f"{_cut(ascii(tool))} is not in the policy of this endpoint")
        if (beyond := self._beyond(policy, arguments)) is not None:
            return beyond
        if not policy.limits:
            return None
        used = self._counters.of(tool)
        if used.damaged:
            text = (
                f"{tool} is refused: {self._counters.damage}, so what was counted for its limits is not known. "
                f"A person looks at the device and then sets it back: octoform limits -reset {tool}"
            )
            return Refusal("counters_damaged", text)
        found = [item for item in (self._one(tool, limit, arguments, used) for limit in policy.limits) if item]
        texts = list(dict.fromkeys(item.text for item in found))
        return Refusal(found[0].code, " ".join(texts)) if found else None

    def _beyond(self, policy: ToolPolicy, arguments: Mapping[str, Any]) -> Refusal | None:
        """The refusal of a call of a unit that its device last reported outside of its range."""
        if policy.effect == "read" or policy.ends:
            return None
        for name, units in self._outside.items():
            other = self._tools[name]
            if not units or set(other.buses).isdisjoint(policy.buses):
                continue
            for unit, text in units.items():
                words = {unit, *(other.units.names[unit] if other.units and unit in other.units.names else ())}
                if policy.units is None or policy.units.acts_on(words, arguments):
                    return Refusal("reported", f"{beyond_text(name, unit, text)}.")
        return None

    def _one(self, tool: str, limit: Limit, arguments: Mapping[str, Any], used: Used) -> Refusal | None:
        """The verdict of one limit."""
        if limit.kind == "goal":
            return _of_goal(tool, limit, self._tools[tool].units, arguments)
        if limit.parameter:
            return _of_value(limit, arguments, used, tool)
        if limit.kind == "quiet_hours":
            text = quiet_hours(tool, limit, self._now())
        elif limit.kind == "rate":
            text = rate(tool, limit, used, self._clock())
        else:
            text = cooldown(tool, limit, used, self._clock())
        return Refusal(limit.kind, text) if text else None

    def _after(self, used: Used, limits: tuple[Limit, ...], arguments: Mapping[str, Any]) -> Used:
        """The counters once this call counts."""
        now = self._clock()
        timed = [limit for limit in limits if limit.seconds]
        span = max((limit.seconds for limit in timed), default=0.0)
        calls = [moment for moment in used.calls if now - moment < span] + [now] * bool(timed)
        kept = max((limit.calls for limit in timed), default=0) or 1
        sums, last = dict(used.sums), dict(used.last)
        for kind, name, value in {(limit.kind, limit.sum, _value(limit, arguments)) for limit in limits}:
            if kind == "cumulative" and value is not None:
                sums[name] = used.sums.get(name, Fraction(0)) + value
            elif kind == "step" and value is not None:
                last[name] = value
        return replace(used, sums=sums, last=last, calls=tuple(calls[-kept:]))


def beyond_text(tool: str, unit: str, text: str) -> str:
    """Why a unit moves no more, and what ends that."""
    return (
        f"after a call of {tool} the device reported {unit} {text}; nothing moves it until a person has looked at it "
        f"and runs: octoform limits -reset {tool}"
    )


def outside(limit: Limit, place: float, within: float) -> str:
    """How a reported place is outside of a range, beyond what a device may be off; empty when it is not."""
    value, margin = exact(place), exact(within)
    low = None if limit.minimum is None else exact(limit.minimum) - margin
    high = None if limit.maximum is None else exact(limit.maximum) + margin
    if (low is None or value >= low) and (high is None or value <= high):
        return ""
    return f"at {_number(value)}{_unit(limit)}, outside of its range ({limit.source}){_allowed(limit)}"


def _at_zero(used: Used, key: str) -> Used:
    doubts = {other: doubt for other, doubt in used.doubts.items() if other != key}
    return replace(used, sums={**used.sums, key: Fraction(0)}, doubts=doubts)


def _near_zero(used: Used, key: str) -> Used:
    """Somewhere between where it may have been and zero."""
    total = used.sums.get(key, Fraction(0))
    low, high = used.doubts.get(key, (Fraction(0), Fraction(0)))
    doubt = (total - min(total - low, Fraction(0)), max(total + high, Fraction(0)) - total)
    return replace(used, doubts={**used.doubts, key: doubt})


def _of_value(limit: Limit, arguments: Mapping[str, Any], used: Used, tool: str) -> Refusal | None:
    name = limit.parameter
    if name in arguments and not is_number(arguments[name]):
        shown = (
            _cut(ascii(arguments[name])) if isinstance(arguments[name], str | float | bool) else _kind(arguments[name])
        )
        allowed = _allowed(limit)
        text = f"{name} is {shown}, which is no finite number; its limit ({limit.source}) takes only one{allowed}."
        return Refusal("no_number", text)
    value = _value(limit, arguments)
    if value is None:
        return None
    if limit.kind == "range":
        text = _range(limit, value)
        if text and limit.default is not None and value == exact(limit.default):
            text += f" {limit.default}{_unit(limit)} is its default: a call that does not give {name} is refused too."
    elif limit.kind == "step":
        text = _step(limit, value, used.last.get(name))
    else:
        text = _cumulative(limit, value, used, tool)
    return Refusal(limit.kind, text) if text else None


def _of_goal(tool: str, limit: Limit, units: Units | None, arguments: Mapping[str, Any]) -> Refusal | None:
    """A bound of the place to which a unit is moved, whatever tool moves it."""
    goals = {} if units is None else units.goals(arguments)
    if limit.of not in goals:
        return None
    goal = goals[limit.of]
    if not is_number(goal):
        text = (
            f"{tool} does not declare in advance where it moves {limit.of}, whose range is limited ({limit.source})"
            f"{_allowed(limit)}. Use a tool that is given the goal."
        )
        return Refusal("goal", text)
    text = _range(replace(limit, parameter=f"the goal of {limit.of} in {tool},"), exact(goal))
    return Refusal("goal", text) if text else None


def _value(limit: Limit, arguments: Mapping[str, Any]) -> Fraction | None:
    """The parameter's value as it is written; its default where it is absent; None where neither is known."""
    if limit.parameter in arguments:
        return exact(arguments[limit.parameter])
    return None if limit.default is None else exact(limit.default)


def exact(number: float) -> Fraction:
    """A finite number as its shortest decimal writing states."""
    return Fraction(number) if isinstance(number, int) else Fraction(repr(number))


def is_number(value: Any) -> bool:
    """Whether it is a finite number that can be judged."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return value.bit_length() <= _BITS if isinstance(value, int) else value - value == 0


def _range(limit: Limit, value: Fraction) -> str:
    low, high = limit.minimum, limit.maximum
    if low is not None and value < exact(low):
        side, bound = "below the least", low
    elif high is not None and value > exact(high):
        side, bound = "above the most", high
    else:
        return ""
    unit = _unit(limit)
    return (
        f"{limit.parameter} {_number(value)}{unit} is {side} that is allowed, {bound}{unit} ({limit.source})"
        f"{_allowed(limit)}."
    )


def _step(limit: Limit, value: Fraction, last: Fraction | None) -> str:
    most = exact(limit.most)
    if last is None or abs(value - last) <= most:
        return ""
    unit = _unit(limit)
    return (
        f"{limit.parameter} {_number(value)}{unit} is {_number(abs(value - last))}{unit} away from the last one, "
        f"{_number(last)}{unit}; one call may change it by {limit.most}{unit} at most ({limit.source}). "
        f"Allowed now: {_number(last - most)} to {_number(last + most)}{unit}."
    )


def _cumulative(limit: Limit, value: Fraction, used: Used, tool: str) -> str:
    most, total = exact(limit.most), used.sums.get(limit.sum, Fraction(0))
    lower, higher = used.doubts.get(limit.sum, (Fraction(0), Fraction(0)))
    least, greatest = total - lower, total + higher
    if -most <= least + value and greatest + value <= most:
        return ""
    unit = _unit(limit)
    since = f" since {limit.zero}" if limit.zero else ""
    zero = f"A call of {limit.zero} that goes well sets the sum to zero, and a" if limit.zero else "A"
    doubt = f" Calls failed, so that it may really be {_number(least)} to {_number(greatest)}{unit} now."
    return (
        f"{limit.parameter} {_number(value)}{unit} would bring the sum over all calls{since} to "
        f"{_number(total + value)}{unit}; it may be {limit.most}{unit} at most in either direction ({limit.source})."
        f"{doubt if least < greatest else ''} Allowed now: {_number(-most - least)} to "
        f"{_number(most - greatest)}{unit}. "
        f"{zero} person sets the sum to zero with: octoform limits -reset {tool}"
    )


def _allowed(limit: Limit) -> str:
    low, high = limit.minimum, limit.maximum
    if limit.kind not in ("range", "goal"):
        return ""
    words = (
        f"{low} to {high}"
        if low is not None and high is not None
        else f"{low} or more"
        if high is None
        else f"{high} or less"
    )
    return f". Allowed: {words}{_unit(limit)}"


def _unit(limit: Limit) -> str:
    return f" {limit.unit}" if limit.unit else ""


def _number(value: Fraction) -> str:
    """As a person writes it: integers without a point, others with as many digits as a float has."""
    try:
        return _cut(str(value.numerator) if value.denominator == 1 else repr(float(value)))
    except OverflowError:
        return "a number beyond all bounds"


def _kind(value: Any) -> str:
    kinds = ((dict, "an object"), (list, "an array"), (int, "a number beyond all bounds"), (type(None), "null"))
    return next((words for kind, words in kinds if isinstance(value, kind)), "of another kind")


def _cut(text: str) -> str:
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
