"""What the emergency stop writes to a product: bytes as data, never a program. Pure."""

import re
from collections.abc import Mapping

from octoform.diagnostics import did_you_mean
from octoform.frontmatter import Place
from octoform.profiles.model import Stop

FIELDS = ("class", "baud", "write")
MOST_BYTES = 256
MOST_ACTIONS = 20
_CLASS = re.compile(r"[a-z0-9][a-z0-9_-]{0,63}")
_EXAMPLE = '{class: tty, baud: 115200, write: "01 02 0A"}'

Problem = tuple[Place, str, str | None]


def read(given: object) -> tuple[tuple[Stop, ...], list[Problem]]:
    """The actions that a front-matter value says, and every problem of it as (place, summary, hint)."""
    if not isinstance(given, list) or len(given) > MOST_ACTIONS:
        summary = f"stop is no list of at most {MOST_ACTIONS} actions"
        return (), [(("stop",), summary, f"write stop: [{_EXAMPLE}]")]
    found: list[Problem] = []
    actions: list[Stop] = []
    for index, item in enumerate(given):
        problems = list(_problems(item))
        found += [(("stop", index, *place), summary, hint) for place, summary, hint in problems]
        if not problems and isinstance(item, Mapping):
            actions.append(Stop(item["class"], item.get("baud"), bytes.fromhex(item["write"])))
    return tuple(actions), found


def _problems(item: object) -> list[Problem]:
    if not isinstance(item, Mapping):
        return [((), "a stop action is a mapping", f"write {_EXAMPLE}")]
    found: list[Problem] = []
    for name in item:
        if name not in FIELDS:
            near = did_you_mean(str(name), FIELDS)
            hint = f"did you mean {near!r}?" if near else f"known fields: {', '.join(FIELDS)}"
            found.append(((name,), f"{name!r} is no field here", hint))
    kind, baud = item.get("class"), item.get("baud")
    if not (isinstance(kind, str) and _CLASS.fullmatch(kind)):
        found.append((("class",), "the class of a stop action is no word of /sys/class", "write for example tty"))
    if "baud" in item and (isinstance(baud, bool) or not isinstance(baud, int) or not 1 <= baud <= 100_000_000):
        found.append((("baud",), "the baud of a stop action is no positive whole number", "write for example 115200"))
    if not _is_bytes(item.get("write")):
        hint = 'write pairs of hexadecimal digits in quotes: "01 02 0A"'
        found.append((("write",), f"a stop action writes 1 to {MOST_BYTES} bytes", hint))
    return found


def _is_bytes(value: object) -> bool:
    try:
        return isinstance(value, str) and 1 <= len(bytes.fromhex(value)) <= MOST_BYTES
    except ValueError:
        return False
