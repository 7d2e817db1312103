"""The ordinary user that a confined agent is where octoform runs as root.

A process of user 0 owns what root owns, and a file mode asks for nothing more: without any capability it may still
write ``/proc/sys`` and read what root keeps for itself. So in the sandbox of root's agents the first program becomes
that user for good. It keeps the groups that serial ports, cameras and buses belong to, as an ordinary user of the
hardware has them.
"""

import os
import pwd
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from octoform.base.files import walk
from octoform.records import dataclass

NAME = "nobody"
FALLBACK = 65534
MEMORY_MAJOR, CONSOLE_MAJOR, TERMINAL_MAJOR = 1, 4, 5
CONSOLES = 64
"""Device numbers of Linux (devices.txt): below this minor the major of consoles has no serial port."""


@dataclass(frozen=True, slots=True)
class AgentUser:
    """User id, and group ids with the user's own first."""

    uid: int
    groups: tuple[int, ...]

    def may_open(self, facts: os.stat_result) -> bool:
        """Whether the mode of a file lets this user read or write it."""
        if facts.st_uid == self.uid:
            return bool(facts.st_mode & 0o600)
        return bool(facts.st_mode & (0o060 if facts.st_gid in self.groups else 0o006))

    def may_pass(self, facts: os.stat_result) -> bool:
        """Whether the mode of a folder lets this user reach what lies in it."""
        if facts.st_uid == self.uid:
            return bool(facts.st_mode & 0o100)
        return bool(facts.st_mode & (0o010 if facts.st_gid in self.groups else 0o001))


def agent_user() -> AgentUser | None:
    """The user of agents; None where octoform itself is an ordinary user, whom they remain."""
    if os.geteuid() != 0:
        return None
    try:
        entry = pwd.getpwnam(NAME)
        uid, gid = entry.pw_uid, entry.pw_gid
    except KeyError:
        uid = gid = FALLBACK
    return AgentUser(uid, (gid, *sorted(_device_groups() - {gid})))


def _device_groups() -> set[int]:
    """The groups that may use character devices; none that opens disks, memory or terminals."""
    devices, closed = set[int](), {0}
    for path in _nodes(Path("/dev")):
        try:
            found = path.lstat()
        except OSError:
            continue  # gone since the folder was read
        if stat.S_ISBLK(found.st_mode) or (stat.S_ISCHR(found.st_mode) and _is_guarded(found.st_rdev)):
            closed.add(found.st_gid)
        elif stat.S_ISCHR(found.st_mode) and found.st_mode & stat.S_IRGRP:
            devices.add(found.st_gid)
    return devices - closed


def _is_guarded(device: int) -> bool:
    """Memory and terminals: a member of the group of terminals may write on everybody's."""
    major = os.major(device)
    return major in (MEMORY_MAJOR, TERMINAL_MAJOR) or (major == CONSOLE_MAJOR and os.minor(device) < CONSOLES)


def _nodes(folder: Path) -> Iterator[Path]:
    for place, folders, files in walk(folder):
        folders[:] = [name for name in folders if name not in ("pts", "shm", "mqueue", "hugepages")]
        yield from (place / name for name in files)


def hand_over(folder: Path, uid: int, gid: int) -> None:
    """Make all of a folder that user's; links are not followed, and what is gone meanwhile is not missed."""
    for place, folders, names in walk(folder):
        for path in (place, *(place / name for name in (*folders, *names))):
            with suppress(FileNotFoundError):
                os.chown(path, uid, gid, follow_symlinks=False)
