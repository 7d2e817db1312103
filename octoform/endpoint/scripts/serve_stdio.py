"""Serve the accepted server on stdio: the program behind every client's command.

Copied beside the connection descriptor, so the endpoint works without octoform. It refuses a server or a runtime
whose bytes are not those that passed the contract: hand-edited code is never served silently.
"""

import hashlib
import json
import os
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

REFUSED = 78
"""Exit status for a configuration that may not be served (EX_CONFIG)."""


class RefusedError(Exception):
    """The endpoint may not be served as it is; the text is one line for a person."""


def main() -> int:
    """Check, load, serve until the client closes stdin."""
    try:
        descriptor = json.loads((Path(__file__).resolve().parent / "connection.json").read_bytes())
        source = accepted(descriptor)
    except (OSError, ValueError, KeyError, RefusedError) as problem:
        print(f"octoform: refused: {problem}", file=sys.stderr)
        return REFUSED
    os.environ.update(descriptor["environment"])
    path = Path(descriptor["server"]["path"])
    sys.path.insert(0, str(path.parent))
    with stdout_diverted():
        server = load(path, source)
    server.run(transport="stdio", show_banner=False, log_level="ERROR")
    return 0


def accepted(descriptor: dict[str, Any]) -> bytes:
    """The server's source, after its digest and the runtime's were compared with the accepted ones."""
    server = descriptor["server"]
    path = Path(server["path"])
    try:
        source = path.read_bytes()
    except OSError as problem:
        raise RefusedError(f"{path} cannot be read ({problem.strerror}); run octoform apply") from problem
    if "sha256:" + hashlib.sha256(source).hexdigest() != server["digest"]:
        raise RefusedError(f"{path} is not the file that was accepted; run octoform plan to see what would be done")
    for name, digest in server["runtime"].items():
        file = path.parent / name
        if not file.is_file() or "sha256:" + hashlib.sha256(file.read_bytes()).hexdigest() != digest:
            raise RefusedError(f"{file} is not the file that was accepted; run octoform apply")
    return source


def load(path: Path, source: bytes) -> Any:
    """Execute exactly the bytes that were checked and give the FastMCP server they define."""
    from fastmcp import FastMCP

    # The bytecode of the runtime belongs into the environment, never beside the committed server.
    sys.pycache_prefix = str(Path(sys.prefix, "bytecode"))
    module = types.ModuleType("server")
    module.__file__ = str(path)
    sys.modules["server"] = module
    exec(compile(source, str(path), "exec"), module.__dict__)
    sys.pycache_prefix = None
    found = [value for value in module.__dict__.values() if isinstance(value, FastMCP)]
    named = module.__dict__.get("mcp")
    return named if isinstance(named, FastMCP) else found[0]


@contextmanager
def stdout_diverted() -> Iterator[None]:
    """Keep whatever a driver prints while it loads away from the protocol's stream."""
    wire = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(wire, 1)
        os.close(wire)


if __name__ == "__main__":
    sys.exit(main())
