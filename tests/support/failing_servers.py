"""Servers whose device fails, and servers that read another attribute than they name.

What answers with nothing while its device fails is wrong, what fails or states it is right.

Each is an edit of `SERVER`, which implements `INTERFACE`.
"""

from typing import Any

_TEXT = {"type": ["string", "null"], "description": "a name"}
_NAMES = ("sys_vendor", "product_name", "board_vendor", "board_name")
INTERFACE: dict[str, Any] = {
    "tools": [
        {
            "name": "read_touches",
            "devices": ["i2c-heron-touch"],
            "effect": "read",
            "description": "Wait for touches.\n\nThrough: the kernel.",
            "input_schema": {
                "type": "object",
                "properties": {"wait_seconds": {"type": "number", "minimum": 0.1, "maximum": 30, "default": 5}},
            },
            "output_schema": {
                "type": "object",
                "properties": {
                    "events": {"type": "array", "items": {"type": "object", "properties": {"code": {}}}},
                    "waited_seconds": {"type": "number"},
                },
            },
        },
        {
            "name": "read_identity",
            "devices": ["dmi-board"],
            "effect": "read",
            "description": "Read maker and model.\n\nThrough: the kernel.",
            "input_schema": {"type": "object", "properties": {}},
            "output_schema": {"type": "object", "properties": dict.fromkeys(_NAMES, _TEXT)},
        },
        {
            "name": "read_presence",
            "devices": ["usb-1f00-00c1"],
            "effect": "read",
            "description": "Read whether the board is attached.\n\nThrough: the kernel.",
            "input_schema": {"type": "object", "properties": {}},
            "output_schema": {
                "type": "object",
                "properties": {"attached": {"type": "boolean"}, "time": {"type": "number"}},
            },
        },
    ]
}
_ASKS = 'runtime.device("usb-1f00-00c1")'
_TAKEN, _READ = "        found = runtime.evdev.events(nodes, 100, wait_seconds)\n", "        return Identity(\n"
_REST = "\n\nif __name__"
_SEEN = """    try:
        runtime.device("usb-1f00-00c1")
    except runtime.DeviceAbsent:
        return Presence(False, time.time())
    return Presence(True, time.time())
"""
SERVER = f'''# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2", "pydantic>=2"]
# ///
"""Server for a touchscreen and the identity of a computer."""

import contextlib
import errno
import logging
import time
from dataclasses import dataclass
from typing import Annotated

import runtime
import runtime.evdev
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from pydantic import Field

mcp = FastMCP("bench")
READ = {{"readOnlyHint": True, "destructiveHint": False, "idempotentHint": False, "openWorldHint": False}}
FAILURES = (OSError, ValueError)


@dataclass
class Touch:
    """One event."""

    code: int


@dataclass
class Touches:
    """The events that came."""

    events: list[Touch]
    waited_seconds: float


@mcp.tool(annotations=READ)
@runtime.logged
def read_touches(wait_seconds: Annotated[float, Field(ge=0.1, le=30)] = 5) -> Touches:
    """Wait for touches."""
    with runtime.device("i2c-heron-touch").bus() as unit:
        start = time.monotonic()
        nodes = unit.nodes("input", "event")
        if not nodes:
            raise ToolError("the touchscreen has no event node; see whether its driver works")
{_TAKEN}        waited = time.monotonic() - start
    return Touches([Touch(each.code) for each in found], waited)


@dataclass
class Identity:
    """Maker and model of a computer and its board."""

    sys_vendor: str | None
    product_name: str | None
    board_vendor: str | None
    board_name: str | None


@mcp.tool(annotations=READ)
@runtime.logged
def read_identity() -> Identity:
    """Read maker and model."""
    with runtime.device("dmi-board").bus() as unit:
        folder = unit.path("dmi")
        return Identity(
            runtime.read_text(folder / "sys_vendor"),
            runtime.read_text(folder / "product_name"),
            runtime.read_text(folder / "board_vendor"),
            runtime.read_text(folder / "board_name"),
        )


@dataclass
class Presence:
    """Whether a device is attached."""

    attached: bool
    time: float


@mcp.tool(annotations=READ)
@runtime.logged
def read_presence() -> Presence:
    """Read whether the board is attached."""
{_SEEN}{_REST} == "__main__":
    mcp.run()
'''
TAKES = _TAKEN.strip().removeprefix("found = ")


def touches(text: str) -> str:
    """The server with other statements that take the events as ``found``."""
    assert _TAKEN in SERVER
    return SERVER.replace(_TAKEN, "".join(f"        {line}\n" for line in text.splitlines()))


def helped(helper: str, taken: str) -> str:
    """The server that takes the events through a function of its own."""
    return touches(f"found = {taken}").replace("@dataclass\nclass Touch:", f"{helper}\n\n\n@dataclass\nclass Touch:")


