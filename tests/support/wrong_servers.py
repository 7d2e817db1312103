"""Servers that are wrong, each in one way: what is wrong, an edit of the desk's server, the codes of which one is due.

Written by hand after what agents were seen to write, and after what somebody would write who wants to be believed.
"""

from server_edits import ASKED, CAMERA, FILE, FLUSHED, WHOLE, Edit, adds, all_of, body, line, read_by, swap, uses, warm

Case = tuple[Edit, str]
NOTHING, DEVICE, CONSTANT = "SERVE-NOT-IMPLEMENTED", "SERVE-DEVICE-NOT-ASKED", "SERVE-CONSTANT-READING"
DEFAULT, PLACE, WRITES = "SERVE-DEFAULT-READING", "SERVE-LITERAL-PLACE", "SERVE-READ-WRITES"
HELD, FLUSH, FRAME = "SERVE-CAMERA-HELD", "SERVE-CAMERA-NOT-FLUSHED", "SERVE-FRAME-BY-HAND"
PANEL = """
folder = runtime.device({}).path("backlight")
level = int((folder / "brightness").read_text())
return Lights(device=device, lights=[Light(name=folder.name, percent=level, level=level, maximum={})])
"""
PORT = f"port = serial.Serial({ASKED}.node('tty'), 9600, timeout=1)"


def says(expression: str, *imports: str, more: str = "") -> Edit:
    """`read_temperature` with a value that is said and not read."""
    parts = [uses(*imports)] if imports else []
    return all_of(*parts, *([adds(more)] if more else []), body("read_temperature", warm(expression)))


def temperature(text: str, *imports: str, more: str = "") -> Edit:
    """`read_temperature` with a body that ends in `value`."""
    parts = [uses(*imports)] if imports else []
    return all_of(*parts, *([adds(more)] if more else []), read_by(text))


def beside(text: str) -> Edit:
    """`read_brightness` of which one number is read and one is not."""
    return body("read_brightness", text)


def picture(text: str, more: str = "") -> Edit:
    return all_of(*([adds(more)] if more else []), body("capture_image", text))


