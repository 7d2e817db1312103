"""Serving environments that all tests share stay as they were made: one that is built again spoils other tests.

What runs from it finds its files gone, its fork server is another one's. A test whose apply builds an environment again
or drops it takes copies: `Project.take_environments`.
"""

from pathlib import Path

import pytest

from octoform.endpoint.environment.model import MARKER

Identity = tuple[int, int, int]
OWN = "by it or by a test of another worker: which of them does so begins with copies (Project.take_environments)"


class KeptEnvironments:
    """The complete environments in some folders, each known by the folder of its interpreter from then on.

    It looks after each of thousands of tests: a folder in which nothing was made is not read.
    """

    def __init__(self) -> None:
        self._folders: dict[Path, int] = {}
        self._made: dict[Path, Identity | None] = {}

    def watch(self, folder: Path) -> None:
        """Look at the environments in this folder too."""
        self._folders.setdefault(folder, 0)

    def check(self) -> None:
        """Fail if one is not what it was."""
        if found := self.changed():
            pytest.fail(f"{' and '.join(found)} while this test ran, {OWN}", pytrace=False)

    def changed(self) -> list[str]:
        """Those that were built again or dropped since the last look, each with what happened."""
        found = []
        for interpreters, former in self._made.items():
            present = _identity(interpreters)
            if former != present:
                found.append(f"{interpreters.parent} was {'dropped' if present is None else 'built again'}")
                self._made[interpreters] = present
        for folder, last in self._folders.items():
            time = folder.stat().st_mtime_ns
            if time != last:
                self._folders[folder] = time if self._add(folder) else 0
        return found

    def _add(self, folder: Path) -> bool:
        """Take in those that are complete; whether all are."""
        present = [path for path in folder.iterdir() if not path.name.startswith(".")]
        whole = [path for path in present if (path / MARKER).exists()]
        self._made = {path / "bin": _identity(path / "bin") for path in whole} | self._made
        return len(whole) == len(present)


def _identity(interpreters: Path) -> Identity | None:
    """Which folder it is. That of the whole environment is changed by scripts, which leave their bytecode there."""
    try:
        status = interpreters.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_ctime_ns
