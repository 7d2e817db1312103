"""Build the serving environment of a lock, once, and drop those that no one needs.

An environment is bound to its path, so it is built in place: a marker is written last, and a folder without it is
a build that was cut off and is made again. Only the lock's hashes are installed.
"""

import json
import os
import shutil
import sys
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

from octoform.base import shortage
from octoform.base.files import private_folder, replace
from octoform.base.locks import held
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.bounded_program import ForkServer, base_environment, run
from octoform.endpoint.environment.lockfile import packages, reason, resolve, tool_missing
from octoform.endpoint.environment.model import (
    FOLDER_NAME,
    MARKER,
    Environment,
    at,
    installed,
    intact,
    locate,
    modules,
    normal,
    packages_of,
    pins,
    recorded,
)
from octoform.endpoint.published_files import read_manifest
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

_BYTECODE = "__pycache__"
Built = tuple[Environment | None, tuple[Diagnostic, ...]]


def build(layout: Layout, lock_text: str, timeout: float = 600.0, *, again: bool = False) -> Built:
    """The environment of this lock, built unless a complete and intact one is there; errors as diagnostics.

    ``again`` trusts none that is there: what its names do not show may be broken inside. ``timeout`` is in seconds
    for the installation. Two builds of one lock wait for each other.
    """
    environment = locate(layout, lock_text)
    private_folder(layout.environments)
    with held(layout.environments / f".{environment.path.name}.lock"):
        if not again and not intact(environment):
            return environment, ()
        problem = _make(environment, lock_text, timeout) or _seal(environment, lock_text)
        if problem is None:
            with suppress(OSError):  # what is not shared is compiled when it is imported
                _share_bytecode(layout, environment)
    if problem is not None:
        shutil.rmtree(environment.path, ignore_errors=True)
        return None, (problem,)
    return environment, ()


def prune(layout: Layout, keep: Collection[Path]) -> list[Path]:
    """Drop half-built environments and all complete ones but those to keep; gives what was dropped.

    An environment that someone builds at this moment stays.
    """
    if not layout.environments.is_dir():
        return []
    found = [path for path in sorted(layout.environments.iterdir()) if FOLDER_NAME.fullmatch(path.name)]
    return [path for path in found if path.is_dir() and path not in keep and _drop(path)]


def _drop(path: Path) -> bool:
    """Remove an environment unless someone builds in it right now."""
    lock = path.parent / f".{path.name}.lock"
    with held(lock, 0.0) as mine:
        if not mine:
            return False
        shutil.rmtree(path, ignore_errors=True)
    return not path.exists()


def _make(environment: Environment, lock_text: str, timeout: float) -> Diagnostic | None:
    """Build from nothing; the reason when it did not work."""
    path = environment.path
    shutil.rmtree(path, ignore_errors=True)
    # An endpoint that still runs from it may write its bytecode there meanwhile.
    options = ["--quiet", "--allow-existing", "--no-project", "--no-python-downloads"]
    arguments = [*options, "--python", sys.executable, str(path)]
    try:
        made = packages(["venv", *arguments], path.parent, 60.0)
        if made.status != 0:
            return _failed("the serving environment could not be made", reason(made))
        lock = path / "requirements.txt"
        replace(lock, lock_text.encode(), 0o644, synced=False)
        install = ["pip", "install", "--quiet", "--python", str(environment.python), "--require-hashes", "--no-deps"]
        # From the cache first: with all packages there, no index is asked at all.
        done = packages([*install, "--offline", "-r", str(lock)], path.parent, timeout)
        if done.status != 0:
            done = packages([*install, "-r", str(lock)], path.parent, timeout)
    except FileNotFoundError as problem:
        return tool_missing(problem)
    return None if done.status == 0 else _failed("the locked packages could not be installed", reason(done))


def _share_bytecode(layout: Layout, environment: Environment) -> None:
    """Give it the bytecode of another environment's equal files, which saves two CPU seconds of compiling.

    An environment without an endpoint is dropped when one is published: its folders of bytecode are moved, and only the
    newest still has them. The files of one that serves are linked. Bytecode names the time and size of its source, so
    what does not fit is compiled again; and Python replaces such files, never rewrites them, so a link is safe.
    """
    folders = (path for path in layout.environments.iterdir() if FOLDER_NAME.fullmatch(path.name))
    others = [found for path in folders if path != environment.path and (found := at(path)) is not None]
    others.sort(key=lambda each: (each.path / MARKER).stat().st_mtime_ns, reverse=True)
    donor = next((each for each in others if not intact(each)), None)
    if donor is None:
        return
    manifest = read_manifest(layout) or {}
    serves = str(donor.path) in (manifest.get("environment"), manifest.get("previous_environment"))
    source, target = packages_of(donor.path), packages_of(environment.path)
    equal = _equal(source, target)
    shared: dict[str, set[str]] = {}
    for name in equal:
        folder, _, file = name.rpartition("/")
        if ".." not in folder.split("/"):
            shared.setdefault(folder, set()).add(file)
    for folder in sorted(shared):
        try:
            (_link_files if serves else Path.rename)(source / folder / _BYTECODE, target / folder / _BYTECODE)
        except OSError:  # none there, a package that is not there, or a file system without links
            del shared[folder]
    _give_times(source, target, shared, (donor.path / MARKER).stat().st_mtime_ns)


def _link_files(folder: Path, target: Path) -> None:
    if folder.is_dir():
        target.mkdir()
    for path in folder.iterdir():
        os.link(path, target / path.name)


def _equal(source: Path, target: Path) -> set[str]:
    """The sources that one distribution has in both environments, with the same line in its RECORD."""
    former, present = recorded(source), recorded(target)
    names = Counter(line.partition(",")[0] for line in former & present)
    others = {line.partition(",")[0] for line in former ^ present}
    return {name for name, count in names.items() if count == 1 and name not in others}


