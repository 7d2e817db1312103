"""What is forbidden or bounded of one joint, on a live endpoint: it holds by every tool, and outlives every process."""

import asyncio
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from projects import OCTOFORM, Project

from octoform.claims.gathering import settings_of
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Claim, Condition, Restriction, Signal
from octoform.claims.proposal import Proposal
from octoform.daemon.sensing.moments import SystemClock
from octoform.simulation.descriptions import load
from octoform.simulation.rig import Rig
from octoform.state.layout import Layout

TOP = Path(__file__).parents[2]
ARM, ELBOW = "usb-1a86-55d3", "elbow_flex"
GOALS = {"shoulder_pan": 2048, "shoulder_lift": 1500, ELBOW: 2100, "wrist_flex": 2048, "wrist_roll": 2048}
MOVING: dict[str, dict[str, Any]] = {
    "arm_move_joint": {"joint": ELBOW, "position": 2100, "speed": 1500},
    "arm_move_joints": {**GOALS, "gripper": 2048, "speed": 1500},
    "arm_home": {"speed": 1500},
    "arm_rest": {"speed": 1500},
    "arm_set_torque": {"joint": "3", "on": True},
}
LOAD = Signal(Channel.SENSOR, "arm_status", f"/joints/{ELBOW}/load")


@dataclass
class Bench:
    project: Project
    rig: Rig

    @property
    def layout(self) -> Layout:
        return Layout(self.project.folder, self.project.host)

    @property
    def ledger(self) -> Ledger:
        return Ledger.open(self.layout, SystemClock(), settings_of(self.layout, 600.0))

    def told(self, *calls: tuple[str, dict[str, Any]]) -> list[str]:
        """What a client is told of each call; empty where it goes well."""

        async def talk() -> list[str]:
            words = [f"-chdir={self.project.folder}", "connect", self.project.host]
            transport = StdioTransport(str(OCTOFORM), words, env=self.project.environment(), keep_alive=False)
            async with Client(transport) as client:
                done = [await client.call_tool(name, given, raise_on_error=False) for name, given in calls]
                return [str(each.content[0].text) if each.is_error else "" for each in done]

        return asyncio.run(talk())


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, compiled: Path) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("units")
    description = load("reference")
    description["devices"]["arm"] |= {"speedup": 20}
    rig = Rig(description, folder / "tree")
    rig.start()
    project = Project(folder / "project", folder / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(folder / "tree")
    project.manifest = {"profiles": "[profiles/so-arm101.md]"}
    (project.folder / "profiles").mkdir(parents=True)
    (project.folder / "profiles" / "so-arm101.md").write_text((TOP / "profiles" / "so-arm101.md").read_text())
    project.take_bytecode(compiled)
    project.apply(status=0)
    yield Bench(project, rig)
    project.run("stop")
    rig.stop()


def test_a_confirmed_declaration_keeps_the_joint_still_for_good(bench: Bench) -> None:
    ledger = bench.ledger
    reading = ledger.make(LOAD, 99.0)
    ledger.record([reading])
    proposal = Proposal(
        f"device:{ARM}/{ELBOW}", "none", "The gear is broken.", cites=(reading.id,), irreversible="disable_unit"
    )
    claim = ledger.propose(proposal, "watch")
    assert isinstance(claim, Claim)
    assert "permanent restriction disable_unit" in bench.project.run("claims", status=0).out
    assert "permanent restriction disable_unit" in bench.project.run("health").out
    bench.project.run("confirm", claim.id, "-auto-approve", status=0)

    def is_held() -> None:
        for call, text in zip(MOVING, bench.told(*MOVING.items()), strict=True):
            assert "permanent restriction disable_unit" in text and f"claims -retire {claim.id}" in text, (call, text)

    is_held()
    wrist = ("arm_move_joint", {"joint": "wrist_roll", "position": 2100, "speed": 1500})
    assert bench.told(wrist, ("arm_stop", {}), ("arm_status", {})) == ["", "", ""]
    bench.project.run("stop")
    bench.project.run("start", status=0)
    is_held()  # another process serves, and no daemon runs
    bench.project.run("stop")
    bench.layout.restrictions.unlink()
    bench.project.run("start", status=0)
    is_held()  # what the ledger says holds without the file
    bench.layout.restrictions.write_text("{")
    is_held()
    bench.project.run("claims", "-retire", claim.id, status=0)
    assert bench.told(("arm_home", {"speed": 1500})) == [""]


def test_a_claim_on_one_joint_holds_whichever_tool_moves_it(bench: Bench) -> None:
    ledger = bench.ledger
    ledger.record([ledger.make(LOAD, 1.0)])
    reading = ledger.make(LOAD, 99.0)
    ledger.record([reading])
    still = Restriction("arm_move_joint", {"joint": ELBOW})
    claim = ledger.propose(
        Proposal(
            target=f"device:{ARM}/{ELBOW}",
            fault="none",
            statement="The elbow strains.",
            signal=LOAD,
            condition=Condition(">", 90),
            cites=(reading.id,),
            restrictions=(still,),
        ),
        "watch",
    )
    assert isinstance(claim, Claim), claim
    for call, text in zip(MOVING, bench.told(*MOVING.items()), strict=True):
        assert "temporary claim" in text and claim.id in text, (call, text)
    assert bench.told(("arm_move_joint", {"joint": "gripper", "position": 2100, "speed": 1500})) == [""]
    bench.project.run("claims", "-retire", claim.id, status=0)
    assert bench.told(("arm_home", {"speed": 1500})) == [""]


def test_a_tighter_range_of_one_joint_holds_whichever_tool_moves_it(bench: Bench) -> None:
    limit = f"{{tool: arm_move_joint, parameter: position, units: [{ELBOW}], maximum: 1000}}"
    bench.project.manifest["policy"] = f"{{limits: [{limit}, {{tool: 'arm_*', parameter: speed, maximum: 300}}]}}"
    applied = bench.project.apply(status=0)
    assert "POLICY-POSE" in applied.text and "POLICY-DEFAULT" in applied.text
    moving = {name: {**given, **({"speed": 300} if "speed" in given else {})} for name, given in MOVING.items()}
    *moves, _ = bench.told(*moving.items())
    assert all(ELBOW in text and "1000" in text for text in moves), moves
    (text,) = bench.told(("arm_move_joint", {"joint": "gripper", "position": 2100}))
    assert "400" in text and "default" in text and "300" in text
    low = {"joint": ELBOW, "position": 990, "speed": 300}
    assert bench.told(("arm_move_joint", low)) == [""]
    assert json.loads((bench.layout.endpoint / "policy.json").read_bytes())["tools"]["arm_home"]["units"]
