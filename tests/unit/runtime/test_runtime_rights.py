"""Which nodes are closed to a user, and which one command opens them."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from octoform.runtime.where import Account, Node, refused, remedy

ANA = Account("ana", groups=frozenset({1000}), listed=frozenset({1000}))
JOINED = Account("ana", groups=frozenset({1000}), listed=frozenset({1000, 20}))
NOBODY = 65534
CASES = [
    (
        "a group that the user is not in",
        Node("/dev/ttyACM0", "tty", 0o660, 20, "dialout"),
        ANA,
        "usermod -aG dialout ana",
    ),
    (
        "a group that came after the login",
        Node("/dev/ttyACM0", "tty", 0o660, 20, "dialout"),
        JOINED,
        "log in again: ana",
    ),
    ("root alone", Node("/dev/hidraw0", "hidraw", 0o600, 0, "root"), ANA, 'KERNEL=="hidraw0", GROUP="plugdev"'),
    ("root's group", Node("/dev/ttyS0", "tty", 0o660, 0, "root"), ANA, 'KERNEL=="ttyS0", GROUP="dialout"'),
    (
        "a group that may only read",
        Node("/dev/video0", "video4linux", 0o640, 44, "video"),
        ANA,
        'GROUP="video", MODE="0660"',
    ),
    ("reading is enough", Node("/dev/input/event0", "input", 0o640, 105, "input"), ANA, "usermod -aG input ana"),
]


@pytest.mark.parametrize(("node", "who", "words"), [case[1:] for case in CASES], ids=[case[0] for case in CASES])
def test_the_remedy_is_one_command_that_grants_what_is_needed(node: Node, who: Account, words: str) -> None:
    assert words in remedy(node, who)


def test_who_has_to_log_in_again_is_not_told_to_join_the_group_twice() -> None:
    assert "usermod" not in remedy(CASES[0][1], JOINED)


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder that everybody may enter; the ones of pytest are private."""
    with TemporaryDirectory() as made:
        Path(made).chmod(0o755)
        yield Path(made)


def as_user(kind: str, path: Path, groups: list[int]) -> list[dict[str, Any]]:
    """The answer for an ordinary user with these groups, from a process of its own."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.setgroups(groups)
        os.setgid(NOBODY)
        os.setuid(NOBODY)
        os.write(writer, json.dumps(refused([(kind, str(path))])).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as answer:
        found: list[dict[str, Any]] = json.loads(answer.read())
    os.waitpid(child, 0)
    return found


@pytest.mark.skipif(os.geteuid() != 0, reason="only root becomes another user")
@pytest.mark.parametrize(
    ("kind", "mode", "groups", "lacks"),
    [
        ("tty", 0o660, [], "read and write to"),
        ("tty", 0o660, [20], None),
        ("tty", 0o664, [], "write to"),
        ("tty", 0o666, [], None),
        ("tty", 0o600, [20], "read and write to"),
        ("input", 0o640, [20], None),
        ("input", 0o640, [], "read"),
        ("block", 0o600, [], None),
    ],
)
def test_an_ordinary_user_and_a_node(folder: Path, kind: str, mode: int, groups: list[int], lacks: str | None) -> None:
    node = folder / "node"
    node.write_bytes(b"")
    os.chown(node, 0, 20)
    node.chmod(mode)
    found = as_user(kind, node, groups)
    assert [each["lacks"] for each in found] == ([] if lacks is None else [lacks])
    assert all(each["mode"] == f"{mode:04o}" and each["group"] == "dialout" for each in found)


def test_a_node_that_is_not_there_is_no_matter_of_rights(folder: Path) -> None:
    assert refused([("tty", str(folder / "gone"))]) == []
