"""What a string of a device says about the product: a model, only a class, or only the chip's transport.

Every string here comes from a device and is data: it is bounded, cleaned and compared, nothing more. The judgement
uses general words of the trade (what kind of thing, which transport), never the name of a maker or a product.
"""

import re

LONGEST_NAME = 120
MOST_WORDS = 18
_WORD = re.compile(r"[a-z]+\d[a-z0-9]*|\d+[a-z][a-z0-9]*|[a-z]+|\d+")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")

# Words that say what kind of thing it is, or nothing at all; a string of only these names no model.
_GENERIC = """
    a an and the of for with in on to by at or no not none unknown default string manufacturer product name model
    generic general standard composite multi multifunction function functional device devices gadget unit module board
    controller adapter adaptor converter bridge interface bus host root hub port ports ver version rev revision
    usb usb1 usb2 usb3 pci pcie express sata ata ahci scsi nvme mmc sd i2c spi hid ps acpi pnp platform wmi
    full low high super speed hi-speed 2.0 3.0 integrated internal external built embedded onboard mobile
    hd fhd uhd qhd sd ir rgb camera cam webcam web video image imaging laptop notebook audio sound speaker speakers
    microphone mic headset headphone headphones line codec digital analog output input in out stereo mono
    keyboard keypad mouse optical wired wireless receiver transceiver transmitter dongle stick gaming pointing
    touch touchscreen touchpad screen pad pen stylus tablet pentablet panel finger gamepad joystick game
    mass storage disk drive flash memory reader writer card multi-card crw cd dvd rom ram removable media
    ethernet network lan wlan wifi wi fi gigabit fast bluetooth bt radio edr le
    fingerprint biometric sensor sensors printer scanner printing support serial uart com virtual vcp cdc acm modem
    power button lid sleep switch system peripheral chipset family series series/ technology technologies
    inc ltd co corp corporation company limited gmbh llc ag sa srl electronics semiconductor computer systems
    international communications r tm c vendor misc monitor processor coprocessor chip soc microcontroller nic pnp udisk
    oscilloscope scope logic analyzer analyser ups gnss gps light lamp led leds dock docking token key security meter
    colorimeter thermometer relay kvm radio sdr tuner infrared fido u2f smartcard smart biometrics
    4g 5g 4ghz 5ghz 2k 4k 3d 720p 1080p 1080 1000 2500 u
"""
GENERIC = frozenset(_GENERIC.split())
# What the wire is, not what hangs on it: a name with such words belongs to the chip.
_TRANSPORT = re.compile(
    r"\bu(?:sb)?[\s_-]*\d?(?:\.\d)?[\s_-]*(?:<->|to|2)?[\s_-]*ser\b|serial|\buarts?\b|\bvcp\b|\bcom[\s_-]?port|"
    r"\brs[\s_-]?(?:232|422|485)|\bttl|\bvcom\b",
    re.IGNORECASE,
)
# Words by which makers mark firmware that ships unchanged in other people's products.
_REFERENCE = re.compile(r"demo|generic|sample|template|\bexamples?\b|reference design|\btest\b", re.IGNORECASE)
_CHIP_WORDS = frozenset(("processor", "coprocessor", "chip", "soc", "microcontroller"))
_IDS = re.compile(r"\b[0-9A-Fa-f]{4}:[0-9A-Fa-f]{4}\b")
# PROBE's marks in a text: escapes of unprintable characters, a serial number taken out, an end cut off.
_MARKS = re.compile(r"\\(?:x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8})|<serial>|\[cut\]")
_TWICE = re.compile(r"\b(\w{3,})(?: \1\b)+", re.IGNORECASE)
_NO_VENDOR = frozenset(
    ("generic", "no manufacturer", "manufacturer", "n/a", "na", "none", "unknown", "default string", "vendor", "usb")
)
_LOT_NUMBER = re.compile(r"^(?=.*\d.*\d)[A-Z0-9_-]{14,}$")


def tidy(text: str) -> str:
    """A string fit to be shown as a name: one line of at most LONGEST_NAME characters, without PROBE's marks."""
    plain = _MARKS.sub(" ", text).replace("_", " ")
    printable = "".join(sign if sign.isprintable() else " " for sign in plain)
    return _TWICE.sub(r"\1", " ".join(printable.split()))[:LONGEST_NAME].strip()


def words(text: str) -> list[str]:
    """The lower-case words of a name; 'LEDCube' is two words, 'H640P' is one."""
    return _WORD.findall(_CAMEL.sub(" ", text.replace("_", " ")).lower())


def model_words(text: str) -> list[str]:
    """The words of a name that tell one model from another: no class words, no small numbers."""
    return [word for word in words(without_ids(text)) if word not in GENERIC and not (word.isdigit() and len(word) < 4)]


def without_ids(text: str) -> str:
    """A name without the vendor:product numbers that drivers append to it."""
    return _IDS.sub(" ", text)


def is_name(text: str) -> bool:
    """True for what can be a product's name at all: has letters and is no sentence or paragraph."""
    tokens = words(text)
    return any(token[0].isalpha() for token in tokens) and len(tokens) <= MOST_WORDS


def names_a_model(text: str) -> bool:
    """True when a name tells the model; false for class words, reference firmware and chips' transports."""
    return is_name(text) and bool(model_words(text)) and not describes_transport(text) and not is_reference(text)


def describes_transport(text: str) -> bool:
    """True for names such as 'USB Serial' or 'UART Bridge': they say how it is wired, not what it is."""
    return bool(_TRANSPORT.search(text.replace("_", " ")))


def describes_chip(text: str) -> bool:
    """True where a product's string speaks of the chip in it."""
    return not _CHIP_WORDS.isdisjoint(words(text))


def is_reference(text: str) -> bool:
    """True where the maker itself marks the string as a demonstration or generic firmware's."""
    return bool(_REFERENCE.search(text.replace("_", " ")))


def is_vendor(text: str) -> bool:
    """False for placeholders and for lot numbers that stand in the manufacturer's field."""
    plain = text.strip(" -._")
    return bool(plain) and plain.lower() not in _NO_VENDOR and is_name(plain) and not _LOT_NUMBER.match(plain)


def join(vendor: str, product: str) -> str:
    """'Vendor Product', without saying the vendor twice and without a placeholder for a vendor."""
    vendor, product = tidy(vendor), tidy(product)
    if not is_vendor(vendor):
        return product
    first = vendor.split()[0].strip(",.").lower()
    if product.lower().startswith(first):
        return product
    return tidy(f"{vendor} {product}") if product else vendor


def share_a_word(one: str, other: str) -> bool:
    """True when two names have a model word in common."""
    return not set(model_words(one)).isdisjoint(model_words(other))
