"""Foreign text on one line of a terminal: bounded, control characters shown."""

from octoform.escaping import escaped


def escape(text: str) -> str:
    """Hidden characters as backslash escapes; line feeds and tabs stay."""
    return escaped(text, "\n\t")


def one_line(text: str, width: int) -> str:
    """At most ``width`` characters of the text on one line."""
    flat = escape(" ".join(text.split()))
    return flat if len(flat) <= width else flat[: max(0, width - 1)] + "…"
