"""What an attempt after a failed one knows of it, and what an agent can find out before it ends."""

import hashlib
import json
import shlex
import time
from pathlib import Path
from typing import Any

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


def changed() -> Any:
    document = json.loads((GOOD / "identify.json").read_text())
    document["devices"][0]["capabilities"][0]["effect"] = "sometimes"
    return document


def prompt(folder: Path) -> str:
    return (folder / "prompt.md").read_text()


def test_a_retry_gets_the_refused_output_and_is_told_that_the_rest_of_it_was_right(project: Project) -> None:
    project.script = {"identify": [{"mutate": WRONG}, "good"]}
    project.apply("-target", "identify", status=0)
    first, second = project.attempts("identify")
    assert (second / "former-output.json").read_bytes() == (first / "output.json").read_bytes()
    assert not (first / "former-output.json").exists()
    text = " ".join(prompt(second).split())
    assert "A copy of the last output that was judged is former-output.json" in text
    assert "Keep everything that no finding below is about: it was right" in text
    assert "/devices/0/capabilities/0/effect" in text
    assert "former-output.json" not in json.loads((second / "attempt.json").read_text())["files"]


def test_an_attempt_that_left_nothing_leaves_nothing_to_correct(project: Project) -> None:
    project.script = {"identify": [{"exit": 7}, "good"]}
    project.apply("-target", "identify", status=0)
    second = project.attempts("identify")[-1]
    assert not (second / "former-output.json").exists()
    assert "start afresh" in prompt(second)


def test_a_changed_input_gives_the_accepted_output_as_a_draft_with_what_has_changed(project: Project) -> None:
    other = {"mutate": [[["devices", 0, "capabilities", 0, "description"], "The temperature of the board."]]}
    project.apply("-target", "interface", status=0)
    former = project.state / "interface" / "output.json"
    accepted = former.read_bytes()
    project.script = {"identify": [other], "interface": [{"exit": 7}, "good"]}
    project.apply("-replace", "identify", "-target", "identify", "-target", "interface", status=0)
    first, left_nothing, last = project.attempts("interface")
    requested = project.attempts("identify")[-1]
    for folder in (first, requested):
        assert not (folder / "former-output.json").exists() and "former" not in prompt(folder).split("# Spec")[0]
        assert json.loads((folder / "attempt.json").read_text())["changed"] == []
    changes = ["the output of IDENTIFY is another one", "devices: hwmon-benchtemp differs in capabilities"]
    for folder in (left_nothing, last):
        assert (folder / "former-output.json").read_bytes() == accepted
        assert "```text data=changed\n" + "\n".join(changes) + "\n```" in prompt(folder)
        record = json.loads((folder / "attempt.json").read_text())
        assert record["changed"] == changes
        assert record["digests"]["former-output.json"] == f"sha256:{hashlib.sha256(accepted).hexdigest()}"
    assert "a draft, and no source" in prompt(left_nothing) and "# Spec" in prompt(left_nothing)
    assert "failed and left no output" in prompt(last) and "start afresh" not in prompt(last)


POINTER = "/devices/0/capabilities/0/effect"
UNFINISHED: dict[str, dict[str, Any]] = {
    "crashed": {"exit": 7},
    "out of time": {"sleep": 60},
    "killed": {"shell": "kill -9 $PPID"},
}


@pytest.mark.parametrize("ending", UNFINISHED)
def test_what_an_attempt_wrote_that_did_not_end_well_is_judged_and_handed_on(project: Project, ending: str) -> None:
    """And it is remembered when the next attempt leaves nothing at all."""
    project.manifest["budget"] = "{attempts: 4, attempt_timeout: 3s}"
    wrong = project.outside / "wrong.json"
    wrong.write_text(json.dumps(changed()))
    writing = f"cp {shlex.quote(str(wrong))} output.json"
    first = {**UNFINISHED[ending], "shell": f"{writing}; {UNFINISHED[ending].get('shell', '')}"}
    empty = {"exit": 3, "shell": "rm -f output.json"}
    project.script = {"identify": [first, empty, {"write": "{"}, "good"]}
    project.apply("-target", "identify", status=0)
    _, second, third, fourth = project.attempts("identify")
    assert json.loads((second / "former-output.json").read_text()) == changed()
    for folder in (second, third):
        text = " ".join(prompt(folder).split())
        assert POINTER in text, folder
        assert "No finding is about" in text and "0 of 1 devices" not in text
    assert "APPLY-AGENT-FAILED" in prompt(third) and json.loads((third / "former-output.json").read_text()) == changed()
    listed = json.loads((third / "task.json").read_text())["diagnostics"]
    assert [item["code"] for item in listed].count("APPLY-AGENT-FAILED") == 1 and len(listed) > 1
    assert (fourth / "former-output.json").read_text() == "{"
    text = " ".join(prompt(fourth).split())
    assert "It could not be read as a whole" in text and POINTER not in text


