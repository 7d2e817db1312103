"""The process behind every client of a host: check, load, own, serve, until it is asked to stop."""

import asyncio
import gc
import importlib
import logging
import os
import stat
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from octoform.base import files, processes
from octoform.base.shortage import TEXT, limits, printed
from octoform.policy.published import PolicyInvalid

from .audit.audit_log import AuditFailed
from .process.descriptor import Descriptor, RefusedError, digest_of, digest_of_file, read, untouched
from .process.instance_lock import MARK, Owner
from .process.stderr_log import StderrHandler, write_line
from .transport.addresses import NoAddressError

# The folders of what the process keeps and writes are its user's alone, even when another made them. Standard library
# only.
#
# A user who can write there can take an emergency stop away, put tokens or counters in their place, and reach the
# sockets.

PRIVATE = 0o700


class NotOursError(Exception):
    """A folder that may not be used; the text is one line for a person."""


def private(folder: Path) -> None:
    """Make the folder, or close one of ours that is open to others.

    NotOursError when it is a link, no folder, another user's, or when somebody else, save root, has a file in it (it
    had been open then); also when the system refuses.
    """
    if folder.is_symlink():
        raise NotOursError(f"{folder} is a symlink; it has to be a folder")
    try:
        folder.mkdir(mode=PRIVATE, parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError as problem:
        raise NotOursError(f"{folder} cannot be used: {problem.strerror}") from problem
    try:
        status = os.fstat(descriptor)
        if status.st_uid != os.geteuid():
            raise NotOursError(f"{folder} belongs to another user (uid {status.st_uid}); nothing of it can be trusted")
        if stat.S_IMODE(status.st_mode) & 0o077:
            os.fchmod(descriptor, PRIVATE)
        _look_through(folder, descriptor)
    finally:
        os.close(descriptor)


def _look_through(folder: Path, descriptor: int) -> None:
    with os.scandir(descriptor) as entries:
        for entry in entries:
            owner = entry.stat(follow_symlinks=False).st_uid
            if owner not in (os.geteuid(), 0):
                text = f"{entry.name} in {folder} belongs to another user (uid {owner}); look at it and take it away"
                raise NotOursError(text)


REFUSED = 78
"""Exit status for a configuration that may not be served (EX_CONFIG)."""
FAILED = 70
"""Exit status when it served and could not go on (EX_SOFTWARE): anyone who supervises it starts it again."""
TAKEN = 75
"""Exit status when another process owns the endpoint (EX_TEMPFAIL)."""


def main(folder: Path) -> int:
    """Serve the endpoint in ``folder``; the exit status. Does not return once it has served."""
    logger = logging.getLogger("octoform")
    logger.addHandler(StderrHandler())
    try:
        untouched(folder)
        descriptor = read(folder)
        for kept in (descriptor.run, descriptor.log):
            private(kept)
        owner = Owner.take(descriptor.run)
        if owner is None:
            write_line("another process serves this endpoint already")
            return TAKEN
        os.environ.update(descriptor.environment)
        processes.put_on(os.environ.setdefault(MARK, processes.new(16)))  # who started it by hand has given none
        gc.disable()  # all that is loaded stays: looking through it for garbage takes a seventh of the start
        from .wiring import (  # only now: FastMCP reads its settings from the environment as it is loaded
            DoorFailedError,
            Endpoint,
        )

        endpoint = Endpoint(descriptor, owner, load(descriptor))
        gc.freeze()
        gc.enable()
    except (RefusedError, NotOursError, PolicyInvalid, AuditFailed) as problem:
        return _refuse(problem)
    status = 0
    try:
        asyncio.run(endpoint.serve())
    except (NoAddressError, AuditFailed) as problem:
        status = _refuse(problem)
    except DoorFailedError as problem:
        write_line(f"it ends: {problem}")
        status = FAILED
    except RuntimeError as problem:
        if not printed(str(problem)):
            logger.exception("it ends")
        else:
            write_line(f"it ends: {TEXT} ({limits()})")
        status = FAILED
    except Exception:  # whatever it is: threads of tools must not keep a process alive that serves no one
        logger.exception("it ends")
        status = FAILED
    owner.release()
    sys.stdout.flush()
    sys.stderr.flush()
    # A tool that never returns has a thread that never ends, and the interpreter would wait for it.
    os._exit(status)


def _refuse(problem: Exception) -> int:
    write_line(f"refused: {problem}")
    return REFUSED


# Load the accepted server: exactly the bytes that passed the contract, or nothing.
#
# Hand-edited code is never served silently, so the server's digest and the runtime's are compared before anything of
# them runs.


def load(descriptor: Descriptor) -> Any:
    """The FastMCP server that server.py defines; RefusedError when its bytes are not the accepted ones."""
    source = accepted(descriptor)
    path = Path(descriptor.server["path"])
    sys.path.insert(0, str(path.parent))
    with stdout_diverted():
        return _execute(path, source)


def accepted(descriptor: Descriptor) -> bytes:
    """The server's source, after its digest and the runtime's were compared with the accepted ones."""
    path = Path(descriptor.server["path"])
    try:
        source = files.read(path)
    except OSError as problem:
        raise RefusedError(f"{path} cannot be read ({problem.strerror}); run octoform apply") from problem
    if digest_of(source) != descriptor.server["digest"]:
        raise RefusedError(f"{path} is not the file that was accepted; run octoform plan to see what would be done")
    for name, digest in descriptor.server["runtime"].items():
        file = path.parent / name
        if digest_of_file(file) != digest:
            raise RefusedError(f"{file} is not the file that was accepted; run octoform apply")
    return source


def _execute(path: Path, source: bytes) -> Any:
    from fastmcp import FastMCP

    # The bytecode of the runtime belongs in the environment, never beside the committed server.
    sys.pycache_prefix = str(Path(sys.prefix, "bytecode"))
    module = types.ModuleType("server")
    module.__file__ = str(path)
    sys.modules["server"] = module
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
        if "runtime" in sys.modules:
            with suppress(ImportError):  # who looks at devices asks for it later, when bytecode goes beside the code
                importlib.import_module("runtime.where")
    finally:
        sys.pycache_prefix = None
    found = [value for value in module.__dict__.values() if isinstance(value, FastMCP)]
    named = module.__dict__.get("mcp")
    if not found:
        raise RefusedError(f"{path} defines no server")
    return named if isinstance(named, FastMCP) else found[0]


@contextmanager
def stdout_diverted() -> Iterator[None]:
    """Keep whatever a driver prints while it loads away from standard output."""
    wire = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(wire, 1)
        os.close(wire)
