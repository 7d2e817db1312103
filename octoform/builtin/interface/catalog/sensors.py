"""Measurements: hardware monitoring, thermal zones and industrial I/O give one list of readings each."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, listing, record

READING = record("Reading", sensor=TEXT, channel=TEXT, label=TEXT, value=NUMBER, unit=TEXT)
READINGS = record("Readings", device=TEXT, readings=listing(READING), unreadable=listing(TEXT))
_REST = "Channels that did not answer are named in `unreadable`."


def _kind(name: str, what: str, worth: int = 60) -> Kind:
    return Kind(name, f"Read {what} of every channel that the device has now. {_REST}", READINGS, worth)


KINDS = (
    _kind("read_temperature", "the temperature in degC", 75),
    _kind("read_fan_speed", "the fan speed in rpm", 65),
    _kind("read_voltage", "the voltage in V"),
    _kind("read_current", "the electric current in A"),
    _kind("read_power", "the power in W", 65),
    _kind("read_energy", "the energy counter in J", 50),
    _kind("read_humidity", "the relative humidity in %", 70),
    _kind("read_acceleration", "the acceleration in m/s^2 along each axis", 70),
    _kind("read_angular_velocity", "the angular velocity in rad/s about each axis", 70),
    _kind("read_magnetic_field", "the magnetic field in gauss along each axis", 70),
    _kind("read_illuminance", "the illuminance in lux", 70),
    _kind("read_pressure", "the pressure in kPa", 70),
    _kind("read_proximity", "the proximity (no unit, larger is nearer unless the sensor says otherwise)", 70),
    _kind("read_sensor_channels", "the scaled value", 45),
)
