"""Serving environments as values: where one lies, whether it is whole, whether it is still what was built.

A serving environment is content-addressed by its lock and by the interpreter that carries it, so an environment is
never changed, only made or dropped. Light: no process is started and nothing heavy imported, because every plan
asks whether the environment drifted.
"""

import os
import re
import sys
from pathlib import Path
from typing import Any

from octoform.base.digest import of_value, short
from octoform.base.files import read_json
from octoform.base.shape import fits
from octoform.records import dataclass
from octoform.state.layout import Layout

MARKER = "octoform-complete.json"
_WHOLE = {"digest": str, "lock": str, "distributions": [str], "modules": ([str], None)}
FOLDER_NAME = re.compile(r"[0-9a-f]{12}")
_PIN = re.compile(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;\\]+)", re.MULTILINE)
_DIST_INFO = ".dist-info"


@dataclass(frozen=True, slots=True)
class Environment:
    """A serving environment. ``digest`` is over lock and interpreter; ``lock`` is the digest of the lock's text."""

    python: Path
    digest: str
    path: Path
    lock: str


def locate(layout: Layout, lock_text: str) -> Environment:
    """Where the environment of this lock lies on this machine, built or not."""
    lock = of_value(lock_text)
    carrier = f"{sys.implementation.name}-{sys.version_info.major}.{sys.version_info.minor}"
    digest = of_value({"lock": lock, "python": carrier, "machine": f"{sys.platform}-{os.uname().machine}"})
    path = layout.environments / short(digest)
    return Environment(path / "bin" / "python", digest, path, lock)


def at(path: Path) -> Environment | None:
    """The complete environment in this folder by its marker, or None."""
    marker = _marker(path)
    if marker is None:
        return None
    return Environment(path / "bin" / "python", str(marker["digest"]), path, str(marker["lock"]))


def intact(environment: Environment) -> list[str]:
    """Plain reasons why the environment is not what was built; empty when it is.

    Compares the names and versions of the installed distributions, and the names of their modules, with those
    recorded at build time, so an upgrade or a lost package behind our back is seen; a file edited inside a package
    is not.
    """
    marker = _marker(environment.path)
    if marker is None or marker.get("digest") != environment.digest:
        return ["the serving environment is missing or was never completed"]
    # With the rights that start it: those of the user alone may be fewer.
    if not os.access(environment.python, os.X_OK, effective_ids=os.access in os.supports_effective_ids):
        return ["the interpreter of the serving environment is missing"]
    names = contents(environment.path)
    built = _by_name(marker["distributions"])
    present = _by_name(_distributions(names))
    lost = sorted(set(marker.get("modules") or ()) - set(names))
    reasons = [f"{name} is gone from the serving environment" for name in lost]
    if "modules" in marker and not set(present) - set(built):
        # What was installed is reported by its distribution, not by each of its modules.
        added = {name for name in names if not name.endswith(_DIST_INFO)} - set(marker["modules"] or ())
        reasons += [f"{name} was added to the serving environment" for name in sorted(added)]
    for name in sorted({*built, *present}):
        before, after = built.get(name), present.get(name)
        if before != after:
            reasons.append(_difference(name, before, after))
    if set(present) - set(built):
        reasons += _conflicts(packages_of(environment.path))
    return reasons


def _conflicts(folder: Path) -> list[str]:
    """Check added packages for modules that existed before: the last installed one overwrites the other."""
    from octoform.endpoint.environment.wheel_records import conflicts  # here, since this is the rare case

    return [f"{module} is provided by both {' and '.join(names)}" for module, names in conflicts(folder).items()]


def packages_of(path: Path) -> Path:
    """The folder of an environment that holds its packages."""
    return path / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"


def installed(path: Path) -> list[str]:
    """Names of the ``*.dist-info`` folders (without the ending), sorted; empty when there is no environment."""
    return _distributions(contents(path))


def contents(path: Path) -> list[str]:
    """Every name in the folder that holds the packages, bytecode omitted; empty when there is no environment."""
    try:
        with os.scandir(packages_of(path)) as entries:
            return [entry.name for entry in entries if entry.name != "__pycache__"]
    except OSError:
        return []


def modules(path: Path) -> list[str]:
    """The names in that folder which can be imported or are read at the start, sorted."""
    return sorted(name for name in contents(path) if not name.endswith(_DIST_INFO))


def pins(lock_text: str) -> dict[str, str]:
    """Normalised distribution name to exact version, as the lock states."""
    return {normal(name): version for name, version in _PIN.findall(lock_text)}


def normal(name: str) -> str:
    """A distribution's name in the one form in which two spellings are equal."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _distributions(names: list[str]) -> list[str]:
    return sorted(name.removesuffix(_DIST_INFO) for name in names if name.endswith(_DIST_INFO))


def _difference(name: str, before: str | None, after: str | None) -> str:
    if after is None:
        return f"{name} {before} is gone from the serving environment"
    if before is None:
        return f"{name} {after} was added to the serving environment"
    return f"{name} {before} -> {after} in the serving environment"


def _by_name(distributions: list[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for item in distributions:
        name, _, version = item.partition("-")
        found[normal(name)] = version
    return found


def _marker(path: Path) -> dict[str, Any] | None:
    try:
        value = read_json(path / MARKER)
    except (OSError, ValueError):
        return None
    return value if fits(value, _WHOLE) else None
