"""Classes and facts that PROBE does not bear out, devices merged, split and exchanged, and right ones in unusual words.

Each set was written before anybody looked at what the rules say of it, and then stayed.
"""

from typing import Any

import identify_cases as identify
import probe_cases as probe
import wrong_deploys as deploy
from identify_cases import BOARD, ENV, GPIO, LEDS, LIGHT, called, more, out, put
from probe_cases import (
    ARM,
    BATTERY,
    CAMERA,
    CHIP,
    DISK,
    HEAT,
    KESTREL,
    KEYS,
    LINE,
    LINE_2,
    MONITOR,
    MOUSE,
    PAD,
    RAIL,
    SOUND,
    STEPPER,
    TWIN,
    WIFI,
)
from server_edits import FILE, MAIN, adds, all_of, body, read_by, swap, uses
from unseen_cases import every
from wrong_interfaces import takes, tool

CAM, PANEL = "usb-1f00-00c1", "backlight-panel"
BOTH = ("hwmon-benchtemp", CAM)


def of_class(where: str, device: str, name: str) -> tuple[str, Any]:
    return where, identify.put(device, **{"class": name})


IDENTIFY_WRONG: dict[str, tuple[str, Any]] = {
    f"class: {device} as {name}": of_class(where, device, name)
    for where, device, name in [
        ("laptop", KESTREL, "light"),
        ("laptop", KESTREL, "microphone"),
        ("laptop", BATTERY, "storage"),
        ("laptop", DISK, "camera"),
        ("laptop", WIFI, "bluetooth"),
        ("laptop", SOUND, "keyboard"),
        ("laptop", KEYS, "touchscreen"),
        ("laptop", CHIP, "battery"),
        ("raspberry", ENV, "gpio"),
        ("raspberry", GPIO, "serial"),
        ("bench", STEPPER, "camera"),
        ("rig", CAMERA, "scanner"),
        ("rig bare", ARM, "printer"),
    ]
}
IDENTIFY_RIGHT: dict[str, tuple[str, Any]] = {
    f"class: {device} as {name}": of_class(where, device, name)
    for where, device, name in [
        ("laptop", KESTREL, "webcam"),
        ("laptop", BATTERY, "power"),
        ("laptop", DISK, "disk"),
        ("laptop", WIFI, "network"),
        ("laptop", SOUND, "audio"),
        ("laptop", CHIP, "temperature"),
        ("raspberry", ENV, "environment"),
        ("raspberry", GPIO, "gpio_chip"),
        ("raspberry", LEDS, "light"),
        ("laptop", LIGHT, "light"),
        ("laptop", KEYS, "keyboard"),
        ("laptop", WIFI, "ethernet"),
        ("laptop", KESTREL, "video"),
        ("bench", LINE, "serial"),
    ]
}


def fact(device: str, ability: str, **parameters: Any) -> Any:
    """Other parameters of a capability."""
    return lambda value: identify.ability(value, device, ability).setdefault("parameters", {}).update(parameters)


def channel(device: str, ability: str, **members: Any) -> Any:
    """Other members of the first channel of a capability."""
    return lambda value: identify.ability(value, device, ability)["parameters"]["channels"][0].update(members)


def steps(**members: Any) -> Any:
    """Other members of the parameter of the rail's first command."""
    return lambda value: identify.ability(value, RAIL, "rail_move_x")["parameters"]["steps"].update(members)


