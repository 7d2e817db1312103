"""Hosts without a recording, made by construction: each device with what is true of it.

A host is a tree in the form of sysfs. Each device has a kind (what the kernel's interface of its class offers), strings
that name its product, name nothing, mislead or are in another script. Some hosts have id databases, where the number of
a device is registered to it, to another kind, to the chip or to several products, or is absent. Serial numbers are
missing, good, or those that makers leave in by default. A seed makes the same host again; another order plugs the same
devices into other places.

A registered name is evidence behind class, driver and the device's own words. Of a device whose strings name product or
kind it changes neither name nor category; of any other USB device it is a hint and never a certain name.
"""

import random
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from generated_kinds import CONTROLLER, KINDS, NATIVE, Kind
from sysfs_tree import Tree

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.rules.serve.serve_rules import serve_static
from octoform.diagnostics import Severity

BUDGET = 100
CERTAIN = 0.5
TWINS = 0.1
SCHEMAS = Path(__file__).parents[2] / "protocol" / "schemas"

MAKERS = ("Heron", "Quantal", "Brightwater", "Osmo Labs", "Nordwind", "Tessera", "Karoo", "Vireo Works")
MODELS = ("X200", "LX-7", "Pico4", "M310", "Delta9", "QV22", "T-880", "Aria3")
DEFAULT_SERIALS = ("0001", "0123456789", "000000", "111111111111")
SCRIPTS = ("ヘロン", "Журавль", "苍鹭之家", "Ölprüfer", "بلشون")
MISLEADING = (
    *("USB Serial", "USB UART Bridge", "Generic USB Device", "USB2.0-Serial", "Android Bootloader"),
    *("USB to Serial", "I2CFT232R", "USB2.0 MISC", "VendorCo ProductCode"),
)
DATABASES = 0.6
REGISTERED = ("absent", "true", "true", "other kind", "chip", "several")
REGISTERED_MODELS = ("Zephyr61", "QK-90", "Marl530", "Bolt7700")
REGISTERED_CHIPS = ("USB Serial Port", "KX2102 UART Bridge", "USB to Serial Converter", "KX9340 Serial (UART) IC")
REGISTERED_KINDS = (
    *(("Label Printer", "actuator"), ("Relay Board", "actuator"), ("Ethernet Adapter", "infrastructure")),
    *(("Barcode Scanner", "sensor"), ("Webcam", "sensor"), ("Flash Drive", "infrastructure")),
)
"""What a misleading number is registered as, with the category of that."""


@dataclass(frozen=True)
class Made:
    """A device as it was made. ``strings`` is what its strings do: tell, nothing, mislead, script.

    ``tools`` are tools of which it has one at least; empty where no interface of its class offers any.
    ``categories`` are those that are right. ``product`` is the model that its strings name, "" where they name none.
    ``registered`` is what the id database has of its number, "" on a host without one, ``hints`` the models in that.
    """

    kind: str
    place: str
    strings: str
    default_serial: bool
    categories: frozenset[str]
    tools: frozenset[str]
    product: str = ""
    registered: str = ""
    hints: tuple[str, ...] = ()


@dataclass(frozen=True)
class Entry:
    """What an id database has of a number: ``form`` is how it relates to the device, ``name`` its text.

    ``models`` are the models in the text, ``categories`` those of the kind that it names.
    """

    form: str = ""
    name: str = ""
    models: tuple[str, ...] = ()
    categories: tuple[str, ...] = ()


Registry = dict[tuple[str, str, str], str]
"""The registered names by bus, vendor and product."""


