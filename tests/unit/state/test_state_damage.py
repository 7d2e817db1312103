"""Every way a state file can be no state: each worded apart, the good copy named, nothing overwritten."""

import json
import os
import re
from pathlib import Path

import pytest

from octoform.state.files import read_regular, refused, unforeseen_refusal, write_atomic
from octoform.state.layout import Layout
from octoform.state.model import NodeState
from octoform.state.store.quick_read import backup_path, parse, peek
from octoform.state.store.store import StateStore

PAGES = Path(__file__).parents[3] / "octoform/diagnostics/pages"


@pytest.fixture
def twice(layout: Layout) -> Layout:
    """A host with two serials: state file and previous copy."""
    store, _ = StateStore.open(layout)
    assert store is not None
    for key in ("one", "two"):
        store.success("probe", NodeState(key=key, seconds=1e-9, detail={"text": 'é\n"\x1f\\', "least": -3}))
        assert store.commit_snapshot() == []
    return layout


def code(layout: Layout) -> str:
    store, found = StateStore.open(layout)
    assert store is None
    assert peek(layout) is None
    assert len(found) == 1
    assert found[0].path and found[0].path.endswith("state.json")
    return found[0].code


def test_cut_anywhere_it_is_never_read(twice: Layout) -> None:
    data = twice.snapshot.read_bytes()
    for length in range(len(data) - 2):
        document, found = parse(data[:length], twice)
        assert document is None and [item.code for item in found] == ["STATE-TRUNCATED"], data[:length][-20:]
    for length in range(0, len(data) - 2, 50):
        twice.snapshot.write_bytes(data[:length])
        assert code(twice) == "STATE-TRUNCATED"
        assert twice.snapshot.read_bytes() == data[:length]


def test_the_previous_good_copy_is_named(twice: Layout) -> None:
    twice.snapshot.write_bytes(b"{")
    hint = StateStore.open(twice)[1][0].hint or ""
    assert "serial 1" in hint and str(backup_path(twice)) in hint
    twice.snapshot.write_bytes(backup_path(twice).read_bytes())
    store, found = StateStore.open(twice)
    assert store is not None and store.snapshot.nodes["probe"].key == "one" and found == []


def test_without_a_good_copy_git_is_named(twice: Layout) -> None:
    for damage in (b"[]", b"{", b'{"format": 1, "host": "other", "serial": 1}'):
        backup_path(twice).write_bytes(damage)
        twice.snapshot.write_bytes(b"{")
        assert "git log" in (StateStore.open(twice)[1][0].hint or "")


CONFLICT = """{
  "format": 1,
<<<<<<< HEAD
  "serial": 3
=======
  "serial": 4
>>>>>>> theirs
}
"""


@pytest.mark.parametrize(
    ("content", "wanted"),
    [
        (CONFLICT, "STATE-CONFLICT"),
        (CONFLICT.replace("\n", "\r\n"), "STATE-CONFLICT"),
        ("", "STATE-TRUNCATED"),
        ("\n\n", "STATE-TRUNCATED"),
        ("\0" * 4096, "STATE-TRUNCATED"),
        ('{"format": 1, "ho' + "\0" * 4000, "STATE-TRUNCATED"),
        ("not json", "STATE-NOT-STATE"),
        ("{'format': 1}", "STATE-NOT-STATE"),
        ("[]", "STATE-NOT-STATE"),
        ("null", "STATE-NOT-STATE"),
        ('{"lineage": "x"}', "STATE-NOT-STATE"),
        ('{"format": "1"}', "STATE-NOT-STATE"),
        ('{"format": 0}', "STATE-NOT-STATE"),
        ('{"format": 2, "octoform": "9.0"}', "STATE-NEWER"),
        ('{"format": 1, "host": "attic", "lineage": "l", "octoform": "0"}', "STATE-OTHER-HOST"),
        ('{"format": 1, "host": "bench", "octoform": "0"}', "STATE-NOT-STATE"),
        ('{"format": 1, "host": "bench", "lineage": "l", "octoform": "0", "serial": -1}', "STATE-NOT-STATE"),
        ("[" * 100_000, "STATE-NOT-STATE"),
    ],
)
def test_each_damage_has_its_own_code(twice: Layout, content: str, wanted: str) -> None:
    twice.snapshot.write_bytes(content.encode())
    assert code(twice) == wanted
    assert twice.snapshot.read_bytes() == content.encode()


