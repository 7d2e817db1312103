"""Sizes and times of a project's files, that show a change that is reported and left; what folders and links hold.

Of what other programs fill all the time, such as a repository, an environment or a cache, only that the folder is
there: a person or a program may be at work in it.
"""

import os
import stat
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from itertools import chain, islice
from pathlib import Path

from octoform.base import files

MAX_FILES = 5000
_MAX_LINKED = 1000
"""Entries of a folder that a link leads to; a larger one is no folder of instructions."""
_MAX_HOPS = 8
MAX_NAMED = 20
"""Names that a person reads."""
_SKIPPED = frozenset((".git", ".octoform", "node_modules"))
"""Folders that other programs fill all the time."""
_MARKS = ("pyvenv.cfg", "CACHEDIR.TAG")
"""Files that say of a folder that a program made it and may make it again: an environment, a cache."""


class Gaps:
    """The folders that are not there, each looked for once: nothing is at a path below one of them.

    Most of the guarded paths are where a program would look for instructions, had the person that program.
    """

    def __init__(self) -> None:
        self._known = {"": False}

    def have(self, path: Path) -> bool:
        """Whether a folder above the path is not there."""
        return self._are_above(str(path))

    def forget(self) -> None:
        """Look again: folders may have been made."""
        self._known = {"": False}

    def _are_above(self, name: str) -> bool:
        folder = name.rpartition("/")[0]
        known = self._known.get(folder)
        if known is None:
            known = self._known[folder] = self._are_above(folder) or _is_nothing(folder)
        return known


def _is_nothing(place: str) -> bool:
    try:
        os.stat(place)  # noqa: PTH116 - for hundreds of names, which need be no paths
    except (FileNotFoundError, NotADirectoryError):
        return True
    except OSError:  # closed to this user
        return False
    return False


def listing(project: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of the project's files, bounded; of what programs fill themselves only that the folder is there."""
    found: dict[Path, tuple[int, int]] = {}
    own = _own_streams()
    for place, folders, names in files.walk(project):
        whole = [name for name in folders if (place / name).is_symlink() or _is_filled(place / name)]
        folders[:] = sorted(name for name in folders if name not in whole and name != "__pycache__")
        for path in (place / name for name in (*names, *whole)):
            if len(found) >= MAX_FILES:
                return found
            try:
                facts = path.lstat()
            except FileNotFoundError:  # gone since the folder was read: nothing to compare
                continue
            if stat.S_ISDIR(facts.st_mode):
                found[path] = (0, 0)
            elif (facts.st_dev, facts.st_ino) not in own:
                found[path] = (facts.st_size, facts.st_mtime_ns)
    return found


def _is_filled(folder: Path) -> bool:
    return folder.name in _SKIPPED or any((folder / mark).exists() for mark in _MARKS)


def _own_streams() -> set[tuple[int, int]]:
    """Where octoform itself prints: a person may have sent that into a file of the project."""
    found = set()
    for number in (1, 2):
        try:
            facts = os.fstat(number)
        except OSError:
            continue  # closed
        found.add((facts.st_dev, facts.st_ino))
    return found


def listed(names: list[str]) -> str:
    """Names, as many as a person reads; where there are more, the folders in which they lie."""
    shown = names if len(names) <= MAX_NAMED else list(dict.fromkeys(str(Path(name).parent) for name in names))
    return ", ".join(shown[:MAX_NAMED]) + (", ..." if len(shown) > MAX_NAMED else "")


def at_start(name: str) -> bool:
    """Whether an interpreter runs a file of that name among its packages before anything else (site, Python docs)."""
    return name.endswith(".pth") or name in ("sitecustomize.py", "usercustomize.py")


def is_entry(name: str) -> bool:
    return name != "__pycache__"


def names_in(room: Path, counts: Callable[[str], bool] = is_entry) -> frozenset[str]:
    try:
        with os.scandir(room) as entries:
            return frozenset(entry.name for entry in entries if counts(entry.name))
    except OSError:
        return frozenset()


def led_to(path: Path, whole: tuple[Path, ...]) -> Iterator[Path]:
    """The targets of the links at a path, and of those in a folder there: many people keep such files in a repository.

    Not a folder that holds one of ``whole``, nor one that is too large.
    """
    try:
        mode = os.lstat(path).st_mode
    except OSError:
        return
    found = [path] if stat.S_ISLNK(mode) else []
    if stat.S_ISDIR(mode) or (found and path.is_dir()):
        found += [
            place / name for place, *names in files.walk(path) for name in chain(*names) if (place / name).is_symlink()
        ]
    for link in found:
        for _ in range(_MAX_HOPS):
            link = Path(os.path.normpath(link.parent / link.readlink()))
            if any(each.is_relative_to(link) for each in whole) or _is_large(link):
                break
            yield link
            if not link.is_symlink():
                break


def _is_large(folder: Path) -> bool:
    entries = (name for _, folders, names in files.walk(folder) for name in (*folders, *names))
    return next(islice(entries, _MAX_LINKED, None), None) is not None


def inside(folder: Path, places: Iterable[Path]) -> list[Path]:
    """Those of the places that are the folder, or lie in it."""
    start = f"{folder}/".replace("//", "/")
    return [place for place in places if f"{place}/".startswith(start)]


def above(paths: Iterable[Path]) -> set[Path]:
    """Every folder above the paths, each taken once: many files share few folders."""
    found: set[str] = set()
    for name in map(str, paths):
        folder = name.rpartition("/")[0]
        while folder not in found:
            found.add(folder)
            folder = folder.rpartition("/")[0]
    return {_folder(name or "/") for name in found}


@lru_cache(1024)
def _folder(name: str) -> Path:
    """They are the same at each attempt, and to make them takes long."""
    return Path(name)
