"""Rules for what moves at the end of a raw line: whoever drives it knows its limits and how it stops.

Behind a serial line, a HID report, a bus or a bare USB interface the kernel knows nothing of the device: no range, no
unit, no stop. A model may remember the registers of a servo, and nobody can tell whether it does so rightly before
something has moved. So what acts there comes from a profile, or from what the device's owner said of it.
"""

from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.text import pointer, shown
from octoform.diagnostics import Diagnostic, error

CODE = "IDENTIFY-ACTUATE-WITHOUT-PROFILE"
RAW = frozenset(
    {"tty", "hid", "hidraw", "hiddev", "i2c", "i2c-adapter", "i2c-dev", "spi", "spidev", "usb", "usb_device", "usbmisc"}
)
"""Classes of the kernel whose nodes carry bytes and no meaning (Documentation/ABI, devices.txt)."""


def actuate_without_profile(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A capability that acts through a raw line is one of a profile that holds, or the owner spoke of the device."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    return [
        error(
            CODE,
            f"{shown(capability['name'])} acts on {shown(device['id'])} through a raw line, and no profile says how",
            pointer=pointer("devices", index, "capabilities", at),
            hint=f"leave it out; `octoform profile new {device['id']}` drafts what is missing: limits and how to stop",
        )
        for index, device in enumerate(value["devices"])
        if not known_by_a_person(device, artifacts) and RAW.issuperset(probed.get(device["id"], {}).get("classes", ()))
        for at, capability in enumerate(device["capabilities"])
        if capability["effect"] != "read"
    ]


def unknown_lines(artifacts: Artifacts) -> frozenset[str]:
    """The devices behind raw lines of which neither a profile nor a person says how they are driven."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    return frozenset(
        device["id"]
        for device in (artifacts.identify or {}).get("devices", ())
        if device["id"] in probed
        and not known_by_a_person(device, artifacts)
        and RAW.issuperset(probed[device["id"]].get("classes", ()))
    )


def known_by_a_person(device: JsonObject, artifacts: Artifacts) -> bool:
    """Whether a person or a profile says how it is driven; a profile that does not hold is another rule's finding."""
    return device["id"] in artifacts.answers or "profile" in device or device["method"] == "profile"


RULES = (Rule(CODE, actuate_without_profile),)
