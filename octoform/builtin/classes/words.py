"""Kinds of devices without an interface class, identified by general words in the device's own strings.

The words are those of the trade (oscilloscope, colorimeter, UPS); none is a maker's or a product's. They are looked
for in the device's own strings and in the name that the host's id database gives; a word found only in the database
is weaker and states that.
"""

from collections.abc import Iterable, Iterator

from octoform.builtin.description import glossary, product_names
from octoform.builtin.description.class_model import ACTUATOR, BIDIRECTIONAL, INFRASTRUCTURE, SENSOR, Claim, Evidence
from octoform.builtin.description.device_evidence import Device
from octoform.patterns import regex

# A model number often begins with the kind (a DSO2000 is a DSO), and strings run number and kind together.
_STEM = regex(r"^[a-z]{3,}(?=\d)|(?<=\d)[a-z]{5,}$")
# (words, kind, category, noun); a phrase needs its words side by side. The first line that fits wins. A noun has words
# of class alone, because it may be the whole name of a device: no string of its own has any other word of it.
Entry = tuple[tuple[str, ...], str, str, str]
_WORDS: tuple[Entry, ...] = (
    (("fingerprint", "finger print", "biometric", "biometrics", "swipe sensor"), "fingerprint",
     SENSOR, "fingerprint reader"),
    (("fido", "fido2", "u2f", "security key", "smartcard", "smart card", "security token", "passkey", "authenticator"),
     "security", INFRASTRUCTURE, "security token"),
    (("ups", "uninterruptible"), "ups", INFRASTRUCTURE, "uninterruptible power supply"),
    (("oscilloscope", "scope", "dso"), "scope", SENSOR, "oscilloscope"),
    (("logic analyzer", "logic analyser"), "logic", SENSOR, "logic analyser"),
    (("spectrum analyzer", "spectrum analyser", "signal analyzer", "network analyzer", "vna"), "analyzer", SENSOR,
     "signal analyser"),
    (("multimeter", "dmm", "power meter", "energy meter", "lux meter", "light meter", "sound level meter", "ph meter",
      "tachometer", "force gauge", "load cell", "inclinometer", "altimeter", "caliper", "datalogger", "data logger",
      "lcr meter", "watt meter", "power analyzer"), "meter", SENSOR, "measuring instrument"),
    (("signal generator", "function generator", "waveform generator"), "generator", ACTUATOR, "signal generator"),
    (("power supply", "electronic load", "source meter", "sourcemeter", "smu"), "power_source", BIDIRECTIONAL,
     "bench power supply"),
    (("daq", "data acquisition"), "daq", BIDIRECTIONAL, "measurement and control device"),
    (("gpib", "ieee 488", "hpib"), "instrument", BIDIRECTIONAL, "instrument bus interface"),
    (("colorimeter", "spectrophotometer", "spectrometer"), "color", SENSOR, "colour meter"),
    (("thermometer", "hygrometer", "humidity", "barometer", "temperature", "temp", "weather station", "co2",
      "carbon dioxide", "air quality", "particulate", "gas sensor", "geiger", "radiation", "dosimeter", "anemometer",
      "thermocouple", "soil moisture"), "temperature", SENSOR, "environment sensor"),
    (("eeg", "ecg", "emg", "brain waves", "oximeter", "pulse oximeter", "heart rate", "spirometer", "glucose meter",
      "glucometer",
      "blood pressure"), "biosensor", SENSOR, "biosensor"),
    (("lidar", "rangefinder", "range finder", "radar", "time of flight"), "range", SENSOR, "range sensor"),
    (("eye tracker", "eyetracker", "motion tracker", "head tracker"), "tracker", SENSOR, "position sensor"),
    (("gnss", "gps", "glonass", "rtk"), "gnss", SENSOR, "satellite positioning receiver"),
    (("zigbee", "z-wave", "zwave", "802.15.4", "matter thread"), "zigbee", BIDIRECTIONAL, "home radio stick"),
    (("lora", "lorawan"), "radio", BIDIRECTIONAL, "radio"),
    (("sdr", "dvb", "tuner"), "sdr", BIDIRECTIONAL, "radio receiver"),
    (("wimax", "wlan", "wi-fi", "wifi", "802.11", "802.11n", "802.11ac"), "wifi", INFRASTRUCTURE,
     "wireless network adapter"),
    (("lte", "modem", "wwan", "mobile broadband"), "modem", INFRASTRUCTURE, "modem"),
    (("ethernet", "lan", "nic"), "network", INFRASTRUCTURE, "network adapter"),
    (("infrared", "ircu", "remote control receiver"), "ir", BIDIRECTIONAL, "infrared transceiver"),
    (("radio", "transceiver"), "radio", BIDIRECTIONAL, "radio"),
    (("dmx", "dmx512", "ilda", "laser dac"), "light", ACTUATOR, "light control interface"),
    (("led", "leds", "light", "lamp", "lighting", "glow", "blink", "busylight", "beacon", "strobe"), "light", ACTUATOR,
     "light"),
    (("dock", "docking"), "dock", INFRASTRUCTURE, "dock"),
    (("kvm", "remote console"), "kvm", INFRASTRUCTURE, "KVM switch"),
    (("barcode", "bar code", "qr code"), "barcode", SENSOR, "barcode reader"),
    (("magstripe", "magnetic stripe", "swipe reader", "card swipe"), "card_reader", SENSOR, "magnetic stripe reader"),
    (("postal scale", "weighing scale", "weight scale", "scale"), "scale", SENSOR, "weighing scale"),
    (("braille",), "braille", BIDIRECTIONAL, "braille display"),
    (("scanner", "scan"), "scanner", SENSOR, "scanner"),
    (("3d printer", "cnc", "engraver", "plotter", "laser cutter", "vinyl cutter"), "machine", ACTUATOR,
     "machine with computer control"),
    (("printer",), "printer", ACTUATOR, "printer"),
    (("id card", "identity card"), "reader", SENSOR, "card reader"),
    (("card reader", "crw", "cardreader"), "storage", INFRASTRUCTURE, "card reader"),
    (("relay", "stepper", "servo", "motor controller", "motor driver", "gimbal", "gripper", "robot"), "actuator",
     ACTUATOR, "actuator"),
    (("fan controller", "liquid cooler", "water cooling", "pump controller"), "cooling", BIDIRECTIONAL,
     "cooling controller"),
)  # fmt: skip
# Words with a second meaning: only where the device shows interfaces of its vendor and is nothing for a person's hand.
_INSTRUMENTS: tuple[Entry, ...] = ((("logic",), "logic", SENSOR, "logic analyser"),)
# No memory card is read through such a line; what is held to the reader sends its number.
_HELD_CARDS = ("reader", SENSOR, "card reader")
# What a thing is for, even when it also shows a disk with its manual or a network of its own.
_DEFINING = tuple(entry for entry in _WORDS if entry[1] in ("scope", "logic", "analyzer", "meter", "generator", "sdr"))
# A debugger on a board does not identify the board.
_PROBES: tuple[Entry, ...] = (
    (("cmsis dap", "daplink", "jtag", "swd", "debug probe", "debugger", "programmer"), "debugger", BIDIRECTIONAL,
     "debug probe"),
)  # fmt: skip
# A keyboard or a mouse is one whatever words are printed on it.
_BOOT = ("03/01/01", "03/01/02")
_HID = "03"
_PLAIN: tuple[Entry, ...] = (
    (("storage", "flash drive", "flash disk", "ssd", "card reader"), "storage", INFRASTRUCTURE, "storage device"),
    (("webcam", "camera", "thermal imager", "microscope", "endoscope", "borescope"), "camera", SENSOR, "USB camera"),
    (("video capture", "capture card", "frame grabber", "grabber", "capture"), "capture", SENSOR,
     "video capture device"),
    (("hub",), "hub", INFRASTRUCTURE, "USB hub"),
    (("keyboard",), "keyboard", SENSOR, "USB keyboard"),
    (("mouse",), "mouse", SENSOR, "USB mouse"),
    (
        ("headset", "headphones", "audio", "speaker", "microphone", "midi", "synthesizer", "mixer", "sound card"),
        "audio",
        BIDIRECTIONAL,
        "USB audio device",
    ),
    (("touchscreen", "touch screen", "touchpad", "touch panel", "digitizer", "digitiser"), "touchscreen", SENSOR,
     "touch surface"),
    (("trackball", "presenter", "gamepad", "joystick", "game controller", "foot pedal", "footswitch", "foot switch",
      "macropad", "macro pad", "keypad", "touchpen", "pen tablet", "drawing tablet", "graphics tablet", "stylus"),
     "input", SENSOR, "input device"),
    (("rfid", "nfc", "contactless", "magstripe", "magnetic stripe"), "reader", SENSOR, "card reader"),
    (("phone", "smartphone"), "phone", BIDIRECTIONAL, "phone"),
    (("oled", "lcd", "epaper", "e paper", "projector", "customer display", "pole display", "usb display"), "display",
     ACTUATOR, "display"),
)  # fmt: skip
TABLES = (_WORDS, _INSTRUMENTS, _PROBES, _PLAIN)
_CLASSED = frozenset(("storage", "camera", "capture", "hub", "keyboard", "mouse", "audio", "touchscreen"))
"""Of the plain words those for which the USB-IF has a class."""
_UDEV = (
    ("ID_SIGNAL_ANALYZER", "logic", SENSOR, "signal analyser"),
    ("ID_SOFTWARE_RADIO", "sdr", BIDIRECTIONAL, "software radio"),
    ("ID_AV_LIGHTS", "light", ACTUATOR, "studio light"),
    ("ID_AV_PRODUCTION_CONTROLLER", "input", SENSOR, "production controller"),
    ("COLOR_MEASUREMENT_DEVICE", "color", SENSOR, "colour meter"),
    ("ID_MAKER_TOOL", "maker_tool", BIDIRECTIONAL, "maker tool"),
    ("ID_INFRARED_CAMERA", "camera", SENSOR, "infrared camera"),
)


