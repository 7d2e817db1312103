"""What an agent writes that is true of something else: another device, another act, another quantity, no kind at all.

Each set was accepted by the rules of its day, and is kept beside what is right although it looks alike.
"""

import json
from typing import Any

import wrong_deploys as deploy
from identify_cases import (
    CAM,
    CSI,
    ENV,
    FEETECH,
    GPIO,
    GRAPHICS,
    KESTREL_OPTICS,
    LEDS,
    LIGHT,
    METER,
    RELAY,
    SERVOS,
    STEPS,
    TEMP,
    USB_SERIAL,
    ability,
    called,
    cited,
    device,
    more,
    put,
)
from probe_cases import (
    ARM,
    BATTERY,
    CAMERA,
    CHIP,
    DISK,
    KESTREL,
    KEYS,
    LINE,
    MOUSE,
    PAD,
    RAIL,
    RECEIVER,
    SOUND,
    STEPPER,
    WIFI,
)
from server_edits import ASKED, FILE, Edit, adds, all_of, alongside, body, read_by, swap, uses, warm
from wrong_interfaces import PANELS, TEXT, Output, says, takes, told, tool


def beside(name: str, text: str) -> Any:
    """One more sentence in a description."""
    return lambda value: tool(value, name).update(description=f"{tool(value, name)['description']} {text}")


def returns(name: str, member: str, **schema: Any) -> Any:
    return lambda value: tool(value, name)["output_schema"]["properties"].update({member: schema})


def whole(name: str, member: str, **schema: Any) -> Any:
    """A result that is one member."""
    return told(name, output_schema={"type": "object", "properties": {member: schema}, "required": [member]})


def lacks(name: str, member: str) -> Any:
    return lambda value: tool(value, name).pop(member)


def reason(device: str, word: str) -> Any:
    def change(value: Output) -> None:
        next(each for each in value["left_out"] if each["id"] == device).update(reason=word)

    return change


def taking(name: str, parameter: str, about: str, **more: Any) -> Any:
    return takes(name, parameter, {**TEXT, "default": "", "description": about, **more})


LEVEL = {"type": "number", "minimum": 0, "maximum": 100, "default": 50, "description": "percent"}
INTERFACE_WRONG: dict[str, Any] = {
    "a filter in Python": taking("read_input_events", "filter", "python expression to filter events"),
    "a filter in Python with an end": taking("read_input_events", "keep", "Python code that selects", maxLength=80),
    "an expression by its name": taking("read_input_events", "expr", "which events", maxLength=80),
    "what is evaluated": taking("read_temperature", "convert", "is evaluated on each value", maxLength=80),
    "a regular expression": taking("read_led", "which", "regular expression of the names", maxLength=80),
    "a query in a list": takes(
        "read_storage", "select", {"type": "array", "items": {**TEXT, "description": ""}, "description": "jq programs"}
    ),
    "of a camera in front of keys": says("read_input_events", "Take a picture with the camera of the laptop."),
    "of a robot in front of a disk": says("read_storage", "Brings the gripper home."),
    "a picture that turns something": beside("capture_image", "Before the picture the head is turned to the place."),
    "a reading that moves its camera": beside("capture_image", "It first rotates the camera to the left."),
    "a volume of keys": takes("read_input_events", "volume_percent", LEVEL),
    "a volume of a lamp": takes("set_led", "volume", LEVEL),
    "an exposure of a disk": takes("read_storage", "exposure_ms", {**LEVEL, "description": "ms"}),
    "a joint of a chip": takes("read_temperature", "joint", {"type": "integer", "minimum": 1, "maximum": 6}),
    "an order with an adverb": beside("read_led", "You must first run read_storage."),
    "a need of another call": beside("read_led", "You need to call read_storage."),
    "everything as text": whole("read_input_events", "events", type="string", description="all events as text"),
    "one text": whole("read_led", "text", type="string", description="what was found"),
    "a serial number in a result": returns("read_storage", "serial", type=["string", "null"], description="serial"),
    "a serial number by its full name": returns("read_storage", "disk_serial_number", type="string", description="it"),
    "a reading without a test call": lacks("read_led", "smoke"),
    "another reason": reason("platform-amdi0010", "bus_infrastructure"),
    "no function of what is unknown": reason("usb-0a0a-0001", "no_function"),
    "a raw value as a percentage": returns(
        "read_input_events", "value", type="integer", minimum=0, maximum=100, description="raw value"
    ),
}
INTERFACE_RIGHT: dict[str, Any] = {
    "a word that selects": taking("read_input_events", "kind", "name of the kind of event to keep", maxLength=20),
    "a language by its code": taking("read_input_events", "country", "code of the country", maxLength=2),
    "a choice of expressions": taking("read_led", "regular", "a regular expression", enum=["", "a"]),
    "a picture after a movement": beside("capture_image", "Wait until the camera is moved to its place by hand."),
    "a picture that moves nothing": beside("capture_image", "The camera is not turned to anything."),
    "a lamp by another word": says("read_led", "Reports how bright the lamp is, in percent."),
    "a camera by another word": says("capture_image", "Takes one photograph with the webcam."),
    "a tray that was moved": beside("read_storage", "Reports whether the head is moved to its parking place."),
    "a zoom of a camera": takes("capture_image", "zoom_percent", LEVEL),
    "a brightness of a lamp": takes("set_led", "brightness_percent", LEVEL),
    "a rate of pictures": takes("capture_image", "fps", {"type": "integer", "minimum": 1, "maximum": 60, "default": 9}),
    "another tool by its name": beside("capture_image", "The sizes are those of list_camera_formats."),
    "another tool in a choice": beside("read_led", "It does not change what set_led has written."),
    "what you need": beside("read_led", "You need to switch the lamp on to see it."),
    "a flag about a serial number": returns("read_storage", "has_serial", type="boolean", description="whether"),
    "a serial line": returns("read_storage", "serial_port", type="string", description="name of the line"),
    "a step with its bound": returns(
        "read_input_events", "value", type="integer", minimum=0, maximum=255, description="raw value"
    ),
    "a percentage": returns("read_led", "share", type="number", minimum=0, maximum=100, description="percent"),
    "a kind that is one text": whole("read_storage", "model", type="string", description="model of the disk"),
}


DEPLOY_WRONG: dict[str, Any] = {
    "a module of Python that is not listed": lambda value: value["imports"].pop(4),
    "the runtime that is not listed": lambda value: value["imports"].pop(5),
    "a module of Python by a package": deploy.provider(4, "fastmcp"),
    "a Python that does not serve": lambda value: value.update(python=">=3.14"),
    "a Python before the one that serves": lambda value: value.update(python=">=3.9,<3.11"),
    "a package by its module alone": deploy.requires("pandas", "2.2.3", "pandas"),
}
DEPLOY_RIGHT: dict[str, Any] = {
    "the Python that serves alone": lambda value: value.update(python="==3.11.*"),
    "no range of Python": lambda value: value.pop("python", None),
    "a package with its purpose": deploy.requires("tzdata", "2024.2", "time zones of this host"),
    "a submodule of Python": lambda value: value["imports"][4].update(module="json.decoder"),
}


def acts(old: str, new: str) -> Edit:
    """`set_brightness` with other statements in the place of its write."""
    whole = ACT.replace("(folder / 'brightness').write_text(str(round(top * percent / 100)))", "{}")
    assert whole != ACT
    return body("set_brightness", whole.format(new) if old == "write" else ACT.replace(old, new))


