"""Cameras and sound: pictures through Video4Linux2, recordings and tones through ALSA."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, WHOLE, Schema, choice, listing, number, record, whole

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


def _focus(_: Facts) -> dict[str, Schema]:
    return {"percent": number("where on its way, in percent", 0, 100)}


KINDS = (
    Kind(
        "capture_image",
        "Take one picture. `mean` and `variance` of its brightness (0 to 255) tell a black frame from a picture.",
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
    Kind("read_focus", "Read where the camera's lens stands; 0 percent is one end of its way.", FOCUS, 45),
    Kind(
        "set_focus",
        "Move the camera's lens to a part of its way, and read it back. It stays there until it is moved again.",
        FOCUS,
        60,
        "actuate",
        _focus,
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
