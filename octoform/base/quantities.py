"""What can be measured at all: bounds by unit, which the runtime of a server and the check of an endpoint share.

They are those of physics and of what anybody attaches to a computer, so wide that only a wrong scale, a wrong unit or a
sensor that is not connected is beyond them.
"""

BOUNDS: dict[str, tuple[float, float]] = {
    "degC": (-273.15, 3000.0),
    "degF": (-459.67, 5500.0),
    "K": (0.0, 3300.0),
    "%": (-100.0, 1000.0),
    "rpm": (-500_000.0, 500_000.0),
    "V": (-5000.0, 5000.0),
    "A": (-5000.0, 5000.0),
    "W": (-1e6, 1e6),
    "lux": (0.0, 300_000.0),
    "kPa": (0.0, 1e6),
    "hPa": (0.0, 1e7),
    "m/s^2": (-20_000.0, 20_000.0),
    "rad/s": (-20_000.0, 20_000.0),
    "dBm": (-300.0, 100.0),
}


def is_possible(value: float, unit: str) -> bool:
    """Whether a number can be a measurement in a unit; any number can in a unit that has no bounds here."""
    low, high = BOUNDS.get(unit, (float("-inf"), float("inf")))
    return low <= value <= high
