"""The name of a unit, and its confidence.

The order of trust: the device's own strings where they name a model, the kernel's own names for what it found, the
host's id databases, and last the plain class. Confidence speaks of the product's name, not of its class: a camera
whose strings only say "USB camera" is surely a camera, but which one is not known, so it stays below one half. A
registered name that the device's own strings do not bear out is worth no more, because ids are borrowed and cloned.
"""

import re
from collections.abc import Sequence

from octoform.builtin.description import glossary, product_names
from octoform.builtin.description.class_model import UNKNOWN, Claim, Evidence
from octoform.builtin.description.device_evidence import Device
from octoform.builtin.description.product_names import GENERIC
from octoform.records import dataclass

FULL, STRING, REGISTERED, KERNEL, CLASS_ONLY, NOTHING = 0.9, 0.8, 0.7, 0.8, 0.45, 0.3
# The kernel's name for these is less specific than the database's name of the adapter.
_DATABASE_FIRST = frozenset(("audio", "audio_out", "audio_in", "network", "wifi", "gpu", "bluetooth"))
# Firmware of these kinds ships under borrowed ids, so that a registered name alone proves no product.
_BORROWED = frozenset(("input", "keyboard", "mouse", "gamepad", "tablet", "touchscreen", "touchpad", "serial", "ups"))
# Controllers of these kinds are sold under any brand: what is known by its ids alone is not known.
_NAMELESS = _BORROWED | {"storage", "camera", "audio", "audio_in", "audio_out", "phone", "bluetooth"}
# Kinds whose strings are shared as freely as their ids: a model is only sure when its maker registered the ids.
_LENT = frozenset(("ups", "keyboard", "mouse", "audio", "audio_in", "audio_out"))
# Kinds whose makers give every model ids of its own; elsewhere one number serves many models, and other makers' too.
_OWN_IDS = frozenset(("hub", "still_camera"))
# What is sold as the chip that it is, so that a maker of chips names it.
_CHIPS = frozenset(("hub", "network", "wifi", "bluetooth", "modem"))
# The longest end of a part number that only gives its variant (S2, C6).
_SUFFIX = 2
_MEDIUM_WORDS = frozenset(("flash", "drive", "disk", "udisk", "stick"))
_SDIO_VENDOR = "udev.ID_VENDOR_FROM_DATABASE"
_PARAVIRTUAL = frozenset(("virtio", "xen", "vmbus", "vio"))


@dataclass(frozen=True, slots=True)
class Identity:
    """A name with its confidence (0..1), the schema's word for how it was found, and what it rests on."""

    name: str
    confidence: float
    method: str
    evidence: tuple[Evidence, ...] = ()


def identity(device: Device, claim: Claim) -> Identity:
    """The best name of a unit whose kind is already judged."""
    if claim.category == UNKNOWN:
        return Identity(_display(device, claim), 0.0, "none")
    if claim.kind == "gpio" and device.bus == "usb":
        # A bridge is itself what was plugged in here; its strings speak of the other wires that it has.
        return Identity(_display(device, claim), CLASS_ONLY, "kernel_class", _strings(device))
    found = _translated(_of_usb(device, claim)) if device.bus == "usb" else _of_other(device, claim)
    if found.confidence <= CLASS_ONLY or (claim.settled and _is_cited(found, claim)):
        return found
    return Identity(found.name, CLASS_ONLY, found.method, found.evidence)


def _translated(found: Identity) -> Identity:
    """The name with what it states in English, where it is in another language; what it rests on states that, too."""
    if found.method != "descriptor_strings" or found.confidence >= STRING:
        return found
    evidence = tuple(_with_meaning(each) for each in found.evidence)
    borne_out = {word for each in evidence for word in each.says.split()}
    text = " ".join(word for word in glossary.english(found.name).split() if word in borne_out)
    return Identity(f"{found.name} ({text})", found.confidence, found.method, evidence) if text else found


def _with_meaning(cited: Evidence) -> Evidence:
    """The evidence with what its quote means in English."""
    found = glossary.english(cited.quote)
    return Evidence(cited.quote, f"{cited.says}; in English: {found}") if found else cited


def _is_cited(found: Identity, claim: Claim) -> bool:
    """True when each word of the name is in what is cited for it, or states the kind of thing.

    A string with unprintable signs, or one that PROBE had to cut, gives a name that no one can look up.
    """
    cited = {word for each in (*found.evidence, *claim.evidence) for word in product_names.words(each.quote)}
    if found.method == "id_database":
        cited.update(word for each in found.evidence for word in product_names.words(each.says))
    return cited.union(product_names.words(claim.noun), GENERIC).issuperset(product_names.words(found.name))


