"""Outputs that an agent writes which wants to be done: placeholders, copied values, other units, plausible facts.

Each set was written before anybody looked at what the rules say of it, and then stayed. What a server may do wrong is
in `novel_servers`.
"""

from typing import Any

import identify_cases as identify
import novel_servers
import probe_cases as probe
import wrong_deploys as deploy
import wrong_interfaces as interface
from fresh_cases import NUMBER, TEXT, result
from identify_cases import ENV, called, more
from probe_cases import ARM, BATTERY, CAMERA, CHIP, DISK, HEAT, KESTREL, LINE, LINE_2, SOUND, STEPPER, WIFI
from unseen_cases import every

CAM = "product: Kestrel HD Camera"
KESTREL_OPTICS = "manufacturer: Kestrel Optics"


def copied(name: str, source: str) -> Any:
    """What is said of one device, under another one's id."""
    return lambda value: probe.found(value, name).update(raw_descriptor=probe.found(value, source)["raw_descriptor"])


PROBE_WRONG: dict[str, tuple[str, Any]] = {
    "a text that was cut short": ("laptop", probe.spelt(KESTREL, "product: Kestrel HD Camera", "product: Kes...")),
    "a note that it was cut": ("laptop", probe.line(SOUND, "(truncated for brevity)")),
    "the text of another device": ("laptop", copied(WIFI, DISK)),
    "the text of its twin by reference": ("bench", probe.put(LINE_2, raw_descriptor=f"same as {LINE}")),
    "what another program would say": ("laptop", probe.put(DISK, raw_descriptor="see the output of lspci -vv")),
    "maker and product in each other's place": (
        "laptop",
        every(
            probe.spelt(KESTREL, "product: Kestrel HD Camera", "product: Kestrel  Optics"),
            probe.spelt(KESTREL, "manufacturer: Kestrel Optics", "manufacturer: Kestrel HD Camera"),
        ),
    ),
    "a power from the specification": ("laptop", probe.line(KESTREL, "bMaxPower: 500mA")),
    "a speed from the specification": ("laptop", probe.line(KESTREL, "speed: 480 Mbit/s")),
    "a number in another base": ("laptop", probe.line(KESTREL, "idVendor (decimal): 7580")),
    "no driver where there is one": ("laptop", probe.line(KESTREL, "driver: none")),
    "a serial number that is none": ("laptop", probe.place(KESTREL, serial="N/A")),
    "another kind of cell": ("laptop", probe.spelt(BATTERY, "Li-ion", "Li-poly")),
    "a kind of supply of its neighbour": ("laptop", probe.line(BATTERY, "power_supply[0].type: Mains")),
    "a sum of devices": ("laptop", probe.line("dmi-board", "devices found: 34")),
    "a confidence": ("laptop", probe.line(KESTREL, "confidence: 0.95")),
    "a right that nothing asked for": ("laptop", probe.left((KESTREL, "permission denied"))),
    "a scan of all that failed beside": (
        "laptop",
        lambda value: [each.update(status="error") for each in value["scan_methods"]],
    ),
    "a link to a document": ("rig", probe.line(ARM, "datasheet: https://example.org/sts3215.pdf")),
}
PROBE_RIGHT: dict[str, tuple[str, Any]] = {
    "values in quotation marks": ("laptop", probe.spelt(KESTREL, CAM, 'product: "Kestrel HD Camera"')),
    "columns": (
        "laptop",
        lambda value: [
            each.update(raw_descriptor=each["raw_descriptor"].replace(": ", ":\t")) for each in value["devices"]
        ],
    ),
    "as a JSON object": (
        "laptop",
        probe.put(
            KESTREL,
            raw_descriptor='{"manufacturer": "Kestrel Optics", "product": "Kestrel HD Camera", "driver": "uvcvideo"}',
        ),
    ),
    "a way in German": ("laptop", probe.scan("Durchsicht von /sys/bus/usb und /sys/bus/pci", "ok", "nur gelesen")),
    "numbers of classes in decimal": ("laptop", probe.line(KESTREL, "bInterfaceClass 14")),
    "a way that took its time": ("laptop", probe.scan("upower -d", "timeout", "no answer within 10 s")),
}
IDENTIFY_WRONG: dict[str, tuple[str, Any]] = {
    "sizes of pictures from memory": (
        "laptop",
        lambda value: identify.ability(value, KESTREL, "capture_image").update(
            parameters={"resolutions": ["1920x1080", "1280x720"], "fps": 30}
        ),
    ),
    "a range from memory": (
        "raspberry",
        lambda value: identify.device(value, ENV)["capabilities"][0].update(
            parameters={"range": "-40 to 85 degC", "accuracy": "1 degC"}
        ),
    ),
    "a class of another kind": ("laptop", identify.put(KESTREL, **{"class": "printer"})),
    "a way to be found": ("laptop", more(BATTERY, "read_charge_cycles", via="TBD")),
    "a way that is no way": ("laptop", more(BATTERY, "read_charge_cycles", via="an appropriate library")),
    "a picture over a serial line": (
        "laptop",
        lambda value: identify.ability(value, KESTREL, "capture_image").update(via="pyserial"),
    ),
    "what another capability does": (
        "server",
        lambda value: identify.device(value, HEAT)["capabilities"][0].update(description="Take one picture."),
    ),
    "a guess under an unknown": ("bench", identify.unknown(LINE, identified_as="Arduino Uno")),
    "a clock that is set": (
        "laptop",
        more("pnp-pnp0b00", "sync_clock", description="Synchronise the clock with the network's time.", via="rtc"),
    ),
    "a meter that is tared": ("shop", identify.able(identify.METER, "tare_meter", "Make what it shows now zero.")),
    "a camera that focuses anew": (
        "laptop",
        more(KESTREL, "refocus_camera", description="Focus the lens anew.", via="V4L2"),
    ),
    "a reset that can be undone": (
        "laptop",
        more(KESTREL, "factory_reset_camera", description="Restore the settings.", effect="actuate", via="V4L2"),
    ),
    "a volume in German that reads": (
        "laptop",
        more(SOUND, "setze_lautstaerke", description="Stellt die Lautstärke ein.", via="ALSA mixer"),
    ),
    "a singular and a plural": (
        "laptop",
        more(KESTREL, "capture_images", description="Take one picture.", via="an installed video library"),
    ),
    "another host's camera": ("rig", called(CAMERA, "Kestrel HD Camera", CAM)),
    "a whole host out of scope": (
        "laptop",
        lambda value: value.update(
            devices=[],
            left_out=[
                {"id": each, "reason": "out_of_scope"}
                for each in (d["id"] for d in [*value["devices"], *value["left_out"]])
            ],
        ),
    ),
    "a kind of thing by a bare class": (
        "shop",
        called(identify.BARE, "USB input device", "interface 00: class ff/00/00", confidence=0.3, category="sensor"),
    ),
    "a sure name of a guess": (
        "bench",
        called(STEPPER, "Heron pick and place machine", "product: Heron Stepper <serial>", confidence=1.0),
    ),
}
IDENTIFY_RIGHT: dict[str, tuple[str, Any]] = {
    "codes in a picture": (
        "laptop",
        more(KESTREL, "decode_qr_codes", description="Take a picture and return the codes in it.", via="OpenCV"),
    ),
    "temperatures that are watched": (
        "laptop",
        more(CHIP, "monitor_temperatures", description="Temperatures over ten seconds.", via="sysfs hwmon"),
    ),
    "a time that is left": (
        "laptop",
        more(BATTERY, "estimate_remaining_time", description="How long the charge lasts.", via="sysfs power_supply"),
    ),
    "half sure": ("laptop", called(KESTREL, "Kestrel HD Camera", CAM, confidence=0.5)),
    "in Spanish": (
        "laptop",
        called(KESTREL, "cámara Kestrel HD", f"{CAM} => cámara: Spanish for camera"),
    ),
    "channels as PROBE names them": (
        "raspberry",
        lambda value: identify.device(value, ENV)["capabilities"][0].update(
            parameters={"channels": ["humidityrelative", "pressure", "temp"], "units": "as the kernel's iio class says"}
        ),
    ),
    "sizes that are asked for": (
        "laptop",
        lambda value: identify.ability(value, KESTREL, "capture_image").update(
            parameters={"sizes": "asked at every call", "reached_by": "video4linux"}
        ),
    ),
    "an unknown by its own string": ("bench", identify.unknown(LINE, identified_as="USB Serial adapter")),
}


