"""Names of hosts: what is legal, and what comes nearest to a name that is not. Light, for `init` and `validate`."""

import re

PATTERN = r"^[a-z0-9]([a-z0-9-]{0,61}[a-z0-9])?$"
DEFAULT = "local"


def is_legal(name: str) -> bool:
    """True for a DNS label in lower case, which is also safe as the name of a folder on every file system."""
    return re.fullmatch(PATTERN[1:-1], name) is not None


def nearest(text: str) -> str:
    """The nearest legal name to a text, empty when nothing is left of it."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")[:63].strip("-")


def of_machine(machine: str) -> str:
    """A name for a machine: the first label of its own name, or the default where that says nothing."""
    name = nearest(machine.split(".")[0])
    return DEFAULT if name in ("", "localhost") else name
