"""The stage: capabilities to tools, within the budget, and every other device with the reason why it has none.

The budget is the task's number of tools, and the length that the protocol allows a server: what SERVE could not write
must not be promised here. Heavy: renders the server to see how long it gets (jinja2).
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import Any

from octoform.builtin import protocol_tools
from octoform.builtin.classes import inputs, media, network, office, outputs, position, power, sensors, storage
from octoform.builtin.classes.macos import NO_TOOLS
from octoform.builtin.description.class_model import Kind, Schema, one_of
from octoform.builtin.serve.stage import MAX_LINES, line_count
from octoform.builtin.task import Profiles, Task, TaskRefused
from octoform.patterns import regex

# The description of a tool's ``device`` parameter: which id is which product, as far as that is short and safe.
#
# Product names come from the devices themselves and end up before a language model, so only letters, digits and a few
# marks of a bounded length pass, inside quotation marks, and nothing that could look like an instruction to a reader.

MAX_CHARS = 60
NAME_CHARS = 48
_UNSAFE = regex(r"[^A-Za-z0-9 .,()/+#_-]+")


def legend(devices: Sequence[Mapping[str, Any]]) -> str:
    """``device id ("Product A", "Product B")``, in the order of the ids; without names where they would be too long."""
    names = ", ".join(f'"{_safe(device["identified_as"])}"' for device in devices)
    long = len(names) + sum(len(device["id"]) for device in devices) > MAX_CHARS
    return "device id" if long else f"device id ({names})"


def _safe(name: str) -> str:
    text = " ".join(_UNSAFE.sub(" ", name).split())
    return text if len(text) <= NAME_CHARS else text[: NAME_CHARS - 3].rstrip() + "..."


# Why a device has no tool: what is true of its class, and what is missing, in words for the person who looks for it.
#
# The first half are devices that the kernel could show as one of its classes and did not (no driver is bound, or the
# host's record does not show it); the second half are classes that no interface of the system serves.

_NONE, _CARRIES, _NOTHING, _PART = "no_standard_interface", "bus_infrastructure", "no_function", "out_of_scope"
_NO_INPUT = "the kernel has made no input device of it: no driver is bound to it"
_NO_BUTTONS = "no driver of the kernel or service of the system speaks its own protocol"
_LINK = "carries the host's own network; nothing that an agent should switch"
_CABLE = "a program of its own speaks over its serial line; a profile with its commands would give it tools"
_OTHER = "the kernel offers no class interface for what it does"

_REASONS: Mapping[str, tuple[str, str]] = {
    "accelerometer": (_NONE, "its driver reports only a fall, and offers no channel to read"),
    "audio": (_NONE, "the kernel has made no sound device with a PCM stream of it"),
    "audio_in": (_NONE, "the kernel has made no sound device with a capture stream of it"),
    "audio_out": (_NONE, "the kernel has made no sound device with a playback stream of it"),
    "camera": (_NONE, "the kernel has made no video capture device of it"),
    "camera_sensor": (
        _NONE,
        "gives raw pictures to the machine's camera pipeline, which a program must set up (libcamera)",
    ),
    "dac": (_NONE, "the kernel shows no output channel of it with a scale"),
    "gamepad": (_NONE, _NO_INPUT),
    "gnss": (_NONE, "it shows neither the kernel's gnss device nor a serial port of the USB class (CDC-ACM)"),
    "hwmon": (_NONE, "the kernel shows no channel of it with a reading"),
    "iio": (_NONE, "the kernel shows no channel of it with a reading"),
    "input": (_NONE, f"the kernel has made no input device of it; {_NO_BUTTONS}"),
    "keyboard": (_NONE, _NO_INPUT),
    "light": (_NONE, f"the kernel has made no LED of it; {_NO_BUTTONS}"),
    "mouse": (_NONE, _NO_INPUT),
    "printer": (_NONE, "there is no printer node of the kernel (usblp); printing is the work of a print service"),
    "tablet": (_NONE, _NO_INPUT),
    "touchpad": (_NONE, _NO_INPUT),
    "touchscreen": (_NONE, _NO_INPUT),
    "billboard": (_NOTHING, "only reports that a display mode could not be entered"),
    "bluetooth": (_CARRIES, "the radio by itself does nothing; what is paired with it is listed apart"),
    "bridge": (
        _CARRIES,
        "its addresses are never probed: even a read can disturb a chip, and nothing shows what is there",
    ),
    "can": (_NONE, "what its messages mean is not known; nothing is sent on a bus of unknown participants"),
    "codec": (_NONE, "works on memory for other programs, and the kernel shows no node of it"),
    "fingerprint": (
        _NONE,
        "the kernel has no class for it (a service such as fprintd has), and a fingerprint is private",
    ),
    "gpu": (_PART, "draws for the desktop; the kernel shows no connector of it"),
    "hub": (_CARRIES, "carries other USB devices"),
    "instrument": (_NONE, "its commands are not known; a profile with its commands would give it tools"),
    "ir": (_NONE, _NO_BUTTONS),
    "logic": (_NONE, "a program of its own drives it; the kernel has no class for logic analysers"),
    "mcu": (_NOTHING, "waits for firmware and does nothing else"),
    "modem": (_CARRIES, _LINK),
    "network": (_CARRIES, _LINK),
    "optical": (_PART, "holds a medium for the file system; no tool opens its tray or reads discs"),
    "phone": (_NONE, "its files and debug interface need a program of its own and the consent of its owner"),
    "pwm": (_NONE, "its outputs drive parts of the board (a fan, a backlight), and nothing shows which one is free"),
    "nfc": (_NONE, "a service of the system (neard, pcscd) speaks with it; the kernel gives a tool no tags to read"),
    "cec": (_NONE, "its messages switch other people's screens; nothing is sent on a bus of unknown participants"),
    "pps": (_NONE, "gives the moment of a second to the system's clock, and no value"),
    "tv_receiver": (_NONE, "its transport streams need a program that knows the local transmitters"),
    "buzzer": (_NONE, "the kernel plays its tones for the console"),
    "isp": (_NONE, "gives pictures only to a program that has linked the parts of the camera (libcamera)"),
    "vendor": (_NONE, "a program of its own speaks with it; a profile with its commands would give it tools"),
    "video_data": (_NOTHING, "carries numbers about pictures, which the camera has an entry of its own for"),
    "scanner": (_NONE, "scanners are driven by a service of the system (SANE); the kernel has no class for them"),
    "scope": (_NONE, "a program of its own drives it; the kernel has no class for oscilloscopes"),
    "sdr": (_NONE, "its channels are sample streams, which need a radio program"),
    "security": (
        _NONE,
        "needs the smart card service (pcscd) or a library of its own; keys are not handed to an agent",
    ),
    "serial": (_NONE, _CABLE),
    "still_camera": (_NONE, "its pictures are files behind a picture transfer program; the kernel has no class for it"),
    "storage": (_CARRIES, "there is no medium in it that the kernel shows as a disk"),
    "storage_controller": (_CARRIES, "carries drives, which are listed apart"),
    "tpm": (_NONE, "a key store is not handed to an agent"),
    "ups": (_NONE, "the kernel has made no power supply of it; a service (NUT, upower) speaks with it"),
    "wifi": (_CARRIES, _LINK),
    "zigbee": (_NONE, _CABLE),
}

_WORDLESS = "the profile {} has no protocol definition to make tools from"
_MEANT = "its meaning is known now; no standard interface drives it: a profile with a protocol definition would ({})"
_REPORTED = "macos-"
"""How the ids begin of what only the reports of another system list; the reasons above are those of a Linux kernel."""


def why_left_out(device: Mapping[str, Any]) -> tuple[str, str]:
    """(reason, detail) for a device of IDENTIFY that no tool serves."""
    if device["category"] == "unknown":
        return "unknown_meaning", str(device.get("missing") or "")
    if device["id"].startswith(_REPORTED) or any(item.get("says") == NO_TOOLS for item in device.get("evidence", ())):
        return _CARRIES if device["category"] == "infrastructure" else _NONE, NO_TOOLS
    if device["capabilities"]:
        names = ", ".join(capability["name"] for capability in device["capabilities"])
        return _NONE, f"nothing here can write a tool for {names}"
    if "profile" in device and device["category"] != "infrastructure":
        return _NONE, _WORDLESS.format(device["profile"])
    if device.get("method") == "user_answer" and device["category"] != "infrastructure":
        return _NONE, _MEANT.format(f"octoform profile new {device['id']}")
    ordinary = (_CARRIES, "") if device["category"] == "infrastructure" else (_NONE, _OTHER)
    return _REASONS.get(str(device.get("class") or ""), ordinary)


# Every tool that the embedded agent can write, one module per class of device; their order is that of the server.

KINDS: dict[str, Kind] = {
    kind.name: kind
    for kinds in (
        *(media.KINDS, sensors.KINDS, position.KINDS, power.KINDS, outputs.KINDS, outputs.OUTPUT_KINDS),
        *(inputs.KINDS, office.KINDS, storage.KINDS, network.KINDS, sensors.CLOCK_KINDS),
    )
    for kind in kinds
}  # fmt: skip


Device = Mapping[str, Any]
Owners = dict[str, list[tuple[Device, Mapping[str, Any]]]]
"""Capability name to (device, capability) of each device that has it, in the artifact's order."""


