"""What an agent writes that is true of something else: another device, another act, another quantity, no kind at all.

Each set was accepted by the rules of its day, and is kept beside what is right although it looks alike.
"""

from typing import Any

import wrong_deploys as deploy
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
