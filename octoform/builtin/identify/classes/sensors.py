"""Sensors that the kernel reads for us: hardware monitoring, thermal zones, industrial I/O.

A channel is offered only when the kernel has an input for it, with the unit that the kernel's interface documents
(Documentation/ABI/testing: sysfs-class-hwmon, sysfs-class-thermal, sysfs-bus-iio) after scaling. `parameters.channels`
is a list of {channel, label, unit, source, name}: source is hwmon, thermal or iio; name is the sensor's kernel name.
The outputs of digital-to-analog converters are here too, because they share that interface; `parameters.outputs` names
them. Nothing else that has an output is driven: a radio's and a sensor's own belong to what surrounds it.
"""

import re
from collections.abc import Iterable
from typing import Any

from octoform.builtin.identify.evidence import Device, Fact
from octoform.builtin.identify.verdict import ACTUATE, SENSOR, Capability, Claim

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
}
_IIO_UNITS = {"voltage": "V", "current": "A", "power": "W", "resistance": "ohm", "intensity": "", "angl": "rad"}
_DRIVERS = {"smo8800": ("accelerometer", "free-fall sensor"), "hp_accel": ("accelerometer", "free-fall sensor")}
_HWMON_KEY = re.compile(r"^([a-z]+)\d+$")
# Pairs of in-phase and quadrature channels, or a synthesiser: what only radios have.
_RADIO_KEY = re.compile(r"^out_altvoltage|^(?:in|out)_voltage\d+_[iq]$")
_IIO_KEY = re.compile(r"^in_([a-z]+)")
_OUTPUT_KEY = re.compile(r"^out_(?:voltage|current)\d+$")
_LABEL = re.compile(r"\blabel=(.*)$")
# Families of kernel drivers by what they sit in; the words are what the kernel's documentation calls them.
_FAMILIES = (
    (re.compile(r"^(?:coretemp|k\d+temp|zenpower|cpu|soc|via_cputemp|fam15h_power|x86_pkg)"), "processor temperature"),
    (re.compile(r"^(?:amdgpu|nouveau|radeon|i915|xe)$"), "graphics temperature and power"),
    (re.compile(r"^(?:nvme|drivetemp)"), "drive temperature"),
    (re.compile(r"^(?:iwlwifi|ath\d+k|mt7\d+|rtw|brcmfmac)"), "Wi-Fi temperature"),
    (re.compile(r"^(?:acpitz|pch_|thermal|thinkpad|dell_smm|applesmc)"), "system temperature"),
    (re.compile(r"^(?:spd5118|jc42|dimm)"), "memory module temperature"),
    (re.compile(r"^(?:BAT|CMB)\d|^battery"), "battery voltage and current"),
    (re.compile(r"^(?:r8169|e1000|ig[bc]|enp|eno|eth|atlantic|bnxt|mlx)"), "network adapter temperature"),
    (re.compile(r"psu$|^ucsi"), "power supply readings"),
    (re.compile(r"volt"), "supply voltage monitor"),
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
    # The kernel names a monitor after its driver; without a family that says which of many chips, not what it is in.
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
                capability, unit = _IIO.get(found[1], ("", _IIO_UNITS.get(found[1], "")))
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
    """A sensor that its kernel driver tells, though it offers no class of the kernel; nothing otherwise."""
    for driver in sorted(device.drivers & _DRIVERS.keys()):
        kind, noun = _DRIVERS[driver]
        return Claim(kind, SENSOR, noun, (device.cite_key("driver", f"the kernel's {noun} driver"),))
    return None


def _iio_claim(device: Device, kinds: set[str], capabilities: tuple[Capability, ...]) -> Claim:
    evidence = (device.cite("iio", "industrial I/O device"),)
    kind, noun, category = _iio_kind(device, kinds, bool(capabilities))
    names = device.names("iio", "label", "name")
    if kind not in (_ANY_SENSOR, "adc"):  # channels of voltage are found in much that is no converter
        names = tuple((f"{noun} ({name})", line) for name, line in names)
    if kind == "dac":
        capabilities = _outputs(device)
    return Claim(kind, category, noun, evidence, capabilities, names, settled=kind != _ANY_SENSOR)


def _iio_kind(device: Device, kinds: set[str], readable: bool) -> tuple[str, str, str]:
    keys = [fact.key for fact in device.of("iio")]
    if any(_RADIO_KEY.search(key) for key in keys):
        return "sdr", "radio transceiver", "bidirectional"
    if not readable and any(key.startswith("out_") for key in keys):
        return "dac", "digital-to-analog converter", "actuator"
    if {"read_acceleration", "read_angular_velocity"} <= kinds:
        return "imu", "inertial measurement unit", SENSOR
    for name, kind, noun in (
        ("read_acceleration", "accelerometer", "accelerometer"),
        ("read_angular_velocity", "gyroscope", "gyroscope"),
        ("read_magnetic_field", "magnetometer", "magnetometer"),
        ("read_illuminance", "light_sensor", "light sensor"),
        ("read_proximity", "proximity", "proximity sensor"),
        ("read_pressure", "pressure", "pressure sensor"),
        ("read_humidity", "humidity", "humidity sensor"),
    ):
        if name in kinds:
            return kind, noun, SENSOR
    if any("voltage" in key or "current" in key for key in keys):
        return "adc", "analog-to-digital converter", SENSOR
    return (
        ("temperature", "temperature sensor", SENSOR)
        if "read_temperature" in kinds
        else (_ANY_SENSOR, "sensor", SENSOR)
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
