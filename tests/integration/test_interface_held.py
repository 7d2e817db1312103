"""INTERFACE of an agent that gets it wrong: each attempt is refused, with a finding that names the right value."""

from typing import Any

import pytest
from bench_host import desk
from cases import for_each
from held import Change, Output, both, refusals

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.contracts.model import Artifacts

PANELS = ["backlight-panel", "backlight-panel2"]
CAMERA, KEYS, TOUCH = "usb-1f00-00c1", "platform-keys", "hid-1f00-0077"


def tool(value: Output, name: str) -> Output:
    return next(each for each in value["tools"] if each["name"] == name)


def told(tool_name: str, /, **members: Any) -> Change:
    return lambda value: tool(value, tool_name).update(members)


def takes(name: str, parameter: str, schema: Output | None, **more: Any) -> Change:
    """A tool with one parameter as given; without it where the schema is None."""

    def change(value: Output) -> None:
        given = tool(value, name)
        given["input_schema"]["properties"][parameter] = schema
        if schema is None:
            given["input_schema"]["required"] = [
                each for each in given["input_schema"].get("required", ()) if each != parameter
            ]
        given.update(more)

    return change


def hints(**members: bool) -> Change:
    return lambda value: tool(value, "set_led")["annotations"].update(members)


def dropped(name: str) -> Change:
    return lambda value: value["tools"].remove(tool(value, name))


def added(name: str, /, **members: Any) -> Change:
    def change(value: Output) -> None:
        value["tools"].append({**tool(value, "read_temperature"), "name": name, **members})

    return change


def left(device: str, reason: str) -> Change:
    def change(value: Output) -> None:
        value["left_out"] = [each for each in value["left_out"] if each["id"] != device]
        value["left_out"].append({"id": device, "reason": reason})

    return change


def reads(value: Output) -> None:
    """A lamp that is set by a tool whose effect is read."""
    tool(value, "set_led").update(effect="read")
    tool(value, "set_led")["annotations"].update(readOnlyHint=True, idempotentHint=True)


PERCENT = {"type": "number", "description": "percent"}
BOUNDS, PIPE, WAIT = "INTERFACE-NUMBER-UNBOUNDED", "INTERFACE-PASSTHROUGH", "INTERFACE-WAIT-TOO-LONG"
WRONG: dict[str, tuple[Change, str, str]] = {
    "a number without bounds": (takes("set_led", "percent", PERCENT, limits=[]), BOUNDS, "no minimum and no maximum"),
    "a number without an end": (
        takes("set_led", "percent", {**PERCENT, "minimum": 0}, limits=[]),
        BOUNDS,
        "no maximum",
    ),
    "a number or nothing, without bounds": (
        takes("set_led", "fade", {"anyOf": [{"type": "integer"}, {"type": "null"}], "default": None}),
        BOUNDS,
        "'fade'",
    ),
    "numbers of a list without bounds": (
        takes("set_led", "levels", {"type": "array", "items": {"type": "integer"}, "maxItems": 3}),
        BOUNDS,
        "'levels'",
    ),
    "a wait of an hour": (
        takes(
            "read_input_events",
            "seconds",
            {"type": "number", "minimum": 0, "maximum": 3600, "default": 5, "description": "seconds"},
            limits=[],
        ),
        WAIT,
        "at most 60",
    ),
    "a wait permanently": (takes("read_temperature", "timeout", {"type": "number", "default": 1}), WAIT, "permanently"),
    "a wait in milliseconds": (
        takes("set_led", "timeout_ms", {"type": "integer", "minimum": 0, "maximum": 120_000, "default": 9}),
        WAIT,
        "60000",
    ),
    "a free command": (takes("set_led", "command", {"type": "string"}), PIPE, "'command'"),
    "a free command that reads": (takes("read_led", "query", {"type": "string", "default": "?"}), PIPE, "'query'"),
    "a pattern that takes anything": (
        takes("set_led", "mode", {"type": "string", "pattern": "^.*$"}),
        PIPE,
        "an enum or a pattern",
    ),
    "a path": (takes("capture_image", "path", {"type": "string", "default": "/tmp/x"}), PIPE, "'path'"),
    "a file to write to": (takes("capture_image", "save_to", {"type": "string", "default": ""}), PIPE, "'save_to'"),
    "an address of its own": (takes("read_led", "url", {"type": "string", "default": ""}), PIPE, "'url'"),
    "bytes": (
        takes("set_led", "payload", {"type": "array", "items": {"type": "integer", "minimum": 0, "maximum": 255}}),
        PIPE,
        "'payload'",
    ),
    "a pipe by name": (told("set_led", name="exchange_message"), PIPE, "raw pipe"),
    "a pipe by description": (told("set_led", description="Send any command to the lamp."), PIPE, "description"),
    "a pipe by what a parameter takes": (
        takes("set_led", "mode", {"type": "string", "description": "the raw command string", "maxLength": 20}),
        PIPE,
        "'mode'",
    ),
    "a lamp that reads": (reads, "INTERFACE-EFFECT-DIFFERS", "readOnlyHint false"),
    "hints that say that nothing changes": (hints(readOnlyHint=True), "INTERFACE-ANNOTATIONS", "write false"),
    "an erasure that reads": (
        told("read_storage", name="erase_storage"),
        "INTERFACE-EFFECT-UNDERSTATED",
        "what it reads",
    ),
    "one of two devices": (
        both(
            told("set_brightness", devices=PANELS[:1]),
            takes("set_brightness", "device", {"type": "string", "enum": PANELS[:1]}),
        ),
        "INTERFACE-DEVICES-DIFFER",
        PANELS[1],
    ),
    "two devices, and no way to choose": (
        takes("read_brightness", "device", None, smoke={"arguments": {}}),
        "INTERFACE-DEVICE-PARAMETER",
        "enum",
    ),
    "a capability without its tool": (
        dropped("read_input_events"),
        "INTERFACE-CAPABILITY-WITHOUT-TOOL",
        "add its tool",
    ),
    "a tool from nowhere": (
        added("read_pulse", capability="read_pulse"),
        "INTERFACE-TOOL-WITHOUT-CAPABILITY",
        "IDENTIFY",
    ),
    "a device from nowhere": (left("usb-dead-beef", "no_function"), "INTERFACE-UNKNOWN-DEVICE", "usb-dead-beef"),
    "a device in silence": (
        lambda value: value["left_out"].pop(0),
        "INTERFACE-DEVICE-UNACCOUNTED",
        "left_out with its reason",
    ),
    "a budget that is not used up": (left(TOUCH, "tool_budget"), "INTERFACE-BUDGET-UNUSED", "the reason that is true"),
    "a trial that does not fit": (
        told("read_input_events", smoke={"arguments": {"seconds": 300}}),
        "INTERFACE-SMOKE",
        "harmless arguments",
    ),
    "a trial of what acts": (told("set_led", smoke={"arguments": {"percent": 1}}), "INTERFACE-SMOKE", "take smoke out"),
    "a limit of nothing": (
        told("set_led", limits=[{"parameter": "percent", "unit": "%"}]),
        "INTERFACE-LIMIT-EMPTY",
        "neither",
    ),
    "a parameter without a type": (
        takes("set_led", "mode", {"description": "?"}),
        "INTERFACE-UNTYPED-PROPERTY",
        "a type",
    ),
}


