"""One writer that leaves no half file, and one reader that nothing in a file's place can hold up or end."""

import contextlib
import errno
import os
import signal
import socket
import stat
from pathlib import Path
from typing import Any

import pytest

from octoform.base import files


def test_a_short_write_is_gone_on_with_and_a_full_disk_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, whole = tmp_path / "record.json", os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: whole(descriptor, bytes(data)[:3]))
    files.replace(path, b"0123456789")
    assert path.read_bytes() == b"0123456789"
    taken = iter([4])

    def full(descriptor: int, data: Any) -> int:
        room = next(taken, None)
        if room is None:
            raise OSError(errno.ENOSPC, "No space left on device")
        return whole(descriptor, bytes(data)[:room])

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space left"):
        files.replace(path, b"another ten bytes")
    assert path.read_bytes() == b"0123456789"
    assert [each.name for each in tmp_path.iterdir()] == ["record.json"]


def test_a_replaced_file_has_its_mode_and_a_link_is_never_followed(tmp_path: Path) -> None:
    elsewhere, path = tmp_path / "elsewhere", tmp_path / "record"
    elsewhere.write_bytes(b"mine")
    path.symlink_to(elsewhere)
    files.replace(path, b"new", 0o600)
    assert elsewhere.read_bytes() == b"mine" and path.read_bytes() == b"new"
    assert stat.S_ISREG(path.lstat().st_mode) and stat.S_IMODE(path.lstat().st_mode) == 0o600
    with pytest.raises(FileExistsError):
        files.create(path, b"again")


def test_a_folder_is_set_aside_only_where_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "record"
    path.mkdir()
    (path / "mine").write_bytes(b"kept")
    with pytest.raises(IsADirectoryError):
        files.replace(path, b"new")
    assert [each.name for each in tmp_path.iterdir()] == ["record"]
    files.make_way(path)
    files.replace(path, b"new")
    (aside,) = tmp_path.glob("record.aside-*")
    assert (aside / "mine").read_bytes() == b"kept"
    files.make_way(path)
    assert path.read_bytes() == b"new"


