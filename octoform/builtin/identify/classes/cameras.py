"""Cameras: USB video class interfaces and Video4Linux capture nodes, kept apart from what else uses the same class.

The kernel gives encoders, decoders, scalers and image processors the same device class as cameras. They are told by
the words of their names, which drivers take from the function, and by the capability flags that udev records. Radio
receivers have it too; their nodes are called otherwise.
"""

import re

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import BIDIRECTIONAL, INFRASTRUCTURE, SENSOR, Capability, Claim, Evidence

USB_VIDEO = "0e"
_PROCESSORS = (
    "codec enc dec encode decode encoder decoder vpu vdec venc isp rga iep jpeg jpu scaler m2m mem2mem deinterlace "
    "rotator stateless stateful hevc h264 vp8 vp9 av1 mdp csc resizer rkvdec rkvenc coda bdisp g2d "
    "rpivid cedrus hantro vcodec mfc pispbe venus wave5 pxp ge2d"
)
_PROCESSOR_WORDS = frozenset(_PROCESSORS.split())
# Receivers of board cameras, by what drivers and nodes of that kind are called.
_RECEIVER = re.compile(r"unicam|cfe|csi|isp|vfe|camss|cif|ipu\d|cio2|fimc|vin\b", re.IGNORECASE)
_BOARD_BUSES = frozenset(("platform", "amba", "soc", "pci"))
_V4L2 = "Video4Linux2 (VIDIOC_ENUM_FMT)"
# Drivers put the same words together with a family's letters: image signal processors, encoders, decoders.
_PROCESSOR_PARTS = re.compile(r"isp\d|isp$|^(?:rk|mtk|imx|sun)\w*(?:isp|vpu|enc|dec)|codec|jpeg|(?:enc|dec)oder$|m2m")
_RADIO_NODES = ("radio", "swradio")


def claim(device: Device) -> Claim | None:
    """A camera, a video processor, or nothing of the kind."""
    names = device.names("video4linux", "name")
    interface = device.usb(USB_VIDEO)
    if not interface and "video4linux" not in device.classes:
        return None
    if interface:
        evidence = Evidence(interface.line, "USB video class interface")
    else:
        evidence = device.cite("video4linux", "Video4Linux device")
    if not interface and _is_radio(device):
        return Claim("radio", BIDIRECTIONAL, "radio receiver", (evidence,), names=names)
    spoken = [name for name, _ in names]
    if not interface and _is_processor(device, spoken):
        listed = Capability("list_video_codecs", "List the codings that the processor takes and gives.", _V4L2)
        return Claim("codec", INFRASTRUCTURE, "video processor", (evidence,), (listed,), names)
    if device.bus == "i2c":
        return Claim("camera_sensor", SENSOR, "camera sensor", (evidence,), names=names)
    noun = "USB camera" if device.bus == "usb" else "camera"
    return Claim("camera", SENSOR, noun, (evidence,), _capabilities(device, spoken), names)


def _is_processor(device: Device, names: list[str]) -> bool:
    told = device.udev_text("ID_V4L_CAPABILITIES")
    if ":capture:" in told and ":video_output:" in told:
        return True
    spoken = set(naming.words(" ".join([*names, device.name])))
    return not spoken.isdisjoint(_PROCESSOR_WORDS) or any(_PROCESSOR_PARTS.search(word) for word in spoken)


def _is_radio(device: Device) -> bool:
    """True when the only nodes of the class are those of a tuner: nothing there gives a picture."""
    nodes = [name for kind, name in device.nodes if kind == "video4linux"]
    return bool(nodes) and all(name.startswith(_RADIO_NODES) for name in nodes)


def _capabilities(device: Device, names: list[str]) -> tuple[Capability, ...]:
    nodes = [name for kind, name in device.nodes if kind == "video4linux"]
    if "video4linux" not in device.classes or (nodes and not any(name.startswith("video") for name in nodes)):
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
    on_board = device.bus in _BOARD_BUSES and "media" in device.classes
    return on_board and any(_RECEIVER.search(name) for name in (*names, *device.drivers))
