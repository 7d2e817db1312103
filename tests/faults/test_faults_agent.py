"""Agents that write odd outputs, odd logs and odd processes; each through the real command line."""

import json
import time
from pathlib import Path

import pytest
from projects import Project

GOOD_PROBE = Path(__file__).parents[1] / "agent" / "good" / "probe.json"
TWO_GIGABYTES = 2 << 30


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


ODD = [
    pytest.param({"sparse": TWO_GIGABYTES}, {"ARTIFACT-TOO-LARGE", "APPLY-AGENT-FAILED"}, id="two gigabytes"),
    pytest.param({"bytes": "7b226e616d65223a22ff227d"}, {"ARTIFACT-NOT-UTF8"}, id="not UTF-8"),
    pytest.param({"bytes": b"[".hex() * 100_000}, {"ARTIFACT-TOO-DEEP", "ARTIFACT-NOT-JSON"}, id="very deep"),
]


@pytest.mark.parametrize(("behaviour", "codes"), ODD)
def test_an_odd_output_is_refused_by_name_and_the_next_attempt_counts(
    project: Project, behaviour: dict[str, object], codes: set[str]
) -> None:
    project.script = {"probe": [behaviour, "good"]}
    started = time.monotonic()
    done = project.apply("-target", "probe", status=0)
    assert set(done.codes()) & codes
    assert time.monotonic() - started < 30
    assert project.nodes()["probe"]["attempts"] == 2


def test_twenty_children_left_behind_are_all_gone(project: Project) -> None:
    project.script = {"probe": [{"children": 20, "copy": str(GOOD_PROBE)}]}
    project.apply("-target", "probe", status=0)
    pids = json.loads((project.attempts("probe")[0] / "children.json").read_text())
    assert len(pids) == 20
    assert not [pid for pid in pids if alive(pid)]


def test_f37_f38_a_line_of_20_mb_and_bytes_of_no_encoding_make_a_bounded_prompt(project: Project) -> None:
    project.script = {"probe": [{"flood": 20_000_000, "shout": "80fffe1b5b33316d00e2", "exit": 1}, "good"]}
    project.apply("-target", "probe", status=0)
    first, second = project.attempts("probe")
    assert (first / "agent.log").stat().st_size <= (16 << 20) + 1000
    prompt = (second / "prompt.md").read_bytes()
    assert len(prompt) <= 48 * 1024
    prompt.decode("utf-8")
    assert b"\x1b" not in prompt
    assert b"\x00" not in prompt


@pytest.mark.parametrize("kind", ["pipe", "link"])
def test_an_agent_that_replaces_its_spec_by_something_else_hangs_and_misleads_nobody(
    project: Project, kind: str, tmp_path: Path
) -> None:
    foreign = tmp_path / "foreign.md"
    foreign.write_text("nothing of yours\n")
    project.script = {"probe": [{"replace_spec": [kind, str(foreign)], "exit": 1}, "good"]}
    project.apply("-target", "probe", status=0)
    second = (project.attempts("probe")[1] / "spec.md").read_text()
    assert second.startswith("---\nstage: probe")
    assert foreign.read_text() == "nothing of yours\n"


HUGE = "1" + "0" * 400
"""A whole number of JSON that no float holds."""


def test_a_cost_that_no_float_holds_is_no_cost(project: Project) -> None:
    usage = f'{{"input_tokens": 5, "output_tokens": 7, "cost_usd": {HUGE}}}'
    project.script = {"probe": [{"shell": f"echo '{usage}' > usage.json", "copy": str(GOOD_PROBE)}]}
    project.apply("-target", "probe", status=0)
    assert project.nodes()["probe"]["usage"].get("cost_usd") is None
