"""What is read again and again: a pipe is not waited for, and JSON without end is no document."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from octoform.base.files import read, read_json
from octoform.endpoint.environment.model import MARKER, at
from octoform.endpoint.expected_tools import published
from octoform.endpoint.process.record import running
from octoform.endpoint.published_files import POLICY, file_digest, files_below, folder_digest, read_manifest
from octoform.state.layout import Layout

DEEP = "[" * 100_000


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to(path.name)])
def test_what_is_no_file_is_refused_and_never_waited_for(tmp_path: Path, make: Callable[[Path], None]) -> None:
    path = tmp_path / "one"
    make(path)
    with pytest.raises(OSError, match="one"):
        read(path)
    assert file_digest(path) is None


def test_a_link_to_a_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "one").write_text('{"a": 1}')
    (tmp_path / "two").symlink_to("one")
    assert read_json(tmp_path / "two") == {"a": 1}


def test_a_file_that_cannot_be_read_makes_another_folder_and_ends_nobody(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text("1")
    before = folder_digest(tmp_path)
    (tmp_path / ".#one.py").symlink_to("somebody@bench.4711:1700000000")  # as an editor marks what it edits
    assert files_below(tmp_path)[".#one.py"] == ""
    assert folder_digest(tmp_path) != before


@pytest.mark.parametrize("text", [DEEP, '{"format": 1, "digest": 5, "pid": 1e999, "tools": 5}', "\x00", "null"])
def test_damaged_documents_of_the_endpoint_tell_nothing_and_end_nobody(tmp_path: Path, text: str) -> None:
    layout = Layout(tmp_path, "bench")
    for path in (layout.endpoint / "manifest.json", layout.endpoint / POLICY, layout.run / "process.json"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / MARKER).write_text(text)
    assert read_manifest(layout) is None
    assert published(layout) == {}
    assert running(layout) is None
    assert at(tmp_path) is None


def test_the_record_of_a_process_with_a_number_that_is_none(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    layout.run.mkdir(parents=True)
    (layout.run / "process.json").write_text('{"pid": 1e999, "boot": ""}')
    assert running(layout) is None


@pytest.mark.parametrize("rest", ['"digest": "a"', '"lock": "a"'])
def test_a_marker_that_lacks_something_marks_no_environment(tmp_path: Path, rest: str) -> None:
    (tmp_path / MARKER).write_text(f'{{"distributions": [], {rest}}}')
    assert at(tmp_path) is None
