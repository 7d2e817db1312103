"""`udevadm info -a`: one device and its parents, with the attributes as udev rules would match them."""

import re

from recordings.sysroot.tree import Tree, last

_BLOCK = re.compile(r"\n(?=\s*looking at (?:parent )?device ')")
_PATH = re.compile(r"looking at (?:parent )?device '([^']+)'")
_LINE = re.compile(r'^\s+([A-Z]+)(\{[^}]+\})?=="(.*)"\s*$', re.M)


def load(tree: Tree, text: str) -> int:
    """Write the chain of devices; how many it has."""
    count = 0
    for block in _BLOCK.split(text):
        found = _PATH.search(block)
        if found:
            count += 1
            _put(tree, found[1], block)
    return count


def _put(tree: Tree, path: str, block: str) -> None:
    keys: dict[str, str] = {}
    attributes: dict[str, str] = {}
    for key, name, value in _LINE.findall(block):
        # A parent's keys are written in the plural.
        if not name:
            keys[key.removesuffix("S")] = value
        elif key.removesuffix("S") == "ATTR":
            attributes[name[1:-1]] = value
    tree.folder("sys" + path)
    for name, value in attributes.items():
        if value != "(not readable)":
            tree.attribute(f"sys{path}/{name}", value)
    subsystem = keys.get("SUBSYSTEM")
    tree.register(
        path, subsystem, keys.get("DRIVER") or None, disk=subsystem == "block" and "partition" not in attributes
    )
    if subsystem == "tty":
        numbers = attributes.get("dev", "").split(":")
        tree.node(last(path), "char", *(numbers if len(numbers) == 2 else (None, None)))