METADATA = "video4linux-kestrel-hd-camera-kestrel-hd-c"
IDENTIFY_WRONG |= {
    f"fact: {name}": case
    for name, case in {
        "evidence of its neighbour": ("bench", called(LINE, "Heron Stepper", "product: Heron Stepper <serial>")),
        "a revision as a proof": (
            "laptop",
            called(KESTREL, "Kestrel 4K camera", "product: Kestrel HD Camera", "revision: 0102 => the 4K version"),
        ),
        "a channel beside the last": ("raspberry", channel(ENV, "read_temperature", channel="in_temp2")),
        "channels from zero": ("server", channel(MONITOR, "read_fan_speed", channel="fan0")),
        "channels by their names alone": ("raspberry", fact(ENV, "read_pressure", channels=["in_pressure", "in_gas"])),
        "the fans of a usual board": ("server", fact(MONITOR, "read_fan_speed", fans=["CPU fan", "rear fan"])),
        "a battery's heat": ("laptop", more(BATTERY, "read_temperature", description="Read how warm it is.")),
        "a battery's current": ("laptop", more(BATTERY, "read_current", description="Read the current in mA.")),
        "a chip without a fan": ("laptop", more(CHIP, "read_fan_speed", description="Read the fan.", via="hwmon")),
        "fewer lines than there are": ("raspberry", fact(GPIO, "read_gpio_lines", lines=28)),
        "the usual range of a light": ("laptop", fact(LIGHT, "set_brightness", range="0 to 255")),
        "a rate and a depth of the usual card": ("laptop", fact(SOUND, "record_audio", rate_hz=192000, bit_depth=24)),
        "a picture of what has none": (
            "laptop",
            more(METADATA, "capture_image", description="Take one picture.", via="OpenCV"),
        ),
        "wider than its profile": ("rig", steps(maximum=20000)),
        "below its profile": ("rig", steps(minimum=-2001)),
        "in millimetres": ("rig", steps(unit="mm")),
        "a command less": ("rig", lambda value: identify.device(value, RAIL)["capabilities"].pop(1)),
        "a keyboard that is a way to the touch pad": ("laptop", out(KEYS, "duplicate_path")),
        "a disk that is a way to its twin": ("server", out(TWIN, "duplicate_path")),
        "a sound card that wants a password": ("laptop", out(SOUND, "no_credentials")),
        "a battery that wants a password": ("laptop", out(BATTERY, "no_credentials")),
        "what watches": ("laptop", called(KESTREL, "Kestrel HD \u00dcberwachungskamera", "product: Kestrel HD Camera")),
        "sure of what was not read": (
            "raspberry",
            put("w1-family-28", identified_as="DS18B20 temperature sensor", confidence=1.0),
        ),
        "unknown, and a camera": ("bench", put(LINE, **{"class": "camera"})),
        "unknown, and a robot": ("bench", put(LINE_2, **{"class": "robot"})),
        "unknown, and a disk": ("bench", put(LINE, **{"class": "disk"})),
    }.items()
}
IDENTIFY_RIGHT |= {
    f"fact: {name}": case
    for name, case in {
        "a camera in Spanish": (
            "laptop",
            called(
                KESTREL, "c\u00e1mara Kestrel HD", "product: Kestrel HD Camera => c\u00e1mara is Spanish for camera"
            ),
        ),
        "a lamp of a key": ("laptop", more(KEYS, "read_led", description="Read whether its light is on.", via="leds")),
        "a battery by all its strings": (
            "laptop",
            called(
                BATTERY,
                "Reed Cells RC-57 Li-ion battery",
                "power_supply[0].manufacturer: Reed Cells",
                "power_supply[0].model_name: RC-57",
                "technology: Li-ion",
            ),
        ),
        "a voltage of a battery": ("laptop", more(BATTERY, "read_voltage", description="Read its voltage.")),
        "steps that are shown": ("laptop", fact(LIGHT, "set_brightness", range="0 to 1500", steps=1500)),
        "a range of percent": ("laptop", fact(LIGHT, "set_brightness", range="0 to 100 percent")),
        "lines that are shown": ("raspberry", fact(GPIO, "read_gpio_lines", lines=58, labels=["pinctrl-soc2711"])),
        "rates that are asked for": ("laptop", fact(SOUND, "record_audio", rates="asked at every call")),
        "channels by their names alone": ("raspberry", fact(ENV, "read_pressure", channels=["in_pressure"])),
        "narrower than its profile": ("rig", steps(minimum=-500, maximum=500)),
        "a board": (
            "laptop",
            called(BOARD, "Marsh Computing Heron 14", "dmi[0].sys_vendor: Marsh Computing", "product_name: Heron 14"),
        ),
        "unknown, and a serial line": ("bench", put(LINE, **{"class": "serial_adapter"})),
        "unknown, and unknown": ("bench", put(LINE, **{"class": "unknown"})),
        "unknown, and a converter": ("bench", put(LINE, **{"class": "usb_serial_converter"})),
    }.items()
}


