"""What an agent writes that is true of something else: another device, another act, another quantity, no kind at all.

Each set was accepted by the rules of its day, and is kept beside what is right although it looks alike.
"""

from typing import Any

import wrong_deploys as deploy
from identify_cases import ENV, ability, more
from server_edits import ASKED, FILE, Edit, adds, all_of, alongside, body, read_by, swap, uses, warm
from wrong_interfaces import TEXT, Output, says, takes, told, tool


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
DISK = """
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
    "kernel: sectors as bytes": body("read_storage", DISK.format("sectors")),
    "kernel: pages": body("read_storage", DISK.format("sectors * 4096")),
    "kernel: kibibytes": body("read_storage", DISK.format("sectors // 2")),
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
    "kernel: sectors of 512 bytes": body("read_storage", DISK.format("sectors << 9")),
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
