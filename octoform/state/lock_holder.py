"""Who holds a lock, and whether that process still lives.

A pid alone is no identity: it is given again, and it means another process after a reboot, on another machine or in
another container. So a holder is pid, start time, boot, machine and pid namespace, as the kernel tells them. Light.
"""

import contextlib
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path

from octoform.base import digest
from octoform.base.clock import boot_id
from octoform.base.files import read
from octoform.base.processes import PROC, start_of

_MACHINE_ID = Path("/etc/machine-id")


class Liveness(StrEnum):
    """What can be found out about a holder from here."""

    ALIVE = "alive"
    DEAD = "dead"
    ELSEWHERE = "elsewhere"
    HIDDEN = "hidden"


@dataclass(frozen=True, slots=True)
class Process:
    """One process of one boot of one machine.

    ``start_time`` is field 22 of ``/proc/<pid>/stat`` (clock ticks since boot; None where there is no /proc),
    ``machine`` a digest of the machine id, ``namespace`` the pid namespace, ``host`` the node name.
    """

    pid: int
    start_time: int | None
    boot_id: str
    machine: str
    namespace: str
    host: str


def myself(proc: Path = PROC) -> Process:
    """The calling process."""
    pid = os.getpid()
    found = start_of(pid, proc)
    return Process(
        pid=pid,
        start_time=found,
        boot_id=boot_id(proc),
        machine=digest.short(digest.of_bytes(_text(_MACHINE_ID).encode())),
        namespace=_link(proc / "self/ns/pid"),
        host=os.uname().nodename,
    )


def liveness(holder: Process, me: Process, proc: Path = PROC) -> Liveness:
    """Whether ``holder`` lives, as far as ``me`` can know.

    ELSEWHERE: on another machine. HIDDEN: on this one, but in another pid namespace (a container), or where no boot
    id is reported.
    """
    if holder.boot_id != me.boot_id:
        return Liveness.DEAD if _same_machine(holder, me) and holder.boot_id and me.boot_id else Liveness.ELSEWHERE
    if me.boot_id == "":
        return Liveness.HIDDEN if _same_machine(holder, me) else Liveness.ELSEWHERE
    if holder.namespace != me.namespace:
        return Liveness.HIDDEN
    return Liveness.ALIVE if start_of(holder.pid, proc) == holder.start_time is not None else Liveness.DEAD


def _same_machine(one: Process, other: Process) -> bool:
    return one.machine == other.machine and one.host == other.host


def to_json(process: Process) -> dict[str, object]:
    """The JSON object of a process."""
    return asdict(process)


def from_json(document: Mapping[str, object]) -> Process:
    """The process in a JSON object; ValueError when it is none."""
    pid, began = document.get("pid"), document.get("start_time")
    texts = [document.get(name) for name in ("boot_id", "machine", "namespace", "host")]
    if not isinstance(pid, int) or not isinstance(began, int | None) or not all(isinstance(t, str) for t in texts):
        raise ValueError("no process")
    boot_id, machine, namespace, host = (str(text) for text in texts)
    return Process(pid, began, boot_id, machine, namespace, host)


def _text(path: Path) -> str:
    with contextlib.suppress(OSError):
        return read(path, 4096).decode("utf-8", "replace").strip()
    return ""


def _link(path: Path) -> str:
    with contextlib.suppress(OSError):
        return str(path.readlink())
    return ""
