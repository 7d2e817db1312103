"""Input devices: what they can send, and what they send within a bounded time."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, Schema, listing, number, record, whole

INPUT = record("Input", name=TEXT, event=TEXT, sends=listing(TEXT), keys=WHOLE, axes=listing(WHOLE))
INPUTS = record("Inputs", device=TEXT, inputs=listing(INPUT))
EVENT = record("Event", input=TEXT, time_s=NUMBER, type=TEXT, code=WHOLE, value=WHOLE)
EVENTS = record("Events", device=TEXT, waited_s=NUMBER, events=listing(EVENT))


def _waiting(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("longest wait in seconds", 0.1, 60, 5),
        "events": whole("how many events are enough", 1, 200, 20),
    }


KINDS = (
    Kind(
        "describe_input",
        "Describe what the input device can send: kinds of events, number of keys, axis codes.",
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
)
