"""The program `check` in an attempt's folder: it asks, somebody else judges, and nothing that it finds can fool it."""

import os
import subprocess
from pathlib import Path

import pytest

from octoform.apply.stage import attempt
from octoform.apply.stage.attempt import PROGRAM, REQUEST, SAID, Checks


def asked(folder: Path) -> tuple[int, str]:
    done = subprocess.run([folder / PROGRAM], capture_output=True, text=True, timeout=30, check=False)
    assert done.stderr == ""
    return done.returncode, done.stdout


def test_it_says_what_the_judge_finds_and_how_often_it_may_still_ask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attempt, "MAX_CHECKS", 2)
    found = ["- CODE at /devices/0: it is wrong", ""]
    with Checks(tmp_path, lambda: found.pop(0)) as checks:
        status, text = asked(tmp_path)
        assert (status, text) == (1, "it would be refused (1 check left):\n- CODE at /devices/0: it is wrong\n")
        assert asked(tmp_path) == (0, "it would be accepted, as far as that shows without running it (0 checks left)\n")
        assert asked(tmp_path) == (1, "this was asked 2 times; no more is judged before you end\n")
    assert checks.count == 2 and found == []


@pytest.mark.parametrize("trap", ["pipe", "link", "folder", "words"])
def test_whatever_stands_in_the_place_of_a_question_holds_nobody_up(tmp_path: Path, trap: str) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("theirs")
    place = tmp_path / REQUEST
    with Checks(tmp_path, lambda: "") as checks:
        if trap == "pipe":
            os.mkfifo(place)
        elif trap == "link":
            place.symlink_to(elsewhere)
        elif trap == "folder":
            place.mkdir()
        else:
            place.write_text("a\nb; rm -rf /\n" * 50)
    assert checks.count == 0
    assert elsewhere.read_text() == "theirs" and not (tmp_path / SAID).exists()


def test_an_answer_is_never_written_through_a_link(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("theirs")
    (tmp_path / SAID).symlink_to(elsewhere)
    with Checks(tmp_path, lambda: ""):
        assert asked(tmp_path)[0] == 0
    assert elsewhere.read_text() == "theirs"