def claim_instrument(device: Device) -> Claim | None:
    """An instrument, a radio or a debugger by its own product string, whatever else it shows (a disk, a network)."""
    if device.bus != "usb" or not device.product or device.usb(*_BOOT):
        return None
    if entry := kind_of(_own(device), _DEFINING):
        return Claim(*entry, evidence=_cited(device.product.line, "the device's own words", entry))
    return None if product_names.describes_transport(device.product_text) else _debugger(device)


def claim(device: Device) -> Claim | None:
    """A kind identified by udev's rules, by the device's words, or by the database's; nothing otherwise."""
    for name, kind, category, noun in _UDEV:
        if found := device.udev(name):
            return Claim(kind, category, noun, (Evidence(found.line, "udev's rules set this property"),))
    if device.bus != "usb" or device.usb(*_BOOT):
        return None
    table = _WORDS if device.usb(_HID) else (*_WORDS, *_INSTRUMENTS)
    for line, text, says in _spoken(device):
        entry = kind_of(text, table)
        wired = product_names.is_converter(text) or (
            product_names.describes_a_part(text) and product_names.describes_wires(text)
        )
        if entry and entry[0] == "storage" and (device.usb(_HID) or "tty" in device.classes):
            entry = _HELD_CARDS
        if entry and not (wired and entry[1] in (SENSOR, ACTUATOR)):
            # A number alone names nothing that senses or acts.
            return Claim(*entry, evidence=_cited(line, says, entry), settled=line != device.database.line)
    maker = device.fact("manufacturer")
    if maker and (entry := kind_of(maker.text, _WORDS[:1])):
        return Claim(*entry, evidence=_cited(maker.line, "what its maker makes", entry), settled=False)
    return None


