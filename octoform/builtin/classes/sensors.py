"""Sensors that the kernel reads for us: hardware monitoring, thermal zones, industrial I/O.

A channel is offered only when the kernel has an input for it, with the unit that the kernel's interface documents
(Documentation/ABI/testing: sysfs-class-hwmon, sysfs-class-thermal, sysfs-bus-iio) after scaling. `parameters.channels`
is a list of {channel, label, unit, source, name}: source is hwmon, thermal or iio; name is the sensor's kernel name.
The outputs of digital-to-analog converters are here too, because they share that interface; `parameters.outputs` names
them. Nothing else that has an output is driven: a radio's and a sensor's own belong to what surrounds it.
"""

from collections.abc import Iterable
from typing import Any

from octoform.builtin.description.class_model import (
    ACTUATE,
    ACTUATOR,
    BIDIRECTIONAL,
    INFRASTRUCTURE,
    NUMBER,
    SENSOR,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Kind,
    listing,
    maybe,
    record,
)
from octoform.builtin.description.device_evidence import Device, Fact
from octoform.patterns import regex

_HWMON = {
    "temp": ("read_temperature", "degC", "Read the temperature of each channel."),
    "fan": ("read_fan_speed", "rpm", "Read the speed of each fan."),
    "in": ("read_voltage", "V", "Read the voltage of each channel."),
    "curr": ("read_current", "A", "Read the current of each channel."),
    "power": ("read_power", "W", "Read the power of each channel."),
    "energy": ("read_energy", "J", "Read the energy counter of each channel."),
    "humidity": ("read_humidity", "%", "Read the relative humidity of each channel."),
}
_IIO = {
    "accel": ("read_acceleration", "m/s^2"),
    "anglvel": ("read_angular_velocity", "rad/s"),
    "magn": ("read_magnetic_field", "gauss"),
    "illuminance": ("read_illuminance", "lux"),
    "pressure": ("read_pressure", "kPa"),
    "proximity": ("read_proximity", ""),
    "temp": ("read_temperature", "degC"),
    "humidityrelative": ("read_humidity", "%"),
    "angl": ("read_angle", "rad"),
    "rot": ("read_orientation", ""),
    "incli": ("read_inclination", "deg"),
    "gravity": ("read_gravity", "m/s^2"),
    "distance": ("read_distance", "m"),
    "velocity": ("read_velocity", "m/s"),
    "steps": ("read_steps", ""),
    "intensity": ("read_light_intensity", ""),
    "uvindex": ("read_uv_index", ""),
    "concentration": ("read_gas", "%"),
    "massconcentration": ("read_mass_concentration", "ug/m^3"),
    "ph": ("read_ph", ""),
    "electricalconductivity": ("read_conductivity", "S/m"),
    "voltage": ("read_voltage", "V"),
    "current": ("read_current", "A"),
    "power": ("read_power", "W"),
    "energy": ("read_energy", "J"),
    "resistance": ("read_resistance", "ohm"),
    "capacitance": ("read_capacitance", "nF"),
}
# 1-Wire families (the first byte of each chip's number), as the kernel's w1 drivers know them.
_ONE_WIRE = {
    **dict.fromkeys(("10", "22", "28", "3b", "42"), ("temperature", SENSOR, "1-Wire temperature sensor")),
    **dict.fromkeys(("26", "30", "32", "35", "51"), ("battery", SENSOR, "1-Wire battery monitor")),
    "20": ("adc", SENSOR, "1-Wire analog-to-digital converter"),
    "1d": ("counter", SENSOR, "1-Wire counter"),
    **dict.fromkeys(("05", "12", "1f", "29", "3a"), ("gpio", BIDIRECTIONAL, "1-Wire switch")),
    **dict.fromkeys(("09", "0b", "0f", "14", "23", "2d", "43"), ("memory", INFRASTRUCTURE, "1-Wire memory chip")),
    "01": ("security", INFRASTRUCTURE, "1-Wire identification chip"),
}
MAX_NAME = 110
# What an industrial I/O device is called by what it measures; the first that it measures.
_IIO_NOUNS = (
    ("read_acceleration", "accelerometer", "accelerometer"),
    ("read_gravity", "accelerometer", "accelerometer"),
    ("read_angular_velocity", "gyroscope", "gyroscope"),
    ("read_magnetic_field", "magnetometer", "magnetometer"),
    ("read_orientation", "orientation", "orientation sensor"),
    ("read_inclination", "inclinometer", "inclinometer"),
    ("read_angle", "angle", "angle sensor"),
    ("read_gas", "gas", "gas sensor"),
    ("read_mass_concentration", "dust", "particle sensor"),
    ("read_ph", "ph", "pH sensor"),
    ("read_conductivity", "conductivity", "conductivity sensor"),
    ("read_distance", "distance", "distance sensor"),
    ("read_illuminance", "light_sensor", "light sensor"),
    ("read_uv_index", "light_sensor", "ultraviolet light sensor"),
    ("read_proximity", "proximity", "proximity sensor"),
    ("read_pressure", "pressure", "pressure sensor"),
    ("read_humidity", "humidity", "humidity sensor"),
    ("read_light_intensity", "light_sensor", "light sensor"),
    ("read_steps", "steps", "step counter"),
)
_IIO_LAST = (
    ("read_temperature", "temperature", "temperature sensor"),
    ("read_capacitance", "capacitance", "capacitance sensor"),
    ("read_resistance", "resistance", "resistance sensor"),
    ("read_power", "power", "power monitor"),
    ("read_energy", "power", "energy meter"),
    ("read_velocity", "velocity", "velocity sensor"),
)
_ELECTRIC = frozenset(("read_voltage", "read_current", "read_temperature"))
_DRIVERS = {"smo8800": ("accelerometer", "free-fall sensor"), "hp_accel": ("accelerometer", "free-fall sensor")}
_HWMON_KEY = regex(r"^([a-z]+)\d+$")
# Pairs of in-phase and quadrature channels, or a synthesiser: what only radios have.
_RADIO_KEY = regex(r"^out_altvoltage\d*_(?:TX|RX|\w*LO)|^(?:in|out)_voltage\d+_[iq]$")
_IIO_KEY = regex(r"^in_([a-z]+)")
_OUTPUT_KEY = regex(r"^out_(?:voltage|current|resistance)\d+$")
_LABEL = regex(r"\blabel=(.*)$")
# Families of kernel drivers by what they sit in; the words are what the kernel's documentation calls them.
_FAMILIES = (
    (regex(r"^(?:coretemp|k\d+temp|zenpower|cpu|soc|via_cputemp|fam15h_power|x86_pkg)"), "processor temperature"),
    (regex(r"^(?:amdgpu|nouveau|radeon|i915|xe)$"), "graphics temperature and power"),
    (regex(r"^(?:nvme|drivetemp)"), "drive temperature"),
    (regex(r"^(?:iwlwifi|ath\d+k|mt7\d+|rtw|brcmfmac)"), "Wi-Fi temperature"),
    (regex(r"^(?:acpitz|pch_|thermal|thinkpad|dell_smm|applesmc)"), "system temperature"),
    (regex(r"^(?:spd5118|jc42|dimm)"), "memory module temperature"),
    (regex(r"^(?:BAT|CMB)\d|^battery"), "battery voltage and current"),
    (regex(r"^(?:r8169|e1000|ig[bc]|enp|eno|eth|atlantic|bnxt|mlx)"), "network adapter temperature"),
    (regex(r"psu$|^ucsi"), "power supply readings"),
    (regex(r"volt"), "supply voltage monitor"),
)
_ANY_MONITOR, _ANY_SENSOR = "hardware monitor", "iio"


