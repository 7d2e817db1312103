"""Facts of the kind of a device by its kernel class: which attributes, under which keys.

One small function for each class whose folder needs understanding, a table of attribute names for the rest. Readings
(a temperature, a charge, a brightness) are never taken: they are no facts about a kind and differ at every run.
"""

import re
from collections.abc import Callable, Mapping

from octoform.builtin.probe import capabilities
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.unit_model import Node
from octoform.patterns import regex

ATTRIBUTES: Mapping[str, tuple[str, ...]] = {
    "backlight": ("type", "max_brightness"),
    "dmi": (
        "sys_vendor",
        "product_name",
        "product_version",
        "product_family",
        "board_vendor",
        "board_name",
        "board_version",
        "chassis_vendor",
        "chassis_type",
    ),
    "extcon": ("name",),
    "gnss": ("type",),
    "gpio": ("label", "ngpio"),
    "graphics": ("name",),
    "infiniband": ("hca_type", "node_desc"),
    "media": ("model",),
    "mtd": ("name", "type"),
    "powercap": ("name",),
    "printer": ("ieee1284_id",),
    "ptp": ("clock_name", "max_adjustment", "n_external_timestamps", "n_periodic_outputs"),
    "pwm": ("npwm",),
    "rc": ("protocols",),
    "regulator": ("name", "type", "min_microvolts", "max_microvolts"),
    "remoteproc": ("name",),
    "rfkill": ("type",),
    "scsi_host": ("proc_name",),
    "soc": ("machine", "family", "soc_id"),
    "thermal": ("type", "max_state"),
    "tpm": ("tpm_version_major",),
    "typec": ("port_type", "usb_power_delivery_revision"),
    "video4linux": ("name", "index"),
    "virtio-ports": ("name",),
    "watchdog": ("identity",),
}
_SENSOR = regex(r"^((?:temp|fan|in|curr|power|energy|humidity|freq|intrusion|pwm)\d+)(?:_(\w+))?$")
_SENSOR_PARTS = ("input", "average", "min", "max", "lcrit", "crit", "alarm", "enable", "mode", "target")
_CHANNEL = regex(r"^((?:in|out)_[a-z]+\d*(?:[-_][\w-]+)?)_(raw|input|processed)$")
_SUPPLY_LINES = ("type", "technology", "manufacturer", "model_name", "scope")
_SUPPLY_NO_READING = {"name", "serial_number", "uevent", "devtype", *_SUPPLY_LINES}
_NETWORK_KINDS = {"1": "ethernet", "32": "infiniband", "280": "can", "512": "ppp", "772": "loopback", "801": "wireless"}
_LED_OWNER = regex(r"(?<![a-z])(input|phy|mmc|usb|hid|card)\d+(?=\W|$)")
_LED_HID = regex(r"^[0-9A-F]{4}:[0-9A-F]{4}:[0-9A-F]{4}\.[0-9A-F]+:")
# The keys of a printer's id that give its kind; the id has serial numbers too.
_PRINTER_KEYS = frozenset(("MFG", "MANUFACTURER", "MDL", "MODEL", "CMD", "COMMAND SET", "CLS", "CLASS", "DES"))
_AT_ADDRESS = regex(r"\d+-[0-9a-f]{2,4}$")
_TTY_NUMBER = regex(r"\d+$")
_MAX_CHANNELS = 120
_EDID_BYTES = 512
_UNIQUE = 4


