"""A counted position and a stop, on a real terminal. No time is waited for."""

import os
import pty
import re
from collections.abc import Iterator

import pytest

from octoform.runtime import DeviceFault, counting
from octoform.runtime.counting import Counted, Step
from octoform.runtime.lines import Exchange, Wire

DEVICE = "usb-2341-804f"
HOME = Step(zero=True, resumes=True)
WIRE = Wire("tty", 115200, "\n", "ERR (?P<message>.*)", 1.0, 0.0)


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    monkeypatch.setattr(counting, "_known", {})
    monkeypatch.delenv("OCTOFORM_STOPS", raising=False)
    master, slave = pty.openpty()
    yield slave
    counting._let_go(counting._known.get(DEVICE, counting._Known()))
    os.close(slave)
    os.close(master)


def where(line: int) -> dict[str, object]:
    found = counting.position(DEVICE, os.ttyname(line), ("x", "y"), "rail_home")
    assert found.pop("device") == DEVICE
    return found


def done(line: int, step: Step) -> None:
    with Counted(DEVICE, step, line):
        pass


def test_nothing_is_known_before_home_and_all_after_it(line: int) -> None:
    why = "nothing was counted since this server started; rail_home makes it known"
    unknown = {"x": None, "y": None, "unknown": why}
    assert where(line) == unknown
    done(line, Step("x", 5))
    assert where(line) == unknown
    done(line, HOME)
    for step in (Step("x", 200), Step("y", -30), Step("x", -50), Step()):
        done(line, step)
    assert where(line) == {"x": 150, "y": -30, "unknown": None}


def test_a_movement_that_failed_makes_it_unknown_and_a_reading_does_not(line: int) -> None:
    done(line, HOME)
    with pytest.raises(DeviceFault), Counted(DEVICE, Step(), line):
        raise DeviceFault(DEVICE, "no answer to a question")
    assert where(line)["x"] == 0
    with pytest.raises(DeviceFault), Counted(DEVICE, Step("x", 5), line):
        raise DeviceFault(DEVICE, "no answer")
    assert where(line)["unknown"] == (
        "a movement failed, and whether it was carried out is not known; rail_home makes it known"
    )
    done(line, Step("y", 5))
    assert where(line)["y"] is None
    done(line, HOME)
    assert where(line)["y"] == 0


def test_while_it_moves_nothing_is_claimed(line: int) -> None:
    done(line, HOME)
    with Counted(DEVICE, Step("x", 5), line):
        assert where(line)["unknown"] == "a movement is under way; rail_home makes it known"
    assert where(line)["x"] == 5


def test_a_device_that_was_attached_anew_is_unknown_and_let_go_of(line: int) -> None:
    done(line, HOME)
    kept = counting._known[DEVICE].line
    assert os.ttyname(kept) == os.ttyname(line) and not os.get_inheritable(kept)
    master, other = pty.openpty()
    try:
        assert where(other)["unknown"] == "the device was attached again; rail_home makes it known"
        done(line, HOME)
        done(other, Step("x", 5))
        assert where(other)["x"] is None
        assert os.ttyname(counting._known[DEVICE].line) == os.ttyname(other)
    finally:
        os.close(master)
        os.close(other)


def test_after_a_stop_only_the_command_that_ends_it_is_sent(line: int) -> None:
    done(line, HOME)
    found = counting.stop(DEVICE, "rail_home")
    assert found["stopped"] is True and "until rail_home went well" in found["note"]
    for step in (Step("x", 1), Step()):
        with pytest.raises(DeviceFault, match="is stopped: nothing is sent to it until rail_home went well"):
            done(line, step)
        with pytest.raises(DeviceFault, match="is stopped"), Exchange(DEVICE, WIRE, "MOVE_X 1", "OK", step):
            raise AssertionError("the port would have been opened")
    assert where(line)["x"] == 0  # nothing was sent
    done(line, HOME)
    done(line, Step("x", 1))
    assert where(line)["x"] == 1


def test_a_home_that_fails_or_began_before_the_stop_does_not_end_it(line: int) -> None:
    counting.stop(DEVICE, "rail_home")
    with pytest.raises(DeviceFault, match="no answer"), Counted(DEVICE, HOME, line):
        raise DeviceFault(DEVICE, "no answer")
    with pytest.raises(DeviceFault, match="is stopped"):
        done(line, Step("x", 1))
    with Counted(DEVICE, HOME, line):
        counting.stop(DEVICE, "rail_home")
    with pytest.raises(DeviceFault, match="is stopped"):
        done(line, Step("x", 1))


def test_a_stop_between_the_wait_for_the_line_and_the_writing_is_seen(line: int) -> None:
    """The latch is looked at once more with the device held: what waited for it must not go out."""
    sent: list[bytes] = []

    class Port:
        fd = line

        def write(self, data: bytes) -> None:
            sent.append(data)

        def read(self, size: int) -> bytes:
            return b""

        def reset_input_buffer(self) -> None:
            return None

    talk = Exchange(DEVICE, WIRE, "MOVE_X 1", "OK", Step("x", 1))
    with pytest.raises(DeviceFault, match=re.escape(f"{DEVICE} is stopped")), talk:
        counting.stop(DEVICE, "rail_home")
        talk.over(Port())
    assert sent == []
