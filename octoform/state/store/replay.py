"""State is the fold of the journal: snapshot and records in, snapshot out.

Pure, so that a crash at any point and a normal end go through the same few rules, and so that they can be tested over
all histories. A begin without an end leaves `interrupted`; an end of any kind replaces it. (Heavy: pydantic models.)
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from octoform.state.store.journal import Op, Record
from octoform.state.model import NodeState, Snapshot, Status

Nodes = dict[str, NodeState]


def fold(snapshot: Snapshot, records: Iterable[Record]) -> Snapshot:
    """The snapshot after all records, in order; lineage and serial stay. ValidationError for a record of no state."""
    nodes: Nodes = dict(snapshot.nodes)
    for record in records:
        rule = _RULES.get(record.op)
        if rule is not None:
            rule(nodes, record)
    return snapshot.model_copy(update={"nodes": nodes})


def _begin(nodes: Nodes, record: Record) -> None:
    begun = {"began_at": record.time, **record.data}
    _end_badly(nodes, record.node, Status.INTERRUPTED, {"interrupted": begun})


def _failure(nodes: Nodes, record: Record) -> None:
    _end_badly(nodes, record.node, Status.FAILED, {"failure": {"failed_at": record.time, **record.data}})


def _end_badly(nodes: Nodes, name: str, status: Status, told: Mapping[str, Any]) -> None:
    """What was accepted before stays known; only how the last run ended changes."""
    former = nodes.get(name, NodeState())
    kept = {key: value for key, value in former.detail.items() if key not in ("interrupted", "failure")}
    nodes[name] = former.model_copy(update={"status": status, "detail": {**kept, **told}})


def _success(nodes: Nodes, record: Record) -> None:
    nodes[record.node] = NodeState.model_validate(dict(record.data))


def _destroy(nodes: Nodes, record: Record) -> None:
    nodes.pop(record.node, None)


def _taint(nodes: Nodes, record: Record) -> None:
    if record.node in nodes:
        nodes[record.node] = nodes[record.node].model_copy(update={"tainted": True})


_RULES: Mapping[Op, Callable[[Nodes, Record], None]] = {
    Op.BEGIN: _begin,
    Op.SUCCESS: _success,
    Op.FAILURE: _failure,
    Op.DESTROY: _destroy,
    Op.TAINT: _taint,
}
