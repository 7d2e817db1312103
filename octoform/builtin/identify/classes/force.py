"""Force feedback of game controllers: the motors that let one rumble. Wheels and sticks are never pushed."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import ACTUATE, SENSOR, Capability, Claim, Evidence


def claim(device: Device) -> Claim | None:
    """A game pad that takes force feedback, or nothing of the kind."""
    for group in device.groups("input"):
        events, kinds = (group[key].text.split(",") if key in group else [] for key in ("events", "kinds"))
        if "force" in events and "gamepad" in kinds:
            evidence = Evidence(group["events"].line, "a game pad that takes force feedback")
            via = "Linux evdev force feedback (EVIOCSFF)"
            capability = Capability("play_rumble", "Let the controller rumble for a bounded time.", via, ACTUATE)
            return Claim("gamepad", SENSOR, "game controller", (evidence,), (capability,))
    return None
