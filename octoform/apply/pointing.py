"""Values inside the result of a tool: a trial names the place by a JSON pointer, because results are of any shape."""

from collections.abc import Mapping


def at(value: object, pointer: str) -> object:
    """What a JSON pointer points to; None where there is nothing."""
    for part in pointer.split("/")[1:]:
        key = part.replace("~1", "/").replace("~0", "~")
        if isinstance(value, Mapping):
            value = value.get(key)
        elif isinstance(value, list) and key.isdigit() and int(key) < len(value):
            value = value[int(key)]
        else:
            return None
    return value
