"""Values that a tool of a generated server is computed with, and what Python makes of the plain ones, within bounds.

A value is plain (a number, a string, a list, a table of them), something of the runtime's (a device, a place below its
folder, an open attribute), or unknown. No operation on plain values takes long, whatever the server asks for.
"""

import ast
import math
import operator
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from octoform.patterns import regex

_MAX_LENGTH, _MAX_NUMBER, _MAX_DIGITS = 1000, 1 << 64, 20


class Unsure(Exception):
    """The tool has no outcome that can be computed."""


class Failed(Exception):
    """The call ends with an error."""


class Spent(Exception):
    """The budget of all evaluations is used up."""


Key = tuple[str, ...]
"""The device, the class and the names below its folder of one attribute."""


class Unknown:
    """The value of what cannot be computed."""

    def __repr__(self) -> str:
        return "unknown"


UNKNOWN = Unknown()


@dataclass(frozen=True)
class Place:
    """A folder or a file of the kernel's attributes."""

    key: Key


@dataclass(frozen=True)
class DeviceOfRuntime:
    """What `runtime.device` gives."""

    name: str


@dataclass(frozen=True)
class OpenFile:
    """An attribute that was opened."""

    place: Place


@dataclass(frozen=True)
class Method:
    """A method of a value, not called yet."""

    owner: Any
    name: str


CLASS, OF = "\0class", "\0of"
"""The member of an object that names its class, and the name of the class that a running method is of."""


@dataclass(frozen=True, eq=False)
class Inner:
    """A lambda or a function of the file, with the names around it."""

    node: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda
    scope: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Later:
    """A call that a thread makes, and what it gave."""

    called: Any
    given: Sequence[Any] = ()
    named: Mapping[str, Any] = field(default_factory=dict)
    result: Any = UNKNOWN


@dataclass(frozen=True)
class Pool:
    """What makes calls in threads."""


_UNKNOWNS = (Unknown, Method, Inner, Later, Pool)


def is_unknown(value: Any) -> bool:
    """Whether a value is none that anything can be computed with."""
    return isinstance(value, _UNKNOWNS)


def is_known(value: Any) -> bool:
    """Whether a value is there and can be computed with: neither unknown nor None."""
    return not is_unknown(value) and value is not None


@dataclass
class World:
    """The attributes of all devices: what was written, and what is in those that no tool wrote.

    ``left`` is how many expressions may still be evaluated, for all worlds of a file together.
    """

    usual: Callable[[str], float]
    left: list[int]
    stored: dict[Key, str] = field(default_factory=dict)
    read: dict[Key, None] = field(default_factory=dict)
    written: dict[Key, ast.Call] = field(default_factory=dict)
    ran: list[tuple[ast.Call, list[str]]] = field(default_factory=list)
    """The programs that were started, each with the words that are known; what they did is not."""
    met: dict[Key, Any] = field(default_factory=dict)
    """What was read that no call of this world wrote before, in the order in which it was read; unknown texts too."""

    def text(self, place: Place) -> Any:
        """The text of one attribute; unknown where it is no number."""
        key = place.key
        found = self.peek(key)
        if found is not UNKNOWN:
            self.read[key] = None
        if key not in self.written:
            self.met[key] = found
        return found

    def peek(self, key: Key) -> Any:
        """The text of one attribute, which does not count as read by that."""
        if key in self.stored:
            return self.stored[key]
        return UNKNOWN if len(key) < 3 or _is_text(key[-1]) else f"{self.usual(key[-1]):g}"


_TEXTS = regex(
    r"name|label|trigger|type|status|state|model|uevent|mode|direction|fault|alarm|vendor|available|modalias|governor"
    r"|\Adev\Z|health|technology|scope|online|present|manufacturer|power_supply|enable"
)


@lru_cache(maxsize=1024)
def _is_text(name: str) -> bool:
    return _TEXTS.search(name) is not None