def exchanged(value: Any) -> None:
    """The places of two equal adapters, the one's at the other."""
    one, two = probe.found(value, LINE), probe.found(value, LINE_2)
    one["instance"], two["instance"] = two["instance"], one["instance"]


PROBE_WRONG: dict[str, tuple[str, Any]] = {
    f"part: {name}": case
    for name, case in {
        "twins with each other's places": ("bench", exchanged),
        "a disk of round gigabytes": ("laptop", probe.place(DISK, size_bytes=512_000_000_000)),
        "the monitor apart from its card": (
            "laptop",
            probe.add("drm-reed-panel", "Reed Panel", "drm", "monitor: Reed Panel\nmonitor_vendor: MER"),
        ),
        "the codec apart from its card": (
            "laptop",
            probe.add("hdaudio-marsh-mr245", "Marsh MR245", "hdaudio", "codec: Marsh MR245"),
        ),
        "two adapters as one, with a count": ("bench", every(probe.drop(LINE_2), probe.place(LINE, count=2))),
        "a touch pad as a touch screen": ("laptop", probe.spelt(PAD, "kinds: touchpad", "kinds: touchscreen")),
        "a mouse on the bus of its receiver": ("bench", probe.put(MOUSE, interface="usb")),
        "a wireless mouse that is near": ("bench", probe.put(MOUSE, context=True)),
        "another chemistry": ("laptop", probe.spelt(BATTERY, "Li-ion", "Li-poly")),
        "a label in better words": ("laptop", probe.spelt(CHIP, "Package id 0", "CPU Package")),
        "numbers in decimal": ("laptop", probe.put(KESTREL, vid="7580")),
        "numbers byte by byte the wrong way round": ("laptop", probe.put(KESTREL, vid="9c1d")),
        "the newest kernel": ("laptop", probe.platform(kernel="6.8.0-45-generic")),
        "fewer lines than there are": ("raspberry", probe.spelt(GPIO, "ngpio: 58", "ngpio: 54")),
        "a light that is on or off": ("raspberry", probe.spelt(LEDS, "max_brightness: 255", "max_brightness: 1")),
        "a radio that it should have": ("laptop", probe.put(WIFI, classes=["net", "bluetooth"])),
        "fans from zero": (
            "server",
            every(
                probe.spelt(MONITOR, "fan1: input label=CPU fan", "fan0: input label=CPU fan"),
                probe.spelt(MONITOR, "fan2: input", "fan1: input"),
            ),
        ),
        "a label of another channel": (
            "server",
            probe.spelt(HEAT, "temp1: input label=Tctl", "temp1: input label=Tdie"),
        ),
    }.items()
}
PROBE_RIGHT: dict[str, tuple[str, Any]] = {
    f"part: {name}": case
    for name, case in {
        "keys of the udev database": ("laptop", probe.line(KESTREL, "ID_VENDOR_ID=1d9c", "ID_MODEL_ID=0c14")),
        "the interface's driver alone": ("laptop", probe.put(KESTREL, drivers=["uvcvideo"])),
        "without the names of readings": ("laptop", probe.drop_lines(BATTERY, "power_supply[0].readings")),
        "lines in another order": (
            "laptop",
            lambda value: [
                each.update(raw_descriptor="\n".join(reversed(each["raw_descriptor"].splitlines())))
                for each in value["devices"]
            ],
        ),
        "an instance of the serial number alone": (
            "laptop",
            lambda value: probe.found(value, KESTREL).update(instance={"serial": "KO-200417"}),
        ),
        "numbers with a prefix": ("laptop", probe.spelt(KESTREL, "vendor_id: 1d9c", "vendor_id: 0x1d9c")),
        "both nodes of a camera as one": ("laptop", probe.drop(METADATA)),
        "the size of a disk": ("laptop", probe.place(DISK, size_bytes=512_110_190_592)),
        "a count with another key": ("raspberry", probe.line(GPIO, "gpio ngpio: 58")),
    }.items()
}