ACT = """folder = runtime.device(device, actuate=True).path('backlight')
top = int((folder / 'max_brightness').read_text())
(folder / 'brightness').write_text(str(round(top * percent / 100)))
level = int((folder / 'brightness').read_text())
light = Light(name=folder.name, percent=round(100 * level / top, 1), level=level, maximum=top)
return Lights(device=device, lights=[light])"""
WRITE = "(folder / 'brightness').write_text(str(round(top * percent / 100)))"
EVENTS = """
begun = time.monotonic()
with runtime.device(device).bus() as unit:
    came = runtime.evdev.events(unit.nodes("input", "event"), {}, {})
found = [Event(input=n, time_s=t, type=EVENT_TYPES.get(k, str(k)), code=c, value=v) for n, t, k, c, v in came]
return Events(device=device, waited_s=round(time.monotonic() - begun, 2), events=found)
"""
PICTURE = """
with runtime.device(device).bus() as unit:
    taken = runtime.child.call(take_picture, unit.node("video4linux", "video"), {}, format, flush)
if taken is None:
    raise ToolError("the camera gave no picture; see whether its lid is open")
data, facts = taken
return ToolResult(content=[Image(data=data, format=format)], structured_content={{**facts, "format": format}})
"""
BLOCKS = """
folder = runtime.device(device).path("block")
sectors = runtime.read_integer(folder / "size")
if sectors is None:
    raise ToolError("the size cannot be read; plug the disk in again")
parts = dict.fromkeys(("rotational", "removable", "read_only", "state", "wear", "io_errors", "temperature_degc"))
model = runtime.read_text(folder / "device/model")
return Storage(device=device, disks=[Disk(name=folder.name, model=model, size_bytes={}, volumes=[], **parts)])
"""
HWMON = 'runtime.channels.hwmon(unit, "temp", 0.001, "degC")'
SERVE_WRONG: dict[str, Any] = {
    "hidden: a handler that passes": acts("write", f"try:\n    {WRITE}\nexcept OSError:\n    pass"),
    "hidden: two kinds of errors": acts(
        "write", f"try:\n    {WRITE}\nexcept (PermissionError, FileNotFoundError):\n    pass"
    ),
    "hidden: a line in the log": all_of(
        uses("logging"),
        acts("write", f"try:\n    {WRITE}\nexcept OSError as problem:\n    logging.warning('not set: %s', problem)"),
    ),
    "hidden: suppressed": all_of(uses("contextlib"), acts("write", f"with contextlib.suppress(OSError):\n    {WRITE}")),
    "idle: how long": body("read_input_events", EVENTS.format("events", "5")),
    "idle: how many": body("read_input_events", EVENTS.format("20", "seconds")),
    "idle: how long and how many": body("read_input_events", EVENTS.format("20", "5")),
    "idle: pictures that are thrown away": body(
        "capture_image", PICTURE.format("width, height").replace("format, flush)", "format, 5)")
    ),
    "idle: a width": body("capture_image", PICTURE.format("1280, height")),
    "crossed: width and height": body("capture_image", PICTURE.format("height, width")),
    "kept: by a default of a table": all_of(
        adds("LAST = {}"), read_by(f"value = LAST.setdefault(device, float(({FILE}).read_text()))")
    ),
    "named: a device of the host that it does not serve": alongside(
        "capture_image",
        body(
            "read_temperature",
            f"value = float(({FILE}).read_text())\n{warm('value / 1000')}".replace(
                "device=device", "device='usb-0a0a-0001'"
            ),
        ),
    ),
    "kernel: a fan": read_by(f"value = float(({ASKED}.path('hwmon') / 'fan1_input').read_text())"),
    "kernel: a voltage's channels": swap(HWMON, HWMON.replace('"temp"', '"in"')),
    "kernel: without its scale": swap(HWMON, HWMON.replace("0.001", "1.0")),
    "kernel: in volts": swap(HWMON, HWMON.replace('"degC"', '"V"')),
    "kernel: sectors as bytes": body("read_storage", BLOCKS.format("sectors")),
    "kernel: pages": body("read_storage", BLOCKS.format("sectors * 4096")),
    "kernel: kibibytes": body("read_storage", BLOCKS.format("sectors // 2")),
}
SERVE_RIGHT: dict[str, Any] = {
    "set: a trigger that a light can lack": acts(
        "write", f"try:\n    (folder / 'trigger').write_text('none')\nexcept FileNotFoundError:\n    pass\n{WRITE}"
    ),
    "set: tried three times": acts(
        "write",
        f"for _ in range(3):\n    try:\n        {WRITE}\n        break\n    except OSError:\n        time.sleep(0.05)\n"
        "else:\n    raise ToolError('the light refused three times')",
    ),
    "set: an error that is told later": acts(
        "write",
        f"failed = None\ntry:\n    {WRITE}\nexcept OSError as problem:\n    failed = problem\n"
        "if failed is not None:\n    raise ToolError(f'the light cannot be set: {{failed}}')",
    ),
    "set: read afterwards, and refused": acts(
        "write",
        f"try:\n    {WRITE}\nexcept OSError:\n    pass  # what is read decides\n"
        "if int((folder / 'brightness').read_text()) != round(top * percent / 100):\n"
        "    raise ToolError('the light did not take it')",
    ),
    "set: by a descriptor": all_of(
        uses("os"),
        acts(
            "write",
            "handle = os.open(folder / 'brightness', os.O_WRONLY)\ntry:\n"
            "    os.write(handle, str(round(top * percent / 100)).encode())\nfinally:\n    os.close(handle)",
        ),
    ),
    "used: in an object": all_of(
        adds("class Wish:\n    def __init__(self, width, height):\n        self.size = (width, height)"),
        body("capture_image", "wish = Wish(width, height)\n" + PICTURE.format("wish.size[0], wish.size[1]").strip()),
    ),
    "used: in a table": body(
        "read_input_events",
        "most = {'events': events, 'for': seconds}" + EVENTS.format("most['events']", "most['for']"),
    ),
    "used: by a helper that is wrapped": all_of(
        uses("functools"),
        adds(
            """
            def locked(function):
                @functools.wraps(function)
                def inside(name):
                    with runtime.device(name).bus() as unit:
                        return function(unit)

                return inside


            @locked
            def fetched(unit):
                return float((unit.path('hwmon') / 'temp1_input').read_text())
            """
        ),
        read_by("value = fetched(device)"),
    ),
    "kernel: sectors of 512 bytes": body("read_storage", BLOCKS.format("sectors << 9")),
    "kernel: the scale as a fraction": swap(HWMON, HWMON.replace("0.001", "1e-3")),
}


def within(made: str, call: str, *imports: str) -> Edit:
    """A temperature that goes through a definition of the file."""
    parts = [uses(*imports)] if imports else []
    return all_of(*parts, adds(made), read_by(f"value = float(({FILE}).read_text())", call))


