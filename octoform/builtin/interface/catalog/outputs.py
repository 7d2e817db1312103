"""Converters and digital potentiometers of industrial I/O: outputs in volts, amperes and ohms."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, Schema, listing, maybe, number, one_of, record

OUTPUT = record(
    "Output",
    channel=TEXT,
    value=maybe(NUMBER),
    unit=TEXT,
    minimum=maybe(NUMBER),
    maximum=maybe(NUMBER),
    powered_down=maybe(FLAG),
)
OUTPUTS = record("Outputs", device=TEXT, outputs=listing(OUTPUT))
_VALUE = "in V, out_current in A, out_resistance in ohm"
MOST, MOST_OHMS = 50, 1_000_000
"""No converter gives more, in volts or amperes, and no potentiometer; what one of them can give it says itself."""


def _output(facts: Facts) -> dict[str, Schema]:
    names = sorted(
        {str(name) for fact in facts for name in fact.get("outputs", ())}, key=lambda name: (len(name), name)
    )
    return {
        "channel": one_of("which output", names or ["out_voltage0"]),
        "value": number(_VALUE, -MOST, MOST_OHMS if any("resistance" in name for name in names) else MOST),
    }


KINDS = (
    Kind(
        "read_output_channels",
        "Read what each output of the converter is set to, and its range where the kernel tells it; null is not told.",
        OUTPUTS,
        55,
    ),
    Kind(
        "set_output_channel",
        "Set one output of the converter in volts, amperes or ohms, and read it back. What is wired to it acts at "
        "once; it stays so, also when this server ends. A value outside the output's own range is refused.",
        OUTPUTS,
        88,
        "actuate",
        _output,
        units={"value": "V, A or ohm"},
    ),
)