def limit(**members: Any) -> Any:
    return lambda value: interface.tool(value, "set_brightness")["limits"][0].update(members)


BOOLEAN = {"type": "boolean"}
INTERFACE_WRONG: dict[str, Any] = {
    "a success for a reading": result("read_temperature", ("ok", BOOLEAN)),
    "a success and a message": result("read_temperature", ("success", BOOLEAN), ("message", TEXT)),
    "a temperature as a text": result("read_temperature", ("temperature_celsius", TEXT)),
    "a unit against its name": result(
        "read_temperature", ("temperature_celsius", {**NUMBER, "description": "in degrees Fahrenheit"})
    ),
    "anything": result("read_temperature", ("value", {})),
    "a size without a unit": result("read_storage", ("size", NUMBER)),
    "a weight without a unit": result("read_storage", ("weight", NUMBER)),
    "a frequency without a unit": result("read_storage", ("frequency", {"type": ["number", "null"]})),
    "a picture as a text": result("capture_image", ("image_base64", TEXT)),
    "a picture that was put somewhere": result("capture_image", ("saved_path", TEXT)),
    "many readings at long intervals": every(
        interface.takes("read_temperature", "samples", {"type": "integer", "minimum": 1, "maximum": 600, "default": 1}),
        interface.takes(
            "read_temperature",
            "interval_s",
            {**NUMBER, "minimum": 0, "maximum": 10, "default": 0, "description": "seconds between two"},
        ),
    ),
    "a limit in another unit": limit(unit="rpm"),
    "a list without an end": interface.takes(
        "set_led",
        "levels",
        {"type": "array", "items": {"type": "integer", "minimum": 0, "maximum": 255}, "default": []},
    ),
    "a text without an end": interface.takes("set_led", "caption", {**TEXT, "default": ""}),
    "a reading that is asked for what it reads": result("read_temperature", ("requested_device", TEXT)),
    "what is still to be done": interface.says("read_led", "TODO: describe this tool."),
}
INTERFACE_RIGHT: dict[str, Any] = {
    "few readings at short intervals": every(
        interface.takes("read_temperature", "samples", {"type": "integer", "minimum": 1, "maximum": 10, "default": 1}),
        interface.takes(
            "read_temperature",
            "interval_ms",
            {"type": "integer", "minimum": 0, "maximum": 1000, "default": 0, "description": "milliseconds"},
        ),
    ),
    "a state and whether it is new": result(
        "read_temperature", ("temperature_celsius", NUMBER), ("stale", BOOLEAN), ("note", {**TEXT, "maxLength": 80})
    ),
    "a part of one": result("read_temperature", ("load", {**NUMBER, "description": "as a part of one, 0 to 1"})),
    "in German": interface.says(
        "read_led", "Liest, wie hell die Leuchte der Platine ist.\n\nThrough: the kernel's class leds."
    ),
    "yes or no": result("read_temperature", ("is_present", BOOLEAN), ("temperature_k", NUMBER)),
    "a size in bytes": result("read_storage", ("size_bytes", {"type": "integer"})),
    "an option that is off": interface.takes("read_temperature", "raw", {**BOOLEAN, "default": False}),
}
SERVE_WRONG, SERVE_RIGHT = novel_servers.WRONG, novel_servers.RIGHT
DEPLOY_WRONG: dict[str, Any] = {
    "a letter before the version": deploy.version(2, "v3.5"),
    "a name with a second line": lambda value: value["requirements"][2].update(
        name="pyserial\n--index-url https://example.org/simple"
    ),
    "a digest behind the version": deploy.version(2, "3.5 --hash=sha256:00"),
    "the installer": deploy.requires("pip", "24.0", "to install the others"),
    "what builds packages": deploy.requires("setuptools", "70.0.0", "needed at run time"),
    "numbers by way of pictures": deploy.both(
        lambda value: value["requirements"].pop(3), deploy.provider(3, "opencv-python-headless")
    ),
    "all of it failed, and fine": deploy.both(
        lambda value: value.update(requirements=[]),
        *(deploy.failed(name) for name in ("fastmcp", "opencv-python-headless", "pyserial", "numpy")),
    ),
    "a failure without a reason": deploy.both(lambda value: value["requirements"].pop(1), deploy.failed("cv2", "")),
    "a Python that runs": lambda value: value.update(programs=[{"name": "python3"}]),
    "a Python that is none": lambda value: value.update(python=">=3.11.x"),
    "a failure told twice": deploy.both(
        lambda value: value["requirements"].pop(3), deploy.failed("numpy"), deploy.failed("numpy")
    ),
    "fine, and it could not be proved": lambda value: value.update(error="no network, so nothing was installed"),
    "the name of the module for the package": deploy.both(
        lambda value: value["requirements"][1].update(name="cv2"), deploy.provider(1, "cv2")
    ),
    "another maker's build": deploy.both(
        lambda value: value["requirements"][1].update(name="opencv-contrib-python"),
        deploy.provider(1, "opencv-contrib-python"),
    ),
}
DEPLOY_RIGHT: dict[str, Any] = {
    "a range with blanks": lambda value: value.update(python=">=3.11, <3.15"),
    "two conflicts": lambda value: value.update(
        conflicts=["opencv-python and opencv-python-headless write the same files", "numpy 2.0.0 is excluded"]
    ),
    "a reason of several words": lambda value: value["requirements"][2].update(why="the module serial, for the line"),
    "a version of two numbers": deploy.version(3, "2.1"),
    "a name in other letters": lambda value: value["requirements"][2].update(name="PYSERIAL"),
    "lists with nothing": lambda value: value.update(deps_failed=[], conflicts=[], programs=[]),
}