def claim_hwmon(device: Device) -> Claim | None:
    """A hardware monitoring chip or a thermal zone with what can be read from it."""
    capabilities = [*_hwmon(device), *_thermal(device)]
    if not capabilities and "hwmon" not in device.classes:
        return None
    kind = "hwmon" if "hwmon" in device.classes else "thermal"
    sources = list(device.names("hwmon", "name"))
    sources += [(zone.text, zone.line) for zone in _zones(device)]
    names = tuple((f"{_family(name)} ({name})", line) for name, line in sources)
    evidence = (device.cite(kind, "the kernel's monitoring interface"),)
    # The kernel names a monitor after its driver; without a family that gives the chip, not the product around it.
    settled = any(_family(name) != _ANY_MONITOR for name, _ in sources)
    return Claim("hwmon", SENSOR, _ANY_MONITOR, evidence, tuple(capabilities), names, settled)


def claim_iio(device: Device) -> Claim | None:
    """A sensor of the industrial I/O subsystem."""
    # Triggers share the bus with the sensors that they fire; only devices have channels.
    if not any(kind == "iio" and name.startswith("iio:device") for kind, name in device.nodes):
        return None
    kinds: dict[str, list[dict[str, Any]]] = {}
    everything = []
    for group in device.groups("iio"):
        name = group["name"].text if "name" in group else ""
        for fact in group.values():
            if found := _IIO_KEY.match(fact.key):
                capability, unit = _IIO.get(found[1], ("", ""))
                channel = _channel(fact, unit, "iio", name)
                everything.append(channel)
                if capability:
                    kinds.setdefault(capability, []).append(channel)
    capabilities = [
        Capability(name, f"{name.replace('_', ' ').capitalize()} from the sensor's channels.", _VIA["iio"],
                   parameters={"channels": channels})
        for name, channels in kinds.items()
    ]  # fmt: skip
    if everything:
        capabilities.append(
            Capability("read_sensor_channels", "Read every input channel of the sensor.", _VIA["iio"],
                       parameters={"channels": everything})
        )  # fmt: skip
    return _iio_claim(device, set(kinds), tuple(capabilities))


