"""Classifies a string of a device by what it identifies: a model, only a class, or only the chip's transport.

Every string here comes from a device and is data: it is bounded, cleaned and compared, nothing more. The judgement
uses general words of the trade (what kind of thing, which transport), never the name of a maker or a product.
"""

import re
from collections.abc import Iterable

from octoform.patterns import regex

# Words of the trade by which the strings of devices are judged; none of them is a maker's or a product's name.
#
# Apart from the judgement itself (`naming`), because the lists only grow: each word in them was seen in strings that
# many different products share.

# Words that say what kind of thing it is, or nothing at all; a string of only these names no model.
_GENERIC = """
    a an and the of for with in on to by at or no not none unknown default string manufacturer product name model my
    generic general standard composite multi multifunction function functional device devices gadget unit module board
    controller adapter adaptor converter bridge interface bus host root hub port ports ver version rev revision
    usb usb1 usb2 usb3 pci pcie express sata ata atapi ahci scsi nvme uas mmc sd tf i2c spi hid ps acpi pnp platform wmi
    full low high super speed hi-speed 2.0 3.0 integrated internal external built embedded onboard mobile portable
    hd fhd uhd qhd vga sd ir rgb camera cam webcam web video image imaging laptop notebook pc desktop mini nano slim pro
    audio sound speaker speakers soundbar microphone mic headset headphone headphones earphone earphones line codec dac
    adc amp amplifier midi mixer digital analog analogue output input in out stereo mono hifi uac uvc advanced enhanced
    keyboard keypad kb keys numeric mouse mice optical laser wired wireless receiver transceiver transmitter dongle
    stick gaming pointing scroll wheel combo set kit consumer control receive remote
    touch touchscreen touchpad screen pad pen stylus tablet pentablet panel display monitor finger gamepad joystick game
    gamecontroller mass storage disk drive flash memory reader writer card cards cardreader multi-card crw cd dvd rom
    ram removable media hdd ssd enclosure
    ethernet network lan wlan wifi wi fi gigabit fast bluetooth bt radio edr le rndis ecm ncm eem mbim qmi
    fingerprint biometric sensor sensors printer scanner printing print support serial uart com virtual vcp cdc acm
    modem power button buttons lid sleep switch system peripheral chipset family series series/ technology technologies
    inc ltd co corp corporation company limited gmbh llc ag sa srl electronics electronic semiconductor computer systems
    international communications r tm c vendor misc processor coprocessor chip soc microcontroller mcu nic udisk ic
    oscilloscope scope logic analyzer analyser ups gnss gps light lamp led leds dock docking token key security meter
    colorimeter thermometer relay kvm sdr tuner infrared fido u2f smartcard smart biometrics common universal dual
    single quad usbhid compliant compatible configurable code id raw data link cable type micro plug play easy new auto
    autofocus focus wide angle phone smartphone android linux mtp ptp adb mode fs hs ss boot bootloader dfu loader
    firmware fw application app dev devkit project recovery fastboot upgrade update download debug debugger
    probe jtag swd dap
    mechanical multimedia ergonomic backlit illuminated waterproof silent ultra premium compact smart professional
    extended slimline foldable rainbow multitouch digitizer digitiser grabber hdmi tv fm
    3d 1080 1000 2500 2000 3000 u
    broadband dvb dvbt atsc isdb dab hybrid capture capturing barcode bar qr scan imager lcd oled cooler fan weather
    station hygrometer barometer temperature humidity multimeter tester instrument spectrometer spectrum signal
    generator arbitrary waveform counter zigbee zwave wave coordinator gateway router wheel racing
    801 802 11 11a 11b 11g 11n 11ac 11ax 11an 11bgn cdma wcdma umts hspa hsdpa gsm lte msm fixed fd configuration
    this software sw has time limitation presenter pedal footswitch swipe magstripe magnetic stripe
"""
GENERIC = frozenset(_GENERIC.split())
# A version (v2) or a quantity with its unit (4mp, 32gb, 100m, 60fps): many products share them.
VERSION = regex(r"v\d+|\d+(?:[kgmp]|mpx?|mpix|megapixels?|[kmgt]bp?s?|bits?|fps|[kmg]?hz|ch|dpi|mah|ports?|inch|in)")
# What the wire is, not what hangs on it: a name with such words belongs to the chip.
TRANSPORT = regex(
    r"\bu(?:sb)?[\s_-]*\d?(?:\.\d)?[\s_-]*(?:<->|to|2)?[\s_-]*ser\b|serial|\buarts?\b|\bvcp\b|\bcom[\s_-]?port|"
    r"\brs[\s_-]?(?:232|422|485)|\b[a-z]{1,3}232[a-z]{0,2}\b|\bttl|\bvcom\b|\bfifo\b|"
    r"\bcdc[\s_-]acm\b|\bparallel port\b|\bieee[\s_-]?1284\b|\b(?:usb|hid)[\s\d._-]*to\b",
    re.IGNORECASE,
)
CONVERTER = regex(r"\busb[\s\d._-]*to\b", re.IGNORECASE)
# Words by which makers mark firmware that ships unchanged in other people's products, or the board it was written for.
REFERENCE = regex(
    r"demo|generic|sample|template|\bexamples?\b|reference design|\btest\b|evaluation|\beval\b|development kit|"
    r"\bdefault\b|\bprototype\b|\bgadget\b|\busb[\s_-]*device$|-(?:mtp|idp|qrd|cdp)\b",
    re.IGNORECASE,
)
# A state that many products have in common: what waits for new firmware does not say what it will be.
STATE = regex(
    r"boot[\s_-]?loader|\bpreloader\b|\bboot(?:[\s_-]|$)|\bdfu\b|\brecovery\b|fastboot|\bfirmware\b|\b(?:down|up)load\b|\bupgrade\b|"
    r"\b[fh]s mode\b",
    re.IGNORECASE,
)
CHIP = frozenset(("processor", "coprocessor", "chip", "chipset", "soc", "microcontroller"))
# Parts that sit inside a product; a string about one belongs to the maker of the part.
PART = CHIP | {"bridge", "codec", "transceiver", "fifo", "ic"}
# In the manufacturer's field these words name no maker.
_PLACEHOLDER = """
    generic general default standard manufacturer vendor company co oem odm none no n a na unknown name brand noname
    string usb usb2 usb3 device devices hid test my your composite
"""
PLACEHOLDER = frozenset(_PLACEHOLDER.split())
# A string of these words alone is no name: it could be any device's.
_EMPTY = """
    usb usb2 usb3 pci pcie hid i2c spi device devices unknown unidentified generic thing peripheral hardware component
    composite vendor specific something some a an the of object item module unit interface
"""
EMPTY = frozenset(_EMPTY.split())
# In the name of a maker: what it makes goes into other people's products.
CHIP_MAKER = frozenset(("semiconductor", "semiconductors", "microelectronics", "semi", "silicon", "chips", "chipset"))
# Kinds that exclude each other; a registered name that brings in another one speaks of another product.
KINDS = frozenset(
    ("bluetooth", "camera", "hub", "modem", "phone", "printer", "scanner", "serial", "storage", "webcam", "wifi")
)


