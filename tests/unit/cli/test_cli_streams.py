"""What the caller has done with the streams: closed them, or led them where nothing can be written."""

import subprocess
import sys
from pathlib import Path

import pytest

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
