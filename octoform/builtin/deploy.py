"""DEPLOY of the embedded agent: which exact packages the server needs, and what provides each import.

`stage.run(task)` reads the server's header and its imports, and lets the package tool (uv) choose versions that agree
for this interpreter. It installs nothing: octoform builds the environment, imports the server in it and calls its
tools, which is the better proof.
"""

import ast
import contextlib
import errno
import os
import pwd
import re
import subprocess
import sys
import time
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from uv import find_uv_bin

from octoform.base import shortage
from octoform.base.files import head
from octoform.builtin.task import Profiles, Task, TaskRefused
from octoform.patterns import regex
from octoform.records import dataclass

# What a server's source declares: the dependencies in its header (PEP 723) and the modules that it imports.

_BLOCK = regex(r"(?m)^# /// script\r?\n((?:^#(?: .*)?\r?\n)+?)^# ///\s*$")
_REQUIREMENT = regex(r"^\s*([A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?)\s*(?:\[[^\]]*\]\s*)?([^@/]*)$")
BESIDE = "runtime"


@dataclass(frozen=True, slots=True)
class Script:
    """``requirements`` maps a normalised name to the requirement as written; ``modules`` a top-level module that is
    not of the standard library to whether it is imported only inside functions."""

    python: str
    requirements: dict[str, str]
    standard: tuple[str, ...]
    modules: dict[str, bool]
    uses_runtime: bool


def read_script(text: str) -> Script:
    """The facts of a server; TaskRefused when it is no Python or has no usable header."""
    python, listed = _header(text)
    imports = _imports(text)
    foreign = {name: inside for name, inside in imports.items() if name not in sys.stdlib_module_names}
    return Script(
        python=python,
        requirements={normalised(_name(item)): item for item in listed},
        standard=tuple(sorted(name for name in imports if name in sys.stdlib_module_names)),
        modules={name: inside for name, inside in sorted(foreign.items()) if name != BESIDE},
        uses_runtime=BESIDE in imports,
    )


def normalised(name: str) -> str:
    """A distribution name in the one spelling by which names are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).casefold()


def _header(text: str) -> tuple[str, list[str]]:
    blocks = _BLOCK.findall(text)
    if len(blocks) != 1:
        raise TaskRefused(f"server.py has {len(blocks) or 'no'} script headers, and one is needed")
    try:
        table = tomllib.loads("".join(line[2:] or "\n" for line in blocks[0].splitlines(keepends=True)))
    except tomllib.TOMLDecodeError as problem:
        raise TaskRefused(f"the script header of server.py is not TOML: {problem}") from problem
    listed, python = table.get("dependencies"), table.get("requires-python")
    if not isinstance(listed, list) or not all(isinstance(item, str) for item in listed):
        raise TaskRefused("the script header of server.py has no list of dependencies")
    return python if isinstance(python, str) else "", listed


def _name(requirement: str) -> str:
    match = _REQUIREMENT.match(requirement)
    if match is None:
        raise TaskRefused(f"the dependency {requirement[:80]!r} is no name with a range of versions")
    return match[1]


def _imports(text: str) -> dict[str, bool]:
    """Top-level module to whether all of its imports are inside functions."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError) as problem:
        raise TaskRefused(f"server.py does not compile: {problem}") from problem
    found: dict[str, bool] = {}

    def visit(node: ast.AST, inside: bool) -> None:
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        for name in names:
            top = name.partition(".")[0]
            found[top] = found.get(top, True) and inside
        within = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            visit(child, within)

    visit(tree, inside=False)
    return found


# Which distribution provides a module, and which distributions must not stand side by side.
#
# A module and its distribution are often called differently and no index can be asked by module, so this is knowledge:
# first what the server itself declares, then what the profiles say of their libraries, then a small table of well-known
# differences, then the packages of this interpreter.

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
    from importlib.metadata import packages_distributions  # a third of a start, and few modules come to this

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
            lines.append(
                f"{chosen[0]} was chosen and must not be installed beside {others}: they install the same module"
            )
    return lines, broken


# Asks the package tool (uv) for versions that agree, for this interpreter, in bounded time.
#
# The package cache is asked first and the index second: a host without a network still gets an answer, and one with
# both gets the versions that the environment is then built from. The agent's own home folder is a fresh one, so the
# tool is pointed at the cache and the configuration of the user that it really runs as.

TOTAL_SECONDS = 90.0
_PINNED = regex(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;]+)", re.MULTILINE)
_CREDENTIALS = regex(r"(://)[^/@\s]+@")
_REASON_CHARS = 400


@dataclass(frozen=True, slots=True)
class Resolution:
    """Normalised name to exact version of the whole closure, or why there is none."""

    versions: Mapping[str, str]
    reason: str | None


class Resolver:
    """Resolves several sets of requirements within one bound of time."""

    def __init__(self, seconds: float = TOTAL_SECONDS) -> None:
        """``seconds`` bounds all calls together."""
        self._end = time.monotonic() + seconds

    def resolve(self, requirements: Sequence[str]) -> Resolution:
        """Versions for these requirements; BlockingIOError where the package tool gets no thread."""
        text = "\n".join(sorted(requirements)) + "\n"
        reason = ""
        for extra in (["--offline"], []):
            try:
                done = subprocess.run(
                    [find_uv_bin(), *_ARGUMENTS, "--python", sys.executable, *extra, "-"],
                    input=text,
                    capture_output=True,
                    text=True,
                    errors="replace",
                    timeout=max(self._end - time.monotonic(), 0.1),
                    env=_environment(),
                    check=False,
                )
            except FileNotFoundError:
                return Resolution({}, "the package tool uv is not installed beside this agent")
            except subprocess.TimeoutExpired:
                return Resolution({}, f"no set of versions was found in time; {reason}".rstrip("; "))
            if done.returncode == 0:
                return Resolution({name.lower(): version for name, version in _PINNED.findall(done.stdout)}, None)
            if shortage.printed(done.stderr):
                raise BlockingIOError(errno.EAGAIN, shortage.TEXT)
            reason = _reason(done.stderr)
        return Resolution({}, reason)


