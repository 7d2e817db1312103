"""Import a generated server under watch and report what it declares and what it touched.

Run as ``python -I inspect_server.py <server.py>``; one JSON object on stdout. A server that opens a device, a
connection or a process while it is merely imported would do so in every client's start-up and hold the device for
as long as the client lives, so such an attempt is stopped before it reaches the hardware and reported.
"""

import json
import os
import stat
import sys
import tempfile
import traceback
import types
from collections.abc import Iterator
from pathlib import Path

import anyio
from fastmcp import FastMCP

HARMLESS = {"null", "zero", "full", "random", "urandom", "stdin", "stdout", "stderr", "fd", "shm", "ptmx"}
SOCKET_EVENTS = {"socket.bind", "socket.connect", "socket.getaddrinfo", "socket.gethostbyname"}
PROCESS_EVENTS = {
    "subprocess.Popen",
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "os.spawn",
    "os.fork",
    "os.forkpty",
    "pty.spawn",
}
LOADER_FILES = ("ctypes/util.py", "/platform.py", "/uuid.py")
"""Standard modules that start a small tool to look up a library or a name; they drive nothing."""
MAX_VIOLATIONS = 50


class RefusedAtImportError(PermissionError):
    """Raised into the module that touched something at import."""


class Watch:
    """Records and stops what the server's module may not do while it is imported."""

    def __init__(self, server: str) -> None:
        self.server = server
        self.active = False
        self.violations: list[dict[str, object]] = []

    def hook(self, event: str, arguments: tuple[object, ...]) -> None:
        """The audit hook; it cannot be removed, hence ``active``."""
        if not self.active:
            return
        kind, detail = classify(event, arguments)
        if kind is None:
            return
        self.active = False
        try:
            if kind == "process" and looked_up_by_loader():
                return
            self.add(kind, detail, self.line())
        finally:
            self.active = True
        raise RefusedAtImportError(f"{detail}: not while the server is imported")

    def add(self, kind: str, detail: str, line: int | None) -> None:
        """Note one violation; ``line`` counts in the server's file."""
        if len(self.violations) < MAX_VIOLATIONS:
            self.violations.append({"kind": kind, "detail": detail[:300], "line": line})

    def line(self) -> int | None:
        """The innermost line of the server's file that is being executed."""
        for frame_file, number in frames():
            if frame_file == self.server:
                return number
        return None


def frames() -> Iterator[tuple[str, int]]:
    """File and line of the running frames, innermost first."""
    frame = sys._getframe(1)
    while frame is not None:
        yield frame.f_code.co_filename, frame.f_lineno
        frame = frame.f_back  # type: ignore[assignment]


def looked_up_by_loader() -> bool:
    """True when a standard module's look-up of a library starts the process."""
    return any(file.endswith(LOADER_FILES) for file, _ in frames())


def classify(event: str, arguments: tuple[object, ...]) -> tuple[str | None, str]:
    """The kind of violation (device, socket, process) that an audit event is, or None."""
    if event == "open":
        path = arguments[0]
        if isinstance(path, (str, bytes)) and is_device(os.fsdecode(path)):
            return "device", f"opens {os.fsdecode(path)}"
    elif event in SOCKET_EVENTS:
        # Names are looked up as (host, port, ...), sockets as (socket, address).
        what = arguments[:1] if event.startswith("socket.get") else arguments[-1]
        return "socket", f"{event.removeprefix('socket.')} {what!r}"
    elif event in PROCESS_EVENTS:
        what = arguments[1] if event == "subprocess.Popen" and len(arguments) > 1 else arguments[:1]
        return "process", f"starts {what!r}"
    return None, ""


def is_device(name: str) -> bool:
    """True for a device node: below /dev of the machine or of the system root in use, or a character or block node."""
    path = Path(os.path.realpath(name))
    for root in {"/", os.path.realpath(os.environ.get("OCTOFORM_SYSROOT") or "/")}:
        folder = Path(root, "dev")
        if folder in path.parents:
            return path.relative_to(folder).parts[0] not in HARMLESS
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return stat.S_ISCHR(mode) or stat.S_ISBLK(mode)


