"""Install the program of a harness in the version that octoform was tried with, into the cache folder of the user.

npm by itself takes the newest version that fits the node it runs on, so the version is named and read back. The
record that makes a folder count as installed (see `installed`) is written last, after the program has printed its
version at its final place: install scripts that were needed and did not run are found here and not by an agent.
"""

import json
from collections.abc import Mapping
from pathlib import Path

from octoform.base.files import parse, read_plain, replace
from octoform.diagnostics import Diagnostic, error
from octoform.diagnostics.certificates import UNTRUSTED, is_untrusted
from octoform.harness.atomic_install import Setup, Slot, filled
from octoform.harness.containment.agent_environment import certificates
from octoform.harness.node_runtime import Node, at_least, machine_version, obtain, version_of
from octoform.harness.program_location import RECORD, Located, Pin, folder, locate
from octoform.harness.short_command import ShortRun, short_run, stated_version
from octoform.manifest.credentials import masked
from octoform.records import dataclass

NPM_SECONDS = 900.0
REASON_LINES = 12
PACKAGE_BYTES = 1 << 20
REASON_CHARS = 2000
PASSED = ("HOME", "TMPDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME")
PREFIXES = ("npm_config_", "NPM_")
PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY", "ALL_PROXY")
FLAGS = (
    "--no-audit",
    "--no-fund",
    "--no-save",
    "--no-package-lock",
    "--no-update-notifier",
    "--no-progress",
    "--location=project",
    "--engine-strict=false",
    "--omit=dev",
    # Programs that are native come as an optional package for the machine.
    "--include=optional",
    "--loglevel=warn",
)


@dataclass(frozen=True, slots=True)
class Installation:
    """An installed program; ``is_new`` is False when it was there already. ``node`` is None for the machine's."""

    pin: Pin
    home: Path
    program: Path
    node: str | None
    is_new: bool


def home_of(pin: Pin, environ: Mapping[str, str]) -> Path:
    """Where a pinned program lies, installed or not."""
    return folder(environ) / f"{pin.binary}-{pin.version}"


def install(pin: Pin, setup: Setup) -> Installation | Diagnostic:
    """Install it unless it is there and whole; blocks for as long as npm takes, at most 15 minutes.

    ``setup.report`` gets each step for a person. An interruption leaves nothing that counts as installed.
    """
    home = home_of(pin, setup.environ)
    used: list[Node] = []

    def fill(staging: Path) -> Diagnostic | None:
        node = obtain(setup, pin.node)
        if isinstance(node, Diagnostic):
            return node
        used.append(node)
        return _npm(pin, node, staging, setup)

    def seal() -> Diagnostic | None:
        return _seal(pin, used[0], home, setup.environ)

    try:
        problem = filled(Slot(home, lambda: whole(pin, setup.environ), fill, seal), setup.report)
    except OSError as failure:
        return _unwritable(setup.folder, failure)
    if problem is not None:
        return problem
    located = locate(pin, (), setup.environ)
    node = located.path[0] if located is not None and located.path else None
    return Installation(pin, home, _program(home, pin), node, bool(used))


def whole(pin: Pin, environ: Mapping[str, str]) -> bool:
    """True when the pinned program is installed, its file is there, and so is a node that it can run on."""
    located = locate(pin, (), environ)
    if located is None or located.source != "installed" or not Path(located.argv[0]).is_file():
        return False
    if pin.node is None:
        return True
    node = node_version(located, environ)
    return node is not None and at_least(node, pin.node)


def node_version(located: Located, environ: Mapping[str, str]) -> str | None:
    """The version of the node that a located program would run on; None when there is none."""
    own = located.path[0] if located.path else None
    return machine_version(environ) if own is None else version_of(str(Path(own) / "node"), environ)


def _npm(pin: Pin, node: Node, staging: Path, setup: Setup) -> Diagnostic | None:
    """Let npm put the package into ``staging``."""
    setup.report(f"installing {pin.package} {pin.version} with npm on node {node.version}")
    scripts = f"--ignore-scripts={'false' if pin.scripts else 'true'}"
    argv = (*node.npm, "install", "--prefix", str(staging), *FLAGS, scripts, f"{pin.package}@{pin.version}")
    done = short_run(
        argv,
        _environment(node, setup.environ),
        NPM_SECONDS,
        lambda seconds: setup.report(f"npm is at work, {seconds:.0f} s"),
    )
    if not done.ok:
        return _failed(pin, f"npm: {done.ending}", _last_lines(done))
    found = _version_in(staging / "node_modules" / pin.package / "package.json")
    if found != pin.version:
        return _failed(pin, f"npm installed {found or 'nothing'} where {pin.version} was asked for", _last_lines(done))
    return None


def _version_in(package: Path) -> str | None:
    try:
        value = parse(read_plain(package, PACKAGE_BYTES) or b"")
    except ValueError:
        return None
    return str(value["version"]) if isinstance(value, dict) and "version" in value else None


def _environment(node: Node, environ: Mapping[str, str]) -> dict[str, str]:
    """The environment of npm and the install scripts: the person's npm settings, proxies and trusted certificates."""
    names = (*PASSED, *PROXIES, *(name.lower() for name in PROXIES))
    found = certificates(environ)
    found |= {name: value for name, value in environ.items() if name in names or name.startswith(PREFIXES)}
    path = environ.get("PATH", "")
    return found | {"PATH": f"{node.folder}:{path}" if node.folder else path, "LANG": "C.UTF-8", "TERM": "dumb"}


def _seal(pin: Pin, node: Node, home: Path, environ: Mapping[str, str]) -> Diagnostic | None:
    """Start the program once at its final place, and write the record that makes it count."""
    located = Located((str(_program(home, pin)),), "installed", (node.folder,) if node.folder else ())
    stated = stated_version(located, environ)
    if stated.version is None:
        return _failed(pin, f"{pin.binary} --version: {stated.problem}", None)
    record = {
        "format": 1,
        "package": pin.package,
        "version": pin.version,
        "node": node.folder if pin.node is not None else None,
    }
    replace(home / RECORD, json.dumps(record, indent=1).encode() + b"\n", 0o644)
    return None


def _program(home: Path, pin: Pin) -> Path:
    return home / "node_modules" / ".bin" / pin.binary


def _last_lines(done: ShortRun) -> str:
    """The end of npm's output, without credentials."""
    lines = [line.rstrip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    return masked("\n".join(lines[-REASON_LINES:]))[-REASON_CHARS:]


def _failed(pin: Pin, reason: str, detail: str | None) -> Diagnostic:
    hint = UNTRUSTED if detail and is_untrusted(detail) else "put the reason right"
    return error(
        "HARNESS-INSTALL-FAILED",
        f"{pin.binary} {pin.version} could not be installed: {reason}",
        detail=detail or None,
        hint=f"what was there before is as it was; {hint} and install again",
    )


def _unwritable(where: Path, failure: OSError) -> Diagnostic:
    return error(
        "HARNESS-INSTALL-FOLDER",
        f"the folder for agent programs cannot be used: {failure.strerror or failure}",
        path=str(failure.filename or where),
        hint="free some space or give the folder to this user, or name another folder in OCTOFORM_AGENTS",
    )
