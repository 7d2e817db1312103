"""What agents write of a host in PROBE: wrong outputs of every kind, and right ones that look unusual.

Each is a change to the embedded agent's own output about a host of `case_hosts`. A wrong one names the code that
refuses it and a piece of the finding that names the right value.
"""

import copy
from collections.abc import Callable
from typing import Any

Probe = dict[str, Any]
Change = Callable[[Probe], None]

KESTREL, BATTERY, SOUND, DISK, WIFI = "usb-1d9c-0c14", "acpi-pnp0c0a", "pci-1d00-0a70", "pci-2ee1-0980", "pci-1d00-0a95"
PAD, CHIP, ROOT, KEYS = "i2c-reed0001", "platform-coretemp", "usb-1d6b-0002", "serio-i8042-kbd-port"
STEPPER, MOUSE, LINE, LINE_2, RECEIVER = (
    "usb-1d9c-5e12",
    "hid-1dee-4055",
    "usb-1a86-7523",
    "usb-1a86-7523-2",
    "usb-1dee-c52b",
)
CAMERA, ARM, RAIL = "usb-045e-0772", "usb-1a86-55d3", "usb-2341-804f"
HEAT, TWIN, MONITOR = "pci-1d02-1463", "pci-2ee1-0990-2", "platform-nct9999"


def found(probe: Probe, name: str) -> Probe:
    return next(each for each in probe["devices"] if each["id"] == name)


def put(name: str, /, **members: Any) -> Change:
    """Members of a device; None takes one away."""

    def change(probe: Probe) -> None:
        device = found(probe, name)
        for key, value in members.items():
            device.pop(key, None) if value is None else device.update({key: copy.deepcopy(value)})

    return change


def place(name: str, /, **members: Any) -> Change:
    """Members of a device's instance."""
    return lambda probe: found(probe, name).setdefault("instance", {}).update(members)


def line(name: str, *more: str) -> Change:
    """More lines in what is said of a device."""

    def change(probe: Probe) -> None:
        found(probe, name)["raw_descriptor"] += "".join(f"\n{each}" for each in more)

    return change


def spelt(name: str, old: str, new: str) -> Change:
    """Other words in what is said of a device."""

    def change(probe: Probe) -> None:
        device = found(probe, name)
        assert old in device["raw_descriptor"], old
        device["raw_descriptor"] = device["raw_descriptor"].replace(old, new)

    return change


def drop(*names: str) -> Change:
    return lambda probe: probe.update(devices=[each for each in probe["devices"] if each["id"] not in names])


def drop_lines(name: str, *starts: str) -> Change:
    def change(probe: Probe) -> None:
        device = found(probe, name)
        kept = [each for each in device["raw_descriptor"].splitlines() if not each.startswith(starts)]
        device["raw_descriptor"] = "\n".join(kept)

    return change


def add(name: str, called: str, interface: str, text: str = "state: here", /, **more: Any) -> Change:
    entry = {"id": name, "name": called, "interface": interface, "raw_descriptor": text, **more}
    return lambda probe: probe["devices"].append(copy.deepcopy(entry))


def again(name: str, under: str, /, **more: Any) -> Change:
    return lambda probe: probe["devices"].append({**copy.deepcopy(found(probe, name)), "id": under, **more})


def renamed(name: str, new: str, /, **more: Any) -> Change:
    return lambda probe: found(probe, name).update({"id": new, **more})


def scan(name: str, status: str = "ok", detail: str = "") -> Change:
    entry = {"name": name, "status": status, **({"detail": detail} if detail else {})}
    return lambda probe: probe["scan_methods"].append(dict(entry))


def scans(*entries: tuple[str, str] | str) -> Change:
    """These scans and no others."""
    pairs = [(each, "ok") if isinstance(each, str) else each for each in entries]
    return lambda probe: probe.update(scan_methods=[{"name": name, "status": status} for name, status in pairs])


def top(**members: Any) -> Change:
    def change(probe: Probe) -> None:
        for key, value in members.items():
            probe.pop(key, None) if value is None else probe.update({key: value})

    return change


def platform(**members: Any) -> Change:
    return lambda probe: probe["platform"].update(members)


