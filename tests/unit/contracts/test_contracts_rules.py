"""Each rule of PROBE, IDENTIFY, INTERFACE and DEPLOY, broken alone: a good artifact, one change, exactly that code."""

from collections.abc import Callable
from typing import Any

import pytest
from cases import for_each
from unit.contracts.contract_samples import READ, SCHEMAS, artifacts, good

from octoform.contracts.contract_check import MAX_PER_RULE, RULES, check
from octoform.contracts.model import Artifacts
from octoform.contracts.rules import probe_host_rules, probe_rules
from octoform.contracts.rules.identify import (
    annotation_rules,
    answer_rules,
    channel_rules,
    fact_rules,
    name_rules,
    prose_rules,
)
from octoform.contracts.rules.identify.answer_rules import is_whole_quote
from octoform.diagnostics import Severity

Change = Callable[[dict[str, Any]], Any]


def _put(path: str, new: Any) -> Change:
    """Set the member that a dotted path names; numbers index lists."""

    def change(value: dict[str, Any]) -> None:
        place: Any = value
        *above, last = (int(part) if part.isdigit() else part for part in path.split("."))
        for part in above:
            place = place[part]
        place[last] = new

    return change


def _add(path: str, new: Any) -> Change:
    """Append to the list that a dotted path names."""

    def change(value: dict[str, Any]) -> None:
        place: Any = value
        for part in path.split("."):
            place = place[int(part) if part.isdigit() else part]
        place.append(new)

    return change


def _drop(path: str) -> Change:
    def change(value: dict[str, Any]) -> None:
        place: Any = value
        *above, last = (int(part) if part.isdigit() else part for part in path.split("."))
        for part in above:
            place = place[part]
        del place[last]

    return change


def _all(*changes: Change) -> Change:
    def change(value: dict[str, Any]) -> None:
        for item in changes:
            item(value)

    return change


def _copy_device(value: dict[str, Any]) -> None:
    value["devices"].append(dict(value["devices"][1]))


def _copy_capability(value: dict[str, Any]) -> None:
    value["devices"][0]["capabilities"].append(dict(value["devices"][0]["capabilities"][0]))


def _second_tool(name: str, capability: str, device: str) -> dict[str, Any]:
    return {
        "name": name,
        "capability": capability,
        "devices": [device],
        "description": "x",
        "effect": "read",
        "annotations": READ,
        "output_schema": {"type": "object", "properties": {"seen": {"type": "integer"}}},
        "input_schema": {"type": "object"},
        "smoke": {"arguments": {}},
    }


PROBE_CASES: list[tuple[str, Change]] = [
    ("PROBE-SCHEMA", _put("devices.0.id", "Usb 1")),
    ("PROBE-SCHEMA", _put("surprise", 1)),
    ("PROBE-SCHEMA", _drop("scan_methods.0.status")),
    ("PROBE-DUPLICATE-ID", _copy_device),
    ("PROBE-DUPLICATE-SCAN", _add("scan_methods", {"name": "sysfs", "status": "ok"})),
    ("PROBE-NO-WORKING-SCAN", _put("scan_methods.0.status", "denied")),
    ("PROBE-NEIGHBOUR-NOT-CONTEXT", _put("devices.4.context", False)),
    ("PROBE-NEIGHBOUR-NOT-CONTEXT", _put("devices.5.interface", "mdns")),
    ("PROBE-TTY-OPENED", _put("scan_methods.0.detail", "opened /dev/ttyUSB0 at 115200 baud")),
    ("PROBE-TTY-OPENED", _put("scan_methods.0.name", "serial port handshake")),
    ("PROBE-TTY-OPENED", _put("devices.3.raw_descriptor", "driver: bridge\nreply: OK v1.2")),
    ("PROBE-UNESCAPED-TEXT", _put("devices.0.name", "cam\u202eera")),
    ("PROBE-UNESCAPED-TEXT", _put("devices.0.name", "two\nlines")),
    ("PROBE-UNESCAPED-TEXT", _put("devices.0.raw_descriptor", "bell\x07")),
    ("PROBE-SERIAL-IN-ID", _put("devices.0.id", "usb-1234-ac00451177")),
    ("PROBE-SERIAL-IN-ID", _put("devices.3.id", "usb-02005e100001")),
    ("PROBE-PORT-IN-ID", _put("devices.0.id", "usb-1-1.4")),
    ("PROBE-INSTALLED", _put("scan_methods.0.detail", "apt-get install usbutils was run first")),
    ("PROBE-INSTALLED", _put("scan_methods.0.detail", "installed i2c-tools to list the bus")),
    ("PROBE-INSTALLED", _put("scan_methods.0.name", "modprobe i2c-dev")),
    ("PROBE-NETWORK-SCAN", _put("scan_methods.0.name", "nmap -sn")),
    ("PROBE-NETWORK-SCAN", _put("scan_methods.0.detail", "scanned the subnet for cameras")),
    ("PROBE-NETWORK-SCAN", _put("scan_methods.0.detail", "bluetoothctl scan on, 10 s")),
    ("PROBE-RIGHTS", _put("scan_methods.0.detail", "dmidecode with sudo")),
    ("PROBE-DEVICE-OPENED", _put("scan_methods.0.name", "i2cdetect -y 1")),
    ("PROBE-TIMESTAMP", _put("timestamp", "this morning")),
    ("PROBE-TIMESTAMP", _put("timestamp", "2026-01-02T03:04:05")),
]

