"""Import a generated server where it will be served, in a process of its own, and judge what that showed.

A file that compiles may still fail to import, may hang, may print over the protocol's stream or may open the camera
for as long as a client lives; only the serving interpreter shows it.
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, Span, error
from octoform.endpoint.bounded_program import Finished, ForkServer, run, serving_environment
from octoform.records import dataclass

SCRIPT = Path(__file__).parents[1] / "scripts" / "inspect_server.py"
_RULES = {
    "device": (
        "ENDPOINT-IMPORT-DEVICE",
        "the server touches a device while it is imported",
        "find and open the device inside the tool, and close it before the tool returns",
    ),
    "socket": (
        "ENDPOINT-IMPORT-SOCKET",
        "the server opens a connection while it is imported",
        "connect inside the tool; a server of scope local opens no socket",
    ),
    "process": (
        "ENDPOINT-IMPORT-PROCESS",
        "the server starts a process while it is imported",
        "start nothing at import; a tool that needs a program starts it when it is called",
    ),
    "stdout": (
        "ENDPOINT-IMPORT-STDOUT",
        "the server prints on stdout while it is imported",
        "write to stderr or to the log: over stdio, stdout carries the protocol",
    ),
}


@dataclass(frozen=True, slots=True)
class ImportedTool:
    """A tool as the server declares it: JSON Schemas and annotations in the wire's spelling."""

    name: str
    description: str
    input_schema: dict[str, Any]
    output_schema: dict[str, Any] | None
    annotations: dict[str, Any] | None


@dataclass(frozen=True, slots=True)
class Violation:
    """Something the module did at import; ``kind`` is device, socket, process or stdout."""

    kind: str
    detail: str
    line: int | None


@dataclass(frozen=True, slots=True)
class ImportFault:
    """Why the import failed: class of the exception, its message, the line in server.py."""

    type: str
    message: str
    line: int | None


@dataclass(frozen=True, slots=True)
class ImportReport:
    """The result of an import. ``fault`` None means success; ``survivors`` counts processes it left."""

    name: str | None
    tools: tuple[ImportedTool, ...]
    violations: tuple[Violation, ...]
    fault: ImportFault | None
    seconds: float
    timed_out: bool = False
    survivors: int = 0


def check_import(
    python: Path, folder: Path, timeout: float = 30.0, environment: Mapping[str, str] | None = None
) -> ImportReport:
    """Import ``folder/server.py`` (``runtime/`` beside it) with ``python`` for at most ``timeout`` seconds.

    ``environment`` is added to the few base variables. Takes a tenth of a second once the fork server of ``python`` has
    loaded.
    """
    variables = {**serving_environment(), **(environment or {})}
    if "OCTOFORM_SYSROOT" in os.environ:
        variables.setdefault("OCTOFORM_SYSROOT", os.environ["OCTOFORM_SYSROOT"])
    command = [str(python), "-I", str(SCRIPT), str(folder / "server.py")]
    server = ForkServer.at(python)
    finished = run(command, cwd=folder, environment=variables, timeout=timeout, fork_server=server)
    return _read(finished)


def judge_import(report: ImportReport, path: str = "server.py") -> list[Diagnostic]:
    """Errors for what may not be in an accepted server; empty for a clean import."""
    if report.timed_out:
        return [
            error(
                "ENDPOINT-IMPORT-TIMEOUT",
                f"importing the server did not end within {report.seconds:.0f} s",
                path=path,
                hint="do nothing at import that waits: no loops, no device, no network",
            )
        ]
    found = [_violation(item, path) for item in report.violations]
    # A violation was stopped by an exception; that exception is not a second fault of the server.
    if report.fault is not None and report.fault.type != "RefusedAtImportError":
        where = Span(report.fault.line, 1) if report.fault.line else None
        summary = f"the server cannot be imported: {report.fault.type}: {report.fault.message}"
        found.append(error("ENDPOINT-IMPORT-FAILED", summary, path=path, span=where))
    return found


def _violation(item: Violation, path: str) -> Diagnostic:
    code, summary, hint = _RULES[item.kind]
    where = Span(item.line, 1) if item.line else None
    return error(code, summary, path=path, span=where, detail=item.detail, hint=hint)


def _read(finished: Finished) -> ImportReport:
    if finished.timed_out:
        return ImportReport(None, (), (), None, finished.seconds, True, finished.survivors)
    try:
        value = parse(finished.stdout)
    except ValueError:
        last = finished.stderr.strip().splitlines()[-1:] or [f"exit status {finished.status}"]
        fault = ImportFault("Crash", last[0][:500], None)
        return ImportReport(None, (), (), fault, finished.seconds, False, finished.survivors)
    return ImportReport(
        name=value["name"],
        tools=tuple(ImportedTool(**item) for item in value["tools"]),
        violations=tuple(Violation(**item) for item in value["violations"]),
        fault=ImportFault(**value["error"]) if value["error"] else None,
        seconds=finished.seconds,
        survivors=finished.survivors,
    )
