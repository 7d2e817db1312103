"""Arm, rail and camera together: the embedded agent onboards them, the steps prove them, a real client drives them.

One live endpoint for the whole file. What counts is what the simulated firmware saw, and what the camera shows.
"""

import asyncio
import base64
import json
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from projects import OCTOFORM, Project

from octoform.endpoint.bounded_program import ForkServer, run
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.sdk_client import recorded_environment
from octoform.perception.capture import Picture, Taken, difference, take
from octoform.simulation.rig import Rig, load
from octoform.state.layout import Layout

pytestmark = pytest.mark.dear

TOP = Path(__file__).parents[2]
ARM, RAIL, CAMERA = "usb-1a86-55d3", "usb-2341-804f", "usb-045e-0772"
TRANSACTIONS, CALLS = 300, 10
"""Packets of all together, and calls of each client: without the lock of the bus the first ten calls spoil some."""
SIZE = {"width": 320, "height": 240}
LARGEST_ENDPOINT = 120_000
"""KiB resident after a picture: what a board of 1 GB has room for; the library of the camera alone takes 40,000."""
STAGES = ("probe", "identify", "interface", "serve", "deploy")
STEPS = ("step.perceive", "step.arm", "step.rail")


@dataclass
class Bench:
    project: Project
    rig: Rig

    @property
    def layout(self) -> Layout:
        return Layout(self.project.folder, self.project.host)

    def client(self) -> Client[Any]:
        """An MCP client that starts octoform as any client does."""
        words = [f"-chdir={self.project.folder}", "connect", self.project.host]
        transport = StdioTransport(str(OCTOFORM), words, env=self.project.environment(), keep_alive=False)
        return Client(transport)

    def ask(self, *calls: tuple[str, dict[str, Any]]) -> list[Any]:
        """The structured results of these calls, one after the other, of one client."""

        async def talk() -> list[Any]:
            async with self.client() as client:
                return [(await client.call_tool(tool, given)).structured_content for tool, given in calls]

        return asyncio.run(talk())

    def picture(self) -> Picture:
        """What the camera shows through the endpoint, as small as it is compared."""
        taken = take(self.layout, ToolCall("capture_image", SIZE))
        assert isinstance(taken, Taken), taken
        return taken.picture


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("rig")
    description = load("reference")
    for name, changes in {"arm": {"speedup": 8}, "rail": {"speedup": 8}, "camera": SIZE}.items():
        description["devices"][name] |= changes
    rig = Rig(description, folder / "tree")
    rig.start()
    project = Project(folder / "project", folder / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(folder / "tree")
    project.manifest = {
        "profiles": "[profiles/so-arm101.md, profiles/camera-rail.md]",
        "answers": f"{{{RAIL}: the camera rail of the bench}}",
        "privileged_steps": "[perceive, arm, rail]",
    }
    (project.folder / "profiles").mkdir(parents=True)
    for name in ("so-arm101.md", "camera-rail.md"):
        (project.folder / "profiles" / name).write_text((TOP / "profiles" / name).read_text())
    project.share_environments(packaged("feetech-servo-sdk", "opencv-python-headless"))
    project.apply(status=0)
    yield Bench(project, rig)
    project.run("stop")
    rig.stop()


def test_all_stages_and_steps_at_the_first_attempt_and_nothing_left_to_do(bench: Bench) -> None:
    nodes = bench.project.nodes()
    assert {name: nodes[name]["attempts"] for name in (*STAGES, *STEPS)} == dict.fromkeys((*STAGES, *STEPS), 1)
    assert "No changes." in bench.project.run("plan", "-detailed-exitcode", status=0).out
    moved = [item["unit"] for item in nodes["step.arm"]["detail"]["trials"]]
    assert sorted(moved) == ["elbow_flex", "gripper", "shoulder_lift", "shoulder_pan", "wrist_flex", "wrist_roll"]
    assert all(abs(item["after"] - item["before"]) >= 50 for item in nodes["step.arm"]["detail"]["trials"])
    assert [item["unit"] for item in nodes["step.rail"]["detail"]["trials"]] == ["x", "y"]
    chosen = json.loads((bench.project.state / "steps" / "perceive" / "output.json").read_text())
    assert chosen["camera"]["device"] == CAMERA


def test_the_tools_of_the_rail_are_its_grammar(bench: Bench) -> None:
    tools = json.loads((bench.project.state / "interface" / "output.json").read_text())["tools"]
    of_rail = {tool["name"]: tool for tool in tools if tool["devices"] == [RAIL]}
    assert set(of_rail) == {"rail_move_x", "rail_move_y", "rail_home", "rail_position", "rail_stop"}
    assert bench.rig.line is not None
    before = len(bench.rig.line.lines)
    bench.ask(("rail_home", {}), ("rail_move_x", {"steps": 120}), ("rail_move_y", {"steps": -80}))
    assert bench.rig.line.lines[before:] == ["HOME", "MOVE_X 120", "MOVE_Y -80"]
    assert bench.rig.line.position == {"X": 120, "Y": -80}
    assert bench.ask(("rail_position", {}))[0] == {"device": RAIL, "x": 120, "y": -80, "unknown": None}


def test_a_real_client_moves_both_and_the_camera_sees_it(bench: Bench) -> None:
    assert bench.rig.servos is not None and bench.rig.line is not None
    bench.ask(("rail_home", {}), ("arm_home", {}))
    first, still = bench.picture(), bench.picture()
    noise = difference(first, still)
    (found,) = bench.ask(("arm_move_joint", {"joint": "shoulder_lift", "position": 1600}))
    assert found["moved"] and abs(bench.rig.servos.servos[2].position - 1600) < 30
    bent = bench.picture()
    assert difference(still, bent) > 3 * noise
    bench.ask(("rail_move_x", {"steps": 1500}))
    assert bench.rig.line.position["X"] == 1500
    assert difference(bent, bench.picture()) > 3 * noise
    bench.ask(("rail_home", {}), ("arm_home", {}))
    assert difference(first, bench.picture()) < difference(first, bent) / 2


def test_two_clients_and_the_heartbeat_at_once_spoil_no_packet(bench: Bench) -> None:
    arm = bench.rig.servos
    assert arm is not None
    before, spoilt = arm.received, arm.broken

    async def reads(tool: str, given: dict[str, Any]) -> int:
        async with bench.client() as client:
            done = 0
            while arm.received - before < TRANSACTIONS or done < CALLS:
                done += not (await client.call_tool(tool, given)).is_error
            return done

    def looks(*clients: Future[int]) -> int:
        seen = 0
        while seen < 4 or not all(each.done() for each in clients):
            seen += bool(bench.picture())
        return seen

    with ThreadPoolExecutor(3) as pool:
        status = pool.submit(asyncio.run, reads("arm_status", {}))
        joint = pool.submit(asyncio.run, reads("arm_read_joint", {"joint": "gripper"}))
        beats = pool.submit(looks, status, joint)
        assert status.result() >= CALLS and joint.result() >= CALLS and beats.result() > 3
    assert arm.received - before >= TRANSACTIONS
    assert arm.broken == spoilt and arm.noise == 0


def test_its_pictures_are_looked_into_by_forks_that_have_the_library_loaded(bench: Bench, tmp_path: Path) -> None:
    assert bench.picture()
    environment = recorded_environment(bench.layout)
    assert environment is not None
    script = tmp_path / "script.py"
    script.write_text("import sys; print(*sorted({'cv2', 'fastmcp'} & {*sys.modules}))")
    words = [str(environment.python), "-I", str(script)]
    server = ForkServer.at(environment.python, "pictures")
    ended = run(words, cwd=tmp_path, environment={}, timeout=30.0, fork_server=server)
    assert (ended.status, ended.stdout) == (0, "cv2\n")


def test_a_picture_leaves_its_library_in_a_process_that_ends_and_the_endpoint_small(bench: Bench) -> None:
    assert bench.picture()
    pid = json.loads(bench.project.run("status", "-json").out)["process"]["pid"]
    mapped = {Path(line.split()[-1]).name for line in Path(f"/proc/{pid}/maps").read_text().splitlines()}
    assert not [name for name in mapped if "cv2" in name or "opencv" in name]
    resident = Path(f"/proc/{pid}/status").read_text().partition("VmRSS:")[2].split()[0]
    assert int(resident) < LARGEST_ENDPOINT


def test_look_saves_what_the_camera_shows(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "now.jpg"
    found = json.loads(bench.project.run("look", "-save", str(file), "--json", status=0).out)
    assert file.read_bytes()[:2] == b"\xff\xd8", base64.b64encode(file.read_bytes()[:8])
    assert found["camera"] == CAMERA or found["camera"]["device"] == CAMERA


def test_a_camera_that_does_not_show_what_is_before_it_ends_an_apply(bench: Bench) -> None:
    camera, project = bench.rig.camera, bench.project
    assert camera is not None
    project.manifest["budget"] = "{attempts: 1}"  # a frozen one is looked at for some seconds in each
    project.write()
    try:
        for fault, code in {"black": "STEP-PICTURE-EMPTY", "frozen": "STEP-PICTURE-FROZEN"}.items():
            camera.fault = None
            camera.write()  # what freezes is a picture of the bench
            camera.fault = fault
            camera.write()
            done = project.run("apply", "-auto-approve", "-replace", "step.perceive")
            assert done.status == 1 and code in done.err and "Apply complete" not in done.out, done.text
    finally:
        camera.fault = None
        camera.write()
        del project.manifest["budget"]
    project.apply(status=0)


def test_it_is_found_again_under_other_names(bench: Bench) -> None:
    for name, node in (("arm", "ttyACM7"), ("rail", "ttyACM3"), ("camera", "video4")):
        bench.rig.unplug(name)
        bench.rig.plug(name, port=bench.rig.description["devices"][name]["port"], node=node)
    assert "No changes." in bench.project.run("plan", "-detailed-exitcode", status=0).out
    moved, _, at = bench.ask(
        ("arm_move_joint", {"joint": "5", "position": 2300}), ("rail_home", {}), ("rail_position", {})
    )
    assert moved["moved"] and at["x"] == 0
    assert bench.picture()
