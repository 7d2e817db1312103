"""Servers that set something else than they were asked for, or round what they read, and right ones beside them.

Each set was written before anybody looked at what the rules say of it, and then stayed.
"""

from typing import Any

from novel_servers import LEVEL, NOW, WRITE, light, sets
from novel_servers import NUMBER as RAW
from server_edits import FILE, adds, all_of, body, read_by, swap, uses
from wrong_interfaces import tool
from wrong_servers import temperature

SHARED = '(folder / "brightness").write_text(str(round(maximum * percent / 100)))'
LAMP = """
class Lamp:
    def __init__(self, folder, maximum):
        self.file, self.maximum = folder / "brightness", maximum

    def shine(self, percent):
        level = round(self.maximum * percent / 100)
        self.file.write_text(str(level))
"""
SEEN = "100 * (level / maximum) ** (1 / 2.2)"


def shown(percent: str) -> str:
    """The body of `read_brightness` that gives this percentage."""
    return (
        "folder = runtime.device(device).path('backlight')\n"
        f"maximum = int((folder / 'max_brightness').read_text())\nlevel = {NOW}\n"
        f"return Lights(device=device, lights=[Light(name='panel', percent={percent}, level=level, maximum=maximum)])"
    )


SERVE_WRONG: dict[str, Any] = {
    f"bent: {name}": case
    for name, case in {
        "half of it": light(sets("round(maximum * percent / 200)")),
        "half of it, by a name": light(f"half = percent / 2\n{sets('round(maximum * half / 100)')}"),
        "double of it": light(sets("min(maximum, round(maximum * percent / 50))")),
        "four fifths of it": light(sets("int(0.8 * maximum * percent / 100)")),
        "half of it, by a function": all_of(
            adds("def scaled(percent, maximum):\n    return round(maximum * percent / 200)"),
            light(sets("scaled(percent, maximum)")),
        ),
        "the square of it": light(sets("round(maximum * (percent / 100) ** 2)")),
        "a tenth more than it": light(sets(f"{LEVEL} + maximum // 10")),
        "a level that no maximum explains": light(sets("round(percent * percent / 100)")),
        "at most half": light(sets("round(maximum * min(percent, 50) / 100)")),
        "at most half, by a test": light(f"if percent > 50:\n    percent = 50\n{WRITE}"),
        "at most half, by a choice": light(
            f"wanted = 50 if percent > 50 else percent\n{sets('round(maximum * wanted / 100)')}"
        ),
        "at most half of the level": light(sets(f"min({LEVEL}, maximum // 2)")),
        "at most a constant level": light(sets(f"min({LEVEL}, 40)")),
        "at least a tenth": light(sets("round(maximum * max(percent, 10) / 100)")),
        "on both sides": light(sets("round(maximum * max(20, min(percent, 80)) / 100)")),
        "at most a named number": all_of(adds("SAFE = 60"), light(sets("round(maximum * min(percent, SAFE) / 100)"))),
        "in steps of ten": light(sets("round(maximum * (percent // 10 * 10) / 100)")),
        "rounded to tens": light(sets("round(maximum * round(percent, -1) / 100)")),
        "half of it, by the function of all lights": swap(SHARED, SHARED.replace("100", "200")),
        "at most half, by the function of all lights": swap(SHARED, SHARED.replace("percent", "min(percent, 50)")),
        "half of it, by an object": all_of(
            adds(LAMP),
            light("Lamp(folder, maximum).shine(percent / 2)"),
        ),
        "half of it, that is logged": all_of(
            uses("logging"),
            light(
                f"half = percent / 2\nlogging.getLogger('lamp').info('%s', half)\n{sets('round(maximum * half / 100)')}"
            ),
        ),
        "half of it, tried again": light(
            f"for left in (2, 1, 0):\n    try:\n        {sets('round(maximum * percent / 200)')}\n        break\n"
            "    except OSError:\n        if not left:\n            raise\n        time.sleep(0.05)"
        ),
        "half of it, into an open file": light(
            "with (folder / 'brightness').open('w') as file:\n    print(round(maximum * percent / 200), file=file)"
        ),
        "put back": light(f"before = {NOW}\n{WRITE}\nlevel = {NOW}\n{sets('before')}", "level"),
        "put back, whatever comes": light(
            f"before = (folder / 'brightness').read_text()\ntry:\n    {WRITE}\n    level = {NOW}\n"
            "finally:\n    (folder / 'brightness').write_text(before)",
            "level",
        ),
        "put back, after a while": light(
            f"before = runtime.read_integer(folder / 'brightness')\n{WRITE}\nlevel = {NOW}\ntime.sleep(0.2)\n"
            "(folder / 'brightness').write_text(str(before))",
            "level",
        ),
        "put out again": light(f"{WRITE}\nlevel = {NOW}\n{sets('0')}", "level"),
    }.items()
}
for name, expression in {
    "to tens": "round({} / 1000, -1)",
    "to ten thousands": "round({}, -4) / 1000",
    "by a division": "{} // 10000 * 10",
    "by an integer": "10 * int({} / 10000)",
    "by a remainder": "(lambda raw: raw - raw % 10000)({}) / 1000",
    "by a fraction": "10 * round({} / 10000)",
    "for each letter": "[10 * (float(letter) - 1 + round({} / 10000)) for letter in '12'][0]",
    "to fives": "5 * round({} / 5000)",
    "to whole degrees": "round({} / 1000)",
    "to whole degrees, by no decimals": "round({} / 1000, 0)",
    "to the degrees below": "{} // 1000",
    "to the degrees below, by a remainder": "divmod(int({}), 1000)[0]",
    "to the integer of it": "int({} / 1000)",
    "to the floor of it": "math.floor({} * 0.001)",
    "to the ceiling of it": "-(-{} // 1000)",
    "to a text without decimals": "float(f'{{{} / 1000:.0f}}')",
    "to the whole of a text": "int(str({} / 1000).split('.')[0])",
    "to thousands first": "int({}) // 1000 * 1000 / 1000",
    "to whole degrees, with a calibration": "0.5 + int({} / 1000)",
}.items():
    SERVE_WRONG[f"coarse: {name}"] = temperature(f"value = 1000 * ({expression.format(RAW)})")