IDENTIFY_CASES: list[tuple[str, Change]] = [
    ("IDENTIFY-SCHEMA", _put("devices.0.category", "sensors")),
    ("IDENTIFY-SCHEMA", _put("devices.0.evidence", [])),
    ("IDENTIFY-INVENTED-DEVICE", _add("left_out", {"id": "usb-arm", "reason": "no_function"})),
    ("IDENTIFY-DUPLICATE-DEVICE", _add("left_out", {"id": "usb-1234-0001", "reason": "no_function"})),
    ("IDENTIFY-DEVICE-UNACCOUNTED", _drop("left_out.1")),
    ("IDENTIFY-QUOTE-NOT-VERBATIM", _put("devices.0.evidence.0.quote", "Acme  Deskcam")),
    ("IDENTIFY-QUOTE-NOT-VERBATIM", _put("devices.0.evidence.0.quote", "Widgetronic Deskcam")),
    ("IDENTIFY-QUOTE-NOT-VERBATIM", _all(_put("devices.0.evidence.0.quote", ":"), _put("devices.0.confidence", 0.4))),
    ("IDENTIFY-NAME-WITHOUT-EVIDENCE", _put("devices.0.identified_as", "Zebra 9000")),
    ("IDENTIFY-CHIP-NOT-PRODUCT", _put("devices.0.identified_as", "USB-serial adapter")),
    ("IDENTIFY-PASSTHROUGH", _put("devices.0.capabilities.0.name", "send_serial_command")),
    ("IDENTIFY-CAPABILITY-WITHOUT-CLASS", _put("devices.0.capabilities.0.name", "record_audio_of_disk")),
    ("IDENTIFY-EFFECT-UNDERSTATED", _put("devices.0.capabilities.0.name", "erase_image")),
    (
        "IDENTIFY-UNKNOWN-CAPABILITY",
        _all(
            _put("devices.1.category", "unknown"),
            _put("devices.1.confidence", 0),
            _put("devices.1.missing", "What is it?"),
        ),
    ),
    ("IDENTIFY-UNKNOWN-CONFIDENCE", _put("devices.3.confidence", 0.4)),
    ("IDENTIFY-UNKNOWN-MISSING", _drop("devices.3.missing")),
    ("IDENTIFY-UNKNOWN-MISSING", _put("devices.3.missing", "?")),
    ("IDENTIFY-NO-VIA", _put("devices.0.capabilities.0.via", " N/A ")),
    ("IDENTIFY-PROFILE-EVIDENCE", _put("devices.0.profile", "lamp")),
    ("IDENTIFY-PROFILE-EVIDENCE", _put("devices.2.profile", "lampe")),
    ("IDENTIFY-PROFILE-EVIDENCE", _drop("devices.2.profile")),
    ("IDENTIFY-INFRASTRUCTURE-ACTUATES", _put("devices.2.category", "infrastructure")),
    ("IDENTIFY-DUPLICATE-CAPABILITY", _copy_capability),
    ("IDENTIFY-UNESCAPED-TEXT", _put("devices.0.identified_as", "Acme Desk\u200bcam")),
    ("IDENTIFY-UNESCAPED-TEXT", _put("devices.0.capabilities.0.description", "see \x1b[2J")),
    (
        "IDENTIFY-EFFECT-CONFLICT",
        _all(
            _put("devices.0.category", "bidirectional"),
            _put("devices.1.capabilities.1.name", "set_level"),
            _add(
                "devices.0.capabilities",
                {"name": "set_level", "description": "x", "via": "x86 port", "effect": "irreversible"},
            ),
        ),
    ),
    ("IDENTIFY-STOPS", _put("devices.0.capabilities.0.stops", True)),
    (
        "IDENTIFY-STOPS",
        _all(
            _put("devices.0.category", "bidirectional"),
            _put("devices.1.capabilities.1.name", "set_level"),
            _add(
                "devices.0.capabilities",
                {"name": "set_level", "description": "x", "via": "x86 port", "effect": "actuate", "stops": True},
            ),
        ),
    ),
]