MAX_NAME = 120
MAX_WORDS = 18
_WORD = regex(r"[a-z]+\d[a-z0-9]*|\d+[a-z][a-z0-9]*|[a-z]+|\d+")
_CAMEL = regex(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")

_IDS = regex(r"\b(?:0x[0-9A-Fa-f]{1,4}:0x[0-9A-Fa-f]{1,4}|[0-9A-Fa-f]{4}:[0-9A-Fa-f]{4})\b")
# PROBE's marks in a string: escapes of unprintable characters, a serial number taken out, an end cut off.
_MARKS = regex(r"\\(?:x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8})|<serial>|\[cut\]")
# Some firmware writes the serial number of the unit behind the product's name.
_SERIAL = regex(r"(?:\b|_)S/?N[ :_=-]+[0-9A-Fa-f]{6,}\b")
_TWICE = regex(r"\b(\w{3,})(?: \1\b)+", re.IGNORECASE)
# A firmware's version: three numbers at least.
_DOTTED = regex(r"\b[A-Za-z]?\d+(?:\.\d+){2,}\b")
# The letters of a part number and its first two digits: what members of a family of chips have in common.
_PART_NUMBER = regex(r"[a-z]{2,}\d{2}")
# The letters of a part number and two digits at least, as in the names that makers of chips give to them.
_INITIALS = regex(r"([a-z]{2,4})\d\d[a-z0-9]*")
# A whole family of parts: the last digits are left open.
_FAMILY = regex(r"[a-z]+\d+[a-z]?\d*xx")
_WIRES = ("i2c", "smbus", "spi", "uart", "jtag", "gpio")
_NUMBERED_PART = regex(r"[a-z]{0,5}\d{2,6}[a-z0-9]{0,6}")
_WIRED_PART = regex(r"(?:i2c|smbus|spi|uart)[a-z]{1,3}\d{3}")
_NO_DISKS = frozenset(("webcam", "keyboard", "mouse", "headset", "microphone", "gamepad", "joystick", "oscilloscope"))
_FEW, _LONG = 8, 32
_OPEN = frozenset(("misc", "composite", "unknown", "undefined", "reserved", "oem"))
# Greek, Cyrillic, Hebrew, Arabic, kana, Chinese characters, Hangul: two letters at least.
_FOREIGN = regex(r"[\u0370-\u06ff\u3040-\u30ff\u3400-\u9fff\uac00-\ud7af]{2}")
_COINED = regex(r"\b(?=\w*[a-z])(?=\w*[A-Z]\w*[A-Z])[A-Za-z]{4,}\b")
_LAST_PART = regex(r"[^\w]*\w*$")
_INITIAL = 2
_SHORT_MODEL = regex(r"(.*\S)[ _-]+([A-Z]{2})(?:[ _-].*)?")
_LOT_NUMBER = regex(r"^(?=.*\d.*\d)[A-Z0-9_-]{14,}$")


def tidy(text: str) -> str:
    """A string fit to be shown as a name: one line of at most MAX_NAME characters, without PROBE's marks.

    It is cut where a word ends, since half a word is in no string of the device.
    """
    plain = _SERIAL.sub(" ", _MARKS.sub(" ", text)).replace("_", " ")
    printable = "".join(sign if sign.isprintable() else " " for sign in plain)
    line = _TWICE.sub(r"\1", " ".join(printable.split()))
    if len(line) > MAX_NAME:
        line = _LAST_PART.sub("", line[: MAX_NAME + 1]) or line[:MAX_NAME]
    return line.strip()


def words(text: str) -> list[str]:
    """The lower-case words of a name; 'LEDCube' is two words, 'H640P' is one."""
    return _WORD.findall(_CAMEL.sub(" ", text.replace("_", " ")).lower())


def spread(text: str) -> str:
    """A string with its words of mixed case taken apart."""
    return _CAMEL.sub(" ", text.replace("_", " "))


def model_words(text: str) -> list[str]:
    """The words of a name that distinguish models: no class words, versions, letters or small numbers."""
    plain = _DOTTED.sub(" ", without_ids(text))
    found = [word for word in words(plain) if not _is_filler(word)]
    if found and max(map(len, found)) > _INITIAL:
        return found
    # A coined word of mixed case ('RAMBo', 'uDMX') falls into parts without a meaning.
    whole = [word for word in _COINED.findall(plain) if not GENERIC.issuperset(words(word))]
    return found + [word.lower() for word in whole if not _is_filler(word.lower())]


def _is_filler(word: str) -> bool:
    return word in GENERIC or len(word) == 1 or (word.isdigit() and len(word) < 4) or bool(VERSION.fullmatch(word))


def without_ids(text: str) -> str:
    """A name without the vendor:product numbers that drivers append to it."""
    return _IDS.sub(" ", text)


def is_name(text: str) -> bool:
    """True for what can be a product's name at all: has letters and is no sentence or paragraph."""
    tokens = words(text)
    return (any(token[0].isalpha() for token in tokens) or is_foreign(text)) and len(tokens) <= MAX_WORDS


def is_foreign(text: str) -> bool:
    """True for a string with a word of another script than the Latin one."""
    return _FOREIGN.search(text) is not None


def names_a_model(text: str) -> bool:
    """True when a name identifies the model; false for class words, reference firmware and chips' transports."""
    vague = describes_transport(text) or is_reference(text) or is_state(text)
    return is_name(text) and bool(model_words(text)) and not vague


def has_model_name(text: str) -> bool:
    """True for a name with a word that distinguishes models, whatever else it has."""
    return is_name(text) and bool(model_words(text)) and not describes_transport(text)


def names_a_product(text: str) -> bool:
    """True when a device's own string identifies the model of a product, not of a part that sits in products."""
    return names_a_model(text) and PART.isdisjoint(words(text))


def adds_to(maker: str, product: str) -> bool:
    """True when a product string states more than its maker's name: a model word of its own, or a number.

    Two letters alone are the initials of anyone who sells it, unless they are behind the maker's whole name and are not
    its own: that is how a maker calls one of several models.
    """
    names = set(words(maker))
    spoken = words(_DOTTED.sub(" ", product))
    numbers = [word for word in spoken if word.isdigit() and len(word) > 1 and word not in GENERIC]
    telling = [word for word in model_words(product) if len(word) > 2 or not word.isalpha()]
    return bool(numbers) or not names.issuperset(telling) or _is_short_model(maker, product)


def _is_short_model(maker: str, product: str) -> bool:
    """True for two capitals behind the maker's name: 'Acme SX' of Acme."""
    found = _SHORT_MODEL.fullmatch(product.strip())
    if not found or not is_vendor(maker) or words(found[1]) != words(maker):
        return False
    initials = {word[0] for word in words(maker)}
    return found[2].lower() not in GENERIC and not set(found[2].lower()) <= initials


def describes_transport(text: str) -> bool:
    """True for names such as 'USB Serial' or 'UART Bridge': they say how it is wired, not what it is."""
    return bool(TRANSPORT.search(text.replace("_", " ")))


def is_converter(text: str) -> bool:
    """True for 'USB to ...': what follows is what it can be plugged into, not what it is."""
    return bool(CONVERTER.search(text.replace("_", " ")))


def describes_chip(text: str) -> bool:
    """True where a product's string speaks of the chip in it."""
    return not CHIP.isdisjoint(words(text))


def is_reference(text: str) -> bool:
    """True where the maker itself marks the string as a demonstration or generic firmware's."""
    return bool(REFERENCE.search(text.replace("_", " ")))


def describes_a_part(text: str) -> bool:
    """True where a product's string speaks of a part that sits in products (a bridge, a codec)."""
    return not PART.isdisjoint(words(text))


def describes_wires(text: str) -> bool:
    """True where a string names a bus for chips or a serial line."""
    return describes_transport(text) or any(word.startswith(_WIRES) for word in words(text))


def is_wired_part(word: str) -> bool:
    """True for the number of a chip behind the name of its wire, in one word (i2cxy123z)."""
    return bool(_WIRED_PART.match(word))


def is_wire_and_part(text: str) -> bool:
    """True for the name of a wire beside the number of a part and nothing else ('I2C XY2102N')."""
    spelt = words(text)
    others = [word for word in spelt if word not in _WIRES and not _is_filler(word)]
    return any(word in _WIRES for word in spelt) and all(map(_NUMBERED_PART.fullmatch, others))


def is_short(text: str) -> bool:
    """True for a few plain words, as a name is; false for a sentence, and for a string that PROBE had to fix."""
    return len(words(text)) <= _FEW and max(map(len, text.split()), default=0) <= _LONG and not _MARKS.search(text)


def names_another_thing(text: str) -> bool:
    """True where the string of a disk names a thing that is none, as firmware that was copied does."""
    return not _NO_DISKS.isdisjoint(words(text))


def speaks_of_a_part(text: str) -> bool:
    """True where a string speaks of something that sits in products and is none: a sensor's chip, a miscellany."""
    return not _OPEN.isdisjoint(words(text))


def is_state(text: str) -> bool:
    """True where a string shows what the device is waiting for (a boot loader), not what it is."""
    return bool(STATE.search(text.replace("_", " ")))


def is_placeholder(text: str) -> bool:
    """True for a manufacturer's field that names no one: 'Generic', 'VendorCo', or the kind of thing again."""
    found = words(text)
    if not found:
        return not is_foreign(text)
    return PLACEHOLDER.issuperset(found) or (len(found) == 1 and found[0] in GENERIC)


def says_nothing(text: str) -> bool:
    """True for 'Generic USB Device': each word of it could be in any device's string."""
    return not is_foreign(text) and EMPTY.issuperset(words(text))


def makes_chips(maker: str) -> bool:
    """True for a maker whose own name states that it makes chips: its strings are those of a reference design."""
    return not CHIP_MAKER.isdisjoint(words(maker))


def is_part_of_maker(word: str, maker: str) -> bool:
    """True for a part number as makers of chips form them: the initials or first sounds of the maker, then digits."""
    part = _INITIALS.fullmatch(word)
    if not part:
        return False
    sounds = iter("".join(words(maker)))
    return maker[:1].lower() == part[1][0] and all(letter in sounds for letter in part[1])


def is_family(word: str) -> bool:
    """True for a number with open places (ab33xx), which stands for many parts."""
    return bool(_FAMILY.fullmatch(word))


def speaks_of_another_kind(name: str, own: str) -> bool:
    """True when a name has a word for a kind of device that a device's own words do not have."""
    return not KINDS.intersection(words(name)).issubset(words(own))


def is_vendor(text: str) -> bool:
    """False for placeholders and for lot numbers that are in the manufacturer's field."""
    plain = text.strip(" -._")
    return bool(plain) and not is_placeholder(plain) and is_name(plain) and not _LOT_NUMBER.match(plain)


def join(vendor: str, product: str) -> str:
    """'Vendor Product', without saying the vendor twice and without a placeholder for a vendor."""
    vendor, product = tidy(vendor), tidy(product)
    if not is_vendor(vendor):
        return product
    first = vendor.split()[0].strip(",.").lower()
    if product.lower().startswith(first):
        return product
    return tidy(f"{vendor} {product}") if product else vendor


def is_part_of_driver(word: str, drivers: Iterable[str]) -> bool:
    """True for a part number of the family that a kernel driver is named after: its letters and its first digits."""
    part = _PART_NUMBER.match(word)
    return part is not None and any(driver.lower().startswith(part[0]) for driver in drivers)


def share_a_word(one: str, other: str) -> bool:
    """True when two names have a model word in common."""
    return not set(model_words(one)).isdisjoint(model_words(other))
