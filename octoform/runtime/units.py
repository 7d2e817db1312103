"""What can be done with the units of a device on a register bus, one method for each kind of tool.

A result is an object for one unit, or holds one for each unit in a list that is named after them (``joints``). A unit
that the owner disabled is ``skipped`` with the owner's reason and never written to; the others go on.
"""

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

from .faults import DeviceFault
from .movement import NEAR, Move, carried_out, energised, held, motion_of, planned
from .registers import Bank, UnitFault

Record = dict[str, Any]


class Units(Bank):
    """The units of one device: ``Units(map, device, opened)``, see `registers.Bank`."""

    def read(self, name: str, fields: Iterable[str]) -> Record:
        """The unit's fields, ``calibrated`` (percent of its range, None where unknown) and ``skipped``."""
        name = self.named(name)
        record = self._blank(name, dict.fromkeys(wanted := list(fields)))
        if record["skipped"] is None:
            record |= self.exchange(name, "", lambda talk: {field: talk.read(field) for field in wanted})
        motion, extent = self.map.motion, self.calibration().ranges.get(name)
        position = record.get(motion.present) if motion is not None else None
        percent = None if extent is None or position is None else extent.percent(position)
        return {"device": self.device, **record, "calibrated": percent}

    def read_all(self, fields: Iterable[str]) -> Record:
        """The same of every unit, a silent one skipped with that reason; ``calibration`` says why there is none."""
        found, silent, wanted = [], [], list(fields)
        for name in self.map.units:
            try:
                record = self.read(name, wanted)
            except UnitFault as problem:
                silent.append(name)
                told = {"skipped": self.told(problem), **dict.fromkeys(wanted), "calibrated": None}
                record = self._blank(name, told)
            found.append({key: value for key, value in record.items() if key != "device"})
        if silent and len(silent) + len(self.map.disabled) == len(self.map.units):
            raise DeviceFault(self.device, f"{self.device}: no {self.map.unit} answers; is its own power supply on?")
        return self._list(found, calibration=(self.calibration().note or None) if self.map.calibration else None)

    def move(self, name: str, goal: int, speed: int | None = None) -> Record:
        """Move one unit to a position in counts, and wait for the end of it; what came of it."""
        (record,) = self._moved({self.named(name): goal}, speed, alone=True)
        return {"device": self.device, **record}

    def move_percent(self, name: str, percent: float, speed: int | None = None) -> Record:
        """The same by the scale of its calibrated range, -100 to 100; DeviceFault without a calibration."""
        found = self.calibration()
        name = self.named(name)
        extent = found.ranges.get(name)
        if not -100 <= percent <= 100:
            raise self.fault(f"{percent} is no percentage from -100 to 100")
        if extent is None:
            why = found.note or f"the calibration file has no range for {name}"
            raise self.fault(f"{name} has no calibrated scale: {why}; a raw position needs none")
        return self.move(name, extent.counts(percent), speed)

    def move_many(self, goals: Mapping[str, int], speed: int | None = None) -> Record:
        """Move several units at once; one that is disabled, hot or silent is skipped with the reason."""
        return self._list(self._moved(goals, speed, alone=False))

    def pose(self, goals: Mapping[str, int], speed: int | None = None, release: bool = False) -> Record:
        """The same; with ``release`` each unit that came to its place is made limp there (``released``)."""
        stops, found = self.known.stops, self._moved(goals, speed, alone=False)
        for record in found if release else ():
            there = record["skipped"] is None and abs(record["position"] - record["goal"]) <= 3 * NEAR
            record["released"] = there and self.known.stops == stops
            if record["released"]:
                self._limp(record[self.map.unit])
        return self._list(found)

    def torque(self, name: str, on: bool) -> Record:
        """Let a unit hold its place, or make it limp; ``on`` as it was read back, None for one that is skipped."""
        name = self.named(name)
        record = self._blank(name, {"on": on})
        if record["skipped"] is not None:
            return {"device": self.device, **record, "on": None}
        if on:
            self.exchange(name, "whether it holds its place", partial(energised, self))
        else:
            self._limp(name)
        return {"device": self.device, **record}

    def stop(self) -> Record:
        """Every unit holds where it is, and every movement of this process ends; DeviceFault names what may go on."""
        self.known.stop()
        found, faults = [], []
        for name in self.map.units:
            record = self._blank(name, {"position": None})
            try:
                if record["skipped"] is None:
                    record["position"] = self.exchange(name, "whether it stopped", partial(held, self))
            except UnitFault as problem:
                faults.append(self.told(problem))
            except DeviceFault as problem:  # the bus itself: the other units cannot be asked either
                faults.append(self.told(problem))
                break
            found.append(record)
        if faults:
            told = f"not everything is known to have stopped: {'; '.join(faults)}"
            raise DeviceFault(self.device, f"{self.device}: {told}")
        return self._list(found)

    def _limp(self, name: str) -> None:
        release = motion_of(self).release
        self.exchange(name, "whether it is limp", lambda talk: talk.set(release))

    def _moved(self, goals: Mapping[str, int], speed: int | None, alone: bool) -> list[Record]:
        stops, motion = self.known.stops, motion_of(self)
        if motion.speeds and (speed is None or not motion.speeds[0] <= speed <= motion.speeds[1]):
            raise self.fault(f"the speed {speed} is outside of its limits, {motion.speeds[0]} to {motion.speeds[1]}")
        skipped, moves = planned(self, goals, alone)
        carried_out(self, moves.values(), speed, stops)
        return [self._told_of(name, goal, moves.get(name), skipped.get(name)) for name, goal in goals.items()]

    def _told_of(self, name: str, goal: int, move: Move | None, skipped: str | None) -> Record:
        start, position = (move.start, move.position) if move else (None, None)
        moved = move.moved(motion_of(self).moved) if move else False
        told = {"from": start, "goal": goal, "position": position, "moved": moved, "skipped": skipped}
        return {self.map.unit: name, **told}

    def _blank(self, name: str, members: Record) -> Record:
        skipped = self.map.disabled.get(name)
        return {self.map.unit: name, "id": self.map.units[name], "skipped": skipped, **members}

    def _list(self, records: list[Record], **more: Any) -> Record:
        return {"device": self.device, **more, f"{self.map.unit}s": records}
