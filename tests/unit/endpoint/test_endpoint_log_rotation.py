"""Archives of logs: nothing is lost, the writer goes on, errors outlive the oldest archive."""

import gzip
import os
from pathlib import Path

import pytest

from octoform.endpoint.process import log_rotation
from octoform.endpoint.process.log_rotation import ARCHIVES, archives, drop, rotate
from octoform.state.layout import Layout


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    layout = Layout(tmp_path, "bench")
    layout.logs.mkdir(parents=True)
    return layout


def everything(path: Path) -> bytes:
    """All lines that are left of a log, oldest first."""
    parts = sorted(path.parent.glob(f"{path.name}.*"), key=lambda one: -int(one.name.split(".")[2]))
    texts = [gzip.decompress(one.read_bytes()) if one.suffix == ".gz" else one.read_bytes() for one in parts]
    return b"".join([*texts, path.read_bytes() if path.exists() else b""])


@pytest.mark.parametrize("held_open", [False, True])
def test_every_line_is_there_once_and_in_order_and_a_writer_goes_on(layout: Layout, held_open: bool) -> None:
    path = layout.server_log if held_open else layout.call_log
    writer = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    written = b""
    for number in range(ARCHIVES):
        if not held_open:
            os.close(writer)
            writer = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        line = b"line %d\n" % number * 50
        os.write(writer, line)
        written += line
        assert rotate(path, held_open=held_open) == len(line)
    os.write(writer, b"last\n") if held_open else path.write_bytes(b"last\n")
    os.close(writer)
    assert everything(path) == written + b"last\n"
    assert path.read_bytes() == b"last\n"
    names = sorted(one.name for one in archives(layout))
    assert names == [f"{path.name}.1", *(f"{path.name}.{number}.gz" for number in range(2, ARCHIVES + 1))]
    assert {one.stat().st_mode & 0o077 for one in archives(layout)} == {0}


def test_the_oldest_archive_goes_and_its_errors_stay(layout: Layout) -> None:
    failure = b'{"event": "result", "tool": "read", "ok": false, "error": "OSError"}\n'
    for number in range(ARCHIVES + 3):
        layout.call_log.write_bytes(b'{"ok": true}\n%b{"number": %d}\n' % (failure, number))
        rotate(layout.call_log, held_open=False)
    assert len(archives(layout)) == ARCHIVES
    assert (layout.logs / "octoform.errors").read_bytes() == failure * 3


def test_errors_are_bounded_by_whole_lines_the_newest_first(layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_rotation, "MAX_ERROR_BYTES", 40)
    for number in range(4):
        old = layout.logs / "server.log.9"
        old.write_bytes(b"an Error of number %d\nnothing\n" % number)
        drop(old)
        assert not old.exists()
    assert (layout.logs / "server.errors").read_bytes() == b"an Error of number 3\n"


def test_an_archive_that_cannot_be_read_to_its_end_gives_what_it_has(layout: Layout) -> None:
    torn = layout.logs / "octoform.jsonl.4.gz"
    torn.write_bytes(gzip.compress(b"an Error\n" * 4000, 0)[:-4000])
    drop(torn)
    assert (layout.logs / "octoform.errors").read_bytes().count(b"an Error\n") > 1000


def test_a_compressed_archive_takes_the_plain_ones_place_only_when_it_is_whole(
    layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout.call_log.write_bytes(b"one\n")
    rotate(layout.call_log, held_open=False)
    layout.call_log.write_bytes(b"two\n")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(gzip.GzipFile, "write", full)
        with pytest.raises(OSError, match="No space"):
            rotate(layout.call_log, held_open=False)
    assert everything(layout.call_log) == b"one\ntwo\n"
    assert sorted(one.name for one in layout.logs.iterdir()) == ["octoform.jsonl.1", "octoform.jsonl.2"]
