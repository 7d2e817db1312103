"""Each rule of SERVE, broken alone in a good server; what the imported server declares; and the lock."""

import inspect
import warnings

import pytest
from unit.contracts.contract_samples import READ, SCHEMAS, SERVER, artifacts, good

from octoform import runtime
from octoform.contracts.contract_check import RULES, check
from octoform.contracts.model import Artifacts
from octoform.contracts.rules.deploy_rules import deploy_installed
from octoform.contracts.rules.lock_rules import deploy_lock
from octoform.contracts.rules.serve.device_rules import RUNTIME_TOUCHES, camera_held
from octoform.contracts.rules.serve.serve_rules import serve_static
from octoform.contracts.schema_equivalence import serve_dynamic
from octoform.contracts.server_code.script_header import declared_requirements

HASH = "--hash=sha256:" + "ab" * 32
END = '\n\nif __name__ == "__main__":'

FAN = "    return int(path.read_text())"
_OTHERWISE = """\
    try:
        value = int(path.read_text())
    except OSError:
        {}"""
_LINE = """\
    import serial

    node = runtime.device("hwmon-fanboard").node("tty")
    with runtime.bus("hwmon-fanboard"), serial.{} as port:
        port.write(b"RPM?\\n")
        return int(port.readline())"""
_FRAME = _LINE.format("Serial(node, 9600, timeout=1)").replace('b"RPM?\\n"', "{}")
_SPLIT = """\
    import serial

    port = serial.Serial(runtime.device("hwmon-fanboard").node("tty"), 9600, timeout=1)
    with runtime.bus("hwmon-fanboard"):
        port.write(b"RPM?\\n")
    with runtime.bus("hwmon-fanboard"):
        return {"rpm": int(port.readline())}"""

