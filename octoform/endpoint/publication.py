"""Write what a client needs to reach the server: descriptor, client snippets, and last the launcher.

The order matters: anyone who finds a launcher finds a complete endpoint. The manifest written at the very end holds
the digests of all these files, so that a plan sees when one was edited or lost.
"""

import dataclasses
import json
import os
import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from importlib.machinery import SourceFileLoader
from importlib.util import cache_from_source
from pathlib import Path, PurePosixPath
from typing import Any

import octoform
from octoform.base.digest import of_bytes
from octoform.base.files import (
    TEMPORARY,
    create,
    make_way,
    parse,
    private_folder,
    publish,
    read,
    read_json,
    replace,
    sync_folder,
)
from octoform.diagnostics import Diagnostic, Severity
from octoform.endpoint.bounded_program import UNCHECKED
from octoform.endpoint.environment.build import prune
from octoform.endpoint.environment.model import FOLDER_NAME, MARKER, Environment, at
from octoform.endpoint.expected_tools import denied
from octoform.endpoint.mcp_clients.known_clients import CLIENTS as PROGRAMS
from octoform.endpoint.mcp_clients.known_clients import Client, form, of
from octoform.endpoint.mcp_clients.merge import Wish, written
from octoform.endpoint.process.estop import LATCH
from octoform.endpoint.process.start_stop import stop
from octoform.endpoint.process.systemd import lasting_command
from octoform.endpoint.published_files import (
    CHECK,
    CLIENTS,
    CONNECTION,
    LAUNCHER,
    MANIFEST,
    POLICY,
    PROGRAM,
    SERVE_SCRIPT,
    files_below,
    folder_digest,
    program_digest,
    program_files,
    program_paths,
    read_manifest,
)
from octoform.records import dataclass
from octoform.state.artifact_cache import ENDPOINT, forget, keep
from octoform.state.files import refused, write_atomic
from octoform.state.layout import Layout

# One ready-made configuration for each MCP client, in the client's own format.
#
# Absolute paths and no environment: a client can start the command from anywhere. The forms are those that `octoform
# clients install` puts into a client's own file, see `clients.formats`.


def snippets(name: str, command: Sequence[str], url: str | None = None) -> dict[str, str]:
    """File name to text for each client; ``name`` is what the client calls the server, ``command`` what it starts.

    With a ``url``, clients that know HTTP get that; the token is referred to.
    """
    return {client.file: snippet(client, name, command, url) for client in PROGRAMS.values()}


def snippet(client: Client, name: str, command: Sequence[str], url: str | None = None) -> str:
    """The text of one client's configuration that holds this server and nothing else."""
    client = of(client, name)
    entry = form(client, name, command, url) or form(client, name, command, None)
    assert entry is not None
    with_prompt = url is not None and client.http is not None
    return written(client, Wish(client.table, name, entry, prompted=with_prompt))


# What the endpoint shall be, as a value: who reaches it, with which tools, under which policy.


@dataclass(frozen=True, slots=True)
class Service:
    """The content of the endpoint's descriptor and policy.

    ``tools`` are the INTERFACE artifact's, ``devices`` ``{"id", "name", "category"}`` as IDENTIFY has them. ``policy``
    is the resolved one in the form of policy.json. ``network`` and ``tunnel`` are None where the scope has none.
    """

    tools: Sequence[Mapping[str, Any]]
    policy: Mapping[str, Any]
    devices: Sequence[Mapping[str, Any]] = dataclasses.field(default=())
    scope: str = "local"
    network: Mapping[str, Any] | None = None
    tunnel: Mapping[str, Any] | None = None


_SERVICE = ("host", "scope", "tools", "devices", "network", "tunnel")
"""The descriptor's facts of the service itself, and not of the folder or the octoform that wrote it."""
SCRIPT = Path(__file__).parent / "scripts" / "serve.py"