def _debugger(device: Device) -> Claim | None:
    for line, text, says in _spoken(device):
        if entry := kind_of(text, _PROBES):
            return Claim(*entry, evidence=_cited(line, says, entry), settled=False)
    return None


def spoken_of(text: str) -> tuple[str, str, str] | None:
    """(kind, category, noun) from a person's words about a device; None without a word of a kind."""
    return kind_of(text, (*_WORDS, *_PROBES, *_PLAIN))


def claim_plain(device: Device) -> Claim | None:
    """The kind by the plain words of the strings, for a USB device that shows no class of its own.

    A debugger without strings has its word in the registered name alone.
    """
    if device.bus != "usb":
        return None
    for line, text, says in _spoken(device):
        if entry := kind_of(text, (*_PLAIN, *_PROBES)):
            return Claim(*entry, evidence=_cited(line, says, entry), settled=False)
    return None


def _cited(line: str, says: str, entry: tuple[str, str, str]) -> tuple[Evidence, ...]:
    """The line that has the word, with what follows from it: of LTE, that it is a modem."""
    kind, _, noun = entry
    follows = noun if kind in noun else f"{noun}, class {kind}"
    return (Evidence(line, f"{says} ({follows})"),)


def names_own_kind(device: Device) -> bool:
    """True where the product string names a kind by a plain word, so that a registered name states no other."""
    return bool(device.product) and kind_of(_own(device), _PLAIN) is not None


def has_own_class(text: str) -> bool:
    """True where a name has a plain word for what USB has a class for, so that no serial line leads there."""
    entry = kind_of(text, _PLAIN)
    return entry is not None and entry[0] in _CLASSED


def _own(device: Device) -> str:
    """The product string, with what it means in English."""
    return f"{device.product_text} {glossary.english(device.product_text)}"


def _spoken(device: Device) -> Iterator[tuple[str, str, str]]:
    """(line, words, what they are) of the device's own strings, then of the database.

    Where the product string names a kind, also by a plain word, the database is not read: products share numbers.
    """
    if device.product:
        yield device.product.line, _own(device), "the device's own words"
    for interface in device.interfaces:
        if interface.label:
            yield interface.line, interface.label, "the interface's own words"
    found = device.database
    if found.product and not names_own_kind(device):
        yield found.line, found.product, f"{found.source}: {found.vendor} {found.product}"


def kind_of(text: str, table: Iterable[Entry]) -> tuple[str, str, str] | None:
    """(kind, category, noun) from the words of a name; None without a word of a kind."""
    tokens = product_names.words(text)
    stems = [found[0] for token in tokens if (found := _STEM.search(token))]
    spoken = f" {' '.join([*tokens, '.', *stems])} "
    for phrases, kind, category, noun in table:
        if any(f" {' '.join(product_names.words(phrase))} " in spoken for phrase in phrases):
            return kind, category, noun
    return None