def allowed(value: Output) -> None:
    """What an agent may do, once in each way."""
    for change in (
        takes("set_led", "percent", {**PERCENT, "exclusiveMinimum": 0, "maximum": 100}, limits=[]),
        takes("set_led", "mode", {"type": "string", "enum": ["on", "blink"], "default": "on"}),
        takes("set_led", "steps", {"type": "integer", "enum": [1, 2, 4], "default": 1}),
        takes("set_led", "fade", {"anyOf": [{"type": "number", "minimum": 0, "maximum": 5}, {"type": "null"}]}),
        takes("set_led", "text", {"type": "string", "maxLength": 40, "default": ""}),
        takes("set_led", "label", {"type": "string", "pattern": "^[a-z]{1,8}$", "default": "a"}),
        takes("read_temperature", "samples", {"type": "integer", "default": 1}),
        takes("read_temperature", "wait_ms", {"type": "integer", "minimum": 0, "maximum": 60_000, "default": 0}),
        takes("read_temperature", "timeout", {"type": "number", "exclusiveMaximum": 60, "default": 1}),
        takes("capture_image", "length_mm", {"type": "number", "default": 1}),
        told("set_led", description="Sends the lamp its level.\n\nThrough: raw bytes of the LED class."),
        told("read_storage", name="read_erase_count"),
    ):
        change(value)


@pytest.fixture(scope="module")
def refused(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, str]]:
    """The errors of each case of `WRONG`; after them `allowed` is accepted."""
    folder = tmp_path_factory.mktemp("held")
    host = desk(folder / "host")
    probe = probe_root(host)
    found = identify(probe, IdDatabases(host))
    changes = [*(change for change, _, _ in WRONG.values()), allowed]
    earlier = {"probe": probe, "identify": found}
    known = Artifacts(probe=probe, identify=found)
    good = declare(found, 30)
    _, errors = refusals(folder, host, "interface", earlier, good, changes, known=lambda _: known)
    return dict(zip(WRONG, errors, strict=True))


@for_each("case", WRONG, every=3, kind=lambda case: WRONG[case][1])
def test_what_a_caller_could_misuse_is_refused_with_the_cure(refused: dict[str, dict[str, str]], case: str) -> None:
    _, code, found = WRONG[case]
    assert list(refused[case]) == [code] and found in refused[case][code], refused[case]
