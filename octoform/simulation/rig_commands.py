"""Lines that change a running rig: plug, unplug, faults; and what the rig shows of itself. All as plain data."""

from collections.abc import Mapping
from typing import Any

from octoform.simulation import rail_firmware, scene, servo, servos
from octoform.simulation.rail_firmware import LineDevice
from octoform.simulation.rig import Rig
from octoform.simulation.servos import ServoBus

HELP = """\
unplug NAME                   take a device away
plug NAME [PORT [NODE]]       connect it, at another port or under another name when you like
fault NAME[.SERVO] FAULT      break it; the fault `none` makes it whole
show                          what the devices themselves know"""


_OPTIONAL: Mapping[str, object] = {"anonymous": False, "described": False, "unplugged": False, "speedup": 1}
"""Keys that a description may leave out, each with what it then means."""


class CommandRefused(ValueError):
    """A line that can't be done; the text states why."""


def changed(description: Mapping[str, Any], name: str, key: str, value: object) -> dict[str, Any]:
    """The description with another value of one key of one device. CommandRefused for one that is not there.

    The value has to be of the kind that it replaces: a number, true or false, a string. ``kind`` makes another device.
    """
    devices = description["devices"]
    if name not in devices:
        raise CommandRefused(f"there is no device {name}; there are {', '.join(devices)}")
    known = {**_OPTIONAL, **devices[name]}
    if key not in known or key == "kind":
        raise CommandRefused(f"{name} has no value {key} to set; it has {', '.join(sorted(set(known) - {'kind'}))}")
    if _sort(value) != _sort(known[key]):
        raise CommandRefused(f"{name}.{key} takes {_sort(known[key])}, and not {value}")
    return {**description, "devices": {**devices, name: {**devices[name], key: value}}}


def _sort(value: object) -> str:
    sorts = ((bool, "true or false"), (int | float, "a number"), (str, "a string"))
    return next((words for kind, words in sorts if isinstance(value, kind)), "a part of the rig's own file")


def obey(rig: Rig, text: str) -> dict[str, Any]:
    """Do what a line reports; what came of it, with the key ``event``. CommandRefused when it can't be done."""
    words = text.split() or ["show"]
    known = {"plug": (1, 3), "unplug": (1, 1), "fault": (2, 2), "show": (0, 0)}
    word, rest = words[0], words[1:]
    if word not in known:
        raise CommandRefused(f"unknown: {word}\n{HELP}")
    least, most = known[word]
    if not least <= len(rest) <= most:
        raise CommandRefused(f"{word} takes other words\n{HELP}")
    if word == "show":
        return {"event": "state", "devices": describe(rig)}
    name = rest[0].split(".")[0]
    if name not in rig.names:
        raise CommandRefused(f"there is no device {name}; there are {', '.join(rig.names)}")
    if word == "fault":
        return _broken(rig, rest[0], None if rest[1] == "none" else rest[1])
    if word == "unplug":
        rig.unplug(name)
        return {"event": "unplugged", "device": name}
    try:
        rig.plug(name, port=rest[1] if len(rest) > 1 else None, node=rest[2] if len(rest) > 2 else None)
    except ValueError as problem:
        raise CommandRefused(str(problem)) from problem
    return {"event": "plugged", "device": name}


def _broken(rig: Rig, target: str, fault: str | None) -> dict[str, Any]:
    name, _, number = target.partition(".")
    device = rig.devices.get(name)
    if isinstance(device, ServoBus) and number:
        if not number.isdecimal() or int(number) not in device.servos:
            raise CommandRefused(f"{name} has no servo {number}; it has {', '.join(map(str, device.servos))}")
        _known(fault, servo.FAULTS)
        device.servos[int(number)].fault = fault
    elif isinstance(device, ServoBus):
        _known(fault, (servos.DROPPED,))
        device.bus_fault = None
        if fault:
            device.drop()
    elif isinstance(device, LineDevice):
        _known(fault, rail_firmware.FAULTS)
        device.fault = fault
    elif rig.camera is not None:
        _known(fault, scene.FAULTS)
        rig.camera.fault = fault
    else:
        raise CommandRefused(f"{name} is not plugged")
    return {"event": "fault", "device": target, "fault": fault}


def _known(fault: str | None, faults: tuple[str, ...]) -> None:
    if fault is not None and fault not in faults:
        raise CommandRefused(f"no fault {fault} here; there are none, {', '.join(faults)}")


def describe(rig: Rig) -> list[dict[str, Any]]:
    """Each device: where it is plugged, and what it knows of itself that no reply of its would say."""
    found = []
    for name in rig.names:
        place = rig.places.get(name)
        row: dict[str, Any] = {
            "name": name,
            "kind": rig.description["devices"][name]["kind"],
            "plugged": place is not None,
        }
        if place is not None:
            row |= {"port": place[0], "node": place[1]}
        device = rig.devices.get(name)
        if isinstance(device, ServoBus):
            row |= _of_servos(device)
        elif isinstance(device, LineDevice):
            row |= {"position": device.position, "counted": device.counted, "lines": len(device.lines)}
            row |= {"longest": device.longest, "farthest": device.farthest, "fault": device.fault}
        elif rig.camera is not None:
            row |= {"written": rig.camera.written, "fault": rig.camera.fault}
        found.append(row)
    return found


def _of_servos(bus: ServoBus) -> dict[str, Any]:
    bus.advance()
    rows = [
        {
            "servo": number,
            "position": round(one.position),
            "goal": one.value("goal"),
            "torque": one.torque,
            "load": round(one.load, 1),
            "temperature": round(one.temperature, 1),
            "lowest": round(one.reached.lowest),
            "highest": round(one.reached.highest),
            "fault": one.fault,
        }
        for number, one in bus.servos.items()
    ]
    counts = {"received": bus.received, "corrupt": bus.corrupt, "overlapping": bus.overlapping, "noise": bus.noise}
    return {"servos": rows, **counts, "fault": bus.bus_fault}
