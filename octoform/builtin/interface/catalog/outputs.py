"""Digital-to-analog converters of industrial I/O: outputs in volts and amperes."""

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
MOST = 50
"""No converter gives more, in volts or amperes; what one of them can give it says itself."""


def _output(facts: Facts) -> dict[str, Schema]:
    names = sorted(
        {str(name) for fact in facts for name in fact.get("outputs", ())}, key=lambda name: (len(name), name)
    )
    return {
        "channel": one_of("which output", names or ["out_voltage0"]),
        "value": number("in volts, for out_current in amperes", -MOST, MOST),
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
        "Set one output of the converter in volts or amperes, and read it back. What is wired to it acts at once; the "
        "output stays so, also when this server ends. A value outside the output's own range is refused.",
        OUTPUTS,
        88,
        "actuate",
        _output,
        units={"value": "V or A"},
    ),
)
