"""Decides which of the attached units an id is: by serial number, else by place, else because only one is left.

All ids of one kind are looked at together, so that no two of them ever get the same unit. What acts is bound by a
serial number or a place, or where one unit is left for one id; on a guess it is not moved (AmbiguousDevice). What
only reads may answer by order. docs/identity.md has the table.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .base import serials
from .faults import AmbiguousDevice, DeviceAbsent
from .sysfs import files, members, path_of, place, read_text, socket, subsystem, sysroot, uevent

# Determines the kind of device of a sysfs folder, in the words of device ids, and which unit it is.
#
# An id such as ``usb-046d-0825-2`` names a bus, a kind and an ordinal. A folder may be called in several ways (by its
# ids, its name attribute, its driver), so it has a set of kinds and matches an id when one of them does.

# Devices on these buses are parts of the device above them, as interfaces and channels are.
_PARTS = frozenset(
    (
        *("auxiliary", "cec", "counter", "gpio", "hdaudio", "iio", "media", "nvmem", "pci_express", "rmi4", "sdio"),
        *("serial-base", "siox", "snd_seq", "spi_master", "ulpi", "usb-serial", "usb_device"),
    )
)
_NAMES = ("name", "type", "model", "id", "description", "hid", "label", "identity")
_KIND_NAMES = ("product", "manufacturer", "model", "name")
_ANNOUNCED = ("OF_NAME", "NAME", "HID_NAME", "POWER_SUPPLY_MODEL_NAME", "POWER_SUPPLY_TYPE", "DEVTYPE")
_ADDRESS = re.compile(r"^(?:[0-9a-f]{4,16}\.|soc:|[0-9a-f]{4,16}[:.])(?=[a-z])")
# A number behind a colon or a dot counts units; digits that end a name itself (AMDI0010, i2c2) are the kind's.
_TRAILER = re.compile(r"(?:[:.]\d+|\.auto|:[0-9a-fA-F]{2}|@[0-9a-f]+)+$")
_NUMBERED = re.compile(r"[0-9:.].*$")
_AT_ADDRESS = re.compile(r",? at \S+$")
_LED_OWNER = re.compile(r"(?<![a-z])(input|phy|mmc|usb|hid|card)\d+(?=\W|$)")
_LED_HID = re.compile(r"^[0-9A-F]{4}:[0-9A-F]{4}:[0-9A-F]{4}\.[0-9A-F]+:")
_HID_ID = re.compile(r"0*[0-9A-Fa-f]{1,4}:0*([0-9A-Fa-f]{1,8}):0*([0-9A-Fa-f]{1,8})")
_HID_NAME = re.compile(r"[0-9A-F]{4}:([0-9A-F]{4}):([0-9A-F]{4})\.[0-9A-F]+")
_HEX = re.compile(r"[0-9a-f]+")
_FAMILY = re.compile(r"([0-9a-f]{2})-[0-9a-f]{12}")
_SLUG_CHARS = 72
# Ids say what a thermal device is for; the kernel lists zones and cooling devices in one class.
_LISTED = {"cooling": "thermal"}
_PLAIN_MODALIAS = frozenset(("spi", "i2c", "platform", "acpi", "wmi", "rpmsg", "tee", "scmi", "mdio"))
_OWN_WORDS = {"usb": "device", "pci": "device", "hid": "device", "scsi": "device", "mmc": "card", "dmi": "board"}
_OWN_WORDS |= {"gpio": "gpiochip"}
_ORDINAL = re.compile(r"^(.*)-([2-9]|[1-9]\d+)$")


def slug(text: str) -> str:
    """Lower-case words joined by dashes, at most 72 characters, as in device ids."""
    return re.sub(r"[^a-z0-9]+", "-", text[: 4 * _SLUG_CHARS].lower()).strip("-")[:_SLUG_CHARS].strip("-")


def is_unit(path: Path) -> bool:
    """Whether a folder is a device on a bus that stands for itself, rather than a part of the one above it."""
    kind, name = subsystem(path)
    if kind != "bus" or name in _PARTS:
        return False
    if name == "usb":
        return ":" not in path.name
    if name == "scsi":
        return not path.name.startswith(("host", "target"))
    return not (name == "i2c" and re.fullmatch(r"i2c-\d+", path.name))


def vid_pid(path: Path) -> str:
    """``vvvv-pppp`` of a USB, PCI or HID device, empty for others."""
    _, name = subsystem(path)
    pair: Sequence[str] = ()
    if name == "usb":
        vendor, product = _two(uevent(path).get("PRODUCT", ""), "/")
        pair = (read_text(path / "idVendor") or vendor, read_text(path / "idProduct") or product)
    elif name == "pci":
        vendor, product = _two(uevent(path).get("PCI_ID", ""), ":")
        pair = (vendor or read_text(path / "vendor") or "", product or read_text(path / "device") or "")
    elif name == "hid":
        found = _HID_ID.fullmatch(uevent(path).get("HID_ID", "")) or _HID_NAME.fullmatch(path.name)
        pair = found.groups() if found else ()
    digits = [part.lower().removeprefix("0x").zfill(4)[-4:] for part in pair if part]
    return "-".join(digits) if len(digits) == 2 and all(map(_HEX.fullmatch, digits)) else ""


def _two(packed: str, sign: str) -> tuple[str, str]:
    first, _, rest = packed.partition(sign)
    return first, rest.partition(sign)[0]


def kinds(path: Path) -> set[str]:
    """Every word by which an id may call the device of this folder; none for an interface, a part of a USB device.

    An interface announces the ids of its device (PRODUCT in its uevent), and is no second one.
    """
    if ":" in path.name and subsystem(path)[1] == "usb":
        return set()
    ids = vid_pid(path)
    return {ids} if ids else {slug(text) for text in _kind_texts(path)} - {""}


def _kind_texts(path: Path) -> Iterator[str]:
    """The names of the device by its folder, attributes and uevent, whole and without its place."""
    events = uevent(path)
    attributes = [_AT_ADDRESS.sub("", read_text(path / name) or "") for name in _NAMES]
    alias = _of_modalias(events.get("MODALIAS") or read_text(path / "modalias") or "")
    driver = events.get("DRIVER") or _driver(path)
    announced = (events.get(key, "").strip('"') for key in _ANNOUNCED)
    if not (alias or driver):
        yield "device"
    for text in (*attributes, *announced, alias, driver, path.name, _ADDRESS.sub("", path.name)):
        yield text
        yield _TRAILER.sub("", text)
    # A clock's driver, before the place where the clock is attached.
    yield attributes[0].partition(" ")[0]
    yield f"{read_text(path / 'vendor') or ''} {read_text(path / 'model') or ''}"
    yield " ".join(events.get(f"MMC_{key}") or read_text(path / key.lower()) or "" for key in ("TYPE", "NAME"))
    yield from _of_folder_name(path)
    yield from _of_bus(path)


def _of_folder_name(path: Path) -> Iterator[str]:
    """The part of a folder's name that gives a kind: a class without its number, an ACPI id, a 1-Wire family."""
    form, name = subsystem(path)
    if form == "class":
        yield _NUMBERED.sub("", path.name) or "device"
        yield _LED_OWNER.sub(r"\1", _LED_HID.sub("", path.name))
    elif name == "acpi":
        yield path.name.partition(":")[0]
    elif family := _FAMILY.fullmatch(path.name):
        yield f"family {family[1]}"


