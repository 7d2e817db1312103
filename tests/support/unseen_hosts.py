"""Twelve hosts of kinds that no recording shows, as trees of sysfs: the strings of each device are made up here.

Each host is a function that plants its devices; what is true of them is beside the test that asks.
"""

from collections.abc import Callable, Mapping

from sysfs_tree import Tree

USB = "pci0000:00/0000:00:14.0/usb1"
KEYS = "1000000000007 ff9f207ac14057ff febeffdfffefffff fffffffffffffffe"
Part = tuple[str, str, Mapping[str, str]]
Interface = tuple[str, str, list[Part]]
"""A device of a class: the class, its folder below the interface, its attributes."""
_NODES = ("tty", "video4linux", "hidraw", "usbmisc")


class Host(Tree):
    """A tree into which devices are plugged, one port after the other."""

    _ports = 0

    def _at(self, vid: str, pid: str, maker: str, product: str, code: str = "00") -> str:
        self._ports += 1
        at = f"{USB}/1-{self._ports}"
        folder = self.usb(at, vid, pid)
        strings = {"manufacturer": maker, "product": product, "bDeviceClass": code}
        strings |= {"bDeviceSubClass": "00", "bDeviceProtocol": "00"}
        for name, text in strings.items():
            if text:
                (folder / name).write_text(f"{text}\n")
        return at

    def _interface(self, at: str, number: int, code: str, driver: str) -> str:
        names = ("bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")
        place = f"{at}/1-{self._ports}:1.{number}"
        facts = {"bInterfaceNumber": f"{number:02}", **dict(zip(names, code.split("/"), strict=True))}
        self.bus(place, "usb", facts, **({"DRIVER": driver} if driver else {}))
        return place

    def plug(self, ids: str, maker: str, product: str, *interfaces: Interface, code: str = "00") -> None:
        """A USB device; of each interface its class code, its driver, and what the kernel made of it."""
        vid, pid = ids.split(":")
        at = self._at(vid, pid, maker, product, code)
        for number, (kind, driver, parts) in enumerate(interfaces):
            place = self._interface(at, number, kind, driver)
            for name, folder, facts in parts:
                node = {"DEVNAME": folder.rpartition("/")[2]} if name in _NODES else {}
                self.member(f"{place}/{folder}", name, facts, **node)

    def hid(self, ids: str, maker: str, product: str, code: str = "00/00", *, keys: bool = False) -> None:
        """A USB device of the HID class: raw reports, or a keyboard."""
        vid, pid = (part.upper() for part in ids.split(":"))
        place = self._interface(self._at(vid.lower(), pid.lower(), maker, product), 0, f"03/{code}", "usbhid")
        number, name = self._ports, f"{maker} {product}".strip()
        unit = f"{place}/0003:{vid}:{pid}.000{number:X}"
        self.bus(unit, "hid", HID_ID=f"0003:0000{vid}:0000{pid}", HID_NAME=name, DRIVER="hid-generic")
        if not keys:
            self.member(f"{unit}/hidraw/hidraw{number}", "hidraw", DEVNAME=f"hidraw{number}")
            return
        folder = f"{unit}/input/input{number}"
        self.member(folder, "input", {"name": name, "capabilities/ev": "120013", "capabilities/key": KEYS})
        self.member(f"{folder}/event{number}", "input", DEVNAME=f"input/event{number}")

    def pci(self, slot: str, ids: str, code: str, driver: str, *parts: Part) -> str:
        """A function of PCI."""
        vid, pid = ids.split(":")
        at = f"pci0000:00/0000:{slot}"
        self.bus(at, "pci", {"vendor": f"0x{vid}", "device": f"0x{pid}", "class": f"0x{code}"}, DRIVER=driver)
        for name, folder, facts in parts:
            self.member(f"{at}/{folder}", name, facts)
        return at

    def serial(self, ids: str, maker: str, product: str, driver: str = "cdc_acm", node: str = "ttyACM0") -> None:
        """A USB device behind which is one serial line."""
        code, folder = ("02/02/01", "tty") if driver == "cdc_acm" else ("ff/ff/ff", f"{node}/tty")
        self.plug(ids, maker, product, (code, driver, [("tty", f"{folder}/{node}", {})]))

    def net(self, ids: str, maker: str, product: str, driver: str, node: str, kind: str = "1") -> None:
        """A USB device that is a network interface."""
        self.plug(ids, maker, product, ("ff/ff/ff", driver, [("net", f"net/{node}", {"type": kind})]))


