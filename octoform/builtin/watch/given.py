"""The input of WATCH as the embedded agent asks it: what is newest, what failed and is not over, what is attached."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from octoform.builtin.task import Refused

Row = Mapping[str, Any]
Place = tuple[str, str, str]
_PARTS = ("readings", "failures", "claims", "tools", "frames", "devices")


@dataclass(frozen=True, slots=True)
class Given:
    """The rows of an input, oldest first; ``newest`` is the last reading of each signal."""

    readings: tuple[Row, ...]
    failures: tuple[Row, ...]
    claims: tuple[Row, ...]
    tools: tuple[Row, ...]
    frames: tuple[Row, ...]
    devices: tuple[Row, ...]
    newest: Mapping[Place, Row]

    @classmethod
    def of(cls, document: Row) -> "Given":
        """Refused when a part is no list of rows."""
        parts = {name: _rows(document, name) for name in _PARTS}
        newest = {(row["channel"], row["source"], row["path"]): row for row in parts["readings"]}
        return cls(**parts, newest=newest)

    def known(self, device: str) -> str | None:
        """The device, where it is one that has tools or was given."""
        served = any(device in item["devices"] for item in self.tools)
        return device if served or any(row["id"] == device for row in self.devices) else None

    def lasting(self) -> list[Row]:
        """The failures after which no success of the tool was read."""
        return [row for row in self.failures if not self._over(row)]

    def unreadable(self) -> list[Place]:
        """The signals that could not be read: null, with a reason. A null without one is what the tool answered.

        A call that failed as a whole is over once the same source was read after it.
        """
        found: dict[Place, None] = {}
        for row in self.readings:
            place = (row["channel"], row["source"], row["path"])
            found.pop(place, None)
            if row["value"] is None and row.get("why"):
                found[place] = None
            elif row["path"]:
                found.pop((row["channel"], row["source"], ""), None)
        return list(found)

    def attached(self, device: str | None) -> bool | None:
        """What the kernel shows of a device; None where it is not known."""
        row = self.newest.get(("kernel", device or "", "/there"))
        return row["value"] if row is not None and isinstance(row["value"], bool) else None

    def device_of(self, failure: Row) -> str | None:
        """The device that a failed call was for, where it can only have been one."""
        tool = next((item for item in self.tools if item["name"] == failure["tool"]), None)
        devices = list(tool["devices"]) if tool is not None else []
        named = [device for device in devices if device in str(failure.get("message"))]
        certain = devices if len(devices) == 1 else named
        return certain[0] if len(certain) == 1 else None

    def _over(self, failure: Row) -> bool:
        ok = self.newest.get(("log", failure["tool"], "/ok"))
        if ok is None or ok["value"] is not True:
            return False
        at, last = _moment(ok.get("at")), _moment(failure.get("last"))
        return at is not None and last is not None and at >= last


def _rows(document: Row, name: str) -> tuple[Row, ...]:
    value = document.get(name, [])
    if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
        raise Refused(f"the input's {name} are no list of objects")
    return tuple(value)


def _moment(stamp: object) -> datetime | None:
    try:
        found = datetime.fromisoformat(str(stamp))
    except ValueError:
        return None
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)