PLAIN: Mapping[str, Callable[..., Any]] = {
    **{item.__name__: item for item in (int, float, str, bool, round, abs, min, max, len, sum, sorted, list)},
    **{item.__name__: item for item in (tuple, dict, set, range, enumerate, zip, any, all, divmod, reversed)},
    **{
        f"math.{name}": getattr(math, name) for name in ("floor", "ceil", "sqrt", "log", "log10", "exp", "trunc", "pow")
    },
    **{f"statistics.{name}": getattr(statistics, name) for name in ("mean", "fmean", "median")},
    **{f"math.{name}": getattr(math, name) for name in ("isclose", "isfinite", "isnan", "log2", "fabs", "copysign")},
}
METHODS = frozenset(
    {"strip", "lstrip", "rstrip", "split", "splitlines", "encode", "decode", "format", "join", "replace", "startswith"}
    | {"endswith", "lower", "upper", "casefold", "get", "items", "keys", "values", "append", "zfill", "ljust", "rjust"}
    | {"is_integer", "removesuffix", "removeprefix", "isdigit", "partition", "rpartition", "copy", "index", "count"}
    | {"update", "extend", "setdefault", "insert", "find"}
)
BINARY: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv},
    **{ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow, ast.BitAnd: operator.and_},
    **{ast.BitOr: operator.or_, ast.BitXor: operator.xor, ast.LShift: operator.lshift, ast.RShift: operator.rshift},
    **{ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq},
    **{ast.NotEq: operator.ne, ast.Is: operator.is_, ast.IsNot: operator.is_not},
}
UNARY: Mapping[type[ast.AST], Callable[[Any], Any]] = {
    **{ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: operator.not_, ast.Invert: operator.invert},
}


def plainly(function: Callable[..., Any], /, *given: Any, **named: Any) -> Any:
    """What Python makes of plain values; an error of it ends the call, and so does what would take long."""
    if not _is_small(function, (*given, *named.values()) if named else given):
        raise Unsure
    try:
        value = function(*given, **named)
    except Exception as problem:
        raise Failed from problem
    if value is None or isinstance(value, float):
        return value
    if isinstance(value, int):
        large = abs(value) > _MAX_NUMBER
    else:
        if not isinstance(value, _SIZED) and (hasattr(value, "__next__") or type(value).__name__.startswith("dict_")):
            value = list(value)
        large = isinstance(value, _SIZED) and len(value) > _MAX_LENGTH
    if large:
        raise Unsure
    return value


_SIZED = (str, bytes, list, tuple, dict, set)
_SCALARS = (int, float, str, bytes, range)
_GROUPS = (list, tuple, set, dict)


def is_plain(value: Any) -> bool:
    """Whether a value is Python's own, with nothing unknown in it, and not large."""
    if value is None or isinstance(value, _SCALARS):
        return True
    waiting, seen = [value], 0
    while waiting:
        item, seen = waiting.pop(), seen + 1
        if isinstance(item, _GROUPS):
            waiting += item.values() if isinstance(item, dict) else item
        elif item is not None and not isinstance(item, _SCALARS):
            return False
        if seen > 2 * _MAX_LENGTH or len(waiting) > 2 * _MAX_LENGTH:
            return False
    return True


_WIDE = regex(r"\d{3,}|\*")


def _is_small(function: Callable[..., Any], given: Sequence[Any]) -> bool:
    """Whether an operation on plain values ends at once: nothing is repeated, raised or padded without end."""
    name = getattr(function, "__name__", "")
    if function not in _UNBOUNDED and name not in _UNBOUNDED_METHODS:
        return True
    numbers = [item for item in given if isinstance(item, (int, float))]
    texts = [item for item in given if isinstance(item, (str, bytes))]
    if function in (operator.pow, operator.lshift, round):
        return all(abs(item) <= _MAX_DIGITS for item in numbers[1:]) and not texts
    if function is operator.mul:
        return len(numbers) == len(given)
    if function is operator.mod or name == "format":
        owner = getattr(function, "__self__", None)
        forms = [owner] if isinstance(owner, str) else texts[:1] if function is operator.mod else texts[-1:]
        return not any(_WIDE.search(item if isinstance(item, str) else item.decode("latin-1")) for item in forms)
    return all(abs(item) <= _MAX_LENGTH for item in numbers)


_UNBOUNDED = frozenset({operator.pow, operator.lshift, operator.mul, operator.mod, round, range})
_UNBOUNDED_METHODS = frozenset({"format", "zfill", "ljust", "rjust"})
"""The operations whose result may be far larger than what they are given."""
