"""The identified devices of a host, where each is attached now, and what was omitted. (Heavy.)

State and ledger say what was found; the generated server's own way to find a device reports where it is now, in a
process of its own, since nothing here has access to hardware.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.contracts.model import Artifacts
from octoform.contracts.rules.raw_line_rules import is_raw_line, lines_answered_incompletely
from octoform.diagnostics import Diagnostic, warning
from octoform.endpoint.published_files import describe_closed, served_nodes
from octoform.engine.plan import device_knowledge
from octoform.engine.plan.configuration import compile_project
from octoform.engine.plan.refresh import artifacts_there
from octoform.host import SYSROOT_VARIABLE
from octoform.records import dataclass, replace
from octoform.state.artifact_cache import classes_of, read_instances
from octoform.state.layout import Layout

WHERE_SECONDS = 30.0
_ACTS = frozenset({"actuator", "bidirectional"})


@dataclass(frozen=True, slots=True)
class Attached:
    """Where a device is now: ``port`` and ``nodes``; ``doubt`` is why it is absent, or why nothing is moved with it.

    ``refused`` are the nodes that this user may not use, as `octoform.runtime.where.refused` lists them.
    """

    attached: bool
    port: str
    strength: str
    nodes: tuple[str, ...]
    doubt: str
    refused: tuple[Mapping[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Row:
    """One identified device. ``now`` is None when that could not be found out.

    ``serial`` is real and of this machine; ``pseudonym`` stands for it in what is committed. ``evidence`` are quotes.
    """

    id: str
    identified_as: str
    category: str
    tools: tuple[str, ...]
    now: Attached | None
    serial: str
    pseudonym: str
    evidence: tuple[str, ...]
    missing: str
    needs_profile: bool = False
    """Only a raw line leads to it, no profile holds for it, and no answer names it, or bounds what acts."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A device that PROBE listed and IDENTIFY omitted."""

    id: str
    reason: str
    detail: str


@dataclass(frozen=True, slots=True)
class Listing:
    """All devices of one host; ``ledger`` is false when this machine does not know its units.

    ``offers`` are profiles that come with octoform and match a device, which the manifest does not name.
    """

    host: str
    devices: tuple[Row, ...]
    left_out: tuple[LeftOut, ...]
    ledger: bool
    offers: tuple[device_knowledge.Offer, ...] = ()


def listing(project: Path, environ: Mapping[str, str]) -> tuple[Listing | None, list[Diagnostic]]:
    """The content of `devices`; None where PROBE or IDENTIFY was never accepted. Changes nothing."""
    compiled, found = compile_project(project, environ)
    if compiled is None:
        return None, found
    layout = compiled.layout
    needed = ("probe", "identify")
    artifacts, problem = artifacts_there(compiled, (*needed, "interface"), needed)
    if problem is not None:
        return None, [problem]
    ledger, result = read_instances(layout)
    listed = _listed(layout, artifacts, ledger, environ, compiled.manifest.answers)
    listed = replace(listed, offers=device_knowledge.offered(artifacts, compiled))
    return listed, [*found, *result, *device_knowledge.offers(artifacts, compiled)]


def _listed(
    layout: Layout,
    artifacts: Mapping[str, Mapping[str, Any]],
    ledger: Mapping[str, object] | None,
    environ: Mapping[str, str],
    answers: Mapping[str, str],
) -> Listing:
    annotated = artifacts["identify"]["devices"]
    known = {name: item for name, item in (ledger or {}).items() if isinstance(item, dict)}
    committed = {device["id"]: device.get("instance") or {} for device in artifacts["probe"]["devices"]}
    tools: dict[str, list[str]] = {}
    for tool in artifacts["interface"].get("tools", ()):
        for name in tool.get("devices", ()):
            tools.setdefault(name, []).append(tool["name"])
    # Only Linux shows in files where a device is now.
    followed = annotated if str(artifacts["probe"]["platform"]["os"]).casefold() == "linux" else ()
    lines = {device["id"] for device in artifacts["probe"]["devices"] if is_raw_line(device)}
    given = Artifacts(probe=dict(artifacts["probe"]), answers=answers)
    incomplete = lines_answered_incompletely(dict(artifacts["identify"]), given)
    now = attached(layout, environ, {device["id"]: classes_of(known.get(device["id"])) for device in followed})
    rows = tuple(
        Row(
            id=device["id"],
            identified_as=device["identified_as"],
            category=device["category"],
            tools=tuple(tools.get(device["id"], ())),
            now=now.get(device["id"]),
            serial=str(known.get(device["id"], {}).get("serial") or ""),
            pseudonym=str(committed.get(device["id"], {}).get("serial") or ""),
            evidence=tuple(item["quote"] for item in device["evidence"]),
            missing=str(device.get("missing") or ""),
            needs_profile=device["id"] in lines
            and "profile" not in device
            and (device["method"] != "user_answer" or (device["category"] in _ACTS and device["id"] in incomplete)),
        )
        for device in annotated
    )
    left = artifacts["identify"]["left_out"]
    out = tuple(LeftOut(item["id"], item["reason"], str(item.get("detail") or "")) for item in left)
    return Listing(layout.host, rows, out, ledger is not None)


def attached(layout: Layout, environ: Mapping[str, str], asked: Mapping[str, list[str]]) -> dict[str, Attached]:
    """Where each device is; empty when the looking itself fails or hangs."""
    environment = {"PATH": environ.get("PATH", ""), "OCTOFORM_INSTANCES": str(layout.instances)}
    if environ.get(SYSROOT_VARIABLE):
        environment[SYSROOT_VARIABLE] = environ[SYSROOT_VARIABLE]
    command = [sys.executable, "-I", "-m", "octoform.runtime.where"]
    try:
        ended = subprocess.run(
            command,
            input=json.dumps(asked),
            env=environment,
            capture_output=True,
            text=True,
            timeout=WHERE_SECONDS,
            check=True,
        )
        answers = files.parse(ended.stdout)
    except (OSError, ValueError, subprocess.SubprocessError):
        return {}  # the rows say that it is not known
    return {name: _attached(answer) for name, answer in answers.items()}


def _attached(answer: Mapping[str, Any]) -> Attached:
    fields = {field: answer[field] for field in ("attached", "port", "strength", "doubt")}
    return Attached(**fields, nodes=tuple(answer["nodes"]), refused=tuple(answer["refused"]))


# The served devices that this user may not use, asked now: for an apply, the doctor and the coverage.

CODE = "ENDPOINT-NO-RIGHTS"


def lacking(layout: Layout, environ: Mapping[str, str]) -> dict[str, str]:
    """A sentence for each device of the endpoint's tools with a node that this user may not use, by device id."""
    ledger = read_instances(layout)[0] or {}
    asked = {name: classes for name in served_nodes(layout) if (classes := classes_of(ledger.get(name)))}
    now = attached(layout, environ, asked) if asked else {}
    return {name: "; ".join(map(describe_closed, each.refused)) for name, each in now.items() if each.refused}


def diagnostics(shut: Mapping[str, str]) -> tuple[Diagnostic, ...]:
    """The findings of `lacking` as warnings: only the tools of these devices answer with an error."""
    hint = "octoform doctor looks again; no other apply is needed"
    return tuple(warning(CODE, f"{name} cannot be used: {why}", hint=hint) for name, why in sorted(shut.items()))
