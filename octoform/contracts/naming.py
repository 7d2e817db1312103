"""What a name gives away: a raw pipe offered as a tool, a chip offered as a product, one thing named twice.

These are judgements over words, with no product in them. They are deliberately blunt: a capability that is refused
here for its name can be renamed to say what it does, and then it is a better name.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any

_SEND = frozenset(
    {"send", "write", "transmit", "exec", "execute", "run", "transfer", "xfer", "forward", "inject", "issue", "tx"}
    | {"put", "post", "emit", "submit"}
)
_PAYLOAD = frozenset(
    {"serial", "uart", "tty", "byte", "bytes", "raw", "command", "commands", "cmd", "cmds", "register", "registers"}
    | {"packet", "packets", "frame", "frames", "data", "payload", "buffer", "hex", "i2c", "spi", "usb", "gpib"}
    | {"scpi", "gcode", "shell", "script", "ioctl", "urb", "hid", "report", "memory", "eeprom", "datagram"}
    | {"opcode", "block", "blocks", "sector", "sectors", "port", "socket"}
)
_RUN = frozenset({"exec", "execute", "run", "eval"})
# A defined message is no pipe: `send_magic_packet` wakes a computer, `send_usb_packet` sends what it is given.
_MESSAGE = frozenset({"packet", "packets", "frame", "frames", "datagram", "report", "block"})
_ANY = frozenset(
    {"raw", "usb", "hid", "serial", "uart", "tty", "i2c", "spi", "can", "lin", "modbus", "network", "ethernet", "udp"}
    | {"tcp", "ip", "radio", "lora", "ble", "zigbee", "custom", "arbitrary", "any", "generic", "vendor", "feature"}
    | {"output", "input", "device", "to", "from", "a", "an", "the", "and", "data", "bus", "sensor", "port"}
)
_VAGUE = frozenset(
    {"query", "request", "exchange", "communicate", "communication", "talk", "interact", "transact", "transaction"}
    | {"message", "invoke", "register", "registers", "access", "roundtrip", "io", "rw", "conversation"}
)
_NOBODY = frozenset({"device", "the", "a", "to", "with", "and", "serial", "usb", "i2c", "spi", "hid", "line", "port"})
_READ = frozenset({"read", "receive", "recv", "rx", "get", "query", "dump", "peek"})
_RAW_SOURCE = frozenset({"bytes", "register", "registers", "uart", "tty", "serial", "eeprom"})
_ALWAYS = frozenset({"passthrough", "transceive", "transceiver", "shell", "exec", "eval", "ioctl", "bash", "poke"})
# `read_serial_number` and `list_serial_ports` ask about a line, they do not talk over it.
_ABOUT = frozenset({"number", "numbers", "ports", "list", "info", "count", "status", "rate", "usage", "settings"})

_PIPE = re.compile(
    r"\b(?:raw|arbitrary|verbatim|any|custom|free-form|user-supplied|caller-supplied)\s+(?:\w+\s+){0,2}?"
    r"(?:bytes?|commands?|command string|packets?|messages?|requests?|quer(?:y|ies)|payloads?|strings?|scpi|g-?code"
    r"|registers?|frames? to|data to|instructions?|opcodes?|at commands?)\b"
    r"|\b(?:sends?|writes?|forwards?|pass(?:es)?|transmits?|issues?)\s+(?:the\s+)?(?:given|supplied|passed|specified)\b"
    r"|\breads?(?:\s+(?:and|or)\s+writes?)?\s+any\s+register",
    re.IGNORECASE,
)
_FREE = frozenset({"string", "str", "bytes", "text", "free text", "hex", "hex string", "any", "list of bytes"})
# As the verb of a name these say that something is other afterwards.
_CHANGING = frozenset(
    {"set", "move", "turn", "switch", "toggle", "enable", "disable", "lock", "unlock", "rotate", "drive", "actuate"}
    | {"blink", "fire", "launch", "feed", "dispense", "rumble", "vibrate", "adjust", "increase", "decrease", "raise"}
    | {"lower", "write", "program", "burn", "update", "upgrade", "install", "uninstall", "kill", "eject", "mount"}
    | {"unmount", "format", "reset", "reboot", "restart", "shutdown", "poweroff", "clear", "remove", "flash", "zero"}
    | {"play", "print", "press", "release", "activate", "deactivate", "home", "calibrate", "jog", "send", "wake"}
)
# These do so as the verb of a description, too.
_DESTROYING = frozenset(
    {"erase", "erases", "delete", "deletes", "wipe", "wipes", "purge", "overwrite", "overwrites", "destroy", "shred"}
    | {"sanitize", "discard", "truncate", "reformat"}
)

RAW_PARAMETERS = frozenset(
    {"command", "commands", "cmd", "raw", "bytes", "payload", "hex", "data", "gcode", "scpi", "shell", "script"}
    | {"code", "packet", "frame", "opcode", "buffer", "raw_bytes", "hex_string", "message_bytes"}
    | {"query", "request", "register", "statement", "expression", "instruction", "instructions", "at_command"}
)

_VERBS = {
    "capture": ("capture", "take", "grab", "snap", "shoot", "acquire", "record"),
    "read": ("read", "get", "query", "fetch", "measure", "sense"),
    "set": ("set", "change", "adjust"),
}
_NOUNS = {
    "image": ("image", "photo", "picture", "frame", "snapshot", "still", "photograph"),
    "audio": ("audio", "sound", "microphone", "mic"),
    "temperature": ("temperature", "temp", "temperatures"),
    "video": ("video", "clip", "movie"),
}
_SYNONYMS = {word: name for table in (_VERBS, _NOUNS) for name, words in table.items() for word in words}

_BRIDGE = frozenset(
    {"serial", "uart", "usart", "rs232", "rs422", "rs485", "ttl", "bridge", "i2c", "smbus", "spi", "jtag", "vcp"}
)
_HEADS = frozenset({"adapter", "adaptor", "converter", "bridge", "cable", "dongle", "chip"})
_FILLER = frozenset(
    {"usb", "usb2", "usb3", "to", "the", "a", "an", "of", "and", "for", "port", "ports", "device", "interface"}
    | {"generic", "unknown", "unidentified", "controller", "virtual", "com", "cdc", "acm", "hid", "composite"}
    | {"tty", "single", "dual", "quad", "full", "high", "speed", "chipset", "ic", "board", "module", "based"}
    | {"inc", "ltd", "co", "corp", "corporation", "limited", "gmbh", "international", "electronics", "technology"}
    | {"technologies", "semiconductor", "semiconductors", "labs", "laboratories", "devices", "company", "vendor"}
)
_CLASS_WORDS = """
    ac accelerometer access acpi actuator adapter adaptor adc ahci amplifier analog analogue antenna array audio
    backlight bank barcode battery biometric bluetooth bridge bus button buttons cable camera capacitor capture card
    cdc cec charger chip chipset clock codec coil color colour compass composite computer console control controller
    converter cooler cooling counter current dac dc definition depth desktop detector digital digitizer disc disk
    display dock docking drive driver dual dvb electric embedded emmc emulated encoder ethernet external eye fan
    fans fi fingerprint flash flow fm force frequency front game gamepad gateway generator gnss gpio gps graphics
    gyroscope hard hda hdd hdmi head headphone headphones headset hid high host hub humidity identification image
    imu inertial infrared input integrated interface internal ir joystick keyboard keypad label laptop laser lcd led
    leds lid light line load lock logger logic lte machine magnetic mains management measurement media memory meter
    microphone midi mixer modem module monitor motherboard motion mouse mtp multi multifunction network nfc node
    numeric numpad nvme oled optical oscilloscope output package pad panel paper passive pci pcie pen phone photo
    platform pointing port portable position power presence pressure printer probe processor projector proximity ptp
    pump pwm radio reader real rear receiver recorder relay remote removable rf rfid ring room root router rtc sata
    scanner screen scsi sd sdr security sensor sensors serial server signal single smart solid sound speaker
    speakers ssd state stick still storage stylus supply surface switch system tablet tape telephone temperature
    terminal thermal thermometer thermostat time timer token touch touchpad touchscreen trackball trackpad
    transceiver transmitter tuner tv uac uninterruptible unit ups usb uvc video virtual voltage watchdog water
    weather webcam wi wifi wired wireless wlan xhci zone
