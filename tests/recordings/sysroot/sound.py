"""/proc/asound/cards and alsa-info.txt: sound cards, their PCM devices, the machine's names and PCI functions."""

import re
from collections.abc import Iterator

from recordings.sysroot.tree import Tree

_CARDS = re.compile(r"!!Soundcards recognised by ALSA\n!!-+\n\n(.*?)(?:\n\n\n|\n!!)", re.S)
_PCI = re.compile(r"!!PCI Soundcards installed in the system\n!!-+\n\n(.*?)(?:\n\n\n|\n!!)", re.S)
_PCI_LINE = re.compile(r"^([0-9a-f:.]+) (.*?) \[([0-9a-f]{4})\]: .*\[([0-9a-f]{4}):([0-9a-f]{4})\]", re.M)
_PCM_LINE = re.compile(r"^card (\d+): (\S+) \[([^\]]*)\], device (\d+): (.*?) \[(.*?)\]", re.M)
_DMI = {
    "sys_vendor": "Manufacturer",
    "product_name": "Product Name",
    "product_version": "Product Version",
    "bios_version": "Firmware Version",
    "board_vendor": "Board Vendor",
    "board_name": "Board Name",
}


def load(tree: Tree, text: str) -> int:
    """Write the facts of the text; returns their number."""
    count = _cards(tree, text)
    _pcm_devices(tree, text)
    return count + _machine(tree, text) + _pci_functions(tree, text)


def _cards(tree: Tree, text: str) -> int:
    section = _CARDS.search(text)
    plain = None if section else re.search(r"^( *\d+ \[[^\]]+\]: .*\n +.*\n)+", text, re.M)
    cards = section[1] + "\n" if section else plain[0] if plain else ""
    if not cards:
        return 0
    tree.write("proc/asound/cards", cards)
    found = re.findall(r"^ *(\d+) \[([^\]]+)\]: .*? - .*$", cards, re.M)
    for number, name in found:
        path = f"/devices/recorded/sound/card{number}"
        tree.attribute(f"proc/asound/card{number}/id", name.strip(), derived=True)
        tree.attribute(f"sys{path}/id", name.strip(), derived=True)
        tree.attribute(f"sys{path}/number", number, derived=True)
        tree.register(path, "sound")
        tree.node(f"snd/controlC{number}", "char")
    return len(found)


def _pcm_devices(tree: Tree, text: str) -> None:
    """The PCM devices that aplay -l and arecord -l list."""
    known: dict[tuple[int, int], tuple[str, str]] = {}
    directions: dict[tuple[int, int], set[str]] = {}
    for kind, card, device, names in _pcm_lines(text):
        known.setdefault((card, device), names)
        directions.setdefault((card, device), set()).add(kind)
        name = f"pcmC{card}D{device}{kind[0]}"
        tree.node(f"snd/{name}", "char")
        path = f"/devices/recorded/sound/card{card}/{name}"
        tree.folder("sys" + path)
        tree.register(path, "sound")
    if known:
        lines = []
        for (card, device), (name, title) in sorted(known.items()):
            counts = " : ".join(f"{kind} 1" for kind in sorted(directions[card, device], reverse=True))
            lines.append(f"{card:02d}-{device:02d}: {name} : {title} : {counts}\n")
        tree.write("proc/asound/pcm", "".join(lines), derived=True)


def _pcm_lines(text: str) -> Iterator[tuple[str, int, int, tuple[str, str]]]:
    """Direction, card, device, name and title."""
    for kind in ("playback", "capture"):
        head = rf"\*\*\*\* List of {kind.upper()} Hardware Devices \*\*\*\*\n(.*?)(?:\n\n|\n!!|\Z)"
        section = re.search(head, text, re.S)
        for found in _PCM_LINE.finditer(section[1] if section else ""):
            yield kind, int(found[1]), int(found[4]), (found[5], found[6])


def _machine(tree: Tree, text: str) -> int:
    """The firmware's tables in alsa-info."""
    count = 0
    for name, word in _DMI.items() if "!!DMI Information" in text else ():
        if found := re.search(rf"^{word}:[ \t]+(\S.*)$", text, re.M):
            tree.attribute(f"sys/devices/virtual/dmi/id/{name}", found[1].strip())
            tree.link("sys/class/dmi/id", "sys/devices/virtual/dmi/id")
            count += 1
    return count


def _pci_functions(tree: Tree, text: str) -> int:
    section = _PCI.search(text)
    count = 0
    for found in _PCI_LINE.finditer(section[1] if section else ""):
        address = found[1] if found[1].count(":") == 2 else "0000:" + found[1]
        path = f"/devices/pci0000:00/{address}"
        values = {"vendor": found[4], "device": found[5], "class": found[3] + "00"}
        for name, value in values.items():
            tree.attribute(f"sys{path}/{name}", "0x" + value, derived=True)
        tree.register(path, "pci")
        count += 1
    return count
