"""Real-time clocks."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, listing, record

CLOCK = record("Clock", name=TEXT, since_epoch_s=WHOLE, time=TEXT, drift_s=NUMBER)
CLOCKS = record("Clocks", device=TEXT, clocks=listing(CLOCK))

KINDS = (
    Kind(
        "read_clock",
        "Read the hardware clock, taken as UTC, and how many seconds it is ahead of the system's time (`drift_s`).",
        CLOCKS,
        35,
    ),
)
