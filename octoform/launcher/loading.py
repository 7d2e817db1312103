"""Load the accepted server: exactly the bytes that passed the contract, or nothing.

Hand-edited code is never served silently, so the server's digest and the runtime's are compared before anything of
them runs.
"""

import importlib
import os
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from octoform.base import files

from .descriptor import Descriptor, RefusedError, digest_of, digest_of_file


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

    # The bytecode of the runtime belongs into the environment, never beside the committed server.
    sys.pycache_prefix = str(Path(sys.prefix, "bytecode"))
    module = types.ModuleType("server")
    module.__file__ = str(path)
    sys.modules["server"] = module
    try:
        exec(compile(source, str(path), "exec"), module.__dict__)
        if "runtime" in sys.modules:
            with suppress(ImportError):  # who looks at devices asks for it later, when bytecode goes beside the code
                importlib.import_module("runtime.rights")
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
