"""The file tools of the small agent: what they read, where they write, and what they leave alone."""

import os
import socket
from pathlib import Path

import pytest

from octoform.harness.react.agent_tools import READ_BYTES, ToolResult, patch, read_file, write_file


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The attempt's folder, with something beside it."""
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "there").write_text("theirs")
    own = tmp_path / "own"
    own.mkdir()
    return own


def test_a_whole_file_and_parts_of_it(folder: Path) -> None:
    (folder / "a").write_text("".join(f"line {number}\n" for number in range(1, 11)))
    assert read_file(folder, "a").text.splitlines()[0] == "line 1"
    assert "[lines" not in read_file(folder, "a").text
    assert read_file(folder, "a", 4, 2) == ToolResult("line 4\nline 5\n[lines 4 to 5 of 10]")
    assert read_file(folder, str(folder / "a"), 9) == ToolResult("line 9\nline 10\n[lines 9 to 10 of 10]")
    assert read_file(folder, "a", 11) == ToolResult("[nothing there: the file has 10 lines]")
    (folder / "empty").touch()
    assert read_file(folder, "empty") == ToolResult("[the file is empty]")


def test_reading_is_bounded(folder: Path) -> None:
    (folder / "lines").write_text("0123456789\n" * 100_000)
    (folder / "line").write_bytes(b"x" * 5_000_000)
    lines, line = read_file(folder, "lines").text, read_file(folder, "line").text
    assert len(lines) < READ_BYTES + 100 and lines.endswith("of 100000]")
    assert len(line) < READ_BYTES + 100 and line.endswith("[lines 1 to 1 of 1, the last one cut]")


def test_a_kernel_file_is_read_and_a_device_is_not_opened(folder: Path) -> None:
    assert "processor" in read_file(folder, "/proc/cpuinfo").text
    os.mkfifo(folder / "pipe")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(folder / "sock"))
        for special in ("pipe", "sock", "/dev/null", "."):
            assert read_file(folder, special) == ToolResult(f"{special} is no plain file", failed=True)
    primary, secondary = os.openpty()
    try:
        assert read_file(folder, os.ttyname(secondary)).failed
    finally:
        os.close(primary)
        os.close(secondary)


@pytest.mark.parametrize("path", ["missing", "a\0b", "x" * 5000, "missing/below"])
def test_what_cannot_be_read_is_said(folder: Path, path: str) -> None:
    assert read_file(folder, path).failed


def test_hidden_signs_are_shown(folder: Path) -> None:
    (folder / "a").write_bytes(b"\xff\x1b[2J\r\n\xe2\x80\xae")
    assert read_file(folder, "a").text == "\ufffd\\x1b[2J\r\n\\u202e"


def test_a_file_is_written_whole_and_with_its_folders(folder: Path) -> None:
    found = write_file(folder, "new/deep/a.txt", "caf\u00e9\n")
    assert found == ToolResult("6 bytes written to new/deep/a.txt")
    assert (folder / "new/deep/a.txt").read_text("utf-8") == "caf\u00e9\n"
    (folder / "run").write_text("old")
    (folder / "run").chmod(0o750)
    assert not write_file(folder, str(folder / "run"), "new").failed
    assert (folder / "run").read_text() == "new"
    assert (folder / "run").stat().st_mode & 0o777 == 0o750
    assert [path.name for path in folder.iterdir() if path.name.endswith(".part")] == []


@pytest.mark.parametrize("path", ["../outside/there", "/etc/octoform-test", ".", "", "a/../../outside/there", ".."])
def test_nothing_is_written_outside(folder: Path, path: str) -> None:
    for text in (write_file(folder, path, "mine"), patch(folder, path, [{"old": "theirs", "new": "mine"}])):
        assert text.failed and "is not below your folder" in text.text
    assert (folder.parent / "outside" / "there").read_text() == "theirs"


def test_no_link_is_followed_when_writing(folder: Path) -> None:
    there = folder.parent / "outside" / "there"
    (folder / "file").symlink_to(there)
    (folder / "way").symlink_to(there.parent)
    for path in ("file", "way/there", "way/new"):
        assert write_file(folder, path, "mine").failed
        assert patch(folder, path, [{"old": "theirs", "new": "mine"}]).failed
    assert there.read_text() == "theirs"
    assert sorted(path.name for path in there.parent.iterdir()) == ["there"]
    assert (folder / "file").is_symlink()


def test_nothing_but_a_plain_file_is_replaced(folder: Path) -> None:
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    for path in ("pipe", "folder"):
        assert write_file(folder, path, "x").failed
        assert patch(folder, path, [{"old": "x", "new": "y"}]).failed


def test_descriptors_are_given_back(folder: Path) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(20):
        write_file(folder, "a/b/c", "x")
        write_file(folder, "a/b/c/d", "x")
        patch(folder, "a/b/missing", [{"old": "x", "new": "y"}])
        patch(folder, "a/missing/c", [{"old": "x", "new": "y"}])
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_replacements_in_their_order(folder: Path) -> None:
    (folder / "a").write_bytes(b"one\r\ntwo\nthree\n")
    found = patch(folder, "a", [{"old": "one\r\n", "new": "1\n"}, {"old": "1\ntwo", "new": "1\n2"}])
    assert found == ToolResult("2 replacement(s) made in a")
    assert (folder / "a").read_bytes() == b"1\n2\nthree\n"


@pytest.mark.parametrize(
    ("edits", "told"),
    [
        ([{"old": "x", "new": "y"}], "edit 1 of 1: old is not in the file; read the file"),
        ([{"old": "b", "new": "y"}], "edit 1 of 1: old is in the file 2 times; add the lines around"),
        ([{"old": "a", "new": "c"}, {"old": "a", "new": "y"}], "edit 2 of 2: old is not in the file"),
        ([{"old": "", "new": "y"}], "edit 1 of 1: old is empty"),
        ([], "edits is empty"),
    ],
)
def test_all_replacements_are_made_or_none(folder: Path, edits: list[dict[str, str]], told: str) -> None:
    (folder / "file").write_text("a b b")
    found = patch(folder, "file", edits)
    assert found.failed and found.text.startswith(told) and "nothing was changed" in found.text
    assert (folder / "file").read_text() == "a b b"


def test_what_is_no_text_is_not_patched(folder: Path) -> None:
    (folder / "a").write_bytes(b"\xff\xfe x")
    assert "is not UTF-8 text" in patch(folder, "a", [{"old": "x", "new": "y"}]).text
    assert patch(folder, "missing", [{"old": "x", "new": "y"}]).failed