def called_otherwise(index: int, name: str) -> Any:
    """Another name of a requirement and of what provides its module."""
    return deploy.both(lambda value: value["requirements"][index].update(name=name), deploy.provider(index, name))


DEPLOY_WRONG: dict[str, Any] = {
    f"set: {name}": case
    for name, case in {
        "a letter less": called_otherwise(1, "opencv-python-headles"),
        "a letter more": called_otherwise(3, "numpyy"),
        "a letter more, beside it": deploy.requires("numpyy", "2.1.0", "numpy, for older code"),
        "a letter less, beside it": deploy.requires("pyseral", "3.5", "the line"),
        "another letter, beside it": deploy.requires("pyserlal", "3.5", "the line"),
        "a separator, beside it": deploy.requires("py-serial", "3.5", "serial, for safety"),
        "an epoch": deploy.version(0, "1!4.1.2"),
        "reasons of each other": deploy.both(
            lambda value: value["requirements"][1].update(why="serial"),
            lambda value: value["requirements"][2].update(why="cv2"),
        ),
        "a Python that is to come": lambda value: value.update(python=">=4"),
        "an old Python only": lambda value: value.update(python="==3.10.*"),
        "what installs": deploy.requires("pip", "24.0", "installs the others"),
        "a module of two providers": deploy.imports("numpy", "opencv-python-headless"),
        "a module by its package's name": deploy.both(
            lambda value: value["imports"].pop(1), deploy.imports("opencv-python-headless", "opencv-python-headless")
        ),
        "a program that is Python": lambda value: value.update(programs=[{"name": "python3", "package": "python3"}]),
        "all of it failed": deploy.both(deploy.failed("fastmcp"), lambda value: value["requirements"].pop(0)),
        "a version before the release": deploy.version(2, "3.5b0"),
        "a part of the package": lambda value: value["requirements"][0].update(name="fastmcp-slim"),
    }.items()
}
DEPLOY_RIGHT: dict[str, Any] = {
    f"set: {name}": case
    for name, case in {
        "the first of the range": deploy.version(0, "4.1.0"),
        "a release after it": deploy.version(0, "4.1.2.post1"),
        "a compatible release": deploy.version(2, "3.5.1"),
        "a Python without one": lambda value: value.update(python=">=3.11,!=3.13.0"),
        "one more part of Python": deploy.imports("os", "python"),
        "what must not be together": lambda value: value.update(conflicts=["numpy 2.0.0 breaks opencv 4.10"]),
        "a reason in a sentence": lambda value: value["requirements"][1].update(
            why="cv2 (takes the pictures; the headless build, since nothing shows windows)"
        ),
        "a plugin of one": deploy.requires("pyserial-asyncio", "0.6", "a version that pyserial 3.5 works with"),
    }.items()
}


def offers(name: str, parameter: str, *choices: str, **more: Any) -> Any:
    """One more parameter of a tool, with these choices."""
    return takes(name, parameter, {"type": "string", "enum": [*choices], "default": choices[0]}, **more)