def _of_bus(path: Path) -> Iterator[str]:
    """The words that stand for a kind where a bus or class has a word of its own for it."""
    _, name = subsystem(path)
    if name in _OWN_WORDS:
        yield _OWN_WORDS[name]
    if name == "virtio":
        yield (read_text(path / "device") or "").lower().removeprefix("0x").zfill(4)[-4:]


def _of_modalias(alias: str) -> str:
    """The part of a modalias that names the kind: ``spi:adc`` is ``adc``, a device tree's its first compatible."""
    prefix, _, rest = alias.partition(":")
    if prefix == "of":
        return rest.partition("C")[2].partition("C")[0]
    return rest.strip(":") if prefix in _PLAIN_MODALIAS else ""


def _driver(path: Path) -> str:
    try:
        return (path / "driver").readlink().name
    except OSError:
        return ""


def contradicts(path: Path, device_id: str) -> bool:
    """Whether the folder is certainly another kind than the id states: a number was given to something else."""
    ids = vid_pid(path)
    if ids:
        return f"-{ids}" not in device_id
    kind, name = subsystem(path)
    found = slug(read_text(path / ("type" if name == "thermal" else "name")) or "")
    return kind == "class" and bool(found) and found not in device_id and slug(path.name) not in device_id


def kind_of(device_id: str) -> tuple[str, list[Path]]:
    """The kind that an id names, without an ordinal, and the folders of all its units in natural order."""
    if found := _of_kind(device_id):
        return device_id, found
    ordinal = _ORDINAL.match(device_id)
    return (ordinal[1], _of_kind(ordinal[1])) if ordinal else (device_id, [])


