"""Foreign text inside our messages: bounded and escaped, because a device may name itself anything.

A product string can hold control characters, right-to-left overrides or a megabyte of blanks; a diagnostic goes to
a terminal and into the next prompt, so nothing foreign enters one except through `shown`.
"""

from octoform.base.escaping import escaped, is_hidden


def flattened(text: str) -> str:
    """The text with each hidden character made one visible one, so that columns stay where they are."""
    return "".join((" " if item == "\t" else "\ufffd") if is_hidden(item) else item for item in text)


def shown(value: object, limit: int = 80) -> str:
    """``value`` as one quoted line of at most about ``limit`` characters, fit for a terminal."""
    text = value if isinstance(value, str) else str(value)
    cut = text if len(text) <= limit else text[: limit - 3] + "..."
    return f"'{escaped(cut)}'"


def listed(values: list[str], limit: int = 5) -> str:
    """``'a', 'b' and 3 more``: the first few of them, each through `shown`."""
    first = ", ".join(shown(item) for item in values[:limit])
    return first if len(values) <= limit else f"{first} and {len(values) - limit} more"
