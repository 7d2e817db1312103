"""Run in a mount namespace of its own: an apply on a file system that fills, with every amount of room left.

Where no file system may be mounted, the same happens below a limit on the size of a file.
"""

import resource
import subprocess
import sys
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.state.accepted import accept, file_digest
from octoform.state.files import check_writable, full_disk
from octoform.state.layout import Layout
from octoform.state.model import NodeState
from octoform.state.store.store import StateStore

SIZE = 2 * 1024 * 1024


def room(folder: Path, pages: int | None) -> None:
    """Fill the file system and leave so many pages; None removes the filling."""
    filling = folder / "filling"
    filling.unlink(missing_ok=True)
    if pages is None:
        return
    with filling.open("wb", buffering=0) as stream:
        try:
            while True:
                stream.write(bytes(4096))
        except OSError:
            stream.truncate(max(0, stream.tell() - pages * 4096))


def step(layout: Layout, version: int) -> tuple[list[Diagnostic], bool]:
    """One node's work: why it failed, and whether the failure came before the work began."""
    store, found = StateStore.open(layout)
    assert store is not None, found
    found = store.begin("serve")
    if found:
        return found, True
    found = accept(layout, "serve", {"server.py": b"#%d\n" % version + bytes(60_000), "runtime/a.py": b"a" * 5000})
    digest = file_digest(layout, "serve") or ""
    found = found or store.success("serve", NodeState(key=str(version), file_digest=digest, detail={"t": "x" * 20_000}))
    return found or store.commit_snapshot(), False


def check(layout: Layout) -> str:
    """The state opens, and what it calls accepted is there."""
    store, found = StateStore.open(layout)
    assert store is not None, found
    state = store.snapshot.nodes["serve"]
    if state.status.value == "accepted":
        assert state.file_digest == file_digest(layout, "serve"), state.key
    return f"{state.status.value} {state.key}"


def main(folder: Path) -> None:
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "none", str(folder)], capture_output=True, check=False
    )
    if mounted.returncode != 0:
        resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))
    project = folder / "project"
    project.mkdir()
    layout = Layout(project, "bench")
    if mounted.returncode != 0:
        assert [item.code for item in check_writable(layout)] == ["STATE-DISK-FULL"]
        print("survived")
        return
    assert step(layout, 0) == ([], False)
    outcomes = set()
    for version, pages in enumerate([*range(0, 40), *range(120, 180, 3)], start=1):
        room(folder, pages)
        before = check(layout)
        found, early = step(layout, version)
        assert {item.code for item in found} <= {"STATE-DISK-FULL"}, found
        assert not found or str(folder) in found[0].summary, found
        assert early or not found, (pages, found)  # once begun, the reserve carries the step to its end
        after = check(layout)
        assert after == (before if found else f"accepted {version}"), (pages, before, after)
        outcomes.add("refused" if found else "done")
    assert outcomes == {"refused", "done"}
    room(folder, 0)
    assert full_disk(layout) is not None
    room(folder, None)
    assert check_writable(layout) == [] and full_disk(layout) is None
    assert step(layout, 1000) == ([], False)
    print(check(layout))
    print("survived")


main(Path(sys.argv[1]))