def generate(root: Path, seed: int, count: int, order: int = 0) -> list[Made]:
    """Build a host of ``count`` devices below ``root``; what was made, in the order of ``seed`` whatever ``order``."""
    if root.exists():
        shutil.rmtree(root)
    chance = random.Random(seed)
    wanted = [(chance.choice(sorted(KINDS)), index) for index in range(count)]
    for index in range(1, count):  # a twin: the same numbers, strings and serial number in another place
        if chance.random() < TWINS and KINDS[wanted[index - 1][0]].bus == "usb":
            wanted[index] = wanted[index - 1]
    tree = Tree(root)
    (root / "etc").mkdir()
    (root / "etc/os-release").write_text('ID=debian\nVERSION_ID="12"\n')
    tree.bus("pci0000:00/0000:00:14.0", "pci", {"vendor": "0x8086", "device": "0x1e31", "class": "0x0c0330"})
    tree.bus(CONTROLLER, "usb", {"idVendor": "1d6b", "idProduct": "0003", "bDeviceClass": "09"})
    slots = list(range(1, count + 1))
    random.Random(order).shuffle(slots) if order else None
    registry: Registry | None = {} if random.Random(f"databases {seed}").random() < DATABASES else None
    made = [
        _make(tree, kind, random.Random(hash_of(seed, index)), (index, slots[at]), registry)
        for at, (kind, index) in enumerate(wanted)
    ]
    if registry is not None:
        _write_databases(root / "usr/share/misc", registry)
    return made


def hash_of(seed: int, index: int) -> int:
    """One number for each device of each host."""
    return seed * 100_003 + index


def _make(tree: Tree, name: str, chance: random.Random, at: tuple[int, int], registry: Registry | None) -> Made:
    kind, (index, slot) = KINDS[name], at
    native = ("native",) if kind.noun in NATIVE else ()
    strings = (
        chance.choice(("tell", "tell", "nothing", "mislead", "script", *native)) if kind.bus == "usb" else "nothing"
    )
    maker, model = chance.choice(MAKERS), f"{chance.choice(MODELS)}{chance.choice('abcdef')}{index}"
    serial = chance.choice(("", "", f"SN{chance.randrange(10**8):08d}", *DEFAULT_SERIALS)) if kind.bus == "usb" else ""
    texts = {
        "tell": (maker, f"{model} {kind.noun}"),
        "nothing": ("", ""),
        "mislead": ("", chance.choice(MISLEADING)),
        "script": ("", chance.choice(SCRIPTS)),
        "native": ("", NATIVE.get(kind.noun, "")),
    }[strings]
    numbers = (f"{0x1F00 + MAKERS.index(maker):04x}", f"{index:04x}")
    entry = Entry()
    if registry is not None and kind.bus in ("usb", "pci"):
        entry = _entry(kind, model, chance)
        registry[(kind.bus, *numbers)] = entry.name
    place = {"usb": _usb, "pci": _pci}.get(kind.bus, _other)(tree, kind, numbers, index, slot)
    if kind.bus == "usb":
        given = zip(("serial", "manufacturer", "product"), (serial, *texts), strict=True)
        for attribute, text in given:
            if text:
                (tree.root / "sys/devices" / place / attribute).write_text(f"{text}\n")
    kind.build(tree, place if kind.bus != "usb" else f"{place}/{place.rpartition('/')[2]}:1.0", slot)
    # The numbers of other buses are given to no second product, so that a true entry names it there.
    is_known = strings == "tell" or (kind.bus == "pci" and entry.form == "true")
    product = kind.model or (model if is_known else "")
    return Made(
        kind=name,
        place=place,
        strings=strings,
        default_serial=serial in DEFAULT_SERIALS,
        categories=frozenset(_categories(kind, strings, entry)),
        tools=frozenset(kind.tools),
        product=product,
        registered=entry.form,
        hints=tuple(each for each in entry.models if each != product),
    )


def _entry(kind: Kind, model: str, chance: random.Random) -> Entry:
    """What the number of a device is registered as."""
    form, letter = chance.choice(REGISTERED), chance.choice("ghjk")
    if form == "absent":
        return Entry(form)
    if form == "true":
        return Entry(form, f"{model} {kind.noun}", (model,), kind.categories)
    if form == "chip":
        chip = chance.choice(REGISTERED_CHIPS)
        return Entry(form, chip, (chip.split()[0],) if chip.startswith("KX") else ())
    one, other = (f"{each}{letter}" for each in chance.sample(REGISTERED_MODELS, 2))
    if form == "several":
        return Entry(form, f"{one} {kind.noun} / {other} {kind.noun}", (one, other), kind.categories)
    noun, category = chance.choice([each for each in REGISTERED_KINDS if each[1] not in kind.categories])
    return Entry(form, f"{one} {noun}", (one,), (category,))


