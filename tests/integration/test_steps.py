"""Privileged steps on a live rig: the real command line proves the joints of a simulated arm, and rewrites its tools.

One live endpoint for all tests of the file, which leave it in sync. What counts is what the firmware did.
"""

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from projects import Done, Project

from octoform.simulation.rig import Rig, load
from octoform.simulation.servos import ServoBus

pytestmark = pytest.mark.dear

TOP = Path(__file__).parents[2]
DEVICE = "usb-1a86-55d3"
STILL = {name: "not for this test" for name in ("shoulder_pan", "shoulder_lift", "wrist_flex", "wrist_roll")}
"""Two joints are enough here; each takes a second or two."""
AGENT = '''\
"""An agent of a step that asks the embedded one what to try, and puts one text of the server in another's place."""
import json, subprocess, sys
from pathlib import Path

task = json.loads(Path("task.json").read_text())
subprocess.run([sys.executable, "-m", "octoform.builtin", "task.json"], check=True)
for old, new in json.loads(Path(sys.argv[1]).read_text()):
    text = Path("server.py").read_text()
    assert old in text, old
    Path("server.py").write_text(text.replace(old, new))
    value = json.loads(Path(task["output"]).read_text())
    Path(task["output"]).write_text(json.dumps({**value, "server": "server.py"}))
'''


