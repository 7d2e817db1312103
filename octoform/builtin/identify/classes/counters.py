"""Counters and pulse generators: what the kernel counts can be read; what it pulses is left alone.

A pulse width output of a board drives its own fan, its backlight or its regulator, and nothing tells which one is free.
"""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, SENSOR, Capability, Claim


def claim(device: Device) -> Claim | None:
    """A counter, a pulse generator, or nothing of the kind."""
    if "counter" in device.classes:
        description = "Read every count of the counter, with its direction where it has one."
        capability = Capability("read_counters", description, "Linux counter subsystem (/sys/bus/counter)")
        return Claim("counter", SENSOR, "counter", (device.cite("counter", "the kernel's counters"),), (capability,))
    if "pwm" in device.classes and device.bus != "virtual":
        evidence = device.cite("pwm", "the kernel's PWM class")
        return Claim("pwm", INFRASTRUCTURE, "pulse width generator", (evidence,))
    return None