def run(task: Task) -> str:
    """Write the INTERFACE artifact of the task's IDENTIFY artifact; the summary: ``7 tools, 31 devices skipped``."""
    artifact = declare(task.read_input(), task.tools_budget, task.profiles)
    task.write(artifact)
    tools, left_out = len(artifact["tools"]), len(artifact["left_out"])
    return f"{tools} tool{'s' * (tools != 1)}, {left_out} device{'s' * (left_out != 1)} skipped"


def declare(identify: Mapping[str, Any], budget: int, profiles: Profiles = ()) -> dict[str, Any]:
    """The artifact; TaskRefused when the input is no IDENTIFY artifact."""
    try:
        owners = _owners(identify["devices"])
        kinds = {**KINDS, **protocol_tools.kinds(profiles, KINDS)}
        wanted = [kinds[name] for name in kinds if name in owners]
        made = {kind.name: _tool(kind, owners[kind.name]) for kind in wanted}
        allowed = _within(budget, wanted)
        kept = _written(allowed, made, profiles)
        tools = [made[kind.name] for kind in kept]
        cut = [kind for kind in wanted if kind not in kept]
        reason = "tool_budget" if len(allowed) < len(wanted) and kept == allowed else "server_size"
        served = {name for tool in tools for name in tool["devices"]}
        left_out = _left_out(identify, served, _spared(cut, owners), reason)
    except (KeyError, TypeError, AttributeError) as problem:
        raise TaskRefused(f"the IDENTIFY artifact is not as expected: {type(problem).__name__}: {problem}") from problem
    return {"format": 1, "tools": tools, "left_out": left_out}