LIMITED = "def limited(value):\n    return max(0, min(100, value))"
BRANCHES = """
def limited(value):
    if value > 60:
        return 60.0
    if value < -5:
        return -5.0
    return value
"""
GUARD = "class Guard:\n    @staticmethod\n    def inside(value):\n        return min(max(value, -10.0), 60.0)"
OBJECT = """
class Band:
    def __init__(self, low, high):
        self.low, self.high = low, high

    def of(self, value):
        return self.low if value < self.low else min(value, self.high)
"""
BELOW = "def upto(value, most):\n    return most if value > most else value"
AT_MOST = "def at_most(value):\n    return min(value, {})"
SERVE_WRONG |= {
    f"limit: {name}": case
    for name, case in {
        "both sides": within(LIMITED, "limited(value / 1000)"),
        "of the raw number": within(LIMITED.replace("100", "75_000"), "limited(value) / 1000"),
        "by branches": within(BRANCHES, "limited(value / 1000)"),
        "by a static method": within(GUARD, "Guard.inside(value / 1000)"),
        "by an object": within(OBJECT, "Band(5, 95).of(value / 1000)"),
        "of an argument": within(BELOW, "upto(value / 1000, 90)"),
        "by two functions": within(
            f"{BELOW}\n\n\ndef safe(value):\n    return upto(value, 90.0)", "safe(value / 1000)"
        ),
        "by a lambda": within("SAFE = lambda value: min(max(value, 3), 80)", "SAFE(value / 1000)"),
        "by the middle of three": within(
            "def limited(value):\n    return sorted((-20.0, value, 85.0))[1]", "limited(value / 1000)"
        ),
        "by bounds with a name": within(
            "BOUNDS = {'low': -20, 'high': 70}\n\n\ndef limited(value):\n"
            "    return max(BOUNDS['low'], min(BOUNDS['high'], value))",
            "limited(value / 1000)",
        ),
        "where it is read": all_of(
            adds(f"def heat():\n    return min(float(({FILE}).read_text()), 70000.0)"), read_by("value = heat()")
        ),
        "by a library": within(
            "def limited(value):\n    import numpy\n\n    return float(numpy.clip(value, -10, 60))",
            "limited(value / 1000)",
        ),
        "of a level": all_of(
            adds(LIMITED.replace("100", "80").replace("0,", "20,")),
            acts("write", WRITE.replace("percent", "limited(percent)")),
        ),
        "of a level, by an object": all_of(
            adds(OBJECT), acts("write", WRITE.replace("percent", "Band(0, 60).of(percent)"))
        ),
        "of a wait": all_of(
            adds(AT_MOST.format(2)), body("read_input_events", EVENTS.format("events", "at_most(seconds)"))
        ),
        "of a wait, where it is used": body("read_input_events", EVENTS.format("events", "min(seconds, 2.0)")),
        "of a number of events": all_of(
            adds(AT_MOST.format(10)), body("read_input_events", EVENTS.format("at_most(events)", "seconds"))
        ),
        "of a number of events, by a test": body(
            "read_input_events", "if events > 10:\n    events = 10" + EVENTS.format("events", "seconds")
        ),
        "of a width": all_of(
            adds(AT_MOST.format(640)), body("capture_image", PICTURE.format("at_most(width), height"))
        ),
        "of a height, where it is used": body("capture_image", PICTURE.format("width, max(1080, height)")),
    }.items()
}
SERVE_RIGHT |= {
    f"limit: {name}": case
    for name, case in {
        "an error outside": within(
            "def checked(value):\n    if not -55 <= value <= 150:\n        raise ToolError('out of range')\n"
            "    return value",
            "checked(value / 1000)",
        ),
        "the hotter one": within("def hotter(one, two):\n    return max(one, two)", "hotter(value, value) / 1000"),
        "nothing below zero": within("def above(value):\n    return max(0.0, value)", "above(value) / 1000"),
        "the range of the argument": all_of(adds(LIMITED), acts("write", WRITE.replace("percent", "limited(percent)"))),
        "of the level that is written": all_of(
            adds(BELOW),
            acts("write", WRITE.replace("round(top * percent / 100)", "upto(round(top * percent / 100), top)")),
        ),
        "a pause between tries": all_of(
            adds("def pause(count):\n    return min(0.05 * count, 0.2)"),
            read_by(
                "for count in range(3):\n    try:\n"
                f"        value = float(({FILE}).read_text())\n        break\n    except OSError:\n"
                "        time.sleep(pause(count))\nelse:\n    raise ToolError('no reading in three tries')"
            ),
        ),
        "the longest wait of INTERFACE": all_of(
            adds(AT_MOST.format(60)), body("read_input_events", EVENTS.format("events", "at_most(seconds)"))
        ),
        "the most events of INTERFACE": body("read_input_events", EVENTS.format("max(1, min(events, 200))", "seconds")),
        "a wait in pieces": all_of(
            adds("def piece(left):\n    return min(left, 0.5)"),
            body(
                "read_input_events",
                EVENTS.format("events", "seconds").replace(
                    "with runtime",
                    "left = seconds\nwhile left > 0:\n    step = piece(left)\n    left -= step\nwith runtime",
                ),
            ),
        ),
        "a wait that the caller may omit": body(
            "read_input_events",
            "limit = seconds if seconds is not None else 5.0\nif limit is None:\n    limit = 1.0\n"
            + EVENTS.format("events", "limit"),
        ),
        "a wait that is counted down": (
            body(
                "read_input_events",
                "while seconds > 0:\n    step = min(seconds, 0.5)\n    time.sleep(step)\n    seconds -= step\n"
                + EVENTS.format("events", "seconds"),
            ),
            lambda interface: tool(interface, "read_input_events")["input_schema"]["properties"]["seconds"].update(
                minimum=0
            ),
        ),
        "an even width": all_of(
            adds("def even(value):\n    return value // 2 * 2"),
            body("capture_image", PICTURE.format("even(width), height")),
        ),
        "a wait of a moment at the least": body("read_input_events", EVENTS.format("events", "max(seconds, 0.25)")),
        "as many as a table has": all_of(
            adds("KEYS = ('power', 'mute', 'lid')"),
            body("read_input_events", EVENTS.format("min(events, len(KEYS))", "seconds")),
        ),
        "the size that the camera has": body("capture_image", PICTURE.format("min(width, 8192), min(height, 8192)")),
    }.items()
}
IDENTIFY_WRONG: dict[str, tuple[str, Any]] = {
    "a gas of a chip for air": ("raspberry", more(ENV, "read_co2", description="The CO2 in ppm.", via="iio")),
    "a quality of a chip for air": ("raspberry", more(ENV, "read_air_quality", description="An index.", via="iio")),
}
IDENTIFY_RIGHT: dict[str, tuple[str, Any]] = {
    "a humidity of the air": (
        "raspberry",
        lambda value: ability(value, ENV, "read_humidity").update(description="The humidity of the air in percent."),
    ),
}
INTERFACE_WRONG |= {
    "a reading that begins as a setter": says("read_brightness", "Set the brightness of the display in percent."),
    "degrees Celsius in kelvin": returns("read_temperature", "mean_celsius", type="number", description="K"),
    "a reading that switches": says("read_led", "Turns on the LED, and reads it."),
}
INTERFACE_RIGHT |= {
    "degrees Celsius in their sign": returns("read_temperature", "mean_celsius", type="number", description="°C"),
    "a set of readings": says("read_led", "Set of brightness values of the LED in percent."),
}


# Names, facts and abilities that go beyond their evidence, and descriptions that their own schema contradicts.

