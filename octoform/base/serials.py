"""Judges what a serial number proves: whether two devices that show the same one are the same device.

Makers leave defaults in place: counts, one symbol again and again, a date, a word. The two errors cost differently. A
default that passes for a number lets an actuator follow it to the wrong twin; a good number that passes for none costs
a refusal, and that only where several equal devices left their ports. So a number must carry enough that nobody would
have typed it, and less counts only where equal devices show different ones. Pure: values only.
"""

import re
from collections.abc import Iterable
from itertools import pairwise

NONE, PATTERN, SHORT, UNIQUE = range(4)
"""No number; a default (another one is another device, the same proves nothing); too short to be rare; rare."""
_LEAST_SYMBOLS = 6
_LEAST_UNFORESEEN = 3
_LONGEST_STRIDE = 4
_ORDER = "0123456789abcdefghijklmnopqrstuvwxyz"
_WORDS = re.compile(r"[a-z]+|\d+")
# Words that stand in for a number, or before one.
_PLACEHOLDERS = frozenset(
    (
        *("applicable", "asset", "assigned", "available", "be", "board", "by", "chassis", "default", "dev", "device"),
        *("empty", "example", "filled", "hw", "id", "invalid", "none", "not", "null", "num", "number"),
        *("oem", "product", "rev", "revision", "sample", "serial", "sn", "specified", "string", "system", "tag"),
        *("test", "to", "unique", "unit", "unknown", "unset", "usb", "v", "ver", "version", "xx"),
        *("xxx", "xxxx"),
    )
)
_DATE = re.compile(r"(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])")
_NOT_SERIAL = re.compile(r"[^0-9a-z]+")


def bare(serial: str) -> str:
    """A number without what tools write differently: letter case, blanks, signs."""
    return _NOT_SERIAL.sub("", serial.lower())


def same(one: str, other: str) -> bool:
    """Whether two serial numbers are one, as tools spell them: some replace blanks, some change the case."""
    return bool(one and other) and _NOT_SERIAL.sub("_", one.lower()) == _NOT_SERIAL.sub("_", other.lower())


def is_placeholder(serial: str) -> bool:
    """Whether a text stands where there is no number at all: zeros, one digit, or words for nothing."""
    number = _number(serial)
    return len(number) < 2 or not number.strip("0")


def weight(serial: str, said: Iterable[str] = ()) -> int:
    """How much a number says, NONE to UNIQUE; ``said`` is what the device says of its kind: product, maker, ids."""
    number = _number(serial)
    kind = {bare(text) for text in said}
    if not any(map(str.isdecimal, number)) or len(set(number)) < 2 or {bare(serial), number} & kind:
        return NONE
    # Zeros in front only fill the width.
    number = number.lstrip("0")
    unforeseen = _unforeseen(number)
    if len(number) >= _LEAST_SYMBOLS and unforeseen >= _LEAST_UNFORESEEN:
        return UNIQUE
    return SHORT if unforeseen >= 2 and 2 * unforeseen >= len(number) else PATTERN


def tells_apart(serial: str, others: Iterable[str] = (), said: Iterable[str] = ()) -> bool:
    """Whether a number is one unit's alone; ``others`` are the numbers of the other units of its kind."""
    others = list(others)
    own = weight(serial, said)
    if any(bare(serial) == bare(other) for other in others):
        return False
    # Two that differ show that the maker numbers the units, where neither looks like a default.
    return own == UNIQUE or (own == SHORT and bool(others) and all(weight(other) >= SHORT for other in others))


def _number(serial: str) -> str:
    """What is left without signs, placeholders and a date in front; a hexadecimal number without its mark."""
    text = re.sub(r"\b0x(?=[0-9a-f])", "", serial.lower().replace("s/n", "sn"))
    kept = "".join(word for word in _WORDS.findall(text) if word not in _PLACEHOLDERS)
    dated = _DATE.match(bare(kept))
    return kept[dated.end() :] if dated else kept


def _unforeseen(number: str) -> int:
    """How many symbols do not follow from those before them by repeating, counting up or counting down."""
    if not number:
        return 0
    values = [_ORDER.index(symbol) for symbol in number]
    for stride in range(1, min(_LONGEST_STRIDE, len(values) - 1) + 1):
        if all(_follows(values[at - stride], values[at]) for at in range(stride, len(values))):
            return min(stride, 2)
    period = next(
        (size for size in range(1, len(number) // 2 + 1) if number == (number * 2)[size : size + len(number)]), 0
    )
    if period:
        return _unforeseen(number[:period]) if period > 1 else 1
    return 1 + sum(not _follows(one, other) for one, other in pairwise(values))


def _follows(one: int, other: int) -> bool:
    # After 9 people count on with 0 as well as with a.
    return abs(one - other) <= 1 or {one, other} == {0, 9}
