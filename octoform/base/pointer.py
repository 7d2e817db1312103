"""JSON pointers (RFC 6901): the place of a value in a document, as one text."""


def step(part: object) -> str:
    """One reference token: ``~`` and ``/`` inside it are escaped (section 3)."""
    return str(part).replace("~", "~0").replace("/", "~1")


def pointer(*parts: str | int) -> str:
    """The pointer of the parts; ``""`` for none, which is the whole document."""
    return "".join(f"/{step(part)}" for part in parts)