def held_devices() -> set[str]:
    """Device nodes that this process has open, however they were opened (a C library raises no audit event)."""
    found = set()
    for entry in Path("/proc/self/fd").glob("*"):
        try:
            target = str(entry.readlink())
        except OSError:  # the descriptor of this very listing
            continue
        if target.startswith("/") and is_device(target):
            found.add(target)
    return found


def main(path: str) -> None:
    """Import, list, report; never raises for what the server does."""
    server = Path(path).resolve()
    watch = Watch(str(server))
    sys.addaudithook(watch.hook)
    sys.path.insert(0, str(server.parent))
    before = held_devices()
    report_fd = os.dup(1)
    with tempfile.TemporaryFile() as printed:
        os.dup2(printed.fileno(), 1)
        report = inspect(server, watch)
        sys.stdout.flush()
        printed.seek(0)
        text = printed.read(400).decode("utf-8", "replace").strip()
    if text:
        watch.add("stdout", f"prints {text[:200]!r}", None)
    for device in sorted(held_devices() - before):
        watch.add("device", f"holds {device} open after the import", None)
    with os.fdopen(report_fd, "w", encoding="utf-8") as out:
        json.dump({**report, "violations": watch.violations}, out)
    # Threads that the module started must not keep the check alive.
    os._exit(0)


def inspect(server: Path, watch: Watch) -> dict[str, object]:
    """Name, tools and error of the server."""
    try:
        name, tools = declared(execute(server, watch))
    except BaseException as problem:  # noqa: BLE001 - whatever generated code raises belongs in the report
        return {"name": None, "tools": [], "error": describe(problem, str(server))}
    return {"name": name, "tools": tools, "error": None}


def execute(server: Path, watch: Watch) -> dict[str, object]:
    """Run the module's top level as an importer would, never its ``__main__`` part."""
    code = compile(server.read_bytes(), str(server), "exec")
    module = types.ModuleType("server")
    module.__file__ = str(server)
    sys.modules["server"] = module
    # The bytecode of the runtime belongs in the environment, never beside the committed server.
    sys.pycache_prefix = str(Path(sys.prefix, "bytecode"))
    watch.active = True
    try:
        exec(code, module.__dict__)
    finally:
        watch.active = False
    return module.__dict__


def declared(namespace: dict[str, object]) -> tuple[str, list[dict[str, object]]]:
    """Name of the server and its tools as a client would see them."""
    mcp = namespace.get("mcp")
    if not isinstance(mcp, FastMCP):
        servers = [value for value in namespace.values() if isinstance(value, FastMCP)]
        if len(servers) != 1:
            raise LookupError(f"one FastMCP server named 'mcp' is expected, {len(servers)} were found")
        mcp = servers[0]

    async def collect() -> list[dict[str, object]]:
        return [as_json(tool.to_mcp_tool(name=tool.name)) for tool in await mcp.list_tools()]

    return mcp.name, sorted(anyio.run(collect), key=lambda item: str(item["name"]))


def as_json(tool: object) -> dict[str, object]:
    """A tool as the wire has it, under the report's names."""
    wire = tool.model_dump(mode="json", by_alias=True, exclude_none=True)  # type: ignore[attr-defined]
    return {
        "name": wire["name"],
        "description": wire.get("description", ""),
        "input_schema": wire["inputSchema"],
        "output_schema": wire.get("outputSchema"),
        "annotations": wire.get("annotations"),
    }


def describe(problem: BaseException, server: str) -> dict[str, object]:
    """Type, message and the line of the server's file where it went wrong."""
    line = problem.lineno if isinstance(problem, SyntaxError) else None
    for frame in traceback.extract_tb(problem.__traceback__):
        if frame.filename == server:
            line = frame.lineno
    return {"type": type(problem).__name__, "message": str(problem)[:500], "line": line}


if __name__ == "__main__":
    main(sys.argv[1])
