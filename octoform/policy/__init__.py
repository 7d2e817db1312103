"""Limits on calls of tools, from what a manifest or a profile states of them to the verdict on a call.

Here is what all kinds of limits share; `kinds` has one class for each, `resolve` makes the endpoint's policy file of
all sources, `published` reads that file, `enforce` judges and counts calls. Copied beside the server: of octoform it
imports the base and the records alone.

Numbers are compared as they are written: ten times 0.1 is 1, whatever a binary fraction makes of it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from octoform.base import durations
from octoform.base.shape import Fields
from octoform.records import dataclass, field

if TYPE_CHECKING:
    from datetime import datetime
    from fractions import Fraction
    from typing import Protocol

    class Shown(Protocol):
        """What is used of a tool's limits, as `Used.shown` has it."""

        @property
        def sums(self) -> Mapping[str, float]: ...
        @property
        def last(self) -> Mapping[str, float]: ...
        @property
        def calls(self) -> Sequence[float]: ...

    class Moves(Protocol):
        """The units of a tool, as far as limits know them."""

        def goals(self, arguments: Mapping[str, Any]) -> Mapping[str, Any]: ...


_SHOWN = 60
_BITS = 1000


def exact(number: float) -> "Fraction":
    """A finite number as its shortest decimal writing states; an integer is exact as it is, and is compared faster."""
    if isinstance(number, int):
        return int(number)  # type: ignore[return-value]
    from fractions import Fraction  # which the core has no use for

    return Fraction(repr(number))