def network_storage(host: Host) -> None:
    at = host.pci("00:17.0", "8086:a282", "010601", "ahci")
    for number, model in enumerate(("WDC WD80EFZX-68U", "ST8000VN0022-2EL")):
        unit = f"{at}/ata{number + 1}/host{number}/target{number}:0:0/{number}:0:0:0"
        host.bus(unit, "scsi", {"vendor": "ATA", "model": model, "type": "0"}, DRIVER="sd")
        node = f"sd{'ab'[number]}"
        host.member(f"{unit}/block/{node}", "block", {"removable": "0", "queue/rotational": "1"}, DEVNAME=node)
        host.member(f"{unit}/hwmon/hwmon{number}", "hwmon", {"name": "drivetemp", "temp1_input": "31000"})
    host.bus("platform/leds", "platform", DRIVER="leds-gpio")
    host.member("platform/leds/leds/disk1:red:fault", "leds", {"max_brightness": "1", "brightness": "0"})
    host.hid("051d:0002", "American Power Conversion", "Back-UPS ES 700G FW:871.O3 .I USB FW:O3")
    host.net("0bda:8156", "Realtek", "USB 10/100/1G/2.5G LAN", "r8152", "eth1")


def thin_client(host: Host) -> None:
    host.plug("076b:3021", "HID Global", "OMNIKEY 3x21 Smart Card Reader", ("0b/00/00", "", []))
    card: list[Part] = [("sound", "sound/card1", {"id": "C320M"})]
    card += [("sound", f"sound/card1/pcmC1D0{way}", {}) for way in "pc"]
    host.plug("047f:c025", "Plantronics", "Plantronics C320-M", ("01/01/00", "snd-usb-audio", card))
    host.hid("413c:2113", "Dell", "KB216 Wired Keyboard", "01/01", keys=True)


def router(host: Host) -> None:
    lines: list[Interface] = [("ff/00/00", "option", [("tty", f"ttyUSB{at}/tty/ttyUSB{at}", {})]) for at in range(2)]
    data: list[Part] = [("usbmisc", "usbmisc/cdc-wdm0", {}), ("net", "net/wwan0", {"type": "1"})]
    host.plug("2c7c:0125", "Quectel", "EC25-EU", *lines, ("ff/ff/ff", "qmi_wwan", data))
    host.bus("platform/keys", "platform", DRIVER="gpio-keys")
    host.member("platform/keys/input/input0", "input", {"name": "keys", "capabilities/key": "100000000"})
    host.member("platform/keys/input/input0/event0", "input", DEVNAME="input/event0")


def laboratory(host: Host) -> None:
    tmc: list[Part] = [("usbmisc", "usbmisc/usbtmc0", {})]
    host.plug("1ab1:0588", "Rigol Technologies.", "DS1000 SERIES", ("fe/03/00", "usbtmc", tmc))
    host.plug("3923:709b", "National Instruments", "GPIB-USB-HS", ("ff/00/00", "", []))
    host.serial("103e:0109", "TTi", "QL355TP Power Supply")
    host.serial("0403:6001", "FTDI", "FT232R USB UART", "ftdi_sio", "ttyUSB0")


def machining(host: Host) -> None:
    host.serial("1a86:7523", "", "USB Serial", "ch341", "ttyUSB0")
    host.serial("0483:5740", "grbl", "grblHAL CNC controller")
    host.plug("10ce:eb70", "KTURT.LTD", "NORTEK wireless pendant XHC-HB04", ("03/00/00", "usbhid", []))


def printing(host: Host) -> None:
    host.serial("2c99:0002", "Prusa Research (prusa3d.com)", "Original Prusa i3 MK3")
    host.serial("1d50:614e", "Klipper", "stm32f446xx", node="ttyACM1")
    video: list[Part] = [("video4linux", "video4linux/video0", {"name": "HD USB Camera", "index": "0"})]
    host.plug("32e4:9230", "HD USB Camera", "HD USB Camera", ("0e/01/00", "uvcvideo", video))


