"""A ledger of claims over a folder of its own, on a clock that only moves when the test advances it."""

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from octoform.claims.admission import Proposal
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Claim, Condition, Reading, Restriction, Signal, Value
from octoform.claims.settings import Bound, Settings, ToolFacts
from octoform.diagnostics import Diagnostic
from octoform.state.layout import Layout

ARM = "usb-1a86-55d3"
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
NAMES = (*JOINTS, *(str(number + 1) for number in range(len(JOINTS))))
ELBOW_TARGET = f"device:{ARM}/elbow_flex"
TOOLS = {
    "arm_status": ToolFacts("read", devices=(ARM,)),
    "arm_stop": ToolFacts("actuate", stops=True, devices=(ARM,)),
    "arm_move_joint": ToolFacts("actuate", devices=(ARM,), choices={"joint": NAMES, "device": (ARM,)}),
    "arm_home": ToolFacts("actuate", devices=(ARM,)),
    "rail_move_x": ToolFacts("actuate", devices=("usb-2341-804f",)),
}
HEAT = Bound("temperature", 69.0, 60.0, sources=("arm_status",), source="the profile so-arm101")
SECONDS = 1800.0


def heat(joint: str = "elbow_flex") -> Signal:
    """The temperature of a joint."""
    return Signal(Channel.SENSOR, "arm_status", f"/joints/{joint}/temperature")


def load(joint: str = "elbow_flex") -> Signal:
    """The load of a joint, that no profile describes."""
    return Signal(Channel.SENSOR, "arm_status", f"/joints/{joint}/load")


@dataclass
class Clock:
    """Seconds since the machine was started, and the wall clock beside, which may jump by itself."""

    now: float = 5000.0
    jumped: float = 0.0

    def uptime(self) -> float:
        return self.now

    def stamp(self) -> str:
        moment = datetime(2026, 11, 22, tzinfo=UTC) + timedelta(seconds=self.now + self.jumped)
        return moment.isoformat(timespec="seconds").replace("+00:00", "Z")


STILL = Restriction("arm_move_joint", {"joint": "elbow_flex"})


@dataclass
class Bench:
    """A host's ledger; ``again()`` is another process, or the daemon after a restart."""

    project: Path
    clock: Clock = field(default_factory=Clock)
    boot: str = "boot-1"
    bounds: tuple[Bound, ...] = (HEAT,)
    ledger: Ledger = field(init=False)

    def __post_init__(self) -> None:
        self.layout = Layout(self.project, "bench")
        self.again()

    def again(self) -> Ledger:
        self.ledger = Ledger.open(self.layout, self.clock, self.settings())
        return self.ledger

    def settings(self) -> Settings:
        return Settings(SECONDS, TOOLS, self.bounds, self.boot)

    def read(self, value: Value, signal: Signal | None = None, why: str = "") -> Reading:
        """Take and record one reading, of the elbow's heat where no other signal is given."""
        reading = self.ledger.make(signal or heat(), value, why)
        self.ledger.record([reading])
        return reading

    def claim(self, *cites: Reading | str, op: str = ">=", value: Value = 69, **more: Any) -> Claim | Diagnostic:
        """Propose that the elbow is hot; what of it is otherwise comes by name."""
        names = tuple(each if isinstance(each, str) else each.id for each in cites)
        by = more.pop("by", "watch")
        fields: dict[str, Any] = {
            "target": ELBOW_TARGET,
            "fault": "none",
            "statement": "the elbow is hot",
            "signal": heat(),
            "condition": Condition(op, value),
            "cites": names,
            "restrictions": (STILL,),
            **more,
        }
        return self.ledger.propose(Proposal(**fields), by)

    def code(self, *cites: Reading | str, **more: Any) -> str:
        """The code for which a claim is refused or waits; empty for one that is believed."""
        found = self.claim(*cites, **more)
        return found.code if isinstance(found, Diagnostic) else str(found.data.get("because", ""))
