"""A sentence for the log never breaks what it is about, whatever room the log has."""

import io
import os
import sys
from pathlib import Path

import pytest

from octoform.launcher.saying import say


def test_a_line_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    say("a door is closed")
    assert capsys.readouterr().err == "octoform: a door is closed\n"


def test_a_full_disk_takes_the_line_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stderr", full)
        for _ in range(2_000):  # more than any buffer keeps
            say("there is no room " * 10)
        monkeypatch.undo()
        somewhere = os.open(os.devnull, os.O_WRONLY)  # closing writes what is left
        os.dup2(somewhere, full.fileno())
        os.close(somewhere)


def test_another_fault_is_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with io.FileIO(writing, "w") as raw:
        broken = io.TextIOWrapper(raw, encoding="utf-8", write_through=True)
        monkeypatch.setattr(sys, "stderr", broken)
        with pytest.raises(BrokenPipeError):
            say("nobody reads")
        monkeypatch.undo()
        broken.detach()
