"""What a unit is called, and how sure that is.

The order of trust: the device's own strings where they name a model, the kernel's own names for what it found, the
host's id databases, and last the plain class. Confidence speaks of the product's name, not of its class: a camera
whose strings only say "USB camera" is surely a camera, but which one is not known, so it stays below one half. A
registered name that the device's own strings do not bear out is worth no more, because ids are borrowed and cloned.
"""

from dataclasses import dataclass

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import UNKNOWN, Claim, Evidence

FULL, STRING, REGISTERED, KERNEL, CLASS_ONLY, NOTHING = 0.9, 0.8, 0.7, 0.8, 0.45, 0.3
# What the kernel calls these says less than the database's name of the adapter.
_DATABASE_FIRST = frozenset(("audio", "audio_out", "audio_in", "network", "wifi", "gpu", "bluetooth"))
# Firmware of these kinds ships under borrowed ids, so that a registered name alone proves no product.
_BORROWED = frozenset(("input", "keyboard", "mouse", "gamepad", "tablet", "touchscreen", "touchpad", "serial", "ups"))
# Controllers of these kinds are sold under any brand: whoever registered the ids made the chip.
_CONTROLLER_IDS = _BORROWED | {"storage", "camera", "audio", "audio_in", "audio_out"}
_MEDIUM_WORDS = frozenset(("flash", "drive", "disk", "udisk", "stick"))
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
        return Identity(_shown(device, claim), 0.0, "none")
    found = _of_usb(device, claim) if device.bus == "usb" else _of_other(device, claim)
    if claim.settled or found.confidence < CLASS_ONLY:
        return found
    return Identity(found.name, min(found.confidence, CLASS_ONLY), found.method, found.evidence)


def _of_usb(device: Device, claim: Claim) -> Identity:
    product, maker = device.product_text, device.text("manufacturer")
    if naming.describes_chip(product) and naming.is_vendor(maker):
        return Identity(naming.join(maker, claim.noun), CLASS_ONLY, "descriptor_strings", _strings(device))
    if naming.names_a_model(product):
        confidence = FULL if naming.is_vendor(maker) else STRING
        return Identity(naming.join(maker, product), confidence, "descriptor_strings", _strings(device))
    registered = _registered(device, claim, maker, product)
    if registered and registered.confidence > CLASS_ONLY:
        return registered
    spoken = _kernel_name(claim)
    if spoken and spoken.confidence > CLASS_ONLY and not product:
        return spoken
    if not naming.is_vendor(maker) and claim.kind not in _BORROWED and not _is_medium(claim, product):
        maker = device.database.vendor
    joined = naming.join(maker, product)
    if product and naming.is_name(joined):
        return Identity(joined, CLASS_ONLY, "descriptor_strings", _strings(device))
    return registered or spoken or Identity(claim.noun, NOTHING, "kernel_class")


def _registered(device: Device, claim: Claim, maker: str, product: str) -> Identity | None:
    """The database's name; None when it names nothing or only how the thing is wired."""
    entry = device.database
    if not entry.vendor or naming.describes_transport(entry.product):
        return None
    evidence = (Evidence(entry.line, f"{entry.source}: {naming.tidy(f'{entry.vendor} {entry.product}')}"),)
    name = naming.join(entry.vendor, entry.product or claim.noun)
    if not entry.product:
        return Identity(name, NOTHING, "id_database", evidence)
    if naming.is_reference(product):
        return Identity(name, CLASS_ONLY, "id_database", evidence)
    borne_out = naming.is_vendor(maker) and naming.share_a_word(maker, entry.vendor)
    if borne_out:
        return Identity(name, REGISTERED, "id_database", evidence)
    if device.bus == "usb" and _is_medium(claim, entry.product):
        return None
    if not (maker or product) and not (device.bus == "usb" and claim.kind in _CONTROLLER_IDS):
        return Identity(name, REGISTERED, "id_database", evidence)
    return Identity(name, CLASS_ONLY, "id_database", evidence)


def _is_medium(claim: Claim, product: str) -> bool:
    """True for a flash drive or disk, whose registered vendor is that of its controller and seldom its brand."""
    spoken = set(naming.words(product))
    return claim.kind == "storage" and bool(spoken & _MEDIUM_WORDS) and "reader" not in spoken


def _of_other(device: Device, claim: Claim) -> Identity:
    registered = _registered(device, claim, "", "")
    spoken = _kernel_name(claim)
    if registered and registered.confidence > CLASS_ONLY and (claim.kind in _DATABASE_FIRST or not spoken):
        return registered
    if spoken:
        return spoken
    if registered:
        return registered
    own = device.text("name") if device.bus == "platform" else ""
    prefix = own if naming.is_name(own) else device.bus if device.bus in _PARAVIRTUAL else ""
    return Identity(naming.tidy(f"{prefix} {claim.noun}"), CLASS_ONLY, "kernel_class")


def _kernel_name(claim: Claim) -> Identity | None:
    """The kernel's name for the thing: the first that names a model, else the first that is a name."""
    usable = [(naming.tidy(naming.without_ids(text)), line) for text, line in claim.names]
    usable = [(text, line) for text, line in usable if naming.is_name(text)]
    if not usable:
        return None
    text, line = next((pair for pair in usable if naming.names_a_model(pair[0])), usable[0])
    confidence = KERNEL if naming.names_a_model(text) else CLASS_ONLY
    return Identity(text, confidence, "kernel_class", (Evidence(line, "the kernel's name for it"),))


def _strings(device: Device) -> tuple[Evidence, ...]:
    found = [fact for fact in (device.product, device.fact("manufacturer")) if fact]
    return tuple(Evidence(fact.line, "the device's own string") for fact in found)


def _shown(device: Device, claim: Claim) -> str:
    """What an unknown device is called: its own strings as they are, with the kind that shows."""
    strings = naming.join(device.text("manufacturer"), device.product_text)
    return f"{claim.noun} ({strings})" if strings else claim.noun
