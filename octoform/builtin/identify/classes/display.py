"""Graphics adapters and what is connected to them; monitors name themselves in the EDID that the kernel keeps."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, Capability, Claim

_PCI_DISPLAY = "03"


def claim(device: Device) -> Claim | None:
    """A graphics adapter, or nothing of the kind."""
    is_pci = device.pci_class.startswith(_PCI_DISPLAY)
    if device.bus == "virtual" or not (is_pci or {"drm", "graphics"} & device.classes):
        return None
    connectors = [fact.text for fact in device.of("drm", "connector")]
    capabilities: tuple[Capability, ...] = ()
    if connectors:
        capabilities = (
            Capability(
                "read_display",
                "Read which displays are connected, their names and their modes.",
                "Linux DRM (/sys/class/drm)",
                parameters={"connectors": connectors},
            ),
        )
    if is_pci:
        evidence = device.cite_key("class_code", "PCI display controller")
    else:
        evidence = device.cite("drm", "a graphics device of the kernel")
    names = device.names("graphics", "name")
    return Claim("gpu", INFRASTRUCTURE, "graphics adapter", (evidence,), capabilities, names)
