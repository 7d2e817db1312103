"""What `octoform coverage` finds on disk: accepted artifacts, kept attempts, and what stands in their way."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from attempt_folders import Folders
from covered import STAMP, declared, identified, known, left, onboarded, seen

from octoform.cli.dispatch import dispatch
from octoform.engine import coverage as collect
from octoform.engine.coverage import CoverageReport
from octoform.engine.coverage_runs import grouped, runs
from octoform.engine.inspect.attempts import of_host
from octoform.state.accepted import file_digest
from octoform.state.model import NodeState, Snapshot, Status, Usage, encode

Artifacts = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def laptop(tmp_path_factory: pytest.TempPathFactory) -> Artifacts:
    from hosts.plant import plant

    return onboarded(plant("laptop", tmp_path_factory.mktemp("hosts") / "laptop"))


class Host:
    """A project whose state and attempts are written by hand."""

    def __init__(self, project: Path) -> None:
        self.folders = Folders(project)
        self.nodes: dict[str, NodeState] = {}

    def accept(self, artifacts: Artifacts, **more: Any) -> None:
        before = ""
        for stage, value in artifacts.items():
            self.folders.accept(stage, json.dumps(value).encode())
            parts = {f"input.{before}": f"sha256:{before}"} if before else {}
            self.nodes[stage] = NodeState(
                key_parts=parts,
                output_digest=f"sha256:{stage}",
                file_digest=file_digest(self.folders.layout, stage) or "",
                harness="builtin",
                attempts=1,
                accepted_at=STAMP,
                **more,
            )
            before = stage
        self.save()

    def save(self) -> None:
        snapshot = Snapshot(octoform="0", host="bench", lineage="one", nodes=self.nodes)
        self.folders.layout.snapshot.write_bytes(encode(snapshot))

    def add(self, stage: str, value: Any, attempt: int = 1, **fields: Any) -> Path:
        data = json.dumps(value).encode()
        return self.folders.add(stage, attempt, output=data, **{"accepted": True, "harness": "builtin", **fields})

    def report(self) -> CoverageReport:
        found, problems = collect.report(self.folders.project, {})
        assert found is not None, problems
        return found


@pytest.fixture
def host(tmp_path: Path) -> Host:
    return Host(tmp_path)


def with_camera(laptop: Artifacts, change: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    copy: dict[str, Any] = json.loads(json.dumps(laptop["identify"]))
    change(next(item for item in copy["devices"] if item["class"] == "camera"))
    return copy


def test_without_probe_there_is_a_clear_error(host: Host) -> None:
    report, problems = collect.report(host.folders.project, {})
    assert report is None
    assert [item.code for item in problems] == ["COVERAGE-NOTHING"]
    assert problems[0].hint == "octoform apply makes it"


def test_a_state_without_its_artifact_says_so(host: Host, laptop: Artifacts) -> None:
    host.accept({"probe": laptop["probe"]})
    host.folders.layout.output("probe").unlink()
    _, problems = collect.report(host.folders.project, {})
    assert "is gone" in problems[0].summary


def test_probe_alone_gives_a_report_that_says_what_is_missing(host: Host, laptop: Artifacts) -> None:
    host.accept({"probe": laptop["probe"]})
    report = host.report()
    assert (report.coverage.funnel.enumerated, report.coverage.funnel.annotated) == (25, None)
    assert report.stability is None
    assert report.notes == ("not there yet: IDENTIFY, INTERFACE, SERVE, DEPLOY; octoform apply makes it",)


def test_a_laptop_up_to_interface(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    report = host.report()
    funnel = report.coverage.funnel
    assert funnel.enumerated == len(laptop["probe"]["devices"])
    assert funnel.annotated == len(laptop["identify"]["devices"])
    assert funnel.tools == len(laptop["interface"]["tools"])
    assert report.platform == {"os": "linux", "arch": "x86_64", "os_id": "debian", "os_version": "12"}
    assert report.stability is not None and report.stability.runs == 1
    assert report.endpoint == "absent"
    assert [item.name for item in report.stages] == ["probe", "identify", "interface"]


def test_what_was_never_accepted_is_not_reported(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    host.nodes["identify"] = NodeState(status=Status.FAILED)
    host.save()
    report = host.report()
    assert report.coverage.funnel.annotated is None
    assert "IDENTIFY: its last run failed; nothing of it was accepted yet" in report.notes


def test_what_is_out_of_date_or_edited_is_said(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    host.nodes["probe"] = host.nodes["probe"].model_copy(update={"output_digest": "sha256:newer"})
    host.nodes["interface"] = host.nodes["interface"].model_copy(update={"status": Status.INTERRUPTED})
    host.save()
    host.folders.accept("interface", json.dumps(laptop["interface"], indent=2).encode())
    notes = host.report().notes
    assert "IDENTIFY: made from an earlier output of PROBE; octoform apply renews it" in notes
    assert "INTERFACE: its last run was interrupted; what was accepted before is shown" in notes
    assert "INTERFACE: its accepted output was edited by hand; what lies there is shown" in notes


def test_what_cannot_be_read_is_not_taken_for_what_never_was(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    host.folders.accept("identify", b"garbage")
    aside = "its accepted output is skipped, for it or what it rests on cannot be read; octoform apply makes it again"
    missing = "not there yet: SERVE, DEPLOY; octoform apply makes it"
    assert host.report().notes == (f"IDENTIFY: {aside}", f"INTERFACE: {aside}", missing)
    host.folders.layout.output("identify").unlink()
    assert "IDENTIFY: its accepted output is gone; octoform apply makes it again" in host.report().notes


def test_an_answer_counts_once_identify_was_made_with_it(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    manifest = host.folders.project / "octopus.yaml"
    manifest.write_text(manifest.read_text() + 'answers: {usb-1d9c-0c14: "my camera"}\n')
    camera = next(item for item in host.report().coverage.devices if item.id == "usb-1d9c-0c14")
    assert (camera.answered, camera.tier) == (False, 1)
    assert "answered since: usb-1d9c-0c14; octoform apply takes it into account" in host.report().notes
    parts = {**host.nodes["identify"].key_parts, "answer.usb-1d9c-0c14": "my camera"}
    host.nodes["identify"] = host.nodes["identify"].model_copy(update={"key_parts": parts})
    host.save()
    camera = next(item for item in host.report().coverage.devices if item.id == "usb-1d9c-0c14")
    assert (camera.answered, camera.tier) == (True, 2)
    assert not [note for note in host.report().notes if "answered" in note]


def test_three_runs_of_which_one_differs(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    other = with_camera(laptop, lambda item: item.update(identified_as="a lamp"))
    for value in (laptop["identify"], other, laptop["identify"]):
        host.add("probe", laptop["probe"])
        host.add("identify", value)
    stability = host.report().stability
    assert stability is not None
    assert (stability.runs, stability.compared, stability.same) == (3, 25, 24)
    (found,) = stability.disagreements
    assert found.device == "usb-1d9c-0c14"
    assert found.said == (("Kestrel HD Camera", 2), ("a lamp", 1))


def test_runs_that_were_given_something_else_are_not_compared(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    first = host.add("identify", with_camera(laptop, lambda item: item.update(identified_as="unknown camera")))
    (first / "task.json").write_text(json.dumps({"answers": {}, "profiles": [], "stage": "identify"}))
    answered = host.add("identify", laptop["identify"])
    (answered / "task.json").write_text(json.dumps({"answers": {"usb-1d9c-0c14": "a camera"}}))
    stability = host.report().stability
    assert stability is not None
    assert (stability.runs, stability.skipped, stability.disagreements) == (1, 1, ())


def test_an_output_without_the_shape_of_its_stage_is_passed_over(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    host.add("identify", {"devices": "none", "left_out": 7})
    host.add("identify", laptop["identify"])
    stability = host.report().stability
    assert stability is not None and stability.runs == 1


def test_a_second_agents_words_stand_in_place_of_the_firsts(host: Host) -> None:
    first = identified([known("adapter", "unknown", missing="What is it?", identified_as="an adapter")])
    for device in first["devices"]:
        device["evidence"] = [{"quote": "adapter"}]
    second = json.loads(json.dumps(first))
    second["devices"][0].update(category="actuator", identified_as="a rail")
    probe = {"id": "adapter", "name": "adapter", "interface": "usb", "raw_descriptor": "adapter"}
    scans = [{"name": "usb", "status": "ok"}]
    whole = {"format": 1, "platform": {"os": "x", "arch": "y"}, "scan_methods": scans, "devices": [probe]}
    host.accept({"probe": whole, "identify": second})
    for _ in range(2):
        host.add("identify", first)
        host.add("identify", second, role="escalate", harness="pi", model="a/b")
    stability = host.report().stability
    assert stability is not None
    assert stability.agents == (("pi, a/b", 2),)
    assert stability.same == 1


def test_passes_have_the_papers_columns(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    used = Usage(input_tokens=1000, output_tokens=100, cost_usd=0.01)
    host.add("probe", laptop["probe"], usage=used, seconds=2.0)
    host.folders.add("identify", 1, harness="builtin", usage=used, seconds=3.0)
    host.add("identify", laptop["identify"], 2, usage=used, seconds=4.0)
    host.add("interface", laptop["interface"], seconds=1.0)
    host.add("identify", laptop["identify"])
    first, second = host.report().passes
    counts = (25, len(laptop["identify"]["devices"]), len(laptop["interface"]["tools"]))
    assert first.stages == ("probe", "identify", "interface")
    assert (first.attempts, first.retries, first.seconds) == (4, 1, 10.0)
    assert (first.enumerated, first.annotated, first.tools) == counts
    assert (first.input_tokens, first.output_tokens) == (3000, 300) and first.cost_usd == pytest.approx(0.03)
    assert (second.stages, second.number, second.tools) == (("identify",), 5, counts[2])
    assert (second.input_tokens, second.cost_usd) == (None, None)


def test_a_server_that_is_sent_back_stays_in_its_pass(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    for stage, accepted in (("serve", True), ("deploy", False), ("serve", True), ("deploy", True), ("serve", True)):
        host.folders.add(stage, 1, accepted=accepted, harness="pi")
    assert [item.attempts for item in host.report().passes] == [4, 1]


def test_what_was_taken_over_is_no_run_and_no_attempt(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    host.add("identify", laptop["identify"], 0, role="reuse", reason="reused", seconds=0.0)
    report = host.report()
    assert [(item.agents, item.attempts, item.retries) for item in report.passes] == [(("reused",), 0, 0)]
    assert report.stability is not None and report.stability.runs == 1


def test_another_set_of_tools_belongs_to_its_own_answer(host: Host, laptop: Artifacts) -> None:
    """Tools stand by the run that they were made of, and by a run that said the same; not by another one."""
    other = with_camera(laptop, lambda item: item.update(identified_as="a lamp"))
    for value in (laptop["identify"], laptop["identify"], other):
        host.add("identify", value)
        if value is laptop["identify"] and not host.nodes:
            host.add("interface", laptop["interface"])
            host.accept(laptop)
    found = runs(
        grouped(of_host(host.folders.layout)), lambda item: json.loads((item.folder / "output.json").read_text())
    )
    assert [len(run.tools) > 0 for _, run in found] == [True, True, False]


def test_a_device_that_only_interface_leaves_out_counts(host: Host, laptop: Artifacts) -> None:
    cut = json.loads(json.dumps(laptop))
    cut["interface"]["tools"] = [tool for tool in cut["interface"]["tools"] if "usb-1d9c-0c14" not in tool["devices"]]
    cut["interface"]["left_out"].append(left("usb-1d9c-0c14", "tool_budget"))
    host.accept(cut)
    onboardable = host.report().coverage.onboardable
    assert onboardable is not None and onboardable.usable == onboardable.of - 1


@pytest.mark.parametrize("standing", ["unknown", "named", "left_out", "waiting"])
def test_a_profile_that_comes_with_octoform_is_the_reason_whatever_became_of_the_device(
    host: Host, standing: str, capsys: pytest.CaptureFixture[str]
) -> None:
    line = "write `profiles: [so-arm101]` in octopus.yaml to use it"
    arm = {
        **seen("usb-1a86-55d3", "USB Serial"),
        "vid": "1a86",
        "pid": "55d3",
        "raw_descriptor": "product: LeRobot arm",
    }
    artifacts: Artifacts = {
        "probe": {"format": 1, "platform": {"os": "linux"}, "devices": [{**arm, "classes": ["tty"]}]}
    }
    if standing != "waiting":
        category = {"unknown": "unknown", "named": "actuator"}.get(standing)
        unknown = {"missing": "What is it?", "confidence": 0.0} if standing == "unknown" else {}
        out = [left(arm["id"], "no_standard_interface", "nothing drives it")]
        named = [known(arm["id"], category, **unknown)] if category else []
        artifacts["identify"] = identified(named, [] if category else out)
        artifacts["interface"] = declared(artifacts["identify"], out if category else ())
    host.accept(artifacts)
    project = str(host.folders.project)
    page = host.folders.project / "page.html"
    assert dispatch(["-chdir", project, "coverage"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert dispatch(["-chdir", project, "coverage", "-json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert dispatch(["-chdir", project, "coverage", "-html", str(page)]) == 0
    html = page.read_text()
    (device,) = document["devices"]
    assert (device["standing"], device["offer"]) == (standing, f"so-arm101: {line}")
    assert line in text and line in html
    assert "reaches it" not in text + html and "nothing drives it" not in text + html
    if standing != "waiting":
        assert (device["reason"], device["detail"]) == ("profile_offered", f"so-arm101: {line}")
        assert "a profile that comes with octoform matches it" in text and "octoform matches it" in html
        assert document["coverage"]["onboardable"]["of"] == 1
        assert document["left_out"] == ({"profile_offered": 1} if standing == "left_out" else {})


def test_the_command_ends_with_1_only_where_there_is_no_report(
    host: Host, laptop: Artifacts, capsys: pytest.CaptureFixture[str]
) -> None:
    project = str(host.folders.project)
    assert dispatch(["-chdir", project, "coverage"]) == 1
    assert "error[COVERAGE-NOTHING]" in capsys.readouterr().err
    assert dispatch(["-chdir", project, "coverage", "-html", ""]) == 1
    host.accept({"probe": laptop["probe"]})
    assert dispatch(["-chdir", project, "coverage"]) == 0
    assert "not known yet" in capsys.readouterr().out
    page = host.folders.project / "page.html"
    assert dispatch(["-chdir", project, "coverage", "--json", "-html", str(page)]) == 0
    assert json.loads(capsys.readouterr().out) == {"format": 1, "written": str(page)}
    assert page.read_text().startswith("<!doctype html>")
    assert dispatch(["-chdir", project, "coverage", "-html", project]) == 1


def test_only_a_page_pays_for_the_template_engine(host: Host, laptop: Artifacts) -> None:
    host.accept(laptop)
    text = (
        "import sys; from octoform.cli.dispatch import dispatch; dispatch(sys.argv[1:]);"
        "heavy = {'jinja2', 'rich', 'fastmcp', 'litellm', 'git'} & set(sys.modules); sys.exit(sorted(heavy) or 0)"
    )
    command = [sys.executable, "-c", text, "-chdir", str(host.folders.project), "coverage"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
