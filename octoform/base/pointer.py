"""JSON pointers (RFC 6901): the place of a value in a document, as one text."""

from collections.abc import Mapping


def step(part: object) -> str:
    """One reference token: ``~`` and ``/`` inside it are escaped (section 3)."""
    return str(part).replace("~", "~0").replace("/", "~1")


def pointer(*parts: str | int) -> str:
    """The pointer of the parts; ``""`` for none, which is the whole document."""
    return "".join(f"/{step(part)}" for part in parts)


def resolve(document: object, place: str) -> object:
    """The value that a pointer points to, or the local reference of a schema (``#/$defs/x``); None without one."""
    for part in place.removeprefix("#").split("/")[1:]:
        key = part.replace("~1", "/").replace("~0", "~")
        if isinstance(document, Mapping):
            document = document.get(key)
        elif isinstance(document, list) and key.isdigit() and int(key) < len(document):
            document = document[int(key)]
        else:
            return None
    return document
