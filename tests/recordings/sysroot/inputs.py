"""/proc/bus/input/devices: every input device with its ids, names, handlers and what it can report."""

import re

from recordings.sysroot.tree import Tree

_IDS = re.compile(r"I: Bus=([0-9a-f]{4}) Vendor=([0-9a-f]{4}) Product=([0-9a-f]{4}) Version=([0-9a-f]{4})")
_NAMES = {
    "name": r'^N: Name="(.*)"',
    "phys": r"^P: Phys=(.*)",
    "uniq": r"^U: Uniq=(.*)",
    "properties": r"^B: PROP=(.*)",
}


def load(tree: Tree, text: str) -> int:
    """Write the input devices; how many the text has."""
    start = text.find("I: Bus=")
    blocks = re.split(r"\n\s*\n", text[start:]) if start >= 0 else []
    kept = [block for block in blocks if _IDS.match(block.strip())]
    for number, block in enumerate(kept):
        _put(tree, number, block)
    if kept:
        tree.write("proc/bus/input/devices", "\n\n".join(block.strip() for block in kept) + "\n\n")
    return len(kept)


def _put(tree: Tree, number: int, block: str) -> None:
    where = re.search(r"^S: Sysfs=(\S+)", block, re.M)
    path = where[1] if where else f"/devices/recorded/input/input{number}"
    values: dict[str, str] = {}
    if ids := _IDS.match(block.strip()):
        values.update(zip(("id/bustype", "id/vendor", "id/product", "id/version"), ids.groups(), strict=True))
    for name, pattern in _NAMES.items():
        if found := re.search(pattern, block, re.M):
            values[name] = found[1].strip()
    for kind, bits in re.findall(r"^B: (EV|KEY|REL|ABS|MSC|LED|SND|FF|SW)=(.*)$", block, re.M):
        values.setdefault(f"capabilities/{kind.lower()}", bits.strip())
    for name, value in values.items():
        tree.attribute(f"sys{path}/{name}", value, derived=True)
    tree.register(path, "input")
    handlers = re.search(r"^H: Handlers=(.*)$", block, re.M)
    for handler in re.findall(r"(?:event|js|mouse)\d+", handlers[1] if handlers else ""):
        tree.folder(f"sys{path}/{handler}")
        tree.register(f"{path}/{handler}", "input")
        tree.link(f"sys{path}/{handler}/device", "sys" + path)
        tree.node("input/" + handler, "char")
