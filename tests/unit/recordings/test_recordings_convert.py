"""One small invented recording of each format family, and what a program then finds below the tree's root."""

import io
import json
import tarfile
from pathlib import Path

import pytest
from recordings.sysroot.convert import convert
from recordings.sysroot.tree import Tree

LSUSB_LONG = """
Bus 001 Device 004: ID f00d:0001 Invented Works Sample Gadget
Device Descriptor:
  bcdUSB               2.00
  bDeviceClass          239 Miscellaneous Device
  bDeviceSubClass         2
  bDeviceProtocol         1
  idVendor           0xf00d Invented Works
  idProduct          0x0001
  bcdDevice            1.02
  iManufacturer           1 Invented Works
  iProduct                2 Sample Gadget
  iSerial                 0
  Configuration Descriptor:
    bConfigurationValue     1
    bmAttributes         0x80
    MaxPower              100mA
    Interface Descriptor:
      bInterfaceNumber        0
      bAlternateSetting       0
      bNumEndpoints           1
      bInterfaceClass        14 Video
      bInterfaceSubClass      1
      bInterfaceProtocol      0
      iInterface              3 Sample Picture
    Interface Descriptor:
      bInterfaceNumber        0
      bAlternateSetting       1
      bInterfaceClass        14 Video
      bInterfaceSubClass      1
      bInterfaceProtocol      0
      iInterface              0
"""
LSUSB_TREE = """
/:  Bus 01.Port 1: Dev 1, Class=root_hub, Driver=xhci_hcd/4p, 480M
    |__ Port 3: Dev 4, If 0, Class=Video, Driver=uvcvideo, 480M
"""
UDEV = r"""
P: /devices/pci0000:00/0000:00:14.0/usb1/1-2
N: bus/usb/001/007
E: SUBSYSTEM=usb
E: DEVTYPE=usb_device
E: PRODUCT=f00d/2/100
E: TYPE=0/0/0
E: BUSNUM=001
E: DEVNUM=007
E: MAJOR=189
E: MINOR=6
E: ID_VENDOR_ENC=Invented\x20Works
E: ID_MODEL_ENC=0002
E: ID_MODEL_ID=0002
E: ID_SERIAL_SHORT=A1

P: /devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2:1.0/video4linux/video0
N: video0
S: v4l/by-id/usb-sample
E: SUBSYSTEM=video4linux
E: MAJOR=81
E: MINOR=0
E: ID_V4L_PRODUCT=Sample\x20Eye
E: TAGS=:seat:uaccess:
"""


def made(tmp_path: Path, **files: str) -> Path:
    """The tree of a recording with these files; double underscores stand for dots."""
    entry = tmp_path / "entry"
    entry.mkdir()
    for name, text in files.items():
        (entry / name.replace("__", ".")).write_text(text, encoding="utf-8")
    done = convert(entry, tmp_path / "tree")
    assert done.faults == ()
    assert done.loaded
    return tmp_path / "tree"


def read(tree: Path, path: str) -> str:
    return (tree / path).read_text(encoding="utf-8").removesuffix("\n")


def test_lsusb_gives_ids_strings_and_the_first_setting_of_an_interface(tmp_path: Path) -> None:
    tree = made(tmp_path, lsusb__txt=LSUSB_LONG)
    device = "sys/bus/usb/devices/1-4"
    values = {name: read(tree, f"{device}/{name}") for name in ("idVendor", "product", "bcdDevice", "bDeviceClass")}
    assert values == {"idVendor": "f00d", "product": "Sample Gadget", "bcdDevice": "0102", "bDeviceClass": "ef"}
    assert not (tree / device / "serial").exists(), "string 0 is no string"
    assert read(tree, f"{device}/1-4:1.0/interface") == "Sample Picture"
    assert read(tree, f"{device}/1-4:1.0/modalias") == "usb:vF00Dp0001d0102dcEFdsc02dp01ic0Eisc01ip00in00"
    assert (tree / "dev/bus/usb/001/004").read_bytes() == b""


