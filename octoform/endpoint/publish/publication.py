"""Write what a client needs to reach the server: descriptor, client snippets, and last the launcher.

The order matters: whoever finds a launcher finds a complete endpoint. The manifest written at the very end holds
the digests of all these files, so that a plan sees when one was edited or lost.
"""

import json
import os
import shlex
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import octoform
from octoform.base.files import make_way, parse, read, read_json
from octoform.diagnostics import Diagnostic, Severity
from octoform.digest import of_bytes
from octoform.endpoint.environment.build import prune
from octoform.endpoint.environment.model import Environment, at
from octoform.endpoint.files import (
    CHECK,
    CLIENTS,
    CONNECTION,
    LAUNCHER,
    MANIFEST,
    PACKAGES,
    POLICY,
    PROGRAM,
    SERVE_SCRIPT,
    files_below,
    folder_digest,
    private_folder,
    program_digest,
    program_files,
    read_manifest,
)
from octoform.endpoint.process.start_command import lasting_command
from octoform.endpoint.publish.expected_tools import denied
from octoform.endpoint.publish.snippets import snippets
from octoform.endpoint.publish.spec import Service
from octoform.state.artifacts.cache import ENDPOINT, keep
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

_SERVICE = ("host", "scope", "tools", "devices", "network", "tunnel")
"""What the descriptor says of the service itself, and not of the folder or the octoform that wrote it."""
SCRIPT = Path(__file__).parents[1] / "scripts" / "serve.py"


def write_endpoint(
    layout: Layout, environment: Environment, service: Service, environ: Mapping[str, str] | None = None
) -> list[Diagnostic]:
    """Write the endpoint of the accepted server; errors when the disk refuses, a warning when only a copy is missing.

    ``environ`` (default: this process's) is where a system root in use is taken from. OSError when the accepted
    server.py cannot be read, which is a bug of the caller.
    """
    folder = private_folder(layout.endpoint)
    former = read_manifest(layout)
    # What was seen of the former server says nothing of this one.
    for name in (CHECK, MANIFEST):
        make_way(folder / name)
    (folder / CHECK).unlink(missing_ok=True)
    private_folder(layout.logs)
    descriptor = _descriptor(layout, service, os.environ if environ is None else environ)
    files = _files(layout, environment, service, descriptor)
    for name in (CLIENTS, PROGRAM, *(f"{PROGRAM}/{package.name}" for package in PACKAGES)):
        private_folder(folder / name)
    for name, (data, mode) in files.items():
        make_way(folder / name)
        if problem := write_atomic(folder / name, data, mode):
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
    kept = keep(layout, ENDPOINT, {**{name: data for name, (data, _) in files.items()}, MANIFEST: _json(manifest)})
    prune(layout, {Path(str(manifest[name])) for name in ("environment", "previous_environment") if manifest[name]})
    return [] if kept is None else [replace(kept, severity=Severity.WARNING)]


def is_published(layout: Layout, service: Service, environ: Mapping[str, str] | None = None) -> bool:
    """True when the endpoint that was written last is this very service, byte for byte."""
    manifest = read_manifest(layout)
    environment = at(Path(str(manifest["environment"]))) if manifest is not None else None
    if manifest is None or environment is None:
        return False
    descriptor = _descriptor(layout, service, os.environ if environ is None else environ)
    files = _files(layout, environment, service, descriptor)
    return bool(manifest["files"] == {name: of_bytes(data) for name, (data, _) in files.items()})


def tells_of(layout: Layout, service: Service, environ: Mapping[str, str]) -> bool:
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
    """The launcher: a shell's two lines, because a shebang can hold neither a long path nor one with a blank."""
    words = [str(environment.python), "-I", str(script)]
    return "#!/bin/sh\nexec " + " ".join(shlex.quote(word) for word in words) + ' "$@"\n'


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
    }
    if environ.get("OCTOFORM_SYSROOT"):
        variables["OCTOFORM_SYSROOT"] = environ["OCTOFORM_SYSROOT"]
    runtime = {f"{layout.runtime.name}/{name}": digest for name, digest in files_below(layout.runtime).items()}
    told = ("name", "effect", "devices", "annotations", "output_schema")
    return {
        "format": 2,
        "octoform": octoform.__version__,
        "host": layout.host,
        "scope": service.scope,
        "transport": "stdio",
        "command": client_command(layout),
        "environment": variables,
        "tools": [{key: tool[key] for key in told if key in tool} for tool in service.tools],
        "devices": [dict(device) for device in service.devices],
        "server": {"path": str(server), "digest": of_bytes(read(server)), "runtime": runtime},
        "paths": {"run": str(layout.run), "log": str(layout.logs)},
        "network": service.network,
        "tunnel": service.tunnel,
    }


def client_command(layout: Layout) -> list[str]:
    """What a client starts: this interpreter by its absolute path, so it can be started from any folder.

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