INTERFACE_CASES: list[tuple[str, Change]] = [
    ("INTERFACE-SCHEMA", _put("tools.0.name", "no blanks")),
    ("INTERFACE-SCHEMA", _drop("tools.0.annotations.openWorldHint")),
    ("INTERFACE-STOPS", _put("tools.2.stops", True)),
    ("INTERFACE-CAPABILITY-WITHOUT-TOOL", _drop("tools.1")),
    ("INTERFACE-TOOL-WITHOUT-CAPABILITY", _add("tools", _second_tool("see", "see_things", "usb-1234-0001"))),
    ("INTERFACE-DUPLICATE-CAPABILITY", _add("tools", _second_tool("fan_rpm", "read_fan_speed", "hwmon-fanboard"))),
    ("INTERFACE-DEVICES-DIFFER", _put("tools.1.devices", ["usb-1234-0002"])),
    ("INTERFACE-NAME-CLASH", _put("tools.2.name", "Capture-Image")),
    ("INTERFACE-EFFECT-DIFFERS", _all(_put("tools.2.effect", "read"), _put("tools.2.annotations", READ))),
    ("INTERFACE-ANNOTATIONS", _put("tools.1.annotations", {**READ, "destructiveHint": True})),
    ("INTERFACE-ANNOTATIONS", _put("tools.2.annotations", READ)),
    ("INTERFACE-UNKNOWN-DEVICE", _add("left_out", {"id": "usb-arm", "reason": "no_function"})),
    ("INTERFACE-DEVICE-UNACCOUNTED", _drop("left_out.2")),
    ("INTERFACE-UNESCAPED-TEXT", _put("tools.0.description", "A picture.\U000e0069\U000e0067")),
    ("INTERFACE-LEFT-OUT-TWICE", _add("left_out", {"id": "pci-bridge", "reason": "bus_infrastructure"})),
    ("INTERFACE-REASON-DIFFERS", _put("left_out.2.reason", "virtual")),
    ("INTERFACE-LEFT-OUT-TWICE", _add("left_out", {"id": "hwmon-fanboard", "reason": "virtual"})),
    ("INTERFACE-DUPLICATE-PATH", _put("tools.2.name", "get_fan_speed")),
    ("INTERFACE-EFFECT-UNDERSTATED", _put("tools.1.name", "erase_fan_speed")),
    ("INTERFACE-NUMBER-UNBOUNDED", _put("tools.2.input_schema.properties.percent", {"type": "number", "minimum": 0})),
    ("INTERFACE-WAIT-TOO-LONG", _put("tools.1.input_schema.properties.timeout", {"type": "number", "maximum": 61})),
    ("INTERFACE-BUDGET-UNUSED", _put("left_out.2.reason", "tool_budget")),
    ("INTERFACE-BUDGET-UNUSED", _put("left_out.2.reason", "server_size")),
    ("INTERFACE-PASSTHROUGH", _put("tools.1.name", "raw_bytes_read")),
    ("INTERFACE-PASSTHROUGH", _put("tools.2.input_schema.properties.command", {"type": "string"})),
    ("INTERFACE-INPUT-SCHEMA", _put("tools.1.input_schema.type", "array")),
    ("INTERFACE-INPUT-SCHEMA", _put("tools.1.input_schema.minProperties", "many")),
    ("INTERFACE-INPUT-SCHEMA", _put("tools.1.input_schema.$ref", "https://example.org/schema")),
    ("INTERFACE-INPUT-SCHEMA", _put("tools.1.input_schema.$ref", "#/$defs/lost")),
    ("INTERFACE-OUTPUT-SCHEMA", _put("tools.0.output_schema.type", "string")),
    ("INTERFACE-UNTYPED-PROPERTY", _put("tools.2.input_schema.properties.percent", {"description": "x"})),
    ("INTERFACE-REQUIRED-UNKNOWN", _put("tools.2.input_schema.required", ["percent", "fan"])),
    ("INTERFACE-DEVICE-PARAMETER", _put("tools.2.input_schema.properties.device", {"enum": ["usb-1234-0001"]})),
    ("INTERFACE-LIMIT-MISSING", _drop("tools.3.limits")),
    ("INTERFACE-LIMIT-WIDER", _put("tools.3.limits.0.maximum", 81)),
    ("INTERFACE-LIMIT-WIDER", _drop("tools.3.limits.0.minimum")),
    ("INTERFACE-LIMIT-WIDER", _put("tools.3.limits.0.unit", "watt")),
    ("INTERFACE-LIMIT-EMPTY", _put("tools.2.limits", [{"parameter": "percent"}])),
    ("INTERFACE-LIMIT-EMPTY", _put("tools.2.limits", [{"parameter": "percent", "minimum": 2, "maximum": 1}])),
    ("INTERFACE-LIMIT-EMPTY", _put("tools.2.limits", [{"parameter": "speed", "maximum": 1}])),
    ("INTERFACE-SMOKE", _put("tools.0.smoke.arguments", {"width": 0})),
    ("INTERFACE-SMOKE", _drop("tools.0.smoke")),
    ("INTERFACE-SMOKE", _put("tools.2.smoke", {"arguments": {"percent": 1}})),
]