def _give_times(source: Path, target: Path, folders: Mapping[str, Set[str]], complete: int) -> None:
    """Give the equal sources in these folders that have bytecode the times of those of another environment.

    Where the package tool's cache lies on another file system, it copies all files, each with a time of its own; else
    they are links, which have one time. What was written again after that environment was ``complete`` is not equal,
    and its bytecode goes.
    """
    for folder, equal in folders.items():
        with os.scandir(target / folder / _BYTECODE) as entries:
            compiled = {entry.path: f"{entry.name.partition('.')[0]}.py" for entry in entries}
        wanted = _times(source / folder, equal & set(compiled.values()))
        with os.scandir(target / folder) as entries:
            for entry in entries:
                if entry.name not in wanted:
                    continue
                copy = entry.stat()
                if copy.st_nlink > 1:
                    return
                if wanted[entry.name] <= complete:
                    os.utime(entry.path, ns=(copy.st_atime_ns, wanted[entry.name]))
                else:  # its time, in seconds, may be that of the copy
                    for path in [path for path, name in compiled.items() if name == entry.name]:
                        Path(path).unlink()


def _times(folder: Path, names: Collection[str]) -> dict[str, int]:
    """When these files of a folder were written, in nanoseconds."""
    with os.scandir(folder) as entries:
        return {entry.name: entry.stat().st_mtime_ns for entry in entries if entry.name in names}


def _seal(environment: Environment, lock_text: str) -> Diagnostic | None:
    """Compare what is there with the lock and write the marker, the last step of a build."""
    present = installed(environment.path)
    names = {normal(item.partition("-")[0]) for item in present}
    missing = sorted(set(pins(lock_text)) - names)
    if missing:
        return _failed("the installation differs from the lock", "missing: " + ", ".join(missing[:10]))
    document = {
        "format": 1,
        "digest": environment.digest,
        "lock": environment.lock,
        "distributions": present,
        "modules": modules(environment.path),
    }
    return write_atomic(environment.path / MARKER, json.dumps(document, indent=1).encode(), 0o600)


def _failed(summary: str, detail: str) -> Diagnostic:
    return error(
        "ENDPOINT-BUILD-FAILED",
        summary,
        detail=detail or None,
        hint="the lock is in state/<host>/deploy/requirements.txt; nothing of the old environment was changed",
    )


# Build the environment that nearly every server needs while the agents still work on the first stages.
#
# The first import of freshly installed packages costs two CPU seconds of compiling, which would otherwise stand at the
# end of a first apply, when a person waits for the endpoint. It is a guess and never more: nothing rests on it, and
# what fails here fails again, and is reported, where it counts.

GUESS = ("fastmcp>=4.1,<4.2",)
"""The packages that every server needs by the SERVE spec; further packages differ from host to host."""
SECONDS = 120.0
COMPILING = ".compiling.lock"
COMPILED_BESIDE = (
    *("pydantic/_internal", "pydantic_settings", "mcp_types", "httpx2", "fastmcp/client", "beartype", "mcp"),
    *("starlette", "uvicorn", "click", "cryptography", "jwt", "joserfc", "fastmcp/server", "fastmcp/tools"),
    *("yaml", "griffe"),
)
"""Folders of packages of which the import of FastMCP needs most files, in the order in which it comes to them."""


@contextmanager
def prewarmed(layout: Layout, requirements: Sequence[str] = GUESS) -> Iterator[None]:
    """Prepare an environment beside the work of the block, unless this host has one; ends with the block.

    The block's end waits for what is under way (bounded), so that nothing is left running.
    """
    if has_environment(layout):
        yield
        return
    worker = Thread(target=_attempt, args=(layout, requirements), name="prewarming")
    try:
        shortage.start(worker)
    except BlockingIOError:  # where it counts, the same shortage is reported
        yield
        return
    try:
        yield
    finally:
        worker.join()


def _attempt(layout: Layout, requirements: Sequence[str]) -> None:
    with suppress(OSError):  # it fails again, and is reported, where it counts
        prepare(layout, requirements)


def prepare(layout: Layout, requirements: Sequence[str]) -> bool:
    """Lock, build, compile; True when all of it went through."""
    lock, _ = resolve(requirements, layout.project, timeout=SECONDS)
    if lock is None:
        return False
    environment, _ = build(layout, lock, SECONDS)
    if environment is None:
        return False
    with held(layout.environments / COMPILING):
        loading = ForkServer.at(environment.python)
        _compile_beside(environment)
        return loading.loaded(SECONDS)


def _compile_beside(environment: Environment) -> None:
    """Compile what FastMCP imports in a second process, ahead of the fork server, which compiles the rest.

    The import is one thread's work, and for most of it the agents and octoform wait: a half of it is done here.
    """
    packages = packages_of(environment.path)
    folders = [str(packages / name) for name in COMPILED_BESIDE if (packages / name).is_dir()]
    if not folders:  # the command would take all that can be imported
        return
    command = [str(environment.python), "-I", "-m", "compileall", "-q", *folders]
    with suppress(OSError):  # then the import does all of it
        run(command, cwd=environment.path, environment=base_environment(), timeout=SECONDS)


def await_bytecode(layout: Layout) -> None:
    """Wait for a compiling that is under way (bounded, as that is): an import beside it would do all of it again."""
    path = layout.environments / COMPILING
    if path.is_file():
        with held(path, shared=True):
            return


def has_environment(layout: Layout) -> bool:
    """True when at least one complete and unchanged environment is there."""
    found = (at(path) for path in layout.environments.glob("*") if FOLDER_NAME.fullmatch(path.name))
    return any(environment is not None and not intact(environment) for environment in found)
