"""A recording holds the last accepted run of each stage, and nothing of the host on which it was made."""

import copy
import json
import re
from pathlib import Path
from typing import Any

import pytest
from attempt_folders import Folders

from octoform.apply.stage.artifact_writer import pseudonym_key, text_of
from octoform.contracts.host_identity import instances, pseudonymise
from octoform.diagnostics import Diagnostic, error, to_json
from octoform.engine.inspect.attempts import of_host
from octoform.engine.recording import Recorded, record, runs
from octoform.harness import transcript
from octoform.harness.port import AgentEvent, Output, ToolCalled
from octoform.harness.recording import Recording, load
from octoform.state.artifact_cache import write_instances
from octoform.state.attempts import SpecEdit

SERIAL, ADDRESS, HOST = "QX-77120-B", "02:00:5e:10:00:01", "lab-machine-4"
PROBE: dict[str, Any] = {
    "format": 1,
    "platform": {"os": "linux", "arch": "x86_64"},
    "hostname": HOST,
    "scan_methods": [{"name": "sysfs", "status": "ok"}],
    "devices": [
        {
            "id": "usb-1234-0001",
            "name": "lamp",
            "interface": "usb",
            "raw_descriptor": f"lamp {SERIAL}",
            "instance": {"serial": SERIAL, "address": ADDRESS},
        }
    ],
}
TOKEN = "sk-abcdefghijklmnopqrstuvwx"
REFUSED: dict[str, Any] = {"diagnostics": [to_json(error("PROBE-SERIAL-IN-ID", "no"))]}


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    """A project with an accepted PROBE whose real instances are known on this machine."""
    made = Folders(tmp_path / "project")
    made.accept("probe", text_of(pseudonymise(PROBE, pseudonym_key(made.layout))))
    assert write_instances(made.layout, instances(PROBE)) == []
    return made


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "recording"


def made(folders: Folders, target: Path, first: int = 1, environ: dict[str, str] | None = None) -> Recorded:
    found, problems = record(folders.project, environ or {}, target, first)
    assert found is not None, problems
    return found


def problem(folders: Folders, target: Path, environ: dict[str, str] | None = None) -> Diagnostic:
    found, problems = record(folders.project, environ or {}, target)
    assert found is None
    return next(item for item in problems if item.severity == "error")


def loaded(target: Path) -> Recording:
    found = load(target)
    assert isinstance(found, Recording), found
    return found


def chosen(folders: Folders, first: int = 1) -> dict[str, list[int]]:
    found = runs(of_host(folders.layout), first)
    return {stage: [item.number for item in items] for stage, items in found.items()}


def test_the_latest_accepted_run_of_each_stage(folders: Folders) -> None:
    folders.add("probe", 1, accepted=True)
    folders.add("identify", 1)
    folders.add("identify", 2, accepted=True)
    folders.add("probe", 1)
    folders.add("probe", 2, accepted=True)
    folders.add("identify", 1)
    folders.add("identify", 2)
    assert chosen(folders) == {"probe": [4, 5], "identify": [2, 3]}


def test_a_run_that_was_cut_short_or_cleared_away_is_none(folders: Folders) -> None:
    folders.add("probe", 2, accepted=True)
    folders.add("identify", 1, accepted=True)
    folders.add("identify", 1, record=False)
    folders.add("identify", 2, accepted=True)
    folders.add("serve", 1, record=False)
    folders.add("serve", 1, accepted=True)
    assert chosen(folders) == {"identify": [2], "serve": [6]}


def test_an_escalation_is_no_run_of_the_stage(folders: Folders) -> None:
    folders.add("identify", 1, accepted=True)
    folders.add("identify", 1, role="escalate")
    folders.add("identify", 2, role="escalate", accepted=True)
    assert chosen(folders) == {"identify": [1]}


def test_from_leaves_out_what_began_before(folders: Folders) -> None:
    folders.add("probe", 1)
    folders.add("probe", 2, accepted=True)
    folders.add("identify", 1, accepted=True)
    assert chosen(folders, 2) == {"identify": [3]}


