"""Force feedback: motors that let a controller rumble or a phone vibrate. Wheels and sticks are never pushed."""

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import ACTUATE, ACTUATOR, SENSOR, Capability, Claim, Evidence

_VIA = "Linux evdev force feedback (EVIOCSFF)"


def claim(device: Device) -> Claim | None:
    """A game pad that takes force feedback, a vibration motor, or nothing of the kind."""
    for group in device.groups("input"):
        events, kinds = (group[key].text.split(",") if key in group else [] for key in ("events", "kinds"))
        if "force" in events and "gamepad" in kinds:
            evidence = Evidence(group["events"].line, "a game pad that takes force feedback")
            capability = Capability("play_rumble", "Let the controller rumble for a bounded time.", _VIA, ACTUATE)
            return Claim("gamepad", SENSOR, "game controller", (evidence,), (capability,))
        if events == ["force"] and "name" in group:
            evidence = Evidence(group["events"].line, "takes force feedback and sends nothing: a vibration motor")
            capability = Capability("play_rumble", "Let the motor vibrate for a bounded time.", _VIA, ACTUATE)
            names = ((group["name"].text.strip('"'), group["name"].line),)
            return Claim("haptic", ACTUATOR, "vibration motor", (evidence,), (capability,), names)
        if events == ["sound"] and "name" in group:
            evidence = Evidence(group["events"].line, "takes tones and sends nothing: a beeper")
            names = ((group["name"].text.strip('"'), group["name"].line),)
            return Claim("buzzer", ACTUATOR, "beeper", (evidence,), names=names)
    return None
