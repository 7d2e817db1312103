"""Folders that are there as a whole or not at all, with concurrent installers and after an interruption.

What is fetched goes into a sibling folder first and is renamed when it is whole. A lock, which the kernel drops with
its holder, makes a second installation wait and find the work done; what an interrupted one left is removed by the
next, and counts as nothing until then.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from octoform.base.locks import held
from octoform.diagnostics import Diagnostic
from octoform.records import dataclass

Fetch = Callable[[str, Path], str | None]
"""Put one requirement (``name==version``) of the Python package index into a folder; why not, or None."""


@dataclass(frozen=True, slots=True)
class Setup:
    """The surroundings of an installation: the cache folder, the caller's variables, the package tool, a reporter."""

    folder: Path
    environ: Mapping[str, str]
    fetch: Fetch
    report: Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Slot:
    """One such folder and what makes it.

    ``whole`` shows whether it is there. ``fill`` puts its content into an empty sibling folder; ``seal`` runs last, at
    the final place, proves the content and marks it as whole.
    """

    home: Path
    whole: Callable[[], bool]
    fill: Callable[[Path], Diagnostic | None]
    seal: Callable[[], Diagnostic | None] = lambda: None


def filled(slot: Slot, report: Callable[[str], None]) -> Diagnostic | None:
    """Make the slot's folder unless it is whole; what went wrong, or None. OSError when it cannot be written."""
    home = slot.home
    home.parent.mkdir(parents=True, exist_ok=True)
    with _alone(home.parent / f".{home.name}.lock", lambda: report("waiting for another installation of it")):
        if slot.whole():
            return None
        staging = home.parent / f".{home.name}.partial"
        _remove(staging)
        staging.mkdir()
        try:
            problem = slot.fill(staging)
            if problem is not None:
                return problem
            _remove(home)
            staging.rename(home)  # a folder, into a free place: no file is replaced
        finally:
            _remove(staging)
        problem = slot.seal()
        if problem is not None:
            _remove(home)
        return problem


def _remove(folder: Path) -> None:
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    elif folder.exists():
        shutil.rmtree(folder)


@contextmanager
def _alone(path: Path, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold an exclusive lock on ``path``; ``waiting`` is called when somebody else holds it."""
    with held(path, 0.0) as mine:
        if mine:
            yield
            return
    waiting()
    with held(path):
        yield