DEPLOY_CASES: list[tuple[str, Change]] = [
    ("DEPLOY-UNESCAPED-TEXT", _put("requirements.0.why", "the \u200bserver")),
    ("DEPLOY-SCHEMA", _put("requirements.0.version", ">=4")),
    ("DEPLOY-STATUS-ERROR", _all(_put("status", "error"), _put("error", "no wheel"))),
    ("DEPLOY-IMPORT-UNRESOLVED", _drop("imports.0")),
    ("DEPLOY-IMPORT-PROVIDER", _put("imports.1.provided_by", "opencv")),
    ("DEPLOY-IMPORT-PROVIDER", _put("imports.1.provided_by", "python")),
    ("DEPLOY-IMPORT-PROVIDER", _put("imports.1.provided_by", "runtime")),
    ("DEPLOY-DUPLICATE-REQUIREMENT", _add("requirements", {"name": "FastMCP", "version": "4.1.0"})),
    ("DEPLOY-FAILED-AND-REQUIRED", _add("deps_failed", {"name": "opencv_python_headless", "reason": "no wheel"})),
    (
        "DEPLOY-DECLARED-NOT-REQUIRED",
        _all(
            _drop("requirements.1"),
            _drop("imports.1"),
            _add("requirements", {"name": "opencv-python", "version": "4.1", "why": "pictures"}),
            _add("imports", {"module": "cv2", "provided_by": "opencv-python"}),
        ),
    ),
    ("DEPLOY-PROVIDER-TWICE", _add("imports", {"module": "cv2", "provided_by": "fastmcp"})),
    ("DEPLOY-VERSION-OUTSIDE", _put("requirements.0.version", "3.9.9")),
    ("DEPLOY-VERSION-OUTSIDE", _put("requirements.0.version", "4.2.0")),
    ("DEPLOY-IMPORT-NOT-THERE", _add("imports", {"module": "serial", "provided_by": "fastmcp"})),
    ("DEPLOY-REQUIREMENT-UNUSED", _add("requirements", {"name": "leftpad", "version": "1.0"})),
]