def left(*pairs: tuple[str, str]) -> Change:
    """These devices are left out, for these reasons."""

    def change(probe: Probe) -> None:
        drop(*(name for name, _ in pairs))(probe)
        probe["left_out"] = [{"id": name, "reason": reason} for name, reason in pairs]

    return change


def every(*changes: Change) -> Change:
    def change(probe: Probe) -> None:
        for each in changes:
            each(probe)

    return change


def half_left(probe: Probe) -> None:
    """Every second device is left out, for a reason that could be one."""
    own = [each["id"] for each in probe["devices"] if each.get("context") is not True]
    left(*((name, "its owner will unplug it again today") for name in own[::2]))(probe)


def bare(probe: Probe) -> None:
    """Nothing is said of any device but what it hangs on."""
    for device in probe["devices"]:
        device["raw_descriptor"] = f"bus: {device['interface']}"
        device["name"] = "device"


def swapped(one: str, other: str) -> Change:
    """What is said of two devices, each under the id of the other."""

    def change(probe: Probe) -> None:
        first, second = found(probe, one), found(probe, other)
        first["id"], second["id"] = other, one

    return change


UNKNOWN, MISSING, CONTRADICTED = "PROBE-DEVICE-UNKNOWN", "PROBE-DEVICE-MISSING", "PROBE-CONTRADICTED"
TEXT, UNTOLD, LEFT, LOST = "PROBE-TEXT-NOT-OF-HOST", "PROBE-SCAN-UNTOLD", "PROBE-LEFT-OUT", "PROBE-TEXT-MISSING"
INSTANCE, TOOL, SCHEMA, NEIGHBOUR = (
    "PROBE-INSTANCE-IN-TEXT",
    "PROBE-SCAN-FALSE",
    "PROBE-SCHEMA",
    "PROBE-NEIGHBOUR-NOT-CONTEXT",
)
INSTALLED, NETWORK, TOUCHED, RIGHTS = "PROBE-INSTALLED", "PROBE-NETWORK-SCAN", "PROBE-DEVICE-OPENED", "PROBE-RIGHTS"
LONG = "a servo arm of six joints, as used for teaching; it is driven over the serial line at one megabaud"