def identity(text: str, more: str = "") -> str:
    """The server with another end of `read_identity`."""
    start = SERVER.index(_READ)
    end = SERVER.index("\n\n\n@dataclass", start)
    made = SERVER[:start] + "".join(f"        {line}\n" for line in text.splitlines()) + SERVER[end:]
    return made.replace("@dataclass\nclass Touch:", f"{more}\n\n\n@dataclass\nclass Touch:") if more else made


def tried(handler: str, before: str = "") -> str:
    return touches(f"{before}try:\n    found = {TAKES}\n{handler}")


_HELP = "def taken(nodes, wait_seconds):\n    try:\n        return " + TAKES + "\n    except {}"
_CALLED = "taken(nodes, wait_seconds)"
_EACH = "found = []\nfor node in nodes:\n    try:\n        {}\n    except OSError:\n        continue"
_ONE = "runtime.evdev.events([node], 100, wait_seconds)"
_ALL = ", ".join(f'(folder / "{name}").read_text()' for name in _NAMES)
_OPTIONAL = "def optional(path):\n    try:\n        return path.read_text().strip()\n    except {}:\n"
_OPTIONAL += "        return None"
_ONE_BY_ONE = "return Identity(" + ", ".join(f'optional(folder / "{name}")' for name in _NAMES) + ")"

WRONG: dict[str, str] = {
    "an empty list": tried("except OSError:\n    found = []"),
    "an empty list that was set before": tried("except Exception:\n    pass", "found = []\n"),
    "whatever goes wrong": tried("except:\n    pass", "found = []\n"),
    "suppressed": touches(f"found = []\nwith contextlib.suppress(OSError):\n    found = {TAKES}"),
    "in a helper": helped(_HELP.format("OSError:\n        return []"), _CALLED),
    "None of a helper, and a list instead": helped(_HELP.format("OSError:\n        return None"), f"{_CALLED} or []"),
    "a helper that returns nothing": helped(_HELP.format("OSError:\n        pass"), f"{_CALLED} or []"),
    "a helper of any function": helped(
        "def taken(function):\n    try:\n        return function()\n    except Exception:\n        return []",
        f"taken(lambda: {TAKES})",
    ),
    "failures in a constant": tried("except FAILURES:\n    found = []"),
    "each node is skipped": touches(_EACH.format(f"found += {_ONE}")),
    "each node is skipped, with extend": touches(_EACH.format(f"found.extend({_ONE})")),
    "with a line of the log": tried("except OSError as error:\n    logging.warning('%s', error)\n    found = []"),
    "after three tries": touches(
        f"found = []\nfor _ in range(3):\n    try:\n        found = {TAKES}\n        break\n    except OSError:\n"
        "        time.sleep(0.1)"
    ),
    "a fault of the runtime": tried("except runtime.DeviceFault:\n    found = []"),
    "a record of nothing": tried("except OSError:\n    return Touches(list(), time.monotonic() - start)"),
    "in pieces, until it fails": touches(
        "found = []\nend = time.monotonic() + wait_seconds\nwhile time.monotonic() < end:\n    try:\n"
        "        found += runtime.evdev.events(nodes, 100, 0.1)\n    except OSError:\n        break"
    ),
    "a device that is not there": SERVER.replace(
        '    with runtime.device("i2c-heron-touch").bus() as unit:',
        '    try:\n        unit = runtime.device("i2c-heron-touch")\n    except runtime.DeviceAbsent:\n'
        "        return Touches([], 0.0)\n    with unit.bus():",
    ),
    "null in each field": identity(
        f"try:\n    return Identity({_ALL})\nexcept Exception:\n    return Identity(None, None, None, None)"
    ),
    "null in each field, set before": identity(
        f"one = two = three = four = None\ntry:\n    one, two, three, four = {_ALL}\nexcept OSError:\n    pass\n"
        "return Identity(one, two, three, four)"
    ),
    "null in each field of a loop": identity(
        'found = {}\nfor name in ("sys_vendor", "product_name", "board_vendor", "board_name"):\n    try:\n'
        "        found[name] = (folder / name).read_text()\n    except Exception:\n        found[name] = None\n"
        "return Identity(**found)"
    ),
    "null in each field by a helper of everything": identity(_ONE_BY_ONE, _OPTIONAL.format("Exception")),
}
RIGHT: dict[str, str] = {
    "as it is": SERVER,
    "a time without any event": tried("except TimeoutError:\n    found = []"),
    "one of several nodes is skipped": touches(
        f"found, read = [], 0\n{_EACH.format(f'found += {_ONE}; read += 1').removeprefix('found = []')}\n"
        "if not read:\n    raise ToolError('no node of the touchscreen can be read')"
    ),
    "another error": tried("except OSError as error:\n    raise ToolError('it gives no events') from error"),
    "an error later": tried(
        "except OSError as error:\n    problem = error\nif problem is not None:\n    raise ToolError('it gives none')",
        "found, problem = [], None\n",
    ),
    "an error that is no failure": tried(
        "except OSError as error:\n    if error.errno != errno.EAGAIN:\n        raise\n    found = []"
    ),
    "three tries, then an error": touches(
        f"for _ in range(3):\n    try:\n        found = {TAKES}\n        break\n    except OSError:\n"
        "        time.sleep(0.1)\nelse:\n    raise ToolError('it gives no events')"
    ),
    "each node is tried, then an error": touches(
        f"found = []\nfor node in nodes:\n    try:\n        found = {_ONE}\n        break\n"
        "    except OSError:\n        continue\nelse:\n    raise ToolError('no node of the touchscreen can be read')"
    ),
    "until the time is over, then an error": touches(
        f"found, end = [], time.monotonic() + wait_seconds\nwhile time.monotonic() < end:\n    try:\n"
        f"        found = {TAKES}\n        break\n    except OSError:\n        time.sleep(0.1)\n"
        "else:\n    raise ToolError('it gives no events')"
    ),
    "a close that fails": touches(
        f"found = {TAKES}\ntry:\n    runtime.evdev.axis(nodes[0], 0)\nexcept OSError:\n    pass"
    ),
    "attributes that a driver may lack": identity(_ONE_BY_ONE, _OPTIONAL.format("OSError")),
    "one attribute that the driver may lack": identity(
        'try:\n    name = (folder / "product_name").read_text()\nexcept OSError:\n    name = None\n'
        'return Identity((folder / "sys_vendor").read_text(), name, None, None)'
    ),
    "a file that is not there": identity(
        'try:\n    name = (folder / "product_name").read_text()\nexcept FileNotFoundError:\n    name = None\n'
        "return Identity(None, name, None, None)"
    ),
}


