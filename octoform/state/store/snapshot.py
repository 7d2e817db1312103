"""Reads what one host's state is now: the snapshot with the journal folded onto it. Writes nothing.

A plan takes no lock, so it may read while an apply writes. The journal is read between two looks at the snapshot, and
all over again when the snapshot moved meanwhile. (Heavy: pydantic models.)
"""

import uuid
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydantic import ValidationError

from octoform import __version__
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.records import dataclass
from octoform.state.files import display, read_regular
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Snapshot, Status, state_digest
from octoform.state.store import journal as journals
from octoform.state.store.journal import Op, Reading, Record
from octoform.state.store.quick_read import backup_path, parse, recovery

# State is the fold of the journal: snapshot and records in, snapshot out.
#
# Pure, so that a crash at any point and a normal end go through the same few rules, and so that they can be tested over
# all histories. A begin without an end leaves `interrupted`; an end of any kind replaces it. (Heavy: pydantic models.)

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


def _end_badly(nodes: Nodes, name: str, status: Status, journal: Mapping[str, Any]) -> None:
    """Record how the last run ended; what was accepted before stays."""
    former = nodes.get(name, NodeState())
    kept = {key: value for key, value in former.detail.items() if key not in ("interrupted", "failure")}
    nodes[name] = former.model_copy(update={"status": status, "detail": {**kept, **journal}})


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


_TRIES = 5


@dataclass(frozen=True, slots=True)
class Current:
    """The stored state on disk.

    ``base`` is the state file (None: there is none yet) and ``folded`` what holds now; ``pending`` counts the node
    records that the state file has not absorbed; ``foreign`` shows that the journal continues another state file.
    """

    base: Snapshot | None
    folded: Snapshot
    reading: Reading
    pending: int
    foreign: bool

    @property
    def base_digest(self) -> str | None:
        """Digest of the state file's content."""
        return state_digest(self.base) if self.base is not None else None


def read_snapshot(layout: Layout) -> tuple[Snapshot | None, list[Diagnostic]]:
    """The state file; (None, []) when there is none, errors when it is not a state of this host."""
    data, problem = read_regular(layout.snapshot)
    if problem is not None:
        return None, [problem]
    if data is None:
        return None, []
    document, found = parse(data, layout)
    if document is None:
        return None, found
    try:
        return Snapshot.model_validate(document), []
    except ValidationError as invalid:
        return None, [_field(layout, invalid)]


def _field(layout: Layout, invalid: ValidationError) -> Diagnostic:
    first = invalid.errors(include_url=False, include_input=False)[0]
    pointer = "".join(f"/{part}" for part in first["loc"])
    more = f" (and {invalid.error_count() - 1} more)" if invalid.error_count() > 1 else ""
    # pydantic calls every value its input, and goes on about how it tried to read it.
    wrong = first["msg"].partition(",")[0].replace("Input should", "this value should")
    summary = f"the state file is damaged: {wrong}{more}"
    return error("STATE-NOT-STATE", summary, path=display(layout.snapshot), pointer=pointer, hint=recovery(layout))


def read_current(layout: Layout) -> tuple[Current | None, list[Diagnostic]]:
    """Snapshot and journal as of one moment, folded; None with errors when either cannot be trusted."""
    before, found = read_snapshot(layout)
    for _ in range(_TRIES):
        if has_errors(found):
            return None, found
        reading, result = journals.read(layout.journal)
        after, found = read_snapshot(layout)
        if before == after and not has_errors(found):
            return (None, result) if reading is None else _combine(layout, after, reading, result)
        before = after
    return None, [*found, _moving(layout)] if not has_errors(found) else found


def _moving(layout: Layout) -> Diagnostic:
    return error(
        "STATE-MOVED",
        "the state file changed again and again while it was read",
        path=display(layout.snapshot),
        hint="wait for what writes it to end, then run the command again",
    )


def _combine(
    layout: Layout, base: Snapshot | None, reading: Reading, diagnostics: list[Diagnostic]
) -> tuple[Current | None, list[Diagnostic]]:
    found = [*diagnostics, *_history(layout, base)]
    start = position(reading.records, state_digest(base) if base is not None else None)
    foreign = start is None
    records = reading.records[start:] if start is not None else ()
    ground = base or _first(layout, reading)
    try:
        folded = fold(ground, records)
    except ValidationError as invalid:
        summary = f"the journal holds a record of no state: {invalid.errors(include_url=False)[0]['msg']}"
        return None, [*found, error("STATE-JOURNAL-CORRUPT", summary, path=display(layout.journal))]
    if foreign and _steps(reading.records):
        found.append(_stale(layout, len(_steps(reading.records))))
    return Current(base, folded, reading, len(_steps(records)), foreign), found


def position(records: tuple[Record, ...], base: str | None) -> int | None:
    """The first record that the state file of digest ``base`` has not absorbed; None: none continues that file."""
    if not records:
        return 0
    for index in range(len(records) - 1, -1, -1):
        record = records[index]
        if record.op in (Op.HEAD, Op.COMMIT) and record.data.get("snapshot") == base:
            return index + 1
    return None


def _steps(records: tuple[Record, ...]) -> tuple[Record, ...]:
    return tuple(record for record in records if record.op not in (Op.HEAD, Op.COMMIT, Op.NOTE))


def _first(layout: Layout, reading: Reading) -> Snapshot:
    """The state before the first one; a first apply that was killed has minted the lineage already."""
    minted = reading.records[0].data.get("lineage") if reading.records else None
    lineage = minted if isinstance(minted, str) and reading.records[0].data.get("snapshot") is None else None
    return Snapshot(octoform=__version__, host=layout.host, lineage=lineage or str(uuid.uuid4()))


def _stale(layout: Layout, count: int) -> Diagnostic:
    return warning(
        "STATE-JOURNAL-STALE",
        f"{count} steps in the journal continue another state file than the one that is there; they are skipped",
        path=display(layout.journal),
        detail="the state file was replaced (a pull, a checkout, a copy) after a run that did not end",
        hint="the plan compares artifacts with the state that is there; what does not fit is shown as edited",
    )


def _history(layout: Layout, base: Snapshot | None) -> list[Diagnostic]:
    """Warnings about a state file that went, or that belongs to another history than this machine last saw."""
    data, problem = read_regular(backup_path(layout))
    document = parse(data, layout)[0] if data is not None and problem is None else None
    if document is None:
        return []
    if base is None:
        summary = "there is no state file, but this machine wrote one before"
        return [warning("STATE-MISSING", summary, path=display(layout.snapshot), hint=recovery(layout))]
    if document.get("lineage") != base.lineage:
        summary = f"the state has lineage {base.lineage}; this machine last wrote {document.get('lineage')}"
        hint = "if no one started this host's state again on purpose, restore the former one from git"
        return [warning("STATE-LINEAGE", summary, path=display(layout.snapshot), pointer="/lineage", hint=hint)]
    return []