def test_a_right_output_of_an_attempt_that_was_stopped_is_said_to_be_right_and_not_accepted(project: Project) -> None:
    project.manifest["budget"] = "{attempts: 2, attempt_timeout: 3s}"
    copied = f"cp {shlex.quote(str(GOOD / 'identify.json'))} output.json; sleep 60"
    project.script = {"identify": [{"shell": copied}, {"shell": "cp former-output.json output.json"}]}
    project.apply("-target", "identify", status=0)
    second = project.attempts("identify")[-1]
    assert project.nodes()["identify"]["attempts"] == 2
    assert "Nothing is wrong with it, as far as that shows without running it" in " ".join(prompt(second).split())


def test_an_output_with_a_key_in_it_is_handed_to_nobody(project: Project) -> None:
    project.environ, project.env = {"OCTOFORM_TEST_KEY": "sk-Zx81kd93KLmq77"}, ["OCTOFORM_TEST_KEY"]
    project.script = {"identify": [{"leak": "OCTOFORM_TEST_KEY", "exit": 7}, "good"]}
    project.apply("-target", "identify", status=0)
    second = project.attempts("identify")[-1]
    assert not (second / "former-output.json").exists() and "sk-Zx81kd93KLmq77" not in prompt(second)


def test_what_a_trial_found_stands_until_the_next_trial_however_many_servers_are_refused(project: Project) -> None:
    good = (GOOD / "server.py").read_text()
    dead = good.replace("round(value / 1000, digits)", "__time.no_such_clock(value, digits)")
    dead = dead.replace("return Temperature", "import time\n\n        return Temperature").replace("__time", "time")
    assert "time.no_such_clock" in dead and "import time" in dead
    (project.outside / "dead.py").write_text(dead)
    (project.outside / "refused.py").write_text("eval('1')\n" + good)
    project.script = {
        "serve": [{"copy": str(project.outside / "dead.py")}],
        "serve:told": [{"copy": str(project.outside / "refused.py")}, {"shell": "cp former-server.py seen"}],
    }
    project.apply(status=0)
    first, found, last = project.attempts("serve")
    assert "ENDPOINT-TOOL-BROKEN" not in prompt(first)
    assert "ENDPOINT-TOOL-BROKEN" in prompt(found) and "no_such_clock" in (found / "former-server.py").read_text()
    assert "ENDPOINT-TOOL-BROKEN" in prompt(last), "no one has tried another one yet"
    assert "Why the earlier attempt was rejected" in prompt(last) and "eval" in prompt(last)
    assert (last / "seen").read_text() == (project.outside / "refused.py").read_text()


def checked(project: Project) -> list[str]:
    """What `./check` printed for a wrong output, and for the good one, and its statuses."""
    wrong, right = project.outside / "wrong.json", GOOD / "identify.json"
    wrong.write_text(json.dumps(changed()))
    lines = [f"cp {shlex.quote(str(wrong))} output.json", "./check > first.txt || echo status $? >> first.txt"]
    lines += [f"cp {shlex.quote(str(right))} output.json", "./check > second.txt && echo status 0 >> second.txt"]
    project.script = {"identify": [{"shell": "\n".join(lines)}]}
    project.apply("-target", "identify", status=0)
    (folder,) = project.attempts("identify")
    return [
        path.read_text()
        for path in sorted(folder.glob("*.txt"))
        if path.name in ("first.txt", "second.txt", "third.txt")
    ]


def test_an_agent_can_hold_its_output_against_the_contract_before_it_ends(project: Project) -> None:
    first, second = checked(project)
    assert "it would be refused (29 checks left)" in first and first.endswith("status 1\n")
    assert "/devices/0/capabilities/0/effect" in first
    assert "it would be accepted" in second and second.endswith("status 0\n")
    (folder,) = project.attempts("identify")
    assert json.loads((folder / "attempt.json").read_text())["checks"] == 2
    assert "./check" in prompt(folder)


