"""What an agent may not touch is put back and reported; what a person may have done meanwhile is reported and left."""

import os
import sys
from pathlib import Path

import pytest

from octoform.apply import file_integrity, protected_paths


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name in ("octopus.yaml", "state/bench/probe/output.json", "notes.md"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{name}\n")
    return tmp_path


def watch(project: Path) -> file_integrity.Watch:
    return file_integrity.begin(
        project, file_integrity.Guarded([project / "octopus.yaml", project / "absent.md"], [project / "state"])
    )


def test_nothing_touched_is_nothing_told(project: Path) -> None:
    assert file_integrity.end(watch(project), project / ".octoform") == []


def test_guarded_files_are_put_back(project: Path) -> None:
    seen = watch(project)
    (project / "octopus.yaml").write_text("other\n")
    (project / "absent.md").write_text("new\n")
    (project / "state" / "bench" / "probe" / "output.json").unlink()
    (project / "state" / "stranger.json").write_text("{}")
    found = file_integrity.end(seen, project / ".octoform")
    assert sorted(item.path or "" for item in found) == [
        "absent.md",
        "octopus.yaml",
        "state/bench/probe/output.json",
        "state/stranger.json",
    ]
    assert {item.severity.value for item in found} == {"error"}
    assert (project / "octopus.yaml").read_text() == "octopus.yaml\n"
    assert (project / "state" / "bench" / "probe" / "output.json").exists()
    assert not (project / "absent.md").exists()
    assert not (project / "state" / "stranger.json").exists()


def test_a_link_in_the_place_of_a_guarded_file_is_taken_away_and_never_written_through(project: Path) -> None:
    seen = watch(project)
    foreign = project / "notes.md"
    (project / "octopus.yaml").unlink()
    (project / "octopus.yaml").symlink_to(foreign)
    assert [item.path for item in file_integrity.end(seen, project / ".octoform")] == ["octopus.yaml"]
    assert not (project / "octopus.yaml").is_symlink()
    assert (project / "octopus.yaml").read_text() == "octopus.yaml\n"
    assert foreign.read_text() == "notes.md\n"


@pytest.mark.parametrize("how", ["file", "folder", "pipe"])
def test_a_folder_or_file_of_the_other_kind_is_put_back_too(project: Path, how: str) -> None:
    seen = watch(project)
    if how == "folder":
        (project / "octopus.yaml").unlink()
        (project / "octopus.yaml").mkdir()
    elif how == "pipe":
        (project / "octopus.yaml").unlink()
        os.mkfifo(project / "octopus.yaml")
    else:
        output = project / "state" / "bench" / "probe" / "output.json"
        output.unlink()
        output.parent.rmdir()
        output.parent.write_text("in the way\n")
    assert file_integrity.end(seen, project / ".octoform")
    assert (project / "octopus.yaml").read_text() == "octopus.yaml\n"
    assert (project / "state" / "bench" / "probe" / "output.json").read_text() == "state/bench/probe/output.json\n"


def test_other_files_are_told_as_warnings_and_left(project: Path) -> None:
    seen = watch(project)
    (project / "notes.md").write_text("a person writes\n")
    found = file_integrity.end(seen, project / ".octoform")
    assert [(item.severity.value, item.path) for item in found] == [("warning", "notes.md")]
    assert (project / "notes.md").read_text() == "a person writes\n"


def test_a_link_that_a_person_uses_is_put_back_as_a_link(project: Path) -> None:
    manifest = project / "octopus.yaml"
    manifest.unlink()
    manifest.symlink_to("notes.md")
    seen = watch(project)
    manifest.unlink()
    manifest.write_text("other\n")
    assert file_integrity.end(seen, project / ".octoform")
    assert manifest.is_symlink()
    assert manifest.read_text() == "notes.md\n"


def test_a_folder_of_the_state_that_became_a_link_is_not_written_through(project: Path, tmp_path: Path) -> None:
    seen = watch(project)
    foreign = tmp_path.parent / f"{tmp_path.name}-foreign"
    foreign.mkdir()
    (foreign / "output.json").write_text("mine\n")
    folder = project / "state" / "bench" / "probe"
    (folder / "output.json").unlink()
    folder.rmdir()
    folder.symlink_to(foreign)
    assert file_integrity.end(seen, project / ".octoform")
    assert not folder.is_symlink()
    assert (folder / "output.json").read_text() == "state/bench/probe/output.json\n"
    assert (foreign / "output.json").read_text() == "mine\n"


def test_a_state_folder_that_a_person_keeps_elsewhere_stays_a_link(project: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path.parent / f"{tmp_path.name}-elsewhere"
    (project / "state").rename(elsewhere)
    (project / "state").symlink_to(elsewhere)
    seen = watch(project)
    (elsewhere / "bench" / "probe" / "output.json").write_text("{}")
    assert file_integrity.end(seen, project / ".octoform")
    assert (project / "state").is_symlink()
    assert (elsewhere / "bench" / "probe" / "output.json").read_text() == "state/bench/probe/output.json\n"


def test_what_is_undone_is_kept_for_whoever_wrote_it(project: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    """A person may have saved a file while an agent ran; the author is unknown, so nothing is lost."""
    outside = tmp_path_factory.mktemp("installed") / "identify.md"
    outside.write_text("the spec\n")
    seen = file_integrity.begin(
        project,
        file_integrity.Guarded(
            [project / "octopus.yaml", outside], [project / "state"], installed=frozenset({outside})
        ),
    )
    (project / "octopus.yaml").write_text("an hour of work\n")
    outside.write_text("another\n")
    (project / "state" / "stranger.json").write_text("{}")
    kept = project / ".octoform" / "undone"
    found = file_integrity.end(seen, kept)
    assert (kept / "octopus.yaml").read_text() == "an hour of work\n"
    assert (kept / "state" / "stranger.json").read_text() == "{}"
    assert outside.read_text() == "another\n", "an installation is shared: it is told and not put back"
    assert [item.path for item in found if item.path == str(outside)] == [str(outside)]
    assert ".octoform/undone/octopus.yaml" in (found[0].detail or "")


def test_what_came_to_a_room_is_taken_away_and_in_the_installation_only_told(
    project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    own, theirs = tmp_path_factory.mktemp("own"), tmp_path_factory.mktemp("theirs")
    wanted = file_integrity.Guarded([], [], [own, theirs], installed=frozenset({theirs}))
    watch = file_integrity.begin(project, wanted)
    for room in (own, theirs):
        (room / "planted.pth").write_text("import os\n")
        (room / "__pycache__").mkdir()
    found = file_integrity.end(watch, project / ".undone")
    assert [(item.severity, Path(item.path or "").parent) for item in found] == [("error", own), ("error", theirs)]
    assert not (own / "planted.pth").exists() and (theirs / "planted.pth").exists()
    assert (own / "__pycache__").is_dir(), "anyone who imports leaves bytecode"


def test_octoform_knows_what_its_own_interpreter_starts_with() -> None:
    started = protected_paths.of_octoform()
    [room] = started.rooms
    assert (room / "pytest").is_dir()
    assert Path(sys.prefix) / "pyvenv.cfg" in started.files
    assert {path for path in room.glob("*.pth")} <= set(started.files)


def test_what_is_new_in_the_home_folder_is_told_and_left(
    project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    home = tmp_path_factory.mktemp("home")
    for name in (".viminfo", ".profile"):
        (home / name).write_text("old\n")
    watch = file_integrity.begin(project, file_integrity.Guarded([home / ".profile"], [], home=home))
    (home / "notes.txt").write_text("new\n")
    (home / ".viminfo").write_text("what programs of the person write all the time\n")
    (home / ".profile").write_text("planted\n")
    lines = [(item.severity.value, item.path) for item in file_integrity.end(watch, project / ".undone")]
    assert lines == [("error", str(home / ".profile")), ("warning", str(home / "notes.txt"))]
    assert (home / "notes.txt").exists() and (home / ".profile").read_text() == "old\n"


def test_more_new_files_than_a_person_reads_are_counted_and_hidden_ones_are_told_as_well(project: Path) -> None:
    watch = file_integrity.begin(project, file_integrity.Guarded([], []))
    places = [project / ".idea" / "run.xml", *(project / "made" / f"{number}.txt" for number in range(30))]
    for path in places:
        path.parent.mkdir(exist_ok=True)
        path.write_text("new\n")
    cache = project / ".cache"
    cache.mkdir()
    (cache / "CACHEDIR.TAG").write_text("Signature: 8a477f597d28d172789f06886806bc55\n")
    (cache / "more").write_text("new\n")
    *named, last = file_integrity.end(watch, project / ".octoform" / "undone")
    assert [item.path for item in named][:2] == [".cache", ".idea/run.xml"] and len(named) == 20
    assert last.summary.startswith("12 more files") and "made/9.txt" in (last.detail or "")
