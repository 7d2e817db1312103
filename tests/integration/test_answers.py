"""Zero or one question: what evidence cannot settle is asked once, and one sentence settles it.

The host is a bench with two serial boards that nothing identifies; the embedded agent works on it up to
INTERFACE, since no server is needed to see what a sentence changes.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from projects import Done, Project
from terminals import Terminal

from octoform.state.layout import Layout
from octoform.state.store.lock import acquire

BOARD, OTHER = "usb-1a86-7523", "usb-1a86-7523-2"
SENTENCE = "the Heron dosing pump on the left of the bench"
MANIFEST = """\
# the bench

version: 1        # of the format
host: bench
profiles: [profiles/pump.md]   # what we know
# before the budget
budget:
    attempts: 1   # it is quick
# the end
"""
PROFILE = """\
---
name: heron-pump
about: the dosing pump of the Heron bench
evidence: {all: [{vid_pid: "1a86:7523"}, {text: [Heron dosing pump]}]}
---

It doses one millilitre a turn.
"""
UP_TO = ("-target", "interface")


@pytest.fixture
def bench(project: Project, planted: Callable[..., Path]) -> Project:
    """The bench with a commented manifest and a profile that holds by a name."""
    project.environ["OCTOFORM_SYSROOT"] = str(planted("bench"))
    (project.folder / "profiles").mkdir()
    (project.folder / "profiles" / "pump.md").write_text(PROFILE)
    (project.folder / "octopus.yaml").write_text(MANIFEST)
    return project


def apply(project: Project, *arguments: str) -> list[dict[str, Any]]:
    return project.run("apply", "-auto-approve", "-json", *UP_TO, *arguments, status=0).events()


def plan(project: Project, *arguments: str) -> list[dict[str, Any]]:
    return project.run("plan", "-json", *UP_TO, *arguments, status=0).events()


def of(events: list[dict[str, Any]], kind: str, field: str) -> list[dict[str, Any]]:
    return [event[field] for event in events if event["type"] == kind]


def asked(events: list[dict[str, Any]]) -> list[str]:
    return [question["device"] for question in of(events, "open_question", "question")]


def identified(project: Project) -> dict[str, dict[str, Any]]:
    value = json.loads((project.state / "identify" / "output.json").read_text())
    return {device["id"]: device for device in value["devices"]}


def manifest(project: Project) -> str:
    return (project.folder / "octopus.yaml").read_text()


def test_one_sentence_settles_a_device_and_changes_nothing_else(bench: Project) -> None:
    result = of(apply(bench), "run_summary", "result")[0]
    assert [item["device"] for item in result["questions"]] == [BOARD, OTHER]
    assert {item["tier"] for item in result["questions"]} == {2}
    assert all(item["sentence"].count("?") <= 1 for item in result["questions"])
    assert identified(bench)[BOARD]["category"] == "unknown"
    near = {"profile": "heron-pump", "device": BOARD, "word": "Heron dosing pump"}
    assert of(plan(bench), "profile_near", "near") == [near, {**near, "device": OTHER}]
    assert f"heron-pump will match {BOARD}, {OTHER} after this answer:" in bench.run("plan", *UP_TO, status=0).out

    found = bench.run("answer", BOARD, SENTENCE, status=0).out
    assert f'+   {BOARD}: "{SENTENCE}"' in found
    assert "octoform plan" in found
    assert manifest(bench) == f'{MANIFEST}answers:\n  {BOARD}: "{SENTENCE}"\n'

    events = plan(bench)
    moved = {item["node"]: item for item in of(events, "planned_change", "change")}
    assert [reason["part"] for reason in moved["identify"]["reasons"]] == [f"answer.{BOARD}"]
    assert {name: item["certain"] for name, item in moved.items()} == {"identify": True, "interface": False}
    assert of(events, "profile_use", "use") == [{"profile": "heron-pump", "device": BOARD, "action": "create"}]
    assert asked(events) == [OTHER]
    text = bench.run("plan", *UP_TO, status=0).out
    assert f'answer {BOARD}: new: "{SENTENCE}"' in text
    assert f"heron-pump will match {BOARD}" in text
    assert f"? {OTHER}" in text

    before = identified(bench)
    apply(bench)
    after = identified(bench)
    assert (after[BOARD]["method"], after[BOARD]["profile"]) == ("profile", "heron-pump")
    assert {name: device for name, device in after.items() if name != BOARD} == {
        name: device for name, device in before.items() if name != BOARD
    }
    events = plan(bench)
    assert of(events, "planned_change", "change") == []
    known = {item["device"]: item for item in of(events, "known_device", "known")}
    assert known[BOARD]["tier"] == 2
    assert known[BOARD]["answer"] == SENTENCE
    assert known["usb-1d9c-5e12"]["tier"] == 1


def test_a_name_without_a_profile_is_a_name_and_no_tool(bench: Project) -> None:
    apply(bench)
    bench.run("answer", BOARD, "the tide gauge", status=0)
    apply(bench)
    device = identified(bench)[BOARD]
    assert (device["identified_as"], device["method"], device["capabilities"]) == ("tide gauge", "user_answer", [])
    interface = json.loads((bench.state / "interface" / "output.json").read_text())
    left_out = next(item for item in interface["left_out"] if item["id"] == BOARD)
    assert left_out["reason"] == "no_standard_interface"
    assert f"octoform profile new {BOARD}" in left_out["detail"]

    taken = bench.run("answer", "-remove", BOARD, "-json", status=0)
    assert json.loads(taken.out)["before"] == "the tide gauge"
    assert manifest(bench) == MANIFEST + "answers: {}\n"
    apply(bench)
    assert identified(bench)[BOARD]["category"] == "unknown"


def refused(done: Done) -> tuple[str, str]:
    found = json.loads(done.out)["diagnostics"][0]
    return found["code"], found.get("hint") or ""


def test_what_cannot_be_written_is_refused_and_nothing_changes(bench: Project) -> None:
    nothing_known = bench.run("answer", BOARD, "a pump", "-json", status=1)
    assert refused(nothing_known)[0] == "ANSWER-NO-PROBE"
    apply(bench, "-target", "identify")
    for arguments, code, hint in (
        (("usb-1a86-7253", "a pump"), "ANSWER-UNKNOWN-DEVICE", BOARD),
        ((BOARD,), "ANSWER-NO-SENTENCE", "as an argument"),
        ((BOARD, "   "), "MANIFEST-WRONG-VALUE", "a sentence"),
        ((BOARD, "its key is sk-ant-api03-abcdefghijklmnopqrstuvwxyz0123456789"), "MANIFEST-SECRET", "environment"),
        (("-remove", BOARD), "ANSWER-NOT-THERE", "octoform answer"),
    ):
        found = refused(bench.run("answer", "-json", *arguments, status=1))
        assert found[0] == code
        assert hint in found[1]
    assert manifest(bench) == MANIFEST
    listed = json.loads(bench.run("answer", "-json", status=0).out)
    assert [item["device"] for item in listed["questions"]] == [BOARD, OTHER]
    assert listed["answers"] == {}


def test_an_answer_about_something_else_is_a_warning_each_time(bench: Project) -> None:
    (bench.folder / "octopus.yaml").write_text(f"{MANIFEST}answers: {{usb-1a86-7532: a pump}}\n")
    apply(bench)
    for _ in range(2):
        done = bench.run("plan", status=0)
        assert "PLAN-ANSWER-WITHOUT-DEVICE" in done.err
        assert re.search("did you mean usb-1a86-7523", done.err)


def test_tier_1_is_a_run_as_if_nobody_had_said_anything(bench: Project) -> None:
    (bench.folder / "octopus.yaml").write_text(f"{MANIFEST}answers: {{{BOARD}: {SENTENCE}}}\n")
    assert asked(plan(bench, "-tier1")) == []  # nothing is known yet
    apply(bench, "-tier1")
    assert identified(bench)[BOARD]["category"] == "unknown"
    state = json.loads((bench.state / "state.json").read_text())
    assert state["tier1"] is True
    assert not any(part.startswith(("answer.", "profile.")) for part in state["nodes"]["identify"]["key_parts"])
    assert "(-tier1)" in bench.run("plan", "-tier1", *UP_TO, status=0).out

    saved = bench.folder / "tier1.plan"
    apply(bench)
    assert identified(bench)[BOARD]["method"] == "profile"
    assert "tier1" not in json.loads((bench.state / "state.json").read_text())
    bench.run("plan", "-tier1", "-out", str(saved), *UP_TO, status=0)
    bench.run("apply", str(saved), status=0)
    assert identified(bench)[BOARD]["category"] == "unknown"


def test_a_profile_typed_into_the_manifest_is_the_same_input_as_its_file(bench: Project) -> None:
    bench.script = {"identify": [{"good": True}]}
    bench.harness = f"{bench.scripted()}"
    head = f"version: 1\nhost: bench\nharness: {bench.harness}\nstages: {{probe: {{harness: builtin}}}}\n"
    text = f"answers: {{{BOARD}: {SENTENCE}}}\n"
    (bench.outside / "script.json").write_text("{}")
    typed = "".join(f"    {line}\n" if line else "\n" for line in PROFILE.splitlines())
    for profiles in ("profiles: [profiles/pump.md]\n", f"profiles:\n  - |\n{typed}"):
        (bench.folder / "octopus.yaml").write_text(f"{head}{text}{profiles}budget: {{attempts: 1}}\n")
        # The scripted agent has no output for this host and is refused; its prompt is what counts.
        bench.run("apply", "-auto-approve", "-target", "identify", status=1)
    first, second = (folder / "prompt.md" for folder in bench.attempts("identify"))
    assert "It doses one millilitre a turn." in first.read_text()
    assert f"{BOARD}: {SENTENCE}" in first.read_text()
    assert second.read_text().replace(second.parent.name, first.parent.name) == first.read_text()
    tasks = [json.loads((folder / "task.json").read_text()) for folder in bench.attempts("identify")]
    assert tasks[0]["profiles"] == tasks[1]["profiles"] != []
    assert tasks[0]["answers"] == {BOARD: SENTENCE}


def test_a_problem_of_a_typed_profile_is_told_at_its_place(bench: Project) -> None:
    broken = PROFILE.replace("about:", "abuot:")
    typed = "".join(f"    {line}\n" for line in broken.splitlines())
    (bench.folder / "octopus.yaml").write_text(f"version: 1\nprofiles:\n  - |\n{typed}")
    text = bench.run("validate", status=1).err
    assert "octopus.yaml:6:12" in text
    assert "    abuot:" in text


def on_terminal(project: Project, *arguments: str) -> Terminal:
    return Terminal(project.folder, {**project.environment(), "NO_COLOR": "1"}, *arguments)


def test_ask_on_a_terminal_goes_on_with_what_was_said(bench: Project) -> None:
    terminal = on_terminal(bench, "apply", "-ask", "-auto-approve", "-target", "identify")
    terminal.wait_for(f"? {BOARD} (")
    terminal.wait_for("press Enter to pass over:")
    terminal.type(f"{SENTENCE}\n")
    terminal.wait_for(f"? {OTHER} (")
    terminal.type("\n")
    status, _ = terminal.end()
    assert status == 0
    assert manifest(bench) == f'{MANIFEST}answers:\n  {BOARD}: "{SENTENCE}"\n'
    assert identified(bench)[BOARD]["method"] == "profile"
    assert identified(bench)[OTHER]["category"] == "unknown"

    # What is still open is asked again by the next such run; Ctrl-C leaves everything as it is.
    terminal = on_terminal(bench, "apply", "-ask", "-auto-approve", "-target", "identify")
    terminal.wait_for("press Enter to pass over:")
    terminal.type("half a sen\x03")
    status, last = terminal.end()
    assert status == 130
    assert any("interrupted" in line for line in last)
    assert OTHER not in manifest(bench)

    terminal = on_terminal(bench, "answer", OTHER)
    terminal.wait_for("press Enter to pass over:")
    terminal.type("a spare\n")
    assert terminal.end()[0] == 0
    assert manifest(bench) == f'{MANIFEST}answers:\n  {BOARD}: "{SENTENCE}"\n  {OTHER}: "a spare"\n'


def test_without_a_terminal_nobody_is_asked_and_nothing_is_done(bench: Project) -> None:
    done = bench.run("apply", "-ask", "-auto-approve", status=1)
    assert "APPLY-ASK-NO-TERMINAL" in done.err
    assert refused(bench.run("apply", "-ask", "-json", "-auto-approve", status=1))[0] == "APPLY-ASK-NO-TERMINAL"
    assert "usage:" in bench.run("apply", "-ask", "-tier1", status=1).err
    assert not bench.state.exists()


def test_what_only_a_person_could_name_goes_to_the_second_agent(bench: Project) -> None:
    bench.script = {"identify": [{"name_all": "USB Serial"}]}
    bench.harness = "builtin"
    bench.manifest = {
        "stages": f"{{identify: {{escalate: {{harness: {bench.scripted()}}}}}}}",
        "answers": f"{{{BOARD}: a tide gauge}}",
    }
    bench.write()
    bench.run("apply", "-auto-approve", "-target", "identify", status=0)
    assert identified(bench)[BOARD]["identified_as"] == "USB Serial"
    task = json.loads((bench.attempts("identify")[1] / "task.json").read_text())
    assert task["answers"] == {BOARD: "a tide gauge"}
    assert "a tide gauge" in (bench.attempts("identify")[1] / "prompt.md").read_text()


def test_an_answer_waits_for_the_end_of_an_apply_which_would_undo_it(bench: Project) -> None:
    apply(bench)
    bench.run("answer", BOARD, SENTENCE, status=0)
    before = manifest(bench)
    acquired = acquire(Layout(bench.folder, "bench"), "apply")
    assert acquired.lock is not None
    with acquired.lock:
        for command in (("answer", OTHER, SENTENCE), ("answer", "-remove", BOARD), ("profile", "new", OTHER)):
            done = bench.run(*command)
            assert done.status == 1 and "error[STATE-LOCKED]: the state of bench is locked: apply" in done.err, command
    assert manifest(bench) == before
    assert [path.name for path in (bench.folder / "profiles").iterdir()] == ["pump.md"]
    bench.run("answer", OTHER, SENTENCE, status=0)


def test_what_acts_needs_a_profile_where_the_answer_gives_no_limits(bench: Project) -> None:
    (bench.folder / "octopus.yaml").write_text(MANIFEST.replace("profiles: [profiles/pump.md]", "profiles: []"))
    apply(bench)
    for sentence, needs in (("a robot arm with servos", True), ("a robot arm, 0 to 4095, STOP stops it", False)):
        bench.run("answer", BOARD, sentence, status=0)
        apply(bench)
        assert (f"profile new {BOARD} drafts" in bench.run("devices", "-v", status=0).out) == needs
