"""Judges what a serial number proves: whether two devices that show the same one are the same device.

Makers leave defaults in place: counts, one symbol again and again, a date, a word. The two errors cost differently. A
default that passes for a number lets an actuator follow it to the wrong twin; a good number that passes for none costs
a refusal, and that only where several equal devices left their ports. So a number must carry enough that no one would
have typed it, and less counts only where equal devices show different ones. Pure: values only.
"""

import re
import unicodedata
from collections.abc import Iterable
from itertools import pairwise

NONE, PATTERN, SHORT, UNIQUE = range(4)
"""No number; a default (another one is another device, the same proves nothing); too short to be rare; rare."""
_LEAST_SYMBOLS = 6
_LEAST_UNFORESEEN = 3
_MAX_STRIDE = 4
_ORDER = "0123456789abcdefghijklmnopqrstuvwxyz"
_WORDS = re.compile(r"[a-z]+|[0-9]+")
# Words in place of a number, or before one.
_PLACEHOLDERS = frozenset(
    (
        *("adapter", "applicable", "asset", "assigned", "available", "be", "board", "bridge", "build", "by", "chassis"),
        *(
            "controller",
            "converter",
            "date",
            "default",
            "demo",
            "dev",
            "device",
            "empty",
            "example",
            "factory",
            "filled",
        ),
        *("fixme", "changeme", "fw", "hw", "id", "invalid", "mfg", "model", "none", "not", "null", "num", "number"),
        *("oem", "product", "prototype", "rev", "revision", "sample", "serial", "sn", "specified", "string", "system"),
        *("tag", "test", "to", "uart", "unique", "unit", "unknown", "unset", "usb", "v", "ver", "version", "xx"),
        *("xxx", "xxxx"),
        *("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov"),
    )
)
_DAY, _MONTH, _AGE = "(?:0[1-9]|[12]\\d|3[01])", "(?:0[1-9]|1[0-2])", "(?:19|20|99)\\d\\d"
_DATE = re.compile(f"{_AGE}{_MONTH}{_DAY}|{_DAY}{_MONTH}{_AGE}|{_MONTH}{_DAY}{_AGE}|{_AGE}w[0-5]\\d")
_YEAR = re.compile(r"(?:19|20)\d\d")
# A vendor and a product, an address on PCI, a port on USB, a version: none is a number of a unit.
_OTHER_FORMS = re.compile(
    r"[0-9a-f]{4}[:_][0-9a-f]{4}|(?:[0-9a-f]{4}:)?[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]|(?:usb)?\d{1,3}-\d{1,3}(?:\.\d{1,3})*"
    r"|v?\d{1,3}(?:\.\d{1,3})+(?:-.*)?"
)
_VERSION = re.compile(r"(?<![0-9a-z])v?\d{1,3}(?:\.\d{1,3})+(?![0-9a-z])")
# Of what a maker calls a chip or a product: letters that are no hexadecimal digits, a number, at most one letter more.
_MODEL = re.compile(r"(?=[a-z]*[g-z])[a-z]{2,4}\d{3,4}[a-z]?")
# What people write where any number would do: words of hexadecimal digits, rows of a keyboard, constants.
_TYPED = re.compile(
    r"deadbeef|badc0ffee0ddf00d|baadf00d|badf00d|c0ffee|c0de|cafebabe|feedface|0d15ea5e|d15ea5e|f00d|beef|cafe|babe|dead"
    r"|qwerty|qwertz|azerty|asdf|zxcv|1q2w3e|31415926|3141592|2718281|8675309|1618033|11235813(?:2134)?|1248163264"
    r"|1qaz(?:2wsx)?|zaq1(?:2wsx)?|789456123|147258369|741852963|159753|0?13579(?:24680?)?|0?2468(?:013579|13579)"
)
_UNNAMED = frozenset(("na", "nil", "tbd", "none", "null", "tobefilled", "tobefilledbyoem", "notapplicable"))
_LEAST_NAME = 4
_LEAST_GROUP = 4
_NOT_SERIAL = re.compile(r"[^0-9a-z]+")


def bare(serial: str) -> str:
    """A number without what tools write differently: letter case, blanks, signs."""
    return _NOT_SERIAL.sub("", _plain(serial))


def same(one: str, other: str) -> bool:
    """Whether two serial numbers are one, as tools spell them: some replace blanks, some change the case."""
    return bool(one and other) and _NOT_SERIAL.sub("_", one.lower()) == _NOT_SERIAL.sub("_", other.lower())


def is_placeholder(serial: str) -> bool:
    """Whether a string is where there is no number at all: zeros, one digit, or words for nothing."""
    number = _number(serial)
    return len(number) < 2 or not number.strip("0") or bare(serial) in _UNNAMED


def weight(serial: str, texts: Iterable[str] = ()) -> int:
    """How well a number identifies, NONE to UNIQUE; ``texts`` are the texts of the device's kind: product, maker."""
    number = _number(serial)
    if not any(map(str.isdecimal, number)) or len(set(number)) < 2 or _names_kind(serial, number, texts):
        return NONE
    # Zeros in front only fill the width.
    filled, number = number, number.lstrip("0")
    if (len(number) >= _LEAST_SYMBOLS and _is_counted(filled)) or _is_worded(filled) or _is_grouped(serial):
        return PATTERN
    unforeseen = _unforeseen(number)
    # One of sixteen hexadecimal numbers begins with a zero that fills nothing.
    whole = number if len(number) >= _LEAST_SYMBOLS or unforeseen < len(number) else filled
    if len(whole) >= _LEAST_SYMBOLS and unforeseen >= _LEAST_UNFORESEEN and not _MODEL.fullmatch(number):
        return UNIQUE
    return SHORT if unforeseen >= 2 and 2 * unforeseen >= len(number) else PATTERN


