"""kill -9 at the points where something becomes durable: the next apply completes, and no agent runs in vain."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import warm
from projects import Done, Project

CRASHING = Path(__file__).parent / "crashing.py"
NODES = {"probe": ("probe",), "identify": ("probe", "identify")}
SLICES = 2
CHANGES = ("written", "renamed", "cleared")
"""How the points are called behind which something else stands on the disk than at the point before: what a killed
process has written stays, synced or not. `make faults` kills at the others too (EVERY_POINT)."""


def crash(project: Project, target: str, limit: int) -> Done:
    words = (str(project.folder), target, str(limit))
    return Done(*warm.run(CRASHING, words, project.folder, project.environment(), 60))


@dataclass(frozen=True)
class Whole:
    """Applies that were not killed: where another one is killed, and what they accepted.

    Durable points of an apply of one stage, and those of a second stage, whose run begins with another's record.
    """

    points: list[tuple[str, int, str]]
    """The target, the number of the point in an apply of it, and the point's name: those of these tests."""
    digests: dict[str, str]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    folder = tmp_path_factory.mktemp("whole")
    passed = {}
    for target in NODES:
        project = Project(folder / target, folder / "outside")
        project.write()
        done = crash(project, target, 0)
        assert done.status == 0, done.err
        passed[target] = [(target, number, name) for number, name in enumerate(done.out.split(), 1)]
    begins, ends = (
        [number for _, number, name in passed["identify"] if name == which][1]
        for which in ("journal.begin.start", "journal.success.synced")
    )
    names = [name for _, _, name in passed["probe"]]
    assert len(set(names)) == len(names) >= 20
    assert set(names) == {name for _, _, name in passed["identify"]}
    points = [*passed["probe"], *passed["identify"][begins - 1 : ends]]
    changes = [point for point in points if point[2].endswith(CHANGES)]
    assert len(changes) >= 13
    return Whole(
        points if os.environ.get("EVERY_POINT") else [points[0], *changes],
        {name: node["output_digest"] for name, node in project.nodes().items()},
    )


@pytest.mark.parametrize("part", range(SLICES))
def test_kill_at_a_durable_point_leaves_a_state_that_the_next_apply_completes(
    whole: Whole, part: int, tmp_path: Path
) -> None:
    # Whatever points there are, the slices hold all of them together.
    for target, limit, name in whole.points[part::SLICES]:
        project = Project(tmp_path / f"{target}{limit}", tmp_path / f"{target}{limit}-outside")
        project.write()
        done = crash(project, target, limit)
        assert done.status == -signal.SIGKILL, done.err
        assert done.out.split()[-1] == name
        project.run("apply", "-auto-approve", "-target", target, status=0)
        nodes = project.nodes()
        accepted = {name: whole.digests[name] for name in NODES[target]}
        assert {name: node["output_digest"] for name, node in nodes.items()} == accepted, done.out
        assert {node["status"] for node in nodes.values()} == {"accepted"}
        assert not [path for path in project.folder.rglob("*") if "octoform-tmp" in path.name]


def test_f11_a_killed_orchestrator_leaves_no_agent_that_could_write_later(project: Project) -> None:
    project.script = {"probe": [{"write": '{"half', "sleep": 120}]}
    project.write()
    process = project.start("apply", "-auto-approve", "-target", "probe")
    deadline = time.monotonic() + 30
    while not project.agent_runs() and time.monotonic() < deadline:
        time.sleep(0.02)
    agent = project.agent_runs()[0]["pid"]
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=10)
    while Path(f"/proc/{agent}").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not Path(f"/proc/{agent}").exists()
    project.script = {}
    project.apply("-target", "probe", status=0)
    assert project.nodes()["probe"]["status"] == "accepted"
    assert len(project.agent_runs()) == 2


def test_f10_two_applies_at_once_the_second_is_refused_by_name(project: Project) -> None:
    project.script = {"probe": [{"sleep": 120}]}
    project.write()
    first = project.start("apply", "-auto-approve", "-target", "probe")
    deadline = time.monotonic() + 30
    while not project.agent_runs() and time.monotonic() < deadline:
        time.sleep(0.02)
    second = project.run("apply", "-auto-approve", "-target", "probe", status=1)
    assert "STATE-LOCKED" in second.err
    assert str(first.pid) in second.err
    assert project.run("plan").status == 0
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=30)
    assert first.returncode == 130
    project.script = {}
    project.apply("-target", "probe", status=0)


def test_f41_an_artifact_edited_by_hand_is_made_again(project: Project) -> None:
    project.apply("-target", "interface", status=0)
    path = project.state / "identify" / "output.json"
    good = path.read_bytes()
    path.write_bytes(good.replace(b"0.9", b"0.8"))
    plan = project.run("plan", "-target", "interface", "-detailed-exitcode", status=2)
    assert "edited by hand" in plan.out
    project.apply("-target", "interface", status=0)
    assert path.read_bytes() == good
    assert [run["stage"] for run in project.agent_runs()].count("interface") == 1


def test_f40_an_artifact_replaced_by_a_link_is_never_followed(project: Project, tmp_path: Path) -> None:
    project.apply("-target", "identify", status=0)
    path = project.state / "identify" / "output.json"
    foreign = tmp_path / "foreign.json"
    foreign.write_bytes(path.read_bytes())
    path.unlink()
    path.symlink_to(foreign)
    project.apply("-target", "identify", status=0)
    assert not path.is_symlink()
    assert foreign.exists()
