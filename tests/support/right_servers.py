"""Ways to read a sensor that are right, however unusual: each a text with a function `reads` of a device's id.

``PICTURES`` are ways to take a picture, ``RESULTS`` whole bodies of `read_brightness`.
"""

import textwrap

from server_edits import Edit, adds, all_of, body, uses, warm

MODULES = (
    *(
        "asyncio",
        "concurrent.futures",
        "contextlib",
        "dataclasses",
        "enum",
        "functools",
        "itertools",
        "json",
        "logging",
    ),
    *("operator", "os", "queue", "serial", "statistics", "subprocess", "tempfile", "threading", "typing"),
)
READS: dict[str, str] = {
    "a context manager of its own": """
        @contextlib.contextmanager
        def held(name):
            unit = runtime.device(name)
            with runtime.bus(unit):
                yield unit

        def reads(name):
            with held(name) as unit:
                return runtime.read_number(unit.path("hwmon") / "temp1_input")
        """,
    "a context manager as a class": """
        class Held:
            def __init__(self, name):
                self.unit = runtime.device(name)

            def __enter__(self):
                return self.unit.path("hwmon")

            def __exit__(self, *problem):
                return None

        def reads(name):
            with Held(name) as folder:
                return float((folder / "temp1_input").read_text())
        """,
    "a class hierarchy of drivers": """
        class Driver:
            FILE = "temp1_input"

            def __init__(self, unit):
                self.unit = unit

            def raw(self):
                return (self.unit.path("hwmon") / self.FILE).read_text()

        class Thermometer(Driver):
            def value(self):
                return float(self.raw())

        def reads(name):
            return Thermometer(runtime.device(name)).value()
        """,
    "a table of drivers": """
        class Thermometer:
            def __init__(self, name):
                self.unit = runtime.device(name)

            @property
            def value(self):
                return float((self.unit.path("hwmon") / "temp1_input").read_text())

        DRIVERS = {"hwmon-benchtemp": Thermometer}

        def reads(name):
            return DRIVERS[name](name).value
        """,
    "a computed property": """
        class Sensor:
            def __init__(self, name):
                self._folder = runtime.device(name).path("hwmon")

            @functools.cached_property
            def milli(self):
                return int((self._folder / "temp1_input").read_text())

        def reads(name):
            return Sensor(name).milli
        """,
    "a data class that holds the device": """
        @dataclasses.dataclass(frozen=True)
        class Sensor:
            unit: runtime.Device
            file: str = "temp1_input"

            def value(self):
                return runtime.read_number(self.unit.path("hwmon") / self.file)

        def reads(name):
            return Sensor(runtime.device(name)).value()
        """,
    "a named tuple": """
        class Sample(typing.NamedTuple):
            value: float
            unit: str

        def reads(name):
            sample = Sample(float((runtime.device(name).path("hwmon") / "temp1_input").read_text()), "mdegC")
            return sample.value
        """,
    "an alternative constructor": """
        class Sample:
            def __init__(self, value):
                self.value = value

            @classmethod
            def of(cls, unit):
                return cls(float((unit.path("hwmon") / "temp1_input").read_text()))

        def reads(name):
            return Sample.of(runtime.device(name)).value
        """,
    "an object that is a number": """
        class Heat:
            def __init__(self, name):
                self.file = runtime.device(name).path("hwmon") / "temp1_input"

            def __float__(self):
                return float(self.file.read_text())

        def reads(name):
            return float(Heat(name))
        """,
    "an object that is called": """
        class Read:
            def __init__(self, file):
                self.file = file

            def __call__(self, name):
                return float((runtime.device(name).path("hwmon") / self.file).read_text())

        def reads(name):
            return Read("temp1_input")(name)
        """,
    "a match": """
        def reads(name):
            match runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input"):
                case None:
                    raise ToolError(f"{name} gives no reading now")
                case value:
                    return value
        """,
    "a match on the id": """
        def reads(name):
            match name:
                case "hwmon-benchtemp":
                    file = "temp1_input"
                case _:
                    raise ToolError(f"{name} is no sensor of this server")
            return float((runtime.device(name).path("hwmon") / file).read_text())
        """,
    "an enum": """
        class File(enum.Enum):
            HEAT = "temp1_input"

        def reads(name):
            return float((runtime.device(name).path("hwmon") / File.HEAT.value).read_text())
        """,
    "an enum of ids": """
        class Known(str, enum.Enum):
            SENSOR = "hwmon-benchtemp"

        def reads(name):
            return float((runtime.device(Known(name).value).path("hwmon") / "temp1_input").read_text())
        """,
    "asynchronous waits": """
        async def later(name):
            await asyncio.sleep(0)
            return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())

        def reads(name):
            return asyncio.run(later(name))
        """,
    "a thread": """
        def value(name):
            return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())

        def reads(name):
            with concurrent.futures.ThreadPoolExecutor(1) as pool:
                return pool.submit(value, name).result(timeout=5)
        """,
    "a queue": """
        def reads(name):
            came = queue.Queue()
            came.put(runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input"))
            return came.get(timeout=1)
        """,
    "a thread and a queue": """
        def fill(came, name):
            came.put(float((runtime.device(name).path("hwmon") / "temp1_input").read_text()))

        def reads(name):
            came = queue.Queue()
            threading.Thread(target=fill, args=(came, name), daemon=True).start()
            return came.get(timeout=1)
        """,
    "a generator helper": """
        def samples(name, count):
            for _ in range(count):
                yield float((runtime.device(name).path("hwmon") / "temp1_input").read_text())

        def reads(name):
            return statistics.median(samples(name, 3))
        """,
    "a generator over channels": """
        def channels(folder):
            yield from runtime.files(folder, "temp*_input")

        def reads(name):
            return max(float(path.read_text()) for path in channels(runtime.device(name).path("hwmon")))
        """,
    "tries": """
        def reads(name):
            problem = None
            for _ in range(3):
                try:
                    return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
                except OSError as found:
                    problem = found
                    time.sleep(0.05)
            raise ToolError(f"{name} gave no reading in three tries: {problem}")
        """,
    "tries with an else": """
        def reads(name):
            for left in (2, 1, 0):
                try:
                    value = int((runtime.device(name).path("hwmon") / "temp1_input").read_text())
                except OSError:
                    if not left:
                        raise
                else:
                    break
            return value
        """,
    "a decorator of its own": """
        def tried(function):
            @functools.wraps(function)
            def again(name):
                try:
                    return function(name)
                except OSError:
                    return function(name)

            return again

        @tried
        def reads(name):
            return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
        """,
    "a decorator with arguments": """
        def within(seconds):
            def outer(function):
                def inner(*given, **named):
                    begun = time.monotonic()
                    value = function(*given, **named)
                    if time.monotonic() - begun > seconds:
                        raise ToolError("the sensor was too slow")
                    return value

                return inner

            return outer

        @within(5.0)
        def reads(name):
            return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
        """,
    "a cache of static facts": """
        @functools.lru_cache(maxsize=8)
        def label(name):
            return (runtime.device(name).path("hwmon") / "name").read_text().strip()

        def reads(name):
            logging.getLogger("bench").debug("%s", label(name))
            return float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
        """,
    "a table of static facts": """
        SCALES = {"temp1_input": 1.0}
        UNITS = {"temp1_input": "mdegC"}

        def reads(name):
            value = float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
            return value * SCALES["temp1_input"]
        """,
    "a smoothed reading": """
        LAST = {}

        def reads(name):
            value = float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
            LAST[name] = 0.8 * value + 0.2 * LAST.get(name, value)
            return LAST[name]
        """,
    "a partial": """
        def scaled(name, factor):
            return factor * float((runtime.device(name).path("hwmon") / "temp1_input").read_text())

        plain = functools.partial(scaled, factor=1.0)

        def reads(name):
            return plain(name)
        """,
    "a lambda in a table": """
        WAYS = {"hwmon": lambda unit: float((unit.path("hwmon") / "temp1_input").read_text())}

        def reads(name):
            return WAYS["hwmon"](runtime.device(name))
        """,
    "a map": """
        def reads(name):
            files = runtime.files(runtime.device(name).path("hwmon"), "temp*_input")
            return sum(map(float, map(Path.read_text, files))) / max(len(files), 1)
        """,
    "a reduction": """
        def reads(name):
            files = runtime.files(runtime.device(name).path("hwmon"), "temp*_input")
            return functools.reduce(max, (float(path.read_text()) for path in files))
        """,
    "an item getter": """
        def reads(name):
            rows = list(runtime.channels.hwmon(runtime.device(name), "temp", 1, "mdegC"))
            return max(map(operator.attrgetter("value"), rows))
        """,
    "an assignment expression": """
        def reads(name):
            if (value := runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input")) is None:
                raise ToolError(f"{name} gives no reading now")
            return value
        """,
    "a record that is filled": """
        def reads(name):
            found = {}
            for path in runtime.files(runtime.device(name).path("hwmon"), "temp*_input"):
                found[path.name] = float(path.read_text())
            return found["temp1_input"]
        """,
    "a record filled by a helper": """
        def fill(found, unit):
            found["value"] = float((unit.path("hwmon") / "temp1_input").read_text())

        def reads(name):
            found = {}
            fill(found, runtime.device(name))
            return found["value"]
        """,
    "a list extended": """
        def reads(name):
            values = []
            values.extend(float(path.read_text()) for path in runtime.files(runtime.device(name).path("hwmon"), "t*"))
            return values[0]
        """,
    "a buffer that is filled": """
        def reads(name):
            data = bytearray(16)
            with open(runtime.device(name).path("hwmon") / "temp1_input", "rb", buffering=0) as file:
                size = file.readinto(data)
            return float(data[:size])
        """,
    "a descriptor": """
        def reads(name):
            with runtime.bus(name):
                handle = os.open(runtime.device(name).path("hwmon") / "temp1_input", os.O_RDONLY)
                try:
                    return float(os.read(handle, 32))
                finally:
                    os.close(handle)
        """,
    "a nested function": """
        def reads(name):
            unit = runtime.device(name)

            def value(file):
                return float((unit.path("hwmon") / file).read_text())

            return value("temp1_input")
        """,
    "a nonlocal result": """
        def reads(name):
            found = None

            def take():
                nonlocal found
                found = float((runtime.device(name).path("hwmon") / "temp1_input").read_text())

            take()
            return found
        """,
    "an exit stack": """
        def reads(name):
            with contextlib.ExitStack() as stack:
                stack.enter_context(runtime.bus(name))
                file = stack.enter_context(open(runtime.device(name).path("hwmon") / "temp1_input"))
                return float(file.read())
        """,
    "a suppressed failure with null": """
        def reads(name):
            value = None
            with contextlib.suppress(OSError):
                value = float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
            return value
        """,
    "a failure as null in a helper": """
        def number(path):
            try:
                return float(path.read_text())
            except (OSError, ValueError):
                return None

        def reads(name):
            value = number(runtime.device(name).path("hwmon") / "temp1_input")
            if value is None:
                raise ToolError(f"{name} gives no reading now")
            return value
        """,
    "an average that guards against nothing": """
        def reads(name):
            values = [float(path.read_text()) for path in runtime.files(runtime.device(name).path("hwmon"), "t*_input")]
            if not values:
                raise ToolError(f"{name} has no channel now")
            return sum(values) / len(values)
        """,
    "a share of a maximum that may be nothing": """
        def reads(name):
            folder = runtime.device(name).path("hwmon")
            most, level = runtime.read_number(folder / "temp1_max"), runtime.read_number(folder / "temp1_input")
            if most is None or level is None:
                raise ToolError(f"{name} does not say how hot it may become")
            return 100 * level / most if most else 0.0
        """,
    "words made numbers": """
        def reads(name):
            text = runtime.read_text(runtime.device(name).path("hwmon") / "temp1_alarm")
            if text is None:
                raise ToolError(f"{name} does not say whether it is too hot")
            return 1.0 if text.strip() == "1" else 0.0
        """,
    "a word made a number by a table": """
        LEVELS = {"low": 10.0, "mid": 50.0, "high": 90.0}

        def reads(name):
            return LEVELS[(runtime.device(name).path("hwmon") / "level").read_text().strip()]
        """,
    "a word made a number by branches": """
        def reads(name):
            text = (runtime.device(name).path("hwmon") / "state").read_text().strip()
            if text == "hot":
                level = 2
            elif text == "warm":
                level = 1
            else:
                level = 0
            return level
        """,
    "bits of a register": """
        def reads(name):
            raw = int((runtime.device(name).path("hwmon") / "raw").read_text(), 0)
            value = raw >> 4 & 0xFFF
            return value - 4096 if value & 0x800 else value
        """,
    "a value clamped": """
        def reads(name):
            value = float((runtime.device(name).path("hwmon") / "temp1_input").read_text())
            return max(-40_000.0, min(125_000.0, value))
        """,
    "a program of the system": """
        def reads(name):
            chip = runtime.device(name).path("hwmon").name
            done = subprocess.run(["sensors", "-j", chip], capture_output=True, text=True, timeout=5, check=True)
            return next(iter(json.loads(done.stdout).values()))["temp1"]["temp1_input"] * 1000
        """,
    "a line, asked and heard": """
        def reads(name):
            node = runtime.device(name).node("tty")
            with runtime.bus(name), serial.Serial(node, 9600, timeout=1) as port:
                port.reset_input_buffer()
                port.write(b"T?\\r\\n")
                return float(port.read_until(b"\\n", 32))
        """,
    "a line behind a class": """
        class Line:
            def __init__(self, name):
                self.name, self.node = name, runtime.device(name).node("tty")

            def ask(self, question):
                with runtime.bus(self.name), serial.Serial(self.node, baudrate=9600, timeout=1) as port:
                    port.write(f"{question}?\\n".encode("ascii"))
                    return port.readline().decode("ascii", "replace").strip()

        def reads(name):
            return float(Line(name).ask("TEMP"))
        """,
    "a table of written requests": """
        REQUESTS = {"hwmon-benchtemp": b"TEMP?\\n"}

        def reads(name):
            node = runtime.device(name).node("tty")
            with runtime.bus(name), serial.Serial(node, 9600, timeout=1) as port:
                port.write(REQUESTS[name])
                return float(port.readline())
        """,
    "a library over a line": """
        def reads(name):
            import minimalmodbus

            with runtime.bus(name):
                meter = minimalmodbus.Instrument(runtime.device(name).node("tty"), 1)
                meter.serial.baudrate = 19200
                return meter.read_register(289, 1)
        """,
    "a bus by its node": """
        def reads(name):
            import smbus2

            with runtime.bus(name), smbus2.SMBus(runtime.device(name).node("i2c-dev")) as lines:
                lines.write_byte(0x48, 0)
                high, low = lines.read_i2c_block_data(0x48, 0, 2)
            return (high << 8 | low) / 256 * 1000
        """,
    "a raw report": """
        def reads(name):
            with runtime.bus(name), open(runtime.device(name).node("hidraw"), "r+b", buffering=0) as file:
                file.write(b"\\x00\\x01\\x80\\x33\\x01\\x00\\x00\\x00\\x00")
                answer = file.read(8)
            return float(int.from_bytes(answer[2:4], "big")) * 10
        """,
    "a scratch file": """
        def reads(name):
            with tempfile.TemporaryDirectory() as folder:
                copy = Path(folder) / "value"
                copy.write_text((runtime.device(name).path("hwmon") / "temp1_input").read_text())
                return float(copy.read_text())
        """,
    "all of the devices, and then the one": """
        KNOWN = ("hwmon-benchtemp",)

        def reads(name):
            values = {each: runtime.read_number(runtime.device(each).path("hwmon") / "temp1_input") for each in KNOWN}
            return values[name]
        """,
    "aliases": """
        from runtime import device as find, read_number as number

        def reads(name):
            return number(find(name).path("hwmon") / "temp1_input")
        """,
    "keywords": """
        def reads(name):
            return runtime.read_number(path=runtime.device(device_id=name).path(kind="hwmon") / "temp1_input")
        """,
    "arguments handed on": """
        def ask(*given, **named):
            return runtime.device(*given, **named)

        def reads(name):
            return runtime.read_number(ask(name).path("hwmon") / "temp1_input")
        """,
    "counts of what failed": """
        def reads(name):
            values, failed = [], 0
            for path in runtime.files(runtime.device(name).path("hwmon"), "temp*_input"):
                try:
                    values.append(float(path.read_text()))
                except (OSError, ValueError):
                    failed += 1
            if not values:
                raise ToolError(f"none of {failed} channels answered")
            return max(values)
        """,
    "counts of words": """
        def reads(name):
            seen = {}
            for word in (runtime.device(name).path("hwmon") / "log").read_text().split():
                seen[word] = seen.get(word, 0) + 1
            return float(max(seen.values()))
        """,
    "an offset that may not be there": """
        def reads(name):
            folder = runtime.device(name).path("hwmon")
            value = runtime.read_number(folder / "temp1_input")
            if value is None:
                raise ToolError(f"{name} gives no reading now")
            return value + (runtime.read_number(folder / "temp1_offset") or 0)
        """,
    "a wait with an end": """
        def reads(name):
            until = time.monotonic() + 2
            while True:
                value = runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input")
                if value is not None:
                    return value
                if time.monotonic() > until:
                    raise ToolError(f"{name} gave no reading within 2 s")
                time.sleep(0.05)
        """,
    "a text template": """
        FILE = "temp{}_input"

        def reads(name):
            return float(runtime.device(name).path("hwmon").joinpath(FILE.format(1)).read_text())
        """,
    "words of another language": """
        def reads(name):
            \"\"\"读取温度（毫摄氏度）。\"\"\"
            wert = runtime.read_number(runtime.device(name).path("hwmon") / "temp1_input")
            if wert is None:
                raise ToolError("der Fühler antwortet nicht; ist er angesteckt?")
            return wert
        """,
}
PANEL = 'folder = runtime.device(device).path("backlight")\nlevel = int((folder / "brightness").read_text())\n'
RESULTS: dict[str, str] = {
    "constants that are facts": PANEL + "row = Light(name='panel', percent=level, level=level, maximum=100)\n"
    "return Lights(device=device, lights=[row])",
    "a record by keywords": PANEL + "row = dict(name='panel', percent=level / 1, level=level, maximum=100)\n"
    "return Lights(device=device, lights=[Light(**row)])",
    "a record that grows": PANEL + "row = {'name': folder.name}\nrow['percent'] = level\nrow |= {'level': level}\n"
    "row.update(maximum=100)\nreturn Lights(device=device, lights=[row])",
    "a record unpacked": PANEL + "rest = {'level': level, 'percent': float(level)}\n"
    "return Lights(device=device, lights=[Light(name='panel', maximum=100, **rest)])",
    "off is nothing": PANEL + "percent = 0.0\nif level > 0:\n    percent = 100 * level / 255\n"
    "return Lights(device=device, lights=[Light(name='panel', percent=percent, level=level, maximum=255)])",
    "an empty list where there is none": 'folders = runtime.device(device).paths("backlight")\nif not folders:\n'
    "    return Lights(device=device, lights=[])\nlevel = int((folders[0] / 'brightness').read_text())\n"
    "return Lights(device=device, lights=[Light(name='panel', percent=level, level=level, maximum=100)])",
}


def reading(name: str) -> Edit:
    """The server whose `read_temperature` goes this way."""
    return all_of(
        uses(*MODULES),
        adds(textwrap.dedent(READS[name])),
        body("read_temperature", f"value = reads(device)\n{warm('value / 1000')}"),
    )


def result(name: str) -> Edit:
    """The server whose `read_brightness` has this body."""
    return body("read_brightness", RESULTS[name])