def write_endpoint(
    layout: Layout, environment: Environment, service: Service, environ: Mapping[str, str] | None = None
) -> list[Diagnostic]:
    """Write the endpoint of the accepted server; errors when the disk refuses, a warning when only a copy is missing.

    ``environ`` (default: this process's) is where a system root in use is taken from. OSError when the accepted
    server.py cannot be read, which is a bug of the caller.
    """
    folder = private_folder(layout.endpoint)
    former = read_manifest(layout)
    # A check of the former server is no evidence about this one.
    for name in (CHECK, MANIFEST):
        make_way(folder / name)
    (folder / CHECK).unlink(missing_ok=True)
    private_folder(layout.logs)
    descriptor = _descriptor(layout, service, os.environ if environ is None else environ)
    files = _files(layout, environment, service, descriptor)
    for name in sorted({CLIENTS, *(part.as_posix() for each in files for part in Path(each).parents)}):
        private_folder(folder / name)
    if problem := _write_files(folder, {name: file for name, file in files.items() if name != LAUNCHER}):
        return [problem]
    _lay_bytecode(folder)
    if problem := _write_files(folder, {LAUNCHER: files[LAUNCHER]}):
        return [problem]
    manifest = {
        "format": 1,
        "files": {name: of_bytes(data) for name, (data, _) in files.items()},
        "environment": str(environment.path),
        "previous_environment": _previous(former, environment),
        "lock": environment.lock,
        "tools": sorted(tool["name"] for tool in service.tools if tool["name"] not in denied(service.policy)),
        "server": descriptor["server"]["digest"],
        "runtime": folder_digest(layout.runtime),
        "launcher": program_digest(),
    }
    if problem := write_atomic(folder / MANIFEST, _json(manifest), 0o600):
        return [problem]
    _remove_former(folder / PROGRAM, files)
    kept = keep(layout, ENDPOINT, {**{name: data for name, (data, _) in files.items()}, MANIFEST: _json(manifest)})
    prune(layout, {Path(str(manifest[name])) for name in ("environment", "previous_environment") if manifest[name]})
    return [] if kept is None else [dataclasses.replace(kept, severity=Severity.WARNING)]


def _write_files(folder: Path, files: Mapping[str, tuple[bytes, int]]) -> Diagnostic | None:
    """Replace each file as a whole, synced to disk; their folders are synced once, after all of them."""
    for name, (data, mode) in files.items():
        path = folder / name
        draft = path.with_name(f".{path.name}.{os.urandom(6).hex()}{TEMPORARY}")
        try:
            make_way(path)
            create(draft, data, mode)
            publish(draft, path)
        except OSError as problem:
            with suppress(OSError):
                draft.unlink()
            return refused(problem, path)
    try:
        for place in {(folder / name).parent for name in files}:
            sync_folder(place)
    except OSError as problem:
        return refused(problem, folder)
    return None


def _lay_bytecode(folder: Path) -> None:
    """Lay the bytecode of this octoform's own files beside their published copies, so that no start compiles them.

    Bytecode names the time and the size of its source (importlib), so each copy gets the time of its original. Copies,
    never links: what is changed in the endpoint's folder changes nothing of the installation. A start compiles what
    cannot be laid here.
    """
    # The others are what damaged bytecode of the installation raises (marshal).
    with suppress(OSError, EOFError, ValueError, TypeError):
        for name, source in program_paths().items():
            SourceFileLoader(name, str(source)).get_code(name)  # which writes it where it is missing or outdated
            cached, time = Path(cache_from_source(str(source))), source.stat().st_mtime_ns
            place = Path(cache_from_source(str(folder / name)))
            private_folder(place.parent)
            make_way(place)
            replace(place, read(cached), 0o600, synced=False)
            os.utime(folder / name, ns=(time, time))


def _remove_former(program: Path, names: Iterable[str]) -> None:
    """Folders of an earlier octoform in which none of these files lies: no one imports them, and no one checks them."""
    held = {program.parent / above for name in names for above in PurePosixPath(name).parents}
    for place in list(program.rglob("*")):
        if place not in held and place.name != "__pycache__" and place.is_dir() and not place.is_symlink():
            shutil.rmtree(place, ignore_errors=True)


