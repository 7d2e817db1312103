"""The memory of one servo: which field stands at which address, what survives a power cut, what can't be written.

All numbers come from the rig's description. Fields of two bytes have the low byte first; a ``sign_bit`` marks a
negative number and leaves the rest its size.
"""

from collections.abc import Mapping
from typing import Any


class Registers:
    """``memory`` is what a host reads; ``kept`` what is there again after the supply was off."""

    def __init__(self, given: Mapping[str, Any]) -> None:
        self.fields: Mapping[str, Mapping[str, Any]] = given["fields"]
        self._kept_below, self._read_only_from = int(given["kept_below"]), int(given["read_only_from"])
        self.memory = bytearray(int(given["size"]))
        for name, field in self.fields.items():
            self.put(name, field.get("initial", 0))
        self.kept = bytes(self.memory)

    def value(self, name: str) -> int:
        """A field's number with its sign; 0 for a field that this servo does not have."""
        field = self.fields.get(name)
        if field is None:
            return 0
        start, bit = int(field["address"]), field.get("sign_bit")
        raw = int.from_bytes(self.memory[start : start + int(field["bytes"])], "little")
        if bit is not None and raw >> bit & 1:
            raw = -(raw & ~(1 << bit))
        return raw

    def put(self, name: str, number: float) -> None:
        """Set a field, kept within what fits in; nothing for a field that this servo does not have."""
        field = self.fields.get(name)
        if field is None:
            return
        width, bit = int(field["bytes"]), field.get("sign_bit")
        most = (1 << (8 * width if bit is None else bit)) - 1
        raw = min(abs(round(number)), most) if bit is not None else min(max(round(number), 0), most)
        if bit is not None and number < 0:
            raw |= 1 << bit
        self.memory[field["address"] : field["address"] + width] = raw.to_bytes(width, "little")

    def scaled(self, name: str, number: float) -> None:
        """Set a field to a measured value, in the field's own unit."""
        self.put(name, number / self.fields.get(name, {}).get("scale", 1))

    def write(self, address: int, data: bytes, *, locked: bool) -> set[str]:
        """What a host writes: the names of the fields that it touched. What can only be read stays as it is."""
        touched = set()
        end = min(address + len(data), self._read_only_from)
        for place in range(address, end):
            self.memory[place] = data[place - address]
        if not locked:
            kept = bytearray(self.kept)
            kept[address : min(end, self._kept_below)] = self.memory[address : min(end, self._kept_below)]
            self.kept = bytes(kept)
        for name, field in self.fields.items():
            if field["address"] < end and address < field["address"] + field["bytes"]:
                touched.add(name)
        return touched

    def restart(self) -> None:
        """After a power cut: what was kept, and all else as it was delivered."""
        self.memory[: self._kept_below] = self.kept[: self._kept_below]
        for name, field in self.fields.items():
            if field["address"] >= self._kept_below:
                self.put(name, field.get("initial", 0))