SERVE_WRONG |= {
    "coarse: by a function": temperature(
        f"value = 1000 * whole({RAW})", more="def whole(raw):\n    return raw // 1000"
    ),
    "coarse: by an object": temperature(
        f"value = 1000 * Heat({RAW}).degrees",
        more="class Heat:\n    def __init__(self, raw):\n        self.raw = raw\n\n    @property\n"
        "    def degrees(self):\n        return round(self.raw / 1000)",
    ),
    "coarse: as it is returned": read_by(f"value = {RAW}", "round(value / 1000)"),
    "coarse: by the reader of integers": read_by(f"value = runtime.read_integer({FILE})", "value // 1000"),
    "coarse: by a scale of the runtime": read_by(f"value = runtime.read_number({FILE}, 0.001)", "int(value)"),
}
SERVE_RIGHT: dict[str, Any] = {
    "coarse: exact by a function, whole by the method of its name": temperature(
        f"value = 1000 * degrees({RAW})",
        more="def degrees(raw):\n    return raw / 1000\n\n\n"
        "class Whole(int):\n    def degrees(self):\n        return self // 1000",
    ),
} | {
    f"set: {name}": case
    for name, case in {
        "all of it, by an object": all_of(adds(LAMP), light("Lamp(folder, maximum).shine(percent)")),
        "an object that turns, in both tools": all_of(
            adds(LAMP),
            light("Lamp(folder, maximum).shine(100 - percent)", percent="100 - 100 * level / maximum"),
            body("read_brightness", shown("100 - 100 * level / maximum")),
        ),
        "at least one step": light(sets(f"max(1, {LEVEL})")),
        "at most all": light(sets(f"min(maximum, {LEVEL})")),
        "within the range of its argument": light(sets("round(maximum * max(0, min(percent, 100)) / 100)")),
        "whole percents": light(sets("int(percent) * maximum // 100")),
        "off by its power": light(f"if percent == 0:\n    {sets('4', 'bl_power')}\nelse:\n    {WRITE}"),
        "refused above, and cut there": light(
            f"if percent > 80:\n    raise ToolError('at most 80 percent')\npercent = min(percent, 80)\n{WRITE}"
        ),
        "a flash before it": light(f"{sets('maximum')}\ntime.sleep(0.05)\n{WRITE}"),
        "a guess that is corrected": light(f"{sets('maximum // 2')}\nif {NOW} != {LEVEL}:\n    {WRITE}"),
        "the nearest of a table": all_of(
            adds("TABLE = (0, 10, 30, 100)"),
            light(sets("round(maximum * min(TABLE, key=lambda each: abs(each - percent)) / 100)")),
        ),
        "as the eye sees it": all_of(
            light(sets("round(maximum * (percent / 100) ** 2.2)"), percent=SEEN), body("read_brightness", shown(SEEN))
        ),
        "read as the kernel measures it": all_of(
            light(WRITE),
            body("read_brightness", shown("100 * int((folder / 'actual_brightness').read_text()) / maximum")),
        ),
    }.items()
}
SERVE_RIGHT |= {
    f"fine: {name}": temperature(f"value = 1000 * ({expression.format(RAW)})")
    for name, expression in {
        "a tenth of a degree": "round({} / 1000, 1)",
        "half degrees": "0.5 * round({} / 500)",
        "hundredths, by integers": "{} // 10 / 100",
        "a text with one decimal": "float(f'{{{} / 1000:.1f}}')",
        "what the attribute has": "int({}) / 1000",
        "cut after two decimals": "int({} / 10) / 100",
        "a field of a register": "5 * ((int({}) >> 8) & 15)",
        "of a period": "1000000 / {}",
        "whole, of a period": "9000000 // {}",
    }.items()
}