def _codes(stage: str, change: Change, **other: Any) -> set[str]:
    value = good(stage)
    change(value)
    return {item.code for item in check(stage, value, artifacts(**other), SCHEMAS)}


@pytest.mark.parametrize("stage", ["probe", "identify", "interface", "serve", "deploy"])
def test_the_good_artifact_is_accepted(stage: str) -> None:
    assert check(stage, good(stage), artifacts(), SCHEMAS) == []


@pytest.mark.parametrize(("code", "change"), PROBE_CASES)
def test_a_broken_probe_gets_exactly_its_code(code: str, change: Change) -> None:
    assert _codes("probe", change) == {code}


@pytest.mark.parametrize(("code", "change"), IDENTIFY_CASES)
def test_a_broken_identify_gets_exactly_its_code(code: str, change: Change) -> None:
    assert _codes("identify", change) == {code}


@pytest.mark.parametrize(("code", "change"), INTERFACE_CASES)
def test_a_broken_interface_gets_exactly_its_code(code: str, change: Change) -> None:
    assert _codes("interface", change) == {code}


@pytest.mark.parametrize(("code", "change"), DEPLOY_CASES)
def test_a_broken_deploy_gets_exactly_its_code(code: str, change: Change) -> None:
    assert _codes("deploy", change) == {code}


def test_a_neighbour_may_not_be_promoted() -> None:
    value = good("identify")
    value["left_out"].pop(0)
    device = dict(value["devices"][0], id="neighbour-router", identified_as="A router", evidence=[{"quote": "router"}])
    value["devices"].append(device)
    found = check("identify", value, artifacts(), SCHEMAS)
    assert [item.code for item in found] == ["IDENTIFY-NEIGHBOUR-PROMOTED"]


def test_many_devices_are_a_warning_only() -> None:
    probe, value = good("probe"), good("identify")
    for index in range(40):
        probe["devices"].append(dict(probe["devices"][1], id=f"hwmon-x-{index}"))
        value["devices"].append(dict(value["devices"][1], id=f"hwmon-x-{index}"))
    found = check("identify", value, artifacts(probe=probe), SCHEMAS)
    assert [(item.code, item.severity) for item in found] == [("IDENTIFY-MANY-DEVICES", Severity.WARNING)]


@pytest.mark.parametrize(
    ("count", "method", "told"), [(5, "kernel_class", 0), (6, "kernel_class", 1), (9, "profile", 0)]
)
def test_many_capabilities_of_one_device_are_a_warning_only(count: int, method: str, told: int) -> None:
    value = good("identify")
    device = value["devices"][1]
    first = device["capabilities"][0]
    more = [dict(first, name=f"{first['name']}_{'abcdefghi'[index]}") for index in range(count)]
    device |= {"capabilities": more, "method": method}
    found = [item for item in check("identify", value, artifacts(), SCHEMAS) if "MANY" in item.code]
    wanted = ("IDENTIFY-MANY-CAPABILITIES", Severity.WARNING, "/devices/1/capabilities")
    assert [(item.code, item.severity, item.pointer) for item in found] == [wanted] * told


COUNT = {"type": "integer", "minimum": 1, "maximum": 10, "default": 2}
SERIES = {
    "at most a minute": ({"type": "number", "minimum": 0, "maximum": 6, "default": 1}, []),
    "longer together": ({"type": "number", "minimum": 0, "maximum": 7, "default": 1}, ["INTERFACE-WAIT-TOO-LONG"]),
    "a pause that is a word": ({"type": "string", "enum": ["short", "long"]}, []),
    "a pause of a choice of numbers": ({"type": "number", "enum": [1, 5]}, []),
    "a pause without an end": ({"type": "number", "minimum": 0, "default": 1}, ["INTERFACE-WAIT-TOO-LONG"]),
    "a pause below a bound": ({"type": "number", "minimum": 0, "exclusiveMaximum": 7}, ["INTERFACE-WAIT-TOO-LONG"]),
}


