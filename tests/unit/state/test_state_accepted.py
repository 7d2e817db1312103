"""Artifacts: put in place as a whole, seen as they are, and no link ever followed."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.base.files import TEMPORARY
from octoform.state.accepted import accept, file_digest, observe
from octoform.state.artifact_cache import read_instances, write_instances
from octoform.state.layout import STAGES, Layout

names = st.sampled_from(["runtime/a.py", "runtime/b.py", "notes.txt", "deep/er/x", "runtime/sub/y"])
trees = st.dictionaries(names, st.binary(max_size=20), max_size=4).map(lambda tree: {"server.py": b"x", **tree})


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@given(st.lists(trees, min_size=1, max_size=4))
def test_a_stage_has_exactly_the_files_accepted_last(layout: Layout, history: list[dict[str, bytes]]) -> None:
    digests: dict[str, str | None] = {}
    for tree in history:
        assert accept(layout, "serve", tree) == []
        assert files(layout.committed / "serve") == tree
        digests.setdefault(str(sorted(tree.items())), file_digest(layout, "serve"))
        assert digests[str(sorted(tree.items()))] == file_digest(layout, "serve")
    assert len(set(digests.values())) == len(digests)
    assert list(layout.committed.glob(f".*{TEMPORARY}")) == []


def test_nothing_is_there_at_first(layout: Layout) -> None:
    facts = observe(layout)
    assert set(facts) == set(STAGES)
    assert all((item.exists, item.digest, item.is_link, item.problem) == (False, None, False, None)
               for item in facts.values())  # fmt: skip
    assert file_digest(layout, "endpoint") is None


def test_an_edit_an_addition_and_a_removal_are_seen(layout: Layout) -> None:
    accept(layout, "serve", {"server.py": b"1", "runtime/bus.py": b"2"})
    before = file_digest(layout, "serve")
    folder = layout.committed / "serve"
    seen = {before}
    (folder / "runtime/bus.py").write_bytes(b"3")
    seen.add(file_digest(layout, "serve"))
    (folder / "more.py").write_bytes(b"")
    seen.add(file_digest(layout, "serve"))
    (folder / "more.py").unlink()
    (folder / "runtime/bus.py").rename(folder / "runtime/train.py")
    seen.add(file_digest(layout, "serve"))
    assert len(seen) == 4 and None not in seen
    (folder / "server.py").unlink()
    assert observe(layout)["serve"].digest is None


def test_what_python_and_editors_leave_is_no_edit(layout: Layout) -> None:
    accept(layout, "serve", {"server.py": b"1", "runtime/bus.py": b"2"})
    before = file_digest(layout, "serve")
    folder = layout.committed / "serve"
    (folder / "runtime/__pycache__").mkdir()
    (folder / "runtime/__pycache__/bus.pyc").write_bytes(b"x")
    (folder / ".server.py.swp").write_bytes(b"x")
    assert file_digest(layout, "serve") == before
    assert accept(layout, "serve", {"server.py": b"1"}) == []
    assert (folder / "runtime/__pycache__/bus.pyc").exists()


@pytest.mark.parametrize("where", ["server.py", "runtime/bus.py", "runtime", "extra", ""])
def test_a_link_is_seen_never_followed_and_replaced(layout: Layout, tmp_path: Path, where: str) -> None:
    wanted = {"server.py": b"1", "runtime/bus.py": b"2"}
    accept(layout, "serve", wanted)
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "server.py").write_bytes(b"precious")
    (foreign / "bus.py").write_bytes(b"precious")
    place = layout.committed / "serve" / where
    if place.is_dir():
        place.rename(layout.project / "away")
    else:
        place.unlink(missing_ok=True)
    place.symlink_to(foreign / "server.py" if place.suffix else foreign)
    facts = observe(layout)["serve"]
    assert (facts.exists, facts.digest, facts.is_link) == (False, None, True)
    assert accept(layout, "serve", wanted) == []
    assert observe(layout)["serve"].digest is not None
    assert files(layout.committed / "serve") == wanted
    assert files(foreign) == {"server.py": b"precious", "bus.py": b"precious"}


def test_a_folder_or_a_pipe_in_a_file_s_place(layout: Layout) -> None:
    accept(layout, "probe", {"output.json": b"{}"})
    layout.output("probe").unlink()
    layout.output("probe").mkdir()
    assert observe(layout)["probe"].digest is None
    assert accept(layout, "probe", {"output.json": b"{}"}) == []
    layout.output("probe").unlink()
    os.mkfifo(layout.output("probe"))
    facts = observe(layout)["probe"]
    assert facts.digest is None and facts.problem is not None
    assert accept(layout, "probe", {"output.json": b"{}"}) == []
    assert observe(layout)["probe"].digest is not None


def test_too_many_files_are_a_problem_and_no_wait(layout: Layout) -> None:
    accept(layout, "probe", {"output.json": b"{}"})
    for number in range(1001):
        (layout.committed / "probe" / f"x{number}").touch()
    facts = observe(layout)["probe"]
    assert facts.digest is None and facts.problem is not None


@pytest.mark.parametrize(
    "name", ["../x", "/etc/x", "a/../x", ".hidden", "a/.b", "a//b", "", ".", "__pycache__/x", "a\0"]
)
def test_a_name_that_leaves_the_folder_is_a_bug(layout: Layout, name: str) -> None:
    with pytest.raises(ValueError, match="no name"):
        accept(layout, "probe", {"output.json": b"", name: b""})
    assert not layout.committed.exists()


def test_files_without_the_output_are_a_bug(layout: Layout) -> None:
    with pytest.raises(ValueError, match=r"server\.py"):
        accept(layout, "serve", {"output.json": b""})


def test_a_refused_write_changes_nothing(layout: Layout) -> None:
    accept(layout, "serve", {"server.py": b"1", "runtime/bus.py": b"2"})
    before = files(layout.committed)

    def full(name: str) -> None:
        if name == "artifact.written":
            raise OSError(28, os.strerror(28))

    [problem] = accept(layout, "serve", {"server.py": b"new"}, full)
    assert problem.code == "STATE-DISK-FULL"
    assert files(layout.committed) == before


def test_the_ledger_of_instances_is_private(layout: Layout) -> None:
    assert read_instances(layout) == (None, [])
    devices = {"usb-045e-0772": {"serial": "SN1", "strength": "strong"}}
    assert write_instances(layout, devices) == []
    assert read_instances(layout) == (devices, [])
    assert layout.instances.stat().st_mode & 0o777 == 0o600
    assert layout.local.stat().st_mode & 0o777 == 0o700
    assert (layout.local.parent / ".gitignore").read_text() == "*\n"
    layout.local.chmod(0o755)
    write_instances(layout, devices)
    assert layout.local.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"format": 2, "devices": {}}', '{"format": 1, "devices": []}'])
def test_a_damaged_ledger_is_said(layout: Layout, content: str) -> None:
    write_instances(layout, {})
    layout.instances.write_text(content)
    devices, found = read_instances(layout)
    assert devices is None and [item.code for item in found] == ["STATE-INSTANCES"]
