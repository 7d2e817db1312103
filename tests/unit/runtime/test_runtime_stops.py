"""A device's stop outlives the process that took it. A new process is a runtime that knows nothing yet."""

import json
import os
import pty
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from octoform.runtime import DeviceFault, counting
from octoform.runtime.counting import Counted, Step
from octoform.runtime.lines import Exchange, Wire

DEVICE = "usb-2341-804f"
HOME = Step(zero=True, resumes=True)
MOVE = Step("y", 5)
WIRE = Wire("tty", 115200, "\n", "ERR (?P<message>.*)", 1.0, 0.0)
STOPPED = f"^{DEVICE} is stopped: nothing is sent to it until rail_home went well$"


class Host:
    """The folder of an endpoint and the processes that serve it, one after the other or side by side."""

    def __init__(self, folder: Path, line: int, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.line, self._monkeypatch = folder, line, monkeypatch
        self.processes: list[dict[str, counting._Known]] = []
        self.file = folder / f"stopped-{DEVICE}.json"
        self.restart()

    def restart(self) -> int:
        """Go on as a process that was just started; gives its number."""
        self.processes.append({})
        self.be(len(self.processes) - 1)
        return len(self.processes) - 1

    def be(self, process: int) -> None:
        self._monkeypatch.setattr(counting, "_known", self.processes[process])

    def send(self, step: Step) -> None:
        with Counted(DEVICE, step, self.line):
            pass

    def refuses(self, why: str) -> None:
        """Nothing is sent, and no port is opened for it."""
        with pytest.raises(DeviceFault, match=why), Exchange(DEVICE, WIRE, "MOVE_Y 5", "OK", MOVE):
            raise AssertionError("the port would have been opened")
        for step in (MOVE, Step()):
            with pytest.raises(DeviceFault, match=why):
                self.send(step)


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Host]:
    run = tmp_path / "run"
    run.mkdir(mode=0o700)
    monkeypatch.setenv("OCTOFORM_STOPS", str(run))
    master, slave = pty.openpty()
    found = Host(run, slave, monkeypatch)
    yield found
    for process in found.processes:
        for known in process.values():
            counting._let_go(known)
    os.close(slave)
    os.close(master)


def test_a_stop_outlives_its_process_until_the_way_home_went_well(host: Host) -> None:
    found = counting.stop(DEVICE, "rail_home")
    assert "until rail_home went well, also after a restart of this server; a movement under way" in found["note"]
    assert [path.name for path in host.folder.iterdir()] == [host.file.name]
    assert stat.S_IMODE(host.file.stat().st_mode) == 0o600
    assert json.loads(host.file.read_bytes())["until"] == "rail_home"
    host.refuses(STOPPED)
    host.restart()
    host.refuses(STOPPED)
    with pytest.raises(DeviceFault, match="no answer"), Counted(DEVICE, HOME, host.line):
        raise DeviceFault(DEVICE, "no answer")
    host.refuses(STOPPED)
    host.restart()
    host.refuses(STOPPED)
    host.send(HOME)
    host.send(MOVE)
    assert list(host.folder.iterdir()) == []
    host.restart()
    host.send(MOVE)


def test_another_device_is_not_stopped(host: Host) -> None:
    counting.stop("usb-2341-804f/2", "rail_home")
    assert [path.name for path in host.folder.iterdir()] == [f"stopped-{DEVICE}%2F2.json"]
    host.send(MOVE)
    host.file.write_bytes((host.folder / f"stopped-{DEVICE}%2F2.json").read_bytes())
    host.refuses("counts as stopped")


def test_processes_see_each_other(host: Host) -> None:
    other = host.restart()
    host.be(0)
    counting.stop(DEVICE, "rail_home")
    host.be(other)
    host.refuses(STOPPED)
    host.send(HOME)
    host.be(0)
    host.send(MOVE)


def test_a_way_home_ends_no_stop_that_came_after_it_began(host: Host) -> None:
    """Neither where nothing was stopped before nor where another stop was."""
    other = host.restart()
    for _ in range(2):
        host.be(0)
        with Counted(DEVICE, HOME, host.line):
            host.be(other)
            counting.stop(DEVICE, "rail_home")
            host.be(0)
        host.refuses(STOPPED)


@pytest.mark.parametrize(
    "words",
    [
        b"",
        b"not JSON",
        b"[" * 4096,
        b"7",
        b"{}",
        b'{"format": 2, "device": "usb-2341-804f", "until": "rail_home"}',
        b'{"format": 1, "device": "usb-2341-804f", "until": ""}',
    ],
)
def test_a_stop_that_cannot_be_read_holds_and_is_named(host: Host, words: bytes) -> None:
    host.file.write_bytes(words)
    host.refuses(f"{DEVICE} counts as stopped: {host.file} is there but cannot be read .*; nothing is sent to it but")
    host.send(HOME)
    host.send(MOVE)
    assert not host.file.exists()


def test_no_link_is_followed(host: Host, tmp_path: Path) -> None:
    target = tmp_path / "elsewhere"
    for there in (False, True):
        host.file.symlink_to(target)
        host.refuses(f"{host.file} is there but cannot be read")
        if there:
            counting.stop(DEVICE, "rail_home")
            assert target.read_bytes() == b"mine" and not host.file.is_symlink()
            host.refuses(STOPPED)
        host.send(HOME)
        assert not os.path.lexists(host.file)
        target.write_bytes(b"mine")


def test_what_waits_when_it_is_opened_holds_up_nothing(host: Host) -> None:
    os.mkfifo(host.file)
    host.refuses("cannot be read")


def test_a_stop_that_cannot_be_removed_holds_and_says_so(host: Host) -> None:
    host.file.mkdir()
    host.refuses("it is no regular file")
    with pytest.raises(DeviceFault, match=f"went well, but {DEVICE} stays stopped: {host.file} cannot be removed"):
        host.send(HOME)
    host.refuses("it is no regular file")


def test_a_place_that_cannot_be_looked_at_counts_as_a_stop(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    (host.folder / "file").touch()
    monkeypatch.setenv("OCTOFORM_STOPS", str(host.folder / "file"))
    host.refuses(r"cannot be read \(Not a directory\)")


def test_a_stop_that_cannot_be_written_holds_in_the_process_and_says_so(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    host.folder.rmdir()
    note = counting.stop(DEVICE, "rail_home")["note"]
    assert f"or this server ends, because {host.file} cannot be written (No such file or directory);" in note
    host.refuses(STOPPED)
    host.send(HOME)
    host.send(MOVE)
    monkeypatch.delenv("OCTOFORM_STOPS")
    assert "or this server ends, because it was given no folder" in counting.stop(DEVICE, "rail_home")["note"]
    host.refuses(STOPPED)
    host.send(HOME)
    host.send(MOVE)