_ARGUMENTS = ("pip", "compile", "--quiet", "--no-header", "--no-annotate", "--no-emit-index-url", "--color", "never")


def _environment() -> dict[str, str]:
    """This process's variables with the home folder of the account, where cache and configuration are."""
    found = dict(os.environ)
    # A user id without an account, as containers have them, keeps the home that this process was given.
    with contextlib.suppress(KeyError):
        home = Path(pwd.getpwuid(os.getuid()).pw_dir)
        if home.is_dir():
            found["HOME"] = str(home)
    # The certificates of the system, which a host behind an inspecting proxy has been given.
    for name in ("UV_SYSTEM_CERTS", "UV_NATIVE_TLS"):  # its name today, and before
        found.setdefault(name, "true")
    return found


def _reason(stderr: str) -> str:
    """The tool's own words on one line, bounded and without credentials."""
    text = " ".join(_CREDENTIALS.sub(r"\1***@", stderr).split())
    return text[:_REASON_CHARS] or "the package tool gave no reason"


# The stage: server.py in, the exact direct requirements and the provider of every import out.
#
# A dependency that cannot be had and that only functions import is reported as failed, and the rest goes on: its tool
# fails alone when it is called. One that the top of the file needs makes the whole stage an error.

MAX_BYTES = 1_000_000


def run(task: Task) -> str:
    """Write the DEPLOY artifact; the summary line (``4 requirements, 71 packages``)."""
    if task.input is None:
        raise TaskRefused("stage deploy needs server.py and the task names none")
    try:
        text = head(task.input, MAX_BYTES, follow=True).decode("utf-8")
    except OSError as problem:
        raise TaskRefused(f"cannot read {task.input}: {problem.strerror}") from problem
    except UnicodeDecodeError as problem:
        raise TaskRefused(f"{task.input.name} is not UTF-8") from problem
    artifact, packages = decide(read_script(text), Resolver(), task.profiles)
    task.write(artifact)
    if artifact["status"] == "error":
        return f"no working set: {artifact['error']}"
    direct = len(artifact["requirements"])
    return f"{direct} requirement{'s' * (direct != 1)}, {packages} packages"


def decide(script: Script, resolver: Resolver, profiles: Profiles = ()) -> tuple[dict[str, Any], int]:
    """The artifact, and how many packages the whole closure has."""
    providers = {module: provider(module, script.requirements, profiles) for module in script.modules}
    unknown = [module for module, name in providers.items() if name is None]
    if unknown:
        reason = f"nothing that the header declares is known to provide {', '.join(unknown)}"
        return _artifact(script, providers, error=reason), 0
    found, failed = _resolve(script, providers, resolver)
    if found.reason is not None:
        return _artifact(script, providers, error=found.reason), 0
    lines, broken = conflicts(script.requirements, found.versions)
    error = lines[0] if broken else None
    return _artifact(script, providers, found.versions, failed, lines, error), len(found.versions)


def _resolve(
    script: Script, providers: Mapping[str, str | None], resolver: Resolver
) -> tuple[Resolution, dict[str, str]]:
    """Versions for as much as can be had, and name to reason of what cannot."""
    found = resolver.resolve(list(script.requirements.values()))
    if found.reason is None:
        return found, {}
    needed = {providers[module] for module, inside in script.modules.items() if not inside}
    spare = {providers[module] for module, inside in script.modules.items() if inside} - needed
    kept = {name: item for name, item in script.requirements.items() if name not in spare}
    if len(kept) == len(script.requirements):
        return found, {}
    best, failed = resolver.resolve(list(kept.values())), {}
    for name in sorted(script.requirements.keys() - kept.keys()):
        if best.reason is not None:
            break
        tried = resolver.resolve([*kept.values(), script.requirements[name]])
        if tried.reason is None:
            best, kept = tried, {**kept, name: script.requirements[name]}
        else:
            failed[name] = tried.reason
    return best, failed


def _artifact(
    script: Script,
    providers: Mapping[str, str | None],
    versions: Mapping[str, str] | None = None,
    failed: Mapping[str, str] | None = None,
    lines: list[str] | None = None,
    error: str | None = None,
) -> dict[str, Any]:
    imports = [{"module": name, "provided_by": "python"} for name in script.standard]
    imports += [{"module": name, "provided_by": name_of} for name, name_of in providers.items() if name_of is not None]
    imports += [{"module": "runtime", "provided_by": "runtime"}] if script.uses_runtime else []
    found = versions or {}
    artifact: dict[str, Any] = {
        "format": 1,
        "status": "ok" if error is None else "error",
        "requirements": [
            {"name": name, "version": found[name], "why": _why(name, providers)}
            for name in sorted(script.requirements)
            if name in found
        ],
        "imports": imports,
    }
    if script.python:
        artifact["python"] = script.python
    if error is not None:
        artifact["error"] = error[:2000]
    if failed:
        artifact["deps_failed"] = [{"name": name, "reason": reason[:500]} for name, reason in sorted(failed.items())]
    if lines:
        artifact["conflicts"] = [line[:500] for line in lines]
    return artifact


def _why(name: str, providers: Mapping[str, str | None]) -> str:
    modules = [module for module, found in providers.items() if found == name]
    return f"provides {', '.join(modules)}" if modules else "declared by the server's header"


__all__ = ["run"]
