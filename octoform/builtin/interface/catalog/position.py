"""Satellite positioning receivers: where they say that they are."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, Schema, maybe, number, record

POSITION = record(
    "Position",
    device=TEXT,
    fix=TEXT,
    latitude_deg=maybe(NUMBER),
    longitude_deg=maybe(NUMBER),
    altitude_m=maybe(NUMBER),
    satellites=maybe(WHOLE),
    hdop=maybe(NUMBER),
    time_utc=maybe(TEXT),
    sentences=WHOLE,
    waited_s=NUMBER,
)


def _waiting(_: Facts) -> dict[str, Schema]:
    return {"seconds": number("longest wait in seconds", 0.1, 60, 5)}


KINDS = (
    Kind(
        "read_position",
        "Wait for the receiver's next position. `fix` is none, 2d or 3d; without a fix the position is null, and "
        "`sentences` 0 means that the receiver sent nothing that could be read.",
        POSITION,
        75,
        parameters=_waiting,
        smoke={"seconds": 0.5},
        units={"seconds": "s"},
    ),
)
