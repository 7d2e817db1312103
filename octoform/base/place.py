"""Which folder on which machine a record was written in, so that a copy of the folder owns nothing of the original.

`cp -a` and a backup take records along whose process is alive, only not theirs. The kernel's name of a folder (device
and inode) goes with it when it is renamed and never with a copy, and the machine's id does not leave the machine.
The machine may get another id meanwhile (`systemd-machine-id-setup`, a container with its own): where a record shows
which start of the machine it is of, the same start is the same machine. Standard library only.
"""

import hashlib
from pathlib import Path
from typing import Any

from octoform.base.clock import boot_id

KEY = "place"
BOOT = ("boot", "boot_id")
"""Members by which records name the start of the machine that they are of."""
_MACHINE_ID = Path("/etc/machine-id")


def place_of(folder: Path) -> dict[str, object]:
    """The folder as the kernel knows it, and a digest of the machine's id; OSError when there is no such folder."""
    facts = folder.stat()
    return {"device": facts.st_dev, "inode": facts.st_ino, "machine": _machine()}


def is_from(record: Any, folder: Path) -> bool:
    """Whether a record was written in exactly this folder; one of an octoform that noted no place counts as such."""
    if not isinstance(record, dict) or KEY not in record:
        return True
    noted = record[KEY]
    try:
        here = place_of(folder)
    except OSError:
        return False
    if noted == here:
        return True
    of_now = boot_id() in {record.get(name) for name in BOOT if isinstance(record.get(name), str)} - {""}
    return of_now and isinstance(noted, dict) and {**noted, "machine": None} == {**here, "machine": None}


def _machine() -> str:
    try:
        return hashlib.sha256(_MACHINE_ID.read_bytes().strip()).hexdigest()[:12]
    except OSError:
        return ""