@pytest.mark.parametrize("content", [b"\xff\xfe\x00x", b'{"format": 1, "host": "\xe9"}'])
def test_bytes_that_are_no_text(twice: Layout, content: bytes) -> None:
    twice.snapshot.write_bytes(content)
    assert code(twice) == "STATE-NOT-STATE"


def test_a_newer_state_tells_who_wrote_it(twice: Layout) -> None:
    twice.snapshot.write_text('{"format": 7, "octoform": "9.1.0", "nodes": "unheard of"}')
    summary = StateStore.open(twice)[1][0].summary
    assert "format 7" in summary and "9.1.0" in summary


def test_a_damaged_field_is_pointed_at(twice: Layout) -> None:
    document = json.loads(twice.snapshot.read_bytes())
    document["nodes"]["probe"]["attempts"] = "many"
    twice.snapshot.write_text(json.dumps(document))
    found = StateStore.open(twice)[1]
    assert (found[0].code, found[0].pointer) == ("STATE-NOT-STATE", "/nodes/probe/attempts")


def test_a_marker_inside_a_value_is_no_conflict(twice: Layout) -> None:
    store, _ = StateStore.open(twice)
    assert store is not None
    store.success("probe", NodeState(detail={"note": "<<<<<<< HEAD\n=======\n>>>>>>> theirs"}))
    assert store.commit_snapshot() == []
    assert peek(twice) is not None


def test_a_link_a_folder_and_a_pipe_are_refused(twice: Layout, tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.json"
    foreign.write_bytes(twice.snapshot.read_bytes())
    twice.snapshot.unlink()
    twice.snapshot.symlink_to(foreign)
    assert code(twice) == "STATE-LINK"
    twice.snapshot.unlink()
    twice.snapshot.mkdir()
    assert code(twice) == "STATE-LINK"
    twice.snapshot.rmdir()
    os.mkfifo(twice.snapshot)
    assert code(twice) == "STATE-LINK"


def test_a_huge_state_is_not_read(twice: Layout) -> None:
    with twice.snapshot.open("wb") as stream:
        stream.truncate(100 * 1024 * 1024 * 1024)
    assert code(twice) == "STATE-TOO-LARGE"


def test_a_corrupt_journal_stops_and_is_not_touched(twice: Layout) -> None:
    store, _ = StateStore.open(twice)
    assert store is not None
    store.begin("probe")
    data = twice.journal.read_bytes().replace(b'"op":"begin"', b'"op":"taint"')
    twice.journal.write_bytes(data)
    again, found = StateStore.open(twice)
    assert again is None and [item.code for item in found] == ["STATE-JOURNAL-CORRUPT"]
    assert twice.journal.read_bytes() == data


def test_every_code_of_the_package_has_a_page() -> None:
    folder = Path(__file__).parents[3] / "octoform/state"
    pattern = re.compile(r'"((?:STATE|GIT)-[A-Z-]+)"')
    codes = {code for path in folder.rglob("*.py") for code in pattern.findall(path.read_text())}
    assert len(codes) > 20
    for name in sorted(codes):
        text = (PAGES / f"{name}.md").read_text()
        assert text.startswith(f"# {name}: "), name
        assert 6 <= len(text.splitlines()) <= 30, name


def test_a_folder_that_is_a_link_to_itself_is_told_as_one(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    _, problem = read_regular(tmp_path / "loop" / "state.json")
    assert problem is not None
    assert problem.summary == "cannot be read: a folder on the way to it is a link to itself"
    assert problem.hint == "move away what is there and run the same command again"
    problem = write_atomic(tmp_path / "loop" / "state.json", b"{}")
    assert problem is not None
    assert problem.summary == "cannot be written: a folder on the way to it is a link to itself"


def test_what_stands_in_the_place_of_a_folder_is_told_with_what_to_do(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "probe")
    below = write_atomic(tmp_path / "probe" / "output.json", b"{}")
    assert below is not None
    assert below.summary == "cannot be written: a folder on the way to it is none"
    with pytest.raises(FileExistsError) as refusal_of_folder:
        (tmp_path / "probe").mkdir(exist_ok=True)
    there = refused(refusal_of_folder.value, tmp_path / "probe")
    assert there.summary == "cannot be written: what is there is no folder"
    unforeseen = unforeseen_refusal(refusal_of_folder.value)
    assert unforeseen.summary == "the operating system refused: what is there is no folder"
    assert below.hint == there.hint == unforeseen.hint == "move away what is there and run the same command again"