KINDS: dict[str, Any] = {"method": "kernel_class"}
VIDEO, MOUSE_NAME, PAD_NAME = (
    "interface 00: class 0e/01/00",
    "input[0].name: Otter Wireless Mouse",
    "input[0].name: REED0001:00 2EE0:0033 Touchpad",
)
CELLS = ("power_supply[0].manufacturer: Reed Cells", "power_supply[0].model_name: RC-57")
LIFECAM, STICK = "product: Microsoft® LifeCam Studio(TM)", "usb-1f00-00d1"
FULL = "bench: a desk lamp at 9600 baud: 'LEVEL n' with n from 0 to 80 percent sets its brightness, 'OFF' stops it"
"""The host, and what its owner answers about the serial line."""


def kestrel(name: str, *more: str) -> tuple[str, Any]:
    return "laptop", called(KESTREL, name, CAM, VIDEO, *more)


def otter(name: str, says: str = "") -> tuple[str, Any]:
    return "bench", called(MOUSE, name, f"{MOUSE_NAME}{says}", **KINDS)


def heron(name: str, *quotes: str, **more: Any) -> tuple[str, Any]:
    return "bench", called(STEPPER, name, *(quotes or (STEPS,)), **more)


def found(where: str, device: str, name: str, *quotes: str) -> tuple[str, Any]:
    """A device that is known by its class, under this name."""
    return where, called(device, name, *quotes, **KINDS)


def act(name: str, description: str, effect: str = "actuate", **more: Any) -> dict[str, Any]:
    return {"name": name, "description": description, "via": "pyserial", "effect": effect, **more}


DIM = act("set_lamp_level", "Set the level of the lamp.", parameters={"range": "0 to 80 percent", "speed": 9600})
DARK = act("stop_lamp", "Switch the lamp off.", stops=True)


def dims(**more: Any) -> dict[str, Any]:
    return {**DIM, **more, "parameters": {**DIM["parameters"], **more.get("parameters", {})}}


def answered(where: str, name: str, *abilities: dict[str, Any], quotes: tuple[str, ...] = (), **more: Any) -> Any:
    """The serial line of the bench, called and able as given, by the answer that stands behind the host's name."""
    answer = where.partition(": ")[2]

    def change(value: Output) -> None:
        given = device(value, LINE)
        for member in ("missing", "class"):
            given.pop(member, None)
        given.update(identified_as=name, category="actuator", confidence=0.9, method="user_answer")
        given.update(evidence=cited(*(quotes or (answer,)), USB_SERIAL), capabilities=[*abilities])
        given.update(more)

    return where, change


def lamp(*abilities: dict[str, Any]) -> Any:
    return answered(FULL, "desk lamp", *abilities)


def facts(where: str, name: str, capability: str, **given: Any) -> tuple[str, Any]:
    return where, lambda value: ability(value, name, capability).setdefault("parameters", {}).update(given)


def worded(name: str, capability: str, **given: Any) -> tuple[str, Any]:
    """Other words of a command of the rig."""
    return "rig", lambda value: ability(value, name, capability).update(given)


