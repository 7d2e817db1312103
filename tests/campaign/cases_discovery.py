"""Hardware of other kinds: what appears is onboarded in place, what goes for good is let go, what stays stays."""

import json
from functools import partial
from typing import Any

from campaign.bench import Bench
from campaign.connected import Connected
from campaign.model import Case
from campaign.rig import SENSOR

from octoform.daemon.model import Kind, Repair

CHANGED = frozenset({Kind.HARDWARE_CHANGED})
DONE = frozenset({Repair.REDISCOVER, Repair.WAIT, Repair.RESTART, Repair.REBIND})
MAY = ("state/", ".octoform/")


def _thermometer(bench: Bench, port: str, product: str, number: int) -> None:
    """A thermometer of another make."""
    bench.host._usb(port, product, "Other Thermometer")
    path = f"hwmon/hwmon{number}"
    bench.host._part(port, path, "hwmon", {"name": "othertemp", "temp1_input": "31000"})


def _declared(bench: Bench) -> dict[str, dict[str, Any]]:
    """The accepted tools by name."""
    return {tool["name"]: tool for tool in json.loads(bench.layout.output("interface").read_bytes())["tools"]}


def _connect(bench: Bench, *gone: str) -> None:
    """A client connects, and its session is open until the case is over.

    What it sees now is what it may count on, but for the devices that will be ``gone``.
    """
    session = Connected(bench.layout.endpoint)
    bench.undo.append(session.close)
    declared, schemas = _declared(bench), session.tools()
    trials = {
        (name, device): session.works(name, _arguments(schemas[name], device))
        for name, tool in declared.items()
        if tool["effect"] == "read"
        for device in set(tool["devices"]) - set(gone)
    }
    lasting = {name: tool for name, tool in declared.items() if not set(tool["devices"]) <= set(gone)}
    assert any(trials.values()), "no tool works before the fault"
    bench.session = (session, lasting, schemas, trials)


def _arguments(schema: dict[str, Any], device: str) -> dict[str, str]:
    """The device argument for a tool of several devices."""
    return {"device": device} if "device" in schema.get("properties", {}) else {}


def appears(bench: Bench) -> None:
    _connect(bench)
    _thermometer(bench, "1-6", "00a7", 6)


def _replaced(bench: Bench) -> None:
    """The sensor is taken away and one of another make is plugged into its port."""
    _connect(bench, SENSOR)
    bench.host.unplug("1-4")
    _thermometer(bench, "1-4", "00a8", 2)


def kept(bench: Bench) -> list[str]:
    """What the client that was connected all the time has lost."""
    session, lasting, schemas, trials = bench.session
    now, found = _declared(bench), []
    try:
        result = session.tools()
    except Exception as problem:  # noqa: BLE001 - whatever its session ends with, it was dropped
        return [f"the connected client was dropped: {type(problem).__name__}: {problem}"]
    for name, tool in lasting.items():
        if name not in result:
            found.append(f"the tool {name} is gone although its device is there")
        elif now.get(name) == tool and result[name] != schemas[name]:
            found.append(f"the tool {name} has another schema although nothing of it changed")
    for (name, device), worked in trials.items():
        if worked and not session.works(name, _arguments(result.get(name, {}), device)):
            found.append(f"{name} of {device} worked before and does not now")
    return found


def served(device: str, bench: Bench) -> bool:
    """The endpoint has a tool for the new one, and answers."""
    try:
        published = (bench.layout.endpoint / "connection.json").read_text()
    except OSError:
        return False
    return device in published and bench.serves()


_onboarded = partial(
    Case,
    kinds=CHANGED,
    repairs=DONE,
    repair=10.0,
    may_change=MAY,
    after=kept,
    # The embedded agent's runs, one for each stage: no model is asked.
    calls=5,
    bench="builtin",
)
CASES = (
    _onboarded("a new kind of device", appears, right=partial(served, "usb-1f00-00a7")),
    _onboarded("replaced by another model", _replaced, right=partial(served, "usb-1f00-00a8")),
)
