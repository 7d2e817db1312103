"""Cameras and sound: pictures through Video4Linux2, recordings and tones through ALSA."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, WHOLE, Schema, choice, listing, number, record, whole

FORMAT = record("Format", pixel_format=TEXT, description=TEXT, compressed=FLAG, sizes=listing(TEXT))
FORMATS = record("Formats", device=TEXT, formats=listing(FORMAT))
PICTURE = record(
    "Picture", device=TEXT, width=WHOLE, height=WHOLE, format=TEXT, size_bytes=WHOLE, mean=NUMBER, variance=NUMBER
)
PLAYED = record("Played", device=TEXT, seconds=NUMBER, frequency_hz=NUMBER, volume=NUMBER)
RECORDING = record("Recording", device=TEXT, seconds=NUMBER, rate_hz=WHOLE, channels=WHOLE, peak=NUMBER, rms=NUMBER)


def _picture(_: Facts) -> dict[str, Schema]:
    return {
        "width": whole("wished width in pixels; the camera gives the nearest it can", 16, 8192, 1280),
        "height": whole("wished height in pixels", 16, 8192, 720),
        "format": choice("coding of the picture", "jpeg", "png"),
        "flush": whole("pictures to throw away first, so that exposure settles", 0, 60, 5),
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


KINDS = (
    Kind(
        "capture_image",
        "Take one picture. The camera is opened for this call and closed again. `mean` and `variance` are of the "
        "brightness (0 to 255): a variance near zero is a picture of one colour, such as a covered lens.",
        PICTURE,
        95,
        parameters=_picture,
        units={"width": "px", "height": "px", "flush": "pictures"},
        idempotent=False,
    ),
    Kind("list_camera_formats", "List the pixel formats and picture sizes that the camera offers.", FORMATS, 40),
    Kind(
        "record_audio",
        "Record sound and give it as WAV (16 bit). `peak` and `rms` are parts of full scale: a peak of 0 is silence.",
        RECORDING,
        90,
        parameters=_recording,
        smoke={"seconds": 0.2},
        units={"seconds": "s", "rate_hz": "Hz", "channels": "channels"},
        idempotent=False,
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
