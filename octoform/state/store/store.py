"""The one face of the state for anyone who changes it: each step journalled, then one new snapshot.

The order is always: begin is durable before anything happens, the end is durable before it is reported, the new
snapshot is in place before the journal goes. So a kill at any point leaves either the former state, or the former
state with some nodes marked `interrupted`, or the new state. (Heavy: pydantic models.)
"""

import uuid
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from octoform import __version__
from octoform.base.clock import stamp
from octoform.diagnostics import Diagnostic, error, has_errors, to_json
from octoform.records import dataclass, field
from octoform.state import files, model
from octoform.state.files import (
    Checkpoint,
    display,
    make_folders,
    pass_by,
    read_regular,
    write_atomic,
)
from octoform.state.layout import Layout
from octoform.state.model import GitRecord, NodeState, Snapshot, content_digest, state_digest
from octoform.state.store.journal import Journal, Op, Record
from octoform.state.store.quick_read import backup_path
from octoform.state.store.snapshot import Current, fold, read_current, read_snapshot

JOURNAL_RECORDS = 1000
_FAILURES_KEPT = 20
_TEXT_KEPT = 4000


@dataclass(frozen=True, slots=True)
class Context:
    """The facts of a whole run: recorded in the snapshot, but no reason for a new serial (the manifest is one)."""

    manifest_digest: str | None = None
    git: GitRecord | None = None
    tier1: bool = False


@dataclass(frozen=True, slots=True)
class Ports:
    """The parts that a test may replace: the crash points and the clock."""

    checkpoint: Checkpoint = pass_by
    clock: Callable[[], str] = field(default=stamp)


