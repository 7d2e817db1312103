"""Measurable quantities: bounds by unit, and how units are written in names and descriptions.

The bounds are those of physics and of what anybody attaches to a computer, so wide that only a wrong scale, a wrong
unit or a sensor that is not connected is beyond them. The runtime of a server and the check of an endpoint share them.
"""

import re
from typing import Any

BOUNDS: dict[str, tuple[float, float]] = {
    "degC": (-273.15, 3000.0),
    "degF": (-459.67, 5500.0),
    "K": (0.0, 3300.0),
    "%": (-100.0, 1000.0),
    "rpm": (-500_000.0, 500_000.0),
    "V": (-5000.0, 5000.0),
    "A": (-5000.0, 5000.0),
    "W": (-1e6, 1e6),
    "lux": (0.0, 300_000.0),
    "kPa": (0.0, 1e6),
    "hPa": (0.0, 1e7),
    "m/s^2": (-20_000.0, 20_000.0),
    "rad/s": (-20_000.0, 20_000.0),
    "dBm": (-300.0, 100.0),
}


def is_possible(value: float, unit: str) -> bool:
    """Whether a number can be a measurement in a unit; any number can in a unit that has no bounds here."""
    low, high = BOUNDS.get(unit, (float("-inf"), float("inf")))
    return low <= value <= high


_SPELLINGS: dict[str, str] = {
    **dict.fromkeys(("degc", "celsius", "deg c", "°c", "degrees celsius", "degree celsius", "deg_c"), "degC"),
    **dict.fromkeys(("degf", "fahrenheit", "°f", "degrees fahrenheit", "deg_f"), "degF"),
    **dict.fromkeys(("k", "kelvin"), "K"),
    **dict.fromkeys(("%", "percent", "pct"), "%"),
    **dict.fromkeys(("rpm", "revolutions per minute"), "rpm"),
    **dict.fromkeys(("v", "volt", "volts"), "V"),
    **dict.fromkeys(("a", "amp", "amps", "ampere", "amperes"), "A"),
    **dict.fromkeys(("w", "watt", "watts"), "W"),
    **dict.fromkeys(("lx", "lux"), "lux"),
    **dict.fromkeys(("kpa", "kilopascal", "kilopascals"), "kPa"),
    **dict.fromkeys(("hpa", "hectopascal", "hectopascals", "mbar"), "hPa"),
    **dict.fromkeys(("m/s^2", "m/s2", "m/s²"), "m/s^2"),
    **dict.fromkeys(("rad/s",), "rad/s"),
    **dict.fromkeys(("dbm",), "dBm"),
}
_LONG = tuple(word for word in _SPELLINGS if len(word) > 2)
"""Spellings that mean a unit wherever they are in a name or a sentence; the short ones only as a whole."""
COUNTS = frozenset({"count", "counts", "index", "number", "raw", "step", "steps", "ticks", "total"})
"""Last words of members that count something, whatever unit their description mentions."""
_OF_ANOTHER_NUMBER = re.compile(r"(?:\d|\bper)\s*(?:deg(?:rees?)?\s*)?$")
"""Phrases before a unit that is not the member's: "steps at 100 percent", "counts per volt"."""


def unit_of_text(text: Any) -> str | None:
    return _SPELLINGS.get(text.strip().casefold()) if isinstance(text, str) else None


def unit_of_name(name: str) -> str | None:
    """The unit that a member's name ends in: ``temperature_degc``, ``celsius``, ``level_percent``."""
    last = last_word(name)
    return _SPELLINGS.get(last) if len(last) > 2 else None


def last_word(name: str) -> str:
    return name.casefold().rpartition("_")[2]


def unit_in(description: Any) -> str | None:
    """The one unit that a description names; None where it names several, and so may mean none of them."""
    text = description.casefold() if isinstance(description, str) else ""
    found = {
        _SPELLINGS[word]
        for word in _LONG
        if word in text
        for at in re.finditer(rf"(?<!\w){re.escape(word)}(?!\w)", text)
        if not _OF_ANOTHER_NUMBER.search(text, 0, at.start())
    }
    return found.pop() if len(found) == 1 else None