def claim_driver(device: Device) -> Claim | None:
    """A sensor identified by its kernel driver, though it offers no class of the kernel; nothing otherwise."""
    for driver in sorted(device.drivers & _DRIVERS.keys()):
        kind, noun = _DRIVERS[driver]
        return Claim(kind, SENSOR, noun, (device.cite_key("driver", f"the kernel's {noun} driver"),))
    return None


def claim_one_wire(device: Device) -> Claim | None:
    """A chip on a 1-Wire bus by its family; nothing otherwise."""
    if device.bus != "w1" or device.text("family") not in _ONE_WIRE:
        return None
    kind, category, noun = _ONE_WIRE[device.text("family")]
    return Claim(kind, category, noun, (device.cite_key("family", f"the 1-Wire family of a {noun}"),), settled=False)


def _iio_claim(device: Device, kinds: set[str], capabilities: tuple[Capability, ...]) -> Claim:
    kind, noun, category = _iio_kind(device, kinds, bool(capabilities))
    evidence = (device.cite("iio", f"industrial I/O device: {noun}"),)
    names: tuple[tuple[str, ...], ...] = device.names("iio", "label", "name")
    several = list(dict.fromkeys(fact.text for fact in device.of("iio", "name")))
    if len(several) > 1 and kind != "sdr":
        lines = {fact.text: fact.line for fact in device.of("iio", "name")}
        kind, noun = ("sensor_hub", "sensor hub") if category == SENSOR else (kind, noun)
        names = ((", ".join(several)[:MAX_NAME], *lines.values()), *names)
    elif kind not in (_ANY_SENSOR, "adc", "converter"):  # voltages are found in much that is no converter
        names = tuple((f"{noun} ({name})", line) for name, line in names)
    if kind == "sdr":  # what a radio's channels are for, its own program knows
        capabilities = tuple(one for one in capabilities if one.name == "read_sensor_channels")
    if kind in ("dac", "converter"):
        capabilities = (*(capabilities if kind == "converter" else ()), *_outputs(device))
    return Claim(kind, category, noun, evidence, capabilities, names, settled=kind != _ANY_SENSOR)