def test_lsusb_tree_tells_the_port_and_the_driver(tmp_path: Path) -> None:
    tree = made(tmp_path, lsusb__txt=LSUSB_LONG, tree__txt=LSUSB_TREE)
    assert not (tree / "sys/bus/usb/devices/1-4").exists()
    assert read(tree, "sys/bus/usb/devices/1-3/devnum") == "4"
    assert (tree / "sys/bus/usb/devices/1-3:1.0/driver").resolve().name == "uvcvideo"


def test_short_lsusb_is_read_only_where_nothing_richer_is(tmp_path: Path) -> None:
    alone = made(tmp_path, lsusb__txt="Bus 002 Device 005: ID f00d:0003 Invented\n")
    assert read(alone, "sys/bus/usb/devices/2-5/idProduct") == "0003"
    entry = tmp_path / "both"
    entry.mkdir()
    (entry / "lsusb.txt").write_text("Bus 002 Device 005: ID f00d:0003 Invented\n")
    (entry / "usb-devices.txt").write_text(USB_DEVICES)
    assert set(convert(entry, tmp_path / "other").loaded) == {"usb-devices"}


USB_DEVICES = """
> T:  Bus=01 Lev=00 Prnt=00 Port=00 Cnt=00 Dev#=  1 Spd=480 MxCh= 4
> D:  Ver= 2.00 Cls=09(hub  ) Sub=00 Prot=01 MxPS=64 #Cfgs=  1
> P:  Vendor=1d6b ProdID=0002 Rev=05.10
> T:  Bus=01 Lev=01 Prnt=01 Port=02 Cnt=01 Dev#=  6 Spd=12  MxCh= 2
> P:  Vendor=f00d ProdID=0009 Rev=00.01
> T:  Bus=01 Lev=02 Prnt=06 Port=00 Cnt=01 Dev#=  7 Spd=12  MxCh= 0
> D:  Ver= 1.10 Cls=00(>ifc ) Sub=00 Prot=00 MxPS= 8 #Cfgs=  1
> P:  Vendor=f00d ProdID=000a Rev=12.34
> S:  Product=Sample Keys
> C:* #Ifs= 1 Cfg#= 1 Atr=a0 MxPwr=100mA
> I:* If#=0x0 Alt= 0 #EPs= 1 Cls=03(HID  ) Sub=01 Prot=01 Driver=usbhid
"""


def test_usb_devices_quoted_in_a_mail_gives_names_by_port(tmp_path: Path) -> None:
    tree = made(tmp_path, mail__txt=USB_DEVICES)
    assert (tree / "sys/bus/usb/devices/usb1").exists()
    assert read(tree, "sys/bus/usb/devices/1-3.1/product") == "Sample Keys"
    assert (tree / "sys/bus/usb/devices/1-3.1").resolve().parent.name == "1-3"
    assert (tree / "sys/bus/usb/devices/1-3.1:1.0/driver").resolve().name == "usbhid"


def test_kernel_log_gives_strings_and_a_tty(tmp_path: Path) -> None:
    log = """
usb 3-1.2: New USB device found, idVendor=f00d, idProduct=0004, bcdDevice= 2.60
usb 3-1.2: Product: Sample Bridge
usb 3-1.2: invented converter now attached to ttyUSB0
usb 3-2: New USB device found, idVendor=f00d, idProduct=0005
usb 3-2: Product: Another
"""
    tree = made(tmp_path, dmesg__txt=log)
    assert read(tree, "sys/bus/usb/devices/3-1.2/product") == "Sample Bridge"
    assert read(tree, "sys/bus/usb/devices/3-2/product") == "Another"
    assert (tree / "dev/ttyUSB0").exists()


def test_by_id_names_give_the_port_and_what_udev_knew(tmp_path: Path) -> None:
    tree = made(tmp_path, ids__txt="f00d:0006 /dev/serial/by-id/usb-Invented_Stick_77-if00-port0\n")
    assert (tree / "dev/serial/by-id/usb-Invented_Stick_77-if00-port0").resolve() == (tree / "dev/ttyUSB0").resolve()
    assert "E:ID_SERIAL=Invented_Stick_77\n" in (tree / "run/udev/data/c188:0").read_text()
    assert (tree / "sys/class/tty/ttyUSB0/device").resolve().parent.name == "1-1:1.0"