def radio(host: Host) -> None:
    host.plug("1d50:6089", "Great Scott Gadgets", "HackRF One", ("ff/ff/ff", "", []))
    host.plug("04b4:8613", "", "", ("ff/ff/ff", "", []))
    television: list[Part] = [("dvb", "dvb/dvb0.frontend0", {}), ("dvb", "dvb/dvb0.demux0", {})]
    host.plug("0bda:2838", "Realtek", "RTL2838UHIDIR", ("ff/ff/ff", "dvb_usb_rtl28xxu", television))
    host.plug("21a9:1006", "Saleae LLC", "Logic Pro 16", ("ff/00/00", "", []))


def graphics_dock(host: Host) -> None:
    place = "pci0000:00/0000:00:1d.0/0000:05:00.0/domain0/0-0/0-1"
    host.bus(place, "thunderbolt", {"vendor_name": "Razer", "device_name": "Core X", "authorized": "1"})
    heat = {"name": "nouveau", "temp1_input": "41000", "fan1_input": "900"}
    screen: Part = ("drm", "drm/card1/card1-HDMI-A-2", {"status": "connected"})
    host.pci(
        "07:00.0", "10de:1b81", "030000", "nouveau", ("drm", "drm/card1", {}), screen, ("hwmon", "hwmon/hwmon4", heat)
    )
    sound: Part = ("sound", "sound/card2", {"id": "NVidia"})
    host.pci("07:00.1", "10de:10f0", "040300", "snd_hda_intel", sound, ("sound", "sound/card2/pcmC2D3p", {}))
    host.net("0b95:1790", "ASIX Elec. Corp.", "AX88179", "ax88179_178a", "eth2")


def vehicle(host: Host) -> None:
    host.net("0c72:000c", "PEAK-System Technik GmbH", "PCAN-USB", "peak_usb", "can0", "280")
    host.net("1d50:606f", "bytewerk", "candleLight USB to CAN adapter", "gs_usb", "can1", "280")


def practice(host: Host) -> None:
    host.hid("28e9:028a", "CONTEC", "Pulse Oximeter CMS50D+")
    host.hid("0765:5020", "X-Rite, Inc.", "i1Display3")
    host.hid("0922:8003", "DYMO", "DYMO M10 Digital Postal Scale")


def keyboard_switch(host: Host) -> None:
    host.plug("0557:7000", "", "Hub", ("09/00/00", "hub", []), code="09")
    host.hid("0557:2419", "ATEN International Co. Ltd", "CS1922M V1.3.121", "01/01", keys=True)
    name = "USB3.0 HDMI Capture: USB3.0 HDMI"
    video: list[Part] = [("video4linux", "video4linux/video0", {"name": name, "index": "0"})]
    sound: list[Part] = [("sound", "sound/card3", {"id": "Capture"}), ("sound", "sound/card3/pcmC3D0c", {})]
    interfaces = ("0e/01/00", "uvcvideo", video), ("01/01/00", "snd-usb-audio", sound)
    host.plug("345f:2109", "MACROSILICON", "USB3.0 HDMI Capture", *interfaces)


def shop_counter(host: Host) -> None:
    for number, (ids, maker, product) in enumerate(
        (("04f9:2042", "Brother", "QL-700"), ("04b8:0202", "EPSON", "TM-T20II Receipt Printer"))
    ):
        host.plug(ids, maker, product, ("07/01/02", "usblp", [("usbmisc", f"usbmisc/lp{number}", {})]))
    host.hid("0c2e:0b61", "Honeywell", "Voyager 1200g Barcode Scanner", "01/01", keys=True)
    host.serial("0403:6001", "Arexx", "LoRa concentrator RAK2287", "ftdi_sio", "ttyUSB0")


HOSTS: Mapping[str, Callable[[Host], None]] = {
    each.__name__: each
    for each in (
        *(network_storage, thin_client, router, laboratory, machining, printing),
        *(radio, graphics_dock, vehicle, practice, keyboard_switch, shop_counter),
    )
}