def _owners(devices: Sequence[Device]) -> Owners:
    owners: Owners = {}
    for device in devices:
        for capability in device["capabilities"]:
            owners.setdefault(capability["name"], []).append((device, capability))
    return owners


def _within(budget: int, wanted: Sequence[Kind]) -> list[Kind]:
    """The tools that fit: the least worth goes first, the later in the catalog among equals."""
    ranked = sorted(wanted, key=lambda kind: -kind.worth)[:budget]
    return [kind for kind in wanted if kind in ranked]


def _written(wanted: list[Kind], made: Mapping[str, dict[str, Any]], profiles: Profiles) -> list[Kind]:
    """Those of which a server of the allowed length can be written: as many of the most worth as fit."""

    def too_long(count: int) -> bool:
        return line_count([made[kind.name] for kind in _within(count, wanted)], profiles) > MAX_LINES

    if not wanted or not too_long(len(wanted)):
        return wanted
    return _within(bisect_left(range(1, len(wanted)), True, key=too_long), wanted)


def _tool(kind: Kind, owners: Sequence[tuple[Device, Mapping[str, Any]]]) -> dict[str, Any]:
    devices = [device["id"] for device, _ in owners]
    properties = {
        "device": _device(devices, legend([device for device, _ in owners])),
        **kind.parameters([capability.get("parameters", {}) for _, capability in owners]),
    }
    for part in ("led", "channel"):
        if kind.effect == "actuate" and _only_one(properties.get(part)):
            properties[part]["default"] = properties[part]["const"]
    required = [name for name, schema in properties.items() if "default" not in schema]
    tool: dict[str, Any] = {
        "name": kind.name,
        "capability": kind.name,
        "devices": devices,
        "description": kind.description,
        "effect": kind.effect,
        "annotations": _annotations(kind),
        "input_schema": {"type": "object", "properties": properties, "additionalProperties": False},
        "output_schema": _output(kind, [capability.get("parameters", {}) for _, capability in owners]),
    }
    if kind.stops:
        tool["stops"] = True
    if kind.acts_on:
        tool["units"] = dict(kind.acts_on)
    if required:
        tool["input_schema"]["required"] = required
    if limits := [
        _limit(name, schema, kind.units.get(name)) for name, schema in properties.items() if "minimum" in schema
    ]:
        tool["limits"] = limits
    if kind.effect == "read":
        chosen = {} if len(devices) == 1 else {"device": devices[0]}
        tool["smoke"] = {"arguments": {**chosen, **kind.smoke}}
    return tool


