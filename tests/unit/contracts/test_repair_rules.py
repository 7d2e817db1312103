"""What a rewrite may not stop doing: the honest repairs pass, and each way to silence a tool is refused."""

import pytest

from octoform.contracts.rules.heal_rules import bereft

SERVER = '''
"""A server."""
HOTTEST = 60

def _read(bus, unit):
    position = bus.read2(unit, 56)
    heat = bus.read1(unit, 62)
    return position, heat

def _check(heat):
    if heat >= HOTTEST:
        raise runtime.DeviceFault("arm", f"{str(heat)} is too hot")

def read_joint(unit):
    with runtime.bus("arm"):
        bus = open_bus(runtime.device("arm").node("tty"))
        position, heat = _read(bus, unit)
        _check(heat)
        return {"position": position, "heat": heat}

def grab(camera):
    ok, frame = camera.read()
    if not ok:
        raise ToolError("no frame")
    return pictures.encodeBytes(frame)

def ask(line):
    line.write(b"?")
    return int(line.readline().decode())
'''


def codes(old: str, new: str, *functions: str) -> list[str]:
    assert old in SERVER
    rewritten = SERVER.replace(old, new)
    compile(rewritten, "server.py", "exec")
    return [item.code for item in bereft(SERVER, rewritten, functions)]


@pytest.mark.parametrize(
    ("old", "new", "function"),
    [
        ("bus.read1(unit, 62)", "bus.read1(unit, 63)", "_read"),
        ("    return pictures.encodeBytes(frame)", "    data = pictures.encode(frame)\n    return bytes(data)", "grab"),
        ("    return pictures.encodeBytes(frame)", "    return pictures.encode(frame)", "grab"),
        (
            "    return position, heat",
            "    return position, _degrees(heat)\n\ndef _degrees(raw):\n    return raw",
            "_read",
        ),
        ("int(line.readline().decode())", "int(line.readline().decode('ascii', 'replace'))", "ask"),
    ],
    ids=["an address", "another name and shape", "another name", "a new function", "an argument"],
)
def test_an_honest_repair_passes(old: str, new: str, function: str) -> None:
    assert codes(old, new, function) == []


@pytest.mark.parametrize(
    ("old", "new", "function", "code"),
    [
        ("        _check(heat)\n", "", "read_joint", "HEAL-READS-LESS"),
        ("    with runtime.bus('arm'):".replace("'", '"'), "    if True:", "read_joint", "HEAL-READS-LESS"),
        ("heat = bus.read1(unit, 62)", "heat = 30", "_read", "HEAL-INVENTS"),
        (
            "    heat = bus.read1(unit, 62)\n    return position, heat",
            "    return position, 30",
            "_read",
            "HEAL-READS-LESS",
        ),
        ("    return int(line.readline().decode())", "    return 0", "ask", "HEAL-INVENTS"),
        (
            "    return int(line.readline().decode())",
            "    try:\n        return int(line.readline().decode())\n    except ValueError:\n        return 0",
            "ask",
            "HEAL-INVENTS",
        ),
        (
            'return {"position": position, "heat": heat}',
            'return {"position": 0, "heat": 30}',
            "read_joint",
            "HEAL-INVENTS",
        ),
        ("    return pictures.encodeBytes(frame)", '    return b""', "grab", "HEAL-INVENTS"),
    ],
)
def test_a_way_to_silence_a_tool_is_refused(old: str, new: str, function: str, code: str) -> None:
    assert code in codes(old, new, function)


@pytest.mark.parametrize(
    ("old", "new", "function", "code"),
    [
        (
            '        _check(heat)\n        return {"position": position, "heat": heat}',
            '        return {"position": position, "heat": heat}\n        _check(heat)',
            "read_joint",
            "HEAL-READS-LESS",
        ),
        (
            "    ok, frame = camera.read()",
            "    for _ in range(50):\n        ok, frame = camera.read()\n        if ok:\n            break",
            "grab",
            "HEAL-HIDES",
        ),
        ("if heat >= HOTTEST:", "if heat > 100:\n        return\n    if heat >= HOTTEST:", "_check", "HEAL-HIDES"),
        ('    line.write(b"?")', '    for _ in range(20):\n        line.write(b"?")', "ask", "HEAL-HIDES"),
        (
            "        _check(heat)\n",
            "        if unit != 'elbow':\n            _check(heat)\n",
            "read_joint",
            "HEAL-READS-LESS",
        ),
        ("line.readline().decode()", "line.readline().decode() or 0", "ask", "HEAL-INVENTS"),
        ("    line.write", "    time.sleep(30)\n    line.write", "ask", "HEAL-HIDES"),
        ("line.readline()", "line.readline(timeout=60)", "ask", "HEAL-HIDES"),
        (
            "    return position, heat",
            "    global LAST\n    LAST = (position, heat)\n    return LAST",
            "_read",
            "HEAL-HIDES",
        ),
    ],
)
def test_a_way_to_hide_a_failure_is_refused(old: str, new: str, function: str, code: str) -> None:
    assert code in codes(old, new, function)


@pytest.mark.parametrize(
    ("old", "new", "function"),
    [
        ("if heat >= HOTTEST:", "if int(heat) >= HOTTEST:", "_check"),
        (
            "if heat >= HOTTEST:",
            "if heat is None:\n        raise ToolError('no heat')\n    if heat >= HOTTEST:",
            "_check",
        ),
        ("    if not ok:", "    if ok is False:", "grab"),
        ("        _check(heat)\n", "        for each in [heat]:\n            _check(each)\n", "read_joint"),
        ("    if not ok:", "    if not ok or frame is None:", "grab"),
        ('line.write(b"?")', 'for part in (b"T", b"?"):\n        pass\n    line.write(b"T?")', "ask"),
        (
            "    ok, frame = camera.read()",
            "    for _ in range(5):\n        camera.grab()\n    ok, frame = camera.read()",
            "grab",
        ),
        ('line.write(b"?")', 'line.write(b"T?")', "ask"),
        (
            "    return int(line.readline().decode())",
            "    try:\n        return int(line.readline().decode())\n    except ValueError as problem:\n"
            "        raise ToolError('no number') from problem",
            "ask",
        ),
    ],
)
def test_an_honest_repair_in_unusual_form_passes(old: str, new: str, function: str) -> None:
    assert codes(old, new, function) == []


def test_a_function_that_is_not_named_is_not_looked_at() -> None:
    assert codes("heat = bus.read1(unit, 62)", "heat = 30", "grab") == []


def test_a_constant_that_was_there_before_is_none_of_the_repair() -> None:
    old = SERVER.replace("    return pictures.encodeBytes(frame)", "    return True")
    assert bereft(old, old.replace("no frame", "there is no frame"), ["grab"]) == []