SENSOR: dict[str, Any] = {"category": "sensor"}
IDENTIFY_WRONG |= {
    "name: full of four thousand": kestrel("Kestrel HD Camera 4K"),
    "name: lines of a picture": kestrel("Kestrel 1080p Camera"),
    "name: ultra high": kestrel("Kestrel UHD Camera"),
    "name: a second mark": kestrel("Kestrel HD Camera Mk II"),
    "name: a version": kestrel("Kestrel HD Camera v2"),
    "name: a better one": kestrel("Kestrel HD Camera Pro"),
    "name: two lenses": kestrel("Kestrel HD Stereo Camera"),
    "name: no wire": kestrel("Kestrel HD wireless camera"),
    "name: infrared": kestrel("Kestrel HD infrared camera"),
    "name: what it looks through": kestrel("Kestrel HD microscope camera"),
    "name: what it looks for": kestrel("Kestrel HD barcode camera"),
    "name: in depth": kestrel("Kestrel HD 3D camera"),
    "name: heat": kestrel("Kestrel HD thermal camera"),
    "name: a Cyrillic letter": kestrel("K\u0435strel HD Camera"),
    "name: a letter of no width": kestrel("Kes\u200btrel HD Camera"),
    "name: a generation": otter("Otter Wireless Mouse (2nd generation)"),
    "name: a year": otter("Otter Wireless Mouse 2023"),
    "name: another radio": otter("Otter Bluetooth Mouse"),
    "name: a Cyrillic kind": otter("Otter Wireless M\u043euse"),
    "name: the maker of the chip": heron("STMicroelectronics Heron Stepper", STEPS, "interface 00: class 02/02/01"),
    "name: a Greek letter": heron("H\u03b5ron Stepper"),
    "name: the maker of an adapter": (
        "bench",
        called(LINE, "QinHeng CH341 serial adapter", USB_SERIAL, category="infrastructure"),
    ),
    "name: a receiver of another maker": (
        "bench",
        called(RECEIVER, "Otter Unifying Receiver", "product: Otter Receiver"),
    ),
    "name: letters that are no abbreviation": found("shop", "hid-1f00-0077", "Panasonic touch panel", "name: PNL"),
    "name: channels": ("shop", called(RELAY, "Bench 8-channel Relay", "product: Bench Relay", category="actuator")),
    "name: a word cut in two": ("shop", called(METER, "Bench charge meter", "product: Bench Charmeter")),
    "name: a word put together": ("shop", called(STICK, "Bench Joystick", "product: Bench Stick", **SENSOR)),
    "name: a capacity": found(
        "shop", "scsi-bench-stick", "Bench Stick 64 GB flash drive", "vendor: Bench", "model: Stick"
    ),
    "name: a chip for a chip": found("shop", TEMP, "LM75 temperature sensor", "hwmon[0].name: benchtemp => the LM75"),
    "name: a letter behind a number": found(
        "laptop",
        "dmi-board",
        "Marsh Computing Heron 14s laptop",
        "dmi[0].sys_vendor: Marsh Computing",
        "dmi[0].product_name: Heron 14",
    ),
    "name: a letter behind a type": found("laptop", BATTERY, "Reed Cells RC-57A battery", *CELLS),
    "name: another capacity": found("laptop", DISK, "Reed NV 512 1TB SSD", "nvme[0].model: Reed NV 512"),
    "name: the maker of a processor": found("laptop", CHIP, "Intel processor temperature", "hwmon[0].name: coretemp"),
    "name: a generation of radio": found("laptop", WIFI, "Marsh Wi-Fi 6E adapter", "driver: marshwifi"),
    "name: the maker of a codec": found("laptop", SOUND, "Realtek HDA Marsh PCH", "sound[0].name: HDA Marsh PCH"),
    "name: speakers": found("laptop", SOUND, "HDA Marsh PCH 7.1", "sound[0].name: HDA Marsh PCH"),
    "name: the maker of a pad": found("laptop", PAD, "Synaptics touchpad", PAD_NAME),
    "name: how a panel shines": found("laptop", LIGHT, "OLED backlight", "backlight[0].name: marsh_backlight"),
    "name: how keys feel": found("laptop", KEYS, "Plain Mechanical Keyboard", "input[0].name: Plain Keyboard"),
    "name: what is beside keys": found("laptop", KEYS, "Plain Keyboard, fingerprint", "input[0].name: Plain Keyboard"),
    "name: a sensor behind a lens": found("raspberry", CSI, "Sony IMX219 camera", "video4linux[0].name: unicam-image"),
    "name: the maker of pins": found("raspberry", GPIO, "Broadcom GPIO controller", "gpio[0].label: pinctrl-soc2711"),
    "name: memory of a board": (
        "raspberry",
        called("devicetree-board", "Fruit Board 4 Model X 8GB", "model: Fruit Board 4 Model X Rev 1.1"),
    ),
    "name: a card's capacity": found("raspberry", "mmc-sd-reed1", "REED1 32GB SDHC card", "name: REED1", "type: SD"),
    "name: a model with a joint": ("rig bare", called(CAMERA, "Microsoft LifeCam Studio-1080", LIFECAM)),
    "name: a sibling by joints": (
        "rig bare",
        called(ARM, "Feetech SO-ARM-100 servo bus", FEETECH, SERVOS, category="infrastructure", capabilities=[]),
    ),
    "name: a servo of the profile's prose": ("rig", put(ARM, identified_as="Feetech STS3215 SO-ARM101 robot arm")),
    "name: a program of the profile's prose": ("rig", put(ARM, identified_as="LeRobot SO-ARM101 robot arm")),
    "name: a motor of the profile's prose": ("rig", put(RAIL, identified_as="NEMA 17 camera rail")),
    "name: a chip of the profile's prose": ("rig", put(RAIL, identified_as="Camera rail with A4988 drivers")),
    "source: a search without a page": heron(
        "Heron X5 Stepper", f"{STEPS} => a web search finds X5", method="web_search"
    ),
    "source: a page without the word": heron(
        "Trinamic Stepper", f"{STEPS} => https://example.org/usb lists this stepper", method="web_search"
    ),
    "source: the results of a search": heron(
        "Heron X5 Stepper", f"{STEPS} => https://example.org/search?q=heron finds Heron X5", method="web_search"
    ),
    "source: a forum": heron("Heron X5 Stepper", f"{STEPS} => according to a forum post this is the Heron X5"),
    "source: a list of others": heron(
        "Heron X5 Stepper", f"{STEPS} => a list of hardware has X5", method="id_database"
    ),
    "source: a manual": heron("Heron X5 Stepper", f"{STEPS} => the datasheet calls it X5"),
    "class: sound of a camera": ("laptop", more(KESTREL, "record_audio", description="Record sound.", via="ALSA")),
    "class: how far pixels are": (
        "laptop",
        more(KESTREL, "read_depth_map", description="Distances in mm.", via="V4L2"),
    ),
    "class: heat of a picture": ("laptop", more(KESTREL, "read_temperature", description="Of its parts.", via="V4L2")),
    "class: charge of a mouse": ("bench", more(MOUSE, "read_battery", description="Its charge.", via="power_supply")),
    "class: heat of cells": (
        "laptop",
        more(BATTERY, "read_battery_temperature", description="In degC.", via="the class"),
    ),
    "class: a fan of a chip for heat": ("laptop", more(CHIP, "read_fan_speed", description="In rpm.", via="hwmon")),
    "class: a fan to set": ("shop", more(TEMP, "set_fan_speed", effect="actuate", description="Set it.", via="hwmon")),
    "class: volts of a chip for heat": ("shop", more(TEMP, "read_voltage", description="In V.", via="hwmon")),
    "class: the colour of a light": ("raspberry", more(LEDS, "set_led_colour", effect="actuate", via="LED class")),
    "class: light of the air": ("raspberry", more(ENV, "read_illuminance", description="In lux.", via="iio")),
    "class: a shock of the air": ("raspberry", more(ENV, "read_acceleration", description="In m/s^2.", via="iio")),
    "class: a camera that acts": ("laptop", put(KESTREL, category="actuator")),
    "class: a mouse that sees": ("bench", put(MOUSE, **{"class": "camera"})),
    "facts: formats from memory": facts("laptop", KESTREL, "capture_image", formats=["MJPG 1920x1080 at 30 fps"]),
    "facts: sizes from memory": facts("laptop", KESTREL, "capture_image", maximum_width=1920, maximum_height=1080),
    "facts: the bound of a light": facts("raspberry", LEDS, "set_led", leds=[{"name": "ACT", "max_brightness": 100}]),
    "facts: the bound of a panel": facts(
        "laptop", LIGHT, "set_brightness", backlights=[{"name": "marsh_backlight", "max_brightness": 100}]
    ),
    "facts: fewer lines": facts("raspberry", GPIO, "read_gpio_lines", lines=40),
    "facts: the unit of a channel": facts(
        "raspberry", ENV, "read_pressure", channels=[{"channel": "in_pressure", "label": "in_pressure", "unit": "degC"}]
    ),
    "facts: a channel too many": facts(
        "raspberry", ENV, "read_sensor_channels", channels=[{"channel": "in_illuminance", "unit": "lux"}]
    ),
    "facts: a core too many": facts(
        "laptop", CHIP, "read_temperature", channels=[{"channel": "temp9", "label": "Core 7", "unit": "degC"}]
    ),
    "facts: the label of another": facts(
        "laptop", CHIP, "read_temperature", channels=[{"channel": "temp1", "label": "GPU junction", "unit": "degC"}]
    ),
    "facts: a connector too many": facts("laptop", GRAPHICS, "read_display", connectors=["HDMI-A-1", "DP-2"]),
    "facts: keys of a mouse": facts(
        "bench", MOUSE, "read_input_events", inputs=[{"name": "Otter Wireless Mouse", "kinds": ["keyboard"]}]
    ),
    "facts: readings too many": facts(
        "laptop", BATTERY, "read_battery", supplies=[{"type": "Battery", "readings": ["cycle_count", "temp"]}]
    ),
    "profile: an angle": worded(ARM, "arm_move_joint", description="move one joint from -180 to 180 degrees"),
    "profile: another speed of the line": worded(ARM, "arm_status", via="feetech-servo-sdk at 57600 baud"),
    "profile: a length": worded(RAIL, "rail_move_x", description="move the camera by a number of millimetres"),
    "profile: further in words": worded(RAIL, "rail_move_x", description="move the camera by -5000 to 5000 steps"),
    "answer: colours": answered("bench: a lamp", "dimmable RGB lamp with 3 channels"),
    "answer: a maker": answered("bench: a lamp", "Philips desk lamp"),
    "answer: what is beside it": answered("bench: a pump controller", "pump controller with flow meter"),
    "answer: twice as many": answered("bench: a relay board with 4 relays", "8 channel relay board"),
    "answer: three of one": answered("bench: a pump", "three pumps"),
    "answer: none at all": answered("bench: I do not know what it is", "lamp"),
    "answer: what it is not": answered("bench: not a lamp, it is a pump", "lamp", quotes=("not a lamp",)),
    "answer: what it was": answered(
        "bench: no longer the robot arm, a thermometer hangs there now", "robot arm", quotes=("the robot arm",)
    ),
    "answer: acts without limits": answered("bench: a lamp", "lamp", DIM),
    "answer: a wider range": lamp(dims(parameters={"range": "0 to 100 percent"}), DARK),
    "answer: a range in words that is wider": lamp(dims(description="Set the level of the lamp from 0 to 255."), DARK),
    "answer: another speed of the line": lamp(dims(parameters={"speed": 115200}), DARK),
    "answer: another unit": lamp(dims(parameters={"range": "0 to 80 lux"}), DARK),
    "answer: channels of one lamp": lamp(dims(parameters={"channels": 4}), DARK),
    "answer: a protocol from memory": lamp(dims(parameters={"protocol": "Modbus RTU, register 40001"}), DARK),
    "answer: a colour beside the level": lamp(DIM, DARK, act("set_lamp_colour", "Set the hue.")),
    "answer: heat beside the level": lamp(DIM, DARK, act("read_lamp_temperature", "In degC.", "read")),
    "answer: no stop": answered(
        "bench: a desk lamp at 9600 baud, LEVEL n with n from 0 to 80 percent", "lamp", DIM, DARK
    ),
    "answer: moisture of a thermometer": answered(
        "bench: a thermometer at 9600 baud", "thermometer", act("read_humidity", "In percent.", "read"), **SENSOR
    ),
    "answer: the range of another act": answered(
        "bench: a pump that runs 0 to 50 percent and stops with OFF; it also has a heater",
        "pump",
        act("set_heater_temperature", "Heat to 0 to 50 degC.", parameters={"range": "0 to 50 degC"}),
    ),
}
IDENTIFY_RIGHT |= {
    "name: another order": kestrel("HD camera of Kestrel Optics", KESTREL_OPTICS),
    "name: a joint": kestrel("Kestrel-HD camera"),
    "name: French": ("laptop", called(KESTREL, "caméra Kestrel HD", f"{CAM} => caméra is French for camera", VIDEO)),
    "name: whose it is": kestrel("Kestrel Optics' HD Camera", KESTREL_OPTICS),
    "name: the maker aside": kestrel("HD Camera (Kestrel Optics)", KESTREL_OPTICS),
    "name: a space that does not break": kestrel("Kestrel HD\u00a0Camera"),
    "name: a translated mouse": otter("Otter Funkmaus", " => Funkmaus is German for wireless mouse"),
    "name: several lights": found("raspberry", LEDS, "LEDs ACT", "leds[0].name: ACT"),
    "name: a trade mark": ("rig bare", called(CAMERA, "Microsoft® LifeCam Studio™", LIFECAM, VIDEO)),
    "name: small letters": ("rig bare", called(CAMERA, "microsoft lifecam studio", LIFECAM, VIDEO)),
    "name: a model in parts": (
        "rig bare",
        called(ARM, "Feetech SO-ARM 101 servo bus", FEETECH, SERVOS, category="infrastructure", capabilities=[]),
    ),
    "name: what a disk is": found(
        "laptop", DISK, "Reed NV 512 NVMe solid-state drive", "nvme[0].model: Reed NV 512", "driver: nvme"
    ),
    "name: a type without its joint": found("laptop", BATTERY, "Reed Cells RC57 battery", *CELLS),
    "name: its own label": found("shop", TEMP, "board temperature sensor", "hwmon[0].temp1: input label=board"),
    "name: a camera's connector": found(
        "raspberry", CSI, "camera at the CSI port (unicam)", "video4linux[0].name: unicam-image", "name: csi"
    ),
    "name: a revision": (
        "raspberry",
        called("devicetree-board", "Fruit Board 4 Model X, revision 1.1", "model: Fruit Board 4 Model X Rev 1.1"),
    ),
    "name: the profile's with the maker": ("rig", put(ARM, identified_as="Feetech SO-ARM101 robot arm")),
    "name: the profile's in short": ("rig", put(RAIL, identified_as="camera rail")),
    "class: a camera's exposure": ("laptop", more(KESTREL, "set_exposure", effect="actuate", via="V4L2 controls")),
    "class: a card's volume": ("laptop", more(SOUND, "set_volume", effect="actuate", via="ALSA mixer")),
    "class: lights of a keyboard": ("laptop", more(KEYS, "read_led", via="Linux LED class")),
    "class: health of a disk": ("laptop", more(DISK, "read_smart_health", via="smartctl of smartmontools")),
    "facts: asked": facts(
        "laptop", KESTREL, "capture_image", formats="asked at every call", sizes="asked at each call"
    ),
    "facts: in words": facts("raspberry", LEDS, "set_led", range="0 to 255 raw, served as 0 to 100 percent"),
    "facts: its steps": facts("laptop", LIGHT, "set_brightness", steps=1500, unit="percent"),
    "answer: the lamp and its adapter": answered("bench: a lamp", "lamp behind a USB serial adapter"),
    "answer: two of two": answered("bench: two lamps", "lamps"),
    "answer: translated": answered(
        "bench: eine Tischlampe", "table lamp", quotes=("eine Tischlampe => Tischlampe is German for table lamp",)
    ),
    "answer: all of it": lamp(DIM, DARK),
    "answer: less of it": lamp(dims(parameters={"range": "0 to 50 percent"}), DARK),
    "answer: its bounds apart": lamp(
        {**DIM, "parameters": {"minimum": 0, "maximum": 80, "unit": "percent", "baud_rate": 9600, "class": "tty"}}, DARK
    ),
    "answer: a thermometer's heat": answered(
        "bench: a thermometer that prints degrees Celsius at 9600 baud",
        "thermometer",
        act("read_temperature", "In degC.", "read", parameters={"speed": 9600, "unit": "degC"}),
        **SENSOR,
    ),
    "answer: what is not done to it": answered(
        "bench: do not touch the robot arm", "robot arm", quotes=("the robot arm",)
    ),
    "answer: but a pump": answered("bench: not a lamp, it is a pump", "pump", quotes=("it is a pump",)),
    "answer: a number in letters": answered("bench: a relay board with 4 relays", "relay board with four relays"),
    "answer: a hotplate's heat": answered(
        "bench: a hotplate, 20 to 300 degrees, OFF switches it off, 9600 baud",
        "hotplate",
        act("set_hotplate_temperature", "Set it to 20 to 300 degrees.", parameters={"minimum": 20, "maximum": 300}),
        act("stop_hotplate", "Off.", stops=True),
    ),
    "answer: a scale": answered(
        "bench: the kitchen scale, prints grams at 9600",
        "kitchen scale",
        act("read_weight", "Weight in grams.", "read", parameters={"speed": 9600, "unit": "g"}),
        **SENSOR,
    ),
    "answer: each relay": answered(
        "bench: a relay board with 4 relays at 9600 baud; '1 ON' and '1 OFF' switch relay 1, STOP switches all off",
        "relay board",
        act("switch_relay", "Switch one relay.", parameters={"relays": ["1", "2", "3", "4"], "speed": 9600}),
        act("stop_relays", "Switch all relays off.", stops=True),
    ),
    "answer: a fan in short": answered(
        "bench: a fan, PWM 0-255, 0 stops it, 115200",
        "fan",
        act("set_fan_speed", "Set the speed of the fan.", parameters={"minimum": 0, "maximum": 255, "baud": 115200}),
        act("stop_fan", "Stop the fan.", stops=True),
    ),
}