def _write_databases(folder: Path, registry: Registry) -> None:
    """The files usb.ids and pci.ids in their own form: a vendor, its products below it, and what follows them."""
    folder.mkdir(parents=True)
    for bus in ("usb", "pci"):
        lines = [f"# {bus}.ids", "#"]
        for number, maker in ((f"{0x1F00 + at:04x}", maker) for at, maker in enumerate(MAKERS)):
            lines.append(f"{number}  {maker}")
            for (of_bus, vendor, product), name in sorted(registry.items()):
                if (of_bus, vendor) == (bus, number) and name:
                    lines.append(f"\t{product}  {name}")
                    lines += [f"\t\t{vendor} {product}  Carrier Board"] if bus == "pci" else []
        lines += ["ffee  Unrelated Works", "\t0001  Sextant 12 Camera", "", "C 00  (Defined at Interface level)"]
        (folder / f"{bus}.ids").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _categories(kind: Kind, strings: str, entry: Entry) -> tuple[str, ...]:
    """What is right of a device whose strings do this: its kind, as far as anything shows it.

    Class and driver show it first, then its own words; where neither does, the registered kind.
    """
    if kind.chip and strings in ("tell", "script"):
        # The driver shows a wire and the strings a product without a kind.
        return (*kind.categories, *entry.categories)
    if strings in ("tell", "native") or kind.bus != "usb" or (kind.shown and not kind.chip):
        return kind.categories
    if strings == "nothing" and entry.categories and kind.triple.startswith("ff") and not kind.chip:
        return entry.categories
    if kind.chip or kind.triple.startswith("ff"):
        # A name without a word of the kind; without one nothing is known.
        return ("unknown", *entry.categories, *(("bidirectional",) if strings == "script" else ()))
    return (*kind.categories, "sensor", "bidirectional", "unknown", *entry.categories)


def _usb(tree: Tree, kind: Kind, numbers: tuple[str, str], _index: int, slot: int) -> str:
    path = f"{CONTROLLER}/1-{slot}"
    folder = tree.usb(path, *numbers)
    (folder / "bDeviceClass").write_text("00\n")
    described = {"bInterfaceNumber": "00", "bInterfaceClass": kind.triple[:2], "bInterfaceSubClass": kind.triple[2:4]}
    described["bInterfaceProtocol"] = kind.triple[4:]
    bound = {"DRIVER": kind.driver} if kind.driver else {}
    tree.bus(f"{path}/1-{slot}:1.0", "usb", described, **bound)
    return path


def _pci(tree: Tree, kind: Kind, numbers: tuple[str, str], _index: int, slot: int) -> str:
    path = f"pci0000:00/0000:{slot:02x}:00.0"
    ids = {"vendor": f"0x{numbers[0]}", "device": f"0x{numbers[1]}", "class": f"0x{kind.triple}"}
    tree.bus(path, "pci", ids, DRIVER=kind.driver)
    return path


def _other(tree: Tree, kind: Kind, _numbers: tuple[str, str], index: int, slot: int) -> str:
    if kind.bus == "mmc":
        path = f"platform/mmc_host/mmc{slot}/mmc{slot}:0001"
        tree.bus(path, "mmc", {"type": "MMC", "name": f"DEMO{index:02d}G"}, DRIVER=kind.driver)
        return path
    if kind.bus == "w1":
        path = f"w1_bus_master1/28-{index:012x}"
        tree.bus(path, "w1", DRIVER=kind.driver)
        return path
    names = {
        "i2c": (f"platform/i2c-{slot}/{slot}-{0x40 + index % 16:04x}", f"i2c:{kind.driver}"),
        "spi": (f"platform/spi{slot}/spi{slot}.0", f"spi:{kind.driver}"),
        "acpi": (f"LNXSYSTM:00/BNCH{index:04X}:00", f"acpi:BNCH{index:04X}:"),
        "platform": (f"platform/{kind.driver}{index}.{slot}", f"platform:{kind.driver}{index}"),
    }
    path, modalias = names[kind.bus]
    tree.bus(path, kind.bus, {"modalias": modalias, "name": kind.driver}, MODALIAS=modalias, DRIVER=kind.driver)
    return path