IDENTIFY_RIGHT |= {
    "a camera that senses and acts": ("laptop", identify.put(KESTREL, category="bidirectional")),
    "a sound card that acts": ("laptop", identify.put(SOUND, category="actuator")),
    "a light that acts and tells": ("laptop", identify.put(identify.LIGHT, category="bidirectional")),
    "a battery that carries the host": ("laptop", identify.put(BATTERY, category="infrastructure")),
}


# Categories that their class contradicts, the words of a neighbour, and units that disagree: of trials with agents.
def described(name: str, source: str) -> Any:
    """What is stated of one device, word by word, under another one's id."""

    def change(value: Any) -> None:
        own = identify.device(value, source)
        kept = ("identified_as", "category", "class", "confidence", "method", "evidence", "capabilities")
        identify.device(value, name).update({each: own[each] for each in kept if each in own})

    return change


IDENTIFY_WRONG |= {
    "a camera that acts": ("laptop", identify.put(KESTREL, category="actuator")),
    "a sensor chip that acts": ("laptop", identify.put(CHIP, category="actuator")),
    "a battery that acts": ("laptop", identify.put(BATTERY, category="actuator")),
    "an environmental sensor that acts": ("raspberry", identify.put(ENV, category="actuator")),
    "a display's light that senses": ("laptop", identify.put(identify.LIGHT, category="sensor")),
    "a camera that carries others": ("laptop", identify.put(KESTREL, category="infrastructure")),
    "a sensor as the camera": ("laptop", described(CHIP, KESTREL)),
    "the camera as the battery": ("laptop", described(KESTREL, BATTERY)),
    "the text of the camera for the disk": (
        "laptop",
        lambda value: identify.device(value, DISK)["capabilities"][0].update(
            description=identify.ability(value, KESTREL, "capture_image")["description"]
        ),
    ),
    "the text of the battery for the chip": (
        "laptop",
        lambda value: identify.device(value, CHIP)["capabilities"][0].update(
            description=identify.device(value, BATTERY)["capabilities"][0]["description"]
        ),
    ),
}