FILE_OF = "folder / 'brightness'"
PANEL_BEGIN = "class Panel:\n    def __init__(self, folder):\n        self.folder = folder\n\n"


def ways(level: str) -> dict[str, Any]:
    """Setters of this level, each by another way to the attribute."""
    text = f"str({level})"
    own = f"        folder, maximum = self.folder, self.maximum\n        ({FILE_OF}).write_text({text})"
    return {
        "a program that writes": all_of(
            uses("subprocess"),
            light(f"subprocess.run(['tee', str({FILE_OF})], input={text}, text=True, check=True, timeout=5)"),
        ),
        "a program that writes bytes": all_of(
            uses("subprocess"),
            light(
                f"subprocess.run(['tee', {FILE_OF}], input={text}.encode(), stdout=subprocess.DEVNULL, timeout=5, "
                "check=True)"
            ),
        ),
        "a descriptor": all_of(
            uses("os"),
            light(
                f"number = os.open({FILE_OF}, os.O_WRONLY)\ntry:\n    os.write(number, {text}.encode())\n"
                "finally:\n    os.close(number)"
            ),
        ),
        "a file that is flushed": light(
            f"with open({FILE_OF}, 'w') as file:\n    file.write({text})\n    file.flush()"
        ),
        "lines": light(f"with open({FILE_OF}, 'w') as file:\n    file.writelines([{text}])"),
        "a thread": all_of(
            uses("threading"),
            light(
                f"worker = threading.Thread(target=({FILE_OF}).write_text, args=({text},))\n"
                "worker.start()\nworker.join()"
            ),
        ),
        "a pool": all_of(
            uses("concurrent.futures"),
            light(
                "with concurrent.futures.ThreadPoolExecutor(1) as pool:\n"
                f"    pool.submit(({FILE_OF}).write_text, {text}).result()"
            ),
        ),
        "a process of its own": all_of(
            adds("def put(file, text):\n    Path(file).write_text(text)"),
            light(f"runtime.child.call(put, {FILE_OF}, {text})"),
        ),
        "an inherited class": all_of(
            adds(
                "class Lamp:\n    def __init__(self, folder, maximum):\n"
                "        self.folder, self.maximum = folder, maximum\n\n    def shine(self, percent):\n"
                f"        raise NotImplementedError\n\nclass Panel(Lamp):\n    def shine(self, percent):\n{own}"
            ),
            light("Panel(folder, maximum).shine(percent)"),
        ),
        "a method of the class above": all_of(
            adds(
                "class Lamp:\n    def __init__(self, folder):\n        self.folder = folder\n\n"
                f"    def level(self, percent, maximum):\n        return {level}\n\nclass Panel(Lamp):\n"
                "    def __init__(self, folder, maximum):\n        super().__init__(folder)\n"
                "        self.maximum = maximum\n\n    def shine(self, percent):\n"
                "        level = super().level(percent, self.maximum)\n"
                "        (self.folder / 'brightness').write_text(str(level))"
            ),
            light("Panel(folder, maximum).shine(percent)"),
        ),
        "a data class": all_of(
            uses("dataclasses"),
            adds(
                "@dataclasses.dataclass\nclass Panel:\n    folder: Path\n    maximum: int\n\n"
                f"    def shine(self, percent):\n{own}"
            ),
            light("Panel(folder, maximum).shine(percent)"),
        ),
        "a context": all_of(
            adds(
                f"{PANEL_BEGIN}    def __enter__(self):\n        return self\n\n    def __exit__(self, *failure):\n"
                "        pass\n\n    def put(self, level):\n        (self.folder / 'brightness').write_text(str(level))"
            ),
            light(f"with Panel(folder) as panel:\n    panel.put({level})"),
        ),
        "a property and a static method": all_of(
            adds(
                f"{PANEL_BEGIN}    @property\n    def maximum(self):\n"
                "        return int((self.folder / 'max_brightness').read_text())\n\n    @staticmethod\n"
                f"    def level(maximum, percent):\n        return {level}\n\n    def put(self, percent):\n"
                "        level = self.level(self.maximum, percent)\n"
                "        (self.folder / 'brightness').write_text(str(level))"
            ),
            light("Panel(folder).put(percent)"),
        ),
        "an asynchronous function": all_of(
            uses("asyncio"),
            light(f"await asyncio.to_thread(({FILE_OF}).write_text, {text})"),
            swap("def set_brightness(", "async def set_brightness("),
        ),
        "arguments without a number": all_of(
            adds("def put(file, *parts):\n    file.write_text(''.join(parts))"), light(f"put({FILE_OF}, {text})")
        ),
    }


