"""Recordings that are files of sysfs themselves: a tar of a tree, and the listings of a tablet's sysinfo folder."""

import os
import re
import tarfile
from collections.abc import Iterator
from pathlib import Path

from recordings.sysroot.tree import Tree, above, last

_ROOTS = re.compile(r"^(.*?/)?(sys|proc|dev|run|devices)(/|$)")
_WANTED = re.compile(r"^(sys|proc|dev|run|etc|class|bus)(/|$)")


def load_tar(tree: Tree, path: Path) -> int:
    """Unpack the part of the archive that is a root's sys, proc, dev and run; how many files and links."""
    with tarfile.open(path) as archive:
        found = next(filter(None, map(_ROOTS.match, archive.getnames())), None)
        if found is None:
            return 0
        prefix = found[1] or ""
        # Some archives begin below /sys.
        inner = "sys/" if found[2] == "devices" else ""
        return sum(_unpack(tree, archive, member, prefix, inner) for member in archive)


def _unpack(tree: Tree, archive: tarfile.TarFile, member: tarfile.TarInfo, prefix: str, inner: str) -> int:
    name = member.name.removeprefix(prefix)
    path = inner + name
    if not member.name.startswith(prefix) or not name or not _WANTED.match(path):
        return 0
    if member.isdir():
        tree.folder(path)
        return 0
    if member.issym():
        tree.raw_link(path, member.linkname)
        return 1
    content = archive.extractfile(member) if member.isfile() else None
    if content is None:
        return 0
    tree.write(path, content.read())
    return 1


def load_sysinfo(tree: Tree, folder: Path) -> int:
    """A folder of wacom-hid-descriptors: `devtree.txt`, `devtree_data.txt`, `machine.txt`, `*.hid.bin`; how many."""
    folders, links = _listing(_read(folder / "devtree.txt"))
    for name in sorted(folders):
        tree.folder(name[1:])
    values = _values(_read(folder / "devtree_data.txt"), folders)
    for path, lines in values.items():
        tree.write(path[1:], "\n".join(lines) + "\n")
    for path, target in links.items():
        if target.startswith("/sys/"):
            _link(tree, path, target)
    for path, lines in values.items():
        if last(path) == "uevent":
            pairs = dict(line.split("=", 1) for line in lines if "=" in line)
            if pairs.get("DEVNAME"):
                tree.node(pairs["DEVNAME"], "char", pairs.get("MAJOR"), pairs.get("MINOR"))
    return len(values) + _machine(tree, folder) + _descriptors(tree, folder)


def _listing(text: str) -> tuple[set[str], dict[str, str]]:
    """The folders and the links (path to target) of a recursive listing."""
    folders, links = set(), {}
    for line in text.splitlines():
        if line.startswith("********* "):
            folders.add(line[10:].strip())
        elif " -> " in line:
            path, target = line.split(" -> ", 1)
            links[path] = target
        elif line.startswith("/sys/"):
            folders.add(line.strip())
    return folders, links


def _values(text: str, folders: set[str]) -> dict[str, list[str]]:
    """The lines of every attribute, from ``path:value`` lines; a value may hold colons and slashes itself."""
    values: dict[str, list[str]] = {}
    for line in text.splitlines():
        holder = next((one for one in _prefixes(line) if one in folders), None)
        if holder:
            name, _, value = line[len(holder) + 1 :].partition(":")
            if name and "/" not in name:
                values.setdefault(f"{holder}/{name}", []).append(value)
    return values


def _prefixes(line: str) -> Iterator[str]:
    """Every folder that the line may begin with, the longest first."""
    end = line.rfind("/") if line.startswith("/sys/") else -1
    while end > 4:
        yield line[:end]
        end = line.rfind("/", 0, end)


def _link(tree: Tree, path: str, target: str) -> None:
    """A recorded link, and the entry in the bus's or class's folder that a link ``subsystem`` names."""
    real = tree.real(path[1:])
    if not (real.exists() or real.is_symlink()):
        tree.folder(target[1:])
        tree.link(path[1:], target[1:])
    device, subsystem = above(path), last(target)
    if last(path) != "subsystem":
        return
    if target.startswith("/sys/bus/"):
        tree.link(f"sys/bus/{subsystem}/devices/{last(device)}", device[1:])
    elif target.startswith("/sys/class/"):
        tree.link(f"sys/class/{subsystem}/{last(device)}", device[1:])


def _machine(tree: Tree, folder: Path) -> int:
    found = re.findall(r"^/sys/class/dmi/id/(\w+):(.*)$", _read(folder / "machine.txt"), re.M)
    for name, value in found:
        tree.write(f"sys/devices/virtual/dmi/id/{name}", value + "\n")
    if tree.real("sys/devices/virtual/dmi/id").is_dir():
        tree.link("sys/class/dmi/id", "sys/devices/virtual/dmi/id")
    return len(found)


def _descriptors(tree: Tree, folder: Path) -> int:
    """HID report descriptors, each named after its device (``0003:056A:0357.0001.hid.bin``)."""
    count = 0
    for file in sorted(folder.glob("*.hid.bin")):
        name = file.name.removesuffix(".hid.bin")
        places = (Path(base) for base, _, _ in os.walk(tree.real("sys/devices")) if last(base) == name)
        place = min(places, default=None)
        if place:
            tree.write(f"{place.relative_to(tree.root)}/report_descriptor", file.read_bytes())
            count += 1
    return count


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="surrogateescape") if path.exists() else ""