def test_udev_export_gives_attributes_links_and_database(tmp_path: Path) -> None:
    tree = made(tmp_path, host__udevdb__txt=UDEV)
    device = "sys/bus/usb/devices/1-2"
    assert read(tree, f"{device}/idProduct") == "0002"
    assert read(tree, f"{device}/manufacturer") == "Invented Works"
    assert not (tree / device / "product").exists(), "udev writes the id where the device has no string"
    assert read(tree, "sys/class/video4linux/video0/name") == "Sample Eye"
    assert (tree / "sys/class/video4linux/video0/device").resolve() == (tree / device).resolve()
    assert (tree / "dev/v4l/by-id/usb-sample").resolve().name == "video0"
    assert (tree / "run/udev/data/c81:0").read_text().splitlines()[-3:] == ["G:seat", "G:uaccess", "V:1"]
    record = json.loads((tree / ".recorded.json").read_text())
    assert record["nodes"]["video0"] == {"kind": "char", "major": "81", "minor": "0"}
    assert "sys/devices/pci0000:00/0000:00:14.0/usb1/1-2/idProduct" in record["derived"]


def test_umockdev_attributes_are_taken_as_recorded(tmp_path: Path) -> None:
    text = "P: /devices/x/hidraw/hidraw0\nE: SUBSYSTEM=hidraw\nA: note=two\\nlines\nH: raw=00ff\nL: device=../../../x\n"
    tree = made(tmp_path, device__umockdev=text)
    assert read(tree, "sys/class/hidraw/hidraw0/note") == "two\nlines"
    assert (tree / "sys/devices/x/hidraw/hidraw0/raw").read_bytes() == b"\x00\xff"


def test_udevadm_walk(tmp_path: Path) -> None:
    text = """
  looking at device '/devices/x/1-1/tty/ttyACM0':
    SUBSYSTEM=="tty"
    ATTR{dev}=="166:0"
  looking at parent device '/devices/x/1-1':
    SUBSYSTEMS=="usb"
    DRIVERS=="usb"
    ATTRS{idVendor}=="f00d"
    ATTRS{secret}=="(not readable)"
"""
    tree = made(tmp_path, walk__txt=text)
    assert read(tree, "sys/bus/usb/devices/1-1/idVendor") == "f00d"
    assert not (tree / "sys/devices/x/1-1/secret").exists()
    assert (tree / "dev/ttyACM0").exists()


def test_input_devices(tmp_path: Path) -> None:
    text = """I: Bus=0003 Vendor=f00d Product=0007 Version=0111
N: Name="Sample Wheel"
P: Phys=usb-1/input0
S: Sysfs=/devices/x/input/input9
H: Handlers=event4 js0
B: EV=1b
"""
    tree = made(tmp_path, devices=text)
    assert read(tree, "sys/class/input/input9/name") == "Sample Wheel"
    assert read(tree, "sys/class/input/input9/capabilities/ev") == "1b"
    assert (tree / "sys/class/input/event4/device").resolve().name == "input9"
    assert (tree / "dev/input/js0").exists()


def test_sound_cards_with_machine_and_pcm(tmp_path: Path) -> None:
    text = """
!!DMI Information
Manufacturer:      Invented Works
!!Soundcards recognised by ALSA
!!-----------------------------

 0 [Sample         ]: USB-Audio - Sample Horn
                      Invented Works Sample Horn at usb-1


!!Aplay/Arecord output
**** List of PLAYBACK Hardware Devices ****
card 0: Sample [Sample Horn], device 0: USB Audio [USB Audio]

"""
    tree = made(tmp_path, alsa_info__txt=text)
    assert read(tree, "sys/class/sound/card0/id") == "Sample"
    assert (tree / "dev/snd/pcmC0D0p").exists()
    assert read(tree, "sys/class/dmi/id/sys_vendor") == "Invented Works"
    assert read(tree, "proc/asound/pcm") == "00-00: USB Audio : USB Audio : playback 1"