@pytest.mark.parametrize(("pause", "codes"), SERIES.values(), ids=SERIES)
def test_the_length_of_a_series_is_its_count_times_its_pause(pause: dict[str, Any], codes: list[str]) -> None:
    value = good("interface")
    value["tools"][1]["input_schema"]["properties"] |= {"count": COUNT, "interval_s": pause}
    found = check("interface", value, artifacts(), SCHEMAS)
    assert [item.code for item in found if item.severity is Severity.ERROR] == codes


def _takes(name: str, **schema: Any) -> Change:
    return lambda value: value["tools"][1]["input_schema"]["properties"].update({name: schema})


CURED: dict[str, tuple[str, Change, str]] = {
    "two units": ("interface", _takes("hold_ms", type="integer", description="seconds"), "give one unit"),
    "a switch the wrong way round": (
        "interface",
        _takes("light_off", type="boolean", description="true switches it on"),
        "is true where it is off",
    ),
    "a package beside the one that is used": (
        "deploy",
        _add("requirements", {"name": "fast-mcpp", "version": "4.1.0", "why": "it serves"}),
        "only 'fastmcp' is used",
    ),
}


@for_each("case", CURED)
def test_the_cure_is_that_of_what_was_found(case: str) -> None:
    stage, change, words = CURED[case]
    value = good(stage)
    change(value)
    assert words in "\n".join(str(item.hint) for item in check(stage, value, artifacts(), SCHEMAS))


def test_more_tools_than_the_budget_are_refused() -> None:
    found = check("interface", good("interface"), artifacts(tools_budget=3), SCHEMAS)
    assert [item.code for item in found] == ["INTERFACE-TOOL-BUDGET"]


def test_the_tool_budget_may_cut_a_capability_of_a_served_device() -> None:
    value = good("interface")
    del value["tools"][1]
    value["left_out"].append({"id": "hwmon-fanboard", "reason": "tool_budget", "detail": "read_fan_speed"})
    assert check("interface", value, artifacts(tools_budget=3), SCHEMAS) == []


def test_a_tool_of_two_devices_names_the_device() -> None:
    identify, value = good("identify"), good("interface")
    identify["devices"][0]["capabilities"].append(dict(identify["devices"][1]["capabilities"][0]))
    value["tools"][1]["devices"].append("usb-1234-0001")
    found = check("interface", value, artifacts(identify=identify), SCHEMAS)
    assert [item.code for item in found] == ["INTERFACE-DEVICE-PARAMETER"]
    value["tools"][1]["input_schema"]["properties"]["device"] = {
        "type": "string",
        "enum": ["usb-1234-0001", "hwmon-fanboard"],
        "default": "hwmon-fanboard",
    }
    assert check("interface", value, artifacts(identify=identify), SCHEMAS) == []


def _doubling(count: int) -> dict[str, Any]:
    twice = [{"$ref": f"#/$defs/d{index + 1}"} for index in range(count)]
    tables: dict[str, Any] = {f"d{index}": {"allOf": [item, item]} for index, item in enumerate(twice)}
    return {"type": "object", "$ref": "#/$defs/d0", "$defs": {**tables, f"d{count}": {}}}


@pytest.mark.parametrize("schema", [{"type": "object", "$ref": "#"}, _doubling(60)], ids=["endless", "doubling"])
def test_a_schema_that_would_never_end_is_refused(schema: dict[str, Any]) -> None:
    value = good("interface")
    value["tools"][1]["input_schema"] = schema
    found = check("interface", value, artifacts(), SCHEMAS)
    assert [item.code for item in found] == ["INTERFACE-INPUT-SCHEMA"]


def test_a_pattern_of_an_agent_is_not_run_here() -> None:
    value = good("interface")
    schema = {"type": "object", "properties": {"x": {"type": "string", "pattern": "^(a+)+$"}}}
    value["tools"][1].update(input_schema=schema, smoke={"arguments": {"x": "a" * 60 + "!"}})
    assert check("interface", value, artifacts(), SCHEMAS) == []