# (code, what to replace in the good server, by what)
CASES = [
    ("SERVE-SYNTAX", "def _fan() -> int:", "def _fan( -> int:"),
    ("SERVE-SYNTAX", "def _fan() -> int:\n", "def _fan() -> int:\n    return = 1\n"),
    ("SERVE-SYNTAX", '"""The bench."""', '"""The bench.\0"""'),
    ("SERVE-TOO-LONG", END, "\n\n# more" * 500 + END),
    ("SERVE-UNESCAPED-TEXT", '"""The bench."""', '"""The \u202ebench."""'),
    ("SERVE-UNESCAPED-TEXT", "import subprocess\n", "import subprocess  # \u2066 see\n"),
    ("SERVE-HEADER", "# ///\n", "# //\n"),
    ("SERVE-HEADER", '# requires-python = ">=3.11"\n', ""),
    ("SERVE-HEADER", '"fastmcp>=4.1,<4.2"', '"fastmcp @ https://example.org/x.whl"'),
    ("SERVE-IMPORT-OCTOFORM", "import subprocess\n", "import subprocess\n\nfrom octoform import digest\n"),
    ("SERVE-IMPORT-FORM", "import runtime\n", "import runtime\nfrom . import other\n"),
    ("SERVE-IMPORT-FORM", "import runtime\n", "import runtime\nfrom math import *\n"),
    ("SERVE-IMPORT-UNDECLARED", ', "opencv-python-headless"]', "]"),
    ("SERVE-DYNAMIC-CODE", "    return int(path.read_text())", "    return eval(path.read_text())"),
    ("SERVE-DYNAMIC-CODE", "    return int(path.read_text())", "    run = __import__('os').getpid\n    return run()"),
    ("SERVE-DYNAMIC-CODE", "import subprocess\n", "import subprocess\nimport builtins as b\n\nrun = b.exec\n"),
    ("SERVE-SHELL", "subprocess.run(LAMP_STATUS, check=True, timeout=5)", 'os.system("lampctl " + str(level))'),
    ("SERVE-SHELL", '["lampctl", "--level", str(level)], check=True', 'f"lampctl {level}", shell=True'),
    ("SERVE-SHELL", '["lampctl", "--level", str(level)], check=True', '["lampctl"], shell=level > 1'),
    ("SERVE-SHELL", '["lampctl", "--level", str(level)], check=True', '["sh", "-c", str(level)]'),
    ("SERVE-SHELL", '["lampctl", "--level", str(level)], check=True', "[str(level)]"),
    ("SERVE-SHELL", '["lampctl", "--level", str(level)], check=True', "str(level).split()"),
    (
        "SERVE-UNSAFE-LOADS",
        "    return int(path.read_text())",
        "    import pickle\n    return pickle.loads(path.read_bytes())",
    ),
    ("SERVE-DEVICE-AT-IMPORT", 'mcp = FastMCP("bench")', 'mcp = FastMCP("bench")\nNAME = open("/etc/hostname").read()'),
    ("SERVE-DEVICE-AT-IMPORT", END, "\n\nFAN = _fan()" + END),
    ("SERVE-DEVICE-AT-IMPORT", END, '\n\nFAN = runtime.device("hwmon-fanboard")' + END),
    ("SERVE-DEVICE-AT-IMPORT", "def _fan() -> int:", "def _fan(at=open('/dev/null')) -> int:"),
    ("SERVE-DEVICE-AT-IMPORT", END, "\n\nsubprocess.run(LAMP_STATUS)" + END),
    ("SERVE-ACTUATE-UNBOUND", '"hwmon-fanboard", actuate=True)', '"hwmon-fanboard")'),
    ("SERVE-ACTUATE-UNBOUND", '"hwmon-fanboard", actuate=True)', '"hwmon-fanboard", actuate=False)'),
    ("SERVE-ACTUATE-UNBOUND", '"hwmon-fanboard", actuate=True)', '"hwmon-fanboard", False)'),
    ("SERVE-ACTUATE-UNBOUND", 'runtime.device("hwmon-fanboard", actuate=True).node("fan")', '"/dev/fan"'),
    (
        "SERVE-ACTUATE-UNBOUND",
        "        _drive(percent)",
        '        runtime.device("hwmon-fanboard")\n        _drive(percent)',
    ),
    ("SERVE-BUS-UNLOCKED", '    with runtime.bus("hwmon-fanboard"):\n        _drive(percent)', "    _drive(percent)"),
    (
        "SERVE-BUS-UNLOCKED",
        "    return int(path.read_text())",
        "    return len(open(runtime.device('hwmon-fanboard').node('fan')).read())",
    ),
    (
        "SERVE-BUS-UNLOCKED",
        "    return int(path.read_text())",
        "    return [open(n) for n in runtime.device('hwmon-fanboard').nodes('fan')]",
    ),
    (
        "SERVE-BUS-UNLOCKED",
        "    return int(path.read_text())",
        "    import serial\n    return serial.Serial('x', 9600, timeout=1).read()",
    ),
    ("SERVE-BUS-UNLOCKED", "    return int(path.read_text())", "    return runtime.gpio.read('chip', 1)"),
    (
        "SERVE-BUS-UNLOCKED",
        "    return int(path.read_text())",
        "    from runtime import v4l2\n    return v4l2.formats('x')",
    ),
    ("SERVE-DEVICE-AT-IMPORT", END, "\n\nHIGH = runtime.gpio.drive('chip', 1, 'high')" + END),
    (
        "SERVE-ASYNC-BLOCKS",
        END,
        "\n\nasync def r() -> None:\n    with runtime.bus('x'):\n        runtime.evdev.rumble(1, 1, 9)" + END,
    ),
    ("SERVE-CAMERA-HELD", "    finally:\n        camera.release()", "    finally:\n        pass"),
    ("SERVE-CAMERA-HELD", "    camera = cv2", "    global camera\n    camera = cv2"),
    ("SERVE-CAMERA-HELD", "    camera = cv2", "    runtime.camera = camera = cv2"),
    ("SERVE-NO-SERVER", "mcp = FastMCP", "mcp = bench = dict or FastMCP"),
    ("SERVE-TOOLS-DIFFER", '@mcp.tool(name="capture_image")', '@mcp.tool(name="capture_picture")'),
    ("SERVE-TOOLS-DIFFER", '@mcp.tool(name="capture_image")', '@mcp.tool(name="capture" + "_image")'),
    ("SERVE-TOOLS-DIFFER", "@mcp.tool\n@runtime.logged\ndef read_fan_speed", "def read_fan_speed"),
    ("SERVE-TOOL-NOT-LOGGED", "@runtime.logged\ndef read_fan_speed", "def read_fan_speed"),
    ("SERVE-TOOL-NOT-LOGGED", "@mcp.tool\n@runtime.logged\ndef read_fan", "@runtime.logged\n@mcp.tool\ndef read_fan"),
    ("SERVE-DYNAMIC-CODE", FAN, "    __import__('subprocess').run(['sync'], check=True)\n" + FAN),
    ("SERVE-LISTENS", "    mcp.run()", '    mcp.run(transport="http", port=7777)'),
    ("SERVE-LISTENS", "    mcp.run()", "    import socketserver\n    socketserver.TCPServer(('', 1), None)"),
    ("SERVE-BEYOND-TOOLS", END, "\n\n@mcp.resource('x://fan')\ndef fan() -> int:\n    return 1" + END),
    ("SERVE-BEYOND-TOOLS", END, "\n\n@mcp.prompt\ndef fan() -> str:\n    return 'move'" + END),
    ("SERVE-BEYOND-TOOLS", END, "\n\nserver = mcp" + END),
    ("SERVE-BEYOND-TOOLS", END, "\n\ngetattr(mcp, 'resource')('x://fan')(_fan)" + END),
    ("SERVE-BEYOND-TOOLS", END, "\n\nmcp._mcp_server.middleware.clear()" + END),
    ("SERVE-BEYOND-TOOLS", 'FastMCP("bench")', 'FastMCP("bench", middleware=[])'),
    ("SERVE-BEYOND-TOOLS", 'FastMCP("bench")', 'FastMCP("bench", **{"providers": []})'),
    ("SERVE-ASYNC-BLOCKS", END, "\n\nasync def rest() -> None:\n    import time\n    time.sleep(9)" + END),
    ("SERVE-ASYNC-BLOCKS", END, "\n\nasync def rest() -> None:\n    subprocess.run(['lampctl'])" + END),
    (
        "SERVE-ASYNC-BLOCKS",
        END,
        "\n\ndef inner() -> None:\n    import time as t\n    t.sleep(9)"
        "\n\n\ndef outer() -> None:\n    inner()"
        "\n\n\nasync def rest() -> None:\n    outer()" + END,
    ),
    ("SERVE-NOT-IMPLEMENTED", FAN, "    raise NotImplementedError"),
    ("SERVE-NOT-IMPLEMENTED", FAN, "    with runtime.bus('hwmon-fanboard'):\n        raise RuntimeError('later')"),
    ("SERVE-NOT-IMPLEMENTED", '    return {"rpm": _fan()}', "    pass"),
    ("SERVE-NOT-IMPLEMENTED", FAN, "    if 1:\n        raise OSError\n    else:\n        raise ValueError"),
    ("SERVE-DEVICE-NOT-ASKED", '    return {"rpm": _fan()}', '    return {"rpm": 900}'),
    ("SERVE-DEVICE-NOT-ASKED", 'runtime.device("hwmon-fanboard").path', 'runtime.device("hwmon-otherboard").path'),
    (
        "SERVE-DEVICE-NOT-ASKED",
        'runtime.device("hwmon-fanboard").path("hwmon") / "fan1_input"',
        'Path(runtime.device("hwmon-fanboard").id)',
    ),
    ("SERVE-DEVICE-NOT-ASKED", '    return {"rpm": _fan()}', '    return {"rpm": len(platform.node())}'),
    ("SERVE-LITERAL-PLACE", 'runtime.device("usb-1234-0001").node("video4linux")', "0"),
    ("SERVE-LITERAL-PLACE", FAN, "    return int(open('/sys/class/hwmon/hwmon0/fan1_input').read())"),
    ("SERVE-LITERAL-PLACE", 'mcp = FastMCP("bench")', 'mcp = FastMCP("bench")\nNODE = "/dev/video0"'),
    ("SERVE-LITERAL-PLACE", FAN, "    return len(f'/dev/video{path}')"),
    ("SERVE-READ-WRITES", FAN, "    path.write_text('255')\n    return int(path.read_text())"),
    ("SERVE-READ-WRITES", FAN, "    open(path, 'w').write('255')\n    return int(path.read_text())"),
    ("SERVE-READ-WRITES", FAN, "    path.open(mode='a').close()\n    return int(path.read_text())"),
    ("SERVE-READ-WRITES", FAN, "    path.unlink()\n    return 1"),
    ("SERVE-READ-ACTS", FAN, "    runtime.device('hwmon-fanboard', actuate=True)\n" + FAN),
    ("SERVE-READ-ACTS", FAN, "    move = runtime.units.Units(path).move\n    move('fan', 1)\n" + FAN),
    ("SERVE-DEFAULT-READING", FAN, _OTHERWISE.format("return 0")),
    ("SERVE-DEFAULT-READING", FAN, _OTHERWISE.format("return dict(rpm=0)")),
    ("SERVE-DEFAULT-READING", FAN, _OTHERWISE.format("value = -1") + "\n    return value"),
    ("SERVE-DEFAULT-READING", FAN, "    value = 0\n" + _OTHERWISE.format("pass") + "\n    return value"),
    ("SERVE-DEFAULT-READING", FAN, "    return int(runtime.read_number(path) or 0)"),
    (
        "SERVE-DEFAULT-READING",
        FAN,
        "    value = runtime.read_number(path)\n    return 0 if value is None else int(value)",
    ),
    (
        "SERVE-DEFAULT-READING",
        FAN,
        "    value = runtime.read_number(path)\n    if value is None:\n        return 0\n    return int(value)",
    ),
    ("SERVE-EXCHANGE-SPLIT", '    return {"rpm": _fan()}', _SPLIT),
    ("SERVE-CAMERA-IN-SERVER", "runtime.child.call(_picture, width)", "_picture(width)"),
    ("SERVE-CAMERA-IN-SERVER", "import subprocess\n", "import subprocess\n\nimport cv2\n"),
    ("SERVE-CAMERA-IN-SERVER", "import subprocess\n", "import subprocess\nfrom cv2 import VideoCapture\n"),
    ("SERVE-CAMERA-NOT-FLUSHED", "[camera.read()[0] for _ in range(5)][-1]", "camera.read()[0]"),
    (
        "SERVE-CAMERA-HELD",
        "    try:\n        return",
        "    KEPT[width] = camera\n    try:\n        return",
    ),
    (
        "SERVE-CAMERA-HELD",
        "    try:\n        return",
        "    KEPT.append(camera)\n    try:\n        return",
    ),
    ("SERVE-LINE-SPEED", FAN, _LINE.format("Serial(node, timeout=1)")),
    ("SERVE-LINE-SPEED", FAN, _LINE.format("Serial(port=node, timeout=1)")),
    ("SERVE-LINE-WAIT", FAN, _LINE.format("Serial(node, 9600)")),
    ("SERVE-FRAME-BY-HAND", FAN, _FRAME.format("bytes([255, 255, 1])")),
    ("SERVE-FRAME-BY-HAND", FAN, _FRAME.format("b'\\xff\\xff' + b'A'")),
    ("SERVE-FRAME-BY-HAND", FAN, _FRAME.format("struct.pack('<BB', 255, 1)")),
    ("SERVE-PRINTS", "def _fan() -> int:\n", "def _fan() -> int:\n    print('fan')\n"),
    ("SERVE-ENDS-PROCESS", "def _fan() -> int:\n", "def _fan() -> int:\n    if not FANS:\n        quit()\n"),
    ("SERVE-MODULE-CHANGED", "def _fan() -> int:\n", "def _fan() -> int:\n    runtime.files = list\n"),
    ("SERVE-WAIT-TOO-LONG", "def _fan() -> int:\n", "def _fan() -> int:\n    time.sleep(61)\n"),
]
ALSO = {
    "SERVE-CAMERA-HELD": {"SERVE-MODULE-CHANGED"},  # one is kept in the runtime itself
    "SERVE-EXCHANGE-SPLIT": {"SERVE-BUS-UNLOCKED"},
    # They return a number of their own and nothing else.
    "SERVE-DYNAMIC-CODE": {"SERVE-DEVICE-NOT-ASKED"},
    "SERVE-READ-WRITES": {"SERVE-DEVICE-NOT-ASKED"},
    "SERVE-DEFAULT-READING": {"SERVE-DEVICE-NOT-ASKED"},
    "SERVE-ACTUATE-UNBOUND": {"SERVE-DEVICE-NOT-ASKED", "SERVE-LITERAL-PLACE"},
    "SERVE-NO-SERVER": {"SERVE-TOOLS-DIFFER"},
    "SERVE-HEADER": {"SERVE-IMPORT-UNDECLARED"},
}


