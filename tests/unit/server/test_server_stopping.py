"""The emergency stop on real lines: the exact bytes at the right rate, and no device hinders another."""

import json
import os
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from unit.server.server_lines import STOP, Line, host

from octoform.policy.published import Policy, StopAction
from octoform.server import emergency_stop as stopping
from octoform.server.audit.audit_log import Audit, verify
from octoform.server.latch import Latch

LAUNCHER = Path(stopping.__file__).parent
DATA = bytes.fromhex(STOP)


@pytest.fixture
def lines() -> Iterator[list[Line]]:
    made = [Line() for _ in range(3)]
    yield made
    for line in made:
        line.close()


def action(device: str, baud: int | None = 1000000, data: bytes = DATA) -> StopAction:
    return StopAction(device, "tty", baud, data, "profile arm")


def run(actions: list[StopAction], nodes: dict[str, str], seconds: float = 2.0) -> list[stopping.Stopped]:
    return stopping.run(Policy("enforce", {}, tuple(actions)), lambda device, _: nodes[device], seconds)


def test_exact_bytes_raw_and_at_the_rate(lines: list[Line]) -> None:
    (found,) = run([action("arm")], {"arm": lines[0].node})
    assert (found.ok, found.detail) == (True, f"wrote 8 bytes to {lines[0].node}")
    assert lines[0].received(8) == DATA
    mode = termios.tcgetattr(lines[0].device)
    assert mode[4] == mode[5] == termios.B1000000
    assert not mode[3] & (termios.ECHO | termios.ICANON | termios.ISIG)
    assert not mode[1] & termios.OPOST


def test_raw_means_that_no_byte_is_changed(lines: list[Line]) -> None:
    cooked = termios.tcgetattr(lines[0].device)
    cooked[1] |= termios.OPOST | termios.ONLCR
    termios.tcsetattr(lines[0].device, termios.TCSANOW, cooked)
    data = bytes(range(256))
    assert run([action("arm", data=data)], {"arm": lines[0].node})[0].ok
    assert lines[0].received(256) == data


def test_without_a_rate_the_line_stays_as_it_is(lines: list[Line]) -> None:
    before = termios.tcgetattr(lines[0].device)
    assert run([action("arm", baud=None)], {"arm": lines[0].node})[0].ok
    assert termios.tcgetattr(lines[0].device) == before


def test_actions_of_one_device_keep_their_order(lines: list[Line]) -> None:
    actions = [action("arm", data=bytes([number] * 4)) for number in range(5)]
    assert [found.ok for found in run(actions, {"arm": lines[0].node})] == [True] * 5
    assert lines[0].received(20) == b"".join(item.write for item in actions)


def test_one_that_is_gone_one_that_hangs_and_one_in_doubt_do_not_hinder_the_third(lines: list[Line]) -> None:
    gone, full, good = lines
    node = gone.node
    gone.unplug()
    full.fill()
    begun = time.monotonic()
    nodes = {"gone": node, "full": full.node, "good": good.node}
    actions = [action(name) for name in ("gone", "full", "unknown", "good")]
    found = run(actions, nodes)
    assert time.monotonic() - begun < 4
    assert [item.ok for item in found] == [False, False, False, True]
    assert "No such file" in found[0].detail
    assert "took only 0 of 8 bytes" in found[1].detail or "not done after 2.0 s: writing" in found[1].detail
    assert good.received(8) == DATA
    assert found[3].ms < 1000


def test_a_search_that_never_ends_is_told_and_left_behind(lines: list[Line]) -> None:
    forever = threading.Event()

    def find(device: str, _: str) -> str:
        if device == "stuck":
            forever.wait(30)
        return lines[0].node

    found = stopping.run(Policy("enforce", {}, (action("stuck"), action("good"))), find, 0.2)
    forever.set()
    assert [item.ok for item in found] == [False, True]
    assert found[0].detail == "not done after 0.2 s: looking for the device"


def test_what_is_no_character_device_is_never_written_to(tmp_path: Path) -> None:
    file = tmp_path / "node"
    file.write_bytes(b"kept")
    (found,) = run([action("disk")], {"disk": str(file)})
    assert (found.ok, "no character device" in found.detail, file.read_bytes()) == (False, True, b"kept")


def test_a_rate_that_cannot_be_set_is_told(lines: list[Line]) -> None:
    (found,) = run([action("arm", baud=123457)], {"arm": lines[0].node})
    assert (found.ok, "123457 is no rate" in found.detail) == (False, True)


EXCLUSIVE = """
import fcntl, json, os, sys, termios
sys.path.insert(0, sys.argv[2])
from octoform.server import emergency_stop as stopping
from octoform.policy.published import Policy, StopAction
if os.geteuid() == 0:
    os.setgroups([]), os.setgid(65534), os.setuid(65534)  # who may do anything is kept out of nothing
line = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
reading = os.open(sys.argv[1], os.O_RDONLY | os.O_NOCTTY)
fcntl.ioctl(line, termios.TIOCEXCL)
action = StopAction("arm", "tty", 115200, bytes.fromhex("fffffe0403280fd2"), "profile arm")
found, = stopping.run(Policy("enforce", {}, (action,)), lambda device, kind: sys.argv[1])
print(json.dumps([found.ok, found.detail, os.fstat(line).st_rdev == os.fstat(reading).st_rdev]))
"""


