"""Readings from what the tools of a live endpoint answer, and from a camera; what cannot be read is a reading too."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from launched import Launched, launched, tool

from octoform.claims.model import Channel, Reading, Signal, Value
from octoform.daemon.observe.samples import (
    EMPTY,
    MAX_CALLS,
    MAX_VALUES,
    Frames,
    Sensors,
    flattened,
    is_sensor,
    source_of,
    tool_of,
)
from octoform.endpoint.process.record import running
from octoform.state.layout import Layout

SERVER = '''
from fastmcp import FastMCP
from fastmcp.tools.base import ToolResult
from fastmcp.utilities.types import Image
mcp = FastMCP("bench")

@mcp.tool
def joints() -> dict[str, list[dict[str, int | str | None]]]:
    """Joints."""
    return {"joints": [
        {"name": "base", "heat": 30, "skipped": None},
        {"name": "elbow", "heat": None, "skipped": "it is switched off"},
    ]}

@mcp.tool
def read_temperature(device: str) -> dict[str, int | str]:
    """One of two."""
    if device == "hwmon-nvme":
        raise ValueError("no such file")
    return {"device": device, "celsius": 41}

@mcp.tool
def broken() -> dict[str, int]:
    """Fails."""
    raise ValueError("no value")

@mcp.tool
def eye() -> ToolResult:
    """Looks."""
    return ToolResult(content=[Image(data=b"x", format="png").to_image_content()], structured_content={"mean": 1})

@mcp.tool
def faults() -> dict[str, list[str]]:
    """There are none."""
    return {"faults": []}

@mcp.tool
def move() -> dict[str, bool]:
    """Moves."""
    raise RuntimeError("it was called")
'''
ARGUMENTS: dict[str, Any] = {"type": "object", "properties": {}}


def declared(name: str, effect: str = "read", **schema: Any) -> dict[str, Any]:
    return {**tool(name, effect), "input_schema": {**ARGUMENTS, **schema}}


CHIPS = {"type": "string", "enum": ["hwmon-k10temp", "hwmon-nvme"]}
TOOLS = [
    declared("joints"),
    declared("broken"),
    declared("eye"),
    declared("faults"),
    declared("move", "actuate"),
    declared("read_temperature", properties={"device": CHIPS}, required=["device"]),
]


def make(signal: Signal, value: Value, why: str) -> Reading:
    return Reading("id", "now", 0.0, signal, value, why)


def told(readings: tuple[Reading, ...]) -> list[tuple[str, str, Value, str]]:
    return [(each.signal.source, each.signal.path, each.value, each.why) for each in readings]


def sources(sensors: Sensors) -> list[str]:
    return [source_of(probe) for probe in sensors.probes()]


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    with launched(tmp_path_factory.mktemp("sampled"), SERVER, TOOLS) as found:
        path = found.layout.output("interface")
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps({"tools": TOOLS}))
        yield found


def test_what_tools_answer_are_readings_and_so_is_what_they_do_not(endpoint: Launched) -> None:
    sensors = Sensors(endpoint.layout, make)
    chips = ["read_temperature(hwmon-k10temp)", "read_temperature(hwmon-nvme)"]
    assert sources(sensors) == ["broken", "eye", "faults", "joints", *chips]
    found = sensors()
    assert {each.signal.channel for each in found} == {Channel.SENSOR}
    broken, faults, *joints = [each for each in told(found) if each[0] not in chips]
    assert broken[:3] == ("broken", "", None)
    assert broken[3]
    assert faults == ("faults", "", EMPTY, ""), "to tell of nothing is an answer"
    assert joints == [
        ("joints", "/joints/base/name", "base", ""),
        ("joints", "/joints/base/heat", 30, ""),
        ("joints", "/joints/base/skipped", None, ""),
        ("joints", "/joints/elbow/name", "elbow", ""),
        ("joints", "/joints/elbow/heat", None, "it is switched off"),
        ("joints", "/joints/elbow/skipped", "it is switched off", ""),
    ]
    left = ["broken", "faults", "joints", *chips]
    assert sources(sensors) == left, "a tool that gave a picture was called again"
    assert sensors.promised() == {Signal(Channel.SENSOR, name, "") for name in left}


def test_a_tool_of_several_devices_is_asked_for_each_and_one_that_fails_is_told_apart(endpoint: Launched) -> None:
    found = [each for each in told(Sensors(endpoint.layout, make)()) if tool_of(each[0]) == "read_temperature"]
    assert found[:2] == [
        ("read_temperature(hwmon-k10temp)", "/device", "hwmon-k10temp", ""),
        ("read_temperature(hwmon-k10temp)", "/celsius", 41, ""),
    ]
    ((source, path, value, why),) = found[2:]
    assert (source, path, value) == ("read_temperature(hwmon-nvme)", "", None)
    assert why


def test_what_is_more_than_is_read_at_a_time_is_said_and_not_left_out(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    layout.output("interface").parent.mkdir(parents=True)
    many = {"type": "string", "enum": [f"hwmon-{number}" for number in range(MAX_CALLS + 7)]}
    tools = [declared("read_temperature", properties={"device": many}, required=["device"])]
    layout.output("interface").write_text(json.dumps({"tools": tools}))
    found = Sensors(layout, make)()
    assert len({each.signal for each in found}) == MAX_CALLS + 7
    assert all(each.value is None and each.why for each in found)


def test_the_calls_pass_the_gate_and_nothing_is_moved(endpoint: Launched) -> None:
    Sensors(endpoint.layout, make)()
    records = [json.loads(line) for line in (endpoint.layout.logs / "audit.jsonl").read_text().splitlines()]
    assert {each["tool"] for each in records if each["event"] == "decision"} == {
        "broken",
        "eye",
        "faults",
        "joints",
        "read_temperature",
    }


def test_an_endpoint_that_does_not_run_is_not_started(endpoint: Launched) -> None:
    endpoint.stop()
    try:
        found = Sensors(endpoint.layout, make)()
        assert {tool_of(each.signal.source) for each in found} == {
            "broken",
            "eye",
            "faults",
            "joints",
            "read_temperature",
        }
        assert all(each.value is None and each.why for each in found)
        assert Frames(endpoint.layout, make, lambda: pytest.fail("it looked"))() == ()
        assert running(endpoint.layout) is None
    finally:
        endpoint.start()


@pytest.mark.parametrize(
    ("declaration", "called"),
    [
        (declared("read_temperature", properties={"digits": {"default": 1}}), True),
        (declared("read_temperature", required=["device"]), False),
        (declared("read_temperature", properties={"device": CHIPS}, required=["device"]), True),
        (declared("read_register", properties={"device": CHIPS}, required=["device", "address"]), False),
        (declared("capture_image", properties={"device": CHIPS}, required=["device"]), False),
        (declared("wait_for_button", properties={"timeout_s": {"default": 10}}), False),
        (declared("capture_image"), False),
        (declared("look_around") | {"capability": "take_picture"}, False),
        (declared("list_camera_formats"), False),
        (declared("set_light", "actuate"), False),
        ({"name": "odd", "effect": "read", "input_schema": {"properties": []}}, False),
    ],
)
def test_only_what_asks_for_nothing_and_shows_nothing_is_called(declaration: Mapping[str, Any], called: bool) -> None:
    assert is_sensor(declaration) is called


@pytest.mark.parametrize(
    ("look", "expected"),
    [
        (
            {"camera": "usb-1", "picture": {"trouble": None, "mean": 80.5, "spread": 20}},
            [("usb-1", "/trouble", "", ""), ("usb-1", "/mean", 80.5, ""), ("usb-1", "/spread", 20, "")],
        ),
        (
            {"camera": "usb-1", "picture": {"trouble": "black", "mean": 0.0}},
            [("usb-1", "/trouble", "black", ""), ("usb-1", "/mean", 0.0, "")],
        ),
        (
            {"camera": "usb-1", "picture": None, "detail": "it is \x1b gone"},
            [("usb-1", "/trouble", None, "it is \\x1b gone")],
        ),
        ({}, [("camera", "/trouble", None, "there was no picture")]),
    ],
)
def test_a_picture_is_readings_and_so_is_none(endpoint: Launched, look: dict[str, Any], expected: list[Any]) -> None:
    found = Frames(endpoint.layout, make, lambda: look)()
    assert told(found) == expected
    assert {each.signal.channel for each in found} == {Channel.FRAME}


def test_members_of_lists_stand_by_a_name_that_tells_them_apart() -> None:
    value = {"a/b": [{"id": 1, "x": 5}, {"id": 2, "x": 6}], "c~": [{"name": "n", "x": 1}, {"name": "n", "x": 2}]}
    value["joints"] = [{"id": 1, "joint": "pan", "x": 3}, {"id": 2, "joint": "lift", "x": 4}]
    assert [(path, each) for path, each, _ in flattened(value) if path.endswith("/x")] == [
        ("/a~1b/1/x", 5),
        ("/a~1b/2/x", 6),
        ("/c~0/0/x", 1),
        ("/c~0/1/x", 2),
        ("/joints/pan/x", 3),
        ("/joints/lift/x", 4),
    ]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=30,
)


@given(JSON)
def test_whatever_a_tool_answers_each_value_has_its_own_path(value: object) -> None:
    found = list(flattened(value))
    assert len(found) <= MAX_VALUES
    paths = [path for path, _, _ in found]
    assert len(set(paths)) == len(paths)
    assert all(path == "" or path.startswith("/") for path in paths)
    assert all(each is None or not why for _, each, why in found)