def _codes(text: str) -> set[str]:
    return {item.code for item in serve_static(text, good("interface"))}


@pytest.mark.parametrize(("code", "old", "new"), CASES, ids=range(len(CASES)))
def test_a_broken_server_gets_exactly_its_code(code: str, old: str, new: str) -> None:
    assert SERVER.count(old) == 1
    text = SERVER.replace(old, new)
    if "os.system" in new:
        text = text.replace("import subprocess\n", "import os\nimport subprocess\n")
    if "import serial" in new:
        text = text.replace('"opencv-python-headless"', '"opencv-python-headless", "pyserial"')
    assert _codes(text) - ALSO.get(code, set()) == {code}


def test_blank_lines_and_classes_of_results_make_no_server_too_long() -> None:
    members = "".join(f"    member_{number}: int\n" for number in range(300))
    listed = f'@dataclass\nclass Many:\n    """What many registers hold."""\n\n{members}'
    typed = f'class Some(TypedDict):\n    """The same as a dictionary."""\n\n{members}'
    imports = "from dataclasses import dataclass\nfrom typing import TypedDict\n\nimport subprocess\n"
    long = SERVER.replace("import subprocess\n", imports).replace(END, "\n" * 600 + f"\n\n{listed}\n\n{typed}" + END)
    assert len(long.splitlines()) > 1200 and _codes(long) == set()
    constants = "".join(f"NUMBER_{number} = {number}\n" for number in range(500))
    assert _codes(long.replace(listed, constants)) == {"SERVE-TOO-LONG"}