WRONG: dict[str, tuple[str, Change, str, str]] = {
    # Devices that are not there, or that are missing.
    "an empty list": ("laptop", top(devices=[]), MISSING, KESTREL),
    "an invented arm": ("bench", add("usb-1a86-55d3", "Robot arm", "usb", vid="1a86", pid="55d3"), UNKNOWN, "take the"),
    "an invented camera": ("raspberry", add("usb-046d-085e", "BRIO", "usb", vid="046d", pid="085e"), UNKNOWN, "no dev"),
    "an invented part of the computer": ("server", add("tpm-tpm0", "TPM 2.0", "platform"), UNKNOWN, "no device"),
    "an invented neighbour": ("bench", add("usb-near", "arm", "usb", context=True, classes=["tty"]), NEIGHBOUR, "tty"),
    "a device of the host called a neighbour": (
        "bench",
        every(drop(MOUSE), add("hid-mouse", "Otter Wireless Mouse", "hid", context=True)),
        MISSING,
        MOUSE,
    ),
    "one device under two ids": ("laptop", again(KESTREL, f"{KESTREL}-2"), UNKNOWN, "one too many"),
    "one device twice": ("laptop", again(KESTREL, KESTREL), "PROBE-DUPLICATE-ID", "ordinal"),
    "a stream for a device": ("laptop", add("video4linux-video1", "video1", "video4linux"), UNKNOWN, "no device"),
    "a third twin": ("bench", again(LINE, f"{LINE}-3"), UNKNOWN, "one too many"),
    "a camera skipped": ("rig", drop(CAMERA), MISSING, "LifeCam"),
    "a hub skipped": ("laptop", drop(ROOT), MISSING, ROOT),
    "all that is dull skipped": ("laptop", drop(ROOT, "platform-i8042", "pci-1d00-0a2f"), MISSING, "3 devices"),
    "two twins in one entry": (
        "bench",
        every(drop(LINE_2), line(LINE, "count: 2")),
        MISSING,
        LINE_2,
    ),
    "two devices in one entry": (
        "bench",
        every(drop(MOUSE), line(RECEIVER, "input[0].name: Otter Wireless Mouse")),
        MISSING,
        MOUSE,
    ),
    "two devices in one entry with both classes": (
        "bench",
        put(RECEIVER, classes=["hid", "input"]),
        CONTRADICTED,
        "hid",
    ),
    "a filter for a reason": (
        "laptop",
        left((ROOT, "not interesting for an agent"), ("platform-i8042", "irrelevant for the user")),
        LEFT,
        "list it",
    ),
    "half of the host skipped": ("laptop", half_left, LEFT, "list them"),
    "listed and skipped": (
        "bench",
        top(left_out=[{"id": MOUSE, "reason": "a person carries it away"}]),
        LEFT,
        "one of the two",
    ),
    # Ids.
    "a port in an id": ("laptop", renamed(KESTREL, "usb-1-5"), UNKNOWN, f"'{KESTREL}'"),
    "a path of the kernel in an id": ("laptop", renamed(DISK, "pci-0000.01.00.0"), UNKNOWN, f"'{DISK}'"),
    "a class's word for an id": ("laptop", put("dmi-board", id="virtual-dmi", instance={}), UNKNOWN, "'dmi-board'"),
    "a serial number in an id": ("laptop", renamed(KESTREL, "usb-ko-200417"), "PROBE-SERIAL-IN-ID", "ordinal"),
    "a node in an id": ("bench", renamed(STEPPER, "tty-ttyacm0"), UNKNOWN, f"'{STEPPER}'"),
    "a product for an id": ("bench", renamed(STEPPER, "heron-stepper"), UNKNOWN, f"'{STEPPER}'"),
    "a driver's word for an id": ("laptop", renamed(PAD, "hid-hid-multitouch"), UNKNOWN, f"'{PAD}'"),
    "an ordinal from nought": ("bench", renamed(LINE_2, f"{LINE}-0"), UNKNOWN, f"'{LINE_2}'"),
    # Numbers, classes, drivers, bus.
    "another product's number": ("laptop", put(KESTREL, pid="0c15"), CONTRADICTED, "'0c14'"),
    "another maker's number": ("rig", put(ARM, vid="0403"), CONTRADICTED, "'1a86'"),
    "numbers of a device that has none": ("laptop", put(CHIP, vid="8086", pid="0001"), CONTRADICTED, "leave"),
    "a class too many": ("rig", put(ARM, classes=["tty", "video4linux"]), CONTRADICTED, "tty"),
    "a class of another device": ("bench", put(MOUSE, classes=["tty"]), CONTRADICTED, "input"),
    "no class": ("laptop", put(SOUND, classes=[]), CONTRADICTED, "sound"),
    "another driver": ("bench", put(LINE, drivers=["ftdi_sio"]), CONTRADICTED, "ch341"),
    "a driver from memory": ("laptop", put(PAD, drivers=["i2c_hid_acpi", "elan_i2c"]), CONTRADICTED, "hid-multitouch"),
    "another bus": ("laptop", put(KESTREL, interface="pci"), CONTRADICTED, "'usb'"),
    "a guess of the bus": ("laptop", put(BATTERY, interface="i2c smart battery"), CONTRADICTED, "'acpi'"),
    "a bus of another device": ("raspberry", put("i2c-envsense2", interface="spi"), CONTRADICTED, "'i2c'"),
    # Words that the system does not say.
    "an interpretation in a line": ("bench", line(STEPPER, "kind: stepper motor controller"), TEXT, "'motor'"),
    "an interpretation without a key": ("rig", line(ARM, LONG), TEXT, "'joints'"),
    "an interpretation for a key": ("rig", line(ARM, "robot arm: SO-ARM101"), TEXT, "'robot'"),
    "an interpretation in the name": ("rig", put(ARM, name="Feetech SO-ARM101 robot arm"), TEXT, "'robot'"),
    "an interpretation in the bus": ("laptop", put(KESTREL, interface="usb webcam"), TEXT, "'webcam'"),
    "an interpretation after a driver": (
        "bench",
        spelt(STEPPER, "driver=cdc_acm", "driver=cdc_acm (gantry)"),
        TEXT,
        "'gantry'",
    ),
    "an interpretation in another language": ("laptop", line(KESTREL, "Art: Überwachungskamera"), TEXT, "kamera"),
    "a name from memory": ("rig", put(CAMERA, name="Microsoft LifeCam Studio 1080p"), TEXT, "'1080p'"),
    "a model from memory": ("bench", line(MOUSE, "model: Otter M185"), TEXT, "'m185'"),
    "a maker from memory": ("bench", line(LINE, "manufacturer: QinHeng"), TEXT, "'qinheng'"),
    "words of another device": ("bench", line(LINE, "product: Otter Receiver"), TEXT, "'otter'"),
    "channels that are not there": ("raspberry", line("i2c-envsense2", "iio[0].in_illuminance: raw"), TEXT, "illumin"),
    "a file of formats from memory": ("laptop", line(KESTREL, "formats: MJPG 1280x720, YUYV 640x480"), TEXT, "mjpg"),
    "an advice": ("laptop", line(KESTREL, "hint: use this for the picture tool"), TEXT, "'picture'"),
    # Readings.
    "a temperature": ("laptop", line(CHIP, "hwmon[0].temp1_input: 47000"), TEXT, "'47000'"),
    "a temperature in degrees": ("server", line(HEAT, "hwmon[0].temp1: 47"), TEXT, "'47'"),
    "a charge in per cent": ("laptop", line(BATTERY, "power_supply[0].capacity: 81"), TEXT, "'81'"),
    "a state": ("laptop", line(BATTERY, "power_supply[0].status: Discharging"), TEXT, "'discharging'"),
    "a brightness": ("laptop", line("backlight-marsh-backlight", "brightness: 700"), TEXT, "'700'"),
    "a speed of a fan": ("server", line(MONITOR, "fan1 speed: 1180 rpm"), TEXT, "'1180'"),
    "a mains that is off": ("laptop", line("acpi-acpi0003", "online: 0"), TEXT, "'0'"),
    # What distinguishes one copy from another is in `instance` alone.
    "a node in a text": ("laptop", line(KESTREL, "node: /dev/video0"), INSTANCE, "instance"),
    "a path in a text": ("laptop", line(CHIP, "path: /sys/devices/platform/coretemp.0"), INSTANCE, "instance"),
    "a port in a text": ("bench", line(STEPPER, "port: 1-10"), INSTANCE, "instance"),
    "a place on PCI in a text": ("laptop", line(DISK, "slot: 0000:01:00.0"), INSTANCE, "instance"),
    "a piece of a serial number": ("laptop", line(KESTREL, "label: 200417"), TEXT, "'200417'"),
    "a serial number in another spelling": ("laptop", line(KESTREL, "token: KO200417"), TEXT, "'ko200417'"),
    "a node of another device": (
        "bench",
        place(STEPPER, nodes=[{"class": "tty", "name": "ttyUSB0", "node": "/dev/ttyUSB0"}]),
        CONTRADICTED,
        "/dev/ttyACM0",
    ),
    "a port of another device": ("bench", place(STEPPER, port="1-3"), CONTRADICTED, "'1-10'"),
    "a folder of another device": ("bench", swapped(LINE, LINE_2), CONTRADICTED, "instance.sysfs"),
    "a serial number from memory": ("rig", place(ARM, serial="ARM101-0002"), CONTRADICTED, "instance.serial"),
    # Nothing is said.
    "nothing but the bus": ("laptop", bare, LOST, "Kestrel"),
    "no strings of a device": (
        "rig",
        every(put(ARM, name="usb device"), drop_lines(ARM, "product", "manufacturer")),
        LOST,
        "SO-ARM101",
    ),
    # The scans.
    "no scan": ("laptop", top(scan_methods=[]), SCHEMA, "scan_methods"),
    "one scan for all": ("laptop", scans("everything"), UNTOLD, "'usb'"),
    "only scans that were denied": ("bench", scans(("lsusb", "denied")), "PROBE-NO-WORKING-SCAN", "ok"),
    "a bus that no scan saw": (
        "laptop",
        scans("sysfs: usb, acpi, i2c, platform, pnp, serio, backlight"),
        UNTOLD,
        "pci",
    ),
    "a program that is not there": ("laptop", scan("lsusb -v", "ok", "verbose list of usb"), TOOL, "not_found"),
    "a program on the wrong host": ("bench", scan("udevadm info --export-db"), TOOL, "recorded"),
    "a program that was installed": (
        "bench",
        scan("usbutils", "ok", "apt-get install usbutils first"),
        INSTALLED,
        "here",
    ),
    "a module that was loaded": ("raspberry", scan("i2c buses", "ok", "after modprobe i2c-dev"), INSTALLED, "here"),
    "a setting that was changed": (
        "laptop",
        scan("pci rescan", "ok", "echo 1 > /sys/bus/pci/rescan"),
        INSTALLED,
        "change",
    ),
    "rights that were asked for": ("server", scan("dmi table", "ok", "read with sudo dmidecode"), RIGHTS, "denied"),
    "a line that was opened": (
        "bench",
        scan("serial", "ok", "opened /dev/ttyUSB0 at 9600 baud"),
        "PROBE-TTY-OPENED",
        "line",
    ),
    "a picture that was taken": ("laptop", scan("camera", "ok", "captured a frame of /dev/video0"), TOUCHED, "open"),
    "a bus that was probed": ("raspberry", scan("i2cdetect -y 1", "ok"), TOUCHED, "open"),
    "a search of the network": ("laptop", scan("nmap -sn of the subnet", "ok"), NETWORK, "already"),
    "a search of the air": ("laptop", scan("bluetoothctl scan on", "ok", "10 s"), NETWORK, "already"),
    "a login": ("laptop", scan("neighbours", "ok", "ssh to the router, which lists its clients"), NETWORK, "already"),
    "a neighbour without context": ("laptop", put("network-neighbours", context=None), NEIGHBOUR, "context"),
    "a neighbour under another word": ("laptop", add("net-router", "router", "ethernet"), UNKNOWN, "context: true"),
    # The host.
    "no host name": ("laptop", top(hostname=None), SCHEMA, "hostname"),
    "no time": ("laptop", top(timestamp=None), SCHEMA, "timestamp"),
    "a time in words": ("laptop", top(timestamp="this morning"), "PROBE-TIMESTAMP", "UTC"),
    "a time without an offset": ("laptop", top(timestamp="2026-04-01T12:00:00"), "PROBE-TIMESTAMP", "offset"),
    "another system": ("laptop", platform(os="windows"), CONTRADICTED, "'linux'"),
    "another processor": ("laptop", platform(arch="riscv64"), CONTRADICTED, "'x86_64'"),
    "another release": ("laptop", platform(os_version="24.04"), CONTRADICTED, "'12'"),
    "another host": ("laptop", top(hostname="workstation-of-the-agent"), CONTRADICTED, "'heron'"),
}


