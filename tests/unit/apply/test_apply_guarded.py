"""What is guarded is as it was after an attempt, whichever folder above it was changed; foreign files are left."""

import shutil
from pathlib import Path

import pytest

from octoform.apply.file_integrity import Guarded, Watch, begin, end


class Room:
    """A project with a guarded file and folder some levels deep; a home with a guarded file that is not there."""

    def __init__(self, folder: Path) -> None:
        self.home = folder / "home"
        self.project = folder / "work" / "project"
        self.file = self.project / "one" / "two" / "three" / "file"
        self.tree = self.project / "tree"
        self.absent = self.home / ".config" / "tool" / "deep" / "settings"
        for path in (self.file, self.tree / "inner" / "kept"):
            path.parent.mkdir(parents=True)
            path.write_text("as it was")
        for empty in (self.home, self.tree / "hollow"):
            empty.mkdir()

    def begin(self) -> Watch:
        return begin(self.project, Guarded([self.file, self.absent], [self.tree], home=self.home))

    def end(self, watch: Watch) -> dict[str, str]:
        """Severity of what is reported, by path."""
        found = end(watch, self.home.parent / "undone")
        assert {item.code for item in found} <= {"APPLY-OUTSIDE-WRITE"}
        assert self.file.read_text() == "as it was" and not self.absent.exists()
        assert [path.name for path in sorted(self.tree.rglob("*"))] == ["hollow", "inner", "kept"]
        return {str(item.path): item.severity.value for item in found}


@pytest.fixture
def room(tmp_path: Path) -> Room:
    return Room(tmp_path)


def test_nothing_is_told_of_an_attempt_that_changed_nothing(room: Room) -> None:
    assert room.end(room.begin()) == {}


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_a_folder_above_that_became_a_link_is_a_folder_again(room: Room, levels: int) -> None:
    watch, folder = room.begin(), room.file.parents[levels - 1]
    elsewhere = room.home.parent / "elsewhere"
    shutil.copytree(folder, elsewhere)
    shutil.rmtree(folder)
    folder.symlink_to(elsewhere)
    found = room.end(watch)
    assert found[str(folder.relative_to(room.project))] == "error" and not folder.is_symlink()


@pytest.mark.parametrize("levels", [0, 1, 2])
def test_a_link_on_the_way_to_what_is_not_there_goes(room: Room, levels: int) -> None:
    watch, place = room.begin(), (room.absent, *room.absent.parents)[levels]
    target = room.home.parent / "prepared"
    order = target / room.absent.relative_to(place)
    order.parent.mkdir(parents=True, exist_ok=True)
    order.write_text("an order")
    place.parent.mkdir(parents=True, exist_ok=True)
    place.symlink_to(target)
    assert room.end(watch)[str(place)] == "error"
    assert not place.is_symlink()


@pytest.mark.parametrize("name", ["project", "one", "one/two", "tree/inner"])
def test_rights_of_folders_above_are_put_back(room: Room, name: str) -> None:
    folder = room.project if name == "project" else room.project / name
    folder.chmod(0o755)
    watch = room.begin()
    folder.chmod(0o777)
    (found,) = room.end(watch).items()
    assert found == (str(folder) if name == "project" else name, "error")
    assert folder.stat().st_mode & 0o777 == 0o755


def test_rights_of_a_folder_in_the_home_that_leads_to_the_guarded_are_put_back(room: Room) -> None:
    folder = room.absent.parents[2]
    folder.mkdir(mode=0o755)
    watch = room.begin()
    folder.chmod(0o777)
    assert room.end(watch) == {str(folder): "error"}
    assert folder.stat().st_mode & 0o777 == 0o755


def test_what_is_new_in_a_guarded_folder_goes_with_its_folders(room: Room) -> None:
    watch = room.begin()
    (room.tree / "new" / "deep").mkdir(parents=True)
    (room.tree / "new" / "deep" / "file").write_text("an order")
    (room.tree / "link").symlink_to(room.home)
    (room.tree / "empty").mkdir()
    found = room.end(watch)
    assert found.keys() >= {"tree/new/deep/file", "tree/link"} and set(found.values()) == {"error"}


def test_what_is_new_in_the_home_is_told_and_left_and_what_leads_to_the_guarded_is_not(room: Room) -> None:
    watch = room.begin()
    (room.home / "stranger").write_text("a person's")
    (room.home / ".config").mkdir()
    assert room.end(watch) == {str(room.home / "stranger"): "warning"}
    assert (room.home / "stranger").read_text() == "a person's"


def test_what_came_to_a_place_while_the_link_that_leads_there_was_away_is_taken_away(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    way = tmp_path / "project" / "way"
    way.parent.mkdir()
    way.symlink_to(tmp_path / "elsewhere")
    watch = begin(way.parent, Guarded([way / "first", way, way / "second"], []))
    way.unlink()
    (tmp_path / "elsewhere" / "second").write_text("do as I say")
    found = end(watch, tmp_path / "undone")
    assert [item.path for item in found] == ["way", "way/second"]
    assert way.is_symlink() and list(way.iterdir()) == []
