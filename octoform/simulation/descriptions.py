"""Reads the description of a rig: a YAML file with the host around it and each device's numbers.

The one part of the package that needs more than the standard library: a YAML reader. The devices take what it gives
as plain dicts, from wherever they come.
"""

from pathlib import Path
from typing import Any

KINDS = ("servos", "line", "camera")


class RigInvalid(ValueError):
    """No such description, or one that can't be used; the text says which and why."""


def folders() -> tuple[Path, ...]:
    """Where descriptions are shipped: inside the installed package, or at the top of the source tree."""
    here = Path(__file__).parent
    return here / "rigs", here.parents[1] / "profiles" / "rigs"


def names() -> list[str]:
    """The rigs that are shipped."""
    return sorted({path.stem for folder in folders() for path in folder.glob("*.yaml")})


def load(rig: str | Path) -> dict[str, Any]:
    """The description of a shipped rig by its name, or of a file by its path. RigInvalid says what is wrong."""
    from ruamel.yaml import YAML  # heavy, and not needed by the devices
    from ruamel.yaml.error import YAMLError

    path = Path(rig)
    if path.suffix != ".yaml":
        path = next((folder / f"{rig}.yaml" for folder in folders() if (folder / f"{rig}.yaml").is_file()), path)
    try:
        document = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise RigInvalid(
            f"there is no rig {rig}; shipped are {', '.join(names())}; of your own, give the .yaml file"
        ) from None
    except (OSError, UnicodeDecodeError, YAMLError) as problem:
        raise RigInvalid(f"{path}: {problem}") from problem
    return _checked(document, path)


def _checked(document: Any, path: Path) -> dict[str, Any]:
    devices = document.get("devices") if isinstance(document, dict) else None
    if not isinstance(devices, dict) or not devices:
        raise RigInvalid(f"{path}: a rig needs `devices`, a mapping from names to devices")
    for name, device in devices.items():
        if not isinstance(device, dict) or device.get("kind") not in KINDS:
            raise RigInvalid(f"{path}: devices.{name}.kind has to be one of {', '.join(KINDS)}")
        missing = [key for key in ("port", "node", "descriptors") if key not in device]
        if missing:
            raise RigInvalid(f"{path}: devices.{name} has no {missing[0]}")
    return dict(document)
