"""Disks that are too small or closed, for one command: a mount that only that command sees, so nothing is left behind.

Where no mount is permitted (a container without rights) the nearest thing that the system offers to everyone is used.
"""

import os
import subprocess
from functools import cache
from pathlib import Path

MOUNT = 'mount -t tmpfs -o "$1" octoform-test "$0" && shift && exec "$@"'
LIMIT = 'ulimit -f "$0" && exec "$@"'
READ_ONLY = 'mount --bind "$0" "$0" && mount -o remount,bind,ro "$0" && cd "$0" && exec "$@"'
SPACE = ["unshare", "--map-root-user", "--mount", "sh", "-c"]


@cache
def mounts_are_permitted() -> bool:
    """Whether this user may mount something where only one command sees it."""
    try:
        done = subprocess.run([*SPACE, MOUNT, "/mnt", "size=64k", "true"], capture_output=True, check=False)
    except FileNotFoundError:
        return False
    return done.returncode == 0


def small_disk(folder: Path, kib: int) -> list[str]:
    """The beginning of a command for which ``folder`` is an empty disk of ``kib`` KiB.

    Without mounts: a command that may write no file of more than 8 KiB.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if mounts_are_permitted():
        return [*SPACE, MOUNT, str(folder), f"size={kib}k"]
    return ["sh", "-c", LIMIT, "16"]


def closed_folder(folder: Path) -> list[str]:
    """The beginning of a command that cannot write into ``folder``, not even as root where mounts are permitted."""
    folder.mkdir(parents=True, exist_ok=True)
    if mounts_are_permitted():
        return [*SPACE, MOUNT, str(folder), "ro"]
    if os.getuid() == 0:  # root without mounts writes everywhere but where there is no folder
        folder.rmdir()
        folder.write_text("not a folder")
    else:
        folder.chmod(0o555)
    return ["env"]


def read_only(folder: Path) -> list[str]:
    """The beginning of a command that works in ``folder``, which is there as it is and takes no change.

    Only where mounts are permitted.
    """
    return [*SPACE, READ_ONLY, str(folder)]
