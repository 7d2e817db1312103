"""What an attempt after a failed one knows of it, and what an agent can find out before it ends."""

import json
import shlex
from pathlib import Path

import pytest
from projects import AGENT, Project

GOOD = AGENT.parent / "good"
WRONG = [[["devices", 0, "capabilities", 0, "effect"], "sometimes"]]


@pytest.fixture
def project(tmp_path: Path, environments: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.share_environments(environments)
    made.outside.mkdir(parents=True, exist_ok=True)
    return made


def prompt(folder: Path) -> str:
    return (folder / "prompt.md").read_text()


def test_a_retry_gets_the_refused_output_and_is_told_that_the_rest_of_it_was_right(project: Project) -> None:
    project.script = {"identify": [{"mutate": WRONG}, "good"]}
    project.apply(status=0)
    first, second = project.attempts("identify")
    assert (second / "former-output.json").read_bytes() == (first / "output.json").read_bytes()
    assert not (first / "former-output.json").exists()
    said = " ".join(prompt(second).split())
    assert "A copy of the last output that was judged is former-output.json" in said
    assert "What no finding below is about was right: keep that" in said
    assert "/devices/0/capabilities/0/effect" in said
    assert "former-output.json" not in json.loads((second / "attempt.json").read_text())["files"]


def test_an_attempt_that_nobody_judged_leaves_nothing_to_correct(project: Project) -> None:
    project.script = {"identify": [{"mutate": WRONG, "exit": 7}, "good"]}
    project.apply(status=0)
    second = project.attempts("identify")[-1]
    assert not (second / "former-output.json").exists()
    assert "you start afresh" in prompt(second)


def test_what_a_trial_found_stands_until_the_next_trial_however_many_servers_are_refused(project: Project) -> None:
    good = (GOOD / "server.py").read_text()
    dead = good.replace("round(value / 1000, digits)", "__time.no_such_clock(digits)")
    dead = dead.replace("return Temperature", "import time\n\n        return Temperature").replace("__time", "time")
    assert "time.no_such_clock" in dead and "import time" in dead
    (project.outside / "dead.py").write_text(dead)
    (project.outside / "refused.py").write_text("eval('1')\n" + good)
    project.script = {
        "serve": [{"copy": str(project.outside / "dead.py")}],
        "serve:told": [{"copy": str(project.outside / "refused.py")}, {"shell": "cp former-server.py seen"}],
    }
    project.apply(status=0)
    first, told, last = project.attempts("serve")
    assert "ENDPOINT-TOOL-BROKEN" not in prompt(first)
    assert "ENDPOINT-TOOL-BROKEN" in prompt(told) and "no_such_clock" in (told / "former-server.py").read_text()
    assert "ENDPOINT-TOOL-BROKEN" in prompt(last), "nobody has tried another one yet"
    assert "Why the earlier attempt was refused" in prompt(last) and "eval" in prompt(last)
    assert (last / "seen").read_text() == (project.outside / "refused.py").read_text()


def checked(project: Project) -> list[str]:
    """What `./check` printed for a wrong output, and for the good one, and its statuses."""
    wrong, right = project.outside / "wrong.json", GOOD / "identify.json"
    document = json.loads(right.read_text())
    document["devices"][0]["capabilities"][0]["effect"] = "sometimes"
    wrong.write_text(json.dumps(document))
    lines = [f"cp {shlex.quote(str(wrong))} output.json", "./check > first.txt || echo status $? >> first.txt"]
    lines += [f"cp {shlex.quote(str(right))} output.json", "./check > second.txt && echo status 0 >> second.txt"]
    project.script = {"identify": [{"shell": "\n".join(lines)}]}
    project.apply(status=0)
    (folder,) = project.attempts("identify")
    return [
        path.read_text()
        for path in sorted(folder.glob("*.txt"))
        if path.name in ("first.txt", "second.txt", "third.txt")
    ]


def test_an_agent_can_hold_its_output_against_the_contract_before_it_ends(project: Project) -> None:
    first, second = checked(project)
    assert "it would be refused (29 more checks)" in first and first.endswith("status 1\n")
    assert "/devices/0/capabilities/0/effect" in first
    assert "it would be accepted" in second and second.endswith("status 0\n")
    (folder,) = project.attempts("identify")
    assert json.loads((folder / "attempt.json").read_text())["checks"] == 2
    assert "./check" in prompt(folder)