def test_whatever_the_runtime_does_to_a_device_counts_as_reaching_it() -> None:
    harmless = {"runtime.nmea.degrees", "runtime.nmea.number", "runtime.v4l2.is_node"}
    modules = (runtime.evdev, runtime.gpio, runtime.nmea, runtime.v4l2)
    public = {
        f"runtime.{module.__name__.rpartition('.')[2]}.{name}"
        for module in modules
        for name, one in vars(module).items()
        if inspect.isfunction(one) and one.__module__ == module.__name__ and not name.startswith("_")
    }
    assert public - harmless == RUNTIME_TOUCHES


def test_a_passthrough_tool_is_refused_even_if_interface_let_it_in() -> None:
    interface = good("interface")
    interface["tools"][1]["name"] = "send_serial_command"
    text = SERVER.replace("def read_fan_speed", "def send_serial_command")
    assert {item.code for item in serve_static(text, interface)} == {"SERVE-PASSTHROUGH"}


def test_what_python_warns_of_in_a_server_is_not_printed() -> None:
    with warnings.catch_warnings(record=True) as printed:
        warnings.simplefilter("always")
        assert serve_static(SERVER + "\nUNUSED = 1 is 1\n", good("interface")) == []
    assert printed == []


def test_every_rule_of_serve_has_a_case() -> None:
    assert {rule.code for rule in RULES["serve"]} == {code for code, _, _ in CASES} | {
        "SERVE-LINE-WRITTEN",
        "SERVE-PASSTHROUGH",
        "SERVE-CONSTANT-READING",
        # in support/novel_servers
        *("SERVE-SETS-NOTHING", "SERVE-ARGUMENT-UNUSED", "SERVE-ACTS-LATER", "SERVE-FAILURE-HIDDEN"),
        *("SERVE-ARGUMENTS-CROSSED", "SERVE-ARGUMENT-CUT"),
        *("SERVE-SET-ECHOED", "SERVE-SETS-OTHERWISE", "SERVE-READING-COARSE", "SERVE-READING-OTHERWISE"),
        # in test_failing_servers
        "SERVE-DESCRIPTION-DIFFERS",
        # in test_profile_servers
        "SERVE-PROFILE-CONTRADICTED",
        # in integration/test_returns
        "SERVE-INTERFACE-WRONG",
    }


