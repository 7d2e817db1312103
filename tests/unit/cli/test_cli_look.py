"""``octoform look`` at a live endpoint: pictures, none, and pictures that show nothing, each with its exit code."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from launched import Launched, launched, tool

from octoform.cli.dispatch import dispatch
from octoform.endpoint.environment.model import MARKER
from octoform.engine import look
from octoform.perception import capture
from octoform.state.layout import Layout

CAMERA, OTHER = "usb-1f00-00c1", "usb-1f00-00c2"
PICTURE = {"name": "capture_image", "description": "One picture", "via": "OpenCV", "effect": "read"}
SOURCE = '''
import random, struct, zlib
from pathlib import Path
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from fastmcp.utilities.types import Image

mcp = FastMCP("bench")
MODE = Path("@MODE@")
calls = 0


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(rows):
    head = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 0, 0, 0, 0)
    lines = b"".join(bytes([0, *row]) for row in rows)
    start = bytes([137, 80, 78, 71, 13, 10, 26, 10])
    return start + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")


@mcp.tool
def capture_image(device: str):
    """Take a picture."""
    global calls
    mode = MODE.read_text()
    calls += mode != "still"
    if mode == "gone":
        raise ToolError("the camera is unplugged")
    if mode == "words":
        return "/tmp/picture.jpg"
    level = 0 if mode == "dark" else 200
    rows = [[calls % 7] * 64 + [level] * 64 for _ in range(96)]
    if mode == "still":
        rows = [list(random.Random(row).randbytes(128)) for row in range(96)]
    data = png(rows)
    return Image(data=data[:-60] if mode == "cut" else data, format="png")
'''


def written(layout: Layout) -> None:
    """The accepted artifacts of a host with two cameras, in the shape that looking asks for and with little in it."""
    cameras = (CAMERA, OTHER)
    probe: dict[str, Any] = {
        "platform": {"os": "linux", "arch": "x86_64"},
        "scan_methods": [{"name": "sysfs", "status": "ok"}],
    }
    probe |= {"hostname": "bench", "timestamp": "2026-01-02T03:04:05Z"}
    probe["devices"] = [{"id": one, "name": "Eye", "interface": "usb", "raw_descriptor": "eye"} for one in cameras]
    known = {"identified_as": "Camera", "category": "sensor", "confidence": 0.9, "method": "kernel_class"}
    known |= {"evidence": [{"quote": "eye"}], "capabilities": [PICTURE]}
    schema = {"type": "object", "properties": {"device": {"enum": [*cameras]}}, "required": ["device"]}
    offered = {**tool("capture_image", "read", *cameras), "capability": "capture_image", "description": "Look."}
    offered |= {
        "input_schema": schema,
        "output_schema": {"type": "object"},
        "limits": [],
        "smoke": {"arguments": {"device": CAMERA}},
    }
    for stage, value in (
        ("probe", probe),
        ("identify", {"devices": [{"id": one, **known} for one in cameras], "left_out": []}),
        ("interface", {"tools": [offered], "left_out": []}),
    ):
        path = layout.output(stage)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"format": 1, **value}))


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """A running endpoint; this test's own Python stands for its serving environment."""
    folder = tmp_path_factory.mktemp("look")
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    (folder / "mode").write_text("bright")
    source = SOURCE.replace("@MODE@", str(folder / "mode"))
    with launched(folder, source, [tool("capture_image", "read", CAMERA, OTHER)]) as endpoint:
        written(endpoint.layout)
        environment = folder / "environment"
        (environment / "bin").mkdir(parents=True)
        (environment / "bin" / "python").symlink_to(sys.executable)
        marker = {"digest": "sha256:0", "lock": "sha256:0", "distributions": []}
        (environment / MARKER).write_text(json.dumps(marker))
        manifest = endpoint.layout.endpoint / "manifest.json"
        manifest.write_text(json.dumps({**json.loads(manifest.read_text()), "environment": str(environment)}))
        yield endpoint


class Said:
    """What a run of the command line printed, and its exit code."""

    def __init__(self, bench: Launched, capsys: pytest.CaptureFixture[str], mode: str, *arguments: str) -> None:
        project = bench.layout.project
        (project / "mode").write_text(mode)
        self.status = dispatch(["-chdir", str(project), "look", *arguments])
        printed = capsys.readouterr()
        self.out, self.err = printed.out.splitlines(), printed.err

    @property
    def document(self) -> dict[str, Any]:
        """The one JSON object."""
        (line,) = self.out
        value: dict[str, Any] = json.loads(line)
        return value


