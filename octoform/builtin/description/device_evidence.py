"""A PROBE device as the class modules read it: facts with the line that each is in.

PROBE's text is lines of `key: value`; a line of a class device in the unit is `class[0].key: value`. Everything
that IDENTIFY concludes cites such a line whole, so that the quote can be checked against the artifact. Instance facts
(paths, nodes) are used only for what they say about the kind: which directions a sound card has, what lies below what.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import Evidence
from octoform.patterns import regex
from octoform.records import dataclass

_MEMBER = regex(r"^([a-z0-9_-]+)\[(\d+)\]\.([^:]+)$")
_TRIPLE = regex(r"\bclass ([0-9a-f]{2})/([0-9a-f]{2})/([0-9a-f]{2})")
_DRIVER = regex(r"\bdriver=(\S+)")
# The firmware's vendor prefixes (PNP ids) name the company that registered three letters, often not the maker.
_NO_REGISTRY = frozenset(("acpi", "pnp", "platform", "i2c", "spi", "serio", "virtual", "input", "dmi"))
_LABEL = regex(r"\blabel=(.*)$")


@dataclass(frozen=True, slots=True)
class Fact:
    """One line of PROBE's text: ``owner`` and ``index`` name the class device it speaks of, "" the unit itself."""

    owner: str
    index: int
    key: str
    text: str
    line: str


@dataclass(frozen=True, slots=True)
class Interface:
    """One USB interface: its class triple, the driver bound to it and its own string."""

    triple: tuple[str, str, str]
    driver: str
    label: str
    line: str


@dataclass(frozen=True, slots=True)
class Registered:
    """The entry of the host's id databases for the unit's ids, and the line of PROBE that leads there.

    ``maker`` is the line that names the vendor, where another one names the product.
    """

    vendor: str = ""
    product: str = ""
    line: str = ""
    source: str = ""
    maker: str = ""