def test_a_diagnostic_has_line_column_and_source() -> None:
    text = SERVER.replace("def _fan() -> int:\n", "def _fan() -> int:\n    é = print('fan')\n")
    [found] = check("serve", text, artifacts(), SCHEMAS, path="serve/server.py")
    assert found.span is not None and found.source == "    é = print('fan')"
    assert found.source[found.span.column - 1 : (found.span.end_column or 0) - 1] == "print('fan')"
    assert found.path == "serve/server.py"
    assert text.splitlines()[found.span.line - 1] == found.source


GOOD_VARIANTS = [
    (END, "\n\n\n\nclass Row:" + "\n    member: int\n" * 500 + END),
    # the lock taken by every caller of a helper, and by a context manager around the device
    ("        _drive(percent)", "        for _ in range(2):\n            _drive(percent)"),
    (
        '    with runtime.bus("hwmon-fanboard"):',
        "    with runtime.bus(\"hwmon-fanboard\"), open(runtime.device('hwmon-fanboard', True).node('fan')) as _:",
    ),
    ("import runtime\n", "import runtime\nfrom runtime import bus\n"),
    ("@mcp.tool\n@runtime.logged\ndef read_fan_speed", "@mcp.tool\n@runtime.logged()\ndef read_fan_speed"),
    ("def _fan() -> int:\n", "def _fan() -> int:\n    import sys\n    print('fan', file=sys.stderr)\n"),
    ("    camera = cv2.VideoCapture(", "    camera = cv2.VideoCapture(*[0][:0], "),
    ("def _fan() -> int:", "def compile() -> int:\n    return 1\n\n\ndef _fan() -> int:"),
    (END, "\n\nasync def rest() -> None:\n    import asyncio\n    await asyncio.sleep(9)" + END),
    (END, "\n\nasync def rest() -> None:\n    import asyncio, time\n    await asyncio.to_thread(time.sleep, 9)" + END),
    (
        END,
        "\n\nasync def rest() -> None:\n    import asyncio, time"
        "\n    await asyncio.to_thread(lambda: time.sleep(9))\n\n    def later() -> None:\n        time.sleep(9)"
        "\n\n    await asyncio.to_thread(later)" + END,
    ),
    ('FastMCP("bench")', 'FastMCP("bench", instructions="Look before you move.")'),
    ("    return int(path.read_text())", "    import re\n    return len(re.compile('x').findall(path.read_text()))"),
]


