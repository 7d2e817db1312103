"""What a host's committed state gives away of it: serial numbers, hardware addresses, names of host, users, networks.

What is secret is read from the host's own tree, by the names that the kernel, udev and the system's tools give such
facts, never from what octoform took for a secret: what PROBE overlooked must be found here. Nothing of octoform is
imported.
"""

import json
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

SHORTEST = 6
MAX_BYTES = 1 << 20
_ATTRIBUTES = re.compile(
    r"(?:(?:product|board|chassis|platform|unit|assembly)_)?serial(?:_?number)?|sn|wwid|nguid|eui|uniq|unique_id"
    r"|product_uuid|uuid|cid|mac_address|address|addr|machine-id|hostname"
)
_PROPERTIES = re.compile(
    r"^(?:E:|S:|P:)?(?:ID_SERIAL_SHORT|ID_NET_NAME_MAC|ID_WWN\w*|ID_SCSI_SERIAL|DMI_SERIAL|SCSI_IDENT_SERIAL|ID_FS_UUID"
    r"|ID_PART_\w*UUID|ID_MODEL_SERIAL|HID_UNIQ|UNIQ|DM_UUID|MD_UUID|POWER_SUPPLY_SERIAL_NUMBER|SERIAL)=\"?(.+?)\"?$",
    re.M,
)
_SAID = re.compile(
    r"(?:serial[_ ]?num(?:ber)?|iSerial(?: +\d+)?|IOPlatformSerialNumber|platform_UUID|IOPlatformUUID|SSID|host_?name"
    r"|ComputerName|spcast5_address)\"?\s*[:= ]\s*\"?([^\"\n,]{4,80})",
    re.I,
)
_PAIRS = re.compile(r"(?<![0-9A-Fa-f:-])[0-9A-Fa-f]{2}(?:[:-][0-9A-Fa-f]{2}){5}(?![0-9A-Fa-f:-])")
_PLACE = re.compile(r"(?:[0-9a-f]{4}:)?[0-9a-f]{2}:[0-9a-f]{2}\.[0-7]|[a-z0-9_,-]+\.\d+(?:\.auto)?|[0-9a-f]+\.\w+")
_KIND = re.compile(r"[0-9a-f]{4}[_:-]?[0-9a-f]{4}")
_COUNTING = "0123456789abcdef", "1234567890abcdef"
_HOST_NAMES = frozenset(("proc/sys/kernel/hostname", "etc/hostname"))
_EVERYDAY = frozenset(("localhost", "raspberrypi", "debian", "ubuntu", "fedora"))


def secrets_of_tree(tree: Path) -> set[str]:
    """All that identifies the host below ``tree`` or one specimen of a device on it, in lower case."""
    marks: set[str] = set()
    names: set[str] = set()
    for path in _files(tree):
        place = path.relative_to(tree).as_posix()
        if place in _HOST_NAMES:
            names.add(_text(path).strip().casefold())
        elif place == "etc/passwd":
            names |= {line.split(":")[0].casefold() for line in _text(path).splitlines() if ":/home/" in line}
        elif place.startswith("sys/"):
            marks |= _of_attribute(path)
        else:
            marks |= _of_text(place, _text(path))
    return {mark for mark in marks if _tells_apart(mark)} | {name for name in names if _is_name(name)}


def leaks(state: Path, secrets: Iterable[str]) -> list[str]:
    """``file: secret`` for each secret that stands anywhere in the folder, in any spelling of a hardware address."""
    found = []
    wanted = {secret: _pattern(secret) for secret in secrets}
    for path in sorted(path for path in state.rglob("*") if path.is_file()):
        text = "\n".join(_readings(path)).casefold()
        bare = text.replace("-", "").replace("_", "")
        for secret, pattern in sorted(wanted.items()):
            # A quick look first: there are hundreds of secrets and most stand nowhere.
            if (secret in text or _bare(secret) in bare) and pattern.search(text):
                found.append(f"{path.relative_to(state)}: {secret}")
    return found


def _files(tree: Path) -> Iterator[Path]:
    """Files of ``sys`` that are called like an identity, and the texts beside it that hold some."""
    for folder, _, names in os.walk(tree / "sys"):
        for name in names:
            if name == "uevent" or _ATTRIBUTES.fullmatch(name):
                yield Path(folder, name)
    for place in ("run/udev/data", "etc", "recorded", "proc/sys/kernel", "proc/net", "proc/bus/input", "var/lib"):
        for folder, _, names in os.walk(tree / place):
            yield from (Path(folder, name) for name in names)


def _of_attribute(path: Path) -> set[str]:
    text = _text(path)
    if path.name == "uevent":
        return {value.strip().casefold() for value in _PROPERTIES.findall(text)} | _addresses(text)
    value = text.strip().strip("\0").casefold()
    if path.name in ("address", "addr", "mac_address"):
        return _addresses(text)
    # A root hub's is the place of its controller; a register's name may be anything.
    return {value, *value.split()[-1:]} if len(value) <= 120 and "\n" not in value else set()


def _of_text(place: str, text: str) -> set[str]:
    found = _addresses(text) | {value.strip().casefold() for value in _PROPERTIES.findall(text)}
    if place.startswith(("recorded/", "etc/", "var/")):
        found |= {value.strip().casefold() for value in _SAID.findall(text)}
    return found


def _addresses(text: str) -> set[str]:
    return {value.casefold().replace("-", ":") for value in _PAIRS.findall(text)}


def _tells_apart(mark: str) -> bool:
    """Whether a value is one specimen's: not a placeholder, a place, a word, or the numbers of its kind."""
    bare = _bare(mark)
    if len(bare) < SHORTEST or len(set(bare)) < 3 or not any(map(str.isdigit, bare)):
        return False
    return not (_PLACE.fullmatch(mark) or _KIND.fullmatch(mark) or any(bare in row for row in _COUNTING))


def _is_name(name: str) -> bool:
    return len(name) >= SHORTEST and name not in _EVERYDAY


def _pattern(secret: str) -> re.Pattern[str]:
    pieces = secret.split(":") if _PAIRS.fullmatch(secret) else [secret]
    body = "[:_-]?".join(re.escape(piece) for piece in pieces)
    return re.compile(rf"(?<![0-9a-z]){body}(?![0-9a-z])" if len(pieces) == 1 else body)


def _bare(text: str) -> str:
    return re.sub(r"[^0-9a-z]", "", text.casefold())


def _readings(path: Path) -> Iterator[str]:
    """A file as it stands, and the strings that its JSON stands for."""
    # Whole: an artifact of a large host exceeds what a recorded attribute may hold, and its end may leak too.
    text = path.read_text("utf-8", "replace")
    yield text
    if path.suffix == ".json":
        yield from _strings(json.loads(text))


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield name
            yield from _strings(item)
    elif isinstance(value, list):
        for item in value:
            yield from _strings(item)


def _text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return file.read(MAX_BYTES).decode("utf-8", "replace")
    except OSError:  # a recorded attribute that could not be read
        return ""