INTERFACE_WRONG: dict[str, Any] = {
    f"another's: {name}": case
    for name, case in {
        "a camera as the source of a temperature": offers("read_temperature", "source", *BOTH),
        "a panel as the target of a lamp": offers("set_led", "target", "leds-bench-green", PANEL, limits=[]),
        "two panels as the lamp": offers("set_led", "which", PANEL, "backlight-panel2", limits=[]),
        "the panels of a camera": offers("capture_image", "panel", "panel", "panel2"),
        "a lamp of a camera": offers("capture_image", "flash", "bench:green"),
        "the keys of a disk": offers("read_storage", "unit", "usb-1f00-00d1", "platform-keys"),
        "a device by a constant": takes("read_led", "source", {"type": "string", "const": CAM, "default": CAM}),
    }.items()
}
INTERFACE_RIGHT: dict[str, Any] = {
    f"another's: {name}": case
    for name, case in {
        "its own device by another name": offers("read_temperature", "source", "hwmon-benchtemp"),
        "its own lamp by another name": offers("set_led", "lamp", "bench:green", limits=[]),
        "one of its own panels": offers("read_brightness", "panel", "panel", "panel2"),
        "words": offers("capture_image", "mode", "auto", "night"),
        "a word that is in another's name": offers("capture_image", "board", "bench", "wall"),
    }.items()
}

SHOT = """
def shot(node, width, height):
    import cv2

    camera = cv2.VideoCapture(node)
    try:
        camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        frame = [camera.read()[1] for _ in range(5)][-1]
    finally:
        camera.release()
    rows, columns = frame.shape[:2]
    data = cv2.imencode(".png", frame)[1].tobytes()
    facts = {"width": columns, "height": rows, "format": "png", "size_bytes": len(data)}
    return data, facts | {"mean": float(frame.mean()), "variance": float(frame.var())}
"""
TAKES = """
with runtime.device(device).bus() as unit:
    data, facts = runtime.child.call(shot, unit.node("video4linux"), width, height)
if format == "jpeg" and flush > 60:
    raise ToolError("no more than 60 pictures can be thrown away")
return ToolResult(content=[Image(data=data, format="png")], structured_content=facts)
"""


def picture(*changes: tuple[str, str], of: str = TAKES) -> Any:
    """`capture_image` with changes of the function that takes the picture, or of its call."""
    text = f"{SHOT}\x00{of}"
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    made, called_by = text.split("\x00")
    return all_of(swap(MAIN, f"\n\n{made.strip()}{MAIN}"), body("capture_image", called_by))


