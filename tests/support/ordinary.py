"""An ordinary user for tests that run as root: what holds for one has to hold for the other."""

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

OPEN_PYTHON = Path("/usr/bin/python3")
"""An interpreter that every user can start; that of the tests may lie in root's home."""
POSSIBLE = os.geteuid() == 0 and shutil.which("setpriv") is not None
"""Only root can become another user."""


def has_account() -> bool:
    """Whether the user of the tests has an entry in the user database; in a container they may have a number alone."""
    try:
        pwd.getpwuid(os.getuid())
    except KeyError:
        return False
    return True


class User:
    """An ordinary user and a folder of theirs; the one right they are given is to read this interpreter of root's."""

    def __init__(self, place: Path, number: int = 65534) -> None:
        self.place = place
        self._id = number
        read = "+dac_read_search"
        who = [f"--reuid={self._id}", f"--regid={self._id}", "--clear-groups"]
        self.prefix = ["setpriv", *who, f"--inh-caps={read}", f"--ambient-caps={read}", "--"]

    def owns_all(self) -> None:
        subprocess.run(["chown", "-R", "-h", f"{self._id}:{self._id}", str(self.place)], check=True)


@contextmanager
def ordinary_user(number: int = 65534) -> Iterator[User]:
    """Their folder lies beside the tests' own, which is closed to others, and is gone afterwards.

    Limits count what all processes of a user have: a test of one takes a ``number`` that no other has.
    """
    place = Path(tempfile.mkdtemp(prefix="ordinary."))
    place.chmod(0o755)
    try:
        yield User(place, number)
    finally:
        shutil.rmtree(place)
