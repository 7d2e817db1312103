"""IDENTIFY of a handheld computer with a touch screen, a security chip and a monitor that shows nothing: small lies."""

import copy
from collections.abc import Callable
from typing import Any

from cases import for_each
from unit.contracts.contract_samples import SCHEMAS

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.diagnostics import Severity

TOUCH, CHIP, ENTRY, MONITOR, CORES = "i2c-gxtp7380", "acpi-msft0101", "platform-msft0101", "hwmon", "platform-coretemp"
Output = dict[str, Any]
Change = Callable[[Output], None]


def probed(name: str, text: str, *classes: str, interface: str = "acpi", nodes: tuple[str, ...] = ()) -> Output:
    lines = dict(line.partition(": ")[::2] for line in text.splitlines())
    return {
        "id": name,
        "name": lines.get("description") or lines.get("name") or name,
        "interface": interface,
        "raw_descriptor": text,
        "classes": list(classes),
        "drivers": [lines["driver"]] if "driver" in lines else [],
        "instance": {"sysfs": f"/sys/devices/{interface}/{name}", "nodes": [{"name": each} for each in nodes]},
    }


PROBE = {
    "platform": {"os": "linux"},
    "devices": [
        probed(
            TOUCH,
            "name: GXTP7380:00\ndriver: i2c_hid_acpi\nhid[0].driver: hid-multitouch\ninput[0].kinds: touchscreen",
            *("hid", "hidraw", "input"),
            interface="i2c",
            nodes=("input18", "hidraw2"),
        ),
        probed(CHIP, "description: TPM 2.0 Device\ndriver: tpm_crb\ntpm[0].tpm_version_major: 2", "tpm", "tpmrm"),
        probed(ENTRY, "name: MSFT0101\nmodalias: acpi:MSFT0101:", interface="platform"),
        probed(MONITOR, "class: hwmon", "hwmon", interface="hwmon"),
        probed(CORES, "name: coretemp\ndriver: coretemp", "hwmon", interface="platform"),
    ],
}


def known(name: str, kind: str, category: str, quote: str, *abilities: Output, called: str) -> Output:
    return {
        "id": name,
        "identified_as": called,
        "category": category,
        "class": kind,
        "confidence": 0.8,
        "method": "kernel_class",
        "evidence": [{"quote": quote, "says": "what the kernel made of it"}],
        "capabilities": list(abilities),
    }


def reads(name: str, about: str, via: str, **parameters: Any) -> Output:
    return {"name": name, "description": about, "via": via, "effect": "read", "parameters": parameters}


EVENTS = reads("read_input_events", "Report touches and strokes that arrive.", "evdev of the kernel")
VERSION = reads("read_security_chip_version", "Read which version of the standard it keeps to.", "sysfs of the kernel")
HEAT = reads("read_temperatures", "Read every temperature.", "the hwmon class of the kernel")
GOOD: Output = {
    "format": 1,
    "devices": [
        known(TOUCH, "touchscreen", "sensor", "input[0].kinds: touchscreen", EVENTS, called="touchscreen"),
        known(CHIP, "security_chip", "infrastructure", "description: TPM 2.0 Device", VERSION, called="TPM 2.0 chip"),
        known(CORES, "temperature", "sensor", "driver: coretemp", HEAT, called="coretemp sensor"),
        known(MONITOR, "hwmon", "sensor", "class: hwmon", called="hardware monitor"),
    ],
    "left_out": [{"id": ENTRY, "reason": "duplicate_path"}],
}


def also(at: int, *ability: Any, **parameters: Any) -> Change:
    return lambda value: value["devices"][at]["capabilities"].append(reads(*ability, **parameters))


def states(**parameters: Any) -> Change:
    return lambda value: value["devices"][0]["capabilities"][0]["parameters"].update(parameters)


def follows(text: str) -> Change:
    return lambda value: value["devices"][0]["evidence"][0].update(says=text)


def skipped(name: str, reason: str) -> Change:
    def change(value: Output) -> None:
        for member in ("devices", "left_out"):
            value[member] = [each for each in value[member] if each["id"] != name]
        value["left_out"].append({"id": name, "reason": reason})

    return change


