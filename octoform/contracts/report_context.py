"""The context for the rules of WATCH's and HEAL's reports: the very input that their agent was given, as a value.

A report may rest on nothing else. So the facts are made from the input's own document, and a reading that is not in it
does not exist for the report. (Light.)
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from octoform.base.clock import parse_stamp
from octoform.records import dataclass

SENSOR, LOG, FRAME, KERNEL, PROCESS = "sensor", "log", "frame", "kernel", "process"
_TOLD_OF_A_PARAMETER = ("type", "enum", "minimum", "maximum", "default")

Row = Mapping[str, Any]
Place = tuple[str, str, str]
"""A signal: channel, source and path."""


@dataclass(frozen=True, slots=True)
class DutyFacts:
    """The input of one duty, in its own words: ``readings`` and ``failures`` as rows with an ``id``, oldest first.

    ``claims`` are those in force. ``frames`` are the pictures that were given. ``error``, ``target``, ``tool`` and
    ``functions`` (the names that are that tool's alone) are of HEAL and empty for WATCH. ``text`` is all of the input.
    """

    readings: tuple[Row, ...] = ()
    failures: tuple[Row, ...] = ()
    claims: tuple[Row, ...] = ()
    frames: tuple[Row, ...] = ()
    devices: tuple[Row, ...] = ()
    error: Row | None = None
    target: str | None = None
    tool: str | None = None
    functions: tuple[str, ...] = ()
    text: str = ""

    @classmethod
    def of(cls, document: Row) -> "DutyFacts":
        """The facts of an ``input.json``; what it does not have is empty."""
        tool, device = document.get("tool"), document.get("device")
        devices = _rows(document, "devices") or ((device,) if isinstance(device, Mapping) else ())
        return cls(
            readings=_rows(document, "readings"),
            failures=_rows(document, "failures"),
            claims=_rows(document, "claims"),
            frames=_rows(document, "frames"),
            devices=devices,
            error=document.get("error"),
            target=document.get("target"),
            tool=tool.get("name") if isinstance(tool, Mapping) else tool,
            functions=tuple(document.get("functions") or ()),
            text=json.dumps(document, default=str, ensure_ascii=False),
        )

    def reading(self, identity: str) -> Row | None:
        """The reading of an id."""
        return next((row for row in self.readings if row["id"] == identity), None)

    def failure(self, identity: str) -> Row | None:
        """The failure of an id."""
        return next((row for row in self.failures if row["id"] == identity), None)

    def ids(self) -> list[str]:
        """Every id that a report may cite: what was given, and what the error rests on that is to be repaired.

        The tool may have failed again since WATCH saw it, and the failure that is given now is a newer one.
        """
        rests_on = (self.error or {}).get("cites", ())
        return [*(str(row["id"]) for row in (*self.readings, *self.failures)), *map(str, rests_on)]

    def newest(self) -> dict[Place, Row]:
        """The last reading of each signal."""
        return {place_of(row): row for row in self.readings}

    def newest_value(self, place: Place) -> Any:
        """The last value of a signal that could be read; None when there is none."""
        values = [row["value"] for row in self.readings if place_of(row) == place and row["value"] is not None]
        return values[-1] if values else None

    def unreadable(self) -> list[Place]:
        """The signals that could not be read: null, with a reason. A null without one is what the tool answered.

        A call that failed as a whole is over once the same source was read after it.
        """
        found: dict[Place, None] = {}
        for row in self.readings:
            place = place_of(row)
            found.pop(place, None)
            if row["value"] is None and row.get("why"):
                found[place] = None
            elif row["path"]:
                found.pop((row["channel"], row["source"], ""), None)
        return list(found)

    def lasting(self) -> list[Row]:
        """The failures that no later reading shows to be over: a success of the tool, or a value that it returned."""
        return [row for row in self.failures if not self._over(row)]

    def _over(self, failure: Row) -> bool:
        last = parse_stamp(failure.get("last"))
        own = [row for place, row in self.newest().items() if place[1] == failure["tool"]]
        if any(row["channel"] == LOG and row["path"] == "/ok" and row["value"] is False for row in own):
            return False
        for row in own:
            success = row["channel"] == LOG and row["path"] == "/ok" and row["value"] is True
            success = success or (row["channel"] == SENSOR and row["value"] is not None)
            at = parse_stamp(row.get("at"))
            if success and last is not None and at is not None and at >= last:
                return True
        return False


def place_of(row: Row) -> Place:
    """The signal of a reading, or of the ``signal`` member of a claim."""
    return str(row["channel"]), str(row["source"]), str(row["path"])


def tool_facts(interface: Row) -> list[dict[str, Any]]:
    """The tools of INTERFACE for a background task: name, effect, whether it stops, devices, parameters, limits.

    Descriptions are omitted: who diagnoses has to look at readings, and a prompt is bounded.
    """
    return [
        {
            "name": tool["name"],
            "effect": tool["effect"],
            "stops": bool(tool.get("stops", False)),
            "devices": list(tool["devices"]),
            "parameters": dict(_parameters(tool)),
            "limits": list(tool.get("limits") or ()),
        }
        for tool in interface["tools"]
    ]


def device_facts(interface: Row, identify: Row | None) -> list[dict[str, Any]]:
    """The devices that have tools, each with its name and the names of its tools, in the order of IDENTIFY."""
    served = {device: None for tool in interface["tools"] for device in tool["devices"]}
    named = {item["id"]: item.get("identified_as") for item in (identify or {"devices": []})["devices"]}
    return [
        {"id": device, "name": named.get(device), "tools": list(_tools_of(interface["tools"], device))}
        for device in [*(one for one in named if one in served), *(one for one in served if one not in named)]
    ]


def _tools_of(tools: Iterable[Row], device: str) -> Iterator[str]:
    for tool in tools:
        if device in tool["devices"]:
            yield tool["name"]


def _parameters(tool: Row) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, schema in (tool["input_schema"].get("properties") or {}).items():
        kept = schema.items() if isinstance(schema, dict) else ()
        yield name, {key: value for key, value in kept if key in _TOLD_OF_A_PARAMETER}


def _rows(document: Row, name: str) -> tuple[Row, ...]:
    value = document.get(name)
    return tuple(row for row in value if isinstance(row, Mapping)) if isinstance(value, list) else ()