def test_an_exclusive_line_is_written_through_the_descriptor_that_is_open(lines: list[Line]) -> None:
    Path(lines[0].node).chmod(0o666)
    command = [sys.executable, "-c", EXCLUSIVE, lines[0].node, str(LAUNCHER.parent.parent)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert json.loads(done.stdout or "null") == [
        True,
        f"wrote 8 bytes to {lines[0].node} on the line that this process has open",
        True,
    ], done.stderr
    assert lines[0].received(8) == DATA


def emergency(folder: Path, *actions: StopAction) -> stopping.Emergency:
    return stopping.Emergency(Latch(folder / "run/estop.json"), Audit.open(folder / "log"), actions)


def events(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "log/audit.jsonl").read_text().splitlines()]


def test_stop_latches_acts_and_records(tmp_path: Path, lines: list[Line]) -> None:
    stop, seen = emergency(tmp_path, action("arm")), []
    latch = Latch(tmp_path / "run/estop.json")

    def interrupt() -> list[stopping.Running]:
        seen.append(latch.engaged())
        return []

    answer = stop.stop("ada", "smoke", lambda *_: lines[0].node, interrupt)
    assert (answer["ok"], answer["latched"], answer["problems"]) == (True, True, [])
    latched = seen[0]
    assert latched is not None and answer["estop"]["by"] == latched.by == "ada"
    assert lines[0].received(8) == DATA
    again = stop.stop("bob", "more smoke", lambda *_: lines[0].node)
    assert (again["ok"], again["estop"]["by"]) == (True, "ada")
    cleared = stop.clear("eve")
    assert (cleared["ok"], cleared["latched"], cleared["estop"]["reason"]) == (True, False, "smoke")
    assert stop.clear("eve") == {"ok": True, "latched": False, "estop": None, "problems": []}
    found = events(tmp_path)
    assert [item["event"] for item in found] == ["estop", "estop_actions"] * 2 + ["estop_cleared"]
    assert found[1]["stopped"][0]["ok"] is True
    assert found[4]["was"]["by"] == "ada"
    assert verify(tmp_path / "log").ok


def test_a_clear_that_comes_between_does_not_undo_a_stop(tmp_path: Path) -> None:
    stop = emergency(tmp_path)
    clears = iter([stop.clear])

    def interrupt() -> list[stopping.Running]:
        for clear in clears:
            clear("eve")
        return []

    answer = stop.stop("ada", "smoke", interrupt=interrupt)
    assert (answer["ok"], answer["latched"], stop.latch.engaged() is not None) == (True, True, True)
    assert [item["event"] for item in events(tmp_path)] == ["estop_cleared", "estop", "estop_actions"]


def test_a_failed_action_is_no_success_but_latches(tmp_path: Path) -> None:
    answer = emergency(tmp_path, action("arm")).stop("ada", "", lambda *_: "/dev/octoform-is-not-there")
    assert (answer["ok"], answer["latched"], answer["stopped"][0]["ok"]) == (False, True, False)


def test_nothing_is_cleared_that_cannot_be_recorded(tmp_path: Path) -> None:
    stop = emergency(tmp_path)
    stop.stop("ada", "")
    assert stop.audit is not None
    stop.audit.close()
    answer = stop.clear("eve")
    assert (answer["ok"], answer["latched"]) == (False, True)
    assert stop.latch.engaged() is not None


def test_a_lock_that_cannot_be_opened_is_not_called_another_stop(tmp_path: Path) -> None:
    """As on a file system that is read-only by now."""
    stop = emergency(tmp_path)
    stop.stop("ada", "")
    lock = stop.latch.path.with_suffix(".lock")
    lock.unlink()
    lock.mkdir()
    answer = stop.clear("eve")
    assert (answer["ok"], answer["latched"]) == (False, True)
    assert answer["problems"] == ["its lock file cannot be opened", "the emergency stop stays engaged"]


def test_a_stop_goes_on_without_latch_file_and_without_log(tmp_path: Path, lines: list[Line]) -> None:
    (tmp_path / "run").write_text("no folder")
    stop = stopping.Emergency(Latch(tmp_path / "run/estop.json"), None, (action("arm"),), ("there is no log",))
    answer = stop.stop("ada", "smoke", lambda *_: lines[0].node)
    assert (answer["ok"], answer["stopped"][0]["ok"], answer["latched"]) == (False, True, True)
    assert any("it holds in this process alone" in text for text in answer["problems"])
    assert lines[0].received(8) == DATA
    assert stop.latch.engaged() is not None