def member(name: str, *place: str, **given: Any) -> Any:
    """Other words of a member of a result, at any depth."""

    def change(value: Output) -> None:
        # The schemas of the embedded agent share their parts.
        tool(value, name)["output_schema"] = schema = json.loads(json.dumps(tool(value, name)["output_schema"]))
        for each in place:
            schema = schema["items"] if each == "[]" else schema["properties"][each]
        schema.update(given)

    return change


def asks(name: str, parameter: str, **given: Any) -> Any:
    """Other words of a parameter; it has no limits beside them."""

    def change(value: Output) -> None:
        own = {**tool(value, name)["input_schema"]["properties"][parameter], **given}
        takes(name, parameter, own, limits=[])(value)

    return change


def bound(*limits: dict[str, Any]) -> Any:
    return told("set_brightness", limits=[{"parameter": "percent", "unit": "%", **each} for each in limits])


RIGHT_LAMP = lamp(DIM, DARK)[1]
_ACTS = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}
LAMP_TOOLS: list[dict[str, Any]] = [
    {
        "name": "set_lamp_level",
        "capability": "set_lamp_level",
        "devices": [LINE],
        "effect": "actuate",
        "description": "Dim the desk lamp.\n\nThrough: pyserial, class tty, 9600 baud, 'LEVEL n'.",
        "annotations": _ACTS,
        "input_schema": {
            "type": "object",
            "additionalProperties": False,
            "required": ["level_percent"],
            "properties": {"level_percent": {"type": "number", "minimum": 0, "maximum": 80, "description": "percent"}},
        },
        "output_schema": {
            "type": "object",
            "properties": {"level_percent": {"type": "number", "description": "percent"}},
        },
    },
    {
        "name": "stop_lamp",
        "capability": "stop_lamp",
        "devices": [LINE],
        "effect": "actuate",
        "stops": True,
        "description": "Switch the desk lamp off.\n\nThrough: pyserial, class tty, 9600 baud, 'OFF'.",
        "annotations": _ACTS,
        "input_schema": {"type": "object", "additionalProperties": False, "properties": {}},
        "output_schema": {"type": "object", "properties": {"stopped": {"type": "boolean"}}},
    },
]
"""The tools of the lamp of `FULL`."""