def wrong(root: Path, made: list[Made]) -> list[str]:
    """What the embedded agent makes of a generated host that is not true, and what of it a contract refuses.

    A line each, ``kind: what``; empty for a host of which all invariants hold.
    """
    probe: Any = probe_root(root)
    databases = IdDatabases(root)
    found = identify(probe, databases)
    interface = declare(found, BUDGET)
    registered = {
        each["id"]: " ".join(databases.lookup(each["interface"], each["vid"], each["pid"])).strip()
        for each in probe["devices"]
        if each.get("vid") and each.get("pid")
    }
    known = Artifacts(probe=probe, identify=found, interface=interface, tools_budget=BUDGET, registered=registered)
    refused = [
        item
        for stage, value in (("probe", probe), ("identify", found), ("interface", interface))
        for item in check(stage, value, known, SCHEMAS)
    ]
    refused += serve_static(render(interface), interface)
    lines = [f"refused: {item.code} {item.summary}" for item in refused if item.severity is Severity.ERROR]
    annotated = {each["id"]: each for each in found["devices"]}
    tools = {(device, tool["name"]) for tool in interface["tools"] for device in tool["devices"]}
    cut = {each["id"] for each in interface["left_out"] if each["reason"] in ("tool_budget", "server_size")}
    for device in made:
        lines += [f"{device.kind}: {line}" for line in _untrue(device, probe["devices"], annotated, tools, cut)]
    return lines


def ids(root: Path) -> set[str]:
    """The ids of all devices of a host."""
    probe: Any = probe_root(root)
    return {each["id"] for each in probe["devices"]}


def _untrue(
    device: Made,
    units: list[dict[str, Any]],
    annotated: Mapping[str, dict[str, Any]],
    tools: set[tuple[str, str]],
    cut: set[str],
) -> Iterator[str]:
    own = [each for each in units if f"{each['instance']['sysfs']}/".startswith(f"/sys/devices/{device.place}/")]
    if not own:
        yield "not seen"
        return
    named = [annotated[each["id"]] for each in own if each["id"] in annotated]
    categories = {each["category"] for each in named}
    if categories.isdisjoint(device.categories):
        called = " | ".join(each["identified_as"] for each in named)
        yield f"category {sorted(categories)}, not one of {sorted(device.categories)}; it is called {called}"
    cameras = [each["id"] for each in named if each.get("class") == "camera" and each["category"] == "sensor"]
    if len(cameras) > 1:
        yield f"{len(cameras)} cameras of one"
    has = {tool for each in own for name, tool in tools if name == each["id"]}
    if device.tools and has.isdisjoint(device.tools) and cut.isdisjoint(each["id"] for each in own):
        yield f"tools {sorted(has)}, none of {sorted(device.tools)}"
    text = " | ".join(each["identified_as"] for each in named)
    if device.product and device.product.casefold() not in text.casefold():
        yield f"its strings tell {device.product}, and it is called {text}"
    yield from _overclaimed(device, named)
    if device.default_serial and own[0]["instance"]["strength"] == "strong":
        yield "a default serial number is taken for its own"


def _overclaimed(device: Made, named: list[dict[str, Any]]) -> Iterator[str]:
    """Registered names in place of a device's own, and those that are certain though the number proves no product."""
    for each in named:
        name, is_certain = each["identified_as"], each["confidence"] >= CERTAIN
        found = [hint for hint in device.hints if hint.casefold() in name.casefold()]
        if found and (device.product or device.strings == "native"):
            yield f"it names itself, and is called {name} after the id database"
        elif found and is_certain and device.place.startswith(CONTROLLER):
            yield f"its number alone makes it certainly {name}"
        elif is_certain and device.registered == "several" and len(found) == 1:
            yield f"its number stands for {' and '.join(device.hints)}, and it is certainly {name}"