RAW = f"{FILE}"
CONSTANTS: dict[str, Case] = {
    "a class's attribute": (says("Board.HEAT", more="class Board:\n    HEAT = 21.5"), DEVICE),
    "a table": (says("HEAT[device]", more='HEAT = {"hwmon-benchtemp": 21.5}'), DEVICE),
    "sums of literals": (says("20 + 3 * 0.5"), DEVICE),
    "a formatted number": (says("float(f'{2}{1}.{5}')"), DEVICE),
    "chance": (says("20 + random.random()", "random"), DEVICE),
    "chance in a helper": (
        says("drift()", "random", more="def drift():\n    return random.uniform(20, 22)"),
        DEVICE,
    ),
    "the time": (says("20 + time.time() % 3"), DEVICE),
    "a sine of the time": (says("20 + math.sin(time.monotonic())", "math"), DEVICE),
    "the hash of the id": (says("hash(device) % 40"), DEVICE),
    "a digest of the id": (says("hashlib.md5(device.encode()).digest()[0] / 10", "hashlib"), DEVICE),
    "the length of the id": (says("float(len(device))"), DEVICE),
    "the processor's load": (says("os.getloadavg()[0]", "os"), DEVICE),
    "a property": (
        says("Sensor().heat", more="class Sensor:\n    @property\n    def heat(self):\n        return 21.5"),
        DEVICE,
    ),
    "a driver that knows the device and says a constant": (
        says(
            "Sensor(runtime.device(device)).heat()",
            more="""
            class Sensor:
                def __init__(self, unit):
                    self.unit = unit

                def heat(self):
                    return 21.5
            """,
        ),
        DEVICE,
    ),
    "a generator": (says("next(heats())", more="def heats():\n    while True:\n        yield 21.5"), DEVICE),
    "a lambda": (says("(lambda name: 21.5)(device)"), DEVICE),
    "a cached helper": (
        says("heat(device)", "functools", more="@functools.cache\ndef heat(name):\n    return 21.5"),
        DEVICE,
    ),
    "a sum over a range": (says("sum(range(7)) + 0.5"), DEVICE),
    "a counter that goes on": (
        says("next(COUNT)", "itertools", more="COUNT = itertools.count(20)"),
        DEVICE,
    ),
    "an environment variable": (says("float(os.environ.get('HEAT', '21.5'))", "os"), DEVICE),
    "a text that is parsed": (says("float('21.5 C'.split()[0])"), DEVICE),
    "a match on the id": (
        body(
            "read_temperature",
            f"match device:\n    case 'hwmon-benchtemp':\n        {warm('21.5')}\nraise ToolError('no such')",
        ),
        DEVICE,
    ),
    "asked, and then a constant": (body("read_temperature", f"{ASKED}.path('hwmon')\n{warm('21.5')}"), DEVICE),
    "under the device's lock": (
        body("read_temperature", f"with {ASKED}.bus() as unit:\n    unit.path('hwmon')\n    {warm('21.5')}"),
        DEVICE,
    ),
    "read, and then written over": (
        temperature(f"value = runtime.read_number({FILE})\nvalue = 21500.0"),
        DEVICE,
    ),
    "read into nothing": (temperature(f"_ = ({FILE}).read_text()\nvalue = 21500"), DEVICE),
    "only that the place is there": (
        temperature(f"path = {FILE}\nif not path:\n    raise ToolError('away')\nvalue = 21500"),
        DEVICE,
    ),
    "the id's letters as numbers": (says("sum(map(ord, device)) / 50"), DEVICE),
    "a constant beside a true reading": (
        body(
            "read_temperature",
            f"""
            first = float(({FILE}).read_text()) / 1000
            rows = [Reading(sensor="benchtemp", channel="temp1", label="board", value=first, unit="degC")]
            rows.append(Reading(sensor="benchtemp", channel="temp2", label="air", value=22.5, unit="degC"))
            return Readings(device=device, readings=rows, unreadable=[])
            """,
        ),
        CONSTANT,
    ),
    "a named constant beside a true reading": (
        all_of(adds("USUAL = 55.0"), beside(PANEL.format("device", "100").replace("percent=level", "percent=USUAL"))),
        CONSTANT,
    ),
    "chance beside a true reading": (
        all_of(
            uses("random"),
            beside(PANEL.format("device", "100").replace("percent=level", "percent=random.uniform(1, 9)")),
        ),
        CONSTANT,
    ),
    "a sum of literals beside a true reading": (
        beside(PANEL.format("device", "100").replace("percent=level", "percent=11 * 5")),
        CONSTANT,
    ),
    "a constant that is stored into the result": (
        beside(
            PANEL.format("device", "100").replace("return Lights", "made = Lights")
            + 'made["lights"][0]["percent"] = 55.0\nreturn made'
        ),
        CONSTANT,
    ),
    "a constant set after a true reading": (
        beside(
            PANEL.format("device", "100")
            .replace("percent=level", "percent=shown")
            .replace("return", "shown = 55\nreturn")
        ),
        CONSTANT,
    ),
}
DEFAULTS: dict[str, Case] = {
    "0 where a read fails": (
        temperature(f"try:\n    value = float(({FILE}).read_text())\nexcept OSError:\n    value = 0.0"),
        DEFAULT,
    ),
    "0 where anything fails, in a helper": (
        temperature(
            f"value = number({FILE})",
            more="""
            def number(path):
                try:
                    return float(path.read_text())
                except Exception:
                    return 0.0
            """,
        ),
        DEFAULT,
    ),
    "a suppressed failure": (
        temperature(
            f"value = 20000.0\nwith contextlib.suppress(OSError):\n    value = float(({FILE}).read_text())",
            "contextlib",
        ),
        DEFAULT,
    ),
    "or a number": (temperature(f"value = runtime.read_number({FILE}) or 20000"), DEFAULT),
    "or a named number": (temperature(f"value = runtime.read_number({FILE}) or USUAL", more="USUAL = 20000"), DEFAULT),
    "or a number, by way of a name": (
        temperature(f"found = runtime.read_number({FILE})\nvalue = found or 20000.0"),
        DEFAULT,
    ),
    "a number for None": (
        temperature(f"value = runtime.read_number({FILE})\nif value is None:\n    value = 20000.0"),
        DEFAULT,
    ),
    "a number for an empty text": (
        temperature(f"text = runtime.read_text({FILE})\nvalue = float(text) if text else 20000.0"),
        DEFAULT,
    ),
    "a text of a number for an empty text": (temperature(f"value = float(runtime.read_text({FILE}) or '0')"), DEFAULT),
    "a default of a table": (
        temperature(
            f"rows = dict(row.split('=') for row in ({FILE}).read_text().splitlines())\n"
            "value = float(rows.get('temp1', 20000))"
        ),
        DEFAULT,
    ),
    "a default of an iterator": (
        temperature(f"rows = [float(row) for row in ({FILE}).read_text().split()]\nvalue = next(iter(rows), 20000)"),
        DEFAULT,
    ),
    "a default of a largest": (
        temperature(f"value = max((float(row) for row in ({FILE}).read_text().split()), default=20000)"),
        DEFAULT,
    ),
    "a default of an attribute": (
        temperature(f"value = getattr(runtime.channels.hwmon({ASKED}, 'temp', 1, 'mdegC'), 'value', 20000)"),
        DEFAULT,
    ),
    "a case for None": (
        temperature(
            f"""
            match runtime.read_number({FILE}):
                case None:
                    value = 20000
                case value:
                    pass
            """
        ),
        DEFAULT,
    ),
    "a number where nothing matches": (
        temperature(f"found = re.search(r'\\d+', ({FILE}).read_text())\nvalue = float(found[0]) if found else 0.0"),
        DEFAULT,
    ),
    "a number after some tries": (
        temperature(
            f"""
            value = 20000
            for _ in range(3):
                try:
                    value = float(({FILE}).read_text())
                    break
                except OSError:
                    time.sleep(0.1)
            """
        ),
        DEFAULT,
    ),
    "a whole result of its own where a read fails": (
        body(
            "read_temperature",
            f"try:\n    value = float(({FILE}).read_text())\nexcept OSError:\n    {warm('20.0')}\n{warm('value / 9')}",
        ),
        DEFAULT,
    ),
}
ROWS = f"rows = [float(row) for row in ({FILE}).read_text().split()]"
DEFAULTS |= {
    f"an empty series: {end.splitlines()[-1].strip()}": (temperature(f"{ROWS}\n{end}"), DEFAULT)
    for end in (
        "value = max(rows) if rows else 0",
        "value = rows[-1] if rows else 0.0",
        "value = sum(rows) / len(rows) if rows else 0",
        "value = rows[-1] - rows[0] if rows else 20",
        "value = 0.0\nif rows:\n    value = max(rows)",
        "if rows:\n    value = sum(rows) / len(rows)\nelse:\n    value = 0.0",
        "value = 0.0\nif rows:\n    value = rows[-1] / 1000",
    )
}
BY_DEFINITION: dict[str, Edit] = {
    end: temperature(f"{ROWS}\n{end}")
    for end in (
        "value = rows[-1] - rows[0] if rows else 0",
        "value = (rows[-1] - rows[0]) / 1000 if rows else 0.0",
        "value = round(max(rows) - min(rows)) if rows else 0",
        "value = sum(rows) if rows else 0",
        "value = float(len(rows)) if rows else 0",
        "value = sum(rows) or 0",
        "value = 0.0\nif rows:\n    value = rows[-1] - rows[0]",
        "if rows:\n    value = sum(rows)\nelse:\n    value = 0",
    )
}
"""What a series without a member gives by definition: nothing was added, nothing was counted, nothing moved."""
DEVICES: dict[str, Case] = {
    "another tool's device": (
        read_by("value = runtime.read_number(runtime.device('leds-bench-green').path('leds') / 'brightness')"),
        DEVICE,
    ),
    "another tool's device by a name": (
        temperature(
            "value = runtime.read_number(runtime.device(LAMP).path('leds') / 'brightness')",
            more='LAMP = "leds-bench-green"',
        ),
        DEVICE,
    ),
    "the first whichever is named": (beside(PANEL.format('"backlight-panel"', "100")), DEVICE),
    "the first by a name": (
        all_of(adds('FIRST = "backlight-panel"'), beside(PANEL.format("FIRST", "100"))),
        DEVICE,
    ),
    "the argument written over": (beside("device = 'backlight-panel'" + PANEL.format("device", "100")), DEVICE),
    "the id without its end": (beside(PANEL.format('device.removesuffix("2")', "100")), DEVICE),
    "the id cut": (beside(PANEL.format("device[:15]", "100")), DEVICE),
    "the other of the two": (
        all_of(
            adds('OTHER = {"backlight-panel": "backlight-panel2", "backlight-panel2": "backlight-panel"}'),
            beside(PANEL.format("OTHER[device]", "100")),
        ),
        DEVICE,
    ),
    "one or the same": (
        beside(PANEL.format('"backlight-panel" if device else "backlight-panel"', "100")),
        DEVICE,
    ),
}
STUBS: dict[str, Case] = {
    "an error": (body("read_led", 'raise ToolError("not implemented yet")'), NOTHING),
    "an error if a device is named": (body("read_led", 'if device:\n    raise ToolError("later")'), NOTHING),
    "an error if a device is found": (
        body("read_led", "if runtime.device(device).folder:\n    raise ToolError('later')\nreturn None"),
        NOTHING,
    ),
    "an error in a loop": (body("read_led", 'while True:\n    raise ToolError("later")'), NOTHING),
    "an assertion": (body("read_led", 'assert False, "later"'), NOTHING),
    "three dots": (body("read_led", "..."), NOTHING),
    "an error of a helper": (
        all_of(body("read_led", "return todo()"), adds('def todo():\n    raise NotImplementedError("todo")')),
        NOTHING,
    ),
    "an error of a class": (
        all_of(
            body("read_led", "return Lamp().state()"),
            adds('class Lamp:\n    def state(self):\n        raise NotImplementedError("todo")'),
        ),
        NOTHING,
    ),
    "an error after the device is asked": (
        body("read_led", "runtime.device(device).path('leds')\nraise ToolError('not supported by this version')"),
        NOTHING,
    ),
    "nothing comes back": (
        body(
            "read_led", "with runtime.device(device).bus() as unit:\n    (unit.path('leds') / 'brightness').read_text()"
        ),
        NOTHING,
    ),
    "an empty result": (body("read_led", "return Lights(device=device, lights=[])"), DEVICE),
    "an empty result of an asked device": (
        body("read_led", "runtime.device(device).path('leds')\nreturn Lights(device=device, lights=[])"),
        DEVICE,
    ),
    "what acts does nothing": (
        body("set_led", "runtime.device(device, actuate=True).path('leds')\nreturn Lights(device=device, lights=[])"),
        DEVICE,
    ),
    "what acts says what it was told": (
        body("set_led", "return Lights(device=device, lights=[Light(name=led, percent=percent, level=1, maximum=1)])"),
        DEVICE,
    ),
}
PLACES: dict[str, Case] = {
    "a path of attributes": (
        temperature(f"{ASKED}\nvalue = float(Path('/sys/class/hwmon/hwmon0/temp1_input').read_text())"),
        PLACE,
    ),
    "a path in parts": (
        temperature(f"{ASKED}\nvalue = float(Path('/', 'sys', 'class', 'hwmon', 'hwmon0', 'temp1_input').read_text())"),
        PLACE,
    ),
    "a path by joining": (
        temperature(f"{ASKED}\nvalue = float(open(os.path.join('/', 'sys', 'class', 'hwmon0')).read())", "os"),
        PLACE,
    ),
    "a path glued": (
        temperature(f"{ASKED}\nvalue = float(open('/s' + 'ys/class/hwmon/hwmon0/temp1_input').read())"),
        PLACE,
    ),
    "a path by slashes": (
        temperature(f"{ASKED}\nvalue = float((Path('/') / 'sys' / 'class' / 'hwmon' / 'hwmon0').read_text())"),
        PLACE,
    ),
    "a path joined of a list": (
        temperature(f"{ASKED}\nvalue = float(open('/'.join(['', 'sys', 'class', 'hwmon0'])).read())"),
        PLACE,
    ),
    "a path of a named root": (
        temperature(
            f"{ASKED}\nvalue = float((ROOT / 'class' / 'hwmon0').read_text())", more='ROOT = Path("/") / "sys"'
        ),
        PLACE,
    ),
    "a path in bytes": (
        temperature(f"{ASKED}\nvalue = float(open(b'/sys/class/hwmon/hwmon0/temp1_input').read())"),
        PLACE,
    ),
    "a formatted path": (
        temperature(f"{ASKED}\nvalue = float(open('/sys/class/{{}}/temp1_input'.format(device)).read())"),
        PLACE,
    ),
    "a path of the system's root": (
        temperature(f"{ASKED}\nvalue = float((runtime.sysroot() / 'sys/class/hwmon/hwmon0/temp1_input').read_text())"),
        PLACE,
    ),
    "a folder searched": (
        temperature(
            f"{ASKED}\nvalue = [float(path.read_text()) for path in Path('/sys/class/hwmon').glob('*/temp1_input')][0]"
        ),
        PLACE,
    ),
    "a line": (
        temperature(
            f"{ASKED}\nwith runtime.bus(device), serial.Serial('/dev/ttyUSB0', 9600, timeout=1) as port:\n"
            "    value = float(port.readline())",
            "serial",
        ),
        PLACE,
    ),
    "a line by its name": (
        temperature(
            f"{ASKED}\nwith runtime.bus(device), serial.Serial('ttyUSB0', 9600, timeout=1) as port:\n"
            "    value = float(port.readline())",
            "serial",
        ),
        PLACE,
    ),
    "the first camera": (
        picture(CAMERA.format("", FLUSHED).replace('runtime.device(device).node("video4linux")', "0")),
        PLACE,
    ),
    "the first camera by a name": (
        picture(CAMERA.format("", FLUSHED).replace('runtime.device(device).node("video4linux")', "FIRST"), "FIRST = 0"),
        PLACE,
    ),
    "the first camera by a word": (
        picture(CAMERA.format("", FLUSHED).replace('runtime.device(device).node("video4linux")', "index=0")),
        PLACE,
    ),
    "any camera": (
        picture(CAMERA.format("", FLUSHED).replace('runtime.device(device).node("video4linux")', "-1")),
        PLACE,
    ),
    "a camera of a text": (
        picture(CAMERA.format("", FLUSHED).replace('runtime.device(device).node("video4linux")', "int('0')")),
        PLACE,
    ),
    "a camera opened later": (
        picture(
            CAMERA.format("camera.open(0)", FLUSHED).replace('runtime.device(device).node("video4linux")', "")
            + "# runtime.device(device)"
        ),
        PLACE,
    ),
}
WRITING: dict[str, Case] = {
    name: (temperature(f"path = {FILE}\n{text}\nvalue = float(path.read_text())", *imports), WRITES)
    for name, text, *imports in [
        ("a file opened to write", "open(path, 'w').write('1')"),
        ("a file opened to add", "open(path, mode='a').close()"),
        ("a mode by a name", "mode = 'w'\nopen(path, mode).write('1')"),
        ("a mode put together", "open(path, 'w' + 'b').write(b'1')"),
        ("a path opened to write", "path.open('w').write('1')"),
        ("text of a path", "(path.parent / 'update').write_text('1')"),
        ("bytes of a path", "(path.parent / 'update').write_bytes(b'1')"),
        ("a file touched", "path.touch()"),
        ("a descriptor", "handle = os.open(path, os.O_WRONLY)\nos.write(handle, b'1')\nos.close(handle)", "os"),
        ("a descriptor for both", "handle = os.open(path, os.O_RDWR)\nos.write(handle, b'1')\nos.close(handle)", "os"),
        ("a file removed", "os.remove('/tmp/old')", "os"),
        ("a file moved", "path.rename(path.with_suffix('.old'))"),
        ("a path replaced", "path.replace(path.with_suffix('.old'))"),
        ("a folder removed", "shutil.rmtree(Path.home() / 'x')", "shutil"),
        ("a copy made", "shutil.copyfile(path, Path.home() / 'x')", "shutil"),
        (
            "a program that writes",
            "subprocess.run(['tee', str(path)], input=b'1', timeout=5, check=True)",
            "subprocess",
        ),
        ("a program that copies", "subprocess.run(['dd', 'if=/dev/zero', f'of={path}'], timeout=5)", "subprocess"),
        ("a program that sets", "subprocess.run(['v4l2-ctl', '--set-ctrl', 'gain=1'], timeout=5)", "subprocess"),
        ("a program that switches", "subprocess.run(['i2cset', '-y', '1', '0x40', '1'], timeout=5)", "subprocess"),
        ("a line of the kernel driven", "runtime.gpio.drive('gpiochip', 1, 'high')"),
        ("a tone", "runtime.evdev.rumble(path, 1.0, 1.0)"),
    ]
}
WRITING |= {
    "an order on a line": (line(WHOLE, "port.write(b'SET 5\\n')\nvalue = float(port.readline())"), WRITES),
    "a move on a line": (line(WHOLE, "port.write(b'MOVE 1 2000\\n')\nvalue = float(port.readline())"), WRITES),
    "a library's order": (
        line(WHOLE, "servo = Servo(port)\nservo.set_goal_position(1, 2000)\nvalue = float(port.readline())"),
        WRITES,
    ),
    "a method by its name": (
        line(WHOLE, "getattr(port, 'wri' + 'te')(b'T?')\nvalue = float(port.readline())"),
        WRITES,
    ),
}
TALK: dict[str, Case] = {
    "two locks": (
        temperature(
            f"with runtime.bus(device):\n    {PORT}\n    port.write(b'T?')\n"
            "with runtime.bus(device):\n    value = float(port.readline())",
            "serial",
        ),
        "SERVE-EXCHANGE-SPLIT",
    ),
    "a loop of locks": (
        temperature(
            f"""
            with runtime.bus(device):
                {PORT}
                port.write(b"T?")
            for _ in range(3):
                with runtime.bus(device):
                    value = float(port.readline())
            """,
            "serial",
        ),
        "SERVE-EXCHANGE-SPLIT",
    ),
    "no speed": (
        line("Serial(node, timeout=1)", "port.write(b'T?')\nvalue = float(port.readline())"),
        "SERVE-LINE-SPEED",
    ),
    "no lock": (
        temperature(
            f"with serial.Serial({ASKED}.node('tty'), 9600, timeout=1) as port:\n    value = float(port.readline())",
            "serial",
        ),
        "SERVE-BUS-UNLOCKED",
    ),
    **{
        f"a frame: {name}": (line(WHOLE, f"{text}\nvalue = float(port.readline())"), FRAME)
        for name, text in {
            "numbers": "port.write(bytes([255, 255, 1, 4]))",
            "a literal": "port.write(b'\\xff\\xff\\x01')",
            "hexadecimal": "port.write(bytes.fromhex('ffff0104'))",
            "packed": "port.write(struct.pack('<BB', 255, 1))",
            "an array": "frame = bytearray()\nframe.append(255)\nframe.append(4)\nport.write(frame)",
            "joined": "port.write(b''.join([b'\\xff', b'\\xff']))",
            "by descriptor": "import os\nos.write(port.fileno(), b'\\xff\\xff\\x01')",
            "latin": "port.write('\\xff\\xff\\x01'.encode('latin-1'))",
            "characters": "port.write((chr(255) + chr(255)).encode('latin-1'))",
            "a checksum": "core = [1, 4, 2]\nport.write(bytes(core + [~sum(core) & 255]))",
        }.items()
    },
    "a frame through a descriptor": (
        temperature(
            f"""
            with runtime.bus(device):
                handle = os.open({ASKED}.node("tty"), os.O_RDWR | os.O_NOCTTY)
                os.write(handle, b"\\xff\\xff\\x01\\x04")
                value = float(os.read(handle, 8))
                os.close(handle)
            """,
            "os",
        ),
        FRAME,
    ),
    "a frame through a file": (
        temperature(
            f"""
            with runtime.bus(device), open({ASKED}.node("tty"), "r+b", buffering=0) as port:
                port.write(b"\\xff\\xff\\x01\\x04")
                value = float(port.read(8))
            """
        ),
        FRAME,
    ),
}
CAMERAS: dict[str, Case] = {
    "in a table": (picture(CAMERA.format("KEPT[device] = camera", FLUSHED), "KEPT = {}"), HELD),
    "in a module": (picture("global last\n" + CAMERA.format("last = camera", FLUSHED), "last = None"), HELD),
    "in a class": (
        picture(CAMERA.format("Cameras.last = camera", FLUSHED), "class Cameras:\n    last = None"),
        HELD,
    ),
    "in a list": (picture(CAMERA.format("KEPT.append(camera)", FLUSHED), "KEPT = []"), HELD),
    "in a table by default": (picture(CAMERA.format("KEPT.setdefault(device, camera)", FLUSHED), "KEPT = {}"), HELD),
    "in a cache": (
        all_of(
            uses("functools"),
            picture(
                CAMERA.format("", FLUSHED).replace("cv2.VideoCapture(", "opened("),
                "@functools.lru_cache\ndef opened(node):\n    import cv2\n\n    return cv2.VideoCapture(node)",
            ),
        ),
        HELD,
    ),
    "in an object of the module": (
        picture(
            CAMERA.format("", FLUSHED).replace("cv2.VideoCapture(", "EYE.opened("),
            """
            class Eye:
                def opened(self, node):
                    import cv2

                    self.camera = cv2.VideoCapture(node)
                    return self.camera

            EYE = Eye()
            """,
        ),
        HELD,
    ),
    "in an update": (picture(CAMERA.format("KEPT.update({device: camera})", FLUSHED), "KEPT = {}"), HELD),
    "not released": (picture(CAMERA.format("", FLUSHED).replace("camera.release()", "pass")), HELD),
    "the first picture": (picture(CAMERA.format("", "frame = camera.read()[1]")), FLUSH),
    "the first picture, retrieved": (
        picture(CAMERA.format("", "camera.grab()\n        frame = camera.retrieve()[1]")),
        FLUSH,
    ),
}
SHAPES: dict[str, Case] = {
    "a shell": (
        temperature(f"{FILE}\nvalue = float(subprocess.getoutput('sensors').split()[0])", "subprocess"),
        "SERVE-SHELL",
    ),
    "a shell by its name": (
        temperature(f"{FILE}\nvalue = float(subprocess.run(['sh', '-c', 'sensors'], timeout=5).stdout)", "subprocess"),
        "SERVE-SHELL",
    ),
    "code from a device": (read_by(f"value = eval(({FILE}).read_text())"), "SERVE-DYNAMIC-CODE"),
    "a tool skipped": (swap("mcp.tool(runtime.logged(read_led), annotations=READ)\n", ""), "SERVE-TOOLS-DIFFER"),
    "a tool without the log": (swap("mcp.tool(runtime.logged(read_led)", "mcp.tool(read_led"), "SERVE-TOOL-NOT-LOGGED"),
}
GROUPS = {
    "constants": CONSTANTS,
    "defaults": DEFAULTS,
    "devices": DEVICES,
    "stubs": STUBS,
    "places": PLACES,
    "writing": WRITING,
    "talk": TALK,
    "cameras": CAMERAS,
    "shapes": SHAPES,
}
WRONG = {f"{group}: {name}": case for group, cases in GROUPS.items() for name, case in cases.items()}