def is_number(value: Any) -> bool:
    """Whether it is a finite number that can be judged."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return value.bit_length() <= _BITS if isinstance(value, int) else value - value == 0


def cut(text: str) -> str:
    """a string that a caller gave, as far as a message shows it."""
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def written(value: "Fraction") -> str:
    """As a person writes it: integers without a point, others with as many digits as a float has."""
    try:
        return cut(str(value.numerator) if value.denominator == 1 else repr(float(value)))
    except OverflowError:
        return "a number beyond all bounds"


def not_a_number(value: Any) -> str:
    """What a value is that is none."""
    if isinstance(value, str | float | bool):
        return cut(ascii(value))
    kinds = ((dict, "an object"), (list, "an array"), (int, "a number beyond all bounds"), (type(None), "null"))
    return next((words for kind, words in kinds if isinstance(value, kind)), "of another kind")


def in_seconds(value: float) -> str:
    """A time as a person writes it."""
    return f"{value:.1f} s" if value % 1 else f"{value:.0f} s"


def clock_time(minutes: int) -> str:
    """A time of day."""
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


@dataclass(frozen=True, slots=True)
class Form:
    """How the value of a setting is written: a string that ``pattern`` matches, or a number where there is none.

    ``read`` gives what counts of it, None where it is no such value; ``text`` writes that in one word.
    """

    read: Callable[[Any], Any]
    wrong: str
    hint: str
    pattern: str = ""
    is_positive: bool = False
    text: Callable[[Any], str] = repr

    def problem(self, value: Any) -> tuple[str, str] | None:
        """What is wrong with a value as it is written, and what to do; None when it is sound."""
        if self.is_positive and is_number(value) and value <= 0:
            return "is not above 0", "it counts in both directions"
        return (self.wrong, self.hint) if self.read(value) is None else None


def _read_number(value: Any) -> float | None:
    return value if is_number(value) else None


def _read_duration(value: Any) -> float | None:
    seconds = durations.seconds(value) if isinstance(value, str) else None
    return seconds if seconds is not None and 1 <= seconds <= durations.MAX_SECONDS else None


NUMBER = Form(_read_number, "is no number", "write a number, such as -2000 or 0.5")
DISTANCE = Form(
    _read_number, "is no number", "write how far it may go, in both directions, such as 500", is_positive=True
)
RATE = Form(
    lambda value: durations.rate(value) if isinstance(value, str) else None,
    "is no rate",
    "write how many calls in which time, at most 24h: `10/1m`, `1/30s`",
    durations.RATE_PATTERN,
    text=lambda rate: f"{rate[0]}/{rate[1]}s",
)
DURATION = Form(
    _read_duration,
    "is no duration from 1s to 24h",
    durations.HINT,
    durations.PATTERN,
    text=lambda seconds: f"{seconds}s",
)
HOURS = Form(
    lambda value: durations.hours(value) if isinstance(value, str) else None,
    "are no hours of a day",
    "write two different times of 24 hours: `22:00-07:00`",
    durations.HOURS_PATTERN,
    text="-".join,
)


@dataclass(frozen=True, slots=True)
class Setting:
    """A setting of a kind in manifests and profiles. ``about`` describes it to a person who writes one.

    ``first``: it was there with the first limits, and is part of the digest of each manifest with a limit. One that
    came later is so only where it is given, so that the manifests which do not know of it keep their digests.
    """

    name: str
    form: Form
    about: str
    first: bool = False


class Limit:
    """A limit as a source states it: on calls of the tools that the glob ``tool`` matches.

    ``values`` are those of its settings, by name, as they count; those of kinds of values are about ``parameter``.
    With ``units`` a range is of these units of the device alone, whichever tool moves them, and the parameter is the
    place that they are moved to. ``zero`` is the tool whose call brings what is summed up back to where it began.
    """

    __slots__ = ("parameter", "tool", "unit", "units", "values", "zero")

    def __init__(
        self,
        tool: str,
        parameter: str | None = None,
        *,
        units: Iterable[str] = (),
        unit: str = "",
        zero: str = "",
        **values: Any,
    ) -> None:
        self.tool, self.parameter, self.units, self.unit, self.zero = tool, parameter, tuple(units), unit, zero
        self.values = values

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Limit) and all(getattr(self, name) == getattr(other, name) for name in self.__slots__)

    def __hash__(self) -> int:
        return hash((self.tool, self.parameter, self.units, tuple(self.values.items())))

    def __repr__(self) -> str:
        return f"Limit({', '.join(f'{name}={getattr(self, name)!r}' for name in self.__slots__)})"


@dataclass(frozen=True, slots=True)
class Claim:
    """One limit of one source, as it concerns one tool."""

    source: str
    limit: Limit

    def value(self, setting: str) -> Any:
        """The value of a setting; None where the limit has none."""
        return self.limit.values.get(setting)


def tightest(found: Iterable[Claim], setting: str) -> Claim | None:
    """The claim with the tightest value of a number, the first of equal ones; None when no one speaks of it."""
    given = [claim for claim in found if claim.value(setting) is not None]
    sign = -1 if setting == "minimum" else 1
    return min(given, key=lambda claim: sign * claim.value(setting), default=None)


@dataclass(frozen=True, slots=True)
class Used:
    """The counters of one tool: sums and last values by parameter, moments of calls (seconds of the clock, ascending).

    A call that failed may have moved the device or not: by ``doubts`` a sum may really be (lower, higher) than counted.
    ``damaged``: it is not known, because the file could not be read.
    """

    sums: "Mapping[str, Fraction]" = field(default_factory=dict)
    last: "Mapping[str, Fraction]" = field(default_factory=dict)
    calls: tuple[float, ...] = ()
    damaged: bool = False
    doubts: "Mapping[str, tuple[Fraction, Fraction]]" = field(default_factory=dict)
    outside: Mapping[str, str] = field(default_factory=dict)
    """Units that the device reported outside of their range after a call, in words."""

    def shown(self, now: float) -> dict[str, Any]:
        """As plain values; calls as ages in seconds."""
        return {
            "sums": {name: _plain(value) for name, value in self.sums.items()},
            "last": {name: _plain(value) for name, value in self.last.items()},
            "calls": [round(max(0.0, now - moment), 1) for moment in self.calls],
            "damaged": self.damaged,
            **({"outside": dict(self.outside)} if self.outside else {}),
        }


def _plain(value: "Fraction") -> float:
    """A float, or an int for an integer."""
    return value.numerator if value.denominator == 1 else float(value)


class Call:
    """A call that is judged: ``clock`` only goes forward, ``time`` gives the local time of day."""

    __slots__ = ("arguments", "clock", "time", "tool", "units", "used")

    def __init__(
        self,
        tool: str,
        arguments: Mapping[str, Any],
        used: Used,
        units: "Moves | None",
        now: "tuple[Callable[[], float], Callable[[], datetime]]",
    ) -> None:
        self.tool, self.arguments, self.used, self.units = tool, arguments, used, units
        self.clock, self.time = now


class Kept:
    """Sums and last values that are being brought up to date."""

    __slots__ = ("last", "sums")

    def __init__(self, used: Used) -> None:
        self.sums, self.last = dict(used.sums), dict(used.last)


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a call is not let through: ``code`` for a program, ``text`` for anyone who called and for a person.

    Codes are the kinds of limits, and no_number, unknown_tool, counters_damaged, counters_unwritable, reported.
    """

    code: str
    text: str


