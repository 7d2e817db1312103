"""Cameras: USB video class interfaces and Video4Linux capture nodes, kept apart from what else uses the same class.

The kernel gives encoders, decoders, scalers and image processors the same device class as cameras. They are identified
by the words of their names, which drivers take from the function, and by the capability flags that udev records. Radio
receivers have it too; their nodes are called otherwise.
"""

import re
from itertools import takewhile

from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    ACTUATE,
    ACTUATOR,
    BIDIRECTIONAL,
    FLAG,
    INFRASTRUCTURE,
    NUMBER,
    READ,
    SENSOR,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Evidence,
    Facts,
    Kind,
    Schema,
    choice,
    listing,
    number,
    record,
    whole,
)
from octoform.builtin.description.device_evidence import Device
from octoform.patterns import regex

USB_VIDEO = "0e"
_MACHINE_VISION = "ef/05"
_PROCESSORS = (
    "codec enc dec encode decode encoder decoder vpu vdec venc isp rga iep jpeg jpu scaler m2m mem2mem deinterlace "
    "rotator stateless stateful hevc h264 vp8 vp9 av1 mdp csc resizer rkvdec rkvenc coda bdisp g2d "
    "imgu rpivid cedrus hantro vcodec mfc pispbe venus wave5 pxp ge2d"
)
_PROCESSOR_WORDS = frozenset(_PROCESSORS.split())
# Receivers of board cameras, by what drivers and nodes of that kind are called.
_RECEIVER = regex(r"unicam|cfe|csi|isp|vfe|camss|cif|ipu\d|cio2|fimc|vin\b", re.IGNORECASE)
_BOARD_BUSES = frozenset(("platform", "amba", "soc", "pci"))
_V4L2 = "Video4Linux2 (VIDIOC_ENUM_FMT)"
# Drivers put the same words together with a family's letters: image signal processors, encoders, decoders.
_PROCESSOR_PARTS = regex(r"isp\d|isp$|^(?:rk|mtk|imx|sun)\w*(?:isp|vpu|enc|dec)|codec|jpeg|(?:enc|dec)oder$|m2m")
_ON_USB = regex(r"/usb\d+/")
_RADIO_NODES = ("radio", "swradio")
# Chips beside an image sensor, by the families of the kernel's drivers (drivers/media/i2c).
_CHIPS = (
    (regex(r"(?:dw9[78]\d\d|ak73\d\d|ad5820|ad5398|lc8982\d+|gt97\d+|vm149c|rt5133)"), "lens", ACTUATOR,
     "lens focus motor"),
    (regex(r"(?:adv7[1-4]\w+|tvp[57]\d+|tw9\d+|tw28\d+|saa71\d+|isl7998\w+|ks0127|vpx3220|ml86v\w+|ov7640)"),
     "capture", SENSOR, "video decoder"),
    (regex(r"(?:tc3587\d+|lt6911\w*|it66\d+)"), "capture", SENSOR, "video capture bridge"),
    (regex(r"(?:max9[26]\d\w*|ds90ub\d+|thp7312)"), "bridge", INFRASTRUCTURE, "camera link"),
)  # fmt: skip


def claim(device: Device) -> Claim | None:
    """A camera, a part of one, a video processor, or nothing of the kind."""
    names = _names(device)
    if vision := device.usb(_MACHINE_VISION):
        evidence = Evidence(vision.line, "USB3 Vision interface")
        return Claim("camera", SENSOR, "USB machine vision camera", (evidence,))
    interface = device.usb(USB_VIDEO)
    if not interface and "video4linux" not in device.classes:
        return None
    if interface:
        evidence = Evidence(interface.line, "USB video class interface")
    else:
        evidence = device.cite("video4linux", "Video4Linux device")
    if device.bus == "video4linux":
        return _side_stream(device, evidence)
    if not interface and _is_radio(device):
        return Claim("radio", BIDIRECTIONAL, "radio receiver", (evidence,), names=names)
    spoken = [name for name, _ in device.names("video4linux", "name")]
    if not interface and _is_processor(device, spoken):
        listed = Capability("list_video_codecs", "List the codings that the processor takes and gives.", _V4L2)
        return Claim("codec", INFRASTRUCTURE, "video processor", (evidence,), (listed,), names)
    if device.bus == "i2c":
        return _chip(device, evidence, names)
    if _is_receiver(device, spoken) and len(_video_nodes(device)) > 1:
        found = _capabilities(device, spoken)
        return Claim("isp", INFRASTRUCTURE, "camera receiver", (evidence,), found, names)
    if not interface and device.bus == "pci" and "media" not in device.classes:
        found = tuple(one for one in _capabilities(device, spoken) if one.name == "capture_image")
        return Claim("capture", SENSOR, "video capture card", (evidence,), found, names)
    noun = "USB camera" if device.bus == "usb" else "camera"
    return Claim("camera", SENSOR, noun, (evidence,), _capabilities(device, spoken), names)