def program(verb: str, folder: Path, asked: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
    """Run the program as the command line does, in an interpreter that knows nothing of octoform."""
    command = [sys.executable, "-I", "-S", str(LAUNCHER / "offline.py"), verb, str(folder)]
    done = subprocess.run([*command, json.dumps(asked or {})], capture_output=True, text=True, timeout=30, check=False)
    assert done.stdout, done.stderr
    return done.returncode, json.loads(done.stdout)


def test_the_program_stops_every_device_with_no_process_at_all(tmp_path: Path, lines: list[Line]) -> None:
    names = ["usb-1a86-7523", "usb-0403-6001", "usb-2341-0043"]
    folder = host(tmp_path, dict(zip(names, lines, strict=True)))
    status, answer = program("stop", folder, {"by": "ada", "reason": "smoke"})
    assert (status, answer["ok"], answer["problems"]) == (0, True, [])
    assert [item["device"] for item in answer["stopped"]] == names
    assert [line.received(8) for line in lines] == [DATA] * 3
    assert termios.tcgetattr(lines[0].device)[4] == termios.B115200
    assert (tmp_path / "run/estop.json").stat().st_mode & 0o777 == 0o600
    status, answer = program("clear", folder, {"by": "eve"})
    assert (status, answer["estop"]["by"]) == (0, "ada")
    assert verify(tmp_path / "log").seq == 3


def test_the_program_tells_what_it_could_not_do(tmp_path: Path, lines: list[Line]) -> None:
    folder = host(tmp_path, {"usb-1a86-7523": lines[0], "usb-0403-6001": lines[1]})
    lines[1].fill()
    lines[2].close()
    document = json.loads((folder / "policy.json").read_bytes())
    document["stop"].append({"device": "usb-dead-beef", "class": "tty", "write": "00", "source": "p", "baud": None})
    document["stop"].append({"device": "usb-dead-beef", "class": "tty", "write": "not hex"})
    (folder / "policy.json").write_text(json.dumps({**document, "format": 99}))
    (folder / "connection.json").write_text("{")
    os.environ["OCTOFORM_SYSROOT"] = str(tmp_path / "system")
    try:
        status, answer = program("stop", folder)
    finally:
        del os.environ["OCTOFORM_SYSROOT"]
    assert (status, answer["ok"], answer["latched"]) == (1, False, True)
    assert [item["ok"] for item in answer["stopped"]] == [True, False, False]
    assert "not attached" in answer["stopped"][2]["detail"]
    assert any("stop[3].write is not hexadecimal" in text for text in answer["problems"])
    assert lines[0].received(8) == DATA


def test_the_program_without_a_policy_latches_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "endpoint").mkdir()
    status, answer = program("stop", tmp_path / "endpoint", {"by": "ada"})
    assert (status, answer["latched"], answer["stopped"]) == (1, True, [])
    assert "the stop actions cannot be read" in answer["problems"][0]


def test_the_program_shows_and_resets_limits(tmp_path: Path) -> None:
    folder = host(tmp_path, {})
    tool = {"effect": "actuate", "decision": "allow", "source": "p", "timeout": 1, "result_bytes": 1}
    limit = {"kind": "cumulative", "parameter": "steps", "most": 10, "source": "p"}
    tools = {"move": {**tool, "limits": [limit]}}
    (folder / "policy.json").write_text(json.dumps({"format": 1, "mode": "enforce", "tools": tools, "stop": []}))
    (tmp_path / "run").mkdir()
    (tmp_path / "run/limits.json").write_text("damaged")
    assert program("limits", folder)[1]["used"]["move"]["damaged"] is True
    assert program("reset", folder, {"tool": "nothing", "by": "ada"})[1]["unknown"] is True
    assert program("reset", folder, {"tool": "move", "by": "ada"}) == (0, {"ok": True, "problems": []})
    assert program("limits", folder)[1]["used"] == {"move": {"sums": {}, "last": {}, "calls": [], "damaged": False}}
    assert "limits_reset" in [item["event"] for item in events(tmp_path)]


MANY = """
import json, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from octoform.server.audit.audit_log import Audit
from octoform.server.latch import Latch
from octoform.server.emergency_stop import Emergency
folder = Path(sys.argv[1])
mine = Emergency(Latch(folder / "run/estop.json"), Audit.open(folder / "log"), ())
for number in range(15):
    (mine.clear("p") if number % 3 == int(sys.argv[3]) else mine.stop(f"process {sys.argv[3]}", str(number)))
"""


def test_many_stops_and_clears_at_once_end_consistent_and_all_in_the_log(tmp_path: Path) -> None:
    root = str(LAUNCHER.parent.parent)
    processes = [subprocess.Popen([sys.executable, "-c", MANY, str(tmp_path), root, str(one)]) for one in range(3)]
    mine = emergency(tmp_path)
    threads = [
        threading.Thread(target=lambda: [mine.clear("t") if number % 2 else mine.stop("t", "") for number in range(15)])
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert [process.wait(60) for process in processes] == [0, 0, 0]
    found = [item for item in events(tmp_path) if item["event"] in ("estop", "estop_cleared")]
    assert sum(item["event"] == "estop" for item in found) == 3 * 10 + 3 * 8
    latched = mine.latch.engaged() is not None
    assert latched is (found[-1]["event"] == "estop")
    assert all(item["was"]["by"] for item in found if item["event"] == "estop_cleared")
    assert verify(tmp_path / "log").ok