def test_steps_are_told_in_their_order_and_a_kill_between_leaves_no_draft(tmp_path: Path) -> None:
    seen: list[str] = []
    files.replace(tmp_path / "a", b"x", watch=seen.append)
    assert seen == ["written", "renamed", "synced"]

    def killed(step: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        files.replace(tmp_path / "b", b"x", watch=killed)
    assert [each.name for each in tmp_path.iterdir()] == ["a"]


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _link(path: Path) -> None:
    path.with_name("target").write_bytes(b"{}")
    path.symlink_to(path.with_name("target"))


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(2_000)


@pytest.mark.parametrize("trap", [_pipe, _link, Path.mkdir, _sparse, lambda path: path.symlink_to("/dev/zero")])
def test_whatever_stands_in_a_file_s_place_is_refused_at_once(tmp_path: Path, trap: Any) -> None:
    trap(tmp_path / "record")
    with pytest.raises(OSError):
        files.read(tmp_path / "record", 1_000, follow=False)
    if trap is not _link:
        with pytest.raises(OSError):
            files.read_json(tmp_path / "record", 1_000)


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as door, contextlib.chdir(path.parent):
        door.bind(path.name)


@pytest.mark.parametrize(
    ("trap", "words"),
    [
        (_pipe, "it is no regular file"),
        (_socket, "it is no regular file"),
        (Path.mkdir, "it is no regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "it is no regular file"),
        (lambda path: path.symlink_to(path.name), "it is a link to itself"),
    ],
)
def test_what_is_no_file_is_named_in_our_own_words(tmp_path: Path, trap: Any, words: str) -> None:
    trap(tmp_path / "record")
    with pytest.raises(OSError) as refusal:
        files.read(tmp_path / "record")
    assert refusal.value.strerror == words


@pytest.mark.parametrize(
    ("data", "words"),
    [(b'{"a": "\xe4"}', "it is not UTF-8 (byte 7)"), (b'{"a": "\\ud800"}', "a string has half a surrogate pair in it")],
)
def test_what_is_no_text_is_told_in_our_own_words(tmp_path: Path, data: bytes, words: str) -> None:
    (tmp_path / "record").write_bytes(data)
    with pytest.raises(ValueError) as refusal:
        files.read_json(tmp_path / "record")
    assert str(refusal.value) == words


def test_a_name_with_a_nul_is_no_file() -> None:
    with pytest.raises(OSError, match="name that no file"):
        files.read(Path("a\0b"))


@pytest.mark.parametrize(
    "data",
    [
        b"[" * 200_000,
        b"[" * 200_000 + b"]" * 200_000,
        b'{"a":' * 200 + b"1" + b"}" * 200,
        b"\xff\xfe{}",
        b'{"a": "\x00"}',
        b"[NaN]",
        b"[-Infinity]",
        b"[1e999]",
        b"1" * 5_000,
        b"",
        b"{} {}",
    ],
)
def test_what_is_no_document_or_could_harm_is_a_value_error(data: bytes) -> None:
    with pytest.raises(ValueError):
        files.parse(data)


@pytest.mark.parametrize("text", ['{"a": "x\\u0000"}', '{"\\u0000": 1}', '["\\ud800"]'])
def test_characters_that_no_file_name_can_hold_are_for_what_strangers_wrote(tmp_path: Path, text: str) -> None:
    (tmp_path / "record").write_text(text)
    with pytest.raises(ValueError):
        files.read_json(tmp_path / "record")
    assert files.read_json(tmp_path / "record", any_text=True)


def test_documents_are_read_as_they_are() -> None:
    assert files.parse(b'{"a": ["\\ud83d\\ude00", 1.5, {"b": null}], "c": "\\\\u0000"}') == {
        "a": ["😀", 1.5, {"b": None}],
        "c": "\\u0000",
    }
    deep = b"[" * files.MAX_DEPTH + b"]" * files.MAX_DEPTH
    files.parse(deep)


def test_a_head_is_bounded_where_a_whole_is_refused(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(b"0123456789")
    assert files.head(tmp_path / "log", 4) == b"0123"
    with pytest.raises(OSError, match="more than 4 bytes"):
        files.read(tmp_path / "log", 4)


def test_room_is_asked_for_and_given_back(tmp_path: Path) -> None:
    files.require_room(tmp_path, 4_096)
    assert [each.name for each in tmp_path.iterdir()] == []


def test_a_signal_in_the_middle_of_a_write_costs_no_byte(tmp_path: Path) -> None:
    """A handler runs while the kernel writes (EINTR), again and again."""
    data, heard = os.urandom(1 << 20) * 8, []
    former = signal.signal(signal.SIGALRM, lambda *_: heard.append(1))
    signal.setitimer(signal.ITIMER_REAL, 0.001, 0.001)
    try:
        files.replace(tmp_path / "record", data, synced=False)
        assert files.read(tmp_path / "record") == data
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, former)
    assert heard


@pytest.mark.parametrize("refusal", [errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EROFS])
def test_a_refusal_at_any_call_leaves_the_former_file(
    tmp_path: Path, refusal: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "record"
    files.replace(path, b"former")

    def refused(*_: Any, **__: Any) -> None:
        raise OSError(refusal, os.strerror(refusal))

    for owner, name in ((os, "open"), (os, "write"), (os, "fsync"), (Path, "replace")):
        with monkeypatch.context() as broken:
            broken.setattr(owner, name, refused)
            with pytest.raises(OSError, match=os.strerror(refusal)):
                files.replace(path, b"new")
        assert path.read_bytes() == b"former", name
        assert [each.name for each in tmp_path.iterdir()] == ["record"], name
    monkeypatch.setattr(os, "write", lambda *_: 0)
    with pytest.raises(OSError, match="No space left"):
        files.replace(path, b"new")


def test_a_device_and_a_socket_are_no_files(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(tmp_path / "door"))
        for place in (Path("/dev/null"), Path("/dev/zero"), Path("/proc/self/fd"), tmp_path / "door"):
            with pytest.raises(OSError):
                files.read(place)


def test_a_file_that_grows_while_it_is_read_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, plain = tmp_path / "log", os.read
    path.write_bytes(b"12")

    def growing(descriptor: int, size: int) -> bytes:
        with path.open("ab") as log:
            log.write(b"3456")
        return plain(descriptor, size)

    monkeypatch.setattr(os, "read", growing)
    with pytest.raises(OSError, match="more than 8 bytes"):
        files.read(path, 8)


def test_a_record_is_an_object_of_the_format_that_is_known() -> None:
    assert files.record({"format": 2, "a": 1}, 2) == {"format": 2, "a": 1}
    broken: list[Any] = [None, [], "x", {}, {"format": "2"}, {"format": None}, {"format": 1}, {"format": 3}]
    for value in broken:
        with pytest.raises(ValueError):
            files.record(value, 2)
    with pytest.raises(files.OtherFormatError, match="it has format 3, and this octoform reads 2") as later:
        files.record({"format": 3}, 2)
    with pytest.raises(files.OtherFormatError) as other:
        files.record({"format": True}, 1)
    assert later.value.is_newer and not other.value.is_newer


def test_a_private_folder_is_closed_with_all_that_was_missing_above(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    made = files.private_folder(tmp_path / "a" / "b" / "c")
    assert [stat.S_IMODE(each.stat().st_mode) for each in (made, *made.parents[:3])] == [0o700] * 3 + [0o755]
    made.chmod(0o750)
    assert files.private_folder(made) == made and stat.S_IMODE(made.stat().st_mode) == 0o750
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    for taken in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "nowhere"):
        with pytest.raises(OSError):
            files.private_folder(taken)
    assert not (tmp_path / "gone").exists()


def test_a_device_is_never_replaced(tmp_path: Path) -> None:
    device = tmp_path / "null"
    try:
        os.mknod(device, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("only root can make a device")
    with pytest.raises(FileExistsError, match="a device is in its place"):
        files.replace(device, b"x")
    assert stat.S_ISCHR(device.lstat().st_mode) and [each.name for each in tmp_path.iterdir()] == ["null"]
