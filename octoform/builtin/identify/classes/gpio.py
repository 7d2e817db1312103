"""GPIO controllers: their lines can be listed; no line is claimed, because what hangs on it is not known."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import BIDIRECTIONAL, Capability, Claim


def claim(device: Device) -> Claim | None:
    """A GPIO controller, or nothing of the kind."""
    if "gpio" not in device.classes and not any(name.startswith("gpiochip") for _, name in device.nodes):
        return None
    labels = [fact.text for fact in device.of("gpio", "label")]
    lines = [int(fact.text) for fact in device.of("gpio", "ngpio") if fact.text.isdecimal()]
    parameters: dict[str, object] = {"labels": labels} if labels else {}
    if lines:
        parameters["lines"] = max(lines)
    capability = Capability(
        "read_gpio_lines",
        "List the lines of the GPIO controller with name, direction and user, without changing any.",
        "Linux GPIO character device (/dev/gpiochipN)",
        parameters=parameters,
    )
    names = tuple((f"GPIO controller {label}", line) for label, line in device.names("gpio", "label"))
    evidence = (device.cite("gpio", "the kernel's GPIO class"),)
    return Claim("gpio", BIDIRECTIONAL, "GPIO controller", evidence, (capability,), names)
