"""Measurements: hardware monitoring, thermal zones and industrial I/O give one list of readings each."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, listing, maybe, record

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
