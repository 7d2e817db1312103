"""Clues in names: a raw pipe offered as a tool, a chip offered as a product, one thing named twice.

These are judgements over words, with no product in them. They are deliberately blunt: a capability that is refused
here for its name can be renamed to say what it does, and then it is a better name.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from octoform.contracts.device_kinds import KINDS
from octoform.contracts.name_words import without_escapes
from octoform.patterns import regex

_SEND = frozenset(
    {"send", "write", "transmit", "exec", "execute", "run", "transfer", "xfer", "forward", "inject", "issue", "tx"}
    | {"put", "post", "emit", "submit", "deliver", "dispatch", "push"}
)
_PAYLOAD = frozenset(
    {"serial", "uart", "tty", "byte", "bytes", "raw", "command", "commands", "cmd", "cmds", "register", "registers"}
    | {"packet", "packets", "frame", "frames", "data", "payload", "buffer", "hex", "i2c", "spi", "usb", "gpib"}
    | {"scpi", "gcode", "shell", "script", "ioctl", "urb", "hid", "report", "memory", "eeprom", "datagram"}
    | {"opcode", "block", "blocks", "sector", "sectors", "port", "socket", "instruction", "instructions", "telegram"}
    | {"telegrams", "pdu", "message", "messages", "statement", "query", "request"}
)
_RUN = frozenset({"exec", "execute", "run", "eval"})
# A defined message is no pipe: `send_magic_packet` wakes a computer, `send_usb_packet` sends what it is given.
_MESSAGE = frozenset(
    {"packet", "packets", "frame", "frames", "datagram", "report", "block", "message", "messages", "telegram"}
)
_ANY = frozenset(
    {"raw", "usb", "hid", "serial", "uart", "tty", "i2c", "spi", "can", "lin", "modbus", "network", "ethernet", "udp"}
    | {"tcp", "ip", "radio", "lora", "ble", "zigbee", "custom", "arbitrary", "any", "generic", "vendor", "feature"}
    | {"output", "input", "device", "to", "from", "a", "an", "the", "and", "data", "bus", "sensor", "port"}
)
_VAGUE = frozenset(
    {"query", "request", "exchange", "communicate", "communication", "talk", "interact", "transact", "transaction"}
    | {"message", "invoke", "register", "registers", "access", "roundtrip", "io", "rw", "conversation", "speak", "rpc"}
    | {"call", "protocol", "command", "commands", "cmd", "dialogue", "converse", "chat", "rx", "tx", "scpi", "xu"}
)
_NOBODY = frozenset(
    {"device", "the", "a", "to", "with", "and", "serial", "usb", "i2c", "spi", "hid", "line", "port", "modbus", "can"}
    | {"lin", "canopen", "rs485", "rs232", "uart", "uvc", "ble", "tcp", "udp", "http", "at", "bus", "raw", "servo"}
)
_CONTENT = frozenset(
    {"data", "bytes", "byte", "payload", "raw", "hex", "buffer", "command", "commands", "telegram", "value"}
)
_READ = frozenset({"read", "receive", "recv", "rx", "get", "query", "dump", "peek"})
_RAW_SOURCE = frozenset({"bytes", "register", "registers", "uart", "tty", "serial", "eeprom"})
_ALWAYS = frozenset({"passthrough", "transceive", "transceiver", "shell", "exec", "eval", "ioctl", "bash", "poke"})
# Words that together name a way to speak to a device, whatever the messages are.
_PAIRS = (
    (
        frozenset({"open", "attach", "access", "use", "start", "connect", "enter"}),
        frozenset({"console", "terminal", "repl"}),
    ),
    (frozenset({"dump", "peek", "poke"}), frozenset({"memory", "flash", "rom", "eeprom", "ram"})),
    (frozenset({"feature", "hid", "output"}), frozenset({"report", "reports"})),
    (
        frozenset({"vendor", "control", "bulk", "interrupt"}),
        frozenset({"request", "transfer", "requests", "transfers"}),
    ),
)
# `read_serial_number` and `list_serial_ports` ask about a line, they do not talk over it.
_ABOUT = frozenset(
    {"number", "numbers", "ports", "list", "info", "count", "status", "rate", "usage", "settings"}
    | {"presence", "availability"}
)

_PIPE = regex(
    r"\b(?:raw|arbitrary|verbatim|any|custom|free-form|user-supplied|caller-supplied)\s+(?:\w+\s+){0,2}?"
    r"(?:bytes?|commands?|command string|packets?|messages?|requests?|quer(?:y|ies)|payloads?|strings?|scpi|g-?code"
    r"|registers?|frames? to|data to|instructions?|opcodes?|at commands?)\b"
    r"|\b(?:sends?|writes?|forwards?|pass(?:es)?|transmits?|issues?)\s+(?:the\s+)?(?:given|supplied|passed|specified)\b"
    r"|\breads?(?:\s+(?:and|or)\s+writes?)?\s+any\s+register"
    r"|\bwhat(?:ever)?\s+(?:the|a|its)\s+(?:caller|user|client|agent)\s+(?:gives?|sends?|passes|supplies|wants?|writes?)"
    r"|\b(?:given|supplied|passed|caller's|user's)\s+"
    r"(?:bytes?|commands?|strings?|payload|hex|frames?|request|message|line|text|words?|input|data)\b"
    r"|\bany\s+(?:\w+\s+){0,2}(?:address|attribute|file|path|control|parameter|setting|endpoint|topic|variable)\b"
    r"|\bas\s+(?:is|it\s+stands)\s+to\s+the\s+(?:device|line|bus|port)\b",
    re.IGNORECASE,
)
_ANYTHING = regex(
    r"\b(?:hex(?:adecimal)?|bytes?|string|str|text|free|anything|any|characters?|verbatim"
    r"|(?:list|array|sequence) of (?:\w+ )?(?:integers?|ints?|numbers?|words?))\b",
    re.IGNORECASE,
)
_PLACES = frozenset({"path", "file", "filename", "attribute", "url", "topic", "node"})
_CHOICE = regex(r"\bone of\b|\||\benum|\beither\b|\bpattern\b", re.IGNORECASE)
# As the verb of a name these say that something is other afterwards.
_CHANGING = frozenset(
    {"set", "move", "turn", "switch", "toggle", "enable", "disable", "lock", "unlock", "rotate", "drive", "actuate"}
    | {"blink", "fire", "launch", "feed", "dispense", "rumble", "vibrate", "adjust", "increase", "decrease", "raise"}
    | {"lower", "write", "program", "burn", "update", "upgrade", "install", "uninstall", "kill", "eject", "mount"}
    | {"unmount", "format", "reset", "reboot", "restart", "shutdown", "poweroff", "clear", "remove", "flash", "zero"}
    | {"play", "print", "press", "release", "activate", "deactivate", "home", "calibrate", "jog", "send", "wake"}
)
# These may be nouns as well: `zoom_level` is one, `zoom_in` is not.
_STIRRING = frozenset(
    {"start", "stop", "begin", "zoom", "pan", "tilt", "spin", "open", "close", "grip", "boot", "trigger", "apply", "go"}
    | {"follow", "engage", "disengage", "store", "save", "heat", "cool", "spray", "beep", "dim", "step"}
)
_MEASURES = frozenset(
    {
        "level",
        "levels",
        "count",
        "state",
        "states",
        "status",
        "angle",
        "position",
        "distance",
        "value",
        "values",
        "range",
    }
    | {
        "score",
        "rate",
        "limit",
        "limits",
        "time",
        "mode",
        "info",
        "factor",
        "ratio",
        "size",
        "files",
        "events",
        "ports",
    }
)
_READING = frozenset(
    {"read", "get", "list", "describe", "measure", "capture", "record", "take", "grab", "snap", "shoot", "acquire"}
    | {
        "monitor",
        "watch",
        "observe",
        "poll",
        "check",
        "count",
        "detect",
        "inspect",
        "sample",
        "sense",
        "fetch",
        "query",
    }
    | {"scan", "show", "report", "identify", "estimate", "listen", "receive", "wait", "await", "view", "stream", "log"}
    | {"enumerate", "locate", "decode", "weigh", "track", "retrieve", "lookup", "photograph", "film", "find", "search"}
    | {"request", "collect", "compute", "calculate", "summarize", "export", "download", "verify", "test", "diagnose"}
    | {"recognize", "look", "see", "hear", "tell", "compare", "dump", "subscribe", "is", "has", "screenshot", "probe"}
)
_READINGS = frozenset(
    {
        "temperature",
        "temperatures",
        "speed",
        "speeds",
        "voltage",
        "current",
        "humidity",
        "pressure",
        "inventory",
        "list",
    }
    | {"image", "picture", "photo", "reading", "readings", "statistics", "usage", "health", "version", "capacity"}
    | {"measurement", "measurements", "samples", "data", "report", "summary", "description", "formats", "resolutions"}
)
_MANNERS = frozenset({"quick", "fast", "full", "safe", "secure", "factory", "auto", "force", "soft", "low", "deep"})
# The first verb of a description orders something where one of these words stands behind it.
_STARTING = frozenset(
    {"move", "turn", "switch", "toggle", "disable", "rotate", "drive", "reset", "restart", "reboot", "lock", "unlock"}
    | {"press", "activate", "deactivate", "calibrate", "home", "play", "beep", "blink", "flash", "eject"}
)
_BEHIND = frozenset(
    {"the", "a", "an", "it", "its", "them", "all", "each", "every", "one", "this", "that", "both", "your", "on", "off"}
    | {"up", "down", "left", "right", "forward", "back", "to", "into", "until", "and", "then"}
)
_FOR_GOOD = (("factory", "reset"), ("format", "disk"), ("format", "drive"), ("flash", "firmware"), ("burn", "fuse"))
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

_CODES = frozenset({"opcode", "instruction", "instructions", "function_code", "fcode"})
_ADDRESSES = frozenset({"register", "reg", "address", "addr", "offset", "opcode"})
_AMOUNTS = frozenset({"value", "values", "data", "length", "size", "count", "bytes", "width"})
_SPOKEN = frozenset({"message", "msg", "telegram", "pdu", "body", "content", "contents", "line", "words"})

_READ_AS = {**dict.fromkeys(("list", "show", "report", "check", "retrieve", "obtain"), "read"), "event": "events"}
_IDLE = frozenset({"for", "the", "of", "a", "all", "user", "device"})
_EVENTS_WORDS = """
    touch touches key keys keystroke keystrokes keypress keypresses press presses button buttons stroke strokes gesture
    gestures pen stylus mouse pointer motion movement movements keyboard touchscreen touchpad clicks scroll