def described(text: str) -> Change:
    return lambda value: value["devices"][0]["capabilities"][0].update(description=text)


TOUCHES = ("read_touches", "Report touches.", "evdev of the kernel")
WRONG: dict[str, tuple[Change, str]] = {
    "one act under two names": (also(0, *TOUCHES), "IDENTIFY-DUPLICATE-CAPABILITY"),
    "one reading under two verbs": (
        also(1, "get_security_chip_version", "Get its version.", "sysfs"),
        "IDENTIFY-DUPLICATE-CAPABILITY",
    ),
    "one reading as a list": (
        also(2, "list_temperatures", "List every temperature.", "hwmon"),
        "IDENTIFY-DUPLICATE-CAPABILITY",
    ),
    "a range of an axis": (states(x_range="0 to 1199"), "IDENTIFY-FACT-FROM-MEMORY"),
    "a number of contacts": (states(contacts=10), "IDENTIFY-FACT-FROM-MEMORY"),
    "levels of a pen": (states(pressure_levels=4096), "IDENTIFY-FACT-FROM-MEMORY"),
    "a size from nowhere": (follows("a ten-point touchscreen of 8 inches with 1920x1200"), "IDENTIFY-FACT-FROM-MEMORY"),
    "fingers from nowhere": (follows("takes ten fingers"), "IDENTIFY-FACT-FROM-MEMORY"),
    "the kernel's name of an input": (described("Report touches from input18."), "IDENTIFY-PLACE-IN-TEXT"),
    "not permitted although it was read": (skipped(CHIP, "not_permitted"), "IDENTIFY-REASON-FALSE"),
    "virtual although the firmware lists it": (skipped(ENTRY, "virtual"), "IDENTIFY-REASON-FALSE"),
    "an actuator that only reads": (
        lambda value: value["devices"][0].update(category="actuator"),
        "IDENTIFY-CATEGORY-FALSE",
    ),
    "a temperature of what shows none": (
        lambda value: value["devices"][3]["capabilities"].append(HEAT),
        "IDENTIFY-CAPABILITY-WITHOUT-CLASS",
    ),
    "bytes that are sent": (also(1, "send_random_bytes", "Send bytes.", "tpm2-tools"), "IDENTIFY-PASSTHROUGH"),
    "bytes of a line": (also(1, "get_serial_bytes", "Take bytes.", "tpm2-tools"), "IDENTIFY-PASSTHROUGH"),
}
RIGHT: dict[str, Change] = {
    "as it is": lambda value: None,
    "random bytes": also(1, "get_random_bytes", "Take random numbers from the chip.", "tpm2-tools"),
    "entropy": also(1, "read_entropy", "Take random numbers from the chip.", "tpm2-tools"),
    "two readings of one input": also(0, "describe_input", "List the kinds of events.", "evdev of the kernel"),
    "a wait for one event": also(0, "wait_for_key_press", "Wait for a key.", "evdev of the kernel"),
    "a range that is asked": states(x_range="asked at every call", contacts="asked at every call"),
    "kinds of an input": states(kinds="touchscreen", inputs=1),
    "a version": follows("the second version: TPM 2.0"),
    "a size with its page": follows("1920x1200, by https://example.org/gxtp7380"),
    "a size by a database": follows("a panel of 8 inches by the database of the vendor"),
    "a class by its number": follows("HID usage page 0x0d, which is class 3 of USB"),
    "an input by its order": described("Report touches of the first input."),
    "an entry of the same chip": skipped(ENTRY, "no_function"),
}


def judged(change: Change) -> list[str]:
    value = copy.deepcopy(GOOD)
    change(value)
    found = check("identify", value, Artifacts(probe=PROBE), SCHEMAS)
    return [item.code for item in found if item.severity is Severity.ERROR]


@for_each("case", WRONG)
def test_a_small_lie_is_refused(case: str) -> None:
    change, code = WRONG[case]
    assert {*judged(change)} == {code}


@for_each("case", RIGHT)
def test_what_looks_alike_and_is_true_is_accepted(case: str) -> None:
    assert judged(RIGHT[case]) == []