def _side_stream(device: Device, evidence: Evidence) -> Claim:
    """Nodes beside a camera's pictures: PROBE lists such a node apart, since no picture comes out of it."""
    # The second node of a USB camera has the name of the camera, which would be another camera to a reader.
    own = () if _ON_USB.search(device.path) else device.names("video4linux", "name")
    return Claim("video_data", INFRASTRUCTURE, "video metadata node", (evidence,), names=own, settled=False)


def _chip(device: Device, evidence: Evidence, names: tuple[tuple[str, ...], ...]) -> Claim:
    """A part of a board's camera, identified by the family of its driver."""
    for pattern, kind, category, noun in _CHIPS:
        if any(pattern.match(driver) for driver in (*device.drivers, device.text("name"))):
            found = _focus() if kind == "lens" else ()
            return Claim(kind, category, noun, (evidence,), found, names)
    return Claim("camera_sensor", SENSOR, "camera sensor", (evidence,), names=names)


def _focus() -> tuple[Capability, ...]:
    via = "Video4Linux2 control of the lens (V4L2_CID_FOCUS_ABSOLUTE)"
    return (
        Capability("read_focus", "Read the position of the lens, in percent of its way.", via),
        Capability("set_focus", "Move the lens of the camera to a part of its way.", via, ACTUATE),
    )


def _names(device: Device) -> tuple[tuple[str, ...], ...]:
    """The names of the nodes, those of pictures first; several nodes of one board have their common name."""
    nodes = [name for kind, name in device.nodes if kind == "video4linux"]
    facts = [(fact.index < len(nodes) and nodes[fact.index].startswith("video"), fact) for fact in
             device.of("video4linux", "name")]  # fmt: skip
    shown = [(fact.text, fact.line) for ahead in (True, False) for is_video, fact in facts if is_video == ahead]
    pictures = [fact.text for is_video, fact in facts if is_video]
    if device.bus == "usb" or len(set(pictures)) < 2:
        return tuple(shown)
    ends = [text + " " for text in pictures]
    shared = "".join(letters[0] for letters in takewhile(lambda each: len(set(each)) == 1, zip(*ends, strict=False)))
    whole = re.match(r"(.*[^\W_])[\W_]", shared)
    if whole is None or not product_names.is_name(whole[1]):
        return tuple(shown)
    return ((whole[1], shown[0][1]), *shown)


def _is_processor(device: Device, names: list[str]) -> bool:
    found = device.udev_text("ID_V4L_CAPABILITIES")
    if ":capture:" in found and ":video_output:" in found:
        return True
    spoken = set(product_names.words(" ".join([*names, device.name])))
    if {"input", "output"} <= spoken:
        return True  # nodes that take pictures beside nodes that give them
    return not spoken.isdisjoint(_PROCESSOR_WORDS) or any(_PROCESSOR_PARTS.search(word) for word in spoken)


def _is_radio(device: Device) -> bool:
    """True when the only nodes of the class are those of a tuner: nothing there gives a picture."""
    nodes = [name for kind, name in device.nodes if kind == "video4linux"]
    return bool(nodes) and all(name.startswith(_RADIO_NODES) for name in nodes)


def _video_nodes(device: Device) -> list[str]:
    return [name for kind, name in device.nodes if kind == "video4linux" and name.startswith("video")]


def _capabilities(device: Device, names: list[str]) -> tuple[Capability, ...]:
    nodes = [name for kind, name in device.nodes if kind == "video4linux"]
    if "video4linux" not in device.classes or (nodes and not _video_nodes(device)):
        return ()
    parameters = {"video_names": list(dict.fromkeys(names))} if names else {}
    picture = Capability(
        "capture_image",
        "Take one picture with the camera.",
        "Video4Linux2 through OpenCV VideoCapture",
        parameters=parameters,
    )
    formats = Capability(
        "list_camera_formats",
        "List the picture sizes and pixel formats that the camera offers.",
        _V4L2,
        parameters=parameters,
    )
    return (formats,) if _is_receiver(device, names) else (picture, formats)


def _is_receiver(device: Device, names: list[str]) -> bool:
    if device.bus not in _BOARD_BUSES or "media" not in device.classes:
        return False
    return len(_video_nodes(device)) > 1 or any(_RECEIVER.search(name) for name in (*names, *device.drivers))


# Sound cards and USB audio: what can be played or recorded through ALSA's PCM devices.
#
# The direction is read from the PCM devices that the kernel made (their names end in p for playback, c for capture); a
# card without any is a mixer or a MIDI port and gets no capability.

USB_AUDIO = "01"
VENDOR_CLASS, STREAMING, MIDI = "ff", "02", "03"
_PCI_AUDIO = ("0401", "0403")


