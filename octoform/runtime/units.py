"""Operations on the units of a device on a register bus, one method for each kind of tool.

A result is an object for one unit, or holds one for each unit in a list that is named after them (``joints``). A unit
that the owner disabled is ``skipped`` with the owner's reason and never written to; the others go on.
"""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from .faults import DeviceFault
from .registers import Bank, Motion, Talk, UnitFault

# Movements of units on a bus: what is checked before, how the end is waited for, and what makes one end early.
#
# An acknowledgement is no proof of motion, so each movement is judged by the position that the unit reports afterwards.
# The bus is held for one exchange at a time: a reading, a stop and an emergency stop come between. Nothing is written
# before all goals were found to be within the limits: those of the product, those that the unit itself holds, and the
# calibrated range. What went wrong is a DeviceFault that names each unit it concerns.

NEAR = 20
"""Counts from the goal at which a unit is taken to be there: it holds against a load with a small error."""
JITTER = 2
POLL = 0.05
STILL = 4
"""Polls without motion after which a movement has ended."""
MOVING = "moving"
"""The field that is 0 while a unit stands, where the product has one."""


class Move:
    """One unit's movement, all in counts; ``fault`` states what went wrong, in words for a client.

    ``under_way`` from before its goal is written until it was seen to stand or was instructed to hold.
    """

    def __init__(self, name: str, start: int, goal: int) -> None:
        """From where it starts to its goal."""
        self.name, self.start, self.goal = name, start, goal
        self.position = start
        self.fault = ""
        self.under_way = False
        self._still = 0

    def seen(self, position: int, moving: bool) -> bool:
        """Take a fresh reading; whether the movement has ended."""
        stands = not moving and abs(position - self.position) <= JITTER
        self._still = self._still + 1 if stands else 0
        self.position = position
        ended = self._still >= (1 if self.arrived else STILL)
        self.under_way = not ended
        return ended

    @property
    def arrived(self) -> bool:
        """Whether it is where it should go."""
        return abs(self.position - self.goal) <= NEAR

    def moved(self, least: int) -> bool:
        """Whether it went as far as was to be seen: ``least`` counts, fewer where the goal is nearer than that."""
        wanted = abs(self.goal - self.start)
        return abs(self.position - self.start) >= min(least, max(1, wanted - NEAR))

    def failed(self, least: int) -> bool:
        """Whether it stayed where it was, with a goal farther off than ``least``."""
        return abs(self.goal - self.start) > least > abs(self.position - self.start)


def motion_of(bank: Bank) -> Motion:
    """How the units move; DeviceFault for a product of which that is not known."""
    if bank.map.motion is None:
        raise DeviceFault(bank.device, f"{bank.device}: nothing is known of how its units move")
    return bank.map.motion


def planned(bank: Bank, goals: Mapping[str, int], alone: bool) -> tuple[dict[str, str], dict[str, Move]]:
    """Why units are not moved, and the movements of all others. DeviceFault when a goal is outside of the limits.

    A unit that is hot or silent is skipped with that reason, or a fault where it is meant ``alone``.
    """
    calibrated = bank.calibration()
    if calibrated.wrong:
        raise DeviceFault(bank.device, f"{bank.device}: nothing was moved: {calibrated.note}")
    skipped: dict[str, str] = {}
    moves: dict[str, Move] = {}
    refused = []
    for name, goal in goals.items():
        if name in bank.map.disabled:
            skipped[name] = bank.map.disabled[name]
            continue
        try:
            start, low, high = bank.exchange(name, "whether it may be moved; nothing was", partial(_ready, bank))
        except UnitFault as problem:
            if alone:
                raise
            skipped[name] = bank.describe(problem)
            continue
        if extent := calibrated.ranges.get(name):
            low, high = max(low, extent.low), min(high, extent.high)
        if not low <= goal <= high:
            refused.append(f"{goal} is outside of the limits of {name}, {low} to {high}")
        moves[name] = Move(name, start, goal)
    if refused:
        raise DeviceFault(bank.device, f"{bank.device}: {'; '.join(refused)}; nothing was moved")
    return skipped, moves


