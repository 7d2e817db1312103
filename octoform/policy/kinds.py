"""The kinds of limits, one class for each: all that octoform knows of a kind is in its class.

That is the settings that a manifest or a profile gives it, which of several sources is the tightest, its entry in the
endpoint's policy file, when it refuses a call and why, what of a call counts from then on, and how it is described.
Manifest, profiles, plan, endpoint, server and views go through `KINDS`, so a new kind is a new class here.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from octoform.base.shape import Fields
from octoform.policy import (
    DISTANCE,
    DURATION,
    HOURS,
    NUMBER,
    RATE,
    Call,
    Claim,
    Kept,
    Kind,
    Limit,
    OfValue,
    Refusal,
    Setting,
    exact,
    is_number,
    tightest,
    written,
)
from octoform.policy import clock_time as at
from octoform.policy import in_seconds as lasting
from octoform.records import dataclass

if TYPE_CHECKING:
    from fractions import Fraction

    from octoform.policy import Shown


@dataclass(frozen=True, slots=True)
class Range(OfValue):
    """The value lies between two ends, of which one may be open."""

    name = "range"
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting("minimum", NUMBER, "The lowest value of the parameter.", first=True),
        Setting("maximum", NUMBER, "The highest value of the parameter.", first=True),
    )
    minimum: float | None = None
    maximum: float | None = None

    @classmethod
    def resolve(cls, found: Sequence[Claim], more: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """The tighter source for each end by itself."""
        ends = {name: claim for name in ("minimum", "maximum") if (claim := tightest(found, name)) is not None}
        values = {name: claim.value(name) for name, claim in ends.items()}
        sources = [claim.source for claim in ends.values()]
        source = sources[0] if len(set(sources)) == 1 else " (minimum), ".join(sources) + " (maximum)"
        if ends:
            yield {"kind": cls.name, **more, **values, **cls.unit_of([*ends.values(), *found]), "source": source}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        return cls(**cls.common(fields), **cls.ends(fields))

    @staticmethod
    def ends(fields: Fields) -> dict[str, Any]:
        """The two ends of an entry, at least one of them a number."""
        ends = {name: fields.number(name) for name in ("minimum", "maximum")}
        if all(end is None for end in ends.values()):
            raise ValueError(f"{fields.place}: a range needs minimum or maximum")
        return ends

    def objection_to(self, value: "Fraction", _: Call) -> str:
        """Why a value is refused; of the default, what that means for calls without the parameter."""
        text = self.beyond(self.parameter, value)
        if text and self.default is not None and value == exact(self.default):
            name, default = self.parameter, self.with_unit(self.default)
            text += f" {default} is its default: a call that does not give {name} is refused too."
        return text

    def beyond(self, what: str, value: "Fraction") -> str:
        """How a value is outside; empty when it is not."""
        low, high = self.minimum, self.maximum
        if low is not None and value < exact(low):
            side, bound = "below the least", low
        elif high is not None and value > exact(high):
            side, bound = "above the most", high
        else:
            return ""
        found = f"{what} {self.exactly(value)} is {side} that is allowed, {self.with_unit(bound)}"
        return f"{found} ({self.source}){self.allowed()}."

    def allowed(self) -> str:
        low, high = self.minimum, self.maximum
        words = f"{low} or more" if high is None else f"{high} or less" if low is None else f"{low} to {high}"
        return f". Allowed: {self.with_unit(words)}"

    def describe(self) -> str:
        low, high = self.minimum, self.maximum
        ends = f"at most {high}" if low is None else f"at least {low}" if high is None else f"{low} to {high}"
        return f"{self.parameter}: {self.with_unit(ends)}"

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        words = {"minimum": "at least", "maximum": "at most"}
        return " and ".join(f"{word} {item[name]}" for name, word in words.items() if name in item) + _unit(item)


@dataclass(frozen=True, slots=True)
class Goal(Range):
    """The range of the place of a unit of the device (a joint, an axis), whatever tool and parameter moves it there.

    No source states it: it is made of the ranges of all tools. ``of`` is the unit of the device.
    """

    name = "goal"
    settings = ()
    of: str = ""

    @classmethod
    def read(cls, fields: Fields) -> Self:
        of, source = fields.text("of"), fields.text("source")
        return cls(source, unit=fields.string("unit"), of=of, **cls.ends(fields))

    def refusal(self, call: Call) -> Refusal | None:
        """Why a call is refused that moves the unit; one that does not declare where to is."""
        goals = {} if call.units is None else call.units.goals(call.arguments)
        if self.of not in goals:
            return None
        goal, what = goals[self.of], f"the goal of {self.of} in {call.tool},"
        if is_number(goal):
            text = self.beyond(what, exact(goal))
        else:
            limited = f"whose range is limited ({self.source}){self.allowed()}"
            text = f"{call.tool} does not declare in advance where it moves {self.of}, {limited}. "
            text += "Use a tool that is given the goal."
        return Refusal(self.name, text) if text else None

    def outside(self, place: float, within: float) -> str:
        """How a reported place is outside, beyond what a device may be off; empty when it is not."""
        value, margin = exact(place), exact(within)
        low = None if self.minimum is None else exact(self.minimum) - margin
        high = None if self.maximum is None else exact(self.maximum) + margin
        if (low is None or value >= low) and (high is None or value <= high):
            return ""
        return f"at {self.exactly(value)}, outside of its range ({self.source}){self.allowed()}"

    def describe(self) -> str:
        return f"the goal of {self.of}{Range.describe(self)}"


@dataclass(frozen=True, slots=True)
class Step(OfValue):
    """The value differs by ``most`` at most from that of the last call that was let through; the first call passes."""

    name = "step"
    settings = (
        Setting("step", DISTANCE, "The most that the value may differ from that of the call before.", first=True),
    )
    is_counted = True
    most: float = 0.0

    @classmethod
    def entry(cls, claim: Claim) -> dict[str, Any]:
        return {"most": claim.value("step")}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        return cls(**cls.common(fields), most=fields.not_negative("most"))

    def objection_to(self, value: "Fraction", call: Call) -> str:
        most, last, named = exact(self.most), call.used.last.get(self.parameter), self.exactly
        if last is None or abs(value - last) <= most:
            return ""
        return (
            f"{self.parameter} {named(value)} is {named(abs(value - last))} away from the last one, "
            f"{named(last)}; one call may change it by {self.with_unit(self.most)} at most ({self.source}). "
            f"Allowed now: {written(last - most)} to {named(last + most)}."
        )

    def count(self, call: Call, kept: Kept) -> None:
        if (value := self.value(call.arguments)) is not None:
            kept.last[self.parameter] = value

    def describe(self) -> str:
        return f"{self.parameter}: changed by {self.with_unit(self.most)} at most"

    def spent(self, used: "Shown") -> str:
        last = used.last.get(self.parameter)
        return "" if last is None else f"the last one was {self.with_unit(last)}"

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        return f"from call to call no further than {item['step']}{_unit(item)}"


@dataclass(frozen=True, slots=True)
class Cumulative(Step):
    """The sum of all values is within ``most`` in both directions, since the last call of ``zero`` that went well."""

    name = "cumulative"
    settings = (
        Setting(
            "cumulative",
            DISTANCE,
            "The most that all values may come to, positive and negative ones added up.",
            first=True,
        ),
    )

    @classmethod
    def chosen(cls, found: Sequence[Claim]) -> Iterable[Claim]:
        """Sums that begin again at different moments are different sums, and each has its own tightest limit."""
        for zero in dict.fromkeys(claim.limit.zero for claim in found):
            claim = tightest((claim for claim in found if claim.limit.zero == zero), "cumulative")
            if claim is not None:
                yield claim

    @classmethod
    def entry(cls, claim: Claim) -> dict[str, Any]:
        zero = claim.limit.zero
        return {"most": claim.value("cumulative"), **({"zero": zero} if zero else {})}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        common, zero = cls.common(fields), fields.string("zero")
        name = f"{common['parameter']} since {zero}" if zero else common["parameter"]
        return cls(**common, most=fields.not_negative("most"), zero=zero, sum=name)

    def objection_to(self, value: "Fraction", call: Call) -> str:
        """Why a value is refused: with and without the calls that failed, the sum has to stay within its limit."""
        used, most, named = call.used, exact(self.most), self.exactly
        total = used.sums.get(self.sum, exact(0))
        lower, higher = used.doubts.get(self.sum, (exact(0), exact(0)))
        least, greatest = total - lower, total + higher
        if -most <= least + value and greatest + value <= most:
            return ""
        since = f" since {self.zero}" if self.zero else ""
        zero = f"A call of {self.zero} that goes well sets the sum to zero, and a" if self.zero else "A"
        doubt = f" Calls failed, so that it may really be {written(least)} to {named(greatest)} now."
        return (
            f"{self.parameter} {named(value)} would bring the sum over all calls{since} to {named(total + value)}; "
            f"it may be {self.with_unit(self.most)} at most in either direction ({self.source})."
            f"{doubt if least < greatest else ''} Allowed now: {written(-most - least)} to {named(most - greatest)}. "
            f"{zero} person sets the sum to zero with: octoform limits -reset {call.tool}"
        )

    def count(self, call: Call, kept: Kept) -> None:
        if (value := self.value(call.arguments)) is not None:
            kept.sums[self.sum] = call.used.sums.get(self.sum, 0) + value

    def describe(self) -> str:
        since = f" since {self.zero}" if self.zero else ""
        return f"{self.parameter}: sum of all calls{since} {self.with_unit(self.most)} at most"

    def spent(self, used: "Shown") -> str:
        return f"it is {self.with_unit(used.sums.get(self.sum, 0))}"

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        since = f" since the last {item['zero']}" if "zero" in item else ""
        return f"all values{since} added up within {item['cumulative']}{_unit(item)} in both directions"


@dataclass(frozen=True, slots=True)
class Rate(Kind):
    """At most ``calls`` calls in ``seconds``, in a window that slides."""

    name = "rate"
    settings = (Setting("rate", RATE, "The most calls in a time: 10/1m.", first=True),)
    is_counted = True

    @classmethod
    def chosen(cls, found: Sequence[Claim]) -> Iterable[Claim]:
        """Rates of several times hold side by side, save those that another one is tighter than in both numbers."""
        rates = _distinct(found, "rate")
        for (calls, seconds), claim in rates.items():
            if not any(other[0] <= calls and other[1] >= seconds for other in rates if other != (calls, seconds)):
                yield claim

    @classmethod
    def entry(cls, claim: Claim) -> dict[str, Any]:
        calls, seconds = claim.value("rate")
        return {"calls": calls, "seconds": float(seconds)}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        return cls(fields.text("source"), calls=fields.whole("calls"), seconds=fields.positive("seconds"))

    def objection(self, call: Call) -> str:
        now = call.clock()
        recent = [moment for moment in call.used.calls if now - moment < self.seconds]
        if len(recent) < self.calls:
            return ""
        wait = self.seconds - (now - recent[-self.calls])
        return (
            f"{call.tool} was called {len(recent)} times in the last {lasting(self.seconds)}; {self.calls} are allowed "
            f"({self.source}). The next call is allowed in {lasting(wait)}."
        )

    def describe(self) -> str:
        return f"{self.calls} calls in {self.seconds:g} s"

    def spent(self, used: "Shown") -> str:
        return f"{sum(1 for age in used.calls if age < self.seconds)} used"

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        count, _, time = item["rate"].partition("/")
        return f"at most {count} call{'' if count == '1' else 's'} in {time}"


@dataclass(frozen=True, slots=True)
class Cooldown(Kind):
    """At least ``seconds`` between two calls."""

    name = "cooldown"
    settings = (Setting("cooldown", DURATION, "The least time between two calls.", first=True),)
    is_counted = True

    @classmethod
    def chosen(cls, found: Sequence[Claim]) -> Iterable[Claim]:
        return [max(found, key=lambda claim: float(claim.value("cooldown")))] if found else ()

    @classmethod
    def entry(cls, claim: Claim) -> dict[str, Any]:
        return {"seconds": float(claim.value("cooldown"))}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        return cls(fields.text("source"), seconds=fields.positive("seconds"))

    def objection(self, call: Call) -> str:
        calls = call.used.calls
        gone = call.clock() - calls[-1] if calls else self.seconds
        if gone >= self.seconds:
            return ""
        return (
            f"{call.tool} was called {lasting(gone)} ago; {lasting(self.seconds)} have to lie between two calls "
            f"({self.source}). The next call is allowed in {lasting(self.seconds - gone)}."
        )

    def describe(self) -> str:
        return f"{self.seconds:g} s between two calls"

    def spent(self, used: "Shown") -> str:
        wait = self.seconds - min(used.calls, default=self.seconds)
        return f"the next in {wait:.1f} s" if wait > 0 else ""

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        return f"at least {item['cooldown']} between two calls"


@dataclass(frozen=True, slots=True)
class QuietHours(Kind):
    """No call from ``begin`` to ``end``: minutes after midnight, local time; equal ones are the whole day."""

    name = "quiet_hours"
    settings = (
        Setting("quiet_hours", HOURS, "When no call passes, in the host's local time: 22:00-07:00.", first=True),
    )
    begin: int = 0
    end: int = 0

    @classmethod
    def chosen(cls, found: Sequence[Claim]) -> Iterable[Claim]:
        return _distinct(found, "quiet_hours").values()

    @classmethod
    def entry(cls, claim: Claim) -> dict[str, Any]:
        begin, end = claim.value("quiet_hours")
        return {"from": begin, "to": end}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        return cls(fields.text("source"), begin=fields.time_of_day("from"), end=fields.time_of_day("to"))

    def objection(self, call: Call) -> str:
        now = call.time()
        minute, begin, end = now.hour * 60 + now.minute, self.begin, self.end
        if not (begin <= minute < end if begin < end else minute >= begin or minute < end):
            return ""
        if begin == end:
            return f"{call.tool} has quiet hours all day ({self.source})."
        return (
            f"{call.tool} has quiet hours from {at(begin)} to {at(end)} ({self.source}), and it is {at(minute)} on "
            f"this host. It is allowed from {at(end)} on."
        )

    def describe(self) -> str:
        return f"not from {at(self.begin)} to {at(self.end)}"

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        return f"no calls from {item['quiet_hours'].replace('-', ' to ')}"


def _unit(item: Mapping[str, Any]) -> str:
    """The unit of a profile's limit, as it follows a number."""
    return f" {item['unit']}" if "unit" in item else ""


