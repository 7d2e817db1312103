"""/sys/kernel/debug/usb/devices and the script usb-devices: lines ``T:`` ``D:`` ``P:`` ``S:`` ``C:`` ``I:``."""

import re
from collections.abc import Iterator

from recordings.sysroot.tree import Tree, hex2
from recordings.sysroot.usb import UsbDevice, UsbInterface, put

_TOPOLOGY = re.compile(
    r"T:\s+Bus=\s*(\d+) Lev=\s*(\d+) Prnt=\s*(\d+) Port=\s*(\d+) Cnt=\s*(\d+) Dev#=\s*(\d+) Spd=\s*([\d.]+)"
)
_IDS = re.compile(r"^P:\s+Vendor=([0-9a-f]{4}) ProdID=([0-9a-f]{4}) Rev=\s*([0-9a-f]+\.[0-9a-f]+)", re.M)
_DEVICE = re.compile(
    r"^D:\s+Ver=\s*([\d.]+) Cls=([0-9a-f]{2}).*? Sub=([0-9a-f]{2}) Prot=([0-9a-f]{2}) MxPS=\s*(\d+) #Cfgs=\s*(\d+)",
    re.M,
)
_CONFIGURATION = re.compile(r"^C:[* ].*Cfg#=\s*(\d+) Atr=([0-9a-f]{2}) MxPwr=\s*(\d+mA)", re.M)
_INTERFACE = re.compile(
    r"^I:[* ]?\s*If#=\s*(\d+|0x[0-9a-f]+) Alt=\s*(\d+) #EPs=\s*(\d+) Cls=([0-9a-f]{2}).*?"
    r" Sub=([0-9a-f]{2}) Prot=([0-9a-f]{2}) Driver=(.*)$",
    re.M,
)
_STRINGS = {"manufacturer": "Manufacturer", "product": "Product", "serial": "SerialNumber"}


def load(tree: Tree, text: str) -> int:
    """Write all devices of the text, also as quoted in a mail; how many it has."""
    tree.write("sys/kernel/debug/usb/devices", text)
    plain = re.sub(r"^[>| \t]*(?=[TDPSCIEB]:)", "", text, flags=re.M)
    names: dict[tuple[int, int], str] = {}
    count = 0
    for chunk in re.split(r"^(?=T:)", plain, flags=re.M):
        ids = _IDS.search(chunk)
        if ids:
            count += 1
            device = UsbDevice(ids[1], ids[2], "1", str(count + 1), f"1-{count}")
            device.attributes["bcdDevice"] = ids[3].replace(".", "").zfill(4)
            _name(device, chunk, names)
            _describe(device, chunk)
            device.interfaces = list(_interfaces(chunk))
            put(tree, device)
    return count


def _name(device: UsbDevice, chunk: str, names: dict[tuple[int, int], str]) -> None:
    """The kernel's name from level, parent and port; the parents stand before their children."""
    topology = _TOPOLOGY.match(chunk)
    if topology:
        bus, level, parent, port, _, number = map(int, topology.groups()[:6])
        device.bus, device.number, device.attributes["speed"] = str(bus), str(number), topology[7]
        holder = names.get((bus, parent), "")
        if level == 0:
            device.name = f"usb{bus}"
        elif level == 1 or not holder or holder.startswith("usb"):
            device.name = f"{bus}-{port + 1}"
        else:
            device.name = f"{holder}.{port + 1}"
    names[int(device.bus), int(device.number or 0)] = device.name


def _describe(device: UsbDevice, chunk: str) -> None:
    values = device.attributes
    if found := _DEVICE.search(chunk):
        values["version"] = found[1].rjust(5)
        values["bDeviceClass"], values["bDeviceSubClass"], values["bDeviceProtocol"] = found[2], found[3], found[4]
        values["bMaxPacketSize0"], values["bNumConfigurations"] = found[5], found[6]
    for name, word in _STRINGS.items():
        if found := re.search(rf"^S:\s+{word}=(.*)$", chunk, re.M):
            values[name] = found[1].strip()
    if found := _CONFIGURATION.search(chunk):
        values["bConfigurationValue"], values["bmAttributes"], values["bMaxPower"] = found.groups()


def _interfaces(chunk: str) -> Iterator[UsbInterface]:
    seen = set()
    for found in _INTERFACE.finditer(chunk):
        # A hexadecimal number has its prefix; a decimal one may have a leading zero.
        number = int(found[1], 16) if found[1].startswith("0x") else int(found[1])
        if number not in seen:
            seen.add(number)
            driver = found[7].strip()
            known = driver if driver not in ("", "(none)") else None
            yield UsbInterface(f"{number:02x}", (found[4], found[5], found[6]), hex2(found[3]), driver=known)
