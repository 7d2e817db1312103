"""A sentence for the log never breaks what it is about, whatever room the log has."""

import io
import logging
import os
import sys
import time
from datetime import datetime
from pathlib import Path

import pytest

from octoform.server.process.stderr_log import StderrHandler, write_line


def test_a_line_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    before = time.time()
    write_line("a door is closed")
    stamp, _, found = capsys.readouterr().err.partition(" ")
    assert found == "octoform: a door is closed\n"
    assert before - 0.002 <= datetime.fromisoformat(stamp).timestamp() <= time.time()


def test_what_is_logged_has_the_same_form(capsys: pytest.CaptureFixture[str]) -> None:
    logger = logging.Logger("octoform.any")
    logger.addHandler(StderrHandler())
    logger.error("the tool %s failed inside", "move")
    stamp, _, found = capsys.readouterr().err.partition(" ")
    assert (stamp[-1], found) == ("Z", "octoform: the tool move failed inside\n")


def test_a_full_disk_takes_the_line_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stderr", full)
        for _ in range(2_000):  # more than any buffer keeps
            write_line("there is no room " * 10)
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
            write_line("no one reads")
        monkeypatch.undo()
        broken.detach()