def _output(kind: Kind, facts: Sequence[Mapping[str, Any]]) -> Schema:
    """The result's schema, with a note for SERVE of the kernel interfaces that the channels come from."""
    found = {channel.get("source") for fact in facts for channel in fact.get("channels", ())} - {None, ""}
    return {**kind.output, "$comment": "sources: " + ", ".join(sorted(found))} if found else kind.output


def _device(devices: list[str], description: str) -> Schema:
    schema = one_of(description, devices)
    return {**schema, "default": devices[0]} if len(devices) == 1 else schema


def _only_one(schema: Schema | None) -> bool:
    return schema is not None and "const" in schema


def _annotations(kind: Kind) -> dict[str, bool]:
    return {
        "readOnlyHint": kind.effect == "read",
        "destructiveHint": kind.effect == "irreversible",
        "idempotentHint": kind.idempotent,
        "openWorldHint": False,
    }


def _limit(name: str, schema: Schema, unit: str | None) -> dict[str, Any]:
    limit = {"parameter": name, "minimum": schema["minimum"], "maximum": schema["maximum"]}
    return {**limit, "unit": unit} if unit else limit


def _spared(cut: list[Kind], owners: Owners) -> dict[str, list[str]]:
    """Device id to the capabilities that the budget cut, for all devices that lost one."""
    lost: dict[str, list[str]] = {}
    for kind in cut:
        for device, _ in owners[kind.name]:
            lost.setdefault(device["id"], []).append(kind.name)
    return lost


def _left_out(
    identify: Mapping[str, Any], served: set[str], spared: Mapping[str, list[str]], why: str
) -> list[dict[str, Any]]:
    out = [dict(item) for item in identify["left_out"]]
    for device in identify["devices"]:
        name = device["id"]
        if name in spared:
            reason, detail = why, f"without a tool for {', '.join(sorted(spared[name]))}"
        elif name in served:
            continue
        else:
            reason, detail = why_left_out(device)
        out.append({"id": name, "reason": reason, **({"detail": detail[:300]} if detail else {})})
    return out