def carried_out(bank: Bank, moves: Iterable[Move], speed: int | None, stops: int) -> None:
    """Begin these movements and wait for all of them; DeviceFault for those that failed, when the others have ended.

    ``stops`` is how often the device had been stopped when the call began: one stop more ends it.
    """
    moves = list(moves)
    try:
        _watched(bank, moves, speed, stops)
    except DeviceFault as problem:
        _none_goes_on(bank, moves)
        if left := [f"{move.name} goes on to {move.goal}" for move in moves if move.under_way]:
            raise type(problem)(bank.device, f"{problem}; not known: whether {', '.join(left)}") from problem
        raise
    except BaseException:  # the call was ended: nothing may move on unsupervised
        _none_goes_on(bank, moves)
        raise
    _none_goes_on(bank, moves)
    for move in moves:
        if not move.fault:
            _tried(bank, move, "whether it is limp", partial(_judged, bank, move))
    if faults := [move.fault for move in moves if move.fault]:
        done = [f"{move.name} is at {move.position}" for move in moves if not move.fault]
        raise UnitFault(bank.device, f"{bank.device}: {'; '.join(faults + done)}")


def _watched(bank: Bank, moves: list[Move], speed: int | None, stops: int) -> None:
    """Begin all of them and look until each has ended."""
    motion = motion_of(bank)
    for move in moves:
        _tried(bank, move, f"whether it goes to {move.goal}", partial(_begun, bank, move, speed, stops))
    waiting = [move for move in moves if not move.fault]
    end = bank.clock() + motion.within
    while waiting and bank.clock() < end:
        bank.sleep(POLL)
        unstopped(bank, stops)
        waiting = [move for move in waiting if not _tried(bank, move, "whether it moves", partial(_seen, bank, move))]
    unstopped(bank, stops)
    for move in waiting:
        _tried(bank, move, "whether it stopped", partial(_late, bank, move))


def _none_goes_on(bank: Bank, moves: list[Move]) -> None:
    """Order each unit that is still under way to hold, as far as the bus lets.

    The supervisor of a call may interrupt it more than once: the second time does not keep the units from being held.
    """
    for last in (False, True):
        try:
            for move in moves:
                if move.under_way:
                    with suppress(UnitFault):  # its own fault was reported; the others are held all the same
                        bank.exchange(move.name, "whether it stopped", partial(held, bank))
                    move.under_way = False
            return
        except DeviceFault:  # the bus is gone, and how the call ended is what is reported
            return
        except BaseException:
            if last:
                raise


def held(bank: Bank, talk: Talk) -> int:
    """Make a unit hold where it is: its position becomes its goal. The position.

    UnitFault for one that is farther outside of its range than it wavers: the nearest goal would set it off.
    """
    motion = motion_of(bank)
    position = talk.count(motion.present)
    goal = min(max(position, motion.minimum), motion.maximum)
    if abs(goal - position) > NEAR:
        span = f"{motion.minimum} to {motion.maximum}"
        raise bank.fault(f"{talk.name} is at {position}, where it cannot be set to hold: that is only from {span}")
    talk.write(motion.goal, goal)
    return position


def energised(bank: Bank, talk: Talk) -> None:
    """Switch a unit on where it is; UnitFault for one that is too hot, or that stays off."""
    motion = motion_of(bank)
    limp = dict(motion.release)
    wanted = [(field, value) for field, value in motion.before if field in limp and isinstance(value, int)]
    _cool(bank, talk)
    held(bank, talk)  # whatever goal it had before it was made limp must not be gone to
    talk.set(wanted)
    held(bank, talk)  # some units take no goal while they are limp


def unstopped(bank: Bank, stops: int) -> None:
    """DeviceFault when the device was stopped since."""
    if bank.known.stops != stops:
        raise DeviceFault(
            bank.device, f"{bank.device}: stopped: the movement was ended, and its units hold their places"
        )


def _tried(bank: Bank, move: Move, what: str, do: partial[bool]) -> bool:
    """Whether the movement has ended; one that faults has."""
    try:
        return bank.exchange(move.name, what, do)
    except UnitFault as problem:
        move.fault = bank.describe(problem)
        return True


def _cool(bank: Bank, talk: Talk) -> None:
    protect = bank.map.protect
    if protect is None:
        return
    value = talk.read(protect.field)
    if talk.name in bank.known.hot:
        reading = f"its {protect.field} is {value:g} {protect.unit}".rstrip()
        span = f"it was at {protect.refuse_at:g} or above, and is moved again below {protect.resume_below:g}"
        raise bank.fault(f"{talk.name} is too hot to be moved: {reading}; {span}")


def _ready(bank: Bank, talk: Talk) -> tuple[int, int, int]:
    """Where a unit is, and between which counts it may go."""
    motion = motion_of(bank)
    _cool(bank, talk)
    low = max(motion.minimum, talk.count(motion.lowest)) if motion.lowest else motion.minimum
    high = min(motion.maximum, talk.count(motion.highest)) if motion.highest else motion.maximum
    if low >= high:
        raise bank.fault(f"{talk.name} reports limits that leave it no way, {low} to {high}; it was not moved")
    return talk.count(motion.present), low, high