@pytest.mark.parametrize(("old", "new"), GOOD_VARIANTS, ids=range(len(GOOD_VARIANTS)))
def test_other_good_ways_to_write_it_pass(old: str, new: str) -> None:
    assert SERVER.count(old) == 1
    assert serve_static(SERVER.replace(old, new), good("interface")) == []


MANAGER = """
@contextlib.contextmanager
def opened(name: str):
    unit = runtime.device(name)
    with runtime.bus(unit):
        yield unit
"""


def _with_manager(manager: str) -> str:
    text = SERVER.replace("import subprocess\n", "import contextlib\nimport subprocess\n")
    text = text.replace('mcp = FastMCP("bench")\n', f'mcp = FastMCP("bench")\n\n{manager}')
    return text.replace('with runtime.bus("hwmon-fanboard"):', 'with opened("hwmon-fanboard"):')


def test_a_context_manager_of_the_file_may_hold_the_lock() -> None:
    assert serve_static(_with_manager(MANAGER), good("interface")) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("        yield unit", "        pass\n    yield unit"),
        ("    with runtime.bus(unit):", "    with contextlib.suppress(OSError):"),
        ("        yield unit", "        yield unit\n    yield None"),
    ],
)
def test_a_context_manager_that_yields_without_the_lock_does_not(old: str, new: str) -> None:
    found = serve_static(_with_manager(MANAGER.replace(old, new)), good("interface"))
    assert {item.code for item in found} == {"SERVE-BUS-UNLOCKED"}


