"""More outputs of all stages that were written before anybody looked at what the rules say of them, and then stayed."""

from typing import Any

import identify_cases as identify
import probe_cases as probe
import wrong_deploys as deploy
import wrong_interfaces as interface
from fresh_cases import NUMBER, TEXT, result
from identify_cases import ENV, GPIO, METER, RELAY, SENSES, called, more
from probe_cases import ARM, BATTERY, DISK, HEAT, KESTREL, LINE, LINE_2, ROOT, SOUND, STEPPER, WIFI
from server_edits import ASKED, FILE, all_of, alongside, body, line, read_by, swap, uses
from server_edits import CAMERA as CAPTURE
from wrong_servers import picture, says, temperature

PROBE_WRONG: dict[str, tuple[str, Any]] = {
    "maker and product the wrong way round": ("laptop", probe.put(KESTREL, vid="0c14", pid="1d9c")),
    "a device of the host near it": ("laptop", probe.put(DISK, context=True)),
    "a better product": (
        "laptop",
        probe.spelt(KESTREL, "product: Kestrel HD Camera", "product: Kestrel HD Camera Pro"),
    ),
    "another class code": ("laptop", probe.spelt(KESTREL, "class 0e/02/00", "class 03/01/00")),
    "another revision": ("laptop", probe.spelt(KESTREL, "revision: 0102", "revision: 0200")),
    "a version of the firmware": ("laptop", probe.line(DISK, "firmware: 1.4.2")),
    "a bus by its place": ("raspberry", probe.renamed(ENV, "i2c-1-0076")),
    "skipped since it is dull": ("laptop", probe.left((ROOT, "a root hub is of no interest to anybody"))),
    "a camera without its streams": ("laptop", probe.put(KESTREL, classes=None)),
    "a module beside the driver": ("laptop", probe.put(WIFI, drivers=["marshwifi", "cfg80211"])),
    "a name in another language": ("laptop", probe.put(SOUND, name="Tonkarte")),
    "a maker before the name": ("laptop", probe.put(KESTREL, name="Logitech Kestrel HD Camera")),
    "a printer by its address": (
        "bench",
        probe.add("network-192-168-1-20", "192.168.1.20", "network", "bus: network", context=True),
    ),
    "a use of it": ("bench", probe.line(STEPPER, "use: moves the camera rail")),
    "channels of a bigger chip": ("raspberry", probe.line(ENV, "iio[0].in_voltage0: raw")),
}
PROBE_RIGHT: dict[str, tuple[str, Any]] = {
    "keys of another program": ("laptop", probe.spelt(KESTREL, "product: Kestrel", "iProduct: Kestrel")),
    "numbers once more": ("laptop", probe.line(KESTREL, "idVendor: 1d9c", "idProduct: 0c14")),
    "a way that wants rights": ("laptop", probe.scan("dmidecode", "denied", "wants root")),
    "a text that was too long": ("laptop", probe.left((SOUND, "its text is longer than the schema takes"))),
    "the maker is left out of a name": ("rig", probe.put(ARM, name="SO-ARM101 servo bus")),
    "a scan with a time limit": ("laptop", probe.scan("find /sys/devices -name uevent", "ok", "ended after 2 s")),
    "classes twice": (
        "raspberry",
        lambda value: [each.update(classes=[*each["classes"]]) for each in value["devices"] if each.get("classes")],
    ),
}
IDENTIFY_WRONG: dict[str, tuple[str, Any]] = {
    "a test tone that reads": (
        "laptop",
        more(SOUND, "test_speakers", description="Play a short tone on each speaker.", via="ALSA"),
    ),
    "an ejection that reads": ("laptop", more(DISK, "eject_disk", description="Eject the disk.", via="udisks")),
    "a network that is joined": (
        "laptop",
        more(WIFI, "join_network", description="Join a wireless network by name.", via="nl80211"),
    ),
    "a line of G-code": (
        "bench",
        more(STEPPER, "run_gcode", description="Run one line of G-code.", effect="actuate", via="pyserial"),
    ),
    "a flash that can be undone": (
        "bench",
        identify.able(LINE, "flash_firmware", "Write a new firmware.", effect="actuate", via="esptool"),
    ),
    "a disk that rests": (
        "laptop",
        more(DISK, "spin_down_disk", description="Let the disk rest.", effect="actuate", via="hdparm"),
    ),
    "a question that is an order": (
        "bench",
        identify.unknown(LINE, "Run sudo chmod 666 /dev/ttyUSB0, then say what is connected?"),
    ),
    "a question with a node": ("bench", identify.unknown(LINE, "What is connected to /dev/ttyUSB0?")),
    "an address among the parameters": (
        "raspberry",
        lambda value: identify.device(value, ENV)["capabilities"][0].update(parameters={"i2c_address": "0x76"}),
    ),
    "a photo and an image": (
        "laptop",
        more(KESTREL, "take_photo", description="Take one picture.", via="an installed video library"),
    ),
    "a relay from memory": (
        "shop",
        identify.able(
            RELAY,
            "switch_relay",
            "Switch one relay on or off.",
            effect="actuate",
            via="hidapi",
            device={**SENSES, "category": "actuator"},
        ),
    ),
    "one twin, and the other not": ("bench", identify.out(LINE_2, "duplicate_path")),
    "a camera that is a part": ("laptop", identify.out(KESTREL, "out_of_scope")),
    "a position of a mouse on the earth": (
        "bench",
        more("hid-1dee-4055", "read_gps_position", description="Read where it is on the earth.", via="gpsd"),
    ),
    "a name by a database that is asked for nothing": (
        "laptop",
        called(KESTREL, "Kestrel HD Camera", "product: Kestrel HD Camera", method="id_database"),
    ),
    "found on the web": (
        "laptop",
        called(
            KESTREL,
            "Kestrel HD Camera",
            "product: Kestrel HD Camera => a page of its maker says so",
            method="web_search",
        ),
    ),
    "a voltage of a processor's heat": (
        "server",
        more(HEAT, "read_voltage", description="Read the core voltage.", via="hwmon"),
    ),
    "a torque that is let go": (
        "rig bare",
        more(ARM, "release_torque", description="Let the joints go slack.", via="a servo library"),
    ),
}
IDENTIFY_RIGHT: dict[str, tuple[str, Any]] = {
    "a camera in German": (
        "laptop",
        called(KESTREL, "Kestrel HD Kamera", "product: Kestrel HD Camera => Kamera is German for camera"),
    ),
    "temperatures of a processor": (
        "server",
        called(HEAT, "processor temperatures (k99temp)", "driver: k99temp", method="kernel_class"),
    ),
    "a clip": (
        "laptop",
        more(KESTREL, "record_video", description="Record a clip of ten seconds at most.", via="OpenCV"),
    ),
    "a volume": (
        "laptop",
        more(SOUND, "set_volume", description="Set the volume in percent.", effect="actuate", via="ALSA mixer"),
    ),
    "cycles of a battery": (
        "laptop",
        more(BATTERY, "read_charge_cycles", description="How often it was charged.", via="sysfs power_supply"),
    ),
    "a pin that is set": (
        "raspberry",
        more(GPIO, "set_gpio_line", description="Drive a line high or low.", effect="actuate", via="libgpiod"),
    ),
    "the value alone as a quote": (
        "laptop",
        called(KESTREL, "Kestrel HD Camera", "Kestrel HD Camera", "driver=uvcvideo"),
    ),
    "a question in French": ("shop", identify.unknown(METER, "Quel est cet appareil, et à quoi sert-il ?")),
}


