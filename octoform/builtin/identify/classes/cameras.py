"""Cameras: USB video class interfaces and Video4Linux capture nodes, kept apart from what else uses the same class.

The kernel gives encoders, decoders, scalers and image processors the same device class as cameras. They are told by
the words of their names, which drivers take from the function, and by the capability flags that udev records. Radio
receivers have it too; their nodes are called otherwise.
"""

import re
from itertools import takewhile

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import (
    ACTUATE,
    ACTUATOR,
    BIDIRECTIONAL,
    INFRASTRUCTURE,
    SENSOR,
    Capability,
    Claim,
    Evidence,
)

USB_VIDEO = "0e"
_MACHINE_VISION = "ef/05"
_PROCESSORS = (
    "codec enc dec encode decode encoder decoder vpu vdec venc isp rga iep jpeg jpu scaler m2m mem2mem deinterlace "
    "rotator stateless stateful hevc h264 vp8 vp9 av1 mdp csc resizer rkvdec rkvenc coda bdisp g2d "
    "imgu rpivid cedrus hantro vcodec mfc pispbe venus wave5 pxp ge2d"
)
_PROCESSOR_WORDS = frozenset(_PROCESSORS.split())
# Receivers of board cameras, by what drivers and nodes of that kind are called.
_RECEIVER = re.compile(r"unicam|cfe|csi|isp|vfe|camss|cif|ipu\d|cio2|fimc|vin\b", re.IGNORECASE)
_BOARD_BUSES = frozenset(("platform", "amba", "soc", "pci"))
_V4L2 = "Video4Linux2 (VIDIOC_ENUM_FMT)"
# Drivers put the same words together with a family's letters: image signal processors, encoders, decoders.
_PROCESSOR_PARTS = re.compile(r"isp\d|isp$|^(?:rk|mtk|imx|sun)\w*(?:isp|vpu|enc|dec)|codec|jpeg|(?:enc|dec)oder$|m2m")
_ON_USB = re.compile(r"/usb\d+/")
_RADIO_NODES = ("radio", "swradio")
# Chips beside an image sensor, by the families of the kernel's drivers (drivers/media/i2c).
_CHIPS = (
    (re.compile(r"(?:dw9[78]\d\d|ak73\d\d|ad5820|ad5398|lc8982\d+|gt97\d+|vm149c|rt5133)"), "lens", ACTUATOR,
     "lens focus motor"),
    (re.compile(r"(?:adv7[1-4]\w+|tvp[57]\d+|tw9\d+|tw28\d+|saa71\d+|isl7998\w+|ks0127|vpx3220|ml86v\w+|ov7640)"),
     "capture", SENSOR, "video decoder"),
    (re.compile(r"(?:tc3587\d+|lt6911\w*|it66\d+)"), "capture", SENSOR, "video capture bridge"),
    (re.compile(r"(?:max9[26]\d\w*|ds90ub\d+|thp7312)"), "bridge", INFRASTRUCTURE, "camera link"),
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
    """What accompanies the pictures of a camera: PROBE lists such a node apart, since no picture comes out of it."""
    # The second node of a USB camera has the name of the camera, which would be another camera to a reader.
    own = () if _ON_USB.search(device.path) else device.names("video4linux", "name")
    return Claim("video_data", INFRASTRUCTURE, "video metadata node", (evidence,), names=own, settled=False)


def _chip(device: Device, evidence: Evidence, names: tuple[tuple[str, ...], ...]) -> Claim:
    """A part of a board's camera, told by the family of its driver."""
    for pattern, kind, category, noun in _CHIPS:
        if any(pattern.match(driver) for driver in (*device.drivers, device.text("name"))):
            found = _focus() if kind == "lens" else ()
            return Claim(kind, category, noun, (evidence,), found, names)
    return Claim("camera_sensor", SENSOR, "camera sensor", (evidence,), names=names)


def _focus() -> tuple[Capability, ...]:
    via = "Video4Linux2 control of the lens (V4L2_CID_FOCUS_ABSOLUTE)"
    return (
        Capability("read_focus", "Read where the lens stands, in percent of its way.", via),
        Capability("set_focus", "Move the lens of the camera to a part of its way.", via, ACTUATE),
    )


def _names(device: Device) -> tuple[tuple[str, ...], ...]:
    """What the nodes are called, those of pictures first; several of one board are called by what they share."""
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
    if whole is None or not naming.is_name(whole[1]):
        return tuple(shown)
    return ((whole[1], shown[0][1]), *shown)


def _is_processor(device: Device, names: list[str]) -> bool:
    told = device.udev_text("ID_V4L_CAPABILITIES")
    if ":capture:" in told and ":video_output:" in told:
        return True
    spoken = set(naming.words(" ".join([*names, device.name])))
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