def is_published(layout: Layout, service: Service, environ: Mapping[str, str] | None = None) -> bool:
    """True when the endpoint that was written last is this very service, byte for byte."""
    manifest = read_manifest(layout)
    environment = at(Path(str(manifest["environment"]))) if manifest is not None else None
    if manifest is None or environment is None:
        return False
    descriptor = _descriptor(layout, service, os.environ if environ is None else environ)
    files = _files(layout, environment, service, descriptor)
    return bool(manifest["files"] == {name: of_bytes(data) for name, (data, _) in files.items()})


def is_published_for(layout: Layout, service: Service, environ: Mapping[str, str]) -> bool:
    """True when the endpoint that was written last is this service, for whichever folder it was written."""
    try:
        written, policy = (read_json(layout.endpoint / name) for name in (CONNECTION, POLICY))
        made, asked = parse(_json(_descriptor(layout, service, environ))), parse(_json(service.policy))
        same = all(written[name] == made[name] for name in _SERVICE)
        return bool(same and policy == asked and written["server"]["digest"] == made["server"]["digest"])
    except (OSError, ValueError, LookupError, TypeError):
        return False


def _files(
    layout: Layout, environment: Environment, service: Service, descriptor: Mapping[str, Any]
) -> dict[str, tuple[bytes, int]]:
    """Name to bytes and mode, in the order of writing: the launcher comes last."""
    files = {CONNECTION: (_json(descriptor), 0o600), POLICY: (_json(service.policy), 0o600)}
    for name, text in snippets(f"octoform-{layout.host}", descriptor["command"]).items():
        files[f"{CLIENTS}/{name}"] = (text.encode(), 0o600)
    for name, data in program_files().items():
        files[name] = (data, 0o600)
    files[SERVE_SCRIPT] = (SCRIPT.read_bytes(), 0o600)
    files[LAUNCHER] = (launcher_text(environment, layout.endpoint / SERVE_SCRIPT).encode(), 0o700)
    return files


def launcher_text(environment: Environment, script: Path) -> str:
    """The launcher: a shell's lines, because a shebang can hold neither a long path nor one with a blank."""
    words = [str(environment.python), "-I", str(script)]
    return f"#!/bin/sh\n{_MEMORY}exec " + " ".join(shlex.quote(word) for word in words) + ' "$@"\n'


_MEMORY = "export MALLOC_TRIM_THRESHOLD_=16777216 MALLOC_MMAP_THRESHOLD_=16777216\n"
"""Bytes (mallopt(3)): memory of a picture is used again for the next one, instead of being mapped again each time."""


def _previous(former: Mapping[str, Any] | None, environment: Environment) -> str | None:
    """The environment to keep beside the current one, so that a way back needs no network."""
    if former is None:
        return None
    last = former.get("environment")
    found = former.get("previous_environment") if last == str(environment.path) else last
    # That of the folder that this one was copied from is the other one's to keep or to drop.
    return found if found is not None and Path(found).parent == environment.path.parent else None


def _descriptor(layout: Layout, service: Service, environ: Mapping[str, str]) -> dict[str, Any]:
    server = layout.output("serve")
    variables = {
        "OCTOFORM_INSTANCES": str(layout.instances),
        "OCTOFORM_CALL_LOG": str(layout.call_log),
        "OCTOFORM_STOPS": str(layout.run),
        "FASTMCP_CHECK_FOR_UPDATES": "off",
        "FASTMCP_SHOW_SERVER_BANNER": "false",
        # What tools say to their clients is not for the process's own log.
        "FASTMCP_LOG_LEVEL": "ERROR",
        # FastMCP would otherwise read a .env of whatever folder the process was started in.
        "FASTMCP_ENV_FILE": os.devnull,
        **UNCHECKED,
    }
    if environ.get("OCTOFORM_SYSROOT"):
        variables["OCTOFORM_SYSROOT"] = environ["OCTOFORM_SYSROOT"]
    runtime = {f"{layout.runtime.name}/{name}": digest for name, digest in files_below(layout.runtime).items()}
    published = ("name", "effect", "devices", "annotations", "output_schema")
    return {
        "format": 2,
        "octoform": octoform.__version__,
        "host": layout.host,
        "scope": service.scope,
        "transport": "stdio",
        "command": client_command(layout),
        "environment": variables,
        "tools": [{key: tool[key] for key in published if key in tool} for tool in service.tools],
        "devices": [dict(device) for device in service.devices],
        "server": {"path": str(server), "digest": of_bytes(read(server)), "runtime": runtime},
        "paths": {"run": str(layout.run), "log": str(layout.logs)},
        "network": service.network,
        "tunnel": service.tunnel,
    }