class Device:
    """One entry of PROBE's `devices`, parsed once."""

    def __init__(self, entry: Mapping[str, Any], databases: IdDatabases) -> None:
        self._databases = databases
        self.id = str(entry["id"])
        self.name = str(entry["name"])
        self.bus = str(entry["interface"])
        self.classes = frozenset(entry.get("classes", ()))
        self.drivers = frozenset(entry.get("drivers", ()))
        self.vid = str(entry.get("vid", ""))
        self.pid = str(entry.get("pid", ""))
        self.context = bool(entry.get("context", False))
        instance = entry.get("instance", {})
        self.path = str(instance.get("sysfs", ""))
        self.nodes = tuple((str(node["class"]), str(node["name"])) for node in instance.get("nodes", ()))
        self.raw = str(entry["raw_descriptor"])
        self.facts = tuple(_facts(self.raw))

    def fact(self, *keys: str) -> Fact | None:
        """The first fact of the unit itself under one of the keys, tried in their order."""
        for key in keys:
            for fact in self.facts:
                if fact.key == key and not fact.owner and fact.text:
                    return fact
        return None

    def text(self, *keys: str) -> str:
        """The text of that fact; empty when there is none."""
        found = self.fact(*keys)
        return found.text if found else ""

    def udev(self, name: str) -> Fact | None:
        """A property of the system's own udev rules and databases, of the unit or of anything in it."""
        return next((fact for fact in self.facts if fact.key == f"udev.{name}" and fact.text), None)

    def udev_text(self, name: str) -> str:
        """The text of that property; empty when there is none."""
        found = self.udev(name)
        return found.text if found else ""

    def of(self, kernel_class: str, *keys: str) -> list[Fact]:
        """The lines of a kernel class of the unit, under the keys where any are given."""
        return [fact for fact in self.facts if fact.owner == kernel_class and (not keys or fact.key in keys)]

    def groups(self, kernel_class: str) -> list[dict[str, Fact]]:
        """The facts of a kernel class by key, one dictionary for each class device."""
        found: dict[int, dict[str, Fact]] = {}
        for fact in self.of(kernel_class):
            found.setdefault(fact.index, {}).setdefault(fact.key, fact)
        return list(found.values())

    def names(self, kernel_class: str, *keys: str) -> tuple[tuple[str, str], ...]:
        """The texts of a kernel class under the keys, keys in their order, each with its line."""
        return tuple((fact.text, fact.line) for key in keys for fact in self.of(kernel_class, key) if fact.text)

    @cached_property
    def interfaces(self) -> tuple[Interface, ...]:
        """The USB interfaces, in their order."""
        found = []
        for fact in self.facts:
            triple = _TRIPLE.search(fact.text)
            if triple and fact.key.startswith("interface"):
                driver, label = _DRIVER.search(fact.text), _LABEL.search(fact.text)
                parts = (triple[1], triple[2], triple[3])
                found.append(Interface(parts, driver[1] if driver else "", label[1] if label else "", fact.line))
        return tuple(found)

    def usb(self, *triples: str) -> Interface | None:
        """The first interface whose class triple begins with one of the prefixes, such as '0e' or '02/02'."""
        for interface in self.interfaces:
            if any("/".join(interface.triple).startswith(triple) for triple in triples):
                return interface
        return None

    @cached_property
    def product(self) -> Fact | None:
        """The line with the device's product string: the descriptor's, else what udev kept of it."""
        own = self.fact("product")
        kept = [found for name in ("ID_MODEL", "ID_SERIAL.name") if (found := self.udev(name))]
        # Without strings, udev writes the numeric ids in their place.
        return own or next(
            (found for found in kept if found.text.lower() not in (self.pid, f"{self.vid}_{self.pid}")), None
        )

    @property
    def product_text(self) -> str:
        """The product string, tidied; empty when there is none."""
        return product_names.tidy(self.product.text) if self.product else ""

    @cached_property
    def database(self) -> Registered:
        """The registered name: udev's where it recorded one, else the id file's; empty off USB, PCI and SDIO."""
        if self.bus in _NO_REGISTRY:
            return Registered()
        vendor, product = self.udev("ID_VENDOR_FROM_DATABASE"), self.udev("ID_MODEL_FROM_DATABASE")
        line = next((fact.line for fact in (product, self.fact("product_id", "device_id"), vendor) if fact), "")
        if product or not self.vid:
            maker = vendor.line if vendor else ""
            return Registered(vendor.text if vendor else "", product.text if product else "", line, "udev hwdb", maker)
        found = self._databases.lookup(self.bus, self.vid, self.pid)
        if not found[1] and vendor:
            return Registered(vendor.text, "", vendor.line, "udev hwdb")
        return Registered(*found, line, self._databases.source(self.bus)) if line else Registered()

    @property
    def usb_class(self) -> str:
        """The USB device's own class code (two digits); empty when it has none."""
        return self.text("device_class")[:2] if self.bus == "usb" else ""

    @property
    def pci_class(self) -> str:
        """The PCI class and subclass as four digits; empty off that bus."""
        return self.text("class_code").removeprefix("0x")[:4] if self.bus == "pci" else ""

    @property
    def strings(self) -> str:
        """All that the device reports of itself in words: manufacturer, product, interface labels."""
        labels = [interface.label for interface in self.interfaces]
        return " ".join(part for part in (self.text("manufacturer"), self.product_text, *labels) if part)

    def cite(self, kernel_class: str, says: str) -> Evidence:
        """Evidence that the unit has a kernel class: a line of it, else the unit's name."""
        for fact in self.facts:
            if fact.owner == kernel_class:
                return Evidence(fact.line, says)
        return self.cite_self(says)

    def cite_key(self, key: str, says: str) -> Evidence:
        """Evidence from a fact of the unit itself."""
        found = self.fact(key)
        return Evidence(found.line, says) if found else self.cite_self(says)

    def cite_self(self, says: str) -> Evidence:
        """Evidence from the unit's driver, or from its name when it has none."""
        driver = self.fact("driver", "modalias")
        return Evidence(driver.line if driver else self.name or self.facts[0].line, says)


def _facts(raw: str) -> Iterator[Fact]:
    for line in raw.split("\n"):
        key, colon, text = line.partition(": ")
        if not colon:
            continue
        member = _MEMBER.match(key)
        if member:
            yield Fact(member[1], int(member[2]), member[3], text.strip(), line)
        else:
            yield Fact("", 0, key, text.strip(), line)
