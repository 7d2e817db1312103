"""Input devices: what they can send, and what they send within a bounded time."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, Schema, listing, maybe, number, record, whole

AXIS = record("Axis", code=WHOLE, name=TEXT, minimum=maybe(WHOLE), maximum=maybe(WHOLE), position=maybe(WHOLE))
INPUT = record(
    "Input", name=TEXT, event=TEXT, sends=listing(TEXT), keys=WHOLE, buttons=listing(TEXT), axes=listing(AXIS)
)
INPUTS = record("Inputs", device=TEXT, inputs=listing(INPUT))
EVENT = record("Event", input=TEXT, time_s=NUMBER, type=TEXT, code=WHOLE, value=WHOLE)
EVENTS = record("Events", device=TEXT, waited_s=NUMBER, events=listing(EVENT))
RUMBLED = record("Rumbled", device=TEXT, seconds=NUMBER, strength=NUMBER)


def _waiting(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("longest wait in seconds", 0.1, 60, 5),
        "events": whole("how many events are enough", 1, 200, 20),
    }


def _rumbling(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("how long in seconds", 0.05, 5, 0.5),
        "strength": number("strength, as a part of what the device can", 0, 1, 0.5),
    }


KINDS = (
    Kind(
        "describe_input",
        "Describe what the input device sends: kinds of events, keys, buttons, axes with range and present position "
        "(null where this user may not open the device).",
        INPUTS,
        35,
    ),
    Kind(
        "read_input_events",
        "Wait a bounded time for events (keys, axes, switches). An empty list means that none came.",
        EVENTS,
        65,
        parameters=_waiting,
        smoke={"seconds": 0.1},
        units={"seconds": "s", "events": "events"},
    ),
    Kind(
        "play_rumble",
        "Let the game controller or the vibration motor rumble for a bounded time.",
        RUMBLED,
        60,
        "actuate",
        _rumbling,
        units={"seconds": "s", "strength": "of full strength"},
        idempotent=False,
    ),
)