def _distinct(found: Sequence[Claim], setting: str) -> Mapping[Any, Claim]:
    """The first claim with each value of a setting."""
    first: dict[Any, Claim] = {}
    for claim in found:
        first.setdefault(claim.value(setting), claim)
    return first


KINDS: Mapping[str, type[Kind]] = {
    kind.name: kind for kind in (Range, Step, Cumulative, Rate, Cooldown, QuietHours, Goal)
}
"""Every kind by its name in the policy file, in the order in which messages list their settings."""
STATED = tuple(kind for kind in KINDS.values() if kind.settings)
"""Those that a source states, and that are not made of others."""
SETTINGS = {setting.name: setting for kind in STATED for setting in kind.settings}
BOUNDS = tuple(setting.name for kind in STATED if kind.is_of_value for setting in kind.settings)
"""The settings for the value of a parameter."""
PACES = tuple(name for name in SETTINGS if name not in BOUNDS)
"""The settings for calls, whatever their arguments."""
RANGE = tuple(setting.name for setting in Range.settings)


def entry(value: Any, place: str) -> Kind:
    """An entry of the policy file; ValueError names what is wrong with it."""
    fields = Fields(value, place)
    return KINDS[fields.one_of("kind", tuple(KINDS))].read(fields)


def values(item: Mapping[str, Any]) -> dict[str, Any]:
    """What counts of the settings of a limit as it is written, by name."""
    return {name: found.form.read(item[name]) for name, found in SETTINGS.items() if item.get(name) is not None}


def one_line(limit: Limit) -> str:
    """A limit of a manifest in its own words."""
    of = f"{limit.tool} {limit.parameter}" if limit.parameter is not None else limit.tool
    return f"{of}: {', '.join(f'{name} {SETTINGS[name].form.text(value)}' for name, value in limit.values.items())}"


def describe(item: Mapping[str, Any]) -> Iterator[str]:
    """A limit of a profile in words, one text for what an agent has to carry and one for what octoform keeps itself.

    A range is in the tools that INTERFACE makes, so that a client sees it. All other limits concern calls that came
    before; the endpoint keeps them, outside the generated server.
    """
    whose = f" of {item['tool']}" if "tool" in item else ""
    if any(name in item for name in RANGE):
        yield f"{item['parameter']}{whose} {Range.advice(item)}"
    others = [kind for kind in STATED if kind is not Range and any(each.name in item for each in kind.settings)]
    if others:
        lead = f"{item['parameter']}{whose}" if "parameter" in item else item["tool"]
        yield f"{lead}: {', '.join(kind.advice(item) for kind in others)}; the endpoint itself sees to it"
