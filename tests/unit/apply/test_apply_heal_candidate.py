"""A repair mends the functions that it names and nothing else, and takes no protection away."""

import pytest

from octoform.apply.rewrite.review import Reach, lost, objections, reach_of
from octoform.contracts.server_code.server_source import needed_source

SERVER = '''\
"""A bench."""

# /// script
# requires-python = ">=3.11"
# dependencies = ["fastmcp>=4.1,<4.2"]
# ///

import runtime
from fastmcp import FastMCP

mcp = FastMCP("bench")
FACTOR = 10


def shared(value: int) -> int:
    return value * 2


def _move(position: int) -> int:
    """Own to the servo."""
    if not 0 <= position <= 180:
        raise ValueError("no such position")
    with runtime.bus("servo"):
        return runtime.ask(min(position, 170), timeout=2.0)


def servo_move(position: int) -> int:
    """Move it."""
    position = position if position > 20 else 20
    return _move(position) * FACTOR + shared(1)


def lamp_switch(on: bool) -> int:
    """Switch it."""
    return shared(on)


mcp.tool(runtime.logged(servo_move))
mcp.tool(runtime.logged(lamp_switch))
'''
INTERFACE = {
    "tools": [
        {"name": "servo_move", "devices": ["servo"]},
        {"name": "lamp_switch", "devices": ["lamp"]},
    ]
}
DEPLOY = {"imports": [{"module": "fastmcp", "provided_by": "fastmcp"}]}
REACH = reach_of(SERVER, INTERFACE, "servo_move", None)
RIGHT = "def _right(position: int) -> int:\n    return _move(position)\n\n\n"
BOTH = frozenset({"_move", "servo_move"})


def judged(*changes: tuple[str, str], named: frozenset[str] = BOTH) -> list[tuple[str, str]]:
    text = SERVER
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return [(item.code, item.summary) for item in objections(SERVER, text, REACH, named, DEPLOY)]


def test_a_repair_may_touch_the_functions_that_are_the_tools_alone() -> None:
    assert Reach(frozenset({"servo_move"}), ("_move", "servo_move"), frozenset({"lamp"})) == REACH
    assert reach_of(SERVER, INTERFACE, None, "lamp").functions == ("lamp_switch",)
    assert reach_of(SERVER, INTERFACE, "none_such", None).functions == ()
    assert reach_of(SERVER, INTERFACE, None, None).tools == frozenset()


@pytest.mark.parametrize(
    "changes",
    [
        [("_move(position) * FACTOR", "_move(position) * 10")],
        [("runtime.ask(min", "runtime.tell(min")],
        [("    return _move(position)", "    return _right(position)"), ("def servo_move", f"{RIGHT}def servo_move")],
    ],
    ids=["its own function", "what only it uses", "a new function of its own"],
)
def test_a_repair_within_its_functions_is_accepted(changes: list[tuple[str, str]]) -> None:
    assert judged(*changes) == []


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("return value * 2", "return value * 3"), "changes 'shared'"),
        (("return shared(on)", "return shared(not on)"), "changes 'lamp_switch'"),
        (("FACTOR = 10", "FACTOR = 20"), "FACTOR"),
        (("mcp.tool(runtime.logged(lamp_switch))\n", ""), "no longer has the statement"),
        (("mcp.tool(runtime.logged(servo_move))\n", ""), "no longer has 'servo_move'"),
        (('FastMCP("bench")', 'FastMCP("other")'), "changes 'mcp'"),
        (("import runtime\n", "import runtime\nimport os\n"), "imports 'os'"),
        (("    return _move(position)", "    import socket\n    return _move(position)"), "imports 'socket'"),
        (("    return _move(position)", '    open("/etc/shadow")\n    return _move(position)'), "opens something new"),
        (("    return _move(position)", "    globals()\n    return _move(position)"), "globals"),
        (("    return _move(position)", "    lamp_switch(True)\n    return _move(position)"), "lamp_switch"),
        (('"""Move it."""', '"""Move it anywhere."""'), "what 'servo_move' takes"),
        (("def servo_move(position: int)", "def servo_move(position: float)"), "what 'servo_move' takes"),
        (("def servo_move(position: int)", "def servo_move(position: int = 5)"), "what 'servo_move' takes"),
        (('"fastmcp>=4.1,<4.2"', '"fastmcp>=4.1,<4.2", "evil"'), "header"),
    ],
)
def test_what_goes_beyond_is_refused_by_name(change: tuple[str, str], told: str) -> None:
    found = judged(change)
    assert found and {code for code, _ in found} == {"HEAL-BEYOND"}
    assert any(told in summary for _, summary in found), found


def test_a_function_that_is_changed_is_named() -> None:
    (found,) = judged(("runtime.ask(min", "runtime.tell(min"), named=frozenset({"servo_move"}))
    assert found == ("HEAL-BEYOND", "the rewritten server changes '_move' and does not name it")


@pytest.mark.parametrize(
    "change",
    [
        ("position <= 180", "position <= 360"),
        ("if not 0 <= position <= 180:", "if not 0 <= position <= 180 and False:"),
        ('        raise ValueError("no such position")', "        pass"),
        ('    if not 0 <= position <= 180:\n        raise ValueError("no such position")\n', ""),
        ("position > 20", "position > 2"),
        ("min(position, 170)", "position"),
        ("min(position, 170)", "min(position, 270)"),
        ("timeout=2.0", "timeout=20.0"),
        (", timeout=2.0", ""),
        ('    with runtime.bus("servo"):\n        return', "    return"),
        ('with runtime.bus("servo")', 'with runtime.bus("another")'),
    ],
)
def test_a_protection_that_is_gone_or_weaker_is_refused(change: tuple[str, str]) -> None:
    assert "HEAL-WEAKENS" in {code for code, _ in judged(change)}


def test_an_error_that_is_swallowed_is_refused() -> None:
    whole = "        return runtime.ask(min(position, 170), timeout=2.0)\n"
    caught = f"        try:\n    {whole}        except OSError:\n            return 0\n"
    assert {code for code, _ in judged((whole, caught))} == {"HEAL-WEAKENS", "HEAL-INVENTS"}
    text = f"        try:\n    {whole}        except OSError as why:\n            raise ValueError() from why\n"
    assert judged((whole, text)) == []


def test_what_is_read_no_more_or_never_was_is_refused() -> None:
    assert "HEAL-READS-LESS" in {code for code, _ in judged(("_move(position) * FACTOR", "position * FACTOR"))}
    assert "HEAL-INVENTS" in {code for code, _ in judged(("return _move(position) * FACTOR + shared(1)", "return 7"))}


def test_more_protection_is_none_that_is_lost() -> None:
    before = needed_source("def f(x):\n    return x\n").tree.body
    after = needed_source("def f(x):\n    if x > 3:\n        raise ValueError\n    return min(x, 3)\n").tree.body
    assert lost(before, after) == []
    assert [item.code for item in lost(after, before)] == ["HEAL-WEAKENS"]
