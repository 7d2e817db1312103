"""What is forbidden or bounded of one joint, on a live endpoint: it holds by every tool, and outlives every process."""

import asyncio
import json
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from projects import AGENT, OCTOFORM, Project

from octoform.claims.admission import Proposal
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Claim, Condition, Restriction, Signal
from octoform.claims.settings import settings_of
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.engine.unattended.heal import heal
from octoform.simulation.rig import Rig, load
from octoform.state.layout import Layout

pytestmark = pytest.mark.dear

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
        """The error of each call for a client; empty where it goes well."""

        async def talk() -> list[str]:
            words = [f"-chdir={self.project.folder}", "connect", self.project.host]
            transport = StdioTransport(str(OCTOFORM), words, env=self.project.environment(), keep_alive=False)
            async with Client(transport) as client:
                done = [await client.call_tool(name, given, raise_on_error=False) for name, given in calls]
                return [str(each.content[0].text) if each.is_error else "" for each in done]

        return asyncio.run(talk())


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("units")
    description = load("reference")
    description["devices"] = {"arm": {**description["devices"]["arm"], "speedup": 20}}
    rig = Rig(description, folder / "tree")
    rig.start()
    project = Project(folder / "project", folder / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(folder / "tree")
    project.manifest = {"profiles": "[profiles/so-arm101.md]"}
    (project.folder / "profiles").mkdir(parents=True)
    (project.folder / "profiles" / "so-arm101.md").write_text((TOP / "profiles" / "so-arm101.md").read_text())
    project.share_environments(packaged("feetech-servo-sdk"))
    project.apply(status=0)
    yield Bench(project, rig)
    project.run("stop")
    rig.stop()


@pytest.mark.parametrize("kind", ["disable_unit", "fire_risk"])
def test_a_confirmed_declaration_keeps_the_joint_still_for_good(bench: Bench, kind: str) -> None:
    ledger = bench.ledger
    reading = ledger.make(LOAD, 99.0)
    ledger.record([reading])
    proposal = Proposal(f"device:{ARM}/{ELBOW}", "none", "The gear is broken.", cites=(reading.id,), irreversible=kind)
    claim = ledger.propose(proposal, "watch")
    assert isinstance(claim, Claim)
    assert f"permanent restriction {kind}" in bench.project.run("claims", status=0).out
    assert f"permanent restriction {kind}" in bench.project.run("health").out
    assert f"permanent restriction {kind}" in bench.project.run("confirm", status=0).out
    bench.project.run("confirm", claim.id, "-auto-approve", status=0)

    def is_held() -> None:
        for call, text in zip(MOVING, bench.told(*MOVING.items()), strict=True):
            assert f"permanent restriction {kind}" in text and f"claims -retire {claim.id}" in text, (call, text)

    is_held()
    wrist = ("arm_move_joint", {"joint": "wrist_roll", "position": 2100, "speed": 1500})
    assert bench.told(wrist, ("arm_stop", {}), ("arm_status", {})) == ["", "", ""]
    bench.project.run("stop")
    bench.project.run("start", status=0)
    is_held()  # another process serves, and no daemon runs
    bench.project.run("stop")
    bench.layout.restrictions.unlink()
    bench.project.run("start", status=0)
    is_held()  # the ledger's restriction holds without the file
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
    bench.project.manifest["policy"] = (
        f"{{actuate: allow, limits: [{limit}, {{tool: 'arm_*', parameter: speed, maximum: 300}}]}}"
    )
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


MORE = [["move(joint, position", "move(joint, max(position, position * 2, key=int)"]]
"""Twice as far, in words that are not computed before anything runs."""
AGENT_WORDS = {
    "format": 1,
    "stage": "heal",
    "class": "broken_tool",
    "target": "tool:arm_move_joint",
    "status": "repaired",
    "reason": "The servo counts in halves.",
    "action": "rewrite",
    "functions": ["arm_move_joint"],
    "server": "server.py",
    "cites": ["f1"],
    "claims": [],
}


def rewritten(bench: Bench, rewrite: list[list[str]]) -> str:
    """The id under which this rewrite of arm_move_joint by an agent waits for a person."""
    failure = {"id": "f1", "tool": "arm_move_joint", "error": "DeviceFault", "message": "no answer", "count": 3}
    fault = {"tool": "arm_move_joint", "device": ARM, "class": "broken_tool", "message": "it moves too little"}
    moment = "2026-11-22T10:00:00Z"
    brief = {
        "error": {**fault, "severity": "recoverable", "suggested_fix": None, "cites": ["f1"]},
        "readings": [],
        "failures": [{**failure, "first": moment, "last": moment}],
        "since": "2026-11-22T00:00:00Z",
        "target": "tool:arm_move_joint",
        "episode": "e1",
    }
    command = json.dumps([sys.executable, str(AGENT), str(bench.project.outside / "script.json")])
    bench.project.manifest["stages"] = f"{{heal: {{harness: {{name: command, command: {command}, sandbox: false}}}}}}"
    bench.project.script = {"heal": [{"rewrite": rewrite, "report": AGENT_WORDS}]}
    bench.project.write()
    done = heal(bench.project.folder, bench.project.environment(), brief)
    found = re.search(r"octoform confirm (r\w+)", str(done.detail))
    assert found is not None and not done.changed, done
    return found[1]


def test_waiting_rewrites_are_listed_and_one_is_dropped(bench: Bench) -> None:
    before = bench.layout.output("serve").read_text()
    identity = rewritten(bench, MORE)
    listed = bench.project.run("confirm", status=0).out
    assert identity in listed and "arm_move_joint" in listed
    (shown,) = json.loads(bench.project.run("confirm", "-json", status=0).out)["rewrites"]
    assert shown["id"] == identity and any("position * 2" in line for line in shown["difference"])
    bench.project.run("confirm", identity, "-reject", status=0)
    assert bench.layout.output("serve").read_text() == before
    assert identity not in bench.project.run("confirm", status=0).out
    assert bench.project.run("confirm", identity, "-auto-approve").status != 0


def test_a_rewrite_of_another_server_or_behind_an_emergency_stop_is_not_put_in_service(bench: Bench) -> None:
    server = bench.layout.output("serve")
    before = server.read_text()
    identity = rewritten(bench, MORE)
    bench.project.run("estop", status=0)
    done = bench.project.run("confirm", identity, "-auto-approve", status=1)
    assert "HEAL-NOT-CONFIRMED" in done.text and "emergency stop" in done.text and server.read_text() == before
    bench.project.run("estop", "-clear", status=0)
    kept = bench.layout.local / "rewrites"
    (path,) = kept.glob("*.json")
    found = json.loads(path.read_bytes())
    path.write_text(json.dumps({**found, "base": f"{before}\n# of another day\n"}))
    done = bench.project.run("confirm", identity, "-auto-approve", status=1)
    assert "made again since" in done.text and server.read_text() == before
    bench.project.run("confirm", identity, "-reject", status=0)
    assert bench.told(("arm_move_joint", {"joint": "gripper", "position": 2100, "speed": 300})) == [""]


def test_what_the_device_reports_stops_a_rewrite_that_makes_more_of_a_goal(bench: Bench) -> None:
    limit = f"{{tool: arm_move_joint, parameter: position, units: [{ELBOW}], maximum: 1300}}"
    bench.project.manifest["policy"] = f"{{actuate: allow, limits: [{limit}]}}"
    bench.project.apply(status=0)
    bench.project.run("confirm", rewritten(bench, MORE), "-auto-approve", status=0)
    assert "position * 2" in bench.layout.output("serve").read_text()
    move = ("arm_move_joint", {"joint": ELBOW, "position": 1000, "speed": 1500})
    found, again, all_, wrist, status, stop = bench.told(
        move,
        move,
        ("arm_home", {"speed": 1500}),
        ("arm_move_joint", {"joint": "wrist_roll", "position": 1000, "speed": 1500}),
        ("arm_status", {}),
        ("arm_stop", {}),
    )
    assert "has moved its device" in found and ELBOW in found and "limits -reset arm_move_joint" in found
    assert "outside of its range" in again and "outside of its range" in all_
    assert [wrist, status, stop] == ["", "", ""]
    assert "the device reported elbow_flex" in bench.project.run("limits", status=1).out
    assert "OUTSIDE" in bench.project.run("audit").out
    # A person learns of it without reading the audit log, with a daemon and without.
    for words in ("status", "health"):
        text = " ".join(bench.project.run(words).text.split())
        assert f"the device reported {ELBOW}" in text and "limits -reset arm_move_joint" in text, text
    bench.project.run("watch", "--once")
    listed = " ".join(bench.project.run("incidents").text.split())
    assert "arm_move_joint" in listed and f"the device reported {ELBOW}" in listed, listed
    bench.project.run("restart", status=0)
    assert "outside of its range" in bench.told(move)[0]
    bench.project.run("limits", "-reset", "arm_move_joint", status=0)
    assert bench.told(("arm_move_joint", {"joint": ELBOW, "position": 600, "speed": 1500})) == [""]