def given(words: str) -> Any:
    """A setter that starts a program with these words."""
    return all_of(uses("subprocess"), light(f"subprocess.run({words}, check=True, timeout=5)"))


SERVE_WRONG |= {f"half of it, by {name}": case for name, case in ways("round(maximum * percent / 200)").items()}
SERVE_WRONG |= {
    f"at most some, by {name}": case for name, case in ways("round(maximum * min(percent, 60) / 100)").items()
}
SERVE_WRONG |= {
    "put back, by a context": all_of(
        adds(
            f"{PANEL_BEGIN}    def __enter__(self):\n        self.before = (self.folder / 'brightness').read_text()\n"
            "        return self\n\n    def __exit__(self, *failure):\n"
            "        (self.folder / 'brightness').write_text(self.before)\n\n    def put(self, level):\n"
            "        (self.folder / 'brightness').write_text(str(level))"
        ),
        light(f"with Panel(folder) as panel:\n    panel.put({LEVEL})\n    level = {NOW}", "level"),
    ),
    "a program is given half of it": given("['brightnessctl', 'set', f'{percent / 2:.0f}%']"),
    "a program is given at most half": given("['brightnessctl', 'set', f'{min(percent, 50):.0f}%']"),
    "a program is given at most some level": given("['ddcutil', 'setvcp', '10', str(min(round(percent), 50))]"),
    "a program is given what is left": given("['brightnessctl', 'set', f'{100 - percent:.0f}%']"),
}
SERVE_RIGHT |= {f"all of it, by {name}": case for name, case in ways("round(maximum * percent / 100)").items()}
SERVE_RIGHT |= {
    "a program is given all of it": given("['brightnessctl', 'set', f'{percent:.0f}%']"),
    "a program is given the level": given("['ddcutil', 'setvcp', '10', str(round(percent))]"),
    "a program is given a fraction": given("['xrandr', '--brightness', f'{percent / 100:.2f}']"),
    "a program switches": given("['ddcutil', 'setvcp', '10', str(100 if percent > 50 else 0)]"),
    "a program is given steps of the maximum": given("['brightnessctl', 'set', str(round(maximum * percent / 100))]"),
}