def matches(path: Path, device_id: str) -> bool:
    """Whether the folder is of the kind that an id names."""
    ordinal = _ORDINAL.match(device_id)
    words = kinds(path)
    listed = subsystem(path)[1]
    for name in (device_id, *([ordinal[1]] if ordinal else [])):
        rests = (rest for head, rest in _splits(name) if listed in head)
        if any({name, rest} & words for rest in rests):
            return True
    return False


def _of_kind(name: str) -> list[Path]:
    for heads, rest in _splits(name):
        found = [path for head in sorted(heads) for path in members(head) if {name, rest} & kinds(path)]
        if found:
            return found
    return []


def _splits(name: str) -> Iterator[tuple[set[str], str]]:
    """Every way to read a name as a bus or class and the rest; these are written with underscores and dashes alike."""
    parts = name.split("-")
    for count in range(1, len(parts) + 1):
        head = "-".join(parts[:count])
        yield {_LISTED.get(head, head), head.replace("-", "_")}, "-".join(parts[count:])


def serial(path: Path) -> str | None:
    """The serial number that a device reports, empty without one.

    None where the kernel shows none in a place known here, or not yet.
    """
    _, name = subsystem(path)
    if name in ("usb", "mmc"):
        shown = read_text(path / "serial")
        # A USB device without a number has no such attribute. Every card has one: without it nothing is known of it.
        return None if shown is None and name == "mmc" else (shown or "").removeprefix("0x")
    if name == "pci":
        return next((read_text(each) for each in files(path / "nvme", "nvme*/serial")), None)
    # A driver may fill it in when the device speaks for the first time.
    return uevent(path).get("HID_UNIQ") or None if name == "hid" else None


def kind_names(path: Path) -> list[str]:
    """The strings of a device's kind: no serial number of a unit is equal to one of these."""
    ids = vid_pid(path)
    return [text for text in (ids, *(read_text(path / name) or "" for name in _KIND_NAMES)) if text]


STRONG, POSITIONAL, WEAK = "strong", "positional", "weak"
_MAX_NAMED = 4


@dataclass(frozen=True)
class Binding:
    """The folder of the unit that was found, and how surely it is the one."""

    folder: Path
    strength: str


@dataclass(frozen=True)
class _Claim:
    """The entry of the instances file for one id; nothing for an id that it does not know."""

    id: str
    path: str = ""
    port: str = ""
    serial: str = ""
    numbered: bool = False
    unique: bool = False

    def excludes(self, folder: Path) -> bool:
        """Whether the folder is certainly another unit: it shows another serial number."""
        shown = serial(folder) or ""
        return bool(self.serial and shown) and not serials.same(self.serial, shown)

    def rules_out(self, folder: Path) -> bool:
        """The same by a number that can decide between several: a default states nothing about the one that is left."""
        return self.excludes(folder) and (self.unique or serials.weight(self.serial) >= serials.SHORT)

    def lacks(self, folder: Path) -> bool:
        """Whether the serial number that would prove it is not shown where it should be."""
        return self.numbered and serial(folder) == ""

    def gained(self, folder: Path) -> bool:
        """Whether it shows a serial number and the one that is known had none: most likely it is another one."""
        shown = serial(folder) or ""
        return bool(self.path and not self.serial and serials.weight(shown, kind_names(folder)) >= serials.SHORT)


def in_place(device_id: str, known: Mapping[str, Any]) -> Binding | None:
    """The unit where it was last seen, for a reader: nothing else is looked at while all is as it was."""
    instance = known.get(device_id)
    claim = _claim(device_id, instance if isinstance(instance, Mapping) else {})
    folder = _recorded(claim)
    claim = _proved(claim, [claim], kind_names(folder) if folder is not None else [])
    if folder is None or not matches(folder, device_id) or claim.excludes(folder) or claim.lacks(folder):
        return None
    proved = claim.unique and serial(folder)
    text = str(instance.get("strength")) if isinstance(instance, Mapping) else WEAK
    return Binding(folder, STRONG if proved else WEAK if text == WEAK else POSITIONAL)


