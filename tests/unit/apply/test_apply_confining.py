"""A rewritten server may differ from the accepted one in one device's functions, and in nothing else."""

import pytest

from octoform.apply.rewrite.scope import CODE, beyond, others, own_tools

INTERFACE = {
    "tools": [
        {"name": "arm_move", "devices": ["arm"]},
        {"name": "arm_read", "devices": ["arm"]},
        {"name": "get_load", "devices": ["host"]},
        {"name": "list_devices", "devices": ["arm", "host"]},
    ]
}
DEPLOY = {
    "imports": [
        {"module": "fastmcp", "provided_by": "fastmcp"},
        {"module": "scservo_sdk", "provided_by": "feetech-servo-sdk"},
        {"module": "serial", "provided_by": "pyserial"},
    ],
    "deps_failed": [],
}
ACCEPTED = '''\
# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp", "feetech-servo-sdk"]
# ///
"""A server."""

import os

import runtime
from fastmcp import FastMCP

mcp = FastMCP("server")
BAUD = 1000000
WORDS = {"load": 1}


def _words(text):
    return text.split()


def _packet(data):
    return bytes(data) + _end()


def _end():
    return b"!"


class _Servo:
    def go(self, goal):
        return _packet([goal])


@mcp.tool()
@runtime.logged
def arm_move(joint: str, position: int) -> dict:
    """Move a joint."""
    import scservo_sdk

    return {"joint": joint, "sent": _Servo().go(position), "baud": BAUD, "words": _words(joint)}


@mcp.tool()
@runtime.logged
def arm_read(joint: str) -> dict:
    return {"joint": joint}


@mcp.tool()
@runtime.logged
def get_load() -> dict:
    return {"load": os.getloadavg(), "words": sorted(_words("a b")), "known": WORDS}


@mcp.tool(name="list_devices")
@runtime.logged
def devices() -> dict:
    return {}


if __name__ == "__main__":
    mcp.run()
'''


def changed(*pairs: tuple[str, str]) -> str:
    text = ACCEPTED
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def judged(*pairs: tuple[str, str]) -> list[str]:
    found = beyond(ACCEPTED, changed(*pairs), own_tools(INTERFACE, "arm"), DEPLOY, others(INTERFACE, "arm"))
    assert all(item.code == CODE and item.severity == "error" for item in found)
    return [item.summary for item in found]


MORE = ("def _words", "def _checked(value):\n    return min(value, 4095)\n\n\ndef _words")
SORTED = ('return {"joint": joint}', 'return {"joint": sorted(joint)}')
USED = ('"joint": joint, "sent"', '"joint": _checked(joint), "sent"')


@pytest.mark.parametrize(
    "pairs",
    [
        [],
        [("Move a joint.", "Move one joint, torque first.")],
        [("BAUD = 1000000", "BAUD = 115200")],
        [('return b"!"', 'return b"?"')],
        [("return _packet([goal])", "return _packet([1, goal])")],
        [
            ("class _Servo:\n    def go(self, goal):\n        return _packet([goal])\n\n\n", ""),
            ("_Servo().go", "_packet"),
        ],
        [MORE, USED],
        [("import os\n", "import os\nimport time\n"), ('"joint": joint, "sent"', '"at": time.time(), "sent"')],
        [("    import scservo_sdk\n", "    import serial\n    import struct\n")],
        [('"""A server."""', '# a comment\n"""A server."""  # and one more')],
    ],
)
def test_what_belongs_to_the_device_alone_may_change(pairs: list[tuple[str, str]]) -> None:
    assert judged(*pairs) == []


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ([("os.getloadavg()", "0")], "changes 'get_load', the tool of another device"),
        ([("return {}", 'return {"n": 1}')], "changes 'devices', the tool of another device"),
        ([("return text.split()", "return []")], "changes '_words', which 'get_load' uses"),
        ([('"""A server."""', '"""Another."""')], "changes the statement in line 5"),
        ([('WORDS = {"load": 1}', "WORDS = {}")], "changes 'WORDS', which 'get_load' uses"),
        ([('mcp = FastMCP("server")', 'mcp = FastMCP("other")')], "changes 'mcp'"),
        ([("    mcp.run()", '    mcp.run(transport="http")')], "changes the statement"),
        ([MORE], "adds '_checked'"),
        ([("def _words(text):\n    return text.split()\n\n\n", "")], "no longer has '_words', which 'get_load' uses"),
        ([("BAUD = 1000000", "BAUD = 1000000\nWORDS = {}")], "'WORDS'"),
        ([("import os\n", "import time as os\n")], "changes 'os', which 'get_load' uses"),
        (
            [("def _words", "def sorted(value):\n    return 0\n\n\ndef _words"), SORTED],
            "adds 'sorted', which 'get_load' uses",
        ),
        ([("    import scservo_sdk\n", "    global WORDS\n    WORDS = {}\n")], "sets 'WORDS'"),
        ([("    import scservo_sdk\n", '    WORDS["load"] = 2\n')], "sets 'WORDS'"),
        ([("    import scservo_sdk\n", "    runtime.device = None\n")], "sets 'runtime'"),
        ([("    import scservo_sdk\n", "    setattr(runtime, 'x', 1)\n")], "sets 'setattr'"),
        ([("    import scservo_sdk\n", "    import requests\n")], "imports 'requests', which DEPLOY has not installed"),
        ([('"feetech-servo-sdk"]', '"feetech-servo-sdk", "numpy"]')], "declares other packages"),
    ],
)
def test_what_belongs_to_others_may_not(pairs: list[tuple[str, str]], told: str) -> None:
    found = judged(*pairs)
    assert any(told in summary for summary in found), found