def test_a_picture_its_figures_and_the_difference_to_the_one_before(
    bench: Launched, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    first = Said(bench, capsys, "bright", "-save", str(tmp_path / "shot.png"))
    assert first.status == 0
    assert first.out[0].split("  ")[1:4] == [CAMERA, "128x96", "mean 100.5"]
    assert first.out[1] == f"saved {tmp_path / 'shot.png'}"
    assert (tmp_path / "shot.png").read_bytes().startswith(b"\x89PNG")
    assert "warning[PERCEPTION-UNPROVED]" in first.err and f"{CAMERA} was chosen" in first.err
    second = Said(bench, capsys, "bright", "-json")
    assert second.status == 0 and second.document["problem"] is None
    picture = second.document["picture"]
    assert (picture["complaint"], picture["mime"], picture["width"]) == (None, "image/png", 128)
    assert picture["difference"] is not None and picture["difference"] < 2
    assert second.document["camera"] == {"device": CAMERA, "tool": "capture_image", "arguments": {"device": CAMERA}}
    assert (bench.layout.frames / "current.png").is_file()


def test_a_picture_that_shows_nothing_leaves_with_2(
    bench: Launched, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(look, "REPEAT_SECONDS", 0.0)
    monkeypatch.setattr(capture, "FROZEN_SECONDS", 0.0)
    dark = Said(bench, capsys, "dark")
    assert dark.status == 2 and dark.out[0].endswith("shows nothing: black")
    assert Said(bench, capsys, "bright").status == 0
    assert Said(bench, capsys, "still").status == 0, "one picture proves nothing"
    still = Said(bench, capsys, "still", "-json")
    assert (still.status, still.document["picture"]["complaint"]) == (2, "frozen")
    assert any("physical state is unknown" in line for line in still.document["summary"])


@pytest.mark.parametrize(
    ("mode", "code", "told"),
    [
        ("gone", "PERCEPTION-TOOL-FAILED", "the camera is unplugged"),
        ("words", "PERCEPTION-NO-PICTURE", "text"),
        ("cut", "PERCEPTION-BROKEN-PICTURE", "image/png"),
    ],
)
def test_no_picture_leaves_with_1_and_its_reason_is_recorded(
    bench: Launched, capsys: pytest.CaptureFixture[str], mode: str, code: str, told: str
) -> None:
    none = Said(bench, capsys, mode, "-save", "/nowhere/shot.png")
    assert none.status == 1 and "no picture" in none.out[0]
    assert f"error[{code}]" in none.err and told in none.err
    record = json.loads((bench.layout.frames / "frames.json").read_bytes())
    assert record["current"] is None and record["absent"]["code"] == code and told in record["absent"]["reason"]
    assert not list(bench.layout.frames.glob("current.*"))


def test_the_camera_that_a_step_proved_goes_before_the_best_and_a_person_before_both(
    bench: Launched, capsys: pytest.CaptureFixture[str]
) -> None:
    proved = bench.layout.output("step.perceive")
    proved.parent.mkdir(parents=True)
    camera = {"device": OTHER, "tool": "capture_image", "arguments": {"device": OTHER}}
    proved.write_text(json.dumps({"format": 1, "camera": camera}))
    try:
        chosen = Said(bench, capsys, "bright", "-json")
        assert chosen.document["camera"] == camera and chosen.err == ""
        assert Said(bench, capsys, "bright", "-json", "-device", CAMERA).document["camera"]["device"] == CAMERA
    finally:
        proved.unlink()
    wrong = Said(bench, capsys, "bright", "-device", "usb-1f00-00c3")
    assert wrong.status == 1 and "is no camera of this host" in wrong.err and "cameras here: usb-1f00-00c1" in wrong.err


def test_a_row_of_looks_has_numbered_files_and_the_exit_code_of_the_last(
    bench: Launched, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    row = Said(
        bench, capsys, "bright", "-every", "1s", "-count", "2", "-save", str(tmp_path / "a" / "shot.png"), "-json"
    )
    assert row.status == 0 and len(row.out) == 2
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["shot-0001.png", "shot-0002.png"]


def test_without_a_duration_the_manifest_has_to_agree(bench: Launched, capsys: pytest.CaptureFixture[str]) -> None:
    refused = Said(bench, capsys, "bright", "-every")
    assert refused.status == 1 and "error[PERCEPTION-OFF]" in refused.err
    manifest = bench.layout.project / "octopus.yaml"
    text = manifest.read_text()
    manifest.write_text(f"{text}perception: {{enabled: true, camera: {OTHER}, interval: 5s}}\n")
    try:
        agreed = Said(bench, capsys, "bright", "-every", "-count", "1", "-json")
        assert agreed.status == 0 and agreed.document["camera"]["device"] == OTHER
    finally:
        manifest.write_text(text)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("-count", "2"), "-count limits the pictures of -every"),
        (("-every", "1s", "-count", "none"), "is not a number of looks"),
        (("-every", "500ms"), "too often"),
        (("-every", "30"), "is no duration"),
        (("-save", ""), "give the file"),
    ],
)
def test_what_cannot_be_understood(
    bench: Launched, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], told: str
) -> None:
    wrong = Said(bench, capsys, "bright", *arguments)
    assert wrong.status == 1 and told in wrong.err and wrong.out == []


def test_a_host_that_was_never_applied(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    assert dispatch(["-chdir", str(tmp_path), "look"]) == 1
    assert "error[ARTIFACT-MISSING]: probe has no accepted output yet" in capsys.readouterr().err
    assert not (tmp_path / ".octoform").exists()
    written(Layout(tmp_path, "bench"))
    assert dispatch(["-chdir", str(tmp_path), "look"]) == 1
    assert "error[ENDPOINT-NOT-APPLIED]" in capsys.readouterr().err
    record = json.loads((tmp_path / ".octoform/bench/frames/frames.json").read_bytes())
    assert record["absent"]["code"] == "ENDPOINT-NOT-APPLIED" and record["summary"]["absences"] == 1
