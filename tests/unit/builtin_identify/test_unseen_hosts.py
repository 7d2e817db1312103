"""Hosts of kinds that no recording shows, with what is true of each device: none misnamed, none guessed at, all served.

A name is right when it has the words that are true and no other maker or model; "" is a device of which no one can
know what it is.
"""

from pathlib import Path
from typing import Any

from cases import for_each
from unseen_hosts import HOSTS, Host

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.diagnostics import Severity

SCHEMAS = Path(__file__).parents[3] / "protocol" / "schemas"
NET, STORAGE, KEYS = ("read_network_interfaces",), ("read_storage", "read_temperature"), ("read_input_events",)
PICTURE, PRINTER = ("capture_image",), ("read_printer_status",)
TRUE: dict[str, tuple[str, tuple[str, ...]]] = {
    "pci-8086-a282": ("storage controller", ()),
    "scsi-ata-st8000vn0022-2el": ("ST8000VN0022-2EL", STORAGE),
    "scsi-ata-wdc-wd80efzx-68u": ("WDC WD80EFZX-68U", STORAGE),
    "platform-leds": ("LED", ("read_led", "set_led")),
    "usb-051d-0002": ("American Power Conversion Back-UPS ES 700G", ()),
    "usb-0bda-8156": ("Realtek", NET),
    "usb-076b-3021": ("OMNIKEY 3x21 Smart Card Reader", ()),
    "usb-047f-c025": ("Plantronics C320-M", ("record_audio", "play_audio")),
    "usb-413c-2113": ("Dell KB216 Wired Keyboard", KEYS),
    "usb-2c7c-0125": ("Quectel EC25-EU", NET),
    "platform-keys": ("keys", KEYS),
    "usb-1ab1-0588": ("Rigol Technologies. DS1000 SERIES", ()),
    "usb-3923-709b": ("National Instruments GPIB-USB-HS", ()),
    "usb-103e-0109": ("TTi QL355TP Power Supply", ()),
    "usb-0403-6001 of laboratory": ("", ()),
    "usb-1a86-7523": ("", ()),
    "usb-0483-5740": ("grblHAL CNC controller", ()),
    "usb-10ce-eb70": ("pendant XHC-HB04", ()),
    "usb-2c99-0002": ("Original Prusa i3 MK3", ()),
    "usb-1d50-614e": ("", ()),
    "usb-32e4-9230": ("HD USB Camera", PICTURE),
    "usb-1d50-6089": ("HackRF One", ()),
    "usb-04b4-8613": ("", ()),
    "usb-0bda-2838": ("Realtek RTL2838UHIDIR", ()),
    "usb-21a9-1006": ("Saleae LLC Logic Pro 16", ()),
    "thunderbolt-0-1": ("Razer Core X", ()),
    "pci-10de-1b81": ("graphics adapter", ("read_display", "read_temperature", "read_fan_speed")),
    "pci-10de-10f0": ("NVidia", ("play_audio",)),
    "usb-0b95-1790": ("AX88179", NET),
    "usb-0c72-000c": ("PCAN-USB", NET),
    "usb-1d50-606f": ("candleLight USB to CAN adapter", NET),
    "usb-28e9-028a": ("CONTEC Pulse Oximeter CMS50D+", ()),
    "usb-0765-5020": ("X-Rite, Inc. i1Display3", ()),
    "usb-0922-8003": ("DYMO M10 Digital Postal Scale", ()),
    "usb-0557-7000": ("Hub", ()),
    "usb-0557-2419": ("ATEN", KEYS),
    "usb-345f-2109": ("USB3.0 HDMI Capture", (*PICTURE, "record_audio")),
    "usb-04f9-2042": ("Brother QL-700", PRINTER),
    "usb-04b8-0202": ("EPSON TM-T20II Receipt Printer", PRINTER),
    "usb-0c2e-0b61": ("Honeywell Voyager 1200g Barcode Scanner", KEYS),
    "usb-0403-6001 of shop_counter": ("Arexx LoRa concentrator RAK2287", ()),
}
ELSEWHERE = {"usb-0403-6001": ("laboratory", "shop_counter")}


@for_each("name", HOSTS)
def test_each_device_is_what_it_is(name: str, tmp_path: Path) -> None:
    host = Host(tmp_path / "host")
    HOSTS[name](host)
    probe: Any = probe_root(host.root)
    found = identify(probe, IdDatabases(host.root))
    interface = declare(found, 60)
    for stage, value in (("identify", found), ("interface", interface)):
        known = Artifacts(probe=probe, identify=found, registered={}, tools_budget=60)
        assert [item for item in check(stage, value, known, SCHEMAS) if item.severity is Severity.ERROR] == []
    assert found["devices"]
    for device in found["devices"]:
        words, tools = TRUE[f"{device['id']} of {name}" if device["id"] in ELSEWHERE else device["id"]]
        if not words:
            assert (device["category"], device["confidence"], device["capabilities"]) == ("unknown", 0.0, [])
            continue
        assert device["category"] != "unknown" and words in device["identified_as"], device
        text = " ".join(f"{each['name']} {each['raw_descriptor']}" for each in probe["devices"]) + words
        lines = [word for word in device["identified_as"].split() if any(map(str.isdigit, word))]
        assert all(word in text for word in lines), device
        assert set(tools) <= {each["name"] for each in device["capabilities"]}, device