CRITICAL, SECOND, ZEROTH = (FILE.replace("temp1_input", name) for name in ("temp1_crit", "temp2_input", "temp0_input"))
LAMPS = "folder = runtime.device(device).path('backlight')\nmaximum = int((folder / 'max_brightness').read_text())\n"
SERVE_WRONG |= {
    f"scale: {name}": case
    for name, case in {
        "millidegrees as degrees": read_by(f"value = {RAW}", "value"),
        "a tenth of it": read_by(f"value = {RAW}", "value / 10000"),
        "ten times it": read_by(f"value = {RAW}", "value / 100"),
        "Fahrenheit as Celsius": read_by(f"value = {RAW}", "value / 1000 * 9 / 5 + 32"),
        "kelvin as Celsius": read_by(f"value = {RAW}", "value / 1000 + 273.15"),
        "without its sign": read_by(f"value = {RAW}", "abs(value) / 1000"),
        "as an unsigned number": read_by(f"value = int(({FILE}).read_text()) & 0xffff"),
        "the sum of three": read_by(f"value = sum({RAW} for _ in range(3))"),
        "a mean over the wrong number": read_by(f"values = [{RAW} for _ in range(5)]\nvalue = sum(values) / 3"),
        "the limit instead of the reading": read_by(f"value = float(({CRITICAL}).read_text())"),
        "the next channel": read_by(f"value = float(({SECOND}).read_text())"),
        "a channel counted from zero": read_by(f"value = float(({ZEROTH}).read_text())"),
        "by a scale of the runtime": read_by(f"value = runtime.read_number({FILE}, 0.01)", "value"),
        "level and maximum exchanged": body(
            "read_brightness",
            f"{LAMPS}level = {NOW}\nlamp = Light(name='panel', percent=100 * level / maximum, level=maximum, "
            "maximum=level)\nreturn Lights(device=device, lights=[lamp])",
        ),
        "the level as maximum": body(
            "read_brightness",
            f"{LAMPS}level = {NOW}\nlamp = Light(name='panel', percent=100 * level / maximum, level=level, "
            "maximum=level)\nreturn Lights(device=device, lights=[lamp])",
        ),
    }.items()
}
SERVE_RIGHT |= {
    f"scale: {name}": case
    for name, case in {
        "decimals": read_by(f"import decimal\nvalue = float(decimal.Decimal(({FILE}).read_text().strip()))"),
        "a scale of the runtime": read_by(
            f"value = runtime.read_number({FILE}, scale=0.001)\nif value is None:\n    raise ToolError('no reading')",
            "value",
        ),
        "a mean of three": read_by(f"import statistics\nvalue = statistics.fmean({RAW} for _ in range(3))"),
        "a mean by hand": read_by(f"values = [{RAW} for _ in range(4)]\nvalue = sum(values) / 4"),
        "a mean by its length": read_by(f"values = [{RAW} for _ in range(4)]\nvalue = sum(values) / len(values)"),
        "the largest of three": read_by(f"value = max({RAW} for _ in range(3))"),
        "as bytes": read_by(f"with open({FILE}, 'rb') as file:\n    value = int(file.read())"),
        "signed, of a word": read_by(f"raw = int(({FILE}).read_text())\nvalue = raw - 65536 if raw > 32767 else raw"),
        "rounded to a tenth": read_by(f"value = {RAW}", "round(value / 1000, 1)"),
        "a calibration": read_by(f"value = 1.02 * {RAW} - 800"),
        "sorted, the middle one": read_by(f"values = [{RAW} for _ in range(3)]\nvalues.sort()\nvalue = values[1]"),
        "by an object of the file": all_of(
            adds(
                "class Sensor:\n    def __init__(self, folder):\n        self.folder = folder\n\n    @property\n"
                "    def celsius(self):\n        return int((self.folder / 'temp1_input').read_text()) / 1000"
            ),
            read_by("value = Sensor(runtime.device('hwmon-benchtemp').path('hwmon')).celsius", "value"),
        ),
    }.items()
}


def lit(percent: str = "round(100 * level / maximum, 1)", before: str = LAMPS) -> Any:
    """`read_brightness` with this percentage, after these statements."""
    lamp = f"Light(name='panel', percent={percent}, level=level, maximum=maximum)"
    return body("read_brightness", f"{before}level = {NOW}\nreturn Lights(device=device, lights=[{lamp}])")


def led(value: str, most: str = "maximum") -> Any:
    """`set_led` with this level."""
    return body(
        "set_led",
        "folder = runtime.device(device, actuate=True).path('leds')\n"
        f"maximum = int((folder / 'max_brightness').read_text())\n{sets(value)}\nlevel = {NOW}\n"
        f"lamp = Light(name=led, percent=100 * level / {most}, level=level, maximum=maximum)\n"
        "return Lights(device=device, lights=[lamp])",
    )


