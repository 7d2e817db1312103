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
_READ = frozenset({"read", "receive", "recv", "rx", "get", "query", "dump", "peek"})
_RAW_SOURCE = frozenset({"bytes", "register", "registers", "uart", "tty", "serial", "eeprom"})
_ALWAYS = frozenset({"passthrough", "transceive", "transceiver", "shell", "exec", "eval", "ioctl", "bash", "poke"})
# `read_serial_number` and `list_serial_ports` ask about a line, they do not talk over it.
_ABOUT = frozenset({"number", "numbers", "ports", "list", "info", "count", "status", "rate", "usage", "settings"})

RAW_PARAMETERS = frozenset(
    {"command", "commands", "cmd", "raw", "bytes", "payload", "hex", "data", "gcode", "scpi", "shell", "script"}
    | {"code", "packet", "frame", "opcode", "buffer", "raw_bytes", "hex_string", "message_bytes"}
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
_PART_NUMBER = re.compile(r"[a-z]{0,5}\d{2,6}[a-z0-9]{0,6}")
_MAKER_LINE = re.compile(r"^[^:\n]*(?:manufacturer|vendor|maker)[^:\n]*:(.*)$", re.IGNORECASE | re.MULTILINE)
_APPOSITION = re.compile(r"\s(?:with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)


def tokens(name: str) -> list[str]:
    """The lower-case words of a snake_case, kebab-case, dotted or camelCase name."""
    spread = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return [word for word in re.split(r"[^0-9a-z]+", spread.casefold()) if word]


def is_passthrough(name: str) -> bool:
    """True for a name that offers a raw pipe: ``send_serial_command``, ``raw_bytes_write``, ``exec``."""
    words = set(tokens(name))
    if words & _ALWAYS or {"pass", "through"} <= words:
        return True
    if words & _ABOUT:
        return False
    if words & _SEND and words & _PAYLOAD:
        return True
    return bool((words & _READ and words & _RAW_SOURCE) or (words & _RUN and "code" in words))


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


def _says_nothing(word: str, makers: Iterable[str]) -> bool:
    return says_nothing(word) or word in makers or word.isdigit() or _PART_NUMBER.fullmatch(word) is not None


def _words(text: str) -> list[str]:
    joined = re.sub(r"(?i)\brs[- ]?(232|422|485)\b", r"rs\1", text)
    return [word for word in re.split(r"[^0-9a-z]+", joined.casefold()) if word]
