"""Whether a variable holds what can be a key at all, before anybody sends it. Light."""

from collections.abc import Mapping


def complaint(name: str, environ: Mapping[str, str]) -> str | None:
    """What is wrong with the variable of a key, never with its value in it; None when a request can carry it."""
    if name not in environ:
        return f"the variable {name} is not set"
    value = environ[name]
    if not value.strip():
        return f"the variable {name} is empty"
    if "\n" in value or "\r" in value:
        return f"the variable {name} holds a line break, which no key has"
    return None if is_sendable(value) else f"the variable {name} holds blanks or characters that no request can carry"


def is_sendable(key: str) -> bool:
    """True when each character may stand in the header of a request."""
    return all("!" <= character <= "~" for character in key)