def test_every_part_that_is_touched_is_named_with_its_place() -> None:
    text = changed(("os.getloadavg()", "0"), ("return text.split()", "return []"), ("return {}", 'return {"n": 1}'))
    found = beyond(ACCEPTED, text, own_tools(INTERFACE, "arm"), DEPLOY)
    assert [item.path for item in found] == ["server.py"] * 3
    assert all(item.span is not None and item.source for item in found)


def test_a_tool_of_several_devices_belongs_to_none() -> None:
    assert own_tools(INTERFACE, "arm") == {"arm_move", "arm_read"}
    assert own_tools(INTERFACE, "camera") == frozenset()
    assert beyond(ACCEPTED, changed(("BAUD = 1000000", "BAUD = 1")), frozenset(), DEPLOY)


def test_a_module_that_failed_to_install_is_not_there() -> None:
    failed = {**DEPLOY, "deps_failed": [{"name": "pyserial", "reason": "no wheel"}]}
    text = changed(("    import scservo_sdk\n", "    import serial\n"))
    (found,) = beyond(ACCEPTED, text, own_tools(INTERFACE, "arm"), failed)
    assert "'serial'" in found.summary


def run(*lines: str) -> tuple[str, str]:
    """These lines at the beginning of what a tool of the arm does."""
    return "    import scservo_sdk\n", "".join(f"    {line}\n" for line in ("import scservo_sdk", *lines))


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (["import runtime.units as u", "u.Units.move = None"], "'u'"),
        (["from runtime import units", "units.Units.move = None"], "'units'"),
        (["x = runtime", "y = x.units", "y.Units = None"], "'y'"),
        (["if (x := runtime): x.device = None"], "'x'"),
        (["import sys", "sys.modules['server'].get_load = None"], "'modules'"),
        (["import sys", "sys._getframe(1).f_globals.clear()"], "'_getframe'"),
        (["import gc"], "'gc'"),
        (["from unittest import mock"], "'unittest'"),
        (["import builtins as b", "b.setattr(runtime, 'device', None)"], "'builtins'"),
        (["runtime.__dict__.update(device=None)"], "'__dict__'"),
        (["arm_read.__globals__['get_load'] = None"], "'__globals__'"),
        (["type.__setattr__(runtime.units.Units, 'move', None)"], "'__setattr__'"),
        (["WORDS.clear()"], "'WORDS.clear'"),
        (["words = WORDS", "words.pop('load')"], "'words.pop'"),
        (["mcp.remove_tool('get_load')"], "'mcp.remove_tool'"),
        (["import os", "os.environ['HOME'] = '/'"], "'environ'"),
        (["runtime.device('host', actuate=True)"], "'host'"),
        (["get_load()"], "'get_load'"),
    ],
)
def test_code_that_can_touch_what_is_not_the_devices_is_refused(lines: list[str], told: str) -> None:
    found = judged(run(*lines))
    assert any(f"reaches for {told}" in item for item in found), found


def test_what_a_tool_makes_of_its_own_may_be_changed() -> None:
    lines = ["port = scservo_sdk.PortHandler('x')", "port.delay = 1", "seen = {}", "seen['x'] = 1", "seen.clear()"]
    assert judged(run(*lines)) == []


def test_what_the_accepted_server_reached_for_is_no_news() -> None:
    accepted = changed(run("WORDS.clear()"))
    again = accepted.replace('"joint": joint, "sent"', '"joint": joint.strip(), "sent"')
    assert beyond(accepted, again, own_tools(INTERFACE, "arm"), DEPLOY, others(INTERFACE, "arm")) == []
