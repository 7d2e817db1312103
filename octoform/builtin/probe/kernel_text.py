"""Makes what a kernel or a device reports safe to carry as text: bounded, printable, one line.

Device strings are hostile data. Whatever is not printable (control and bidirectional characters, invalid UTF-8,
unassigned code points) stays visible as an escape, so that a person sees that it was there.
"""

from octoform.base.escaping import escape_of
from octoform.patterns import regex

VALUE_CHARS = 240
CUT = " [cut]"
SLUG_CHARS = 72

_DIGITS = regex(r"(\d+)")
_NO_SLUG = regex(r"[^a-z0-9]+")


def visible(text: str) -> str:
    r"""``text`` with every unprintable character as ``\xNN``, ``\uNNNN`` or ``\UNNNNNNNN``."""
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else escape_of(char) for char in text)


def value(text: str, limit: int = VALUE_CHARS) -> str:
    """A value for one line: stripped, visible, at most ``limit`` characters, the cut marked."""
    # Cut before escaping as well: a name of ten thousand characters must not cost ten thousand escapes.
    shown = visible(text[: 2 * limit].strip(" \t\r\n\0"))
    return shown if len(shown) <= limit else shown[: limit - len(CUT)].rstrip() + CUT


def slug(text: str) -> str:
    """Lower-case letters, digits and single hyphens; empty when nothing is left."""
    return _NO_SLUG.sub("-", text[: 4 * SLUG_CHARS].lower()).strip("-")[:SLUG_CHARS].strip("-")


def natural(text: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key that puts ``hwmon2`` before ``hwmon10``."""
    return tuple(
        (0, int(part), "") if part.isdecimal() and part.isascii() else (1, 0, part)
        for part in _DIGITS.split(text)
        if part
    )
