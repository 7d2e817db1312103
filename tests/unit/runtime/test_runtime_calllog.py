"""Every call and its result are in the log, and the log never costs a call."""

import asyncio
import inspect
import json
import os
from pathlib import Path
from typing import Annotated, Any

import pytest
from fastmcp.exceptions import ToolError

from octoform import runtime
from octoform.runtime import calllog


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "calls.jsonl"
    monkeypatch.setenv("OCTOFORM_CALL_LOG", str(path))
    monkeypatch.setattr(calllog, "_complained", [])
    return path


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_bytes().splitlines()]


@runtime.logged
def double(number: Annotated[int, "a number"], text: str = "") -> int:
    """Twice the number."""
    if number < 0:
        raise ValueError(f"{number} is negative")
    return 2 * number


def test_a_call_and_its_result(log: Path) -> None:
    assert double(4) == 8
    call, result = lines(log)
    assert (call["event"], call["tool"], call["arguments"]) == ("call", "double", {"number": 4})
    assert (result["event"], result["ok"], result["id"]) == ("result", True, call["id"])
    assert result["ms"] >= 0 and "error" not in result
    assert call["time"].endswith("Z") and len(call["time"]) == 24


def test_a_failure_is_logged_and_goes_on(log: Path) -> None:
    with pytest.raises(ValueError, match="-1 is negative"):
        double(-1)
    result = lines(log)[1]
    assert (result["ok"], result["error"], result["message"]) == (False, "ValueError", "-1 is negative")


def test_the_signature_stays(log: Path) -> None:
    assert inspect.signature(double) == inspect.signature(inspect.unwrap(double))
    assert list(inspect.signature(double, follow_wrapped=False).parameters) == ["number", "text"]
    assert double.__name__ == "double" and double.__doc__ == "Twice the number."


def test_an_async_tool_stays_async(log: Path) -> None:
    @runtime.logged
    async def wait(seconds: float) -> str:
        await asyncio.sleep(seconds)
        return "done"

    assert inspect.iscoroutinefunction(wait)
    assert asyncio.run(wait(0.001)) == "done"
    assert [line["event"] for line in lines(log)] == ["call", "result"]


def test_a_cancelled_call_ends_in_the_log(log: Path) -> None:
    @runtime.logged
    async def wait() -> None:
        await asyncio.sleep(60)

    async def cancel() -> None:
        task = asyncio.create_task(wait())
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cancel())
    assert lines(log)[1]["error"] == "CancelledError"


def test_long_and_strange_arguments_are_bounded(log: Path) -> None:
    double(1, "x" * 100_000)
    double(2, b"\xff\x00\n")  # type: ignore[arg-type]
    first, _, third, _ = lines(log)
    assert first["arguments"]["text"] == "x" * 200 + "... (100000 characters)"
    assert third["arguments"]["text"] == repr(b"\xff\x00\n")
    assert all(len(line) < calllog.LINE_CHARS + 200 for line in log.read_bytes().splitlines())


def test_very_many_arguments_are_counted(log: Path) -> None:
    @runtime.logged
    def many(**names: str) -> None:
        """Takes anything."""

    many(**{f"name{index}": "y" * 200 for index in range(100)})
    assert len(log.read_bytes().splitlines()[0]) < calllog.LINE_CHARS + 200


def test_a_log_that_cannot_be_written_fails_no_call(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("OCTOFORM_CALL_LOG", str(tmp_path / "absent/calls.jsonl"))
    monkeypatch.setattr(calllog, "_complained", [])
    assert double(1) == 2 and double(2) == 4
    assert capsys.readouterr().err.count("cannot be written") == 1


def test_no_call_waits_for_the_reader_of_a_pipe(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(log)
    assert double(4) == 8
    assert "cannot be written" in capsys.readouterr().err


def test_without_a_log_standard_error_gets_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("OCTOFORM_CALL_LOG", raising=False)
    double(3)
    captured = capsys.readouterr()
    assert json.loads(captured.err.splitlines()[0])["arguments"] == {"number": 3}
    assert captured.out == ""


def test_faults_of_the_room_reach_the_client_as_sentences(log: Path) -> None:
    @runtime.logged
    def absent() -> None:
        raise runtime.DeviceAbsent("usb-1", "usb-1 is not attached")

    @runtime.logged
    def denied() -> None:
        raise PermissionError(13, "Permission denied", "/dev/null")

    with pytest.raises(ToolError, match="usb-1 is not attached"):
        absent()
    with pytest.raises(ToolError, match=r"/dev/null: this user may not open it \(mode 0666, group "):
        denied()
    assert [line["error"] for line in lines(log) if line["event"] == "result"] == ["DeviceAbsent", "PermissionError"]
