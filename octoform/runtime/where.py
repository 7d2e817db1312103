"""Reports where device ids are attached now: a program for octoform's own commands, which touch no hardware.

``python -m octoform.runtime.where`` with {id: [classes]} as JSON on standard input and the runtime's environment; one
JSON object by id on standard output. Names in sysfs are read and nothing is opened.
"""

import grp
import json
import os
import pwd
import stat
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .base.files import parse
from .devices import device
from .faults import AmbiguousDevice, DeviceFault
from .sysfs import path_of, sysroot


def main() -> int:
    """Answer for every id that was asked for."""
    asked: Mapping[str, Iterable[str]] = parse(sys.stdin.read())
    print(json.dumps({name: whereabouts(name, classes) for name, classes in asked.items()}))
    return 0


def whereabouts(device_id: str, classes: Iterable[str] = ()) -> dict[str, Any]:
    """``attached``, ``port``, ``sysfs``, ``strength``, ``nodes``; ``doubt`` is why nothing would be moved with it.

    ``refused`` are the nodes that this user may not use (`refused`).
    """
    answer: dict[str, Any] = {"attached": False, "port": "", "sysfs": "", "strength": "", "nodes": [], "doubt": ""}
    answer["refused"] = []
    try:
        found = device(device_id)
    except DeviceFault as problem:
        return {**answer, "doubt": str(problem)}
    kinds = [(kind, node) for kind in sorted(set(classes)) for node in found.nodes(kind)]
    nodes = dict.fromkeys(_on_host(node) for _, node in kinds)
    answer["refused"] = refused(kinds)
    where = {"attached": True, "port": found.folder.name, "sysfs": path_of(found.folder), "nodes": [*nodes]}
    answer = {**answer, **where, "strength": found.strength}
    try:
        acted_on = device(device_id, actuate=True)
    except AmbiguousDevice as problem:
        return {**answer, "doubt": str(problem)}
    except DeviceFault:  # it went away meanwhile
        return {**answer, "attached": False}
    return {**answer, "strength": acted_on.strength}


def _on_host(node: str) -> str:
    """A node as the host names it, without the system root."""
    root = sysroot()
    return "/" + str(Path(node).relative_to(root)) if Path(node).is_relative_to(root) else node


# Which device nodes this user may not use, and what grants the use: determined from modes and groups, with nothing
# opened.
#
# A device that is attached and closed to its user answers no call, so it must not be counted as usable.

READ, WRITE = 4, 2
NEEDED = {
    "tty": READ | WRITE,
    "video4linux": READ | WRITE,
    "media": READ | WRITE,
    "hidraw": READ | WRITE,
    "i2c-dev": READ | WRITE,
    "spidev": READ | WRITE,
    "gpio": READ | WRITE,
    "usbmisc": READ | WRITE,
    "lirc": READ | WRITE,
    "sound": READ | WRITE,
    "input": READ,
}
"""The rights that a tool needs on a node, by its class; nodes of other classes are read through sysfs instead."""
USUAL = {"tty": "dialout", "video4linux": "video", "media": "video", "sound": "audio", "i2c-dev": "i2c"}
"""Groups that distributions give to the nodes of a class; `plugdev` elsewhere."""
WORDS = {READ: "read", WRITE: "write to", READ | WRITE: "read and write to"}
RULES = "/etc/udev/rules.d/70-octoform.rules"


@dataclass(frozen=True)
class Account:
    """A user: ``groups`` are the gids of this session, ``listed`` those that the group database gives the user."""

    name: str
    groups: frozenset[int]
    listed: frozenset[int]


@dataclass(frozen=True)
class Node:
    """A device node: its path as the host names it, its class, permission bits, and the group by number and name."""

    path: str
    kind: str
    mode: int
    gid: int
    group: str


def account() -> Account:
    """The user of this process."""
    try:
        entry = pwd.getpwuid(os.geteuid())
        name, listed = entry.pw_name, os.getgrouplist(entry.pw_name, entry.pw_gid)
    except (KeyError, OSError):
        name, listed = f"uid {os.geteuid()}", []
    return Account(name, frozenset((*os.getgroups(), os.getegid())), frozenset(listed))


def refused(nodes: Iterable[tuple[str, str]], who: Account | None = None) -> list[dict[str, Any]]:
    """Those of the nodes (class, path below the system root) that this user may not use as tools need it.

    Each with ``node``, ``mode`` (octal), ``group``, ``lacks`` (``read``, ``write to`` or both) and ``remedy``, what a
    person can do. A node that is not there is no matter of rights.
    """
    found = []
    for kind, path in nodes:
        needed = NEEDED.get(kind, 0)
        lacks = sum(bit for bit in (READ, WRITE) if needed & bit and not os.access(path, bit, effective_ids=True))
        try:
            status = Path(path).stat() if lacks else None
        except OSError:
            status = None
        if status is None:
            continue
        node = Node(_on_host(path), kind, stat.S_IMODE(status.st_mode), status.st_gid, _group(status.st_gid))
        fields = {"node": node.path, "mode": f"{node.mode:04o}", "group": node.group, "lacks": WORDS[lacks]}
        found.append({**fields, "remedy": remedy(node, who or account())})
    return found


def remedy(node: Node, who: Account) -> str:
    """The remedy that lets the user use the node: a new session, a group, or a rule where no group has the rights."""
    needed = NEEDED[node.kind]
    if node.gid == 0 or (node.mode >> 3) & needed != needed:
        group = USUAL.get(node.kind, "plugdev") if node.gid == 0 else node.group
        rule = f'SUBSYSTEM=="{node.kind}", KERNEL=="{Path(node.path).name}", GROUP="{group}", MODE="0660"'
        return f"as root, write the rule {rule} into {RULES}, then: udevadm control --reload && udevadm trigger"
    if node.gid in who.listed and node.gid not in who.groups:
        return f"log in again: {who.name} is in the group {node.group} since this session began; then: octoform restart"
    return f"usermod -aG {node.group} {who.name} (as root), then log in again"


def _group(gid: int) -> str:
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # what is loaded need not be taken apart
