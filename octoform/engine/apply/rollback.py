"""Keeps a host's files before an unattended run, and restores them when the run fails. (Heavy.)

A run that a person has started may stop half-way; its next one goes on. An unattended run may not leave a deployment
worse than it was: new artifacts of the first stages beside a server that was made for the former ones, or an endpoint
that was stopped because the new server did not pass. So all nodes, files and instances go back together, as one more
step of the state's history, and the former endpoint is served again.

What it had is on the disk before anything changes (`keep`), so that a run which is killed at any point is taken back
by anyone who opens the host next (`settle`): another run, a person's apply, the daemon as it starts.
"""

import base64
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from octoform.apply.context import CANDIDATE
from octoform.apply.rewrite import promotion
from octoform.base.files import parse, record
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import is_marked, running
from octoform.endpoint.published_files import CHECK, LAUNCHER, MANIFEST, read_manifest
from octoform.records import dataclass
from octoform.state.accepted import accept, contents, file_digest
from octoform.state.files import read_regular, spending, write_atomic
from octoform.state.layout import UNATTENDED, Layout
from octoform.state.model import NodeState, Snapshot, Status
from octoform.state.store.lock import Waiting, acquire
from octoform.state.store.store import StateStore

LOCK_SECONDS = 30.0
FORMAT = 1


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


def keep(former: Former) -> Diagnostic | None:
    """Write down what there is before a run begins; None when that is durable."""
    document = {
        "format": FORMAT,
        "nodes": {name: node.model_dump(mode="json") for name, node in former.nodes.items()},
        "files": {name: _texts(files) for name, files in former.files.items()},
        "local": _texts(former.local),
        "endpoint": _texts(former.endpoint),
        "ran": former.ran,
    }
    path = former.layout.local / UNATTENDED
    return spending(former.layout, lambda: write_atomic(path, json.dumps(document).encode(), 0o600))


def forget(layout: Layout) -> None:
    """The run has come to its end: nothing is to be taken back any more."""
    (layout.local / UNATTENDED).unlink(missing_ok=True)


@contextmanager
def taken_back(former: Callable[[], Former | None]) -> Iterator[None]:
    """A run that is ended in the middle, in order, is taken back at once; the caller that ended it gets that result."""
    try:
        yield
    except BaseException:
        there = former()
        if there is not None:
            go_back(there)  # what of it fails stays on the disk, and is settled by the next who opens the host
        raise


def settle(layout: Layout) -> tuple[tuple[str, ...], list[Diagnostic]]:
    """Take back what a killed unattended run has left: what a person is notified of it, and why that was not possible.

    The caller holds the state's lock, so that run is not at work any more.
    """
    data, _ = read_regular(layout.local / UNATTENDED)
    if data is None:
        return (), []
    try:
        former = _read(layout, parse(data))
    except (ValueError, LookupError, TypeError, AttributeError):
        forget(layout)  # the disk tore it before anything was changed
        return (), []
    found = _state_back(former)
    if has_errors(found):
        return (), found
    text = "took back what an unattended run had left when it was killed"
    unserved = [item.summary for item in _served_again(former) if has_errors([item])]
    forget(layout)  # what is not served then is a problem of its own, and no reason to refuse a person's apply
    return (": ".join([text, *unserved[:1]]),), found


def go_back(former: Former) -> list[Diagnostic]:
    """Make the host what it was; an error shows what could not be put back, and the next apply fixes that."""
    layout = former.layout
    acquired = acquire(layout, "rediscover", Waiting(timeout=LOCK_SECONDS))
    if acquired.lock is None:
        return list(acquired.diagnostics)
    with acquired.lock:
        return _gone_back(former)


def _gone_back(former: Former) -> list[Diagnostic]:
    found = _state_back(former)
    if not has_errors(found):
        found += _served_again(former)
    if not has_errors(found):
        forget(former.layout)
    return found


def _state_back(former: Former) -> list[Diagnostic]:
    """Nodes, artifacts and the files of the machine; what of a rewritten server was on its way is over with it."""
    for name in (promotion.RECORD, promotion.FORMER):
        (former.layout.local / name).unlink(missing_ok=True)
    store, found = StateStore.open(former.layout)
    if store is None or has_errors(found):
        return found
    for name in _changed(former, store):
        found += _node_back(former, store, name)
    found += store.commit_snapshot()
    return found if has_errors(found) else found + _files_back(former)


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
        start_stop.stop(layout)
        for name, data in former.endpoint.items():
            problem = write_atomic(layout.endpoint / name, data, 0o700 if name == LAUNCHER else 0o600)
            if problem is not None:
                return [problem]
    shutil.rmtree(layout.local / CANDIDATE, ignore_errors=True)  # nothing is published from there any more
    if not former.ran or is_marked(layout):
        return []
    process, problem = start_stop.start(layout)
    if process is not None:
        return []
    return [problem or error("ENDPOINT-START-FAILED", "the endpoint is not started again")]


def _there(found: Mapping[str, bytes | None]) -> dict[str, bytes]:
    return {name: data for name, data in found.items() if data is not None}


def _texts(files: Mapping[str, bytes]) -> dict[str, str]:
    return {name: base64.b64encode(data).decode() for name, data in files.items()}


def _bytes(files: Mapping[str, str]) -> dict[str, bytes]:
    return {str(name): base64.b64decode(text) for name, text in files.items()}


def _read(layout: Layout, told: Mapping[str, Any]) -> Former:
    """The record that `keep` wrote; ValueError, LookupError, TypeError or AttributeError when it is none of ours."""
    record(told, FORMAT)
    nodes = {str(name): NodeState.model_validate(node) for name, node in told["nodes"].items()}
    files = {str(name): _bytes(each) for name, each in told["files"].items()}
    return Former(layout, nodes, files, _bytes(told["local"]), _bytes(told["endpoint"]), bool(told["ran"]))
