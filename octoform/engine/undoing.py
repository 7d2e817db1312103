"""What a host had before an unattended run, and putting it back when that fails: the last good stays. (Heavy.)

A run that a person has started may stop half-way; its next one goes on. An unattended run may not leave a deployment
worse than it was: new artifacts of the first stages beside a server that was made for the former ones, or an endpoint
that was stopped because the new server did not pass. So all nodes, files and instances go back together, as one more
step of the state's history, and the former endpoint is served again.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint import supervising
from octoform.endpoint.files import CHECK, LAUNCHER, MANIFEST, read_manifest
from octoform.endpoint.running import running
from octoform.endpoint.stopmark import is_marked
from octoform.state.artifacts import accept, contents, file_digest
from octoform.state.files import read_regular, write_atomic
from octoform.state.layout import Layout
from octoform.state.lock import Waiting, acquire
from octoform.state.model import NodeState, Snapshot, Status
from octoform.state.store import StateStore

LOCK_SECONDS = 30.0


@dataclass(frozen=True, slots=True)
class Former:
    """A host as it was: nodes with their files, the files that stay on the machine, and whether the endpoint ran."""

    layout: Layout
    nodes: Mapping[str, NodeState]
    files: Mapping[str, Mapping[str, bytes]]
    local: Mapping[str, bytes]
    endpoint: Mapping[str, bytes]
    ran: bool


def remember(layout: Layout, snapshot: Snapshot) -> Former | None:
    """The host as it is; None when it is not whole, so that there is nothing good to go back to."""
    nodes = dict(snapshot.nodes)
    files = {}
    for name, node in nodes.items():
        if not node.file_digest:
            continue
        found = contents(layout, name)
        if found is None or node.status is not Status.ACCEPTED or file_digest(layout, name) != node.file_digest:
            return None
        files[name] = found
    manifest = read_manifest(layout)
    if manifest is None:
        return None
    names = (*manifest["files"], MANIFEST, CHECK)
    served = {name: read_regular(layout.endpoint / name)[0] for name in names}
    local = {path.name: read_regular(path)[0] for path in (layout.instances, layout.fingerprint)}
    return Former(layout, nodes, files, _there(local), _there(served), running(layout) is not None)


def go_back(former: Former) -> list[Diagnostic]:
    """Make the host what it was; an error tells what could not be put back, and the next apply mends that."""
    layout = former.layout
    acquired = acquire(layout, "rediscover", Waiting(timeout=LOCK_SECONDS))
    if acquired.lock is None:
        return list(acquired.diagnostics)
    with acquired.lock:
        store, found = StateStore.open(layout)
        if store is None or has_errors(found):
            return found
        changed = _changed(former, store)
        for name in changed:
            found += _node_back(former, store, name)
        found += store.commit_snapshot()
        if has_errors(found):
            return found
        return found + _files_back(former) + _served_again(former)


def _changed(former: Former, store: StateStore) -> list[str]:
    now = store.snapshot.nodes
    names = {name for name in {*former.nodes, *now} if former.nodes.get(name) != now.get(name)}
    return sorted(names | {name for name, files in former.files.items() if contents(former.layout, name) != files})


def _node_back(former: Former, store: StateStore, name: str) -> list[Diagnostic]:
    before = former.nodes.get(name)
    if before is None:
        return store.remove(name)
    found = accept(former.layout, name, former.files[name]) if name in former.files else []
    return found if has_errors(found) else [*found, *store.success(name, before)]


def _files_back(former: Former) -> list[Diagnostic]:
    layout, found = former.layout, []
    for name, data in former.local.items():
        found.append(write_atomic(layout.local / name, data, 0o600))
    return [problem for problem in found if problem is not None]


def _served_again(former: Former) -> list[Diagnostic]:
    """The endpoint as it was published, running if it ran."""
    layout = former.layout
    same = all(read_regular(layout.endpoint / name)[0] == data for name, data in former.endpoint.items())
    if not same:
        supervising.stop(layout)
        for name, data in former.endpoint.items():
            problem = write_atomic(layout.endpoint / name, data, 0o700 if name == LAUNCHER else 0o600)
            if problem is not None:
                return [problem]
    if not former.ran or is_marked(layout):
        return []
    process, problem = supervising.start(layout)
    if process is not None:
        return []
    return [problem or error("ENDPOINT-START-FAILED", "the endpoint is not started again")]


def _there(found: Mapping[str, bytes | None]) -> dict[str, bytes]:
    return {name: data for name, data in found.items() if data is not None}
