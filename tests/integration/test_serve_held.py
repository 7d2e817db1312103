"""SERVE of an agent that gets it wrong: each attempt is refused, with a finding that names the right value.

And of one that writes right things in other words: context managers, models, classes, helpers of its own.
"""

import ast
import re
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest
from bench_host import outputs, watched, written
from cases import for_each
from held import Edit, Output, refusals
from server_edits import ASK, ASKED, CAMERA, FILE, FLUSHED, WHOLE, adds, all_of, body, line, read_by, swap, uses, warm

from octoform.builtin.probe import probe_root
from octoform.contracts.model import Artifacts
from octoform.contracts.rules.serve.serve_rules import serve_static

pytestmark = pytest.mark.dear

CAMERAS, SERIAL = "opencv-python-headless", "pyserial"

# what is wrong -> (edit, code, words of the finding)
WRONG: dict[str, tuple[Edit, str, str]] = {
    "raises that it is not implemented": (
        body("read_temperature", 'raise ToolError("not implemented yet")'),
        "SERVE-NOT-IMPLEMENTED",
        "left_out",
    ),
    "raises under the lock": (
        body("read_storage", "with runtime.bus(device):\n    raise NotImplementedError"),
        "SERVE-NOT-IMPLEMENTED",
        "read_storage",
    ),
    "has an empty body": (body("read_led", "pass"), "SERVE-NOT-IMPLEMENTED", "read_led"),
    "leaves the work to a helper that raises": (
        all_of(body("read_led", "return later(device)"), adds('def later(name):\n    raise ToolError("later")')),
        "SERVE-NOT-IMPLEMENTED",
        "read_led",
    ),
    "returns a constant": (body("read_temperature", warm("21.5")), "SERVE-DEVICE-NOT-ASKED", "never asks"),
    "asks for its device and returns a constant": (
        body("read_temperature", f"{ASKED}\n{warm('21.5')}"),
        "SERVE-DEVICE-NOT-ASKED",
        "takes nothing",
    ),
    "holds the lock and returns a constant": (
        body("read_temperature", f"with runtime.bus(device):\n    {warm('21.5')}"),
        "SERVE-DEVICE-NOT-ASKED",
        "never asks",
    ),
    "reads something of the process": (
        all_of(uses("os"), body("read_temperature", warm("os.getloadavg()[0]"))),
        "SERVE-DEVICE-NOT-ASKED",
        "never asks",
    ),
    "asks for a device of another tool": (
        read_by("value = runtime.read_number(runtime.device('leds-bench-green').path('leds') / 'brightness')"),
        "SERVE-DEVICE-NOT-ASKED",
        "leds-bench-green",
    ),
    "asks for the first of two whichever is named": (
        body(
            "read_brightness",
            """
            folder = runtime.device("backlight-panel").path("backlight")
            level = int((folder / "brightness").read_text())
            return Lights(device=device, lights=[Light(name="panel", percent=level, level=level, maximum=100)])
            """,
        ),
        "SERVE-DEVICE-NOT-ASKED",
        "backlight-panel2",
    ),
    "reads from a place of its own": (
        read_by(f"{ASKED}.path('hwmon')\nvalue = float(Path('/sys/class/hwmon/hwmon0/temp1_input').read_text())"),
        "SERVE-LITERAL-PLACE",
        ".path(class)",
    ),
    "puts a place together": (
        read_by(f"{ASKED}.path('hwmon')\nvalue = float(open(f'/sys/class/hwmon/{{device}}/temp1_input').read())"),
        "SERVE-LITERAL-PLACE",
        "/sys/class/hwmon",
    ),
    "keeps places in a table": (
        adds('NODES = {"usb-1f00-00c1": "/dev/video0"}'),
        "SERVE-LITERAL-PLACE",
        ".node(class)",
    ),
    "opens the first camera": (
        body("capture_image", CAMERA.format("", FLUSHED).replace('runtime.device(device).node("video4linux")', "0")),
        "SERVE-LITERAL-PLACE",
        "camera number 0",
    ),
    "opens an attribute to write": (
        read_by(f"path = {FILE}\nopen(path, 'w').write('1')\nvalue = float(path.read_text())"),
        "SERVE-READ-WRITES",
        "actuate",
    ),
    "writes an attribute": (
        read_by(f"path = {FILE}\n(path.parent / 'update').write_text('1')\nvalue = float(path.read_text())"),
        "SERVE-READ-WRITES",
        "effect read",
    ),
    "removes a file": (
        all_of(uses("os"), read_by(f"path = {FILE}\nos.remove('/tmp/old')\nvalue = float(path.read_text())")),
        "SERVE-READ-WRITES",
        "os.remove",
    ),
    "removes a folder in a helper": (
        all_of(
            uses("shutil"),
            adds("def clean():\n    shutil.rmtree(Path.home() / 'readings')"),
            read_by(f"clean()\nvalue = runtime.read_number({FILE})"),
        ),
        "SERVE-READ-WRITES",
        "shutil.rmtree",
    ),
    "sets with a helper that is given the value": (
        swap('return lights(device, "leds")', 'return lights(device, "leds", 100)'),
        "SERVE-READ-WRITES",
        "read_led",
    ),
    "returns 0 where a read fails": (
        read_by(
            f"""
            path = {FILE}
            try:
                value = float(path.read_text())
            except OSError:
                value = 0
            """
        ),
        "SERVE-DEFAULT-READING",
        "let the error pass",
    ),
    "returns a made-up result where a read fails": (
        read_by(
            f"""
            try:
                value = float(({FILE}).read_text())
            except (OSError, ValueError):
                {warm("20.0")}
            """
        ),
        "SERVE-DEFAULT-READING",
        "a reading that failed",
    ),
    "falls back to a number": (
        read_by(f"value = runtime.read_number({FILE}) or 21500"),
        "SERVE-DEFAULT-READING",
        "made-up",
    ),
    "takes -1 for a value that is not there": (
        read_by(f"value = runtime.read_number({FILE})\nvalue = -1 if value is None else value"),
        "SERVE-DEFAULT-READING",
        "None",
    ),
    "sets a value before it tries": (
        read_by(
            f"""
            value = 20000
            try:
                value = float(({FILE}).read_text())
            except OSError:
                pass
            """
        ),
        "SERVE-DEFAULT-READING",
        "failed",
    ),
    "writes under one lock and reads under another": (
        all_of(
            uses("serial"),
            read_by(
                f"""
                node = {ASKED}.node("tty")
                with runtime.bus(device):
                    port = serial.Serial(node, 9600, timeout=1)
                    port.write(b"T?")
                with runtime.bus(device):
                    value = float(port.readline())
                """
            ),
        ),
        "SERVE-EXCHANGE-SPLIT",
        "one `with runtime.bus(device):`",
    ),
    "locks in two helpers": (
        all_of(
            uses("serial"),
            adds(
                """
                def ask(port):
                    with runtime.bus("hwmon-benchtemp"):
                        port.write(b"T?")

                def hear(port):
                    with runtime.bus("hwmon-benchtemp"):
                        return float(port.readline())

                def opened(node):
                    with runtime.bus("hwmon-benchtemp"):
                        return serial.Serial(node, 9600, timeout=1)
                """
            ),
            read_by(f"port = opened({ASKED}.node('tty'))\nask(port)\nvalue = hear(port)"),
        ),
        "SERVE-EXCHANGE-SPLIT",
        "read_temperature",
    ),
    "reads without the lock": (
        all_of(
            uses("serial"),
            read_by(
                f"with serial.Serial({ASKED}.node('tty'), 9600, timeout=1) as port:\n" + textwrap.indent(ASK, "    ")
            ),
        ),
        "SERVE-BUS-UNLOCKED",
        "runtime.bus",
    ),
    "opens a line at no speed": (line("Serial(node, timeout=1)", ASK), "SERVE-LINE-SPEED", "baudrate="),
    "puts a frame together": (
        line(WHOLE, "port.write(bytes([255, 255, 1, 4]))\nvalue = float(port.readline())"),
        "SERVE-FRAME-BY-HAND",
        "runtime.registers",
    ),
    "puts a frame together in a helper": (
        all_of(
            adds(
                """
                def frame(unit, data):
                    core = struct.pack("<BB", unit, data)
                    return core + bytes([sum(core) & 0xFF])
                """
            ),
            line(WHOLE, "packet = frame(1, 2)\nport.write(packet)\nvalue = float(port.readline())"),
        ),
        "SERVE-FRAME-BY-HAND",
        "puts together",
    ),
    "writes a frame as a literal": (
        line(WHOLE, "port.write(b'\\xff\\xff\\x01\\x02')\nvalue = float(port.readline())"),
        "SERVE-FRAME-BY-HAND",
        "library",
    ),
    "keeps the camera in a dict": (
        all_of(adds("CAMERAS = {}"), body("capture_image", CAMERA.format("CAMERAS[device] = camera", FLUSHED))),
        "SERVE-CAMERA-HELD",
        "kept",
    ),
    "keeps the camera in a global": (
        all_of(adds("last = None"), body("capture_image", "global last\n" + CAMERA.format("last = camera", FLUSHED))),
        "SERVE-CAMERA-HELD",
        "kept",
    ),
    "returns the first picture": (
        body("capture_image", CAMERA.format("", "frame = camera.read()[1]")),
        "SERVE-CAMERA-NOT-FLUSHED",
        "camera.grab()",
    ),
    "does not release the camera": (
        body("capture_image", CAMERA.format("", FLUSHED).replace("camera.release()", "pass")),
        "SERVE-CAMERA-HELD",
        "not released",
    ),
    "leaves a tool out": (
        swap("mcp.tool(runtime.logged(read_led), annotations=READ)\n", ""),
        "SERVE-TOOLS-DIFFER",
        "read_led",
    ),
    "adds a tool": (
        adds("@mcp.tool\n@runtime.logged\ndef reboot() -> None:\n    return None"),
        "SERVE-TOOLS-DIFFER",
        "reboot",
    ),
    "does not log a tool": (
        swap("mcp.tool(runtime.logged(read_led)", "mcp.tool(read_led"),
        "SERVE-TOOL-NOT-LOGGED",
        "read_led",
    ),
    "asks a shell": (
        all_of(uses("subprocess"), read_by(f"{FILE}\nvalue = float(subprocess.getoutput('sensors').split()[0])")),
        "SERVE-SHELL",
        "shell",
    ),
    "computes what a device says": (
        read_by(f"value = eval(({FILE}).read_text())"),
        "SERVE-DYNAMIC-CODE",
        "eval",
    ),
    "opens a device at import": (adds(f"HERE = {ASKED}"), "SERVE-DEVICE-AT-IMPORT", "inside the tool"),
    "imports what it does not declare": (
        swap(', "opencv-python-headless>=4.10"', ""),
        "SERVE-IMPORT-UNDECLARED",
        "cv2",
    ),
    "prints": (read_by(f"value = runtime.read_number({FILE})\nprint(value)"), "SERVE-PRINTS", "stderr"),
    "sets without saying that it acts": (
        swap("actuate=percent is not None", "actuate=False"),
        "SERVE-ACTUATE-UNBOUND",
        "actuate=True",
    ),
    "imports octoform": (
        swap("import runtime\n", "import octoform\nimport runtime\n"),
        "SERVE-IMPORT-OCTOFORM",
        "runtime",
    ),
    "takes another range": (
        swap("led: Annotated[Literal", "percent2: Annotated[Literal"),
        "SERVE-SCHEMA-DIFFERS",
        "percent2",
    ),
    "says that what sets is a reading": (
        swap(
            "mcp.tool(runtime.logged(set_led), annotations=SET)", "mcp.tool(runtime.logged(set_led), annotations=READ)"
        ),
        "SERVE-ANNOTATIONS-DIFFER",
        "readOnlyHint",
    ),
    "gives text for a number": (
        swap('"label": str, "value": float', '"label": str, "value": str'),
        "SERVE-RESULT-DIFFERS",
        "readings[].value: number promised, string found",
    ),
    "gives an untyped result": (
        swap('"hwmon-benchtemp") -> Readings:', '"hwmon-benchtemp") -> dict:'),
        "SERVE-RESULT-DIFFERS",
        "readings: promised, nothing found",
    ),
    "leaves a member of the result out": (
        swap('"volumes": list[Volume]})', '"parts": list[Volume]})'),
        "SERVE-RESULT-DIFFERS",
        "disks[].volumes: promised, nothing found",
    ),
}

