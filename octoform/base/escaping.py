"""Foreign text made visible: one way for terminals, prompts, diagnostics and rules.

A device may name itself anything: escape sequences, right-to-left overrides, invisible joiners. Whatever leaves
octoform as text goes through here, so nothing foreign can act on a terminal or hide in a prompt. Light.
"""

import unicodedata
from collections.abc import Collection

_HIDDEN = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
_NAMED = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}


def is_hidden(character: str) -> bool:
    """True for control, format (bidirectional, zero width), surrogate, unassigned and line-separating characters."""
    return not (" " <= character <= "~") and unicodedata.category(character) in _HIDDEN


def escaped(text: str, keep: Collection[str] = "") -> str:
    """The text with every hidden character but those of ``keep`` as its backslash escape (``\\x1b``, ``\\u202e``)."""
    hidden = (char for char in {*text} - {*keep} if is_hidden(char))
    return text.translate({ord(char): _NAMED.get(char) or escape_of(char) for char in hidden})


def escaped_json(text: str) -> str:
    """A JSON text with every hidden character inside its strings as ``\\uXXXX``: the same value, and nothing acts."""
    hidden = (char for char in {*text} - {"\n"} if is_hidden(char))
    return text.translate({ord(char): _utf16(char) for char in hidden})


def _utf16(character: str) -> str:
    units = character.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[at : at + 4]}" for at in range(0, len(units), 4))


def escape_of(character: str) -> str:
    """The backslash escape of a character by its number; of a byte that surrogateescape carries by that of the byte."""
    code = ord(character)
    code -= 0xDC00 if 0xDC80 <= code <= 0xDCFF else 0
    if code <= 0xFF:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


# Foreign text inside our messages: bounded and escaped, because a device may name itself anything.
#
# A product string can hold control characters, right-to-left overrides or a megabyte of blanks; a diagnostic goes to
# a terminal and into the next prompt, so nothing foreign enters one except through `display`.


def flattened(text: str) -> str:
    """The text with each hidden character made one visible one, so that columns stay where they are."""
    return "".join((" " if item == "\t" else "\ufffd") if is_hidden(item) else item for item in text)


def display(value: object, limit: int = 80) -> str:
    """``value`` as one quoted line of at most about ``limit`` characters, fit for a terminal."""
    text = value if isinstance(value, str) else str(value)
    cut = text if len(text) <= limit else text[: limit - 3] + "..."
    return f"'{escaped(cut)}'"


def listed(values: list[str], limit: int = 5) -> str:
    """``'a', 'b' and 3 more``: the first few of them, each through `display`."""
    first = ", ".join(display(item) for item in values[:limit])
    return first if len(values) <= limit else f"{first} and {len(values) - limit} more"
