"""A libiio context (`iio_genxml`): IIO and hwmon devices with every attribute and its value."""

import re
import xml.etree.ElementTree as ET

from recordings.sysroot.tree import Tree


def load(tree: Tree, text: str) -> int:
    """Write the context's devices; how many it has. ParseError for text that is no XML."""
    # Entities cannot be declared without the document type, and no context needs one.
    context = ET.fromstring(re.sub(r"<!DOCTYPE.*?\]>", "", text, flags=re.S))
    for attribute in context.findall("context-attribute"):
        if attribute.get("name") in ("hw_model", "hw_carrier"):
            tree.attribute("proc/device-tree/model", attribute.get("value"), derived=True)
    devices = [device for device in context.findall("device") if device.get("id")]
    for device in devices:
        _put(tree, device, device.get("id", ""))
    return len(devices)


def _put(tree: Tree, device: ET.Element, name: str) -> None:
    is_hwmon = name.startswith("hwmon")
    path = f"/devices/recorded/{name}"
    tree.folder("sys" + path)
    for key in ("name", "label"):
        tree.attribute(f"sys{path}/{key}", device.get(key))
    for attribute in device.findall("attribute"):
        tree.attribute(f"sys{path}/{attribute.get('filename') or attribute.get('name')}", attribute.get("value"))
    for channel in device.findall("channel"):
        prefix = f"{'out' if channel.get('type') == 'output' else 'in'}_{channel.get('id')}"
        for attribute in channel.findall("attribute"):
            file = attribute.get("filename") or f"{prefix}_{attribute.get('name')}"
            tree.attribute(f"sys{path}/{file}", attribute.get("value"))
        element = channel.find("scan-element")
        if element is not None and not is_hwmon:
            tree.attribute(f"sys{path}/scan_elements/{prefix}_index", element.get("index"))
            tree.attribute(f"sys{path}/scan_elements/{prefix}_type", element.get("format"))
    if is_hwmon:
        tree.register(path, "hwmon")
    else:
        tree.register(path, "iio", bus=True)
        tree.node(name, "char")