def client_command(layout: Layout) -> list[str]:
    """The command that a client starts: this interpreter by its absolute path, so it can be started from any folder.

    An octoform of the PATH instead, where this one will not stay.
    """
    return lasting_client_command(layout) or [sys.executable, "-I", "-m", "octoform.cli", *_pipe(layout)]


def lasting_client_command(layout: Layout) -> list[str] | None:
    """The same for a file that outlives this run; None where octoform runs from a cache and none is installed."""
    return lasting_command(_pipe(layout), os.environ)


def _pipe(layout: Layout) -> list[str]:
    return [f"-chdir={layout.project}", "connect", layout.host]


def _json(value: object) -> bytes:
    return (json.dumps(value, indent=2, ensure_ascii=False) + "\n").encode()


# Take the endpoint away: exactly what apply made, nothing that a person put beside it.

STOPS = "stopped-*.json"  # what the runtime writes for a device that was stopped until a command of its own


def remove(layout: Layout) -> list[Path]:
    """Remove endpoint and environments of this host; gives the files and folders that are not ours and stayed.

    The launcher goes first, so that no client starts a server from what is being removed; then the process is ended,
    and its tokens and counters go with it. The logs stay, and so do an emergency stop and the stop of a device: what
    was stopped for a reason must not move after the next apply because no one remembers it. OSError when the system
    refuses.
    """
    folder = layout.endpoint
    _unlink(folder, LAUNCHER)
    stop(layout)
    _empty(layout.run)
    for name in (SERVE_SCRIPT, CONNECTION, POLICY, CHECK, MANIFEST):
        _unlink(folder, name)
    for name in snippets("", []):
        _unlink(folder / CLIENTS, name)
    shutil.rmtree(folder / PROGRAM, ignore_errors=True)
    for path in sorted(layout.environments.glob("*")):
        if FOLDER_NAME.fullmatch(path.name) and ((path / MARKER).is_file() or (path / "pyvenv.cfg").is_file()):
            shutil.rmtree(path)
    for path in sorted(layout.environments.glob(".*.lock")):
        path.unlink()
    forget(layout, (ENDPOINT,))
    return [*_sweep(folder / CLIENTS), *_sweep(folder), *_sweep(layout.environments)]


def stopped_devices(layout: Layout) -> tuple[Path, ...]:
    """The stops of single devices, which the runtime keeps until the command that ends each went well."""
    return tuple(sorted(layout.run.glob(STOPS)))


def _empty(run: Path) -> None:
    """Remove what the process kept, but for the latch of the emergency stop and the stops of devices."""
    kept = {path.name for path in run.glob(STOPS)} | ({LATCH} if os.path.lexists(run / LATCH) else set())
    if not kept:
        shutil.rmtree(run, ignore_errors=True)
        return
    for path in run.iterdir():
        if path.name in kept:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _unlink(folder: Path, name: str) -> None:
    """The file, and whatever a cut-off write left of it."""
    (folder / name).unlink(missing_ok=True)
    for path in folder.glob(f".{name}.*"):
        path.unlink()


def _sweep(folder: Path) -> list[Path]:
    """Remove the folder when it is empty, else report what is in it."""
    if not folder.is_dir():
        return []
    left = sorted(folder.iterdir())
    if not left:
        folder.rmdir()
    return left
