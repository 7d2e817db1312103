"""Sizes and times of a project's files, that show a change that is reported and left; what folders and links hold.

Of what other programs fill all the time, such as a repository, an environment or a cache, only that the folder is
there: a person or a program may be at work in it.
"""

import os
import stat
from collections.abc import Callable, Iterator
from itertools import chain, islice
from pathlib import Path

from octoform.base import files

MAX_FILES = 5000
_MAX_LINKED = 1000
"""Entries of a folder that a link leads to; a larger one is no folder of instructions."""
_MAX_HOPS = 8
MAX_TOLD = 20
"""Names that a person reads."""
_SKIPPED = frozenset((".git", ".octoform", "node_modules"))
"""Folders that other programs fill all the time."""
_MARKS = ("pyvenv.cfg", "CACHEDIR.TAG")
"""Files that say of a folder that a program made it and may make it again: an environment, a cache."""


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
    shown = names if len(names) <= MAX_TOLD else list(dict.fromkeys(str(Path(name).parent) for name in names))
    return ", ".join(shown[:MAX_TOLD]) + (", ..." if len(shown) > MAX_TOLD else "")


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