def test_outputs_failures_and_what_the_agent_did(folders: Folders, target: Path) -> None:
    folders.add("probe", 1, output=b"{", reason="crashed", exit_status=-9, detail="it broke", **REFUSED)
    folders.add(
        "probe",
        2,
        output=text_of(PROBE),
        accepted=True,
        turns=4,
        model="openai/x",
        usage={"input_tokens": 5, "cost_usd": 0.25, "cost_source": "manifest"},
        events=[ToolCalled("bash", "ls")],
    )
    found = made(folders, target)
    assert (dict(found.stages), found.files) == ({"probe": 2}, 4)
    first, second = loaded(target).stages["probe"]
    assert (first.reason, first.exit_status, first.refused) == ("crashed", -9, ["PROBE-SERIAL-IN-ID"])
    assert (target / "probe-1/output.json").read_bytes() == b"{"
    assert (target / "probe-2/output.json").read_bytes() == folders.layout.output("probe").read_bytes()
    assert (second.turns, second.model, second.usage.cost_source) == (4, "openai/x", "manifest")
    assert transcript.read(target / "probe-2/transcript.jsonl")[0].event == ToolCalled("bash", "ls")
    assert not list(target.rglob("agent.log"))


def test_nothing_of_the_host_is_in_it(folders: Folders, target: Path) -> None:
    bad = copy.deepcopy(PROBE)
    bad["devices"][0]["id"] = f"usb-1234-{SERIAL.lower()}"
    where = folders.layout.attempts / "000001-probe-1"
    lines = [
        f"serial {SERIAL} and {SERIAL.lower()} at {ADDRESS}",
        f"cd {where} && ls {folders.project}/state/bench {folders.layout.local}/log /home/alice/x",
        f"root@{HOST}: up",
        "x" * 195 + SERIAL[:5],
    ]
    edit: dict[str, Any] = {"spec_edit": SpecEdit(digest="x", permitted=True, added=1, removed=0)}
    folders.add("probe", 1, output=text_of(bad), events=[*map(Output, lines)], detail=f"in {where}", **REFUSED)
    folders.add(
        "probe", 2, output=text_of(PROBE), spec=f"# {SERIAL} in {folders.project}\n", events=[], accepted=True, **edit
    )
    made(folders, target, environ={"HOME": "/home/alice"})
    text = "".join(path.read_text() for path in target.rglob("*") if path.is_file())
    for secret in (SERIAL, SERIAL.lower(), ADDRESS, HOST, str(folders.project), "/home/alice"):
        assert secret not in text, secret
    assert SERIAL[:5] not in text, "a remnant at the end of a text that was cut"
    for placeholder in (
        "{workdir}",
        "{project}/state/{host}",
        "{project}/.octoform/{host}/log",
        "{home}/x",
        "@redacted-",
    ):
        assert placeholder in text, placeholder
    refused = json.loads((target / "probe-1/output.json").read_text())["devices"][0]
    assert refused["id"].endswith(refused["instance"]["serial"].lower())


def test_a_short_name_of_the_host_is_hidden_in_what_was_said(folders: Folders, target: Path) -> None:
    lines: list[AgentEvent] = [
        ToolCalled("bash", "echo PI4 && ssh root@pi4 uptime"),
        Output("apis and pi42 are other words, pi4-x too"),
    ]
    folders.add("probe", 1, output=text_of({**PROBE, "hostname": "pi4"}), events=lines, accepted=True)
    made(folders, target)
    found = [transcript.text_of(item.event) for item in transcript.read(target / "probe-1/transcript.jsonl")]
    shown = [re.sub(r"redacted-[0-9a-f]{10}", "{name}", text) for text in found]
    assert shown == ["echo {name} && ssh root@{name} uptime", "apis and pi42 are other words, pi4-x too"]


def test_equal_runs_are_equal_bytes(folders: Folders, target: Path, tmp_path: Path) -> None:
    folders.add("probe", 1, output=text_of(PROBE), accepted=True, events=[Output(SERIAL)])
    made(folders, target)
    made(folders, tmp_path / "again")
    assert contents(target) == contents(tmp_path / "again")


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_what_was_no_file_is_recorded_as_such(folders: Folders, target: Path) -> None:
    (folders.add("probe", 1, **REFUSED) / "output.json").symlink_to("/etc/passwd")
    with (folders.add("probe", 2, **REFUSED) / "output.json").open("wb") as file:
        file.truncate(9 << 20)
    folders.add("probe", 3, **REFUSED)
    folders.add("probe", 4, output=text_of(PROBE), accepted=True)
    made(folders, target)
    left = [item.output for item in loaded(target).stages["probe"]]
    assert [item.kind if item is not None else None for item in left] == ["link", "large", None, "file"]