def presence(text: str) -> str:
    """The server with other statements in `read_presence`."""
    return SERVER.replace(_SEEN, "".join(f"    {line}\n" for line in text.splitlines()))


_THERE = "return Presence(True, time.time())"
UNASKED: dict[str, str] = {
    "always there": presence(_THERE),
    "there where it was asked for": presence(f"{_ASKS}\n{_THERE}"),
    "there where it is not": presence(f"try:\n    {_ASKS}\nexcept runtime.DeviceAbsent:\n    {_THERE}\n{_THERE}"),
    "another error": presence(
        f"try:\n    {_ASKS}\nexcept ValueError:\n    return Presence(False, 0.0)\n{_THERE}",
    ),
}
RIGHT |= {
    "a part of it": SERVER.replace(_ASKS, f'{_ASKS}.path("tty")'),
    "whatever is wrong with it": SERVER.replace("runtime.DeviceAbsent", "runtime.DeviceFault"),
    "by a name": presence(
        f"try:\n    {_ASKS}\n    there = True\nexcept runtime.DeviceAbsent:\n    there = False\n"
        "return Presence(there, time.time())"
    ),
}

_VENDOR = 'runtime.read_text(folder / "sys_vendor")'
_EVERY = "{name: (folder / name).read_text().strip() for name in " + repr(_NAMES) + "}"
OTHERWISE: dict[str, tuple[str, str]] = {
    "two names exchanged": (SERVER.replace(_VENDOR, _VENDOR.replace("sys_", "board_")), "SERVE-READING-OTHERWISE"),
    "exchanged in a record": (
        identity(f"found = {_EVERY}\nreturn Identity(found['board_vendor'], None, found['sys_vendor'], None)"),
        "SERVE-READING-OTHERWISE",
    ),
    "a serial number as a name": (SERVER.replace('/ "product_name"', '/ "product_serial"'), "SERVE-READING-OTHERWISE"),
    "a text of the file": (
        SERVER.replace('runtime.read_text(folder / "board_name")', '"Heron H7"'),
        "SERVE-CONSTANT-READING",
    ),
    "how long it was to wait": (
        SERVER.replace("waited = time.monotonic() - start", "waited = wait_seconds"),
        "SERVE-CONSTANT-READING",
    ),
    "how long it was to wait, at once": (SERVER.replace("], waited)", "], wait_seconds)"), "SERVE-CONSTANT-READING"),
}
RIGHT |= {
    "read in a loop": identity(f"return Identity(**{_EVERY})"),
    "thousands of numbers": identity(f"return [{_VENDOR}, list(range(900)), list(range(900)), list(range(900))]"),
    "a name that is not there": SERVER.replace('runtime.read_text(folder / "board_name")', "None"),
    "two attributes as one text": SERVER.replace(_VENDOR, f'" ".join([str({_VENDOR}), "of the board"])'),
    "a wait that is whole": touches(
        "import runtime.evdev\ntime.sleep(wait_seconds)\n" + f"found = {TAKES}",
    ).replace("waited = time.monotonic() - start", "waited = wait_seconds"),
}