# Ways to read the sensor that are right, however unusual: definitions with a function `reads` of a device's id.
RIGHT = {
    "a context manager": """
        @contextlib.contextmanager
        def held(name):
            unit = runtime.device(name)
            with runtime.bus(unit):
                yield unit

        def reads(name):
            with held(name) as unit:
                return runtime.read_number(unit.path("hwmon") / "temp1_input")
        """,
    "the runtime's own context manager": """
        def reads(name):
            with runtime.device(name).bus() as unit:
                return runtime.read_number(unit.path("hwmon") / "temp1_input")
        """,
    "a class": """
        class Sensor:
            def __init__(self, name):
                self.unit = runtime.device(name)

            def value(self):
                return float((self.unit.path("hwmon") / "temp1_input").read_text())

        def reads(name):
            return Sensor(name).value()
        """,
    "a line, asked and heard under one lock": """
        def reads(name):
            node = runtime.device(name).node("tty")
            with runtime.bus(name), serial.Serial(node, 9600, timeout=1) as port:
                port.write(b"T?\\r\\n")
                return float(port.readline())
        """,
    "a line whose speed is set before it is opened": """
        def reads(name):
            with runtime.bus(name):
                port = serial.Serial()
                port.baudrate, port.timeout = 115200, 1
                port.port = runtime.device(name).node("tty")
                port.open()
                try:
                    port.write(f"T{1}?\\n".encode("ascii"))
                    return float(port.readline())
                finally:
                    port.close()
        """,
    "a line in two helpers below one lock": """
        def ask(port, text):
            port.write(text.encode() + b"\\n")

        def hear(port):
            return port.readline().decode("ascii", "replace").strip()

        def reads(name):
            with runtime.bus(name):
                with serial.Serial(port=runtime.device(name).node("tty"), baudrate=9600, timeout=1) as port:
                    ask(port, "T?")
                    return float(hear(port))
        """,
    "a line that only listens": """
        def reads(name):
            with runtime.bus(name), serial.Serial(runtime.device(name).node("tty"), 4800, timeout=2) as port:
                lines = [port.readline() for _ in range(5)]
            for text in lines:
                if text.startswith(b"$T,"):
                    return float(text[3:])
            raise ToolError(f"{name} said nothing of its temperature within 5 lines")
        """,
    "a raw node opened to ask": """
        def reads(name):
            with runtime.bus(name):
                handle = os.open(runtime.device(name).node("hidraw"), os.O_RDWR | os.O_NONBLOCK)
                try:
                    os.write(handle, b"T")
                    return float(os.read(handle, 64))
                finally:
                    os.close(handle)
        """,
    "an error in words of its own": """
        def reads(name):
            try:
                return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
            except OSError as problem:
                raise ToolError(f"{name} gives no reading now: {problem.strerror}") from problem
        """,
    "null for what could not be read": """
        def reads(name):
            try:
                return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
            except OSError:
                return None
        """,
    "several tries": """
        def reads(name):
            problem = None
            for _ in range(3):
                try:
                    return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
                except OSError as found:
                    problem = found
            raise ToolError(f"{name} gave no reading in three tries: {problem}")
        """,
    "channels that fail are skipped": """
        def reads(name):
            values, failed = [], 0
            for path in runtime.files(runtime.device(name).path("hwmon"), "temp*_input"):
                try:
                    value = float(path.read_text())
                except (OSError, ValueError):
                    failed += 1
                    continue
                values.append(value)
            if not values:
                raise ToolError(f"none of {failed} channels answered")
            return max(values)
        """,
    "an alias of the runtime": """
        from runtime import device as find, read_number as number

        def reads(name):
            return number(find(name).path("hwmon") / "temp1_input")
        """,
    "a keyword": """
        def reads(name):
            return runtime.read_number(path=runtime.device(device_id=name).path("hwmon") / "temp1_input")
        """,
    "a table of ways": """
        def by_file(name):
            return runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input")

        WAYS = {"hwmon-benchtemp": by_file}

        def reads(name):
            return WAYS[name](name)
        """,
    "a lambda and a partial": """
        def scaled(read, factor):
            return read() * factor

        def reads(name):
            folder = runtime.device(name).path("hwmon")
            return scaled(lambda: float((folder / "temp1_input").read_text()), 1.0)
        """,
    "a match": """
        def reads(name):
            match runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input"):
                case None:
                    raise ToolError(f"{name} gives no reading now")
                case value:
                    return value
        """,
    "a program of the system": """
        def reads(name):
            chip = runtime.device(name).path("hwmon").name
            done = subprocess.run(["sensors", "-u", chip], capture_output=True, text=True, timeout=5, check=True)
            return float(done.stdout.split()[-1]) * 1000
        """,
    "a scratch file": """
        def reads(name):
            value = (runtime.device(name).path("hwmon") / "temp1_input").read_text()
            with tempfile.TemporaryDirectory() as folder:
                copy = Path(folder) / "value"
                copy.write_text(value)
                return float(copy.read_text())
        """,
    "a named scratch file": """
        def reads(name):
            with tempfile.NamedTemporaryFile(mode="w+") as scratch:
                scratch.write((runtime.device(name).path("hwmon") / "temp1_input").read_text())
                scratch.seek(0)
                return float(scratch.read())
        """,
    "words of other languages": """
        def reads(name):
            \"\"\"读取温度（毫摄氏度）。\"\"\"
            wert = runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input")
            if wert is None:
                raise ToolError("der Fühler antwortet nicht; ist er angesteckt?")
            return wert
        """,
    "text about places": """
        def reads(name):
            \"\"\"/dev/hwmon is not a place that exists; the kernel says where the sensor is.\"\"\"
            folder = runtime.device(name).path("hwmon")
            if str(folder).startswith("/dev/"):
                raise ToolError("/dev/hwmon is no folder of attributes")
            return float((folder / "temp1_input").read_text())
        """,
    "zeros that are no readings": """
        def reads(name, offset=0):
            total, count = 0.0, 0
            for path in runtime.files(runtime.device(name).path("hwmon"), "temp*_input"):
                total, count = total + float(path.read_text()), count + 1
            return total / count + offset if count else None
        """,
    "an offset and a scale that may not be there": """
        def reads(name):
            folder = runtime.device(name).path("hwmon")
            offset = runtime.read_number(folder / "temp1_offset") or 0
            scale = runtime.read_number(folder / "temp1_scale")
            value = runtime.read_number(folder / "temp1_input")
            if value is None:
                raise ToolError(f"{name} gives no reading now")
            return (value + offset) * (1 if scale is None else scale)
        """,
    "a log of its own": """
        log = logging.getLogger("bench")

        def reads(name):
            value = runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input")
            log.debug("%s says %s", name, value)
            return value
        """,
    "a camera that an exit stack releases": """
        def reads(name):
            import cv2

            with runtime.bus(name), contextlib.ExitStack() as stack:
                camera = cv2.VideoCapture(runtime.device(name).node("video4linux"))
                stack.callback(camera.release)
                for _ in range(5):
                    camera.grab()
                return float(camera.read()[1].mean())
        """,
    "a camera in a context manager": """
        @contextlib.contextmanager
        def opened(node):
            import cv2

            camera = cv2.VideoCapture(node)
            try:
                yield camera
            finally:
                camera.release()

        def reads(name):
            with runtime.bus(name), opened(runtime.device(name).node("video4linux")) as camera:
                until = time.monotonic() + 0.5
                while time.monotonic() < until:
                    camera.grab()
                return float(camera.read()[1].mean())
        """,
    "one of the runtime's readers": """
        def reads(name):
            rows = list(runtime.channels.hwmon(runtime.device(name), "temp", 1, "mdegC"))
            return rows[0].value
        """,
}
# Results that say the same in another form of Python: what to replace in the server.
RESULTS = {
    "models": all_of(
        swap("from pydantic import Field", "from pydantic import BaseModel, Field"),
        swap(
            'Reading = TypedDict("Reading", {"sensor": str, "channel": str, "label": str, "value": float, '
            '"unit": str})',
            "class Reading(BaseModel):\n    sensor: str\n    channel: str\n    label: str\n"
            "    value: float\n    unit: str\n",
        ),
        swap(
            'Readings = TypedDict("Readings", {"device": str, "readings": list[Reading], "unreadable": list[str]})',
            "class Readings(BaseModel):\n    device: str\n    readings: list[Reading]\n    unreadable: list[str]\n",
        ),
    ),
    "data classes": all_of(
        swap("from pathlib import Path", "from dataclasses import dataclass\nfrom pathlib import Path"),
        swap(
            'Light = TypedDict("Light", {"name": str, "percent": float, "level": int, "maximum": int})',
            "@dataclass\nclass Light:\n    name: str\n    percent: float\n    level: int\n    maximum: int\n",
        ),
    ),
    "narrower members": swap('"wear": str | None', '"wear": str'),
}


