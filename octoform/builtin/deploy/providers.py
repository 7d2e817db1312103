"""Which distribution provides a module, and which distributions must not stand side by side.

A module and its distribution are often called differently and no index can be asked by module, so this is knowledge:
first what the server itself declares, then what the profiles say of their libraries, then a small table of well-known
differences, then the packages of this interpreter.
"""

from collections.abc import Mapping
from importlib.metadata import packages_distributions

from octoform.builtin.deploy.script import normalised
from octoform.builtin.grammars import Profiles

_KNOWN: Mapping[str, tuple[str, ...]] = {
    "cv2": (
        "opencv-python-headless",
        "opencv-contrib-python-headless",
        "opencv-python",
        "opencv-contrib-python",
    ),
    "PIL": ("pillow",),
    "bleak": ("bleak",),
    "dateutil": ("python-dateutil",),
    "gpiod": ("gpiod",),
    "hid": ("hidapi", "hid"),
    "serial": ("pyserial",),
    "smbus2": ("smbus2",),
    "usb": ("pyusb",),
    "yaml": ("pyyaml",),
    "zmq": ("pyzmq",),
}
_SAME_MODULE = (frozenset(_KNOWN["cv2"]), frozenset(_KNOWN["hid"]))


def provider(module: str, declared: Mapping[str, str], profiles: Profiles = ()) -> str | None:
    """The declared distribution that provides a module, or None when nothing is known."""
    if normalised(module) in declared:
        return normalised(module)
    for name in (*_of_profiles(module, profiles), *_KNOWN.get(module, ())):
        if name in declared:
            return name
    here = {normalised(name) for name in packages_distributions().get(module, ())}
    return next((name for name in declared if name in here), None)


def _of_profiles(module: str, profiles: Profiles) -> list[str]:
    """The distributions that profiles name for a module."""
    banks = [(profile.get("grammar") or {}).get("registers") for profile in profiles]
    return [
        normalised(str(bank["library"]["distribution"]))
        for bank in banks
        if bank and bank["library"]["module"] == module
    ]


def conflicts(declared: Mapping[str, str], closure: Mapping[str, str]) -> tuple[list[str], bool]:
    """Lines about packages that overwrite each other, and whether the set holds two of one kind after all."""
    lines, broken = [], False
    for family in _SAME_MODULE:
        chosen = sorted(family & declared.keys())
        present = sorted(family & closure.keys())
        if len(present) > 1:
            broken = True
            lines.append(f"{' and '.join(present)} install the same module and overwrite each other; only one may stay")
        elif chosen:
            others = ", ".join(sorted(family - set(chosen)))
            lines.append(f"{chosen[0]} was chosen and must not stand beside {others}: they install the same module")
    return lines, broken