def test_the_header_is_read() -> None:
    assert declared_requirements(SERVER) == ("fastmcp>=4.1,<4.2", "opencv-python-headless")
    assert declared_requirements("print(1)") == ()


def _report() -> dict[str, object]:
    lines = ("name", "input_schema", "output_schema", "annotations")
    tools = [{key: tool[key] for key in lines if key in tool} for tool in good("interface")["tools"]]
    return {"tools": tools, "violations": [], "error": None}


def test_the_imported_tools_are_those_of_interface() -> None:
    assert serve_dynamic(_report(), good("interface")) == []
    report = _report()
    tools = report["tools"]
    assert isinstance(tools, list)
    tools[0]["name"] = "capture_picture"
    found = serve_dynamic(report, good("interface"))
    assert [item.code for item in found] == ["SERVE-TOOLS-DIFFER"] * 2


def test_an_imported_schema_or_annotation_that_differs_is_told_line_by_line() -> None:
    report = _report()
    tools = report["tools"]
    assert isinstance(tools, list)
    tools[0]["input_schema"] = {"type": "object", "properties": {"width": {"type": "integer", "minimum": 1}}}
    tools[2]["annotations"] = None
    tools[1]["annotations"] = {**READ, "title": "Fan"}
    schema, annotations = serve_dynamic(report, good("interface"))
    assert (schema.code, annotations.code) == ("SERVE-SCHEMA-DIFFERS", "SERVE-ANNOTATIONS-DIFFER")
    assert schema.detail is not None and "properties.width.maximum: 4096 promised, nothing found" in schema.detail
    assert annotations.detail is not None and "readOnlyHint: false promised, nothing found" in annotations.detail