def describe(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    """Add what the class of ``node`` reports of its kind, and the instance facts that are beside it."""
    special = SPECIAL.get(node.subsystem)
    if special is not None:
        special(node, reader, uevent)
        return
    for attribute in ATTRIBUTES.get(node.subsystem, ()):
        node.add(attribute, reader.text(f"{node.path}/{attribute}"))
    facts = dict(node.lines)
    node.kind = facts.get("name") or facts.get("label") or facts.get("model") or facts.get("identity", "")


def _hwmon(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    node.kind = reader.text(f"{node.path}/name")
    node.add("name", node.kind)
    channels: dict[str, list[str]] = {}
    for file in reader.names_or_none(node.path):
        found = _SENSOR.match(file)
        if found:
            channels.setdefault(found[1], []).append(found[2] or "value")
    for channel in sorted(channels, key=capabilities.channel_order)[:_MAX_CHANNELS]:
        parts = [part for part in (*_SENSOR_PARTS, "value") if part in channels[channel]]
        label = reader.text(f"{node.path}/{channel}_label") if "label" in channels[channel] else ""
        node.add(channel, ",".join(parts) + (f" label={label}" if label else ""))


def _iio(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    node.kind = reader.text(f"{node.path}/name")
    node.add("name", node.kind)
    node.add("label", reader.text(f"{node.path}/label"))
    files = set(reader.names_or_none(node.path))
    channels: dict[str, list[str]] = {}
    for file in files:
        found = _CHANNEL.match(file)
        if found:
            channels.setdefault(found[1], []).append(found[2])
    for channel in sorted(channels, key=capabilities.channel_order)[:_MAX_CHANNELS]:
        more = [part for part in ("scale", "offset") if _has(files, channel, part)]
        node.add(channel, ",".join(sorted(channels[channel]) + more))
    for folder in ("scan_elements", "buffer0"):
        if folder in files:
            elements = reader.names_or_none(f"{node.path}/{folder}")
            buffered = {name.removesuffix("_index") for name in elements if name.endswith("_index")}
            node.add("buffered", ",".join(sorted(buffered, key=capabilities.channel_order)))
            break


def _has(files: set[str], channel: str, part: str) -> bool:
    """Whether a channel has its own ``part`` or shares that of its type (``in_voltage_scale``)."""
    return f"{channel}_{part}" in files or f"{re.split(r'[0-9]', channel, maxsplit=1)[0]}_{part}" in files


def _power_supply(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    files = reader.names_or_none(node.path)
    for attribute in _SUPPLY_LINES:
        text = uevent.get(f"POWER_SUPPLY_{attribute.upper()}", "")
        node.add(attribute, text or (reader.text(f"{node.path}/{attribute}") if attribute in files else ""))
    prefix = "POWER_SUPPLY_"
    readings = {key.removeprefix(prefix).lower() for key in uevent if key.startswith(prefix)}
    readings |= {file for file in files if file.startswith(("capacity", "charge", "current", "cycle", "energy"))}
    readings |= {file for file in files if file.startswith(("health", "online", "power_", "present", "status"))}
    readings |= {file for file in files if file.startswith(("temp", "time_to", "voltage"))}
    node.add("readings", ",".join(sorted(readings - _SUPPLY_NO_READING - {"power"})))
    node.serial = uevent.get("POWER_SUPPLY_SERIAL_NUMBER", "")
    # Not its name: that of a wireless device's battery carries the device's address.
    facts = dict(node.lines)
    node.kind = facts.get("model_name") or facts.get("type", "")


def _input(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    if not node.name.startswith("input"):
        return
    name = uevent.get("NAME", "").strip('"') or reader.text(f"{node.path}/name")
    node.kind = name
    node.add("name", name)
    bits = {kind: _bits(node, reader, uevent, kind) for kind in ("ev", "key", "rel", "abs", "sw", "prop")}
    node.add("events", capabilities.event_kinds(bits["ev"]))
    node.add("kinds", capabilities.input_kinds(bits))
    node.serial = uevent.get("UNIQ", "").strip('"')


def _bits(node: Node, reader: Reader, uevent: dict[str, str], kind: str) -> int:
    text = uevent.get(kind.upper(), "")
    if not text and not uevent.get("EV"):
        text = reader.text(f"{node.path}/{'properties' if kind == 'prop' else 'capabilities/' + kind}")
    return capabilities.bitmap(text)


def _block(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    if uevent.get("DEVTYPE") == "partition":
        return
    device = f"{node.path}/device"
    parent = reader.link(device)
    base = _joined(node.path, parent) if parent else device
    for attribute, path in (
        ("vendor", f"{base}/vendor"),
        ("model", f"{base}/model"),
        ("removable", f"{node.path}/removable"),
        ("read_only", f"{node.path}/ro"),
        ("rotational", f"{node.path}/queue/rotational"),
    ):
        text = reader.text(path)
        if not (attribute == "vendor" and text.startswith("0x")):
            node.add(attribute, text)
    sectors = reader.text(f"{node.path}/size")
    node.size = int(sectors) * 512 if sectors.isdecimal() else None


def _joined(path: str, link: str) -> str:
    """The folder that a relative link inside ``path`` points to."""
    parts = path.split("/")
    for step in link.split("/"):
        if step == "..":
            parts = parts[:-1]
        elif step not in ("", "."):
            parts.append(step)
    return "/".join(parts)


def _drm(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    card, dash, connector = node.name.partition("-")
    if not dash or not card.startswith("card"):
        return
    node.add("connector", connector)
    node.add("status", reader.text(f"{node.path}/status"))
    edid = reader.data(f"{node.path}/edid", _EDID_BYTES)
    if edid:
        vendor, product = capabilities.edid_names(edid)
        node.add("monitor_vendor", vendor)
        node.add("monitor", product)


def _sound(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    if node.name.startswith("card"):
        node.kind = reader.text(f"{node.path}/id")
        node.add("id", node.kind)


def _net(node: Node, reader: Reader, uevent: dict[str, str]) -> None:
    files = reader.names_or_none(node.path)
    number = reader.text(f"{node.path}/type") if "type" in files else ""
    kind = uevent.get("DEVTYPE") or ("wlan" if "phy80211" in files or "wireless" in files else "")
    node.add("kind", kind or _NETWORK_KINDS.get(number, f"arphrd {number}" if number else ""))
    address = reader.text(f"{node.path}/address") if "address" in files else ""
    node.address = address if len(set(address)) >= _UNIQUE or address.count("0") < len(address) // 2 else ""


def _bluetooth(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    node.address = reader.text(f"{node.path}/address")


def _gpio(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    for attribute in ATTRIBUTES["gpio"]:
        node.add(attribute, reader.text(f"{node.path}/{attribute}"))
    # What a board's maker called the lines (device tree, gpio.yaml: strings, each ended by a zero byte).
    names = (reader.data(f"{node.path}/of_node/gpio-line-names") or b"").split(b"\0")
    node.add("line_names", ",".join(name.decode("utf-8", "surrogateescape") for name in names if name))
    node.kind = dict(node.lines).get("label") or "gpiochip"


def _leds(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    node.kind = _LED_OWNER.sub(r"\1", _LED_HID.sub("", node.name))
    node.add("name", node.kind)
    node.add("max_brightness", reader.text(f"{node.path}/max_brightness"))


def _tty(node: Node, _reader: Reader, _uevent: dict[str, str]) -> None:
    node.add("name", _TTY_NUMBER.sub("", node.name))


def _usbmisc(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    # A printer's IEEE 1284 device id is an attribute of the USB interface (ABI/testing/sysfs-driver-usb-usblp).
    message = reader.text(f"{node.path}/../../ieee1284_id")
    pairs = [pair.partition(":") for pair in message.split(";") if ":" in pair]
    kept = [f"{key.strip()}:{text.strip()}" for key, _, text in pairs if key.strip().upper() in _PRINTER_KEYS]
    node.add("ieee1284_id", ";".join(kept))


def _dmi(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    for attribute in ATTRIBUTES["dmi"]:
        node.add(attribute, reader.text(f"{node.path}/{attribute}"))
    facts = dict(node.lines)
    node.title = " ".join(text for text in (facts.get("sys_vendor"), facts.get("product_name")) if text)
    node.kind = "board"


def _thermal(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    node.kind = reader.text(f"{node.path}/type")
    node.add("role", "cooling" if node.name.startswith("cooling") else "zone")
    node.add("type", node.kind)
    node.add("max_state", reader.text(f"{node.path}/max_state") if node.name.startswith("cooling") else "")


def _nvme(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    for attribute in ("model", "transport"):
        node.add(attribute, reader.text(f"{node.path}/{attribute}"))
    node.serial = reader.text(f"{node.path}/serial")


def _rtc(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    # The driver's name; what follows it gives where the clock is attached.
    node.kind = reader.text(f"{node.path}/name").partition(" ")[0]
    node.add("name", node.kind)


def _backlight(node: Node, reader: Reader, _uevent: dict[str, str]) -> None:
    # A panel on a bus for chips is called by its address there, which is a place and no name.
    node.kind = "" if _AT_ADDRESS.match(node.name) else node.name
    node.add("name", node.kind)
    for attribute in ATTRIBUTES["backlight"]:
        node.add(attribute, reader.text(f"{node.path}/{attribute}"))


SPECIAL: Mapping[str, Callable[[Node, Reader, dict[str, str]], None]] = {
    "backlight": _backlight,
    "block": _block,
    "bluetooth": _bluetooth,
    "dmi": _dmi,
    "drm": _drm,
    "gpio": _gpio,
    "hwmon": _hwmon,
    "iio": _iio,
    "input": _input,
    "leds": _leds,
    "net": _net,
    "nvme": _nvme,
    "power_supply": _power_supply,
    "rtc": _rtc,
    "sound": _sound,
    "thermal": _thermal,
    "tty": _tty,
    "usbmisc": _usbmisc,
}
