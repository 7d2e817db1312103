"""A project that stands as an apply would have left it, without running one: state, artifacts, endpoint.

The files are put in place by the product's own writers (state store, artifacts, endpoint), the artifacts are those of
the scripted agent, and the serving environment is an empty one that is whole by its own record. For tests of what
comes after an apply: plans, drift, the memo.
"""

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from endings import record_running
from launched import policy_of

from octoform import host
from octoform.base import digest
from octoform.contracts.canonical import output_digest
from octoform.endpoint.environment.model import MARKER, Environment, locate, packages_of
from octoform.endpoint.publication import Service, write_endpoint
from octoform.endpoint.published_files import CHECK
from octoform.engine.plan.configuration import Compiled, compile_project
from octoform.engine.plan.refresh import contract_digest
from octoform.graph.model import Node, NodeKind, key_of, key_parts
from octoform.state.accepted import accept, file_digest
from octoform.state.artifact_cache import write_instances
from octoform.state.files import write_atomic
from octoform.state.layout import OUTPUT_NAMES, STAGES, Layout
from octoform.state.model import NodeState, Usage
from octoform.state.store.store import Ports, StateStore

GOOD = Path(__file__).parents[1] / "agent" / "good"
RUNTIME = b'"""Stands for the modules beside a generated server."""\n'
LOCK = "fastmcp==4.1.0\n"
STAMP = "2026-01-01T00:00:00Z"


def sysroot(folder: Path, modaliases: Sequence[str]) -> Path:
    """A system root whose kernel announces these devices and nothing else."""
    shutil.rmtree(folder, ignore_errors=True)
    for number, text in enumerate(modaliases):
        device = folder / "sys" / "bus" / text.partition(":")[0] / "devices" / f"device{number}"
        device.mkdir(parents=True)
        (device / "modalias").write_text(text + "\n")
    for name, text in {"version": "Linux version 6.1.0\n", "sys/kernel/arch": "x86_64\n"}.items():
        path = folder / "proc" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


@dataclass
class Settled:
    """Builds the state of one project folder; ``environ`` is what octoform sees of the environment."""

    project: Path
    environ: Mapping[str, str] = field(default_factory=dict)

    def apply(self) -> Layout:
        """Every node accepted, the endpoint written and seen to answer."""
        compiled = self.compiled()
        store = self.store(compiled.layout)
        fingerprint = host.fingerprint(host.root_from_environment(self.environ))
        for node in compiled.graph.nodes:
            assert store.begin(node.name) == []
            if node.name in STAGES:
                self._stage(compiled, node.name)
            elif node.name in compiled.steps:
                self._step(compiled, node.name)
            else:
                self.publish(compiled.layout)
            outputs = {name: store.snapshot.nodes[name].output_digest for name in node.consumes}
            parts = key_parts(node, outputs, fingerprint.digest)
            assert store.success(node.name, self._state(compiled, node, parts)) == []
        remembered = {"format": 1, "digest": fingerprint.digest, "entries": list(fingerprint.entries)}
        assert write_instances(compiled.layout, {}) == []
        assert write_atomic(compiled.layout.fingerprint, json.dumps(remembered).encode(), 0o600) is None
        assert store.commit_snapshot() == []
        return compiled.layout

    def compiled(self) -> Compiled:
        """The project as it is compiled now."""
        compiled, found = compile_project(self.project, self.environ)
        assert compiled is not None, found
        return compiled

    def store(self, layout: Layout) -> StateStore:
        """The state, with a clock that stands still."""
        store, found = StateStore.open(layout, Ports(clock=lambda: STAMP))
        assert store is not None, found
        return store

    def _stage(self, compiled: Compiled, stage: str) -> None:
        name = OUTPUT_NAMES.get(stage, "output.json")
        files = {name: (GOOD / ("server.py" if stage == "serve" else f"{stage}.json")).read_bytes()}
        if stage == "serve":
            files["runtime/__init__.py"] = RUNTIME
        if stage == "deploy":
            files["requirements.txt"] = LOCK.encode()
        assert accept(compiled.layout, stage, files) == []

    def _step(self, compiled: Compiled, name: str) -> None:
        """A step that was skipped: there was nothing to prove."""
        nothing: dict[str, Any] = {"device": None, "server": None, "trials": [], "skipped": [], "camera": None}
        document = {"format": 1, "step": compiled.steps[name].name, **nothing}
        assert accept(compiled.layout, name, {"output.json": json.dumps(document).encode()}) == []

    def _state(self, compiled: Compiled, node: Node, parts: dict[str, str]) -> NodeState:
        output = digest.of_value(parts)
        if node.kind is not NodeKind.ENDPOINT:
            output = output_digest(node.name, value(compiled.layout, node.name), compiled.schemas)
        place = STAGES.index(node.name) if node.name in STAGES else len(STAGES)
        return NodeState(
            key=key_of(parts),
            key_parts=parts,
            output_digest=output,
            file_digest=(file_digest(compiled.layout, node.name) or "") if node.kind is not NodeKind.ENDPOINT else "",
            harness=node.harness,
            model=node.model,
            attempts=1 if node.name in STAGES else 0,
            usage=Usage(input_tokens=1200 * (place + 1), output_tokens=300 * (place + 1)) if node.model else Usage(),
            seconds=1.5 + place,
            accepted_at=STAMP,
            detail={"contract": contract_digest(compiled.schemas)},
        )

    def publish(self, layout: Layout) -> None:
        """The endpoint written, recorded as running, and seen to answer."""
        tools = value(layout, "interface")["tools"]
        assert write_endpoint(layout, environment(layout), Service(tools, policy_of(tools)), self.environ) == []
        record_running(layout.run)
        answer = {
            "format": 1,
            "at": datetime(2026, 1, 1, tzinfo=UTC).isoformat(),
            "answered": True,
            "tools": [tool["name"] for tool in tools],
            "calls": [],
        }
        (layout.endpoint / CHECK).write_text(json.dumps(answer))


def value(layout: Layout, stage: str) -> Any:
    """An accepted artifact as a value."""
    text = layout.output(stage).read_text()
    return text if stage == "serve" else json.loads(text)


def environment(layout: Layout) -> Environment:
    """A serving environment with one distribution and an interpreter that is only a name."""
    made = locate(layout, LOCK)
    (packages_of(made.path) / "fastmcp-4.1.0.dist-info").mkdir(parents=True, exist_ok=True)
    made.python.parent.mkdir(exist_ok=True)
    made.python.write_text("#!/bin/sh\n")
    made.python.chmod(0o700)
    marker = {"format": 1, "digest": made.digest, "lock": made.lock, "distributions": ["fastmcp-4.1.0"]}
    (made.path / MARKER).write_text(json.dumps(marker))
    return made


def tree(folder: Path) -> dict[str, tuple[int, int, bytes]]:
    """Everything below a folder: mode, time and bytes (or where a link points), to see that nothing was written."""
    found = {}
    for root, folders, files in os.walk(folder):
        for name in [*folders, *files]:
            path = Path(root, name)
            facts = path.lstat()
            data = str(path.readlink()).encode() if path.is_symlink() else b"" if path.is_dir() else path.read_bytes()
            found[str(path.relative_to(folder))] = (facts.st_mode, facts.st_mtime_ns, data)
    return found
