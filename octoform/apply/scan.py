"""The host's own scan beside another agent's PROBE: the embedded agent looks too, and its word is what that is held to.

It costs no model and finds all that the kernel shows. It runs in a folder that the judged agent cannot reach.
"""

import dataclasses
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from octoform.apply.context import Context
from octoform.apply.gate import BYTES_QUOTED, artifacts, read_output, read_value, shown
from octoform.apply.leaks import blanked
from octoform.base.files import parse, replace
from octoform.contracts.checking import check, has_shape
from octoform.contracts.model import HostScan
from octoform.contracts.probe_host_rules import completed
from octoform.diagnostics import Diagnostic, warning
from octoform.harness.port import AgentEvent, ExitReason, Outcome, Task, TaskLimits, Usage
from octoform.harness.registry import resolve
from octoform.manifest.model import HarnessSpec
from octoform.protocol.fence import tail

STAGE = "scan"
SECONDS = 120.0
EMBEDDED = HarnessSpec("builtin")


def scan_beside(context: Context, probe: Any) -> tuple[HostScan | None, list[Diagnostic]]:
    """What the host shows, and which words of ``probe`` it never says; None with a warning where nobody could look."""
    try:
        with TemporaryDirectory(prefix="octoform-scan-") as name:
            return _scanned(context, Path(name), probe)
    except OSError as problem:
        return None, [_not_held(f"{problem.strerror or problem}")]


def judge(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
    """PROBE of another agent: parse, schema and rules, and what it says against what the host shows."""
    value, found = read_value(task, data)
    if value is None:
        return None, found
    fits = has_shape("probe", value, context.schemas)
    scan, more = scan_beside(context, value) if fits else (None, [])
    known = dataclasses.replace(artifacts(context, "probe", value), scan=scan)
    found += [*check("probe", value, known, context.schemas, shown(task.output)), *more]
    return completed(value, scan) if scan is not None else value, found


def _scanned(context: Context, folder: Path, probe: Any) -> tuple[HostScan | None, list[Diagnostic]]:
    task = _task(context, folder)
    given = folder / "input.json"
    replace(given, json.dumps(probe).encode("utf-8", "surrogatepass"), 0o600, synced=False)
    document = {"format": 1, "stage": STAGE, "input": str(given), "output": str(task.output)}
    replace(task.document, json.dumps(document).encode(), 0o600, synced=False)
    harness = resolve(EMBEDDED, context.environ, None)
    assert not isinstance(harness, Diagnostic)
    outcome = harness.run(task, _unheard)
    data, found = read_output(task)
    if outcome.reason is not ExitReason.FINISHED or found:
        return None, [_not_held(_reason(task, outcome))]
    value = parse(data, any_text=True)
    # What is held to it has no secrets of devices any more.
    return HostScan(blanked(value["probe"]), tuple(value["unsaid"]), tuple(value["untrue"])), []


def _task(context: Context, folder: Path) -> Task:
    return Task(
        stage=STAGE,
        attempt=1,
        workdir=folder,
        prompt=folder / "prompt.md",
        output=folder / "output.json",
        log=folder / "agent.log",
        document=folder / "task.json",
        model=None,
        environment=context.environ,
        limits=TaskLimits(SECONDS),
        secrets=context.manifest.variables,
    )


def _unheard(_event: AgentEvent, _elapsed: float, _used: Usage) -> None:
    """It tells of nothing that a person waits for."""


def _reason(task: Task, outcome: Outcome) -> str:
    return outcome.detail or tail(task.log, 1, BYTES_QUOTED) or outcome.reason.value


def _not_held(reason: str) -> Diagnostic:
    return warning(
        "PROBE-NOT-HELD",
        f"what PROBE says could not be held against this host: {reason}",
        hint="`octoform apply -replace probe` tries it again; leave stages.probe out and the embedded agent does PROBE",
    )