def reading_by(name: str, number: int) -> Edit:
    """The server with this way to read, and with `read_temperature` going it."""
    text = textwrap.dedent(RIGHT[name])
    definitions = sorted({item.name for item in ast.parse(text).body if hasattr(item, "name")})
    for each in definitions:  # several ways stand in one server
        text = re.sub(rf"\b{each}\b", f"{each}_{number}", text)
    return all_of(
        adds(text), swap("    return readings(device, ", f"    reads_{number}(device)\n    return readings(device, ")
    )


IMPORTS = uses("contextlib", "logging", "os", "serial", "subprocess", "tempfile")


MEMORY = "SERVE-CAMERA-IN-SERVER"
"""A warning about the server's memory, which these cases are not about."""


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> dict[str, dict[str, str]]:
    """The errors of each wrong server, by what is wrong."""
    folder = tmp_path_factory.mktemp("serve-held")
    earlier, good = written(folder / "host")
    edits = [*(edit for edit, _, _ in WRONG.values()), all_of()]
    known = Artifacts(interface=earlier["interface"])
    _, errors = refusals(folder, folder / "host", "serve", earlier, good, edits, packaged(CAMERAS), lambda _: known)
    return dict(zip(WRONG, errors, strict=True))


@for_each("case", WRONG, every=4, kind=lambda case: WRONG[case][1])
def test_a_wrong_server_is_refused_with_the_cure(refused: dict[str, dict[str, str]], case: str) -> None:
    _, code, found = WRONG[case]
    assert refused[case].keys() - {MEMORY} == {code} and found in refused[case][code], refused[case]


