"""``install``: the programs of harnesses, in the versions that octoform was tried with.

Most are npm packages and go into a cache folder of the user; ``litellm`` is a Python package and goes into octoform's
own environment, where that is one that may be changed.
"""

import importlib.metadata
import os
import re
import shlex
import sys
import sysconfig
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.environment.packages import packages, reason
from octoform.harness import installed, installing, registry
from octoform.harness.adapters.program import ProgramHarness
from octoform.harness.slots import Setup
from octoform.manifest.model import HarnessSpec

LITELLM = "litellm"
NOTHING = {
    "builtin": "it comes with octoform",
    "command": "it runs a program of your own",
    "replay": "it reads a recorded run",
}
SECONDS = 900.0
_EXTRA = re.compile(r"""^([^;]+);\s*extra\s*==\s*['"]litellm['"]\s*$""")


@dataclass(frozen=True, slots=True)
class Installed:
    """One harness that can be used; ``state`` is ``installed``, ``present`` (was there) or ``nothing`` (to install)."""

    harness: str
    state: str
    detail: str
    version: str | None = None
    program: str | None = None
    node: str | None = None


@dataclass(frozen=True, slots=True)
class InstallResult:
    """What is there now, and what could not be installed."""

    installed: tuple[Installed, ...]
    diagnostics: tuple[Diagnostic, ...]


def install(names: Iterable[str], environ: Mapping[str, str], say: Callable[[str], None]) -> InstallResult:
    """Install each by its name of the manifest; one that fails does not keep the others back."""
    found = [_one(name, environ, say) for name in dict.fromkeys(names)]
    return InstallResult(
        tuple(item for item in found if isinstance(item, Installed)),
        tuple(item for item in found if isinstance(item, Diagnostic)),
    )


def _one(name: str, environ: Mapping[str, str], say: Callable[[str], None]) -> Installed | Diagnostic:
    if name in NOTHING:
        return Installed(name, "nothing", NOTHING[name])
    if name == LITELLM:
        return _litellm(lambda text: say(f"{name}: {text}"))
    harness = registry.resolve(HarnessSpec(name), environ)
    if isinstance(harness, Diagnostic):
        return harness
    if not isinstance(harness, ProgramHarness):
        return Installed(name, "nothing", "it needs no program")
    setup = Setup(installed.folder(environ), environ, _fetch, lambda text: say(f"{name}: {text}"))
    done = installing.install(harness.adapter.pin, setup)
    if isinstance(done, Diagnostic):
        return done
    state = "installed" if done.anew else "present"
    return Installed(name, state, str(done.home), done.pin.version, str(done.program), done.node)


def _fetch(requirement: str, target: Path) -> str | None:
    """One wheel into a folder, from the package cache first; see `slots.Fetch`."""
    arguments = ["pip", "install", "--quiet", "--no-deps", "--only-binary", ":all:", "--python", sys.executable]
    arguments += ["--target", str(target), requirement]
    return _uv(arguments, target)


def _uv(arguments: list[str], folder: Path) -> str | None:
    try:
        done = packages([*arguments, "--offline"], folder, SECONDS)
        if done.status != 0:
            done = packages(arguments, folder, SECONDS)
    except FileNotFoundError:
        return "the package tool uv is not installed beside octoform"
    return None if done.status == 0 else reason(done)


def _litellm(say: Callable[[str], None]) -> Installed | Diagnostic:
    """The package that octoform's own extra names."""
    version = _version(LITELLM)
    if version is not None:
        return Installed(LITELLM, "present", sys.prefix, version)
    requirement = _requirement()
    command = ["uv", "pip", "install", "--python", sys.executable, requirement]
    foreign = elsewhere(Path(sys.prefix), requirement)
    if foreign is not None:
        summary = f"litellm belongs into octoform's own environment, {sys.prefix}, which is not octoform's to change"
        return error("HARNESS-INSTALL-FOREIGN", summary, hint=f"run: {foreign}")
    say(f"installing {requirement} into {sys.prefix}")
    with TemporaryDirectory(prefix="octoform-install-") as folder:
        problem = _uv([*command[1:3], "--quiet", *command[3:]], Path(folder))
    if problem is not None:
        summary = f"{requirement} could not be installed"
        return error("HARNESS-INSTALL-FAILED", summary, detail=problem, hint=f"or run yourself: {shlex.join(command)}")
    importlib.invalidate_caches()
    return Installed(LITELLM, "installed", sys.prefix, _version(LITELLM))


def elsewhere(prefix: Path, requirement: str) -> str | None:
    """The command for a person where this environment belongs to another tool or user; None when it may be changed."""
    quoted = shlex.quote(requirement)
    if (prefix / "uv-receipt.toml").exists():
        return f"uv tool install --with {quoted} octoform"
    if (prefix / "pipx_metadata.json").exists():
        return f"pipx inject octoform {quoted}"
    if sys.prefix == sys.base_prefix or not os.access(sysconfig.get_path("purelib"), os.W_OK):
        return f"{shlex.quote(sys.executable)} -m pip install {quoted}"
    return None


def _requirement() -> str:
    """What octoform's own extra asks for."""
    found = (_EXTRA.match(line) for line in importlib.metadata.requires("octoform") or ())
    return next((item[1].strip() for item in found if item), LITELLM)


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
