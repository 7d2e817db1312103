"""Which GPIO lines may be driven: those of breakouts and headers, never a processor's or a chipset's own."""

from pathlib import Path
from typing import Any

import pytest
from sysfs_tree import Tree
from unit.builtin_identify.probes import NO_DATABASES, answer, capabilities, device, probe, usb

from octoform.builtin.identify import identify
from octoform.builtin.probe import probe_root
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts

SCHEMAS = Path(__file__).parents[3] / "protocol/schemas"
NODE = (("gpio", "gpiochip0"),)


def chip(bus: str, driver: str, *lines: str) -> dict[str, Any]:
    facts = [f"driver: {driver}", "gpio[0].label: demo", "gpio[0].ngpio: 8", *lines]
    if bus == "usb":
        return usb(*facts, nodes=NODE, drivers=["usb", driver])
    return device(f"{bus}-demo", bus, f"bus: {bus}", *facts, nodes=NODE, drivers=[driver])


@pytest.mark.parametrize(
    ("bus", "driver"),
    [("platform", "gpio-sim"), ("platform", "gpio-mockup"), ("usb", "cp2112"), ("i2c", "pca953x"), ("spi", "mcp23s08")],
)
def test_lines_of_breakouts_are_read_and_driven(bus: str, driver: str) -> None:
    found = capabilities(answer(chip(bus, driver)))
    assert found.keys() == {"read_gpio_lines", "read_gpio_line", "set_gpio_line"}
    assert found["set_gpio_line"]["effect"] == "actuate" and found["set_gpio_line"]["parameters"]["lines"] == 8


@pytest.mark.parametrize(
    ("bus", "driver"),
    [
        *(("platform", "pinctrl-soc9"), ("acpi", "amd_gpio"), ("pci", "gpio_pch"), ("amba", "pl061_gpio")),
        *(("usb", "gpio-ljca"), ("usb", "cp210x"), ("i2c", "tps65910"), ("platform", "raspberrypi-exp-gpio")),
    ],
)
def test_a_machines_own_controllers_are_listed_only(bus: str, driver: str) -> None:
    found = answer(chip(bus, driver, "gpio[1].line_names: WL_RESET,GPIO_GCLK,CON_PWR_EN,GPIO1_A3,PA12,gpio_led"))
    assert found.get("capabilities", []) == [] or capabilities(found).keys() == {"read_gpio_lines"}


@pytest.mark.parametrize(
    "name", ["GPIO17", "GPIO-A", "P9_22 [spi0_sclk]", "PIN_7", "J8_3", "con1-03", "[HEADER_10]", "7J1 Header Pin3"]
)
def test_a_pin_of_a_boards_header_is_driven_and_never_only_read(name: str) -> None:
    found = capabilities(answer(chip("platform", "pinctrl-soc9", f"gpio[1].line_names: WL_RESET,{name}")))
    assert found.keys() == {"read_gpio_lines", "set_gpio_line"}


@pytest.mark.parametrize("name", ["Demo USB-I2C/UART Combo", "Demo HID USB-to-SMBus Bridge", "Demo Lines 4"])
def test_a_usb_bridge_with_lines_is_a_product_also_beside_its_serial_line(name: str) -> None:
    port = ("interface 00: class 02/02/01 driver=cdc_acm", "interface 02: class 03/00/00 driver=usbhid")
    entry = usb(
        *("manufacturer: Demo", f"product: {name}", *port, "gpio[0].label: demo"),
        nodes=(*NODE, ("tty", "ttyACM0")),
        drivers=["cdc_acm", "mcp2221", "usb"],
    )
    document = probe(entry)
    artifact = identify(document, NO_DATABASES)
    assert check("identify", artifact, Artifacts(probe=document), SCHEMAS) == []
    (found,) = artifact["devices"]
    assert (found["class"], found["category"]) == ("gpio", "bidirectional")
    assert "set_gpio_line" in capabilities(found) and name in found["identified_as"]


def test_the_names_of_the_lines_come_from_the_device_tree(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    tree.bus("platform/soc/7e200000.gpio", "platform", DRIVER="pinctrl-soc9")
    folder = tree.bus("platform/soc/7e200000.gpio/gpiochip0", "gpio", DEVNAME="gpiochip0")
    base = tmp_path / "sys/firmware/devicetree/base/soc/gpio@7e200000"
    base.mkdir(parents=True)
    (base / "gpio-line-names").write_bytes(b"ID_SDA\0\0GPIO2\0")
    (folder / "of_node").symlink_to("../../../../../firmware/devicetree/base/soc/gpio@7e200000")
    artifact = probe_root(tmp_path)
    (found,) = [one for one in artifact["devices"] if "gpio" in one.get("classes", ())]
    assert "gpio[0].line_names: ID_SDA,GPIO2" in found["raw_descriptor"]
    assert "set_gpio_line" in capabilities(answer(found))
