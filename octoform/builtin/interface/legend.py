"""The description of a tool's ``device`` parameter: which id is which product, as far as that is short and safe.

Product names come from the devices themselves and end up before a language model, so only letters, digits and a few
marks of a bounded length pass, inside quotation marks, and nothing that could look like an instruction to a reader.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

MOST_CHARS = 60
NAME_CHARS = 48
_UNSAFE = re.compile(r"[^A-Za-z0-9 .,()/+#_-]+")


def legend(devices: Sequence[Mapping[str, Any]]) -> str:
    """``device id ("Product A", "Product B")``, in the order of the ids; without names where they would be too long."""
    names = ", ".join(f'"{_safe(device["identified_as"])}"' for device in devices)
    long = len(names) + sum(len(device["id"]) for device in devices) > MOST_CHARS
    return "device id" if long else f"device id ({names})"


def _safe(name: str) -> str:
    text = " ".join(_UNSAFE.sub(" ", name).split())
    return text if len(text) <= NAME_CHARS else text[: NAME_CHARS - 3].rstrip() + "..."