_CATEGORIES = {frozenset("p"): ACTUATOR, frozenset("c"): SENSOR}
_MICROPHONES = frozenset(("microphone", "microphones", "mic", "recorder", "camera", "webcam"))


def claim_audio(device: Device) -> Claim | None:
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
    """p and c: what the card's PCM devices do, as PROBE reports it or as the kernel names them."""
    text = " ".join(fact.text for fact in device.of("sound") if fact.key.startswith("pcm"))
    named = {name[-1] for kind, name in device.nodes if kind == "sound" and name.startswith("pcm")}
    return named | ({"p"} if "playback" in text else set()) | ({"c"} if "capture" in text else set())


def _by_interfaces(device: Device) -> set[str]:
    """The direction of a USB device without a driver: one streaming interface carries sound one way only."""
    streaming = [one for one in device.interfaces if one.triple[:2] == (USB_AUDIO, STREAMING)]
    if len(streaming) != 1:
        return set()
    return {"p"} if _MICROPHONES.isdisjoint(product_names.words(device.strings)) else {"c"}


def capabilities(directions: set[str]) -> tuple[Capability, ...]:
    """The capabilities by the directions (p, c) of a card's PCM devices."""
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


# Cameras and sound: pictures through Video4Linux2, recordings and tones through ALSA.

FORMAT = record("Format", pixel_format=TEXT, description=TEXT, compressed=FLAG, sizes=listing(TEXT))
FORMATS = record("Formats", device=TEXT, formats=listing(FORMAT))
CODEC = record("Codec", name=TEXT, takes=listing(TEXT), gives=listing(TEXT))
CODECS = record("Codecs", device=TEXT, codecs=listing(CODEC))
PICTURE = record("Picture", width=WHOLE, height=WHOLE, format=TEXT, size_bytes=WHOLE, mean=NUMBER, variance=NUMBER)
FOCUS = record("Focus", device=TEXT, percent=NUMBER, position=WHOLE, minimum=WHOLE, maximum=WHOLE)
PLAYED = record("Played", device=TEXT, seconds=NUMBER, frequency_hz=NUMBER, volume=NUMBER)
RECORDING = record("Recording", seconds=NUMBER, rate_hz=WHOLE, channels=WHOLE, peak=NUMBER, rms=NUMBER)


def _picture(_: Facts) -> dict[str, Schema]:
    return {
        "width": whole("wished width in pixels; the nearest is taken", 16, 8192, 1280),
        "height": whole("wished height in pixels", 16, 8192, 720),
        "format": choice("coding of the picture", "jpeg", "png"),
        "flush": whole("pictures thrown away first, while exposure settles", 0, 60, 5),
    }


def _recording(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("length of the recording in seconds", 0.1, 30, 3),
        "rate_hz": whole("samples per second", 8000, 192000, 16000),
        "channels": whole("1 is mono, 2 is stereo", 1, 2, 1),
    }


def _tone(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("length of the tone in seconds", 0.1, 10, 1),
        "frequency_hz": number("pitch of the tone in Hz", 20, 20000, 440),
        "volume": number("amplitude, as a part of what the device can", 0, 1, 0.2),
    }


def _focus_parameters(_: Facts) -> dict[str, Schema]:
    return {"percent": number("where on its way, in percent", 0, 100)}


KINDS = (
    Kind(
        "capture_image",
        "Take one picture. `mean` and `variance` of its brightness (0 to 255) show a black frame.",
        PICTURE,
        95,
        parameters=_picture,
        units={"width": "px", "height": "px", "flush": "pictures"},
    ),
    Kind("list_camera_formats", "List the pixel formats and picture sizes that the camera offers.", FORMATS, 40),
    Kind(
        "list_video_codecs",
        "List what each part of a video processor takes and gives; one that takes H.264 or the like decodes it.",
        CODECS,
        30,
    ),
    Kind("read_focus", "Read the position of the camera's lens; 0 percent is one end of its way.", FOCUS, 45),
    Kind(
        "set_focus",
        "Move the camera's lens to a part of its way, and read it back. It stays there until it is moved again.",
        FOCUS,
        60,
        "actuate",
        _focus_parameters,
        units={"percent": "%"},
    ),
    Kind(
        "record_audio",
        "Record sound as 16-bit WAV. `peak` and `rms` are parts of full scale; a peak of 0 is silence.",
        RECORDING,
        90,
        parameters=_recording,
        smoke={"seconds": 0.2},
        units={"seconds": "s", "rate_hz": "Hz", "channels": "channels"},
    ),
    Kind(
        "play_audio",
        "Play a sine tone of bounded length and volume.",
        PLAYED,
        85,
        "actuate",
        _tone,
        units={"seconds": "s", "frequency_hz": "Hz", "volume": "of full scale"},
        idempotent=False,
    ),
)
