"""A camera, serial boards and a sensor in other ports under other names: nothing to plan, and the next call works."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from projects import Project
from replugged import ANSWERS, BOARD, CAMERA, SENSOR, TWIN, Host, script

pytestmark = pytest.mark.dear


@dataclass
class Bench:
    """The live project and the host that it looks at."""

    project: Project
    host: Host

    def call(self, tool: str, board: str = "") -> tuple[int, str]:
        """Exit status, and what the tool answered or why it did not."""
        arguments = ["-arg", f"device={board}"] if board else []
        done = self.project.run("call", tool, *arguments)
        return done.status, json.loads(done.out)["text"] if done.status == 0 else done.err

    def record(self) -> tuple[int, bytes, list[str], list[str]]:
        """What would change if an agent had run or an artifact moved."""
        state = (self.project.state / "state.json").read_bytes()
        attempts = sorted(path.name for path in (self.project.local / "attempts").iterdir())
        return json.loads(state)["serial"], state, attempts, self.project.stages_run()

    def devices(self) -> dict[str, dict[str, object]]:
        """Where `octoform devices` sees each device now."""
        listed = json.loads(self.project.run("devices", "--json", status=0).out)["devices"]
        return {row["id"]: row["now"] for row in listed}


def plug_in(host: Host) -> None:
    """Everything in the port in which PROBE saw it, and nothing else."""
    host.clear()
    host.camera("1-1", 0)
    host.board("1-2", "ttyUSB0", "left")
    host.board("1-3", "ttyUSB1", "right")
    host.sensor("1-4", 2, "21500")


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Iterator[Bench]:
    """One live endpoint for all."""
    folder = tmp_path_factory.mktemp("replug")
    host = Host(folder / "root")
    plug_in(host)
    project = Project(folder / "project", folder / "outside", script=script())
    project.environ["OCTOFORM_SYSROOT"] = str(host.tree.root)
    project.manifest |= {"stages": "{probe: {harness: builtin}}", "answers": ANSWERS}
    project.share_environments(environments)
    project.apply(status=0)
    yield Bench(project, host)
    project.run("stop", status=0)
    host.clear()


@pytest.fixture
def bench(served: Bench) -> Bench:
    """The live host with everything in its port."""
    plug_in(served.host)
    return served


def test_all_answer_where_probe_saw_them(bench: Bench) -> None:
    assert bench.call("capture_image") == (0, "a frame")
    assert bench.call("read_temperature") == (0, "21500")
    assert bench.call("ask_board", BOARD) == (0, "left NAME")
    assert bench.call("move_board", TWIN) == (0, "right STEP")


def test_in_other_ports_under_other_names_they_answer_without_plan_or_agent(bench: Bench) -> None:
    before = bench.record()
    for port in ("1-1", "1-2", "1-4"):
        bench.host.unplug(port)
    bench.host.camera("1-7", 5)
    bench.host.board("1-8", "ttyUSB4", "left")
    bench.host.sensor("1-9", 0, "22750")
    plan = bench.project.run("plan", "-detailed-exitcode", status=0)
    assert "No changes" in plan.out
    assert bench.call("capture_image") == (0, "a frame")
    assert bench.call("read_temperature") == (0, "22750")
    assert bench.call("ask_board", BOARD) == (0, "left NAME")
    # Its twin is where it was, so the one that moved is known by what is left.
    assert bench.call("move_board", BOARD) == (0, "left STEP")
    assert bench.record() == before
    now = bench.devices()
    assert (now[CAMERA]["port"], now[CAMERA]["nodes"], now[CAMERA]["strength"]) == ("1-7", ["/dev/video5"], "strong")
    assert (now[BOARD]["port"], now[BOARD]["nodes"]) == ("1-8", ["/dev/ttyUSB4"])
    assert now[SENSOR]["port"] == "1-9"
    assert now[TWIN] == {
        "attached": True,
        "port": "1-3",
        "strength": "positional",
        "nodes": ["/dev/ttyUSB1"],
        "doubt": "",
        "refused": [],
    }


def test_twins_that_may_be_swapped_are_refused_for_an_actuator_and_positional_for_a_reader(bench: Bench) -> None:
    before = bench.record()
    for port in ("1-2", "1-3"):
        bench.host.unplug(port)
    bench.host.board("1-5", "ttyUSB6", "right")
    bench.host.board("1-6", "ttyUSB7", "left")
    for board in (BOARD, TWIN):
        status, found = bench.call("move_board", board)
        assert status == 1
        assert "may be any of 2 equal devices (1-5, 1-6)" in found
        assert "octoform apply -replace probe" in found
    assert [bench.call("ask_board", board) for board in (BOARD, TWIN)] == [(0, "right NAME"), (0, "left NAME")]
    assert "No changes" in bench.project.run("plan", "-detailed-exitcode", status=0).out
    assert bench.record() == before
    shown = bench.project.run("devices", "-v", status=0).out
    assert "in doubt" in shown
    assert "may be any of 2 equal devices" in shown


def test_under_each_others_names_in_their_ports_they_are_themselves(bench: Bench) -> None:
    for port in ("1-2", "1-3"):
        bench.host.unplug(port)
    bench.host.board("1-2", "ttyUSB1", "left")
    bench.host.board("1-3", "ttyUSB0", "right")
    assert bench.call("move_board", BOARD) == (0, "left STEP")
    assert bench.call("move_board", TWIN) == (0, "right STEP")


def test_one_of_two_twins_that_goes_is_seen_by_the_plan(bench: Bench) -> None:
    bench.host.unplug("1-3")
    assert bench.call("move_board", BOARD) == (0, "left STEP")
    plan = bench.project.run("plan", "-detailed-exitcode", status=2)
    assert "- USB device 1f00:00b1" in plan.out