def test_a_failed_dependency_is_owned_up_to_where_its_import_is_lazy() -> None:
    value = good("deploy")
    value["requirements"].pop(1)
    value["deps_failed"] = [{"name": "opencv-python-headless", "reason": "no wheel for this machine"}]
    assert check("deploy", value, artifacts(), SCHEMAS) == []
    eager = good("serve").replace("import subprocess\n", "import subprocess\n\nimport cv2\n")
    found = check("deploy", value, artifacts(serve=eager), SCHEMAS)
    assert [item.code for item in found] == ["DEPLOY-IMPORT-UNRESOLVED"]


@pytest.mark.parametrize(
    "detail",
    [
        "the package is not installed",
        "read with a program that is already installed",
        "nothing was installed for this",
        "no module was loaded, modprobe was not run",
        "the list of installed drivers",
        "neighbours of the system's own table; no port scan was made",
        "scan codes of the keyboard",
        "the network's cards",
        "pip, npm and apt are here",
    ],
)
def test_what_a_scan_tells_of_the_system_is_no_deed(detail: str) -> None:
    assert _codes("probe", _put("scan_methods.0.detail", detail)) == set()


def test_an_empty_host_is_accepted_all_the_way() -> None:
    probe = {**good("probe"), "devices": []}
    identify = {"format": 1, "devices": [], "left_out": []}
    interface = {"format": 1, "tools": [], "left_out": []}
    known = artifacts(probe=probe, identify=identify, interface=interface)
    assert check("probe", probe, known, SCHEMAS) == []
    assert check("identify", identify, known, SCHEMAS) == []
    assert check("interface", interface, known, SCHEMAS) == []


def test_a_schema_breach_names_field_pointer_and_a_guess() -> None:
    value = good("identify")
    value["devices"][2]["categroy"] = value["devices"][2].pop("category")
    found = check("identify", value, artifacts(), SCHEMAS, path="state/bench/identify/output.json")
    assert {item.pointer for item in found} == {"/devices/2", "/devices/2/categroy"}
    assert any(item.hint == "did you mean category?" for item in found)
    assert all("devices[2]" in item.summary and item.path == "state/bench/identify/output.json" for item in found)


def test_hostile_text_is_escaped_and_bounded_in_messages() -> None:
    value = good("identify")
    value["devices"][0] |= {"identified_as": "x" * 20}
    value["devices"][0]["evidence"][0]["quote"] = "\x1b[31m\u202e" + "x" * 400
    found, hidden = check("identify", value, artifacts(), SCHEMAS)
    assert hidden.code == "IDENTIFY-UNESCAPED-TEXT"
    assert "\x1b" not in found.summary and "\u202e" not in found.summary and len(found.summary) < 250


def test_diagnostics_are_bounded() -> None:
    value = good("identify")
    value["left_out"] += [{"id": f"ghost-{index}", "reason": "virtual"} for index in range(500)]
    found = check("identify", value, artifacts(), SCHEMAS)
    assert len(found) == MAX_PER_RULE
    assert found[-1].detail == "and 490 more like this"
    value["devices"] = [{} for _ in range(500)]
    assert len(check("identify", value, artifacts(), SCHEMAS)) <= 20


def test_a_missing_predecessor_is_a_bug_of_the_caller() -> None:
    with pytest.raises(ValueError, match="without the probe artifact"):
        check("identify", good("identify"), artifacts(probe=None), SCHEMAS)


