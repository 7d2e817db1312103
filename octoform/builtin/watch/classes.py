"""The class of a failure, from the kind of its exception and its words; ``none`` where these do not decide.

A class starts a repair. So only what is certain is said: code that names what a library lacks is wrong, a module that
does not load is missing; whatever a device, a cable or a right may be at fault for is for a person.
"""

import re
from collections.abc import Mapping
from typing import Any

DEPENDENCY, BROKEN_TOOL, CORRUPTED_FILE = "dependency", "broken_tool", "corrupted_file"
DEVICE_MOVED, NONE = "device_moved", "none"
_BY_KIND = {
    "ModuleNotFoundError": DEPENDENCY,
    "ImportError": DEPENDENCY,
    "SyntaxError": CORRUPTED_FILE,
    "IndentationError": CORRUPTED_FILE,
    "TabError": CORRUPTED_FILE,
    "NameError": BROKEN_TOOL,
    "UnboundLocalError": BROKEN_TOOL,
    "NotImplementedError": BROKEN_TOOL,
    "AttributeError": BROKEN_TOOL,
    "TypeError": BROKEN_TOOL,
}
_GONE = frozenset({"FileNotFoundError", "NotADirectoryError"})
_ABSENT_VALUE = "NoneType"
_LIBRARY = re.compile(r"cannot open shared object file|undefined symbol|wrong ELF class|GLIBC(?:XX)?_\d", re.IGNORECASE)
_RIGHT = frozenset({"PermissionError"})
_FIXED_PLACE = re.compile(r"(?<![\w.])/dev/\w")


def class_of(failure: Mapping[str, Any], *, attached: bool | None) -> str:
    """One of the playbook's classes; ``attached``: whether the kernel shows the device (None: it is not known)."""
    kind, message = _words(failure, "error"), _words(failure, "message")
    if attached is False:
        return NONE
    if _LIBRARY.search(message):
        return DEPENDENCY
    if kind in _GONE and attached and _FIXED_PLACE.search(message):
        return DEVICE_MOVED
    if _ABSENT_VALUE in message:
        return NONE  # something was not there when it was asked for; whether the code or the device is at fault is open
    return _BY_KIND.get(kind, NONE)


def is_fatal(failure: Mapping[str, Any]) -> bool:
    """Whether nothing but a person can help: a right that is lacking is not given by trying again."""
    return _words(failure, "error") in _RIGHT


def _words(failure: Mapping[str, Any], name: str) -> str:
    value = failure.get(name)
    return value if isinstance(value, str) else ""