def _of_usb(device: Device, claim: Claim) -> Identity:
    product, maker = device.product_text, device.text("manufacturer")
    if claim.kind == "storage" and product_names.names_another_thing(product):
        vendor = maker if product_names.is_vendor(maker) else device.database.vendor
        return Identity(product_names.join(vendor, claim.noun), CLASS_ONLY, "kernel_class", _strings(device))
    if product_names.describes_chip(product) and product_names.is_vendor(maker):
        return Identity(product_names.join(maker, claim.noun), CLASS_ONLY, "descriptor_strings", _strings(device))
    if product_names.names_a_product(product):
        confidence = _trust_in_strings(device, claim)
        return Identity(product_names.join(maker, product), confidence, "descriptor_strings", _strings(device))
    registered = _registered(device, claim)
    if registered and (
        registered.confidence > CLASS_ONLY or _borne_out(device, claim) or _rests_on_number(device, claim)
    ):
        return registered
    spoken = _kernel_name(claim)
    if spoken and spoken.confidence > CLASS_ONLY and not product:
        # Without strings, drivers take a name from a table of their own by the ids.
        confidence = CLASS_ONLY if claim.kind in _NAMELESS else spoken.confidence
        return Identity(spoken.name, confidence, spoken.method, spoken.evidence)
    evidence, entry = _strings(device), device.database
    if not product_names.is_vendor(maker) and _gives_its_vendor(device, claim):
        maker = entry.vendor
        evidence += (Evidence(entry.maker or entry.line, f"{entry.source}: {maker}"),) if maker else ()
    joined = product_names.join(maker, product)
    if product and product_names.is_name(joined) and not product_names.says_nothing(joined):
        return Identity(joined, CLASS_ONLY, "descriptor_strings", evidence)
    return registered or spoken or Identity(claim.noun, NOTHING, "kernel_class")


def _trust_in_strings(device: Device, claim: Claim) -> float:
    """How far a product string that names a model is believed.

    A brand without a model, a chip's number and a string without anybody's name to it stay below one half, and so does
    what is sold under many names, unless the ids are those of the maker that the strings name.
    """
    maker, product = device.text("manufacturer"), device.product_text
    registered = product_names.share_a_word(product, device.database.product)
    if not product_names.adds_to(maker, product) or names_its_chip(device):
        return CLASS_ONLY
    if product_names.makes_chips(maker) and claim.kind not in _CHIPS:
        return CLASS_ONLY
    if claim.kind in _LENT and not (registered or _maker_registered(device)):
        return CLASS_ONLY
    if product_names.is_vendor(maker):
        return FULL
    if maker and product_names.is_placeholder(maker):
        return CLASS_ONLY
    return CLASS_ONLY if claim.kind in _NAMELESS and not registered else STRING


def names_its_chip(device: Device) -> bool:
    """True when the product string names the chip in it: by the kernel's driver, the id database, or its form."""
    # The text in brackets there is the wire of a product (CDC, UART), not its name.
    found, product = re.sub(r"\(.*?\)", " ", device.database.product), device.product_text
    maker = device.text("manufacturer")
    if product_names.describes_transport(found) and product_names.share_a_word(found, product):
        return True
    telling = product_names.model_words(product)
    if any(product_names.is_part_of_driver(word, device.drivers) or product_names.is_family(word) for word in telling):
        return True
    if product_names.is_wire_and_part(product) or (telling and all(map(product_names.is_wired_part, telling))):
        return True
    parts = [word for word in telling if len(word) > _SUFFIX and word not in product_names.words(maker)]
    return bool(parts) and all(product_names.is_part_of_maker(word, maker) for word in parts)


def _maker_registered(device: Device) -> bool:
    """True when the device's own maker is the one that the ids are registered to."""
    maker = device.text("manufacturer")
    return product_names.is_vendor(maker) and product_names.share_a_word(maker, device.database.vendor)


def _borne_out(device: Device, claim: Claim) -> bool:
    """True when the device's strings agree with the registered product: the same maker, and no other kind of thing.

    Never for a controller: that its maker registered the ids makes the registered product one of its many customers.
    """
    found, own = device.database.product, f"{device.strings} {claim.noun}"
    agrees = bool(found) and _maker_registered(device) and not product_names.speaks_of_another_kind(found, own)
    return agrees and claim.kind in _OWN_IDS


def _rests_on_number(device: Device, claim: Claim) -> bool:
    """True where the registered name is what shows the kind, and the device's own string shows nothing or its wire.

    Such a device is called by what it was identified by: its own string would name something else.
    """
    cited = claim.evidence[0].quote if claim.evidence else ""
    product = device.product_text
    silent = product_names.says_nothing(product) or product_names.describes_transport(product)
    return bool(cited) and cited == device.database.line and silent


def _gives_its_vendor(device: Device, claim: Claim) -> bool:
    """True when the registered vendor may stand for a maker that the strings do not name."""
    found = device.database.product
    return claim.kind not in _BORROWED and not any(_is_medium(claim, text) for text in (device.product_text, found))