def bind(device_id: str, known: Mapping[str, Any], actuate: bool) -> Binding:
    """The unit that an id is now; DeviceAbsent or AmbiguousDevice with the reason."""
    name, specimens = kind_of(device_id)
    claims = _claims(device_id, name, known, specimens)
    mine = next(claim for claim in claims if claim.id == device_id)
    specimens = specimens or _only_recorded(mine)
    bound = _by_serial(claims, specimens)
    _by_place(claims, specimens, bound)
    found = bound.get(device_id)
    if found is not None and not (actuate and mine.lacks(found.folder)):
        return found
    return _left_over(mine, claims, specimens, bound, actuate)


def _by_serial(claims: list[_Claim], specimens: list[Path]) -> dict[str, Binding]:
    bound = {}
    for claim in claims:
        alike = [each for each in specimens if claim.unique and serials.same(claim.serial, serial(each) or "")]
        if len(alike) == 1:
            bound[claim.id] = Binding(alike[0], STRONG)
    return bound


def _by_place(claims: list[_Claim], specimens: list[Path], bound: dict[str, Binding]) -> None:
    """Bind what is alone in the place where it was; the numbers of buses count only while they are as they were."""
    for where in (place, socket):
        wanting = [claim for claim in claims if claim.id not in bound and (claim.path or claim.port)]
        places = [where(claim.path) if claim.path else claim.port for claim in wanting]
        free = [each for each in specimens if each not in [binding.folder for binding in bound.values()]]
        shifted = _shifted(wanting, free) if where is place else set()
        for claim, at in zip(wanting, places, strict=True):
            if socket(claim.path) in shifted:
                continue
            there = [each for each in free if at == (where(path_of(each)) if claim.path else each.name)]
            if len(there) == 1 and places.count(at) == 1 and not claim.excludes(there[0]):
                bound[claim.id] = Binding(there[0], POSITIONAL)


def _shifted(wanting: list[_Claim], free: list[Path]) -> set[str]:
    """The sockets where buses may be counted otherwise now: several equal ones differ by the number of a bus alone.

    Channels of a multiplexer that were 5 and 6 and are 6 and 7 now would else change places without a word.
    """
    was = [claim.path for claim in wanting if claim.path]
    now = [path_of(each) for each in free]
    sockets = {socket(path) for path in was}
    return {
        each
        for each in sockets
        if {place(path) for path in was if socket(path) == each}
        != {place(path) for path in now if socket(path) == each}
        and max(sum(socket(path) == each for path in paths) for paths in (was, now)) > 1
    }


def _left_over(
    mine: _Claim, claims: list[_Claim], specimens: list[Path], bound: Mapping[str, Binding], actuate: bool
) -> Binding:
    """The units that no place and no number gave to an id, to the ids that have none, in order."""
    held = [binding.folder for name, binding in bound.items() if name != mine.id]
    free = [each for each in specimens if each not in held]
    open_to_me = [each for each in free if not mine.excludes(each)]
    if not open_to_me:
        raise DeviceAbsent(mine.id, _why_absent(mine, free))
    wanting = [claim for claim in claims if claim.id == mine.id or claim.id not in bound]
    rivals = [claim for claim in wanting if any(not claim.excludes(each) for each in open_to_me)]
    unlike = mine.lacks(open_to_me[0]) or mine.gained(open_to_me[0])
    candidates = [each for each in free if not mine.rules_out(each)]
    if actuate and (len(candidates) > 1 or len(rivals) > 1 or unlike):
        raise AmbiguousDevice(mine.id, _doubt(mine, candidates, rivals))
    given = _in_order(wanting, free)
    if mine.id not in given:
        raise DeviceAbsent(mine.id, _why_absent(mine, []))
    return Binding(given[mine.id], WEAK)


