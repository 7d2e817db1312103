"""Counters and pulse generators: what the kernel counts can be read; what it pulses is left alone.

A pulse width output of a board drives its own fan, its backlight or its regulator, and nothing tells which one is free.
"""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import ACTUATOR, INFRASTRUCTURE, SENSOR, Capability, Claim

_WIRED = ("i2c", "spi")


def claim(device: Device) -> Claim | None:
    """A counter, a pulse generator, or nothing of the kind."""
    if "counter" in device.classes:
        description = "Read every count of the counter, with its direction where it has one."
        capability = Capability("read_counters", description, "Linux counter subsystem (/sys/bus/counter)")
        return Claim("counter", SENSOR, "counter", (device.cite("counter", "the kernel's counters"),), (capability,))
    if "pwm" in device.classes and device.bus != "virtual":
        evidence, own = device.cite("pwm", "the kernel's PWM class"), device.fact("name")
        names = ((f"PWM controller {own.text}", own.line),) if own and device.bus in _WIRED else ()
        # A chip of its own on a bus is a breakout for others; that of a processor drives the board.
        category = ACTUATOR if names else INFRASTRUCTURE
        return Claim("pwm", category, "PWM controller", (evidence,), names=names)
    return None