def test_a_right_server_in_other_words_is_accepted(tmp_path: Path, packaged: Callable[..., Path]) -> None:
    earlier, good = written(tmp_path / "host")
    ways = [swap("    return readings(device, ", "    return readings(device, ")]
    ways += [reading_by(name, number) for number, name in enumerate(RIGHT)]
    server = all_of(IMPORTS, *ways, *RESULTS.values())(good)
    project, errors = refusals(
        tmp_path, tmp_path / "host", "serve", earlier, server, [all_of()], packaged(CAMERAS, SERIAL)
    )
    assert errors == [] and (project.state / "serve" / "server.py").read_text() == server


@for_each("way", RIGHT, every=3)
def test_a_right_way_to_read_gives_no_finding(way: str, bench_server: tuple[Output, str]) -> None:
    interface, good = bench_server
    found = serve_static(all_of(IMPORTS, reading_by(way, 0))(good), interface)
    assert [item for item in found if item.code != MEMORY] == []


@pytest.fixture(scope="module")
def bench_server(tmp_path_factory: pytest.TempPathFactory) -> tuple[Output, str]:
    root = watched(tmp_path_factory.mktemp("bench") / "host")
    made = outputs(root, probe_root(root), 1000)
    assert made.interface and made.serve
    return made.interface, made.serve