@dataclass
class Bench:
    project: Project
    rig: Rig

    @property
    def arm(self) -> ServoBus:
        assert self.rig.servos is not None
        return self.rig.servos

    @property
    def server(self) -> Path:
        return self.project.state / "serve" / "server.py"

    def steps(self, *names: str, **manifest: str) -> Done:
        """Apply with these steps switched on, whatever comes of it; the rewriting agent runs in any case."""
        self.project.manifest["privileged_steps"] = f"[{', '.join(names)}]"
        self.project.harness = manifest.get("harness", "builtin")
        return self.project.apply(*(("-replace", "step.arm") if manifest else ()))

    def rewriting(self, *changes: tuple[str, str]) -> str:
        """A harness for the steps that rewrites the server so; the stages keep their own agent."""
        changes_file, agent = self.project.outside / "changes.json", self.project.outside / "agent.py"
        changes_file.write_text(json.dumps(changes))
        agent.write_text(AGENT)
        return (
            f"{{name: command, command: {json.dumps([sys.executable, str(agent), str(changes_file)])}, sandbox: false}}"
        )

    def is_in_sync(self) -> bool:
        done = self.project.run("plan", "-detailed-exitcode")
        return done.status == 0 and "No changes." in done.out

    def tried(self, step: str = "step.arm") -> dict[str, dict[str, Any]]:
        """The state's entry for each unit."""
        return {item["unit"]: item for item in self.project.nodes()[step]["detail"]["trials"]}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("steps")
    description = load("reference")
    description["devices"] = {"arm": {**description["devices"]["arm"], "speedup": 8}}
    rig = Rig(description, folder / "tree")
    rig.start()
    project = Project(folder / "project", folder / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(folder / "tree")
    stages = [f"{name}: {{harness: builtin}}" for name in ("probe", "identify", "interface", "serve", "deploy")]
    project.manifest = {
        "profiles": "[profiles/so-arm101.md, profiles/camera-rail.md]",
        "stages": f"{{{', '.join(stages)}}}",
        "budget": "{attempts: 1}",
    }
    (project.folder / "profiles").mkdir(parents=True)
    for name in ("so-arm101", "camera-rail"):
        text = (TOP / "profiles" / f"{name}.md").read_text()
        if name == "so-arm101":
            assert "\n---\n" in text[4:]
            text = text.replace("\n---\n", f"\nrig: {{disabled: {json.dumps(STILL)}}}\n---\n", 1)
        (project.folder / "profiles" / f"{name}.md").write_text(text)
    project.share_environments(packaged("feetech-servo-sdk"))
    bench = Bench(project, rig)
    done = bench.steps("arm", "rail")
    assert done.status == 0, done.text
    yield bench
    project.run("stop")
    rig.stop()


def test_each_joint_was_moved_and_came_back_and_nothing_is_left_to_do(bench: Bench) -> None:
    node = bench.project.nodes()["step.arm"]
    assert node["status"] == "accepted" and node["attempts"] == 1
    assert {item["unit"] for item in node["detail"]["skipped_units"]} == set(STILL)
    tried = bench.tried()
    assert set(tried) == {"elbow_flex", "gripper"}
    for one in tried.values():
        assert abs(one["after"] - one["before"]) >= 50 and abs(one["back"] - one["before"]) < 30
    servo = bench.arm.servos[3]
    assert servo.reached.highest - servo.reached.lowest > 150
    assert [bench.arm.servos[number].goals.lowest for number in (1, 2, 4, 5)] == [float("inf")] * 4
    assert not any(one.torque for one in bench.arm.servos.values()), "what was limp before is limp again"
    assert all(one["restored"] for one in tried.values())
    (folder,) = bench.project.attempts("step.arm")
    found = json.loads((folder / "trials.json").read_text())["trials"]
    assert all(len(item["readings"]) >= 3 for item in found)
    given = json.loads((folder / "input.json").read_text())
    assert given["device"]["id"] == DEVICE and (folder / "server.py").read_bytes() == bench.server.read_bytes()
    assert bench.is_in_sync()
    done = bench.project.run("apply", "-auto-approve", status=0)
    assert "0 added, 0 changed, 0 destroyed" in done.out
    assert len(bench.project.attempts("step.arm")) == 1


def test_a_step_without_a_device_is_skipped_and_no_agent_runs(bench: Bench) -> None:
    node = bench.project.nodes()["step.rail"]
    assert node["status"] == "accepted" and node["attempts"] == 0
    assert node["detail"]["skipped"] == "no device of this host is matched by the profile camera-rail"
    assert bench.project.attempts("step.rail") == []


def test_a_step_that_is_taken_out_of_the_manifest_goes(bench: Bench) -> None:
    done = bench.steps("arm")
    assert done.status == 0 and "STEP-NOT-CORROBORATED" not in done.codes()
    assert "step.rail" not in bench.project.nodes()
    assert [path.name for path in (bench.project.state / "steps").iterdir()] == ["arm"]
    assert bench.is_in_sync()


def test_a_servo_that_acknowledges_and_does_not_move_fails_the_step_and_the_endpoint_stays(bench: Bench) -> None:
    bench.arm.servos[3].fault = "stuck"
    done = bench.project.run("apply", "-auto-approve", "--json", "-replace", "step.arm")
    bench.arm.servos[3].fault = None
    assert done.status == 1 and "STEP-NOT-MOVED" in done.codes()
    summary = "elbow_flex did not move: 3080 raw before, goal 2880, 3080 after; at least 50 were wanted"
    assert summary in done.out
    node = bench.project.nodes()["step.arm"]
    assert node["status"] == "failed" and node["detail"]["failure"]["diagnostics"][0]["code"] == "STEP-NOT-MOVED"
    found = bench.project.run("status").text
    assert "out of sync, degraded" in found and "the hardware test of step.arm failed" in found
    assert "shoulder_pan" in bench.project.run("call", "arm_status", status=0).out
    assert bench.steps("arm").status == 0 and bench.is_in_sync()


def test_a_step_whose_agent_leaves_no_report_fails_whatever_an_earlier_run_has_left(bench: Bench) -> None:
    """Reports of earlier runs lie in the state and in the folders of their attempts; none of them counts again."""
    report = (bench.project.state / "steps" / "arm" / "output.json").read_bytes()
    assert any((each / "output.json").is_file() for each in bench.project.attempts("step.arm"))
    for ending, code in (("pass", "ARTIFACT-MISSING"), ("raise SystemExit(3)", "APPLY-AGENT-FAILED")):
        agent = f"{{name: command, command: {json.dumps([sys.executable, '-c', ending])}}}"
        done = bench.steps("arm", harness=agent)
        assert done.status == 1 and code in done.codes(), done.text
        node = bench.project.nodes()["step.arm"]
        assert node["status"] == "failed", ending
        assert not (bench.project.attempts("step.arm")[-1] / "output.json").exists()
        assert not bench.is_in_sync()
    assert (bench.project.state / "steps" / "arm" / "output.json").read_bytes() == report
    assert bench.steps("arm").status == 0 and bench.is_in_sync()


MOVE = "return ArmMoveJointAnswer(**units.move(joint, position, speed))"


def test_a_rewritten_server_that_is_proved_takes_the_accepted_ones_place(bench: Bench) -> None:
    before, runs = bench.project.nodes(), len(bench.project.attempts("deploy"))
    source = bench.server.read_text()
    rewritten = "moved = units.move(joint, position, speed)\n    return ArmMoveJointAnswer(**moved)"
    done = bench.steps("arm", harness=bench.rewriting((MOVE, rewritten)))
    assert done.status == 0, done.text
    nodes = bench.project.nodes()
    assert bench.server.read_text() == source.replace(MOVE, rewritten)
    assert (bench.project.attempts("step.arm")[-1] / "runtime" / "units.py").is_file(), "what the code uses"
    assert nodes["serve"]["detail"]["rewritten"]["by"] == "step.arm"
    assert nodes["serve"]["key"] == before["serve"]["key"]
    assert nodes["serve"]["output_digest"] != before["serve"]["output_digest"]
    assert nodes["deploy"]["key_parts"]["input.serve"] == nodes["serve"]["output_digest"]
    assert len(bench.project.attempts("deploy")) == runs
    published = json.loads((bench.project.local / "endpoint" / "connection.json").read_text())
    assert published["server"]["path"] == str(bench.server)
    assert not (bench.project.local / "candidate").exists()
    assert (bench.project.local / "former-server.py").read_text() == source
    assert bench.is_in_sync()


def test_a_rewrite_that_fails_its_proof_or_goes_too_far_changes_nothing(bench: Bench) -> None:
    source = bench.server.read_text()
    limp = bench.rewriting(('before=(("torque", 1), ', 'before=(("torque", 0), '))
    done = bench.steps("arm", harness=limp)
    assert done.status == 1, done.text
    assert "STEP-NOT-MOVED" in done.codes()
    assert bench.server.read_text() == source
    published = json.loads((bench.project.local / "endpoint" / "connection.json").read_text())
    assert published["server"]["path"] == str(bench.server)
    done = bench.steps("arm", harness=bench.rewriting(('FastMCP("', 'FastMCP("my-')))
    assert done.status == 1 and "STEP-REWRITE-BEYOND" in done.codes(), done.text
    assert bench.steps("arm").status == 0 and bench.is_in_sync()
    assert bench.server.read_text() == source