def test_lists_of_a_board(tmp_path: Path) -> None:
    video = "Sample Eye (usb-x-1):\n\t/dev/video2\n\t/dev/media0\n\n"
    sensors = "sample-i2c-0-48\nAdapter: bus 0\ninlet:   +21.5°C\nfan1:    900 RPM\nVin:   12.0 V\n"
    buses = "i2c-3\ti2c       \tInvented adapter                  \tI2C adapter\n"
    chips = "gpiochip0 - 2 lines:\n\tline 0: unnamed\n"
    tree = made(tmp_path, video__txt=video, sensors__txt=sensors, buses__txt=buses, gpio__txt=chips)
    assert read(tree, "sys/class/video4linux/video2/name") == "Sample Eye"
    names = ("name", "temp1_input", "temp1_label", "fan1_input", "in0_input")
    chip = [read(tree, f"sys/class/hwmon/hwmon0/{name}") for name in names]
    assert chip == ["sample", "21500", "inlet", "900", "12000"]
    assert read(tree, "sys/class/i2c-adapter/i2c-3/name") == "Invented adapter"
    assert (tree / "sys/bus/gpio/devices/gpiochip0").exists()


def test_iio_context(tmp_path: Path) -> None:
    text = """<?xml version="1.0"?><!DOCTYPE context [<!ELEMENT context (device)*>]>
<context name="local"><context-attribute name="hw_model" value="Sample Board"/>
<device id="iio:device0" name="sample-adc"><channel id="voltage0" type="input">
<attribute name="raw" filename="in_voltage0_raw" value="17"/><scan-element index="0" format="le:u12/16&gt;&gt;0"/>
</channel></device></context>"""
    tree = made(tmp_path, board__xml=text)
    assert read(tree, "sys/bus/iio/devices/iio:device0/in_voltage0_raw") == "17"
    assert read(tree, "sys/bus/iio/devices/iio:device0/scan_elements/in_voltage0_index") == "0"
    assert read(tree, "proc/device-tree/model") == "Sample Board"


def test_documents_of_an_installer_and_of_fwupd(tmp_path: Path) -> None:
    disk = {"DEVPATH": "/devices/x/block/sda", "DEVTYPE": "disk", "attrs": {"size": "1024", "device": None}}
    link = {"netlink_data": {"name": "eth0"}, "udev_data": {"IFINDEX": "2", "attrs": {"speed": "100"}}}
    machine = {"storage": {"blockdev": {"/dev/sda": disk}}, "network": {"links": [link]}}
    strings = [{"Id": "GetStringDescriptor:DescIndex=0x02", "Data": "U2FtcGxlAA=="}]
    gadget = {"IdVendor": 0xF00D, "IdProduct": 8, "Product": 2, "PlatformId": "1-9", "UsbEvents": strings}
    gadget["UsbInterfaces"] = [{"InterfaceClass": 255, "UsbEndpoints": [{}]}]
    tree = made(tmp_path, machine__json=json.dumps(machine), emulation__json=json.dumps({"UsbDevices": [gadget]}))
    assert read(tree, "sys/block/sda/size") == "1024"
    assert read(tree, "sys/class/net/eth0/speed") == "100"
    assert read(tree, "sys/bus/usb/devices/1-9/product") == "Sample"
    assert read(tree, "sys/bus/usb/devices/1-9:1.0/bInterfaceClass") == "ff"


def test_ups_dump(tmp_path: Path) -> None:
    text = "device.type: ups\ndriver.name: usbhid-ups\nups.vendorid: F00D\nups.productid: 0010\nups.model: Sample 500\n"
    tree = made(tmp_path, sample__dev=text)
    assert read(tree, "sys/bus/usb/devices/1-1/idVendor") == "f00d"
    assert read(tree, "sys/bus/usb/devices/1-1/product") == "Sample 500"


