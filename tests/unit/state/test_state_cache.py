"""Kept copies are given back whole or not at all, are bounded, and damage is distinguished from an edit."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from octoform.state import artifact_cache
from octoform.state.accepted import accept, file_digest
from octoform.state.artifact_cache import MAX_ASIDE, Damage, damage_of, move_aside
from octoform.state.layout import Layout

SERVER = b"import os\n\n\ndef tool():\n    return os.name\n"
FILES = {"server.py": SERVER, "runtime/faults.py": b"class Fault(Exception): ...\n"}


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    return Layout(tmp_path, "bench")


def test_what_was_accepted_is_kept_under_the_digest_of_the_state(layout: Layout) -> None:
    assert accept(layout, "serve", FILES) == []
    wanted = file_digest(layout, "serve") or ""
    assert artifact_cache.keep_accepted(layout, {"serve": wanted, "endpoint": ""}) is None
    assert artifact_cache.kept(layout, "serve", wanted) == FILES
    (layout.output("serve")).write_bytes(b"edited")
    assert artifact_cache.keep_accepted(layout, {"serve": wanted}) is None
    assert artifact_cache.kept(layout, "serve") == FILES
    assert artifact_cache.kept(layout, "serve", "sha256:0") is None
    assert {path.stat().st_mode & 0o077 for path in layout.kept.iterdir()} == {0}


def test_two_generations_stay_and_no_copy_without_a_name(layout: Layout) -> None:
    for number in range(5):
        assert artifact_cache.keep(layout, "serve", {"server.py": b"%d" % number, "same.py": b"same"}) is None
    found = [artifact_cache.kept(layout, "serve", artifact_cache.folder_digest(files)) for files in _generations()]
    assert [each is not None for each in found] == [False, False, False, True, True]
    assert len(list(layout.kept.iterdir())) == 1 + 3
    artifact_cache.keep(layout, "probe", {"output.json": b"{}"})
    artifact_cache.forget(layout, ["serve"])
    assert artifact_cache.kept(layout, "serve") is None and artifact_cache.kept(layout, "probe") is not None
    artifact_cache.forget(layout, ["probe"])
    assert not layout.kept.exists()


def _generations() -> list[dict[str, bytes]]:
    return [{"server.py": b"%d" % number, "same.py": b"same"} for number in range(5)]


def test_a_damaged_copy_or_index_gives_nothing_and_is_made_again(layout: Layout) -> None:
    artifact_cache.keep(layout, "serve", FILES)
    copy = next(path for path in layout.kept.iterdir() if path.read_bytes() == SERVER)
    copy.write_bytes(SERVER[:-1])
    assert artifact_cache.kept(layout, "serve") is None
    artifact_cache.keep(layout, "serve", FILES)
    assert artifact_cache.kept(layout, "serve") == FILES
    bent: tuple[object, ...] = ([["x"]], [], {}, "", 0, None)
    for text in (
        "",
        "{",
        '{"format": 7, "nodes": {}}',
        *(json.dumps({"format": 1, "nodes": {"serve": one}}) for one in bent),
    ):
        (layout.kept / "index.json").write_text(text)
        assert artifact_cache.kept(layout, "serve") is None
        artifact_cache.keep(layout, "serve", FILES)
        assert artifact_cache.kept(layout, "serve") == FILES


def test_what_is_too_large_is_not_kept(layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(artifact_cache, "MAX_BYTES", 10)
    assert artifact_cache.keep(layout, "serve", FILES) is None
    assert artifact_cache.kept(layout, "serve") is None


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (None, Damage.MISSING),
        (b"", Damage.TRUNCATED),
        (b"  \n", Damage.TRUNCATED),
        (SERVER[:20], Damage.TRUNCATED),
        (SERVER + b"\0\0", Damage.BROKEN),
        (b"\xff" + SERVER, Damage.BROKEN),
        (SERVER + b"def (:\n", Damage.BROKEN),
        (SERVER + b"<<<<<<< HEAD\n", Damage.BROKEN),
        (SERVER + b"# by hand\n", Damage.EDITED),
        (SERVER.replace(b"tool", b"fool"), Damage.EDITED),
        (SERVER, None),
    ],
)
def test_damage_is_what_no_person_wants_and_the_rest_is_an_edit(
    tmp_path: Path, data: bytes | None, expected: Damage | None
) -> None:
    path = tmp_path / "server.py"
    if data is not None:
        path.write_bytes(data)
    assert damage_of(path, SERVER) == expected


def test_a_link_a_folder_and_a_file_in_a_folders_place_are_damage(tmp_path: Path) -> None:
    path = tmp_path / "output.json"
    path.symlink_to(tmp_path / "elsewhere")
    assert damage_of(path, b"{}") is Damage.LINK
    (tmp_path / "folder").mkdir()
    assert damage_of(tmp_path / "folder", b"{}") is Damage.LINK
    (tmp_path / "file").write_bytes(b"")
    assert damage_of(tmp_path / "file" / "output.json", b"{}") is Damage.LINK


@given(some.binary(max_size=60), some.binary(min_size=1, max_size=60))
def test_only_the_very_bytes_are_whole(tmp_path_factory: pytest.TempPathFactory, data: bytes, wanted: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "damage.json"
    path.write_bytes(data)
    found = damage_of(path, wanted)
    assert (found is None) == (data == wanted)
    if found is Damage.EDITED:
        json.loads(data)


def test_nothing_is_lost_of_what_is_set_aside_and_edits_stay_for_ever(layout: Layout) -> None:
    layout.committed.mkdir(parents=True)
    path = layout.committed / "server.py"
    for number in range(MAX_ASIDE + 5):
        for why in (Damage.BROKEN, Damage.EDITED):
            path.write_bytes(b"%d" % number)
            target, problem = move_aside(layout, path, f"2026-01-01T00:00:{number:02}Z", why)
            assert problem is None and target is not None and target.read_bytes() == b"%d" % number
            assert not path.exists()
    names = [folder.name for folder in (layout.daemon / "aside").iterdir()]
    assert sum(name.endswith("-damaged") for name in names) == MAX_ASIDE
    assert sum(name.endswith("-edited") for name in names) == MAX_ASIDE + 5
    own = layout.endpoint / "connection.json"
    own.parent.mkdir(parents=True)
    own.write_text("{}")
    found, _ = move_aside(layout, own, "2026-01-01T00:00:59Z", Damage.EDITED)
    assert found is not None and "-damaged" in str(found)
    path.symlink_to("nowhere")
    link, _ = move_aside(layout, path, "2026-01-01T00:01:00Z", Damage.LINK)
    assert link is not None and link.is_symlink()
    assert move_aside(layout, path, "2026-01-01T00:02:00Z", Damage.LINK) == (None, None)