def in_words(name: str, text: str) -> Any:
    """A tool with this description."""
    return lambda value: interface.tool(value, name).update(description=text)


def percent(**bounds: Any) -> Any:
    """`set_brightness` with other bounds."""
    return lambda value: interface.tool(value, "set_brightness")["input_schema"]["properties"]["percent"].update(bounds)


INTERFACE_WRONG |= {
    "a temperature that is described in percent": in_words("read_temperature", "Read the humidity in percent."),
    "a temperature that is described in volts": in_words("read_temperature", "Read the sensor in volts."),
    "a percentage up to a hundred thousand": percent(maximum=100_000),
    "a percentage far below zero": percent(minimum=-1e6),
    "a temperature as one text": result("read_temperature", ("text", TEXT)),
    "degrees that are millivolts": result(
        "read_temperature", ("temperature_c", {**NUMBER, "description": "millivolts at the sensor"})
    ),
    "degrees in thousandths": result(
        "read_temperature",
        ("temperature_c", {**NUMBER, "description": "in millidegrees Celsius, as the kernel has it"}),
    ),
    "volts in degrees": result("read_temperature", ("temperature_v", {**NUMBER, "description": "degrees Celsius"})),
    "a pressure in per cent": result("read_temperature", ("pressure_hpa", {**NUMBER, "description": "percent"})),
    "bytes in megabytes": result(
        "read_storage", ("size_bytes", {"type": "integer", "description": "the size in megabytes"})
    ),
    "a kelvin of celsius": result(
        "read_temperature", ("temperature_k", {**NUMBER, "description": "temperature in degrees Celsius"})
    ),
    "a speed in volts": result("read_temperature", ("fan_rpm", {**NUMBER, "description": "in volts"})),
}
INTERFACE_RIGHT |= {
    "a temperature in another unit of it": in_words("read_temperature", "Read every temperature in kelvin."),
    "a temperature beside a load in percent": in_words(
        "read_temperature", "Read the temperature in degrees Celsius, at which fans run at 100 percent."
    ),
    "a temperature in other words": in_words("read_temperature", "Lit la température de la carte en °C."),
    "a percentage that may be negative": percent(minimum=-100, description="change in percent; negative is darker"),
    "a percentage of a turn": interface.takes(
        "set_led", "tilt_percent", {**NUMBER, "minimum": -100, "maximum": 100, "default": 0}
    ),
    "degrees that a voltage gives": result(
        "read_temperature",
        ("temperature_c", {**NUMBER, "description": "degrees Celsius, computed from the millivolts of the sensor"}),
    ),
    "degrees by their letter": result("read_temperature", ("temperature_c", {**NUMBER, "description": "in C"})),
    "degrees without a word": result("read_temperature", ("temperature_c", NUMBER)),
    "volts with their range": result(
        "read_storage", ("supply_v", {**NUMBER, "description": "volts; the driver gives millivolts"})
    ),
    "a state of charge and its count": result(
        "read_storage", ("load_percent", {**NUMBER, "description": "percent of 250 mA"})
    ),
}