WIDE, HIGH = "camera.set(cv2.CAP_PROP_FRAME_WIDTH, width)", "camera.set(cv2.CAP_PROP_FRAME_HEIGHT, height)"
PASSED, SHAPE, FACTS = "width, height)\nif", "rows, columns = frame.shape[:2]", '"width": columns, "height": rows'
SERVE_WRONG: dict[str, Any] = {
    f"size: {name}": case
    for name, case in {
        "fixed": picture((PASSED, "640, 480)\nif")),
        "a fixed width": picture((PASSED, "1280, height)\nif")),
        "a fixed height, by its name": picture((PASSED, "width=width, height=720)\nif")),
        "of a table": picture((PASSED, "*{'size': (1280, 720)}['size'])\nif")),
        "not set": picture((WIDE, "pass"), (HIGH, "pass")),
        "a width that is not set": picture((WIDE, "pass")),
        "fixed where it is set": picture(
            (WIDE, WIDE.replace(" width", " 640")), (HIGH, HIGH.replace(" height", " 480"))
        ),
        "in each other's place where it is set": picture(
            (WIDE, WIDE.replace(" width", " height")), (HIGH, HIGH.replace(" height", " width"))
        ),
        "in each other's place by the property": picture(
            (WIDE, WIDE.replace("WIDTH", "HEIGHT")), (HIGH, HIGH.replace("HEIGHT, h", "WIDTH, h"))
        ),
        "in each other's place by the property's number": picture(
            (WIDE, "camera.set(4, width)"), (HIGH, "camera.set(3, height)")
        ),
        "in each other's place in a pair": picture((PASSED, "*(height, width))\nif")),
        "in each other's place by name": picture((PASSED, "width=height, height=width)\nif")),
        "exchanged on the way": picture((WIDE, f"width, height = height, width\n        {WIDE}")),
        "cut to a square": picture((PASSED, "width, width)\nif")),
        "ignored by a function of a function": all_of(
            picture(("call(shot,", "call(taken,")),
            adds("def taken(node, width, height):\n    return shot(node, 1280, 720)"),
        ),
    }.items()
}
SERVE_RIGHT: dict[str, Any] = {
    f"size: {name}": case
    for name, case in {
        "as it is asked for": picture(),
        "by keywords": picture((PASSED, "height=height, width=width)\nif")),
        "by a function of a function": all_of(
            picture(("call(shot,", "call(taken,")),
            adds("def taken(node, width, height):\n    return shot(node, width, height)"),
        ),
        "in a pair": picture((PASSED, "*(width, height))\nif")),
        "by whatever keywords": picture(
            (PASSED, "width=width, height=height)\nif"),
            ("shot(node, width, height)", "shot(node, **size)"),
            (WIDE, WIDE.replace(" width", " size['width']")),
            (HIGH, HIGH.replace(" height", " size['height']")),
        ),
        "in an object": all_of(
            picture((PASSED, "*Wish(width, height).both())\nif")),
            adds(
                "class Wish:\n    def __init__(self, width, height):\n        self.sides = width, height\n\n"
                "    def both(self):\n        return self.sides"
            ),
        ),
        "by the properties' numbers": picture((WIDE, "camera.set(3, width)"), (HIGH, "camera.set(4, height)")),
        "as floats": picture((WIDE, WIDE.replace(" width", " float(width)"))),
        "by a loop over both": picture(
            (
                WIDE,
                "for key, number in ((cv2.CAP_PROP_FRAME_WIDTH, width), (cv2.CAP_PROP_FRAME_HEIGHT, height)):\n"
                "            camera.set(key, number)",
            ),
            (HIGH, "pass"),
        ),
        "resized afterwards": picture(
            (WIDE, "pass"), (HIGH, "pass"), (SHAPE, f"frame = cv2.resize(frame, (width, height))\n    {SHAPE}")
        ),
        "turned by a quarter": picture((SHAPE, f"frame = cv2.rotate(frame, cv2.ROTATE_90_CLOCKWISE)\n    {SHAPE}")),
    }.items()
}
MORE = ('"value": float, "unit"', '"value": float, "low": float, "high": float, "unit"')


def span(low: str, high: str, text: str = "value = float(({}).read_text())") -> Any:
    """A temperature with its bounds, of which INTERFACE declares both."""

    def declares(interface: Any) -> None:
        rows = tool(interface, "read_temperature")["output_schema"]["properties"]["readings"]["items"]
        rows["properties"].update(low={"type": "number"}, high={"type": "number"})
        rows["required"] += ["low", "high"]

    value = f"value / 1000, low={low}, high={high}"
    return all_of(swap(*MORE), read_by(text.format(FILE), value)), declares


BOUNDS = """folder = ({}).parent
value = float((folder / "temp1_input").read_text())
low, high = float((folder / "temp1_min").read_text()), float((folder / "temp1_max").read_text())
"""
PERIOD = "def period(rate):\n    return 1 / rate"
CLOCK = "class Clock:\n    def period(self, rate):\n        return 1 / rate"


def rates(low: str, high: str, *edits: Any) -> Any:
    """The bounds of a period by the least and the highest rate, which its folder has as files."""
    change, declares = span(
        low,
        high,
        "folder = ({}).parent\nvalue = float((folder / 'temp1_input').read_text())\n"
        "min_rate, max_rate = (float((folder / f'{{end}}_rate').read_text()) for end in ('min', 'max'))",
    )
    return all_of(*edits, change), declares


