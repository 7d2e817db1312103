"""Servers whose readings are numbers of the file, chosen by a test of what was read; and tests that are right.

A comparison makes such a number depend on the device, and shows a caller only on which side of a bound it is.
"""

from server_edits import ASKED, CAMERA, FILE, body, read_by, warm
from wrong_servers import CONSTANT, DEVICE, FLUSH, Case, picture, says, temperature

GOOD = warm("21.5")
GUARDED: dict[str, Case] = {
    "where the device is present": (
        body("read_temperature", f"if {ASKED}.node('hwmon'):\n    {GOOD}\nraise ToolError('away')"),
        DEVICE,
    ),
    "where its folder exists": (
        body("read_temperature", f"if ({FILE}).exists():\n    {GOOD}\nraise ToolError('away')"),
        CONSTANT,
    ),
    "where there is a text": (
        body("read_temperature", f"if runtime.read_text({FILE}):\n    {GOOD}\nraise ToolError('away')"),
        CONSTANT,
    ),
    "where the reading is none": (
        body(
            "read_temperature",
            f"value = runtime.read_number({FILE})\nif value is None:\n    raise ToolError('away')\n{GOOD}",
        ),
        DEVICE,
    ),
    "above a bound or below": (
        temperature(f"raw = runtime.read_number({FILE})\nif raw > 20000:\n    value = 21500\nelse:\n    value = 18000"),
        CONSTANT,
    ),
    "above a bound or below, in one line": (
        temperature(f"raw = runtime.read_number({FILE})\nvalue = 21500 if raw > 20000 else 18000"),
        CONSTANT,
    ),
    "three steps": (
        temperature(
            f"""
            raw = runtime.read_number({FILE})
            if raw > 30000:
                value = 35000
            elif raw > 20000:
                value = 25000
            else:
                value = 15000
            """
        ),
        CONSTANT,
    ),
    "two returns": (
        body(
            "read_temperature",
            f"raw = float(({FILE}).read_text())\nif raw >= 20000:\n    {GOOD}\n{warm('18.0')}",
        ),
        CONSTANT,
    ),
    "two returns of a helper": (
        says(
            "heat(device)",
            more="""
            def heat(name):
                raw = float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
                if raw >= 20000:
                    return 21.5
                return 18.0
            """,
        ),
        CONSTANT,
    ),
    "a table of a comparison": (
        temperature(f"raw = runtime.read_number({FILE})\nvalue = {{True: 21500, False: 18000}}[raw > 20000]"),
        CONSTANT,
    ),
    "a list of a comparison": (
        temperature(f"raw = runtime.read_number({FILE})\nvalue = [18000, 21500][raw > 20000]"),
        CONSTANT,
    ),
    "a product with a comparison": (
        temperature(f"raw = runtime.read_number({FILE})\nvalue = 21500 * (raw > 20000)"),
        CONSTANT,
    ),
    "a sum with a comparison": (
        temperature(f"raw = runtime.read_number({FILE})\nvalue = 18000 + 3500 * bool(raw > 20000)"),
        CONSTANT,
    ),
    "a reading times nothing": (
        temperature(f"raw = runtime.read_number({FILE})\nvalue = raw * 0 + 21500"),
        DEVICE,
    ),
    "a match of a comparison": (
        temperature(
            f"""
            raw = runtime.read_number({FILE})
            match raw > 20000:
                case True:
                    value = 21500
                case _:
                    value = 18000
            """
        ),
        CONSTANT,
    ),
    "the word of a file": (
        temperature(f"word = ({FILE}).read_text().strip()\nvalue = 21500 if word == '42500' else 18000"),
        CONSTANT,
    ),
    "a constant of the module": (
        temperature(f"value = WARM if runtime.read_number({FILE}) > 0 else COLD", more="WARM = 21500\nCOLD = 18000"),
        CONSTANT,
    ),
    "in a row that is put to others": (
        body(
            "read_temperature",
            f"""
            rows = []
            if runtime.read_number({FILE}):
                rows.append(Reading(sensor="benchtemp", channel="temp1", label="board", value=21.5, unit="degC"))
            return Readings(device=device, readings=rows, unreadable=[])
            """,
        ),
        CONSTANT,
    ),
    "a flush of one picture": (
        picture(CAMERA.format("", "camera.read()\n        frame = camera.read()[1]")),
        FLUSH,
    ),
    "a flush of one picture, grabbed": (
        picture(CAMERA.format("", "camera.grab()\n        frame = camera.read()[1]")),
        FLUSH,
    ),
    "a loop of one": (
        picture(CAMERA.format("", "for _ in range(1):\n            camera.read()\n        frame = camera.read()[1]")),
        FLUSH,
    ),
    "a list of one": (picture(CAMERA.format("", "frame = [camera.read()[1] for _ in range(1)][-1]")), FLUSH),
    "a loop over few cameras": (
        picture(CAMERA.format("", "for _ in [0]:\n            frame = camera.read()[1]")),
        FLUSH,
    ),
    "a loop whose number is one": (
        picture(CAMERA.format("", "for _ in range(FRAMES):\n            frame = camera.read()[1]"), "FRAMES = 1"),
        FLUSH,
    ),
    "a flush of one in a helper": (
        picture(
            CAMERA.format("", "settle(camera)\n        frame = camera.read()[1]"),
            "def settle(camera):\n    camera.grab()",
        ),
        FLUSH,
    ),
    "flushed after": (
        picture(CAMERA.format("", "frame = camera.read()[1]\n        for _ in range(5):\n            camera.grab()")),
        FLUSH,
    ),
}
READ = f"raw = runtime.read_number({FILE})\nif raw is None:\n    raise ToolError('no reading')\n"
RIGHT = {
    "nothing where it stands still": read_by(READ + "value = 0.0 if raw == 0 else 60 * raw / 60"),
    "no more than the full scale": read_by(READ + "value = 125000.0 if raw > 125000 else raw"),
    "a return for each case": body(
        "read_temperature", READ + f"if raw < -40000:\n    {warm('-40.0')}\n{warm('raw / 1000')}"
    ),
    "one of two scales": read_by(READ + "scale = 10 if raw < 1000 else 1\nvalue = raw * scale"),
    "a sign that was read": read_by(
        READ + f"sign = -1 if ({FILE}).read_text().startswith('-') else 1\nvalue = abs(raw) * sign"
    ),
    "a table of what was read": read_by(
        READ + "value = next(high for low, high in ((0, 10000), (20000, 30000)) if low <= raw)"
    ),
    "an error beyond a bound": read_by(READ + "if raw > 150000:\n    raise ToolError('no such heat')\nvalue = raw"),
    "a sum of steps": read_by(READ + "value = raw\nif raw > 100000:\n    value -= 100"),
    "frames until one is bright": picture(
        CAMERA.format(
            "",
            "frame = camera.read()[1]\n        until = time.monotonic() + 2\n"
            "        while time.monotonic() < until:\n            frame = camera.read()[1]",
        )
    ),
    "two pictures and a third": picture(
        CAMERA.format("", "camera.read()\n        camera.read()\n        frame = camera.read()[1]")
    ),
    "a flush in a helper": picture(
        CAMERA.format("", "settle(camera)\n        frame = camera.read()[1]"),
        "def settle(camera, frames=5):\n    for _ in range(frames):\n        camera.grab()",
    ),
    "a number of frames by a name": picture(
        CAMERA.format("", "for _ in range(FRAMES):\n            frame = camera.read()[1]"), "FRAMES = 8"
    ),
}