def is_distinctive(serial: str, others: Iterable[str] = (), texts: Iterable[str] = ()) -> bool:
    """Whether a number is one unit's alone; ``others`` are the numbers of the other units of its kind."""
    others, texts = list(others), list(texts)
    own = weight(serial, texts)
    if any(bare(serial) == bare(other) for other in others):
        return False
    # Two that differ show that the maker numbers the units, where neither looks like a default.
    return own == UNIQUE or (own == SHORT and bool(others) and all(weight(other, texts) >= SHORT for other in others))


def _plain(serial: str) -> str:
    """In small letters, with the digits of any script as ASCII has them."""
    text = unicodedata.normalize("NFKC", serial).lower()
    return "".join(str(unicodedata.decimal(sign)) if sign.isdecimal() else sign for sign in text)


def _names_kind(serial: str, number: str, texts: Iterable[str]) -> bool:
    """Whether it repeats the device's text of its kind, or the first word of that, such as the name of its chip."""
    texts = list(texts)
    first = {bare(word) for text in texts for word in text.split()[:1]}
    kind = {bare(text) for text in texts} | {word for word in first if len(word) >= _LEAST_NAME}
    return not {bare(serial), number}.isdisjoint(kind)


def _number(serial: str) -> str:
    """The number without signs, placeholders and a leading date; a hexadecimal number without its mark."""
    text = re.sub(r"\b0x(?=[0-9a-f])", "", _plain(serial).replace("s/n", "sn")).strip()
    if _OTHER_FORMS.fullmatch(text):
        return ""
    words = _WORDS.findall(_VERSION.sub("", text))
    kept = "".join(word for word in words if word not in _PLACEHOLDERS)
    dated = _DATE.match(kept)
    return _TYPED.sub("", kept[dated.end() :] if dated else kept)


def _is_counted(number: str) -> bool:
    """Whether it is a count in another dress, as makers number samples and people type.

    A few letters before a row or a filled count, a year before a count, letters between digits that both go on, a count
    behind the half of a network address that is the maker's, or the members of one row (2468, 10111213).
    """
    letters, digits = re.sub("[0-9]", "", number), re.sub("[a-z]", "", number)
    if len(letters) >= 2 and _unforeseen(letters) <= 1 and _unforeseen(digits) <= 1:
        return True
    address = re.fullmatch("[0-9a-f]{6}([0-9a-f]{6})", number)
    if address is not None and ("000" in address[1] or _is_row(address[1]) or _steps(address[1]) > 3):
        return True
    fronts = [re.match("[a-z]{1,4}(?=.{4})", number), _YEAR.match(number), re.match("", number)]
    return any(_is_row(number[front.end() :]) for front in fronts if front is not None)


def _is_worded(number: str) -> bool:
    """Whether it is letters and then a row: a word and a count."""
    parts = re.fullmatch("([a-z]+)([0-9]{3,})", number)
    return parts is not None and (_is_row(parts[2]) or _unforeseen(parts[2]) <= 1)


def _is_grouped(serial: str) -> bool:
    """Whether each of its groups goes on from symbol to symbol, as in a UUID that somebody typed."""
    groups = _NOT_SERIAL.split(_plain(serial))
    return len(groups) > 2 and all(len(group) >= _LEAST_GROUP and _unforeseen(group) <= 2 for group in groups)


def _is_row(number: str) -> bool:
    """Whether it is a small number behind zeros, or the members of a row with equal distances."""
    if not number or len(number.lstrip("0")) <= len(number) // 3:
        return True
    counted = sorted(map(_ORDER.index, number.replace("0", "")))
    if 2 * len(counted) <= len(number) and all(b - a == 1 for a, b in pairwise(counted)):
        return True  # each digit once, among zeros: 03000200-0400-0500-0006-000700080009 is on boards of many makers
    values = [_ORDER.index(symbol) for symbol in number]
    if len(values) > 2 and any(len({(b - a) % base for a, b in pairwise(values)}) == 1 for base in (10, 16)):
        return True
    return any(
        _goes_on(number, width, step)
        for width in range(1, len(number) // 3 + 1)
        if number[:width].isdecimal()
        for step in range(1, 12)
    )


def _goes_on(number: str, width: int, step: int) -> bool:
    """Whether it is written as its first ``width`` digits and what follows by adding ``step`` again and again."""
    made, member = "", int(number[:width])
    while len(made) < len(number):
        made, member = made + str(member), member + step
    return made.startswith(number)


def _unforeseen(number: str) -> int:
    """How many symbols do not follow from those before them by repeating, counting up or counting down."""
    if not number:
        return 0
    values = [_ORDER.index(symbol) for symbol in number]
    for stride in range(1, min(_MAX_STRIDE, len(values) - 1) + 1):
        if all(_follows(values[at - stride], values[at]) for at in range(stride, len(values))):
            return min(stride, 2)
    period = next(
        (size for size in range(1, len(number) // 2 + 1) if number == (number * 2)[size : size + len(number)]), 0
    )
    if period:
        return _unforeseen(number[:period]) if period > 1 else 1
    return len(values) - _steps(number)


def _steps(number: str) -> int:
    """How many of its symbols go on from the one before."""
    return sum(_follows(one, other) for one, other in pairwise(map(_ORDER.index, number)))


def _follows(one: int, other: int) -> bool:
    # After 9 people count on with 0 as well as with a.
    return abs(one - other) <= 1 or {one, other} == {0, 9}
