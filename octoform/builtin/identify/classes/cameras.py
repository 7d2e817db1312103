"""Cameras: USB video class interfaces and Video4Linux capture nodes, kept apart from codecs that use the same class.

The kernel gives encoders, decoders, scalers and image processors the same device class as cameras. They are told by
the words of their names, which drivers take from the function, and by the capability flags that udev records.
"""

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import INFRASTRUCTURE, SENSOR, Capability, Claim, Evidence

USB_VIDEO = "0e"
_PROCESSORS = (
    "codec enc dec encode decode encoder decoder vpu vdec venc isp rga iep jpeg jpu scaler m2m mem2mem deinterlace "
    "rotator stateless stateful hevc h264 vp8 vp9 av1 mdp csc resizer rkvdec rkvenc coda bdisp g2d "
    "rpivid cedrus hantro vcodec mfc pispbe venus wave5 pxp ge2d"
)
_PROCESSOR_WORDS = frozenset(_PROCESSORS.split())


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
    if not interface and _is_processor(device, [name for name, _ in names]):
        return Claim("codec", INFRASTRUCTURE, "video processor", (evidence,), names=names)
    capabilities = _capabilities([name for name, _ in names]) if "video4linux" in device.classes else ()
    return Claim("camera", SENSOR, "USB camera" if device.bus == "usb" else "camera", (evidence,), capabilities, names)


def _is_processor(device: Device, names: list[str]) -> bool:
    told = device.udev_text("ID_V4L_CAPABILITIES")
    if ":capture:" in told and ":video_output:" in told:
        return True
    spoken = set(naming.words(" ".join([*names, device.name])))
    return not spoken.isdisjoint(_PROCESSOR_WORDS)


def _capabilities(names: list[str]) -> tuple[Capability, ...]:
    parameters = {"video_names": list(dict.fromkeys(names))} if names else {}
    return (
        Capability(
            "capture_image",
            "Take one picture with the camera.",
            "Video4Linux2 through OpenCV VideoCapture",
            parameters=parameters,
        ),
        Capability(
            "list_camera_formats",
            "List the picture sizes and pixel formats that the camera offers.",
            "Video4Linux2 (VIDIOC_ENUM_FMT)",
            parameters=parameters,
        ),
    )
