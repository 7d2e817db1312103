"""Text from devices, agents and files made safe for a terminal: bounded, on one line, control characters shown."""

import unicodedata


def escape(text: str) -> str:
    """Control, format and bidirectional characters as ``\\xNN`` or ``\\uNNNN``; line feeds and tabs stay."""
    return "".join(_visible(char) for char in text)


def _visible(char: str) -> str:
    if char in "\n\t" or unicodedata.category(char) not in ("Cc", "Cf", "Cs", "Co", "Zl", "Zp"):
        return char
    code = ord(char)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def one_line(text: str, width: int) -> str:
    """At most ``width`` characters of the text on one line."""
    flat = escape(" ".join(text.split()))
    return flat if len(flat) <= width else flat[: max(0, width - 1)] + "…"