SERIES = "values = [float(({}).read_text()) for _ in range(3)]\nvalue = values[-1]\n"
SERVE_WRONG |= {
    f"members: {name}": case
    for name, case in {
        "width and height": picture((FACTS, '"width": rows, "height": columns')),
        "width and height, by their names": picture(
            (SHAPE, "height, width = frame.shape[:2]"), (FACTS, '"width": height, "height": width')
        ),
        "width and height, by the shape": picture(
            (SHAPE, "pass"), (FACTS, '"width": frame.shape[0], "height": frame.shape[1]')
        ),
        "width and height, taken apart": picture(
            (SHAPE, "width, height = frame.shape[:2]"), (FACTS, '"width": width, "height": height')
        ),
        "width and height, of three": picture(
            (SHAPE, "width, height, _ = frame.shape"), (FACTS, '"width": width, "height": height')
        ),
        "width and height, by keywords": picture(
            (SHAPE, "height, width = frame.shape[:2]"),
            ('{"width": columns, "height": rows, ', "dict(width=height, height=width) | {"),
        ),
        "width and height, stored later": picture(
            (FACTS, '"width": 0, "height": 0'),
            (
                "    return data, facts |",
                '    facts["width"], facts["height"] = rows, columns\n    return data, facts |',
            ),
        ),
        "the bounds": span("high / 1000", "low / 1000", BOUNDS),
        "the bounds, by their attributes": span(
            'float((folder / "temp1_max").read_text()) / 1000',
            'float((folder / "temp1_min").read_text()) / 1000',
            BOUNDS,
        ),
        "the bounds, by the reader of numbers": span(
            'runtime.read_number(folder / "temp1_crit", 0.001)',
            'runtime.read_number(folder / "temp1_lcrit", 0.001)',
            BOUNDS,
        ),
        "the least and the most": span("max(values) / 1000", "min(values) / 1000", SERIES),
        "the first and the last in order": span("sorted(values)[-1] / 1000", "sorted(values)[0] / 1000", SERIES),
    }.items()
}
SERVE_RIGHT |= {
    f"members: {name}": case
    for name, case in {
        "width and height, by the shape": picture(
            (SHAPE, "pass"), (FACTS, '"width": frame.shape[1], "height": frame.shape[0]')
        ),
        "width and height, taken apart": picture(
            (SHAPE, "height, width = frame.shape[:2]"), (FACTS, '"height": height, "width": width')
        ),
        "width and height, of a turned picture": picture(
            (SHAPE, "width, height = frame.transpose(1, 0, 2).shape[:2]"), (FACTS, '"width": width, "height": height')
        ),
        "width and height, of a camera that lies on its side": picture(
            (WIDE, WIDE.replace(" width", " height")),
            (HIGH, HIGH.replace(" height", " width")),
            (SHAPE, "turned = cv2.rotate(frame, cv2.ROTATE_90_CLOCKWISE)"),
            ('".png", frame', '".png", turned'),
            (FACTS, '"width": frame.shape[0], "height": frame.shape[1]'),
        ),
        "the bounds": span("low / 1000", "high / 1000", BOUNDS),
        "the least and the most": span("min(values) / 1000", "max(values) / 1000", SERIES),
        "the periods of two rates": rates("1 / max_rate", "1 / min_rate"),
        "the periods of two rates, by a power": rates("max_rate ** -1", "min_rate ** -1"),
        "the periods of two rates, by a library": rates(
            "math.pow(max_rate, -1)", "math.pow(min_rate, -1)", uses("math")
        ),
        "the periods of two rates, by a function": rates("period(max_rate)", "period(min_rate)", adds(PERIOD)),
        "the periods of two rates, by a method": rates(
            "Clock().period(max_rate)", "Clock().period(min_rate)", adds(CLOCK)
        ),
        "the lowest of the highest": span("min(values) / 1000", "max(min(values), max(values)) / 1000", SERIES),
    }.items()
}