def _in_order(wanting: list[_Claim], free: list[Path]) -> dict[str, Path]:
    """Each id the unit in its very path, else the next that is left."""
    given = {claim.id: each for claim in wanting for each in free if path_of(each) == claim.path}
    rest = [each for each in free if each not in given.values()]
    for claim in wanting:
        fit = [each for each in rest if not claim.excludes(each)]
        if claim.id not in given and fit:
            given[claim.id] = fit[0]
            rest.remove(fit[0])
    return given


def _claims(device_id: str, name: str, known: Mapping[str, Any], specimens: list[Path]) -> list[_Claim]:
    """The facts of every id of the kind, in the order of ordinals; this id is always among them."""
    ids = {other for other in known if _ordinal(other, name) and _of_same_kind(other, name, known[other], specimens)}
    ids.add(device_id)
    if device_id not in known:
        # A second one was counted after a first one.
        ids |= {name if count == 1 else f"{name}-{count}" for count in range(1, _ordinal(device_id, name))}
    instances = {each: known.get(each) for each in ids}
    claims = [
        _claim(each, instance if isinstance(instance, Mapping) else {})
        for each, instance in sorted(instances.items(), key=lambda item: _ordinal(item[0], name))
    ]
    lines = [text for each in specimens for text in kind_names(each)]
    return [_proved(claim, claims, lines) for claim in claims]


def _proved(claim: _Claim, claims: list[_Claim], texts: list[str]) -> _Claim:
    """The claim, unique where its number is one among those of its kind and not a string of the kind itself."""
    others = [other.serial for other in claims if other.id != claim.id and other.serial]
    return replace(claim, unique=claim.numbered and serials.is_distinctive(claim.serial, others, texts))


def _ordinal(device_id: str, name: str) -> int:
    """1 for the name itself, n for ``name-n``, 0 for another kind."""
    if device_id == name:
        return 1
    rest = device_id.removeprefix(f"{name}-")
    return int(rest) if rest != device_id and re.fullmatch(r"[2-9]|[1-9]\d{1,5}", rest) else 0


def _of_same_kind(device_id: str, name: str, instance: object, specimens: list[Path]) -> bool:
    """Whether an id that ends in a number is an ordinal of the kind, and not a kind that is called so."""
    if device_id == name or (isinstance(instance, Mapping) and _recorded(_claim(device_id, instance)) in specimens):
        return True
    return kind_of(device_id)[1] == specimens


def _claim(device_id: str, instance: Mapping[str, Any]) -> _Claim:
    serial = str(instance.get("serial") or "").strip()
    serial = serial if serials.weight(serial) > serials.NONE else ""
    path = str(instance.get("sysfs") or "")
    return _Claim(
        device_id,
        path if path.startswith("/sys/") else "",
        str(instance.get("port") or ""),
        serial,
        bool(serial) and instance.get("strength") == STRONG,
    )


def _recorded(claim: _Claim) -> Path | None:
    folder = (sysroot() / claim.path.lstrip("/")).resolve() if claim.path else None
    return folder if folder is not None and folder.is_dir() else None


def _only_recorded(claim: _Claim) -> list[Path]:
    """For an id whose words the kernel does not know: what is in its place, if it does not say that it is another."""
    folder = _recorded(claim)
    return [] if folder is None or contradicts(folder, claim.id) else [folder]


def _why_absent(claim: _Claim, others: list[Path]) -> str:
    if others:
        text = f"{claim.id} is not attached; a device of the same kind with another serial number is"
        return f"{text} (if it replaces it, run `octoform apply -replace probe`)"
    return f"{claim.id} is not attached, or its driver does not see it"


def _doubt(mine: _Claim, found: list[Path], rivals: list[_Claim]) -> str:
    places = ", ".join(folder.name for folder in found[:_MAX_NAMED])
    if len(found) > 1:
        text = f"{mine.id} may be any of {len(found)} equal devices ({places})"
    elif len(rivals) > 1:
        other = next(claim.id for claim in rivals if claim.id != mine.id)
        text = f"the device at {places} may be {mine.id} or {other}, which is equal and missing too"
    elif mine.gained(found[0]):
        text = f"the device at {places} shows a serial number, and {mine.id} had none"
    else:
        text = f"the device at {places} does not show the serial number that {mine.id} has"
    back = f"plug it back into {mine.port}" if mine.port else "leave only one of them attached"
    return f"{text}, and what moves something is not guessed; {back}, or run `octoform apply -replace probe`"