def _begun(bank: Bank, move: Move, speed: int | None, stops: int, talk: Talk) -> bool:
    """Write what comes before the goal, see that the unit is switched on, and write the goal."""
    motion = motion_of(bank)
    unstopped(bank, stops)
    before = [(field, speed if isinstance(value, str) else value) for field, value in motion.before]
    limp = dict(motion.release)
    if any(talk.count(field) == value for field, value in limp.items()):
        held(bank, talk)  # switched on, it would first go to the goal that it had before
    flags = 0
    for field, value in before:
        flags |= talk.write(field, value) if value is not None else 0
    for field, value in before:
        if field in limp and (found := talk.count(field)) != value:
            text = f"{move.name} is not switched on: its {field} is {found} after {value} was written"
            raise bank.fault(f"{text}; it was not moved")
    if flags:
        raise bank.fault(f"{move.name} reports a fault of its own (flags 0x{flags:02x}); it was not moved")
    unstopped(bank, stops)
    move.under_way = True
    talk.write(motion.goal, move.goal)
    return False


def _seen(bank: Bank, move: Move, talk: Talk) -> bool:
    """Look at a unit under way; whether it has ended. One that is too hot is stopped."""
    motion, protect = motion_of(bank), bank.map.protect
    position = talk.count(motion.present)
    moving = MOVING in bank.map.fields and talk.count(MOVING) != 0
    if protect is not None and (value := talk.read(protect.field)) >= protect.refuse_at:
        move.position = held(bank, talk)
        move.under_way = False
        reading = f"its {protect.field} is {value:g} {protect.unit}".rstrip()
        raise bank.fault(f"{move.name} was stopped at {move.position} on its way to {move.goal}: {reading}")
    return move.seen(position, moving)


def _late(bank: Bank, move: Move, talk: Talk) -> bool:
    """Stop a unit that is still under way when its time is over; UnitFault states where, unless it came or sticks."""
    motion = motion_of(bank)
    move.position = held(bank, talk)
    move.under_way = False
    if not move.arrived and not move.failed(motion.moved):
        text = f"{move.name} was stopped at {move.position} on its way to {move.goal}: {motion.within:g} s were over"
        raise bank.fault(f"{text}; move it on with another call, or faster")
    return True


def _judged(bank: Bank, move: Move, talk: Talk) -> bool:
    """UnitFault for a unit that did not move at all, and for one that is limp now, wherever it came to."""
    motion = motion_of(bank)
    limp = [f"its {field} is {value}" for field, value in motion.release if talk.count(field) == value]
    why = f"{', '.join(limp)}, so something made it limp meanwhile" if limp else ""
    if move.failed(motion.moved):
        held(bank, talk)  # what blocks it may give way later, unsupervised
        text = f"{move.name} acknowledged the goal {move.goal} and did not move: from {move.start} to {move.position}"
        raise bank.fault(f"{text}; {why}" if why else text)
    if limp:
        raise bank.fault(f"{move.name} was at {move.position} on its way to {move.goal}: {why}")
    return True


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
        """The same of every unit, a silent one skipped with that reason; ``calibration`` states why there is none."""
        found, silent, wanted = [], [], list(fields)
        for name in self.map.units:
            try:
                record = self.read(name, wanted)
            except UnitFault as problem:
                silent.append(name)
                document = {"skipped": self.describe(problem), **dict.fromkeys(wanted), "calibrated": None}
                record = self._blank(name, document)
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
                faults.append(self.describe(problem))
            except DeviceFault as problem:  # the bus itself: the other units cannot be asked either
                faults.append(self.describe(problem))
                break
            found.append(record)
        if faults:
            text = f"not everything is known to have stopped: {'; '.join(faults)}"
            raise DeviceFault(self.device, f"{self.device}: {text}")
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
        return [self._record_of(name, goal, moves.get(name), skipped.get(name)) for name, goal in goals.items()]

    def _record_of(self, name: str, goal: int, move: Move | None, skipped: str | None) -> Record:
        start, position = (move.start, move.position) if move else (None, None)
        moved = move.moved(motion_of(self).moved) if move else False
        fields = {"from": start, "goal": goal, "position": position, "moved": moved, "skipped": skipped}
        return {self.map.unit: name, **fields}

    def _blank(self, name: str, members: Record) -> Record:
        skipped = self.map.disabled.get(name)
        return {self.map.unit: name, "id": self.map.units[name], "skipped": skipped, **members}

    def _list(self, records: list[Record], **more: Any) -> Record:
        return {"device": self.device, **more, f"{self.map.unit}s": records}