FIXED = "folder = runtime.device(device).path('backlight')\nmaximum = 255\n"
TABLE = "STEPS = {{'backlight-panel': 100, 'backlight-panel2': {}}}"
SERVE_WRONG |= {
    f"steps: {name}": case
    for name, case in {
        "ten of a hundred": light(sets("round(percent / 10)")),
        "those of a byte": light(sets("round(255 * percent / 100)")),
        "those of a byte, by a factor": light(sets("int(percent * 2.55)")),
        "those of a byte, in sixteens": light(sets("0xff * int(percent) // 100")),
        "named ones": all_of(adds("STEPS = 4095"), light(sets("round(STEPS * percent / 100)"))),
        "on or off of a hundred": light(sets("1 if percent >= 50 else 0")),
        "by the default of a function": all_of(
            adds("def scaled(percent, maximum=255):\n    return round(maximum * percent / 100)"),
            light(sets("scaled(percent)")),
        ),
        "by a member of an object": all_of(
            adds(
                "class Lamp:\n    def __init__(self, steps=937):\n        self.steps = steps\n\n"
                "    def shine(self, folder, share):\n"
                "        (folder / 'brightness').write_text(f'{self.steps * share:.0f}')"
            ),
            light("Lamp().shine(folder, percent / 100)"),
        ),
        "other ones of the second device": all_of(
            adds(TABLE.format(255)), light(sets("round(STEPS[device] * percent / 100)"))
        ),
        "other ones where it is the second device": light(
            f"top = 100 if device == 'backlight-panel' else 1023\n{sets('round(top * percent / 100)')}"
        ),
        "in both tools": all_of(
            light(sets("round(255 * percent / 100)"), percent="100 * level / 255"), lit("100 * level / 255")
        ),
        "in both tools, by one number": all_of(
            adds("FULL = 1500"),
            light(sets("round(FULL * percent / 100)"), percent="100 * level / FULL"),
            lit("round(100 * level / FULL)"),
        ),
        "of the reading alone": lit("round(100 * level / 255, 1)"),
        "of the reading, as its maximum": lit(before=FIXED),
        "a share for a percentage": lit("level / maximum"),
        "of an LED, as if it had a hundred": led("round(percent)"),
        "of an LED, in tenths": led("round(1000 * percent / 100)"),
    }.items()
}
SERVE_RIGHT |= {
    f"steps: {name}": case
    for name, case in {
        "a hundred, as it has them": light(sets("round(percent)")),
        "a hundred of each": all_of(adds(TABLE.format(100)), light(sets("round(STEPS[device] * percent / 100)"))),
        "a hundred in both tools": all_of(light(sets("round(percent)"), percent="level"), lit("float(level)")),
        "those of a byte, as the LED has them": led("round(255 * percent / 100)", "255"),
        "truncated ones of an LED": led("int(percent * maximum) // 100"),
        "what the kernel measures": lit(
            "round(100 * level / maximum, 1)",
            f"{LAMPS}actual = int((folder / 'actual_brightness').read_text())\n",
        ),
        "rounded up": light(sets("-(-maximum * int(percent) // 100)")),
        "never wholly dark": light(sets("max(1, round(maximum * percent / 100))")),
        "the dark end refused": light(
            f"if percent < 1:\n    raise ToolError('at least one percent')\n{sets('round(maximum * percent / 100)')}"
        ),
        "none where there is no maximum": lit("round(100 * level / maximum, 1) if maximum else 0.0"),
    }.items()
}


def of_value(text: str, **schema: Any) -> tuple[Any, Any]:
    """A temperature by this expression, of which INTERFACE declares this schema."""

    def declares(interface: Any) -> None:
        members = tool(interface, "read_temperature")["output_schema"]["properties"]["readings"]["items"]["properties"]
        members["value"] = schema

    kind = "int" if schema["type"] == "integer" else "float"
    taken = swap('"value": float, "unit"', f'"value": {kind}, "unit"')
    return all_of(taken, read_by(f"value = {RAW}", text)), declares


SERVE_WRONG |= {
    "declared: another bound": of_value("min(85, value / 1000)", type="number", maximum=125),
    "declared: tens of degrees as an integer": of_value("int(value / 10000) * 10", type="integer"),
}
SERVE_RIGHT |= {
    "declared: whole degrees": of_value("round(value / 1000)", type="integer"),
    "declared: steps": of_value("value // 1000", type="number", multipleOf=1),
    "declared: that it is rounded": of_value("value // 1000", type="number", description="rounded to a degree"),
    "declared: its range": of_value("max(-10, min(85, value / 1000))", type="number", minimum=-10, maximum=85),
}