class StateStore:
    """One host's state, opened. Reading needs no lock; every method that writes needs the caller to hold it.

    Writing methods return an empty list when the step is durable, else why it is not; then nothing has changed.
    """

    def __init__(self, layout: Layout, current: Current, ports: Ports) -> None:
        """Use `open_store`."""
        self._layout = layout
        self._ports = ports
        self._folded = current.folded
        self._base = current.base
        self._known = {current.base_digest}
        self._foreign = current.foreign
        self._journal = Journal(layout.journal, current.reading, ports.checkpoint)
        self._dirty = current.pending > 0
        self._run = uuid.uuid4().hex[:12]

    @classmethod
    def open(cls, layout: Layout, ports: Ports | None = None) -> tuple["StateStore | None", list[Diagnostic]]:
        """The state as it is on disk, journal folded; None with errors when it cannot be trusted. Writes nothing."""
        current, found = read_current(layout)
        return (cls(layout, current, ports or Ports()) if current is not None else None), found

    @property
    def snapshot(self) -> Snapshot:
        """The state as of the last step. ``serial`` is that of the state file until `commit_snapshot`."""
        return self._folded

    @property
    def exists(self) -> bool:
        """Whether there is a state file yet."""
        return self._base is not None

    @property
    def unsettled(self) -> bool:
        """Whether there are steps that the state file has not absorbed."""
        return self._dirty

    def begin(self, node: str, data: Mapping[str, Any] | None = None) -> list[Diagnostic]:
        """Say that work on a node starts; until its end is recorded the node is `interrupted`."""
        problem = make_folders(self._layout) or files.hold(self._layout)
        return [problem] if problem is not None else self._step(Op.BEGIN, node, data or {})

    def success(self, node: str, state: NodeState) -> list[Diagnostic]:
        """Say that a node's output is accepted and in place."""
        return self._step(Op.SUCCESS, node, model.to_json(state))

    def failure(
        self, node: str, diagnostics: Iterable[Diagnostic] = (), data: Mapping[str, Any] | None = None
    ) -> list[Diagnostic]:
        """Say that a node's run failed; what was accepted before stays. Also stored in ``detail["failure"]``."""
        lines = [_bounded(to_json(item)) for item in list(diagnostics)[:_FAILURES_KEPT]]
        return self._step(Op.FAILURE, node, {"diagnostics": lines, **(data or {})})

    def remove(self, node: str) -> list[Diagnostic]:
        """Forget a node: it was destroyed, or a person removed it from the state."""
        return self._step(Op.DESTROY, node, {})

    def taint(self, node: str) -> list[Diagnostic]:
        """Mark a node for replacement by the next apply."""
        return self._step(Op.TAINT, node, {})

    def _step(self, op: Op, node: str, data: Mapping[str, Any]) -> list[Diagnostic]:
        if self._journal.count >= JOURNAL_RECORDS:
            found = self.commit_snapshot()
            if has_errors(found):
                return found
        problem = self._head() or self._append(op, node, data)
        if problem is not None:
            return [problem]
        return []

    def _head(self) -> Diagnostic | None:
        """The first record of a journal names the snapshot that it continues."""
        problem = make_folders(self._layout)
        problem = problem or self._part_with_foreign()
        if problem is not None or self._journal.count > 0:
            return problem
        base = state_digest(self._base) if self._base is not None else None
        return self._append(Op.HEAD, "", {"lineage": self._folded.lineage, "snapshot": base})

    def _part_with_foreign(self) -> Diagnostic | None:
        """Move a journal that continues another state file out of the way; a person may still look at it."""
        problem = self._journal.set_aside(self._layout.journal.with_suffix(".stale")) if self._foreign else None
        self._foreign = problem is not None
        return problem

    def _append(self, op: Op, node: str, data: Mapping[str, Any]) -> Diagnostic | None:
        record = Record(self._journal.count + 1, self._ports.clock(), op, self._run, node, data)
        problem = files.spending(self._layout, lambda: self._journal.append(record))
        if problem is None:
            self._folded = fold(self._folded, (record,))
            self._dirty = self._dirty or op not in (Op.HEAD, Op.COMMIT)
        return problem

    def commit_snapshot(self, context: Context | None = None) -> list[Diagnostic]:
        """Write the state file when its content changed, with the next serial; then drop the journal.

        STATE-MOVED when the state file is no longer the one that was opened: nothing is overwritten.
        """
        there, problem = self._there()
        if problem is not None:
            return [problem]
        wanted = self._folded.model_copy(update={"octoform": __version__, **_facts_of(context)})
        if there is not None and content_digest(wanted) == content_digest(there):
            return self._settle(there)
        if there is None and not wanted.nodes and not self._dirty:
            return []
        wanted = wanted.model_copy(update={"serial": there.serial + 1 if there is not None else 1})
        problem = self._head()
        problem = problem or self._append(Op.COMMIT, "", {"serial": wanted.serial, "snapshot": state_digest(wanted)})
        self._known.add(state_digest(wanted))
        problem = problem or files.spending(self._layout, self._keep_former)
        problem = problem or files.spending(self._layout, lambda: self._replace(wanted))
        return [problem] if problem is not None else self._settle(wanted)

    def _replace(self, wanted: Snapshot) -> Diagnostic | None:
        checkpoint = self._ports.checkpoint
        return write_atomic(self._layout.snapshot, model.encode(wanted), 0o644, checkpoint, "snapshot")

    def _keep_former(self) -> Diagnostic | None:
        """Keep the state file that is about to be replaced, as it is."""
        data, problem = read_regular(self._layout.snapshot)
        if data is None:
            return problem
        return write_atomic(backup_path(self._layout), data, 0o600, self._ports.checkpoint, "backup")

    def _there(self) -> tuple[Snapshot | None, Diagnostic | None]:
        """The state file, which must still be what was opened, or what a commit that half failed put there."""
        there, found = read_snapshot(self._layout)
        if found:
            return None, found[0]
        if (state_digest(there) if there is not None else None) in self._known:
            return there, None
        return None, error(
            "STATE-MOVED",
            "the state file was replaced while this run was going on; it is not overwritten",
            path=display(self._layout.snapshot),
            detail=f"opened at serial {self._folded.serial}, now at serial {there.serial if there else '(none)'}",
            hint="the steps of this run are in the journal; restore the state file to fold them in, or plan again",
        )

    def _settle(self, snapshot: Snapshot) -> list[Diagnostic]:
        self._base = self._folded = snapshot
        self._known = {state_digest(snapshot)}
        self._dirty = False
        problem = self._part_with_foreign() or self._journal.clear() or files.give_back(self._layout)
        return [problem] if problem is not None else []


def _facts_of(context: Context | None) -> dict[str, Any]:
    if context is None:
        return {}
    return {"manifest_digest": context.manifest_digest, "git": context.git, "tier1": context.tier1}


def _bounded(document: dict[str, object]) -> dict[str, object]:
    """A diagnostic as it is kept in the state: no text longer than a screen."""
    return {key: value[:_TEXT_KEPT] if isinstance(value, str) else value for key, value in document.items()}