def test_what_the_agent_said_is_cleaned_of_secrets(folders: Folders, target: Path) -> None:
    names = "version: 1\nhost: bench\nharness: {name: command, command: [agent], env: [BENCH_LOGIN]}\n"
    (folders.project / "octopus.yaml").write_text(names)
    events = [Output(f"with {TOKEN}"), Output("and a-plain-password")]
    folders.add("probe", 1, output=text_of(PROBE), accepted=True, events=events)
    made(folders, target, environ={"BENCH_LOGIN": "a-plain-password"})
    text = (target / "probe-1/transcript.jsonl").read_text()
    assert TOKEN not in text and "a-plain-password" not in text
    assert "redacted" in text


@pytest.mark.parametrize("value", [TOKEN, "a-plain-password", "a-plain-passwor\\u0064"])
def test_a_refused_output_with_a_secret_stops_it(folders: Folders, target: Path, value: str) -> None:
    names = "version: 1\nhost: bench\nharness: {name: command, command: [agent], env: [BENCH_LOGIN]}\n"
    (folders.project / "octopus.yaml").write_text(names)
    folders.add("probe", 1, output=f'{{"x": "{value}"}}'.encode(), **REFUSED)
    folders.add("probe", 2, output=text_of(PROBE), accepted=True)
    found = problem(folders, target, {"BENCH_LOGIN": "a-plain-password"})
    assert found.code == "RECORD-SECRET"
    assert "plain" not in f"{found}" and TOKEN not in f"{found}"
    assert not target.exists()


def test_an_instance_in_a_spelling_that_was_not_found_stops_it(folders: Folders, target: Path) -> None:
    spelt = "".join(f"\\u{ord(sign):04x}" for sign in SERIAL)
    folders.add("probe", 1, output=f'{{"x": "{spelt}"}}'.encode(), **REFUSED)
    folders.add("probe", 2, output=text_of(PROBE), accepted=True)
    found = problem(folders, target)
    assert (found.code, found.path) == ("RECORD-PERSONAL", "probe-1/output.json")
    assert SERIAL not in f"{found}"
    assert not target.exists()


def test_a_stage_without_a_run_is_left_out_and_said(folders: Folders, target: Path) -> None:
    folders.add("probe", 1, output=text_of(PROBE), accepted=True)
    found, problems = record(folders.project, {}, target)
    assert found is not None
    assert {item.code for item in problems} == {"RECORD-INCOMPLETE"}
    assert len(problems) == 4


def test_nothing_to_record(folders: Folders, target: Path) -> None:
    folders.add("probe", 1)
    assert problem(folders, target).code == "RECORD-NOTHING"


def test_an_artifact_that_is_gone_is_said(folders: Folders, target: Path) -> None:
    folders.add("probe", 1, output=text_of(PROBE), accepted=True)
    folders.layout.output("probe").unlink()
    assert problem(folders, target).code == "ARTIFACT-MISSING"


def test_a_recording_is_replaced_as_a_whole(folders: Folders, target: Path) -> None:
    folders.add("probe", 1, output=b"{", **REFUSED)
    folders.add("probe", 2, output=text_of(PROBE), accepted=True)
    made(folders, target)
    folders.add("probe", 1, output=text_of(PROBE), accepted=True)
    made(folders, target)
    assert sorted(contents(target)) == ["probe-1/output.json", "recording.json"]
    assert [path.name for path in target.parent.iterdir() if "octoform-tmp" in path.name] == []


@pytest.mark.parametrize("kind", ["foreign", "more", "file", "link", "linked"])
def test_nothing_else_is_overwritten(folders: Folders, target: Path, tmp_path: Path, kind: str) -> None:
    folders.add("probe", 1, output=text_of(PROBE), accepted=True)
    if kind in ("more", "link", "linked"):
        made(folders, target)
    if kind == "foreign":
        target.mkdir()
        (target / "thesis.md").write_text("mine\n")
    elif kind == "more":
        (target / "thesis.md").write_text("mine\n")
    elif kind == "file":
        target.write_text("mine\n")
    elif kind == "link":
        target.rename(tmp_path / "moved")
        target.symlink_to(tmp_path / "moved")
    else:
        (target / "notes").symlink_to(tmp_path)
    before = contents(target)
    assert problem(folders, target).code == "RECORD-FOLDER"
    assert contents(target) == before


def test_an_empty_folder_is_filled(folders: Folders, target: Path) -> None:
    folders.add("probe", 1, output=text_of(PROBE), accepted=True)
    target.mkdir()
    assert made(folders, target).files == 2