"""
_EVENTS = frozenset(_EVENTS_WORDS.split())
"""Kinds of the events that an input gives."""

_VERBS = {
    "capture": ("capture", "take", "grab", "snap", "shoot", "acquire", "record"),
    "read": ("read", "get", "query", "fetch", "measure", "sense"),
    "set": ("set", "change", "adjust"),
}
_NOUNS = {
    "image": ("image", "images", "photo", "photos", "picture", "pictures", "frame", "snapshot", "still", "photograph"),
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
    2d 3d ac accelerometer access acpi actuator adapter adaptor adc ahci ambient amplifier analog analogue analyser
    analyzer antenna aquarium arm array audio axis backlight bank barcode barometer battery bench biometric
    biosensor bluetooth boards bridge broadband builtin bus button buttons cable cam camera cams capacitor capture
    card cdc cec cell cells channel channels charger chassis chip chipset clock co2 codec coil color colour compass
    composite computer console control controller controllers converter conveyor cooler cooling core cores counter
    cpu csi current dac dc ddr debug debugger definition depth desk desktop detector dial digital digitizer dimm
    disc disk display dock docking dongle door dpi drive driver drone dsi dual dust dvb electric embedded emmc
    emulated encoder engraver environment environmental ethernet external eye fan fans fhd fi finder fingerprint
    firmware flash flow fm force fps frequency front function game gamepad gantry gas gateway gb generator ghz
    gimbal gnss gpio gps gpu grabber graphics gripper gyroscope hard hardware hd hda hdd hdmi head header headers
    headphone headphones headset heater hid high home host hub humidity hygrometer identification image imager imu
    inertial infra infrared input instrument instruments integrated interface internal ion ir joystick kb kbd
    keyboard keypad kit knob kvm label lamp lan laptop laser lcd led leds lens level lid light line lines lithium
    load lock logger logic lte machine magnetic mah mainboard mains management manipulator mb measurement measuring
    media memory meter mhz microphone microscope midi mipi mixer mmc mobile mode modem module monitor mono
    motherboard motion motor motors mouse mtp multi multifunction multimeter navigation network nfc node numeric
    numpad nvme oled onboard optical oscilloscope output pack package pad panel paper passive pci pcie pedal pen
    phone photo pin pins platform plotter pointing polymer port portable ports position positioning power presence
    pressure printer probe processor production programmer projector proximity ps2 ptp pump pwm quality rack radio
    rail range reader real rear receiver recorder relay relays remote removable rf rfid ring robot robotic room root
    router rover rpm rtc sas sata satellite scales scanner screen scsi sd sdr security sensor sensors serial server
    servo servos signal single slider slot slots smart soc socket software solid sound soundcard speaker speakers
    spectrum ssd state stepper stereo stick still storage stripe stream streams studio stylus supply surface switch
    switches synthesizer system tablet tape tb telemetry telephone telescope temperature temperatures terminal test
    thermal thermometer thermostat time timer token touch touchpad touchscreen trackball trackpad trackpoint
    transceiver transfer transmitter trusted tuner turntable tv uac uhd uninterruptible unit update ups usb uv uvc
    valve via video virtual voltage voltages wall wan watchdog water watt watts weather webcam webcams weighing wh
    wheel wi wifi window wired wireless wlan xhci zone
"""
_CLASS = frozenset(_CLASS_WORDS.split())
_PART_NUMBER = regex(r"[a-z]{0,5}\d{2,6}[a-z0-9]{0,6}")
_MAKER_LINE = regex(r"^[^:\n]*(?:manufacturer|vendor|maker)[^:\n]*:(.*)$", re.IGNORECASE | re.MULTILINE)
_APPOSITION = regex(r"\s(?:with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)
_HUMP = regex(r"(?<=[a-z0-9])(?=[A-Z])")
_NO_WORD = regex(r"[^0-9a-z]+")


def tokens(name: str) -> list[str]:
    """The lower-case words of a snake_case, kebab-case, dotted or camelCase name."""
    spread = _HUMP.sub("_", name)
    return [word for word in _NO_WORD.split(spread.casefold()) if word]


def is_passthrough(name: str) -> bool:
    """True for a name that offers a raw pipe: ``send_serial_command``, ``raw_bytes_write``, ``exec``, ``exchange``."""
    spoken = set(tokens(name))
    if spoken & {"random", "entropy"} and spoken & _READ and not spoken & _SEND:
        return False  # what comes out is what the device makes, and nothing goes in
    if (
        spoken & _ALWAYS
        or {"pass", "through"} <= spoken
        or (spoken & _VAGUE and spoken <= _VAGUE | _NOBODY | _SEND | _READ | _CONTENT)
        or any(spoken & first and spoken & second for first, second in _PAIRS)
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


def raw_facts(parameters: Mapping[str, Any], effect: str = "actuate") -> str | None:
    """The parameter that IDENTIFY describes as free bytes or text for the device, or None.

    A reading takes no message either; what acts may show one.
    """
    for name, kind in parameters.items():
        spoken = set(tokens(str(name)))
        raw = name.casefold() in RAW_PARAMETERS or bool(spoken & (_PLACES | (_SPOKEN if effect == "read" else set())))
        if (raw and _takes_anything(kind)) or (spoken & _CODES and effect == "read" and not _is_choice(kind)):
            return str(name)
        if spoken & _ADDRESSES and parameters.keys() & _AMOUNTS:
            return str(name)
    return None


def _is_choice(kind: object) -> bool:
    return isinstance(kind, list) or (isinstance(kind, str) and bool(_CHOICE.search(kind)))


def _takes_anything(kind: object) -> bool:
    if isinstance(kind, Mapping):
        return kind.get("type") in ("string", "array") and not {"enum", "const", "pattern"} & kind.keys()
    return isinstance(kind, str) and bool(_ANYTHING.search(kind)) and not _CHOICE.search(kind)


def is_reading(name: str) -> bool:
    """Whether the verb of a name reads, or its last word is what is read: ``battery_status``."""
    spoken = tokens(name)
    return spoken[0] in _READING or (len(spoken) > 1 and spoken[-1] in _MEASURES | _READINGS)


def changes(name: str, description: str) -> str | None:
    """The word that states that a call changes or destroys something, or None."""
    spoken = tokens(name)
    begins = [at for at in range(len(spoken)) if at == 0 or spoken[at - 1] in ("and", "then")]
    begins += [1] if spoken[0] in _MANNERS and len(spoken) > 1 else []
    found = [spoken[at] for at in begins if spoken[at] in _CHANGING or spoken[at] in _DESTROYING]
    found += [spoken[at] for at in begins if spoken[at] in _STIRRING and not _MEASURES.intersection(spoken[at + 1 :])]
    found += [word for word in tokens(description)[:1] if word in _DESTROYING]
    return found[0] if found else _ordered(description)


def destroys(name: str) -> str | None:
    """The word of a name that means that something is gone for good afterwards, or None."""
    spoken = tokens(name)
    found = [word for word in spoken if word in _DESTROYING]
    found += [" ".join(pair) for pair in _FOR_GOOD if set(pair) <= set(spoken)]
    return found[0] if found else None


def _ordered(description: str) -> str | None:
    """The verb with which a description orders something: ``Switch the light on``, ``Moves until it ends``."""
    spoken = [*re.findall(r"[a-z']+", description.casefold())[:2], "", ""]
    verb = next((each for each in (spoken[0], spoken[0][:-1], spoken[0][:-2]) if each in _STARTING), None)
    orders = verb is not None and (verb != spoken[0] or spoken[1] in _BEHIND)
    return spoken[0] if orders else None


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


def same_act(one: str, other: str) -> bool:
    """Whether two names are of one act: synonyms of each other, or the events of an input and one kind of them."""
    if same_action(one) == same_action(other):
        return True
    first, second = ({_READ_AS.get(word, word) for word in same_action(name)} - _IDLE for name in (one, other))
    if "read" not in first & second:
        return False
    pairs = ((first, second), (second, first))
    some = any(a - {"input"} == {"read", "events"} and b - {"input", "read", "events"} <= _EVENTS for a, b in pairs)
    return some or first == second


def is_chip_name(name: str, raw_descriptor: str) -> bool:
    """True when a product name states only which bridge sits in front of the product.

    ``USB-serial adapter``, or a part number and a maker around such a phrase. Words of the maker's line in
    ``raw_descriptor`` do not count as naming a product.
    """
    name = without_escapes(name).strip()
    words = _words(_APPOSITION.split(name, maxsplit=1)[0] or name)
    if not set(words) & _BRIDGE:
        return False
    makers = {word for line in _MAKER_LINE.findall(raw_descriptor) for word in _words(line)}
    left = [word for word in words if not _is_empty(word, makers)]
    names_an_adapter = bool(words) and words[-1] in _HEADS
    return not left or (names_an_adapter and len(left) <= 1)


def is_filler(word: str) -> bool:
    """True for a word that could be in any device's name: a filler, a bridge's word, one letter."""
    return word in _BRIDGE or word in _HEADS or word in _FILLER or len(word) < 2


def is_class_word(word: str) -> bool:
    """True for a word that states what kind of thing a device is, in one or in many; no one's name, and no model."""
    return word in _CLASS or word.removesuffix("s") in _CLASS


def kind_of(word: str) -> str | None:
    """The word for a kind of thing that a word is, its plural folded; None for any other."""
    return next((each for each in (word, word.removesuffix("s")) if each in KINDS), None)


def _is_empty(word: str, makers: Iterable[str]) -> bool:
    return is_filler(word) or word in makers or word.isdigit() or _PART_NUMBER.fullmatch(word) is not None


def _words(text: str) -> list[str]:
    joined = re.sub(r"(?i)\brs[- ]?(232|422|485)\b", r"rs\1", text)
    return [word for word in re.split(r"[^0-9a-z]+", joined.casefold()) if word]