"""
_CLASS = frozenset(_CLASS_WORDS.split())
_PART_NUMBER = re.compile(r"[a-z]{0,5}\d{2,6}[a-z0-9]{0,6}")
_MAKER_LINE = re.compile(r"^[^:\n]*(?:manufacturer|vendor|maker)[^:\n]*:(.*)$", re.IGNORECASE | re.MULTILINE)
_APPOSITION = re.compile(r"\s(?:with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)


def tokens(name: str) -> list[str]:
    """The lower-case words of a snake_case, kebab-case, dotted or camelCase name."""
    spread = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return [word for word in re.split(r"[^0-9a-z]+", spread.casefold()) if word]


def is_passthrough(name: str) -> bool:
    """True for a name that offers a raw pipe: ``send_serial_command``, ``raw_bytes_write``, ``exec``, ``exchange``."""
    spoken = set(tokens(name))
    if (
        spoken & _ALWAYS
        or {"pass", "through"} <= spoken
        or (spoken & _VAGUE and spoken <= _VAGUE | _NOBODY | _SEND | _READ)
    ):
        return True
    if spoken & _ABOUT:
        return False
    if spoken & _SEND and spoken & _PAYLOAD:
        return not _is_a_message(spoken)
    return bool((spoken & _READ and spoken & _RAW_SOURCE) or (spoken & _RUN and "code" in spoken))


def _is_a_message(spoken: set[str]) -> bool:
    """True where what is sent is one message with a name of its own."""
    return spoken & _PAYLOAD <= _MESSAGE and bool(spoken - _SEND - _PAYLOAD - _ANY)


def offers_a_pipe(description: str) -> bool:
    """True for words that offer to carry whatever the caller gives: any command, arbitrary bytes, the given string."""
    return _PIPE.search(description) is not None


def raw_facts(parameters: Mapping[str, Any]) -> str | None:
    """The parameter that IDENTIFY describes as free bytes or text for the device, or None."""
    for name, kind in parameters.items():
        if name.casefold() in RAW_PARAMETERS and isinstance(kind, str) and kind.strip().casefold() in _FREE:
            return str(name)
    return None


def changes(name: str, description: str) -> str | None:
    """The word that says that a call changes or destroys something, or None."""
    spoken = tokens(name)
    begins = [spoken[at] for at in range(len(spoken)) if at == 0 or spoken[at - 1] in ("and", "then")]
    found = [word for word in begins if word in _CHANGING or word in _DESTROYING]
    found += [word for word in tokens(description)[:1] if word in _DESTROYING]
    return found[0] if found else None


def raw_parameter(schema: Mapping[str, Any]) -> str | None:
    """The property of an input schema that takes an unbounded command or bytes, or None."""
    properties = schema.get("properties")
    for name, member in properties.items() if isinstance(properties, dict) else ():
        if name.casefold() not in RAW_PARAMETERS or not isinstance(member, dict):
            continue
        if member.get("type") in ("string", "array") and not {"enum", "const", "pattern"} & member.keys():
            return str(name)
    return None


def same_action(name: str) -> frozenset[str]:
    """The words of a name with synonyms made one: equal for ``take_photo`` and ``capture_image``."""
    return frozenset(_SYNONYMS.get(word, word) for word in tokens(name))


def is_chip_name(name: str, raw_descriptor: str) -> bool:
    """True when a product name says only which bridge sits in front of the product.

    ``USB-serial adapter``, or a part number and a maker around such a phrase. Words of the maker's line in
    ``raw_descriptor`` do not count as naming a product.
    """
    words = _words(_APPOSITION.split(name.strip(), maxsplit=1)[0] or name)
    if not set(words) & _BRIDGE:
        return False
    makers = {word for line in _MAKER_LINE.findall(raw_descriptor) for word in _words(line)}
    left = [word for word in words if not _says_nothing(word, makers)]
    names_an_adapter = bool(words) and words[-1] in _HEADS
    return not left or (names_an_adapter and len(left) <= 1)


def says_nothing(word: str) -> bool:
    """True for a word that could stand in any device's name: a filler, a bridge's word, one letter."""
    return word in _BRIDGE or word in _HEADS or word in _FILLER or len(word) < 2


def is_class_word(word: str) -> bool:
    """True for a word that says what kind of thing a device is, in one or in many; nobody's name, and no model."""
    return word in _CLASS or word.removesuffix("s") in _CLASS


def _says_nothing(word: str, makers: Iterable[str]) -> bool:
    return says_nothing(word) or word in makers or word.isdigit() or _PART_NUMBER.fullmatch(word) is not None


def _words(text: str) -> list[str]:
    joined = re.sub(r"(?i)\brs[- ]?(232|422|485)\b", r"rs\1", text)
    return [word for word in re.split(r"[^0-9a-z]+", joined.casefold()) if word]