def shouted(probe: Probe) -> None:
    """The keys and values of descriptors as other programs spell them."""
    device = found(probe, KESTREL)
    device["raw_descriptor"] = (
        "  idVendor           0x1D9C\n  idProduct          0x0C14\n  iManufacturer  1 Kestrel Optics\n"
        "  iProduct  2 Kestrel HD Camera\n  bDeviceClass  239\n  bcdDevice  1.02\nDRIVER=uvcvideo"
    )


def no_places(probe: Probe) -> None:
    for device in probe["devices"]:
        device.pop("instance", None)


def only_kinds(probe: Probe) -> None:
    for device in probe["devices"]:
        device.pop("instance", None)
        device.pop("drivers", None)
        device.pop("vid", None)
        device.pop("pid", None)


def shuffled(probe: Probe) -> None:
    probe["devices"].reverse()


def no_groups(probe: Probe) -> None:
    probe["devices"] = [each for each in probe["devices"] if not each["id"].startswith(("virtual", "acpi-name"))]


BUSES = "sysfs: usb, pci, acpi, i2c, platform, pnp, serio, hid, backlight, dmi, thermal"
RIGHT: dict[str, tuple[str, Change]] = {
    "as other programs spell it": ("laptop", shouted),
    "without places": ("laptop", no_places),
    "without places, drivers and numbers": ("bench", only_kinds),
    "in another order": ("laptop", shuffled),
    "without what the kernel makes of nothing": ("laptop", no_groups),
    "neighbours one by one": (
        "laptop",
        every(drop("network-neighbours"), add("neighbour-1", "neighbour", "network", "state: reachable", context=True)),
    ),
    "no neighbours": ("laptop", drop("network-neighbours")),
    "a radio in range": ("laptop", add("wifi-1", "access point", "wifi", "band: 5 GHz", context=True)),
    "one scan that lists its buses": ("laptop", scans(BUSES)),
    "one walk of the whole tree": ("laptop", scans("walk of /sys/bus/* and /sys/class/*, all folders")),
    "programs that are not there": ("laptop", every(scan("lsusb", "not_found"), scan("lspci", "unsupported"))),
    "programs that may not be run here": ("laptop", scan("dmidecode", "denied", "wants rights; no sudo was tried")),
    "a scan that denies": ("bench", scan("serial lines", "ok", "read from /sys/class/tty; no line was opened")),
    "i2c adapters listed": ("raspberry", scan("names of i2c adapters", "ok", "no bus was probed")),
    "another name of the processor": ("laptop", platform(arch="amd64")),
    "a release in full": ("laptop", platform(os_version="12 (bookworm)")),
    "a system with a capital": ("laptop", platform(os="Linux", os_id="Debian")),
    "a kernel in full": ("laptop", platform(kernel="Linux 6.6.0-example x86_64")),
    "a bus in capitals": ("laptop", put(KESTREL, interface="USB")),
    "a bus with its version": ("laptop", put(KESTREL, interface="usb 2.0")),
    "a device that is carried away": ("bench", left((STEPPER, "its owner unplugs it during the scan"))),
    "a device that went away": ("bench", left(("usb-046d-085e", "it was unplugged while the buses were read"))),
    "a device whose text is too long": ("laptop", left((PAD, "its descriptor has more than 4000 characters"))),
    "a serial number in a product string": ("bench", spelt(STEPPER, "<serial>", "HW-12-0042")),
    "a name without its maker": ("laptop", put(KESTREL, name="Kestrel HD Camera")),
    "a name of the kernel's": ("laptop", put(BATTERY, name="battery RC-57")),
    "lines in another order": (
        "rig",
        put(CAMERA, raw_descriptor="product: Microsoft® LifeCam Studio(TM)\ndriver: uvcvideo"),
    ),
    "an alias string": ("laptop", line(KESTREL, "modalias: usb:v1D9Cp0C14d0102dcEFdsc02dp01ic0Eisc01ip00in00")),
    "a limit of a channel": ("laptop", line(CHIP, "hwmon[0].temp1_max: 100000")),
    "names of readings": ("laptop", line(BATTERY, "readings: capacity, status, voltage_now")),
    "no driver": ("bench", line(STEPPER, "hid driver: none")),
    "a time with an offset": (
        "laptop",
        lambda probe: probe.update(timestamp=probe["timestamp"].replace("Z", "+00:00")),
    ),
    "a time with fractions": ("laptop", lambda probe: probe.update(timestamp=probe["timestamp"].replace("Z", ".125Z"))),
}