def test_what_the_check_says_of_an_output_has_no_key_in_it(project: Project) -> None:
    key = "sk-Zx81kd93KLmq77aa"
    project.environ, project.env = {"OCTOFORM_TEST_KEY": key}, ["OCTOFORM_TEST_KEY"]
    wrong = project.outside / "wrong.json"
    wrong.write_text(json.dumps(changed()).replace("sometimes", "KEY"))
    lines = [
        f'sed "s/KEY/$OCTOFORM_TEST_KEY/" {shlex.quote(str(wrong))} > output.json',
        "./check > first.txt || true",
        f"cp {shlex.quote(str(GOOD / 'identify.json'))} output.json",
    ]
    project.script = {"identify": [{"shell": "\n".join(lines)}]}
    project.apply("-target", "identify", status=0)
    (folder,) = project.attempts("identify")
    said = (folder / "first.txt").read_text()
    assert "it would be refused" in said and "APPLY-SECRET-IN-OUTPUT" in said and POINTER in said
    assert key not in said


def digest(data: bytes) -> str:
    return f"sha256:{hashlib.sha256(data).hexdigest()}"


def test_the_record_has_the_digests_of_what_was_given_whatever_the_agent_made_of_it(project: Project) -> None:
    names = ("prompt.md", "task.json", "spec.md", "former-output.json")
    spoiling = "; ".join(f"chmod u+w {name}; cp {name} seen-{name}; echo spoilt > {name}" for name in names)
    project.script = {"identify": [{"mutate": WRONG}, {"shell": spoiling}]}
    project.apply("-target", "identify", status=0)
    folder = project.attempts("identify")[-1]
    recorded = json.loads((folder / "attempt.json").read_text())["digests"]
    for name in names:
        assert recorded[name] == digest((folder / f"seen-{name}").read_bytes()), name
    assert recorded["input"] == digest((project.state / "probe" / "output.json").read_bytes())
    assert recorded["output.json"] == digest((folder / "output.json").read_bytes())
    assert set(recorded) == {*names, "input", "schema", "output.json", "agent.log", "transcript.jsonl"}


def test_the_time_of_a_stage_holds_for_its_trial_too(project: Project) -> None:
    good = (GOOD / "server.py").read_text().replace("from typing", "import time\nfrom typing", 1)
    (project.outside / "slow.py").write_text(good.replace("    with bus(", "    time.sleep(15)\n    with bus(", 1))
    project.script = {"serve": [{"copy": str(project.outside / "slow.py")}]}
    project.apply("-target", "serve", status=0)
    project.manifest["stages"] = "{deploy: {budget: {stage_timeout: 6s, attempts: 3}}}"
    began = time.monotonic()
    done = project.apply("-target", "deploy", status=1)
    assert "APPLY-BUDGET-SPENT" in done.codes()
    assert project.stages_run().count("deploy") == 1
    assert time.monotonic() - began < 15


def test_no_record_of_an_attempt_has_a_key_that_its_agent_wrote_anywhere(project: Project) -> None:
    key = "sk-Zx81kd93KLmq77aa"
    project.environ, project.env = {"OCTOFORM_TEST_KEY": key}, ["OCTOFORM_TEST_KEY"]
    shell = (
        "touch named-$OCTOFORM_TEST_KEY; mkdir $OCTOFORM_TEST_KEY; touch $OCTOFORM_TEST_KEY/x; echo $OCTOFORM_TEST_KEY"
    )
    project.script = {
        "identify": [
            {"shell": shell, "echo": "OCTOFORM_TEST_KEY", "exit": 7},
            {"edit_spec": f"use {key}", "echo": "OCTOFORM_TEST_KEY", "sleep": 60},
            {"mutate": [[["devices", 0, "capabilities", 0, "effect"], key]]},
            "good",
        ]
    }
    project.manifest["budget"] = "{attempts: 4, attempt_timeout: 3s}"
    done = project.apply("-target", "identify", status=0)
    assert key not in done.text
    kept = [path for folder in project.attempts("identify") for path in folder.glob("*") if path.is_file()]
    holding = {path.name for path in kept if key.encode() in path.read_bytes()}
    assert holding <= {"spec.md", "output.json"}, "what the agent wrote into its own folder, and nothing of octoform's"
    assert key.encode() not in project.local.joinpath("log", "octoform.jsonl").read_bytes()


def test_the_state_names_system_program_and_specs_of_each_output(project: Project) -> None:
    again = {"mutate": [[["devices", 0, "identified_as"], "Heron thermometer"]]}
    project.script = {"identify": [{"exit": 3}, again, "good"]}
    project.manifest = {"stages": "{probe: {harness: builtin}}"}
    project.apply("-target", "identify", status=0)
    probe = json.loads((project.state / "probe" / "output.json").read_text())
    nodes = project.nodes()
    for name in ("probe", "identify"):
        assert nodes[name]["platform"] == probe["platform"]
        assert nodes[name]["specs"].startswith("sha256:")
    assert nodes["probe"]["program"].startswith("octoform ")
    assert (nodes["identify"]["harness"], nodes["identify"]["attempts"]) == ("command", 3)
