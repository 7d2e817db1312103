"""A state that cannot be trusted is one clear error and stays as it is; two runs at once never mix."""

import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from projects import Project

MERGED = b"<<<<<<< HEAD\n%s=======\n{}\n>>>>>>> other\n"

DAMAGE = [
    pytest.param(lambda data: data[: len(data) // 2], "STATE-TRUNCATED", id="truncated"),
    pytest.param(lambda data: data.replace(b'"format": 1', b'"format": 99'), "STATE-NEWER", id="newer"),
    pytest.param(lambda data: MERGED % data, "STATE-CONFLICT", id="conflict markers"),
]


@pytest.fixture(scope="module")
def applied(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("applied")
    made = Project(folder / "project", folder / "outside")
    made.apply("-target", "identify", status=0)
    return made


@pytest.mark.parametrize(("damage", "code"), DAMAGE)
def test_a_damaged_state_is_one_error_and_nothing_is_lost(
    applied: Project, damage: Callable[[bytes], bytes], code: str
) -> None:
    path = applied.state / "state.json"
    good = path.read_bytes()
    runs = len(applied.agent_runs())
    try:
        path.write_bytes(damage(good))
        before = path.read_bytes()
        for command in (("plan",), ("apply", "-auto-approve")):
            done = applied.run(*command, status=1)
            assert f"error[{code}]" in done.err
            assert done.err.count("error[") == 1
            assert "help:" in done.err
        health, status = applied.run("health"), applied.run("status")
        assert health.status == status.status == 6, "one verdict, whether a plan can be made or not"
        assert f"error[{code}]" in status.err and "host bench: not compared, unknown" in status.out
        found = json.loads(applied.run("status", "-json", status=6).out)
        assert (found["in_sync"], found["health"]) == (None, "unknown") and found["diagnostics"][0]["code"] == code
        assert path.read_bytes() == before
        assert (applied.state / "probe" / "output.json").exists()
    finally:
        path.write_bytes(good)
    assert len(applied.agent_runs()) == runs


def test_two_applies_that_race_for_the_lock_never_mix(project: Project) -> None:
    project.apply("-target", "probe", status=0)
    serial = json.loads((project.state / "state.json").read_bytes())["serial"]
    arguments = ("apply", "-auto-approve", "-target", "probe", "-replace", "probe")
    done_well, last = 0, serial
    for _ in range(3):
        with ThreadPoolExecutor(2) as pool:
            both = list(pool.map(lambda _: project.run(*arguments), range(2)))
        statuses = [done.status for done in both]
        assert set(statuses) <= {0, 1}
        assert 0 in statuses
        assert all(done.status == 0 or "error[STATE-LOCKED]" in done.err for done in both)
        done_well += statuses.count(0)
        snapshot = json.loads((project.state / "state.json").read_bytes())
        assert snapshot["nodes"]["probe"]["status"] == "accepted"
        # Two runs of one second and one duration leave the same content, which is no new serial.
        assert last <= snapshot["serial"] <= serial + done_well
        last = snapshot["serial"]
    assert len(project.agent_runs()) == 1 + done_well


def test_artifacts_that_are_no_json_any_more_are_told_by_every_command(project: Project) -> None:
    project.apply("-target", "interface", status=0)
    (project.state / "identify" / "output.json").write_text('{"devices": [')
    (project.state / "interface" / "output.json").write_text('{"devices": [{"id": 7}]}')
    plan = project.run("plan", "-target", "interface", status=0)
    assert plan.out.count("edited by hand") == 2
    for command in (("status",), ("tools",), ("show",), ("state", "show", "identify")):
        assert project.run(*command).status in ((6,) if command == ("status",) else (0, 1))
    done = project.run("state", "adopt", "identify", status=1)
    assert done.err.count("error[") == 1
    project.run("apply", "-auto-approve", "-target", "probe", status=0)
    project.apply("-target", "interface", status=0)
    assert "No changes" in project.run("plan", "-target", "interface", status=0).out


def test_f39_bytes_of_any_kind_in_the_log_blind_nobody(project: Project) -> None:
    project.apply("-target", "probe", status=0)
    log = project.local / "log" / "octoform.jsonl"
    with log.open("ab") as file:
        file.write(b'\xff\xfe{"event": "call", "tool": "\x80"}\nnot json at all\n\x00\n')
    project.apply("-target", "identify", status=0)
    assert project.run("status").status == 6, "nothing is applied yet"
    assert Path(log).read_bytes().count(b"\xff\xfe") == 1