# Seen later than the rules were written.
WRONG |= {
    "later: gpu invented": (
        "bench",
        add("pci-10de-2684", "NVIDIA GPU", "pci", vid="10de", pid="2684", classes=["drm"]),
        UNKNOWN,
        "take the entry out",
    ),
    "later: bt speaker as device": (
        "laptop",
        add("bluetooth-speaker", "speaker", "bluetooth"),
        UNKNOWN,
        "take the entry out",
    ),
    "later: twin swapped numbers": ("server", put(TWIN, pid="0991"), CONTRADICTED, "write"),
    "later: drop both": ("server", drop(TWIN, HEAT), MISSING, "list each with wha"),
    "later: merge": (
        "raspberry",
        every(drop("platform-leds"), put("platform-gpio", classes=["gpio", "leds"])),
        CONTRADICTED,
        "write",
    ),
    "later: class guess": ("rig", put(RAIL, classes=["tty", "hidraw"]), CONTRADICTED, "write"),
    "later: driver guess": ("rig", put(RAIL, drivers=["cdc_acm", "ch341"]), CONTRADICTED, "write"),
    "later: name translated": ("laptop", put(KEYS, name="Tastatur"), TEXT, "copy what the syst"),
    "later: desc french": ("laptop", line(KESTREL, "type: caméra de surveillance"), TEXT, "copy what the syst"),
    "later: res": ("laptop", line(KESTREL, "max_resolution: 1920x1080"), TEXT, "copy what the syst"),
    "later: fps": ("laptop", line(KESTREL, "frame rate: 30 fps"), TEXT, "copy what the syst"),
    "later: usb speed": ("bench", line(STEPPER, "baud: 115200"), TEXT, "copy what the syst"),
    "later: voltage": ("rig", line(ARM, "supply: 7.4V battery pack"), TEXT, "copy what the syst"),
    "later: reading 2": ("laptop", line("thermal-x86-pkg-temp", "temp: 47"), TEXT, "copy what the syst"),
    "later: reading 3": ("laptop", line(BATTERY, "charge level: 81 %"), TEXT, "copy what the syst"),
    "later: reading 4": ("laptop", line(BATTERY, "voltage_now: 11800000"), TEXT, "copy what the syst"),
    "later: reading 5": ("server", line(MONITOR, "hwmon[0].fan1: 812 RPM"), TEXT, "copy what the syst"),
    "later: reading 6": ("raspberry", line("i2c-envsense2", "temperature = 21.5"), TEXT, "copy what the syst"),
    "later: serial tail": ("laptop", line(DISK, "nvme[0].firmware: 0001733"), TEXT, "copy what the syst"),
    "later: ip": ("laptop", line(WIFI, "inet 192.168.1.23"), TEXT, "copy what the syst"),
    "later: devpath": ("bench", line(MOUSE, "handlers: mouse0 event3"), INSTANCE, "it belongs in `inst"),
    "later: busnum": ("rig", line(ARM, "Bus 001 Device 004"), INSTANCE, "it belongs in `inst"),
    "later: node name": ("bench", line(LINE, "DEVNAME=ttyUSB0"), INSTANCE, "it belongs in `inst"),
    "later: sysfs": (
        "rig",
        line(CAMERA, "looking at device '/devices/pci0000:00/0000:00:14.0/usb1'"),
        TEXT,
        "copy what the syst",
    ),
    "later: scan root": ("server", scan("smartctl -a (as root)", "ok"), TOOL, "write not_found, o"),
    "later: scan apt": (
        "server",
        scan("sensors", "ok", "after installing lm-sensors with apt"),
        INSTALLED,
        "use what is here a",
    ),
    "later: scan write": ("laptop", scan("wifi", "ok", "nmcli device wifi rescan"), NETWORK, "take neighbours fr"),
    "later: scan net": ("laptop", scan("lan", "ok", "pinged 192.168.1.0/24"), NETWORK, "take neighbours fr"),
    "later: scan onvif": (
        "laptop",
        scan("onvif", "ok", "sent WS-Discovery probes to the network"),
        NETWORK,
        "take neighbours fr",
    ),
    "later: scan capture": (
        "rig",
        scan("ffmpeg", "ok", "grabbed one frame to see what the camera shows"),
        TOUCHED,
        "read what the kern",
    ),
    "later: scan servo": (
        "rig",
        scan("servo ping", "ok", "sent PING to ids 1-6 on the bus at 1 Mbaud"),
        TOUCHED,
        "read what the kern",
    ),
    "later: left reason dull": ("laptop", left((ROOT, "just a hub, no one needs it")), LEFT, "list it"),
    "later: left reason infra": ("laptop", left(("pci-1d00-0a2f", "it is only a bus controller")), LEFT, "list it"),
    "later: host name": ("laptop", top(hostname="localhost"), CONTRADICTED, "write"),
    "later: kernel": ("laptop", platform(kernel="5.15.0-generic"), CONTRADICTED, "write"),
    "later: time local": ("laptop", top(timestamp="26.11.2026 14:00"), "PROBE-TIMESTAMP", "write the time at"),
    "later: context on all": ("bench", put(LINE, context=True), CONTRADICTED, "write false; where"),
    "later: interface empty": ("bench", put(LINE, interface=""), CONTRADICTED, "write"),
    "later: product with guess": (
        "bench",
        spelt(LINE, "product: USB Serial", "product: USB Serial (CH340)"),
        TEXT,
        "copy what the syst",
    ),
    "later: raw empty": ("bench", put(MOUSE, raw_descriptor="", name="mouse"), LOST, "copy"),
}
RIGHT |= {
    "in other words: names only": (
        "bench",
        put(MOUSE, raw_descriptor="HID_NAME=Otter Wireless Mouse\nHID_ID=0003:00001DEE:00004055\nDRIVER=otter-hidpp"),
    ),
    "in other words: lsusb style": (
        "rig",
        put(
            ARM,
            raw_descriptor="\n".join(
                (
                    "idVendor 0x1a86",
                    "idProduct 0x55d3",
                    "iManufacturer 1 Feetech",
                    "iProduct 2 SO-ARM101 servo bus",
                    "bDeviceClass 2",
                    "Interface 0: class 2/2/1, driver cdc_acm",
                )
            ),
            name="Feetech SO-ARM101 servo bus",
        ),
    ),
    "in other words: udev": (
        "rig",
        put(
            CAMERA,
            raw_descriptor="\n".join(
                (
                    "ID_V4L_PRODUCT=Microsoft® LifeCam Studio(TM)",
                    "ID_V4L_CAPABILITIES=:capture:",
                    "driver: uvcvideo",
                )
            ),
        ),
    ),
    "in other words: modalias pci": (
        "laptop",
        put(
            DISK,
            raw_descriptor="\n".join(
                (
                    "modalias: pci:v00002EE1d00000980sv00002EE1sd00000001bc01sc08i02",
                    "model: Reed NV 512",
                    "driver: nvme",
                    "class: 0x010802",
                )
            ),
        ),
    ),
    "in other words: hwmon labels": (
        "laptop",
        put(CHIP, raw_descriptor="name: coretemp\ntemp1_label: Package id 0\ntemp2_label: Core 0\ntemp1_max: 100000"),
    ),
    "in other words: iio": (
        "raspberry",
        put(
            "i2c-envsense2",
            raw_descriptor="\n".join(
                (
                    "name: envsense2",
                    "channels: in_humidityrelative_raw, in_pressure_input, in_temp_input",
                    "driver: envsense",
                )
            ),
        ),
    ),
    "in other words: sound": (
        "laptop",
        put(
            SOUND,
            raw_descriptor="\n".join(
                (
                    "card: HDA-Intel - HDA Marsh PCH",
                    "pcm: MR245 Analog playback 1 capture 1",
                    "pcm: HDMI 0 playback",
                    "codec: Marsh MR245",
                    "driver: snd_hda_intel",
                )
            ),
            name="HDA Marsh PCH",
        ),
    ),
    "in other words: keyboard": (
        "laptop",
        put(KEYS, raw_descriptor="description: i8042 KBD port\nname: Plain Keyboard\ndriver: atkbd\nLED: capslock"),
    ),
    "in other words: net": (
        "laptop",
        put(WIFI, raw_descriptor="vendor: 0x1d00\ndevice: 0x0a95\nDEVTYPE=wlan\ndriver=marshwifi"),
    ),
    "in other words: virtual": ("laptop", put("virtual-block", raw_descriptor="loop devices: 8", name="virtual block")),
    "in other words: led": (
        "raspberry",
        put("platform-leds", raw_descriptor="compatible: gpio-leds\nled: ACT\nmax_brightness: 255"),
    ),
    "in other words: disk": (
        "server",
        put(
            "scsi-ata-granary-hd8000",
            raw_descriptor="vendor: ATA\nmodel: Granary HD8000\ntype: 0 (disk)\nrotational: 1",
        ),
    ),
    "in other words: scan by class": (
        "laptop",
        scans(
            "ls /sys/bus/usb/devices",
            "ls /sys/bus/pci/devices",
            "/sys/bus/i2c, /sys/bus/platform, /sys/bus/serio, /sys/bus/pnp, /sys/bus/acpi",
            "/sys/class/backlight",
            "/sys/class/thermal and /sys/class/dmi",
            "/proc/net/arp",
        ),
    ),
    "in other words: python": ("bench", scans("python walk of /sys/devices")),
    "in other words: dev listing": ("laptop", scan("ls -l /dev", "ok", "names only, nothing opened")),
    "in other words: dmesg denied": ("laptop", scan("dmesg", "denied", "wants CAP_SYSLOG")),
    "in other words: timeout": ("laptop", scan("avahi-browse", "timeout", "no answer in 10 s")),
}