def _iio_kind(device: Device, kinds: set[str], readable: bool) -> tuple[str, str, str]:
    keys = [fact.key for fact in device.of("iio")]
    gives = [key for key in keys if key.startswith("out_")]
    if any(_RADIO_KEY.search(key) for key in keys):
        return "sdr", "radio transceiver", BIDIRECTIONAL
    if gives and not readable and all(key.startswith("out_altvoltage") for key in gives):
        return "generator", "frequency synthesiser", ACTUATOR
    if gives and not readable and all(key.startswith("out_resistance") for key in gives):
        return "dac", "digital potentiometer", ACTUATOR
    if gives and not readable:
        return "dac", "digital-to-analog converter", ACTUATOR
    if {"read_acceleration", "read_angular_velocity"} <= kinds:
        return "imu", "inertial measurement unit", SENSOR
    for name, kind, noun in _IIO_NOUNS:
        if name in kinds:
            return kind, noun, SENSOR
    if any(key.startswith(("out_voltage", "out_current")) for key in gives) and kinds <= _ELECTRIC:
        return "converter", "analog converter", BIDIRECTIONAL
    if kinds & {"read_voltage", "read_current"}:
        return "adc", "analog-to-digital converter", SENSOR
    return next(
        ((kind, noun, SENSOR) for name, kind, noun in _IIO_LAST if name in kinds), (_ANY_SENSOR, "sensor", SENSOR)
    )


def _outputs(device: Device) -> tuple[Capability, ...]:
    """A converter's outputs that the kernel has in physical units: a raw value and its scale."""
    names = [fact.key for fact in device.of("iio") if _OUTPUT_KEY.match(fact.key) and {"raw", "scale"} <= _parts(fact)]
    if not names:
        return ()
    parameters = {"outputs": names}
    return (
        Capability("read_output_channels", "Read what each output of the converter is set to.", _VIA["iio"],
                   parameters=parameters),
        Capability("set_output_channel", "Set one output of the converter, and read it back.", _VIA["iio"], ACTUATE,
                   parameters),
    )  # fmt: skip


def _parts(fact: Fact) -> set[str]:
    """The attributes that a channel has."""
    return set(fact.text.split(" ")[0].split(","))


def _hwmon(device: Device) -> Iterable[Capability]:
    found: dict[str, list[dict[str, Any]]] = {}
    for group in device.groups("hwmon"):
        name = group["name"].text if "name" in group else ""
        for fact in group.values():
            kind = _HWMON_KEY.match(fact.key)
            if kind and kind[1] in _HWMON and {"input", "average"} & _parts(fact):
                found.setdefault(kind[1], []).append(_channel(fact, _HWMON[kind[1]][1], "hwmon", name))
    for kind_name, channels in found.items():
        capability, _, description = _HWMON[kind_name]
        yield Capability(capability, description, _VIA["hwmon"], parameters={"channels": channels})


def _thermal(device: Device) -> Iterable[Capability]:
    channels = [
        {"channel": "temp", "label": zone.text, "unit": "degC", "source": "thermal", "name": zone.text}
        for zone in _zones(device)
    ]
    if channels:
        description = _HWMON["temp"][2]
        yield Capability("read_temperature", description, _VIA["thermal"], parameters={"channels": channels})


def _zones(device: Device) -> list[Fact]:
    return [
        group["type"]
        for group in device.groups("thermal")
        if "type" in group and "role" in group and group["role"].text == "zone"
    ]


def _channel(fact: Fact, unit: str, source: str, name: str) -> dict[str, Any]:
    label = _LABEL.search(fact.text)
    return {
        "channel": fact.key,
        "label": label[1] if label else fact.key,
        "unit": unit,
        "source": source,
        "name": name,
    }


def _family(name: str) -> str:
    return next((words for pattern, words in _FAMILIES if pattern.search(name)), _ANY_MONITOR)


_VIA = {
    "hwmon": "Linux hwmon class (/sys/class/hwmon)",
    "thermal": "Linux thermal class (/sys/class/thermal)",
    "iio": "Linux industrial I/O (/sys/bus/iio)",
}


# Counters and pulse generators: what the kernel counts can be read; what it pulses is left alone.
#
# A pulse width output of a board drives its own fan, its backlight or its regulator, and nothing shows which one is
# free.

_WIRED = ("i2c", "spi")


def claim_counter(device: Device) -> Claim | None:
    """A counter, a pulse generator, or nothing of the kind."""
    if "counter" in device.classes:
        description = "Read every count of the counter, with its direction where it has one."
        capability = Capability("read_counters", description, "Linux counter subsystem (/sys/bus/counter)")
        return Claim("counter", SENSOR, "counter", (device.cite("counter", "the kernel's counters"),), (capability,))
    if "pwm" in device.classes and device.bus != "virtual":
        evidence, own = device.cite("pwm", "the kernel's PWM class"), device.fact("name")
        names = ((f"PWM controller {own.text}", own.line),) if own and device.bus in _WIRED else ()
        # A chip of its own on a bus is a breakout for others; that of a processor drives the board.
        category = ACTUATOR if names else INFRASTRUCTURE
        return Claim("pwm", category, "PWM controller", (evidence,), names=names)
    return None