@dataclass(frozen=True, slots=True)
class Kind:
    """One limit of a tool as the endpoint's policy file has it, and its kind: a limit on calls, whatever they give.

    ``source`` is who set it. Where ``seconds`` is above 0, the calls of that time are remembered, the last ``calls`` of
    them, at least one. A subclass has the name of its kind, its settings, and ``is_counted`` where its verdict depends
    on the calls before. ``is_of_value``: it is about the value of a parameter, which its settings need.
    """

    name: ClassVar[str] = ""
    settings: ClassVar[tuple[Setting, ...]] = ()
    is_of_value: ClassVar[bool] = False
    is_counted: ClassVar[bool] = False
    source: str
    parameter: str = ""
    seconds: float = 0.0
    calls: int = 0
    sum: str = ""
    """The name under which values are added up, where they are."""
    zero: str = ""
    """The tool after whose call such a sum begins again at zero."""

    @classmethod
    def resolve(cls, found: Sequence[Claim], more: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """The entries of the policy file for what all sources state of a tool, or of one parameter of it.

        ``more`` is what the entries of that parameter have beside their bounds.
        """
        given = [claim for claim in found if any(claim.value(setting.name) is not None for setting in cls.settings)]
        for claim in cls.chosen(given):
            yield {"kind": cls.name, **more, **cls.entry(claim), **cls.unit_of([claim, *found]), "source": claim.source}

    @classmethod
    def chosen(cls, found: Sequence[Claim]) -> Iterable[Claim]:
        """The claims that hold of those that have a setting of this kind: the one with the lowest number."""
        claim = tightest(found, cls.settings[0].name)
        return () if claim is None else (claim,)

    @classmethod
    def entry(cls, claim: Claim) -> dict[str, Any]:
        """What an entry of the policy file has of a claim."""
        raise NotImplementedError

    @classmethod
    def unit_of(cls, found: Iterable[Claim]) -> dict[str, str]:
        """The unit of an entry's numbers, as the first of the claims that states one has it."""
        unit = next((claim.limit.unit for claim in found if cls.is_of_value and claim.limit.unit), "")
        return {"unit": unit} if unit else {}

    @classmethod
    def read(cls, fields: Fields) -> Self:
        """An entry of the policy file; ValueError where it has anything that is not foreseen."""
        raise NotImplementedError

    def refusal(self, call: Call) -> Refusal | None:
        """Why a call is refused; None where this limit lets it pass."""
        text = self.objection(call)
        return Refusal(self.name, text) if text else None

    def objection(self, call: Call) -> str:
        """The same in words for the caller, empty where it passes."""
        raise NotImplementedError

    def count(self, call: Call, kept: Kept) -> None:
        """Add a call to the sums and last values that are kept from then on."""

    def describe(self) -> str:
        """The limit for a person."""
        raise NotImplementedError

    def spent(self, used: "Shown") -> str:  # noqa: ARG002
        """What is used of it, for a person; empty where nothing is."""
        return ""

    @classmethod
    def advice(cls, item: Mapping[str, Any]) -> str:
        """The limit for an agent, of a profile's item as it is written there."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class OfValue(Kind):
    """A limit on the value of a parameter. An absent one counts as ``default``; None: its call is not judged."""

    is_of_value = True
    unit: str = ""
    default: float | None = None

    @classmethod
    def common(cls, fields: Fields) -> dict[str, Any]:
        """What the entries of all these kinds have."""
        named = {"source": fields.text("source"), "parameter": fields.text("parameter")}
        return {**named, "unit": fields.string("unit"), "default": fields.number("default")}

    def with_unit(self, number: object) -> str:
        """A number as it is written, with its unit."""
        return f"{number} {self.unit}" if self.unit else f"{number}"

    def exactly(self, value: "Fraction") -> str:
        """A value with its unit."""
        return self.with_unit(written(value))

    def value(self, arguments: Mapping[str, Any]) -> "Fraction | None":
        """The parameter's value as it is written; its default where it is absent; None where neither is known."""
        if self.parameter in arguments:
            return exact(arguments[self.parameter])
        return None if self.default is None else exact(self.default)

    def refusal(self, call: Call) -> Refusal | None:
        """Why a call is refused; what is no number never passes."""
        name, arguments = self.parameter, call.arguments
        if name in arguments and not is_number(arguments[name]):
            only = f"its limit ({self.source}) takes only one{self.allowed()}"
            return Refusal(
                "no_number", f"{name} is {not_a_number(arguments[name])}, which is no finite number; {only}."
            )
        value = self.value(arguments)
        text = "" if value is None else self.objection_to(value, call)
        return Refusal(self.name, text) if text else None

    def objection_to(self, value: "Fraction", call: Call) -> str:
        """Why a call with this value is refused, in words for the caller; empty where it passes."""
        raise NotImplementedError

    def allowed(self) -> str:
        """What would pass, as the end of a sentence, where that is always the same."""
        return ""
