"""Sound cards and USB audio: what can be played or recorded through ALSA's PCM devices.

The direction is read from the PCM devices that the kernel made (their names end in p for playback, c for capture); a
card without any is a mixer or a MIDI port and gets no capability.
"""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import (
    ACTUATE,
    ACTUATOR,
    BIDIRECTIONAL,
    READ,
    SENSOR,
    Capability,
    Claim,
    Evidence,
)

USB_AUDIO = "01"
VENDOR_CLASS, STREAMING, MIDI = "ff", "02", "03"
_PCI_AUDIO = ("0401", "0403")


_CATEGORIES = {frozenset("p"): ACTUATOR, frozenset("c"): SENSOR}
_MICROPHONES = frozenset(("microphone", "microphones", "mic", "recorder", "camera", "webcam"))


def claim(device: Device) -> Claim | None:
    """A sound card, or nothing of the kind."""
    interface = device.usb(USB_AUDIO)
    has_card = any(kind == "sound" and name.startswith("card") for kind, name in device.nodes)
    if not interface and not has_card and device.pci_class not in _PCI_AUDIO:
        return None
    directions = _directions(device)
    category = _CATEGORIES.get(frozenset(directions or _by_interfaces(device)), BIDIRECTIONAL)
    if interface:
        evidence = Evidence(interface.line, "USB audio class interface")
    elif has_card:
        evidence = device.cite("sound", "ALSA sound card")
    else:
        evidence = device.cite_key("class_code", "PCI audio function")
    names = device.names("sound", "longname", "name", "id")
    if not directions and interface and not any(one.triple[:2] == (USB_AUDIO, STREAMING) for one in device.interfaces):
        streams = device.usb(f"{USB_AUDIO}/{MIDI}")
        if streams:
            cited = (Evidence(streams.line, "USB MIDI streaming interface"),)
            return Claim("midi", BIDIRECTIONAL, "USB MIDI device", cited, names=names)
    kind = {ACTUATOR: "audio_out", SENSOR: "audio_in"}.get(category, "audio")
    return Claim(kind, category, "sound card", (evidence,), capabilities(directions), names)


def claim_vendor(device: Device) -> Claim | None:
    """Sound under a vendor's own interface class whose subclasses are those of USB audio, as the kernel's driver knows.

    Makers of instruments keep the structure of the audio class (control, streaming, MIDI) and change its first number.
    """
    own = [interface for interface in device.interfaces if interface.triple[0] == VENDOR_CLASS]
    subclasses = {interface.triple[1] for interface in own}
    if len(own) != len(device.interfaces) or not subclasses >= {STREAMING, MIDI}:
        return None
    evidence = Evidence(own[0].line, "a vendor's interfaces, divided like those of USB audio")
    return Claim("audio", BIDIRECTIONAL, "USB audio device", (evidence,), settled=False)


def _directions(device: Device) -> set[str]:
    """p and c: what the card's PCM devices do, as PROBE says it or as the kernel names them."""
    told = " ".join(fact.text for fact in device.of("sound") if fact.key.startswith("pcm"))
    named = {name[-1] for kind, name in device.nodes if kind == "sound" and name.startswith("pcm")}
    return named | ({"p"} if "playback" in told else set()) | ({"c"} if "capture" in told else set())


def _by_interfaces(device: Device) -> set[str]:
    """The direction of a USB device without a driver: one streaming interface carries sound one way only."""
    streaming = [one for one in device.interfaces if one.triple[:2] == (USB_AUDIO, STREAMING)]
    if len(streaming) != 1:
        return set()
    return {"p"} if _MICROPHONES.isdisjoint(naming.words(device.strings)) else {"c"}


def capabilities(directions: set[str]) -> tuple[Capability, ...]:
    """What the directions (p, c) of a card's PCM devices allow."""
    found = []
    if "c" in directions:
        found.append(
            Capability(
                "record_audio", "Record sound for a bounded number of seconds.", "ALSA PCM capture (arecord)", READ
            )
        )
    if "p" in directions:
        found.append(Capability("play_audio", "Play a short sound or a tone.", "ALSA PCM playback (aplay)", ACTUATE))
    return tuple(found)