def of_lamp(parameter: str = "", **given: Any) -> tuple[str, Any]:
    """A change of the tool that dims the lamp of the answer: of itself, or of a parameter."""

    def change(value: Output) -> None:
        own = tool(value, "set_lamp_level")
        if parameter:
            own["input_schema"]["properties"].setdefault(parameter, {}).update(given)
        else:
            own.update(given)

    return FULL, change


def of_rig(name: str, parameter: str = "", **given: Any) -> tuple[str, Any]:
    def change(value: Output) -> None:
        own = tool(value, name)
        (own["input_schema"]["properties"][parameter] if parameter else own).update(given)

    return "rig", change


CELSIUS = {"type": ["number", "null"], "description": "degC; null where it does not answer"}
INTERFACE_WRONG |= {
    "words: raw for percent": says("set_led", "Set the brightness of the LED from 0 to 255, and read it back."),
    "words: minutes": says("read_input_events", "Waits up to 5 minutes for events of the keys."),
    "words: a thousand": says("read_input_events", "Waits for at most 1000 events of the keys."),
    "words: twice as bright": says("set_brightness", "Set the brightness of the display backlight, 0 to 200 percent."),
    "words: a fraction": asks("set_led", "percent", description="brightness as a fraction from 0 to 1"),
    "words: a byte": asks("set_led", "percent", description="brightness from 0 to 255; 0 is off"),
    "words: thousandths": asks("read_input_events", "seconds", description="longest wait in milliseconds"),
    "words: another default": asks("read_input_events", "seconds", description="longest wait in seconds; default 30"),
    "words: more pictures": asks("capture_image", "flush", description="pictures thrown away first, at most 200"),
    "words: light in percent": says("read_brightness", "Read the brightness of the display backlight in lux."),
    "words: bytes by the billion": says("read_storage", "Read size in gigabytes, partitions and free space."),
    "words: pixels": says("capture_image", "Take one picture with the camera in up to 12 megapixels."),
    "words: events in thousandths": says("read_input_events", "Wait for events; their times are in milliseconds."),
    "words: heat of a disk": beside("read_storage", "The temperature is in degrees Fahrenheit."),
    "limits: wider": bound({"minimum": 0, "maximum": 255}),
    "limits: light": bound({"minimum": 0, "maximum": 100, "unit": "lux"}),
    "limits: of nothing": bound({"parameter": "current_ma", "maximum": 100, "unit": "mA"}),
    "limits: crossed": bound({"minimum": 100, "maximum": 0}),
    "limits: two": bound({"minimum": 0, "maximum": 100}, {"minimum": 10, "maximum": 50}),
    "limits: of no profile": bound({"minimum": 0, "maximum": 100, "source": "profile display-panel"}),
    "range: below nothing": asks("set_led", "percent", minimum=-100),
    "range: beyond all": asks("set_brightness", "percent", maximum=150),
    "range: a negative width": asks("capture_image", "width", minimum=-8192),
    "range: a negative number": asks("capture_image", "flush", minimum=-5),
    "range: a negative wait": asks("read_input_events", "seconds", minimum=-1),
    "range: a default outside": asks("read_input_events", "seconds", default=90),
    "range: a default of another type": asks("read_input_events", "events", default="20"),
    "range: a default that is no choice": asks("capture_image", "format", default="gif"),
    "range: crossed": asks("set_led", "percent", minimum=100, maximum=0),
    "range: no choice": asks("capture_image", "format", enum=[]),
    "range: choices of another type": asks("capture_image", "format", enum=[1, 2], default=1),
    "foreign: exposure": takes("read_temperature", "exposure_ms", {**LEVEL, "description": "ms"}),
    "foreign: gain": takes("read_storage", "gain_db", {**LEVEL, "description": "dB"}),
    "foreign: a colour": taking("set_led", "colour", "which", enum=["red", "green"], default="red"),
    "foreign: a hue": takes("set_led", "hue_degrees", {**LEVEL, "description": "degrees"}),
    "foreign: another light": taking(
        "set_led", "led", "which", enum=["bench:green", "status:red"], default="bench:green"
    ),
    "foreign: the speed of a line": takes("set_led", "baud", {"type": "integer", "enum": [9600], "default": 9600}),
    "foreign: a camera by number": takes("capture_image", "camera_index", {**LEVEL, "type": "integer", "maximum": 9}),
    "foreign: a turn": takes("capture_image", "pan_degrees", {**LEVEL, "description": "degrees"}),
    "foreign: a password": taking("read_led", "password", "of the user", maxLength=40),
    "foreign: rights": takes("read_storage", "as_root", {"type": "boolean", "default": False}),
    "foreign: a fan": takes("set_brightness", "fan_rpm", {**LEVEL, "description": "rpm"}),
    "foreign: a goal": takes("read_temperature", "setpoint_celsius", {**LEVEL, "description": "degC"}),
    "foreign: a switch": takes("read_led", "turn_on", {"type": "boolean", "default": False}),
    "result: whether it went well": whole("read_temperature", "ok", type="boolean"),
    "result: how many disks": whole("read_storage", "count", type="integer", description="number of disks"),
    "result: how many events": whole("read_input_events", "events", type="integer", description="number of events"),
    "result: how many formats": whole("list_camera_formats", "formats", type="integer", description="how many"),
    "result: no format": whole("list_camera_formats", "device", type="string"),
    "result: whether it is there": whole("read_brightness", "attached", type="boolean"),
    "result: when": whole("read_led", "time", type="string", description="time of the reading"),
    "result: moisture": whole("read_temperature", "humidity_percent", type="number", description="percent"),
    "result: volts": whole("read_brightness", "voltage_v", type="number", description="V"),
    "result: a small picture": member("capture_image", "width", maximum=640),
    "result: a short wait": member("read_input_events", "waited_s", maximum=10),
    "result: few events": member("read_input_events", "events", maxItems=10),
    "result: other formats": member("capture_image", "format", enum=["bmp", "gif"]),
    "result: one format": member("capture_image", "format", enum=["jpeg"]),
    "result: one of two devices": member("read_brightness", "device", enum=PANELS[:1]),
    "result: another device": member("read_led", "device", const=PANELS[0]),
    "result: a byte in percent": member("read_led", "lights", "[]", "percent", minimum=0, maximum=255),
    "result: a fraction in percent": member("read_led", "lights", "[]", "percent", minimum=0, maximum=1),
    "result: a member that is not there": member("read_led", required=["device", "lights", "percent"]),
    "result: a member that no part has": member("read_led", "lights", "[]", required=["name", "volts"]),
    "result: no part": member("read_led", "lights", maxItems=0),
    "result: a value as text": member("read_temperature", "readings", "[]", "value", type="string"),
    "result: a size as text": member("read_storage", "disks", "[]", "size_bytes", type="string"),
    "effect: a setter that reads": says("set_led", "Read the brightness of one LED. It changes nothing."),
    "effect: a setter that only reads": beside("set_brightness", "It is read-only."),
    "effect: what is gone": beside("set_led", "The old value cannot be restored."),
    "effect: step by step": says("set_led", "Raise the brightness of the LED by a part each time it is called."),
    "effect: a better camera": says("read_led", "Read the brightness of the Kestrel HD Camera."),
    "profile: an angle": of_rig(
        "arm_move_joint", description="Move one joint of the SO-ARM101 arm to an angle in degrees."
    ),
    "profile: a quarter": of_rig(
        "arm_move_joint", description="Move one joint of the arm to a position from 0 to 1023."
    ),
    "profile: seven joints": of_rig("arm_status", description="Status of all seven joints of the SO-ARM101 arm."),
    "profile: a slow line": of_rig("arm_status", description="Status of all joints.\n\nThrough: tty, 115200 baud."),
    "profile: further": of_rig("rail_move_x", description="Move the camera rail along X by -10000 to 10000 steps."),
    "profile: a length": of_rig("rail_move_x", description="Move the camera rail by a number of millimetres."),
    "profile: a place in degrees": of_rig("arm_move_joint", "position", description="goal in degrees"),
    "profile: a way in millimetres": of_rig("rail_move_x", "steps", description="distance in mm"),
    "answer: all of it": of_lamp("level_percent", maximum=100),
    "answer: below nothing": of_lamp("level_percent", minimum=-80),
    "answer: light": of_lamp("level_percent", description="lux; 0 is off"),
    "answer: a colour": of_lamp("red", **{**LEVEL, "maximum": 80, "default": 0}),
    "answer: slowly": of_lamp("fade_seconds", **{**LEVEL, "maximum": 30, "default": 0, "description": "seconds"}),
    "answer: one of four": of_lamp("channel", **{**LEVEL, "type": "integer", "maximum": 4, "default": 1}),
    "answer: another line": of_lamp(
        description="Dim the desk lamp.\n\nThrough: pyserial, tty, 115200 baud, 'LEVEL n'."
    ),
    "answer: a byte": of_lamp(description="Dim the desk lamp from 0 to 255."),
}
INTERFACE_RIGHT |= {
    "words: beside the kernel's levels": says(
        "set_led", "Set the LED from 0 to 100 percent. 255 levels stand behind it."
    ),
    "words: a minute": says("read_input_events", "Waits up to a minute, 5 seconds unless told otherwise, for events."),
    "words: not in Fahrenheit": says(
        "read_temperature", "Read every temperature in degrees Celsius, never in Fahrenheit."
    ),
    "words: grey": says("capture_image", "Takes a photo; `mean` and `variance`, 0 to 255, show a black frame."),
    "words: off and full": asks("set_led", "percent", description="percent from 0 (off) to 100 (full)"),
    "words: some of it": asks("set_led", "percent", description="percent, such as 25 or 50"),
    "words: to a minute": asks("read_input_events", "seconds", description="wait in seconds (0.1 s to one minute)"),
    "limits: one side": bound({"maximum": 100}),
    "limits: by its class": bound({"minimum": 0, "maximum": 100, "source": "Linux backlight class"}),
    "range: never dark": asks("set_brightness", "percent", minimum=5),
    "range: no wait": asks("read_input_events", "seconds", minimum=0),
    "own: the unit": taking("read_temperature", "unit", "of the result", enum=["celsius"], default="celsius"),
    "own: the quality": takes("capture_image", "quality", {**LEVEL, "type": "integer", "minimum": 1}),
    "own: volumes": takes("read_storage", "include_volumes", {"type": "boolean", "default": True}),
    "own: kinds of events": taking("read_input_events", "kind", "which", enum=["key", "all"], default="all"),
    "own: several readings": takes(
        "read_temperature", "samples", {**LEVEL, "type": "integer", "maximum": 10, "default": 1}
    ),
    "result: one temperature": whole("read_temperature", "temperature_celsius", **CELSIUS),
    "result: temperatures by label": whole(
        "read_temperature", "temperatures_celsius", type="object", additionalProperties=CELSIUS, description="degC"
    ),
    "result: what can be measured": member(
        "read_temperature", "readings", "[]", "value", minimum=-273.15, maximum=1000
    ),
    "result: both formats": member("capture_image", "format", enum=["png", "jpeg"]),
    "result: all of a percentage": member("read_led", "lights", "[]", "percent", minimum=0, maximum=100),
    "result: its own device": member("read_led", "device", const="leds-bench-green"),
    "words: hours of the day": beside("set_brightness", "At night, from 22 to 6, a dark value is kinder."),
    "words: a part of the range": says("set_brightness", "Set the display's brightness; 1 to 10 is hard to see."),
    "words: how long it takes": beside("set_led", "Returns after 0.5 to 1 s."),
    "words: a usual wait": beside("read_input_events", "Typical presses take up to 2 seconds."),
    "words: the default in brackets": asks("capture_image", "width", description="wished width in px (default: 1280)"),
    "own: a turned picture": takes("capture_image", "rotation", {"type": "integer", "enum": [0, 90], "default": 0}),
    "own: one or none": takes("read_temperature", "channel", {"type": ["string", "null"], "enum": ["temp1", None]}),
    "own: a correction": takes("read_temperature", "offset_celsius", {**LEVEL, "minimum": -5, "description": "degC"}),
    "own: raw values too": takes("read_led", "include_raw", {"type": "boolean", "default": False}),
    "result: a number beside": returns("read_storage", "count", type="integer", description="number of disks"),
    "effect: nothing else": beside("set_led", "It changes nothing else, and is not read-only."),
    "effect: what it leaves alone": beside("set_led", "It does not write to any other LED; read_led only reads."),
    "effect: not for good": beside("set_brightness", "The value is lost when the computer restarts."),
    "answer: as it is": of_lamp(),
    "answer: less": of_lamp("level_percent", maximum=50),
    "answer: in other words": of_lamp(
        description="Dim the desk lamp from 0 to 80 percent.\n\nThrough: pyserial, tty at 9600 baud, 'LEVEL n'."
    ),
    "profile: in other words": of_rig(
        "arm_move_joint", description="Move one of the six joints of the SO-ARM101 arm to 0 to 4095 counts."
    ),
    "profile: a way": of_rig(
        "rail_move_x", description="Move the camera rail along X by at most 2000 steps either way."
    ),
}