LOCK = f"""# made by the resolver
fastmcp==4.1.2 \\
    {HASH} \\
    {HASH.replace("ab", "cd")}
    # via -r requirements.in
opencv-python-headless==4.10.0.84 ; python_version >= '3.9' \\
    {HASH}
"""
LOCK_CASES = [
    ("DEPLOY-LOCK-UNPINNED", f"extra>=1 {HASH}\n"),
    ("DEPLOY-LOCK-UNPINNED", f"extra==1.* {HASH}\n"),
    ("DEPLOY-LOCK-NO-HASH", "extra==1.0\n"),
    ("DEPLOY-LOCK-NO-HASH", "extra==1.0 --hash=md5:abcd\n"),
    ("DEPLOY-LOCK-URL", f"extra @ https://example.org/extra.whl {HASH}\n"),
    ("DEPLOY-LOCK-URL", "git+https://example.org/extra\n"),
    ("DEPLOY-LOCK-URL", "./extra.whl\n"),
    ("DEPLOY-LOCK-URL", "-e ./extra\n"),
    ("DEPLOY-LOCK-INDEX", "--index-url https://example.org/simple\n"),
    ("DEPLOY-LOCK-INDEX", "--extra-index-url=https://example.org/simple\n"),
    ("DEPLOY-LOCK-INDEX", "--find-links ./wheels\n"),
]


def test_a_good_lock_is_accepted() -> None:
    assert deploy_lock(LOCK, good("deploy")) == []
    assert deploy_lock(LOCK.replace("fastmcp==", "FastMCP[all]=="), good("deploy")) == []


@pytest.mark.parametrize(("code", "line"), LOCK_CASES)
def test_a_bad_line_in_a_lock_gets_exactly_its_code(code: str, line: str) -> None:
    [found] = deploy_lock(LOCK + line, good("deploy"), "requirements.txt")
    assert (found.code, found.span and found.span.line) == (code, 8)


def test_a_lock_has_every_requirement_in_its_version() -> None:
    for text in (LOCK.replace("4.1.2", "4.1.1"), LOCK.replace("fastmcp", "slowmcp")):
        [found] = deploy_lock(text, good("deploy"))
        assert found.code == "DEPLOY-LOCK-MISSING" and "4.1.2" in found.summary


NEEDS = {"fastmcp": {"fastmcp-slim"}, "opencv-python-headless": {"numpy"}}
PROVIDERS = {"fastmcp": {"fastmcp-slim"}, "cv2": {"opencv-python-headless"}, "numpy": {"numpy"}, "leftpad": {"leftpad"}}


def test_what_was_installed_is_held_against_what_deploy_says() -> None:
    assert deploy_installed(good("deploy"), SERVER, PROVIDERS, NEEDS) == []
    value = good("deploy")
    value["imports"][1]["provided_by"] = "fastmcp"
    value["requirements"] += [{"name": name, "version": "1.0", "why": "useful"} for name in ("leftpad", "numpy")]
    provider, unused = deploy_installed(value, SERVER, PROVIDERS, NEEDS)
    assert provider.code == "DEPLOY-IMPORT-PROVIDER" and "it comes from 'opencv-python-headless'" in provider.summary
    assert unused.code == "DEPLOY-REQUIREMENT-UNUSED" and "'leftpad'" in unused.summary
    assert unused.pointer == "/requirements/2"


def test_what_its_author_declares_may_be_there_without_an_import() -> None:
    server = SERVER.replace('"opencv-python-headless"]', '"opencv-python-headless", "leftpad"]')
    value = good("deploy")
    value["requirements"].append({"name": "leftpad", "version": "1.0", "why": "a plug-in"})
    assert deploy_installed(value, server, PROVIDERS, NEEDS) == []


@pytest.mark.parametrize(
    ("opened", "held"),
    [
        ("with contextlib.closing(Device(node)) as camera:\n        yield VideoCapture(camera, size=4)", False),
        ("with Device(node) as camera, VideoCapture(camera) as frames:\n        yield frames", False),
        ("camera = Device(node)\n    yield VideoCapture(camera)", True),
        ("with runtime.bus(node) as lock:\n        camera = Device(node)\n        yield VideoCapture(camera)", True),
    ],
)
def test_a_capture_ends_with_the_device_that_it_is_made_of(opened: str, held: bool) -> None:
    text = f"import contextlib\n\n\ndef opened(node):\n    {opened}\n"
    assert [item.code for item in camera_held(text, Artifacts())] == (["SERVE-CAMERA-HELD"] if held else [])