# Real-time clocks.


def claim_clock(device: Device) -> Claim | None:
    """A hardware clock, or nothing of the kind."""
    if "rtc" not in device.classes:
        return None
    capability = Capability(
        "read_clock",
        "Read the hardware clock and how far it is from the system's time.",
        "Linux rtc class (/sys/class/rtc)",
    )
    names = tuple((f"real-time clock {name}", line) for name, line in device.names("rtc", "name"))
    evidence = (device.cite("rtc", "the kernel's clock class"),)
    return Claim("rtc", INFRASTRUCTURE, "real-time clock", evidence, (capability,), names)


# Measurements: hardware monitoring, thermal zones and industrial I/O give one list of readings each.

READING = record("Reading", sensor=TEXT, channel=TEXT, label=TEXT, value=NUMBER, unit=TEXT)
READINGS = record("Readings", device=TEXT, readings=listing(READING), unreadable=listing(TEXT))
COUNT = record("Count", counter=TEXT, name=TEXT, count=maybe(WHOLE), direction=maybe(TEXT), function=maybe(TEXT))
COUNTS = record("Counts", device=TEXT, counts=listing(COUNT))


def _kind(name: str, what: str, worth: int = 60) -> Kind:
    return Kind(name, f"Read {what}; channels that did not answer are in `unreadable`.", READINGS, worth)


KINDS = (
    _kind("read_temperature", "every temperature of the device in degC", 75),
    _kind("read_fan_speed", "every fan speed of the device in rpm", 65),
    _kind("read_voltage", "every voltage of the device in V"),
    _kind("read_current", "every electric current of the device in A"),
    _kind("read_power", "every power of the device in W", 65),
    _kind("read_energy", "every energy counter of the device in J", 50),
    _kind("read_humidity", "the relative humidity in percent", 70),
    _kind("read_acceleration", "the acceleration in m/s^2 along each axis", 70),
    _kind("read_angular_velocity", "the angular velocity in rad/s about each axis", 70),
    _kind("read_magnetic_field", "the magnetic field in gauss along each axis", 70),
    _kind("read_illuminance", "the illuminance in lux", 70),
    _kind("read_pressure", "the pressure in kPa", 70),
    _kind("read_proximity", "the proximity, larger when nearer", 70),
    _kind("read_angle", "every angle in rad", 70),
    _kind("read_orientation", "the orientation; a quaternion has four parts", 70),
    _kind("read_inclination", "the inclination in degrees", 70),
    _kind("read_gravity", "the gravity in m/s^2 along each axis", 55),
    _kind("read_distance", "the distance in m", 70),
    _kind("read_velocity", "the velocity in m/s", 65),
    _kind("read_steps", "how many steps were counted", 60),
    _kind("read_light_intensity", "the intensity of light, without a unit", 50),
    _kind("read_uv_index", "the ultraviolet index", 65),
    _kind("read_gas", "the concentration of gases in percent", 70),
    _kind("read_mass_concentration", "the mass of particles in ug/m^3", 70),
    _kind("read_ph", "the pH value", 70),
    _kind("read_conductivity", "the electric conductivity in S/m", 70),
    _kind("read_resistance", "every resistance in ohm", 55),
    _kind("read_capacitance", "every capacitance in nF", 60),
    _kind("read_sensor_channels", "the scaled value of every channel of the sensor", 45),
    Kind(
        "read_counters", "Read every count, such as that of a rotary encoder, and which way it went last.", COUNTS, 65
    ),
)


# Real-time clocks.

CLOCK = record("Clock", name=TEXT, since_epoch_s=WHOLE, time=TEXT, drift_s=NUMBER)
CLOCKS = record("Clocks", device=TEXT, clocks=listing(CLOCK))

CLOCK_KINDS = (
    Kind(
        "read_clock",
        "Read the hardware clock, taken as UTC, and how many seconds it is ahead of the system's time (`drift_s`).",
        CLOCKS,
        35,
    ),
)
