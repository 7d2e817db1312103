"""Settings that the design of the manifest names and this version does not act on.

They are refused by name, so that nobody believes that a setting is in force; what is silently ignored today would
change the meaning of a file on the day it starts to work.
"""

from octoform.manifest.tree import Loc

_KEYS = {
    ("daemon",),
    ("stages", "watch"),
    ("stages", "heal"),
}


def is_key(loc: Loc) -> bool:
    """True for the path of a key that comes later."""
    return loc in _KEYS