def test_every_rule_has_a_code_of_its_stage_and_a_case_here() -> None:
    cases = {code for table in (PROBE_CASES, IDENTIFY_CASES, INTERFACE_CASES, DEPLOY_CASES) for code, _ in table}
    identifying = (answer_rules, annotation_rules, channel_rules, fact_rules, name_rules, prose_rules)
    elsewhere = (probe_host_rules, probe_rules, *identifying)
    own_tests = {rule.code for rules in elsewhere for rule in rules.RULES}
    own_tests |= {rule.code for rule in probe_rules.TEXT_RULES}
    own_tests |= {
        "IDENTIFY-ACTUATE-WITHOUT-PROFILE",
        "IDENTIFY-PROFILE-NOT-CHOSEN",
        "IDENTIFY-READ-MOVES",
        "IDENTIFY-READ-UNFOUNDED",
        "INTERFACE-RANGE-UNFOUNDED",
        "INTERFACE-READ-LIMITED",
        "INTERFACE-READ-MOVES",
        "INTERFACE-REASON-FALSE",
        "INTERFACE-ENDLESS",
        "INTERFACE-LIMIT-UNIT",
        *("INTERFACE-CHOICE-UNKNOWN", "INTERFACE-CHANNEL-UNIT", "INTERFACE-NAME-PRODUCT"),
        "IDENTIFY-NEIGHBOUR-PROMOTED",
        "IDENTIFY-MANY-CAPABILITIES",
        "IDENTIFY-MANY-DEVICES",
        "IDENTIFY-SHARED-HUB",
        "INTERFACE-GRAMMAR-DIFFERS",
        "INTERFACE-TOOL-BUDGET",
        "INTERFACE-UNITS-MISSING",
        "INTERFACE-UNITS-WRONG",
        # in test_outputs_held
        "INTERFACE-DESCRIPTION",
        "INTERFACE-RESULT-BARE",
        *("INTERFACE-PARAMETER-FOREIGN", "INTERFACE-RESULT-SERIAL", "INTERFACE-REASON-DIFFERS"),
        # in integration/test_returns
        "INTERFACE-IDENTIFY-WRONG",
        # in test_fresh_outputs
        "INTERFACE-RESULT-UNIT",
        "INTERFACE-RANGE-EMPTY",
        "INTERFACE-RESULT-NARROW",
        "DEPLOY-FAILED-UNKNOWN",
        "DEPLOY-PROGRAMS-DIFFER",
        "DEPLOY-PYTHON-OUTSIDE",
        "DEPLOY-VERSION-EARLY",
        "DEPLOY-VERSION-LOCAL",
    }
    for stage, rules in RULES.items():
        codes = [rule.code for rule in rules]
        assert len(set(codes)) == len(codes)
        assert all(code.startswith(f"{stage.upper()}-") for code in codes)
        if stage not in ("serve", "step", "watch", "heal"):
            assert set(codes) <= cases | own_tests


def test_the_numbers_of_a_kind_in_a_serials_place_are_no_serial() -> None:
    """The device database of a system writes them there for a device that has no serial number."""
    value = good("probe")
    value["devices"][0]["id"] = "usb-0424-9514"
    for serial, codes in (("0424_9514", set()), ("04249514", {"PROBE-SERIAL-IN-ID"})):
        value["devices"][0]["instance"]["udev.ID_SERIAL"] = serial
        assert {item.code for item in check("probe", value, artifacts(), SCHEMAS)} == codes


def test_a_serial_number_of_three_signs_is_one_and_of_two_is_none() -> None:
    value = good("probe")
    for serial, codes in (("1a2a1a2a", {"PROBE-SERIAL-IN-ID"}), ("1a1a1a1a", set())):
        value["devices"][0]["id"] = f"usb-0424-{serial}"
        value["devices"][0]["instance"]["udev.ID_SERIAL"] = serial
        assert {item.code for item in check("probe", value, artifacts(), SCHEMAS)} == codes


@pytest.mark.parametrize(
    ("quote", "whole"),
    [
        ("Otter A", False),
        ("Otter", True),
        ("tter", False),
        ("r A", False),
        ("Otter AB-", True),
        ("AB-7", True),
        ("-7", True),
        ("Ma\u00df1", False),
        ("1\u00df", True),
        ("\u00df12", True),
    ],
)
def test_a_quote_ends_where_a_word_of_latin_letters_does(quote: str, whole: bool) -> None:
    device: Any = {"id": "a", "name": "", "raw_descriptor": "product: Otter AB-7 Ma\u00df12 1\u00dfX"}
    assert is_whole_quote(quote, device, Artifacts()) is whole
