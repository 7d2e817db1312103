"""Random calls before simulated servos that fail at random: no fault and no order of calls exceeds a limit."""

import random
from collections import Counter
from collections.abc import Callable

from unit.runtime.servo_bench import ARM, NAMES, Bench

from octoform.runtime import DeviceFault
from octoform.simulation.servo import FAULTS
from octoform.simulation.servos import ServoBus

CALLS = 1_500
WITHIN = 0.15
"""Shorter than a real movement: the next call then finds the units under way."""


WEIGHTS = (8, 2, 1, 3, 3, 1)
"""How often each kind of call is made; the long ones seldom."""


class Bus(ServoBus):
    """Brings loads and heat to the present now and then alone, which is most of the work of a simulated bus."""

    fed = 0

    def advance(self) -> None:
        """Each hundredth time."""
        self.fed += 1
        if self.fed % 100 == 1:
            super().advance()


def calls(bench: Bench, chance: random.Random) -> list[Callable[[], object]]:
    """One of each kind, with any values."""
    units = bench.units()
    goal, speed = chance.randint(-300, 4400), chance.randint(0, 1700)
    name = chance.choice(NAMES)
    return [
        lambda: units.move(name, goal, speed),
        lambda: units.move(name, chance.randint(900, 3000), chance.randint(50, 1500)),
        lambda: units.move_many({one: chance.randint(800, 3300) for one in NAMES[:3]}, chance.randint(50, 1500)),
        lambda: units.torque(name, chance.random() < 0.6),
        lambda: units.read(name, ("position", "temperature")),
        units.stop,
    ]


def break_something(bus: ServoBus, chance: random.Random) -> None:
    """A fault comes, goes, or the bus is silent for a moment; now and then a servo is hot."""
    servo = bus.servos[chance.randint(1, 6)]
    kind = chance.randrange(4)
    if kind == 0:
        servo.fault = chance.choice(FAULTS)
    elif kind == 1:
        bus.drop(transactions=chance.randint(1, 8))
    elif kind == 2:
        servo.temperature = chance.uniform(30, 69)
    for other in bus.servos.values():
        if chance.random() < 0.5:
            other.fault = None


def test_no_fault_and_no_order_of_calls_exceeds_a_limit() -> None:
    chance, found = random.Random(20), Counter[str]()
    bench = Bench(ARM._replace(motion=ARM.motion._replace(within=WITHIN) if ARM.motion else None), made=Bus)
    limits = {number: (servo.value("lowest"), servo.value("highest")) for number, servo in bench.bus.servos.items()}
    for _ in range(CALLS):
        if chance.random() < 0.1:
            break_something(bench.bus, chance)
        if chance.random() < 0.02:
            bench.events.append((bench.now + chance.uniform(0.01, 0.3), lambda: attempt(bench.units().stop, found)))
        hot = {number for number, servo in bench.bus.servos.items() if servo.temperature >= 66}
        begun = len(bench.writes)
        attempt(chance.choices(calls(bench, chance), WEIGHTS)[0], found)
        for number, address, value in bench.writes[begun:]:
            lowest, highest = limits[number]
            assert address in (40, 41, 42, 46)
            assert address != 42 or lowest <= value <= highest or value == round(bench.bus.servos[number].position)
            assert address != 46 or 50 <= value <= 1500
            assert address != 40 or value != 1 or number not in hot
        bench.writes.clear()
    for number, servo in bench.bus.servos.items():
        assert limits[number][0] <= servo.reached.lowest <= servo.reached.highest <= limits[number][1]
    assert bench.bus.corrupt == bench.bus.overlapping == 0
    assert min(found[kind] for kind in ("well", "limits", "hot", "silent", "stopped", "stuck")) > 2, found


def attempt(call: Callable[[], object], told: Counter[str]) -> None:
    """Make the call and count what came of it; nothing but a DeviceFault may come of one that does not go well."""
    words = {
        "outside": "limits",
        "too hot": "hot",
        "no sound": "silent",
        "stopped:": "stopped",
        "did not move": "stuck",
    }
    try:
        call()
        told["well"] += 1
    except DeviceFault as problem:
        text = str(problem)
        told[next((kind for word, kind in words.items() if word in text), "other")] += 1
