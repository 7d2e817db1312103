"""A small apply over three nodes, which can be killed anywhere and run again until it is done."""

from collections.abc import Sequence
from pathlib import Path

from octoform.base import digest
from octoform.diagnostics import error, has_errors
from octoform.state.accepted import accept, file_digest
from octoform.state.files import Checkpoint, check_writable
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Snapshot, Status
from octoform.state.store.lock import acquire
from octoform.state.store.store import Context, Ports, StateStore

NODES = ("probe", "identify", "serve")
STAMP = "2030-01-02T03:04:05Z"


def files_of(node: str, version: int) -> dict[str, bytes]:
    """What the node's agent makes of that version of its input."""
    if node == "serve":
        return {
            "server.py": b"# %d\n" % version,
            "runtime/bus.py": b"x = %d\n" % version,
            f"runtime/v{version}.py": b"",
        }
    return {"output.json": b'{"version": %d, "node": "%s"}\n' % (version, node.encode())}


def must(found: Sequence[object]) -> None:
    assert found == [], found


def apply(project: Path, version: int, checkpoint: Checkpoint) -> Snapshot:
    """Bring every node to ``version``; only nodes that are not there yet are worked on."""
    layout = Layout(project, "bench")
    acquired = acquire(layout, "apply")
    assert acquired.lock is not None, acquired.diagnostics
    with acquired.lock:
        must(check_writable(layout))
        store, found = StateStore.open(layout, Ports(checkpoint, lambda: STAMP))
        assert store is not None and not has_errors(found), found
        if store.snapshot.nodes.get("gone"):
            must(store.remove("gone"))
        for node in NODES:
            if not settled(layout, store.snapshot, node, version):
                _work(layout, store, node, version, checkpoint)
        must(store.commit_snapshot(Context(manifest_digest=f"sha256:{version}")))
        return store.snapshot


def settled(layout: Layout, snapshot: Snapshot, node: str, version: int) -> bool:
    known = snapshot.nodes.get(node)
    return (
        known is not None
        and known.status is Status.ACCEPTED
        and known.key == f"v{version}"
        and known.file_digest == file_digest(layout, node)
    )


def _work(layout: Layout, store: StateStore, node: str, version: int, checkpoint: Checkpoint) -> None:
    must(store.begin(node, {"version": version}))
    if node == "identify" and version == 2:
        must(store.failure(node, [error("IDENTIFY-INVENTED-DEVICE", "no such device")]))
        must(store.begin(node, {"version": version}))
    must(accept(layout, node, files_of(node, version), checkpoint))
    state = NodeState(
        key=f"v{version}",
        key_parts={"spec": f"sha256:{version}"},
        output_digest=digest.of_value(version),
        file_digest=file_digest(layout, node) or "",
        attempts=1,
        accepted_at=STAMP,
    )
    must(store.success(node, state))
