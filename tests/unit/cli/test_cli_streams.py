"""What the caller has done with the streams: closed them, or led them where nothing can be written."""

import itertools
import os
import subprocess
import sys
from pathlib import Path

import pytest
from cases import share
from ordinary import has_account

OCTOFORM = Path(sys.executable).parent / "octoform"
CLOSED = (">&-", "<&-", "2>&-", "<&- >&- 2>&-")


def run(words: str, streams: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    shell = ["sh", "-c", f'exec "$0" {words} {streams}', str(OCTOFORM)]
    return subprocess.run(shell, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("streams", CLOSED)
def test_a_stream_that_is_closed_ends_no_command(tmp_path: Path, streams: str) -> None:
    done = run("version", streams, tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    (tmp_path / "octopus.yaml").write_text("version: 1\n")
    before = sorted(tmp_path.iterdir())
    assert run("validate", streams, tmp_path).returncode == 0
    assert run("no-such-command", streams, tmp_path).returncode == 1
    assert sorted(tmp_path.iterdir()) == before and (tmp_path / "octopus.yaml").read_text() == "version: 1\n"


@pytest.mark.parametrize("words", ["version", "explain APPLY-AUTH", "schema"])
def test_output_that_cannot_be_written_is_one_sentence(tmp_path: Path, words: str) -> None:
    done = run(words, ">/dev/full", tmp_path)
    assert done.returncode == 1
    assert done.stderr.count("No space left on device") == 1 and "Exception ignored" not in done.stderr, done.stderr


@pytest.mark.parametrize(
    ("words", "streams"),
    share(
        itertools.product(
            ("validate -json", "plan -json", "status -json", "no-such-command", "validate"),
            (">/dev/full", "2>/dev/full", ">/dev/full 2>/dev/full"),
        ),
        4,
    ),
)
def test_a_problem_that_cannot_be_written_is_no_traceback(tmp_path: Path, words: str, streams: str) -> None:
    (tmp_path / "octopus.yaml").write_text("version: one\n")
    done = run(words, streams, tmp_path)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr, done.stderr
    assert done.stderr.count("No space left on device") == ("2>" not in streams and "-json" in words)


def test_a_folder_that_was_removed_is_named_as_such(tmp_path: Path) -> None:
    gone = 'mkdir gone; cd gone; rmdir ../gone; exec "$0" '
    environ = {"PATH": os.environ["PATH"]}  # a relative PYTHONPATH ends Python itself there
    for words, status in (("status", 1), ("init", 1), ("version", 0), ("explain PROJECT-NAME", 0)):
        command = ["sh", "-c", gone + words, str(OCTOFORM)]
        done = subprocess.run(command, cwd=tmp_path, env=environ, capture_output=True, text=True, check=False)
        assert done.returncode == status, done.stderr
        assert ("the folder that this shell is in was removed" in done.stderr) == bool(status)


@pytest.mark.parametrize("words", ["-chdir={} status", "{}", "status {}", "token create a {}", "plan -{}"])
def test_words_of_the_command_line_are_repeated_in_bounds_and_act_on_no_terminal(tmp_path: Path, words: str) -> None:
    text = "a\x1b[2J\nb" * 5000
    given = [word.replace("{}", text) for word in words.split()]
    done = subprocess.run([OCTOFORM, *given], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert len(done.stderr) < 2000 and "\x1b" not in done.stderr, done.stderr[:300]


@pytest.mark.parametrize("home", ["", "rel", "./x"])
def test_a_home_without_a_root_is_none(tmp_path: Path, home: str) -> None:
    script = (
        "import os, sys; sys.argv = ['octoform', 'version']; from octoform.cli.main import main; main();"
        "from pathlib import Path; print(Path('~').expanduser().is_absolute(), os.environ.get('HOME'),"
        " os.environ.get('XDG_CONFIG_HOME'))"
    )
    environ = {"PATH": "/usr/bin", "HOME": home, "XDG_CONFIG_HOME": home}
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environ, capture_output=True, text=True, check=False
    )
    # Where the user database has no home either, it is the root folder.
    assert done.stdout.splitlines()[-1] == f"True {None if has_account() else '/'} None", done.stderr
