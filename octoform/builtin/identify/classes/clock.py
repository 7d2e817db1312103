"""Real-time clocks."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, Capability, Claim


def claim(device: Device) -> Claim | None:
    """A hardware clock, or nothing of the kind."""
    if "rtc" not in device.classes:
        return None
    capability = Capability(
        "read_clock",
        "Read the hardware clock and how far it is from the system's time.",
        "Linux rtc class (/sys/class/rtc)",
    )
    names = tuple((f"real-time clock {name}", line) for name, line in device.names("rtc", "name"))
    evidence = (device.cite("rtc", "the kernel's clock class"),)
    return Claim("rtc", INFRASTRUCTURE, "real-time clock", evidence, (capability,), names)