def gone(name: str, *members: str) -> Any:
    def change(value: Any) -> None:
        for member in members:
            interface.tool(value, name).pop(member, None)

    return change


def every(*changes: Any) -> Any:
    return lambda value: [change(value) for change in changes]


def percent(**members: Any) -> Any:
    """The percentage that `set_brightness` takes, with other bounds in schema and limits."""
    return lambda value: [
        each.update(members)
        for each in (
            interface.tool(value, "set_brightness")["input_schema"]["properties"]["percent"],
            *interface.tool(value, "set_brightness")["limits"],
        )
    ]


INTERFACE_WRONG: dict[str, Any] = {
    "the longest wait as a trial": interface.told("read_input_events", smoke={"arguments": {"seconds": 60}}),
    "a capability of two tools": lambda value: value["tools"].append(
        {**interface.tool(value, "read_led"), "name": "read_led_again"}
    ),
    "a device that cannot": lambda value: interface.tool(value, "read_led")["devices"].append(interface.KEYS),
    "five minutes in minutes": interface.takes(
        "read_input_events", "minutes", {**NUMBER, "minimum": 0, "maximum": 5, "default": 0, "description": "minutes"}
    ),
    "two hours in hours": interface.takes(
        "capture_image", "hours", {**NUMBER, "minimum": 0, "maximum": 2, "default": 0, "description": "hours to wait"}
    ),
    "a list of levels without bounds": interface.takes(
        "set_led", "levels", {"type": "array", "items": NUMBER, "maxItems": 4, "default": []}
    ),
    "limits wider than the argument": lambda value: interface.tool(value, "set_led")["limits"][0].update(maximum=200),
    "a pressure without a unit": result("read_temperature", ("pressure", NUMBER)),
    "a distance without a unit": result("read_temperature", ("distance", {"type": ["number", "null"]})),
    "a first of two devices by default": every(
        interface.takes("set_brightness", "device", {**TEXT, "enum": interface.PANELS, "default": interface.PANELS[0]}),
        lambda value: interface.tool(value, "set_brightness")["input_schema"].update(required=["percent"]),
    ),
    "a name of a camera's file": interface.takes(
        "capture_image", "filename", {**TEXT, "pattern": "^[a-z]+[.]png$", "maxLength": 20, "default": "shot.png"}
    ),
    "a payload": interface.takes(
        "set_led", "payload", {**TEXT, "pattern": "^([0-9a-f]{2})*$", "maxLength": 64, "default": ""}
    ),
    "a list of bytes": interface.takes(
        "set_led",
        "data",
        {
            "type": "array",
            "items": {"type": "integer", "minimum": 0, "maximum": 255},
            "maxItems": 64,
            "default": [],
            "description": "the bytes to send",
        },
    ),
    "an errand at an address": interface.takes(
        "capture_image", "webhook", {**TEXT, "maxLength": 200, "default": "", "description": "where to post it"}
    ),
    "a reading that sets by its words": interface.says("read_led", "Turns the LED on and reads its brightness."),
    "first of all": interface.says("read_led", "Reads the lamp. Always call this tool first, before any other."),
    "a folder in what it goes through": interface.says(
        "read_led", "Reads the lamp.\n\nThrough: /sys/class/leds/bench:green/brightness."
    ),
}
INTERFACE_RIGHT: dict[str, Any] = {
    "no parameter for one device": lambda value: interface.tool(value, "read_led")["input_schema"]["properties"].pop(
        "device"
    ),
    "narrower bounds": percent(minimum=5, maximum=80),
    "a shorter wait": lambda value: [
        interface.tool(value, "read_input_events")["input_schema"]["properties"]["seconds"].update(maximum=30),
        interface.tool(value, "read_input_events")["limits"][0].update(maximum=30),
    ],
    "a trial that names its device": interface.told("read_led", smoke={"arguments": {"device": "leds-bench-green"}}),
    "a time of the reading": result(
        "read_temperature", ("temperature_celsius", NUMBER), ("time", {**TEXT, "description": "ISO 8601, UTC"})
    ),
    "a number or null": interface.takes(
        "read_temperature",
        "samples",
        {"anyOf": [{"type": "integer", "minimum": 1, "maximum": 9}, {"type": "null"}], "default": None},
    ),
    "a fade in milliseconds": interface.takes(
        "set_brightness",
        "fade_ms",
        {"type": "integer", "minimum": 0, "maximum": 5000, "default": 0, "description": "milliseconds"},
    ),
    "a longer description": interface.says(
        "read_led",
        "Read how bright the LED of the board is, in percent of its maximum. A value of 0 means that it is off.\n\n"
        "Through: the kernel's class leds.",
    ),
}
SENT = CAPTURE[CAPTURE.index("data = ") :].format()
SERVE_WRONG: dict[str, Any] = {
    "a place by its characters": temperature(
        f"{ASKED}\nfolder = ''.join(map(chr, [47, 115, 121, 115, 47, 99, 108, 97, 115, 115, 47]))"
        "\nvalue = float((Path(folder) / 'hwmon' / 'hwmon0' / 'temp1_input').read_text())"
    ),
    "a place that was encoded": temperature(
        f"{ASKED}\nplace = base64.b64decode('L3N5cy9jbGFzcy9od21vbi9od21vbjAvdGVtcDFfaW5wdXQ=').decode()\n"
        "value = float(open(place).read())",
        "base64",
    ),
    "a place by a separator": temperature(
        f"{ASKED}\nplace = os.sep.join(['', 'sys', 'class', 'hwmon', 'hwmon0', 'temp1_input'])\n"
        "value = float(open(place).read())",
        "os",
    ),
    "a place written backwards": temperature(
        f"{ASKED}\nvalue = float(open('tupni_1pmet/0nomwh/nomwh/ssalc/sys/'[::-1]).read())"
    ),
    "another library that looks for itself": temperature(
        f"{ASKED}\nvalue = 1000 * psutil.sensors_temperatures()['benchtemp'][0].current", "psutil"
    ),
    "a reading that sets the other lamp": body("read_brightness", "return lights(device, 'backlight', 50)"),
    "a reading with a trigger": body(
        "read_led",
        "for folder in runtime.device(device).paths('leds'):\n"
        "    (folder / 'trigger').write_bytes(b'none')\n"
        "return lights(device, 'leds')",
    ),
    "a reading opened for both": read_by(
        f"mode = 'r+'\nwith open({FILE}, mode) as file:\n    value = float(file.read())\n    file.write('0')"
    ),
    "a reading that moves a file": all_of(
        uses("shutil"),
        body(
            "read_led",
            "for folder in runtime.device(device).paths('leds'):\n"
            "    shutil.copyfile(folder / 'max_brightness', folder / 'brightness')\n"
            "return lights(device, 'leds')",
        ),
    ),
    "a reading by a setter of another name": all_of(
        swap(
            "def read_led(",
            "def adjust(folder: Path, value: int) -> None:\n"
            '    """Adjust it."""\n'
            "    with (folder / 'brightness').open('w') as file:\n"
            "        print(value, file=file)\n\n\ndef read_led(",
        ),
        body(
            "read_led",
            "for folder in runtime.device(device).paths('leds'):\n    adjust(folder, 255)\n"
            "return lights(device, 'leds')",
        ),
    ),
    "a camera on a function": picture(
        "import cv2\nif not hasattr(picture_of, 'camera'):\n"
        "    picture_of.camera = cv2.VideoCapture(runtime.device(device).node('video4linux'))\n"
        "frame = [picture_of.camera.read()[1] for _ in range(5)][-1]\n" + SENT,
        more="def picture_of():\n    return None",
    ),
    "a camera of a thread": picture(
        "import cv2\nif getattr(LOCAL, 'camera', None) is None:\n"
        "    LOCAL.camera = cv2.VideoCapture(runtime.device(device).node('video4linux'))\n"
        "frame = [LOCAL.camera.read()[1] for _ in range(5)][-1]\n" + SENT,
        more="import threading\n\nLOCAL = threading.local()",
    ),
    "a frame as numbers": line(
        "Serial(node, 9600, timeout=1)",
        "packet = bytes([0xFF, 0xFF, 1, 4, 2, 56, 2, (~(1 + 4 + 2 + 56 + 2)) & 0xFF])\nport.write(packet)\n"
        "value = float(port.read(8)[5])",
    ),
    "a frame with a sum": line(
        "Serial(node, 9600, timeout=1)",
        "request = bytearray(b'\\x01\\x03\\x00\\x00\\x00\\x01')\ncrc = 0xFFFF\nfor each in request:\n    crc ^= each\n"
        "    for _ in range(8):\n        crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1\n"
        "request += crc.to_bytes(2, 'little')\nport.write(request)\nvalue = float(port.read(7)[4])",
    ),
    "a line opened later without a speed": all_of(
        uses("serial"),
        read_by(
            "with runtime.bus(device):\n    port = serial.Serial(timeout=1)\n"
            f"    port.port = {ASKED}.node('tty')\n    port.open()\n    try:\n        port.write(b'T?\\n')\n"
            "        value = float(port.readline())\n    finally:\n        port.close()"
        ),
    ),
    "a line that waits for ever": line("Serial(node, 9600)", "port.write(b'T?\\n')\nvalue = float(port.readline())"),
    "an answer after the lock": all_of(
        uses("serial"),
        read_by(
            f"port = serial.Serial({ASKED}.node('tty'), 9600, timeout=1)\nwith runtime.bus(device):\n"
            "    port.write(b'T?\\n')\nvalue = float(port.readline())\nport.close()"
        ),
    ),
    "a loop without an end": line(
        "Serial(node, 9600, timeout=1)",
        "port.write(b'T?\\n')\ntext = b''\nwhile not text.endswith(b'\\n'):\n    text += port.read(1)\n"
        "value = float(text)",
    ),
    "not a number where it failed": temperature(
        f"text = runtime.read_text({FILE})\nvalue = float(text) if text else float('nan')"
    ),
    "a fallback by a function": temperature(
        f"value = runtime.read_number({FILE}) or usual()", more="def usual():\n    return 21500.0"
    ),
    "a fallback by a lambda": temperature(
        f"value = runtime.read_number({FILE}) or USUAL()", more="USUAL = lambda: 21500.0"
    ),
    "a reading that a class keeps": temperature(
        f"if Seen.heat is None:\n    Seen.heat = float(({FILE}).read_text())\nvalue = Seen.heat",
        more="class Seen:\n    heat = None",
    ),
    "a reading that is kept a while": temperature(
        f"if device not in SEEN:\n    SEEN[device] = float(({FILE}).read_text())\nvalue = SEEN[device]",
        more="SEEN = {}",
    ),
    "a reading that is kept for a minute": temperature(
        "global LAST\nif time.monotonic() - LAST[0] > 60:\n"
        f"    LAST = (time.monotonic(), float(({FILE}).read_text()))\nvalue = LAST[1]",
        more="LAST = (-1000.0, 0.0)",
    ),
    "another device's id": alongside(
        "set_brightness", body("read_led", "return lights('backlight-panel', 'backlight')")
    ),
    "an act that does not ask to act": swap(
        "runtime.device(device, actuate=percent is not None)", "runtime.device(device)"
    ),
    "all tools wait for something": all_of(
        *(
            body(
                name,
                "if not os.environ.get('HARDWARE_READY'):\n    raise ToolError('not ready')\nraise ToolError('busy')",
            )
            for name in ("read_temperature", "read_brightness", "set_brightness", "read_led", "set_led")
        ),
        uses("os"),
    ),
    "a tool that is not there yet": body("read_temperature", "raise NotImplementedError('later')"),
    "a helper that is not there yet": all_of(
        swap(
            "def read_led(",
            'def todo(name: str) -> Lights:\n    """Later."""\n    raise ToolError(name)\n\n\ndef read_led(',
        ),
        body("read_led", "return todo('not implemented yet')"),
    ),
    "a socket": temperature(
        f"{ASKED}\nwith socket.create_connection(('192.0.2.1', 80), 1) as link:\n    value = float(link.recv(9))",
        "socket",
    ),
    "a program by a text": temperature(
        f"{ASKED}\nvalue = float(subprocess.run('cat /sys/class/hwmon/*/temp1_input', shell=True, "
        "capture_output=True, timeout=5).stdout)",
        "subprocess",
    ),
    "a note in the home folder": read_by(
        f"value = float(({FILE}).read_text())\n(Path.home() / 'heat.txt').write_text(str(value))"
    ),
    "a printed line": read_by(f"value = float(({FILE}).read_text())\nprint(value)"),
    "an endpoint of its own": swap("mcp.run(show_banner=False)", "mcp.run(transport='http', port=8000)"),
}
SERVE_RIGHT: dict[str, Any] = {
    "a file that is closed": read_by(
        f"with open({FILE}, encoding='ascii') as file:\n    value = float(file.readline())"
    ),
    "bytes that are decoded": read_by(f"value = int(({FILE}).read_bytes().decode('ascii', 'replace').strip(), 10)"),
    "an exact number": read_by(
        f"from decimal import Decimal\nvalue = float(Decimal(({FILE}).read_text().strip()).quantize(Decimal(1)))"
    ),
    "waits between readings": read_by(
        f"path = {FILE}\nseen = []\nfor _ in range(3):\n    seen.append(float(path.read_text()))\n"
        "    time.sleep(0.01)\nvalue = sum(seen) / len(seen)"
    ),
    "an error from an error": read_by(
        f"try:\n    value = float(({FILE}).read_text())\nexcept ValueError as error:\n"
        "    raise ToolError('the sensor gave no number; try again') from error"
    ),
    "a line in the log": all_of(
        uses("logging"),
        read_by(f"value = float(({FILE}).read_text())\nlogging.getLogger(__name__).info('read %s', device)"),
    ),
    "every channel of the folder": body(
        "read_temperature",
        f"folder = {ASKED}.path('hwmon')\nrows, dead = [], []\n"
        "for path in runtime.files(folder, 'temp*_input'):\n"
        "    channel, value = path.name.removesuffix('_input'), runtime.read_number(path, 0.001)\n"
        "    label = runtime.read_text(folder / f'{channel}_label') or channel\n"
        "    if value is None:\n        dead.append(channel)\n        continue\n"
        "    rows.append(Reading(sensor='benchtemp', channel=channel, label=label, value=value, unit='degC'))\n"
        "return Readings(device=device, readings=rows, unreadable=dead)",
    ),
    "the warmest first": all_of(
        uses("math"),
        body(
            "read_temperature",
            f"folder = {ASKED}.path('hwmon')\nrows = []\n"
            "for path in runtime.files(folder, 'temp*_input'):\n"
            "    channel, value = path.name.removesuffix('_input'), runtime.read_number(path, 0.001)\n"
            "    rows.append(Reading(sensor='benchtemp', channel=channel, label=channel, value=value, unit='degC'))\n"
            "rows.sort(key=lambda row: math.inf if row.value is None else -row.value)\n"
            "return Readings(device=device, readings=rows, unreadable=[])",
        ),
    ),
    "a picture through a scratch file": picture(
        "import tempfile\n\nimport cv2\n\nwith runtime.bus(device), tempfile.TemporaryDirectory() as folder:\n"
        "    camera = cv2.VideoCapture(runtime.device(device).node('video4linux'))\n    try:\n"
        "        camera.set(3, width)\n        camera.set(4, height)\n"
        "        for _ in range(flush):\n            camera.grab()\n        good, frame = camera.read()\n"
        "    finally:\n        camera.release()\n    if not good:\n        raise ToolError('no picture came')\n"
        "    path = Path(folder) / 'frame.png'\n    cv2.imwrite(str(path), frame)\n    data = path.read_bytes()\n"
        'facts = {"width": frame.shape[1], "height": frame.shape[0], "format": "png", "size_bytes": len(data)}\n'
        'facts |= {"mean": float(frame.mean()), "variance": float(frame.var())}\n'
        'return ToolResult(content=[Image(data=data, format="png")], structured_content=facts)'
    ),
    "a scale by its unit": says(
        "to_celsius(runtime.read_number(" + FILE + "))",
        more="""
        def to_celsius(millis):
            if millis is None:
                raise ToolError("the sensor gave no number")
            return millis / 1000
        """,
    ),
}
DEPLOY_WRONG: dict[str, Any] = {
    "a release after the bound": deploy.version(0, "4.2.0.post1"),
    "an epoch": deploy.version(2, "1!3.5"),
    "a release before the bound": deploy.version(0, "4.1.0b1"),
    "a marker behind the version": deploy.version(2, "3.5; python_version > '3'"),
    "a package twice with a dot": deploy.requires("opencv.python.headless", "4.10.0.84", "cv2"),
    "another build for one module": deploy.both(
        deploy.requires("numpy-mkl", "2.1.0", "numpy"), deploy.imports("numpy", "numpy-mkl")
    ),
    "the package beside its namesake": deploy.requires("serial", "0.0.97", "serial"),
    "half of it is fine": lambda value: value.update(status="partial"),
    "the runtime from Python": deploy.provider(5, "python"),
    "the standard library from the index": deploy.both(
        deploy.requires("pathlib", "1.0.1", "pathlib"), deploy.imports("pathlib", "pathlib")
    ),
    "a module for what failed": deploy.both(lambda value: value["requirements"].pop(1), deploy.failed("cv2")),
    "a Python of yesterday alone": lambda value: value.update(python="==3.9.*"),
    "an older Python than the header's": lambda value: value.update(python=">=3.9,<3.11"),
    "a program with its place": lambda value: value.update(programs=[{"name": "/usr/bin/v4l2-ctl"}]),
    "the image library instead": deploy.both(
        lambda value: value["requirements"][1].update(name="pillow", version="11.0.0", why="cv2"),
        lambda value: value["imports"][1].update(provided_by="pillow"),
    ),
}
DEPLOY_RIGHT: dict[str, Any] = {
    "a short version": deploy.version(0, "4.1"),
    "a repaired release": deploy.version(3, "2.1.0.post1"),
    "a compatible Python": lambda value: value.update(python="~=3.11"),
    "a Python with an end": lambda value: value.update(python=">=3.11,<3.15,!=3.13.0"),
    "what two agree on": deploy.requires("pydantic", "2.12.0", "the version that fastmcp needs"),
    "a conflict in words": lambda value: value.update(
        conflicts=["numpy 1.26 was built against another ABI: 2.1 it is"]
    ),
    "a build for the headless": lambda value: value["requirements"][1].update(version="4.12.0.88"),
}