def _registered(device: Device, claim: Claim) -> Identity | None:
    """The database's name; None when it names nothing or only how the thing is wired.

    On USB it is believed where the device's own maker bears it out and it states more than that maker's name; a number
    alone names nothing. The ids of other buses are given to no second product.
    """
    entry = device.database
    if not entry.vendor or product_names.describes_transport(entry.product):
        return None
    evidence: tuple[Evidence, ...] = (
        Evidence(entry.line, f"{entry.source}: {product_names.tidy(f'{entry.vendor} {entry.product}')}"),
    )
    if entry.maker and entry.maker != entry.line:
        evidence += (Evidence(entry.maker, f"{entry.source}: the vendor of the same number"),)
    # Where a number on USB was given twice, the database lists both products; which one it is cannot be known.
    product = entry.product.partition(" / ")[0] if device.bus == "usb" else entry.product
    name = product_names.join(entry.vendor, product or claim.noun)
    if not entry.product:
        return Identity(name, NOTHING, "id_database", evidence)
    if device.bus != "usb":
        return Identity(name, REGISTERED, "id_database", evidence)
    if product_names.is_reference(device.product_text):
        return Identity(name, CLASS_ONLY, "id_database", evidence)
    borne_out = _borne_out(device, claim)
    if not borne_out and _is_medium(claim, entry.product):
        return None
    telling = product_names.names_a_model(entry.product) and product_names.adds_to(entry.vendor, entry.product)
    return Identity(name, REGISTERED if borne_out and telling else CLASS_ONLY, "id_database", evidence)


def _is_medium(claim: Claim, product: str) -> bool:
    """True for a flash drive or disk, whose registered vendor is that of its controller and seldom its brand."""
    spoken = set(product_names.words(product))
    return claim.kind == "storage" and bool(spoken & _MEDIUM_WORDS) and "reader" not in spoken


def _of_other(device: Device, claim: Claim) -> Identity:
    registered = _registered(device, claim)
    spoken = _kernel_name(claim)
    if registered and registered.confidence > CLASS_ONLY and (claim.kind in _DATABASE_FIRST or not spoken):
        return registered
    if spoken:
        return spoken
    if registered:
        return registered
    own = device.text("name") if device.bus == "platform" else ""
    prefix = own if product_names.is_name(own) else device.bus if device.bus in _PARAVIRTUAL else ""
    if device.bus in ("platform", "amba") and not product_names.names_a_model(prefix) and (tree := _of_tree(device)):
        text, line = tree
        evidence = (Evidence(line, f"the device tree's name of the {claim.noun}"),)
        return Identity(product_names.tidy(f"{text} {claim.noun}"), CLASS_ONLY, "kernel_class", evidence)
    if device.bus == "mmc" and device.text("type") == "SDIO":
        # A function on the card bus has numbers and no name; its driver gives the family.
        driver = next((fact.text for fact in device.of("sdio", "driver")), "")
        maker = device.database.vendor or next((fact.text for fact in device.of("sdio", _SDIO_VENDOR)), "")
        prefix, driver = product_names.join(maker, "SDIO"), f" ({driver})" if driver else ""
        return Identity(product_names.tidy(f"{prefix} {claim.noun}{driver}"), CLASS_ONLY, "kernel_class")
    return Identity(product_names.tidy(f"{prefix} {claim.noun}"), CLASS_ONLY, "kernel_class")


def _kernel_name(claim: Claim) -> Identity | None:
    """The kernel's name for the thing: the first that names a model, else the first that is a name."""
    usable = [(product_names.tidy(product_names.without_ids(text)), lines) for text, *lines in claim.names]
    usable = [(text, lines) for text, lines in usable if product_names.is_name(text)]
    if not usable:
        return None
    # What the kernel itself calls generic is still what it is called.
    text, lines = next((pair for pair in usable if product_names.has_model_name(pair[0])), usable[0])
    confidence = KERNEL if product_names.names_a_model(text) else CLASS_ONLY
    return Identity(text, confidence, "kernel_class", tuple(Evidence(line, _statement(text, lines)) for line in lines))


def _statement(name: str, lines: Sequence[str]) -> str:
    """The statement that the lines support: the name, and the kind in this agent's words."""
    quoted = {word for line in lines for word in product_names.words(line)}
    own = [word for word in product_names.words(name) if word not in quoted]
    return "the kernel's name for it" + (f": {' '.join(own)}" if own else "")


def _strings(device: Device) -> tuple[Evidence, ...]:
    found = [fact for fact in (device.product, device.fact("manufacturer")) if fact]
    return tuple(Evidence(fact.line, "the device's own string") for fact in found)


def _display(device: Device, claim: Claim) -> str:
    """The name of an unknown device: its own strings verbatim, with the kind that shows."""
    strings = product_names.join(device.text("manufacturer"), device.product_text)
    return f"{claim.noun} ({strings})" if strings else claim.noun


def _of_tree(device: Device) -> tuple[str, str] | None:
    """The model in the first compatible string of the device tree, without its vendor's prefix, and its line."""
    fact = device.fact("of_compatible_0")
    text = fact.text.partition(",")[2] if fact else ""
    return (text, fact.line) if fact and product_names.names_a_model(text) else None