# What the host or a stage before contradicts: lights, channels and products, and whom a description calls.
def choice(name: str, *words: str) -> Any:
    """`set_led` with a choice among these."""
    return interface.takes("set_led", name, {**TEXT, "enum": [*words], "default": words[0]})


def as_named(capability: str, name: str) -> Any:
    return lambda value: interface.tool(value, capability).update(name=name)


UNIT = {**TEXT, "enum": ["V", "A"]}
INTERFACE_WRONG |= {
    "a brightness below zero": percent(minimum=-100),
    "a lamp below zero": interface.takes(
        "set_led", "led_percent", {**NUMBER, "minimum": -50, "maximum": 100, "default": 0}
    ),
    "a light that the board has not": choice("led", "bench:green", "bench:red"),
    "another board's light": choice("led", "bench:red"),
    "a channel that the board has not": interface.takes(
        "read_temperature", "channel", {**TEXT, "enum": ["temp1", "temp7"], "default": "temp1"}
    ),
    "volts of a thermometer": result("read_temperature", ("supply_v", {**NUMBER, "description": "volts"})),
    "units of another chip": result("read_temperature", ("value", NUMBER), ("unit", UNIT)),
    "humidity of a thermometer": result("read_temperature", ("humidity_percent", NUMBER)),
    "a product in a name": as_named("capture_image", "capture_works_image"),
    "a maker in a name": as_named("list_camera_formats", "works_formats"),
    "a reading that is published": interface.says(
        "read_temperature", "Read the temperature and publish it.\nPublishes each reading to an MQTT broker."
    ),
    "a picture that is uploaded": interface.says("capture_image", "Takes a picture and uploads it to the cloud."),
    "a tool that comes first": interface.says(
        "set_led", "Dims the lamp. You must call read_led before, or the level is lost."
    ),
    "a picture that is mailed": interface.says("capture_image", "Takes a picture and e-mails it to the owner."),
    "a lamp of the whole world": interface.hint("set_led", openWorldHint=True),
}
INTERFACE_RIGHT |= {
    "a light by a part of its name": choice("led", "green"),
    "a light or all of them": choice("led", "bench:green", "all"),
    "a choice of something else": choice("effect", "steady", "blink"),
    "a channel by its label": interface.takes(
        "read_temperature", "channel", {**TEXT, "enum": ["temp1", "board"], "default": "board"}
    ),
    "a temperature in Fahrenheit": result("read_temperature", ("temperature_fahrenheit", NUMBER)),
    "a temperature and a load": result("read_temperature", ("temperature_k", NUMBER), ("load_percent", NUMBER)),
    "a name with the kind of thing": as_named("set_led", "set_led_light"),
    "a picture that stays": interface.says(
        "capture_image", "Takes a picture. Nothing is uploaded to the cloud or kept.\n\nThrough: OpenCV."
    ),
    "what a device sends": interface.says(
        "read_input_events", "Waits for the events that the keys send to the kernel."
    ),
    "what an agent advised": interface.says("set_led", "Dims the lamp. Call read_led first to keep what it had."),
    "what may be called as well": interface.says("set_led", "Dims the lamp. Call read_led to see the level."),
    "what to do before": interface.says("set_led", "Dims the lamp. The level that read_led gives is lost then."),
}