def test_sysinfo_folder_of_a_tablet(tmp_path: Path) -> None:
    device = "/sys/devices/x/0003:F00D:0011.0001"
    data = f"{device}/uevent:HID_NAME=Sample: Pad\n{device}/uevent:DEVNAME=hidraw3\n{device}/country:00\n"
    files = {
        "devtree__txt": f"********* {device}\n{device}/subsystem -> /sys/bus/hid\n",
        "devtree_data__txt": data,
        "machine__txt": "/sys/class/dmi/id/sys_vendor:Invented Works\n",
        "0003:F00D:0011.0001__hid__bin": "\x05\x0d",
    }
    tree = made(tmp_path, **files)
    found = tree / "sys/bus/hid/devices/0003:F00D:0011.0001"
    assert (found / "uevent").read_text() == "HID_NAME=Sample: Pad\nDEVNAME=hidraw3\n"
    assert (found / "report_descriptor").read_bytes() == b"\x05\x0d"
    assert read(tree, "sys/class/dmi/id/sys_vendor") == "Invented Works"


def archive(path: Path, links: dict[str, str], **texts: str) -> None:
    with tarfile.open(path, "w:gz") as file:
        for name, target in links.items():
            member = tarfile.TarInfo(name)
            member.type, member.linkname = tarfile.SYMTYPE, target
            file.addfile(member)
        for name, text in texts.items():
            member = tarfile.TarInfo(name)
            member.size = len(text)
            file.addfile(member, io.BytesIO(text.encode()))


def test_an_archive_is_unpacked_and_does_not_write_outside(tmp_path: Path) -> None:
    entry = tmp_path / "entry"
    entry.mkdir()
    outside = tmp_path / "outside"
    outside.mkdir()
    links = {"root/sys/way": str(outside), "root/sys/class/net/eth0": "../../devices/eth0"}
    files = {"root/sys/devices/eth0/mtu": "1500\n", "root/sys/way/file": "x", "root/sys/../../../climb": "x"}
    archive(entry / "host.tar.gz", links, **files)
    convert(entry, tmp_path / "tree")
    assert read(tmp_path / "tree", "sys/class/net/eth0/mtu") == "1500"
    assert list(outside.iterdir()) == []
    assert not (tmp_path / "climb").exists()


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("board.xml", b'<?xml version="1.0"?><context><device', "iio-context"),
        ("host.tar.gz", b"no archive", "tar"),
        ("emulation.json", b'{"UsbDevices": [{"IdVendor": "x", "IdProduct": 1}]}', "emulation"),
        ("machine.json", b'{"storage": {"blockdev": {"/dev/sda": 7}}}', "inventory"),
    ],
)
def test_a_damaged_file_is_named_and_the_others_are_read(tmp_path: Path, name: str, content: bytes, word: str) -> None:
    entry = tmp_path / "entry"
    entry.mkdir()
    (entry / name).write_bytes(content)
    (entry / "lsusb.txt").write_text(LSUSB_LONG)
    done = convert(entry, tmp_path / "tree")
    assert [fault.split(":")[0] for fault in done.faults] == [name]
    assert word in done.faults[0]
    assert done.loaded == {"lsusb-long": 1}


def test_what_is_written_first_stays_and_no_path_climbs_out(tmp_path: Path) -> None:
    tree = Tree(tmp_path / "tree")
    tree.attribute("sys/a/name", "first")
    tree.attribute("sys/a/name", "second")
    tree.write("../../b", "inside")
    tree.write("sys/a/name/below", "a file is in the way")
    tree.write("sys/a/" + "x" * 300, "no file system takes this name")
    tree.link("sys/a/" + "y" * 300, "sys/a")
    assert read(tmp_path / "tree", "sys/a/name") == "first"
    assert read(tmp_path / "tree", "b") == "inside"
    assert tree.written == 2


def test_notes_and_truth_are_no_recordings(tmp_path: Path) -> None:
    entry = tmp_path / "entry"
    entry.mkdir()
    for name in ("SOURCE.txt", "truth.json", "traffic.pcapng"):
        (entry / name).write_text(LSUSB_LONG)
    assert convert(entry, tmp_path / "tree").loaded == {}
