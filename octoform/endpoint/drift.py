"""Compares the applied endpoint with what apply left: the endpoint's share of a plan's drift.

Light: a few files are read and hashed, one folder is listed; nothing is started and nothing is asked, so a plan that
has nothing to do stays fast (a few milliseconds).
"""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base.digest import of_value
from octoform.base.files import read_json
from octoform.base.shape import fits
from octoform.endpoint.environment.model import Environment, at, intact
from octoform.endpoint.process.record import Running, running
from octoform.endpoint.published_files import (
    CHECK,
    CONNECTION,
    LAUNCHER,
    POLICY,
    file_digest,
    folder_digest,
    program_digest,
    read_manifest,
    written_for,
)
from octoform.records import dataclass
from octoform.state.layout import Layout

OTHER_TOOLS = "tools differ"
"""How the reason begins that the endpoint listed other tools than INTERFACE has."""
_WORDS = {LAUNCHER: "the launcher", CONNECTION: "the connection descriptor", POLICY: "the resolved policy"}


@dataclass(frozen=True, slots=True)
class Expected:
    """The endpoint that the accepted artifacts need; None stands for what the endpoint was made for.

    ``server`` is the digest of server.py's bytes.
    """

    tools: tuple[str, ...] | None = None
    server: str | None = None
    lock_text: str | None = None


@dataclass(frozen=True, slots=True)
class EndpointFacts:
    """The endpoint as it is. ``reasons`` are plain sentences, empty when all is as it was left.

    ``tools``, ``answered`` and ``checked_at`` (RFC 3339) come from the last check; empty and None
    when there was none. ``process`` is the one that serves it now.
    """

    present: bool
    reasons: tuple[str, ...]
    server: str | None = None
    runtime: str | None = None
    lock: str | None = None
    tools: tuple[str, ...] = ()
    answered: bool | None = None
    checked_at: str | None = None
    process: Running | None = None


def observe(layout: Layout, expected: Expected | None = None) -> EndpointFacts:
    """Look at the endpoint; never raises for what it finds."""
    wanted = expected or Expected()
    manifest = read_manifest(layout)
    if manifest is None:
        return EndpointFacts(False, ("the endpoint is not there",))
    check = _check(layout)
    server, runtime = file_digest(layout.output("serve")), folder_digest(layout.runtime)
    other = written_for(layout)
    reasons = [
        *(
            [f"the endpoint was written for {other}; octoform start makes this folder one of its own"]
            if other is not None
            else []
        ),
        *_files(layout, manifest["files"]),
        *_environment(manifest),
        *_served(manifest, server, runtime, wanted),
        *_launcher(manifest),
        *_checked(check, manifest, wanted),
    ]
    process = running(layout)
    if process is None and not reasons:
        reasons.append("the endpoint is not running")
    return EndpointFacts(
        present=True,
        reasons=tuple(reasons),
        server=server,
        runtime=runtime,
        lock=manifest.get("lock"),
        tools=tuple(check["tools"]) if check else (),
        answered=bool(check["answered"]) if check else None,
        checked_at=str(check["at"]) if check else None,
        process=process,
    )


def _files(layout: Layout, files: Mapping[str, str]) -> list[str]:
    reasons, folder = [], layout.endpoint
    for name, digest in sorted(files.items()):
        path = folder / name
        what = _WORDS.get(name, f"the endpoint's {name}")
        present = file_digest(path)
        if present is None:
            reasons.append(f"{what} is missing")
        elif present != digest:
            reasons.append(f"{what} was changed")
        elif name == LAUNCHER and not os.access(path, os.X_OK):
            reasons.append(f"{what} is not executable")
    return reasons


def _environment(manifest: Mapping[str, Any]) -> list[str]:
    environment: Environment | None = at(Path(str(manifest.get("environment"))))
    if environment is None:
        return ["the serving environment is missing"]
    return intact(environment)


def _served(manifest: Mapping[str, Any], server: str | None, runtime: str | None, wanted: Expected) -> list[str]:
    reasons = []
    if server is None:
        reasons.append("server.py is missing")
    elif server != manifest.get("server") or (wanted.server and wanted.server != server):
        reasons.append("server.py is not the one that the endpoint was made for")
    if runtime != manifest.get("runtime"):
        reasons.append("the runtime beside server.py is missing" if runtime is None else "the runtime was changed")
    if wanted.lock_text is not None and of_value(wanted.lock_text) != manifest.get("lock"):
        reasons.append("the endpoint was built for another set of packages")
    return reasons


def _launcher(manifest: Mapping[str, Any]) -> list[str]:
    """An endpoint that another octoform published is brought up to this one: what guards it is part of it."""
    same = manifest.get("launcher") == program_digest()
    return [] if same else ["the endpoint was published by another version of octoform"]


def _checked(check: Mapping[str, Any] | None, manifest: Mapping[str, Any], wanted: Expected) -> list[str]:
    if check is None:
        return ["the endpoint was never seen to answer"]
    if not check["answered"]:
        return ["the endpoint did not answer when it was last checked"]
    names = set(manifest.get("tools", []) if wanted.tools is None else wanted.tools)
    added, gone = set(check["tools"]) - names, names - set(check["tools"])
    if not added and not gone:
        return []
    words = [f"+{name}" for name in sorted(added)] + [f"-{name}" for name in sorted(gone)]
    return [f"{OTHER_TOOLS}: {' '.join(words)}"]


def _check(layout: Layout) -> dict[str, Any] | None:
    try:
        value = read_json(layout.endpoint / CHECK)
    except (OSError, ValueError):
        return None
    return value if fits(value, {"answered": bool, "at": str, "tools": [str]}) else None
