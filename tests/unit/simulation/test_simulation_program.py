"""``octoform simulate`` as a person runs it: what it prints, what it obeys, and that it leaves nothing."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from octoform.simulation.rig import Rig, RigInvalid, load, names
from octoform.simulation.rig_commands import CommandRefused, changed, describe, obey

GIVEN = load("reference")


class Program:
    """The program with a pipe to its standard input; ``hear`` gives its next event."""

    def __init__(self, folder: Path, *words: str) -> None:
        command = [sys.executable, "-m", "octoform.cli", f"-chdir={folder}", "simulate", "reference", *words, "-json"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def hear(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        found: dict[str, Any] = json.loads(self._process.stdout.readline())
        return found

    def say(self, line: str) -> dict[str, Any]:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        return self.hear()

    def end(self, number: int = signal.SIGINT) -> int:
        self._process.send_signal(number)
        self._process.communicate(timeout=20)
        return self._process.returncode


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_runs_until_it_is_ended_and_leaves_nothing(tmp_path: Path, number: int) -> None:
    program = Program(tmp_path, "-folder", "tree", "-set", "camera.width=64", "-set", "camera.height=48")
    begun = program.hear()
    tree = tmp_path / "tree"
    assert begun["sysroot"] == str(tree) and (tree / "dev" / "video0").read_bytes().startswith(b"YUV4MPEG2 W64 H48")
    assert (tree / "dev" / "ttyACM0").is_symlink()
    assert program.say("unplug arm") == {"event": "unplugged", "device": "arm"}
    assert not (tree / "dev" / "ttyACM0").is_symlink()
    assert program.say("nonsense")["event"] == "refused"
    assert program.end(number) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_something_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("")
    command = [sys.executable, "-m", "octoform.simulation", "reference", "-folder", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and "is not an empty folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """Not started but for the host: what is said of devices needs no terminal."""
    devices = {name: {**device, "unplugged": True} for name, device in GIVEN["devices"].items()}
    one = Rig({**GIVEN, "devices": devices}, tmp_path)
    one.start()
    yield one
    one.stop()


def test_faults_by_their_names(rig: Rig) -> None:
    assert rig.servos is not None and rig.line is not None
    obey(rig, "fault arm.2 stuck")
    obey(rig, "fault arm dropped")
    obey(rig, "fault rail jammed")
    assert (rig.servos.servos[2].fault, rig.servos.bus_fault, rig.line.fault) == ("stuck", "dropped", "jammed")
    rows = {row["name"]: row for row in describe(rig)}
    assert rows["arm"]["servos"][1]["fault"] == "stuck" and not rows["rail"]["plugged"]
    for target in ("arm.2", "arm", "rail"):
        assert obey(rig, f"fault {target} none")["fault"] is None
    assert (rig.servos.servos[2].fault, rig.servos.bus_fault, rig.line.fault) == (None, None, None)


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("fault arm.9 stuck", "arm has no servo 9"),
        ("fault arm.2 gone", "no fault gone here"),
        ("fault leg stuck", "there is no device leg"),
        ("fault camera black", "camera is not plugged"),
        ("plug arm 1 2 3", "plug takes other words"),
        ("dance", "unknown: dance"),
    ],
)
def test_what_can_not_be_done_is_said(rig: Rig, line: str, reason: str) -> None:
    with pytest.raises(CommandRefused, match=reason):
        obey(rig, line)


def test_the_description_of_another_rig(tmp_path: Path) -> None:
    assert names() == ["reference"]
    path = tmp_path / "mine.yaml"
    for text, reason in (
        ("devices: [", "mine.yaml"),
        ("rig: mine", "needs `devices`"),
        ("devices: {a: {kind: oven}}", "devices.a.kind has to be one of servos, line, camera"),
        ("devices: {a: {kind: line, port: 1-1}}", "devices.a has no node"),
    ):
        path.write_text(text)
        with pytest.raises(RigInvalid, match=reason):
            load(path)
    with pytest.raises(RigInvalid, match="shipped are reference"):
        load("other")


@pytest.mark.parametrize(
    ("name", "key", "value", "reason"),
    [
        ("leg", "anonymous", True, "no device leg"),
        ("arm", "speedpu", 2, "arm has no value speedpu to set; it has anonymous, "),
        ("arm", "speedup", "fast", "arm.speedup takes a number, and not fast"),
        ("arm", "speedup", True, "arm.speedup takes a number"),
        ("arm", "anonymous", 1, "arm.anonymous takes true or false"),
        ("rail", "kind", "camera", "rail has no value kind"),
        ("rail", "half_period", {}, "rail.half_period takes a number"),
    ],
)
def test_a_value_that_the_description_can_not_take_is_refused(name: str, key: str, value: object, reason: str) -> None:
    with pytest.raises(CommandRefused, match=reason):
        changed(GIVEN, name, key, value)


def test_a_value_that_it_can_take() -> None:
    given = changed(changed(GIVEN, "rail", "described", True), "arm", "speedup", 2.5)["devices"]
    assert given["rail"]["described"] is True and given["arm"]["speedup"] == 2.5
