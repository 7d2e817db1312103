"""A disk that fills and a folder that cannot be written: one clear diagnostic, and nothing lost."""

import errno
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from octoform.base.files import TEMPORARY
from octoform.diagnostics import Diagnostic
from octoform.state.accepted import accept, file_digest
from octoform.state.files import check_writable, full_disk, read_regular, refused, reserve_path, write_atomic
from octoform.state.layout import Layout
from octoform.state.model import NodeState
from octoform.state.store.store import Ports, StateStore

HERE = Path(__file__).parent
NOBODY = 65534


def in_child(work: Callable[[], str]) -> str:
    """What ``work`` returns in a forked process, so that its limits and identity end with it."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        text = "no answer"
        try:
            os.close(reader)
            text = work()
        except (OSError, AssertionError, RuntimeError) as problem:
            text = repr(problem)
        finally:
            os.write(writer, text.encode())
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as stream:
        answer = stream.read()
    os.waitpid(pid, 0)
    return answer


def codes(found: list[Diagnostic]) -> str:
    return ",".join(item.code for item in found)


def limited(size: int, work: Callable[[], str]) -> str:
    def run() -> str:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
        return work()

    return in_child(run)


def test_a_write_that_finds_no_room_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    path.write_bytes(b"old")
    for size in (0, 1, 100, 9_999):
        assert limited(size, lambda: (write_atomic(path, bytes(10_000)) or pytest.fail()).code) == "STATE-DISK-FULL"
        assert path.read_bytes() == b"old"
        assert [item.name for item in tmp_path.iterdir()] == ["state.json"]
    assert limited(10_000, lambda: str(write_atomic(path, bytes(10_000)))) == "None"
    assert path.read_bytes() == bytes(10_000)


@pytest.mark.parametrize("point", ["start", "written", "renamed"])
@pytest.mark.parametrize(
    ("number", "wanted"),
    [
        (errno.ENOSPC, "STATE-DISK-FULL"),
        (errno.EDQUOT, "STATE-DISK-FULL"),
        (errno.EROFS, "STATE-READ-ONLY"),
        (errno.EACCES, "STATE-READ-ONLY"),
        (errno.EIO, "STATE-WRITE-FAILED"),
    ],
)
def test_each_refusal_is_named_and_leaves_a_whole_file(tmp_path: Path, point: str, number: int, wanted: str) -> None:
    path = tmp_path / "state.json"
    path.write_bytes(b"old")

    def checkpoint(name: str) -> None:
        if name == f"x.{point}":
            raise OSError(number, os.strerror(number))

    problem = write_atomic(path, b"new", 0o644, checkpoint, "x")
    assert problem is not None and problem.code == wanted
    assert path.read_bytes() == (b"new" if point == "renamed" else b"old")
    assert [item.name for item in tmp_path.iterdir()] == ["state.json"]


def test_a_full_disk_is_named_with_its_room(tmp_path: Path) -> None:
    def checkpoint(name: str) -> None:
        raise OSError(errno.ENOSPC, "")

    problem = write_atomic(tmp_path / "f", b"", checkpoint=checkpoint)
    assert problem is not None
    assert "no space left on /" in problem.summary
    assert "KiB free of" in (problem.detail or "")


def test_no_state_is_lost_whatever_the_room(layout: Layout) -> None:
    """The process may write files of at most ``size`` bytes: every commit is whole or did not happen."""
    store, _ = StateStore.open(layout)
    assert store is not None
    assert store.success("probe", NodeState(key="one")) == [] and store.commit_snapshot() == []
    before = layout.snapshot.read_bytes()

    def grow() -> str:
        mine, _ = StateStore.open(layout)
        assert mine is not None
        found = mine.success("probe", NodeState(key="two", detail={"text": "x" * 3000})) or mine.commit_snapshot()
        return codes(found)

    for size in (0, 50, 300, 1000, 2500, 3300, 3500):
        answer = limited(size, grow)
        reopened, found = StateStore.open(layout)
        assert reopened is not None and found == [], size
        assert answer == "STATE-DISK-FULL"
        assert layout.snapshot.read_bytes() == before
        assert list(layout.committed.rglob(f"*{TEMPORARY}")) == []
    assert limited(1 << 20, grow) == ""
    assert layout.snapshot.read_bytes() != before


def test_a_real_full_file_system(tmp_path: Path) -> None:
    """A small file system of its own, seen by the driver alone; it is gone when the driver ends."""
    environment = {**os.environ, "PYTHONPATH": str(HERE.parents[2])}
    driver = [sys.executable, str(HERE / "state_full_disk.py"), str(tmp_path)]
    for wrapper in (["unshare", "--mount"], ["unshare", "--map-root-user", "--mount"], []):
        if wrapper and subprocess.run([*wrapper, "true"], capture_output=True, check=False).returncode != 0:
            continue
        run = subprocess.run([*wrapper, *driver], env=environment, capture_output=True, text=True, check=False)
        assert (run.returncode, run.stderr) == (0, ""), run.stdout + run.stderr
        assert run.stdout.splitlines()[-1] == "survived"
        return


def test_the_reserve_lets_the_end_of_a_step_be_told(layout: Layout) -> None:
    """The disk is full from the moment after begin: success and snapshot still get through on the reserve."""
    full = [True]

    def checkpoint(name: str) -> None:
        if (
            reserve_path(layout).exists()
            and not name.startswith("journal.begin")
            and not name.startswith("journal.head")
        ):
            raise OSError(errno.ENOSPC, "")

    store, _ = StateStore.open(layout, Ports(checkpoint))
    assert store is not None
    assert store.begin("probe") == []
    assert reserve_path(layout).stat().st_size >= 256 * 1024
    assert accept(layout, "probe", {"output.json": b"{}"}, checkpoint) == []
    assert not reserve_path(layout).exists()
    assert store.success("probe", NodeState(key="k", file_digest=file_digest(layout, "probe") or "")) == []
    assert store.commit_snapshot() == [] and full


def test_a_folder_that_cannot_be_written_is_said_before_any_agent_runs(tmp_path: Path) -> None:
    """As a user who may not write here: root may write anywhere, so it becomes the user nobody in a child."""
    tmp_path.chmod(0o755)
    project = tmp_path / "project"
    (project / "state/bench/serve").mkdir(parents=True)
    for place in (project, project / "state", project / "state/bench", project / "state/bench/serve"):
        place.chmod(0o555)
    layout = Layout(Path("project"), "bench")

    def unprivileged() -> str:
        os.chdir(tmp_path)
        if os.getuid() == 0:
            os.setgid(NOBODY)
            os.setuid(NOBODY)
        return codes(check_writable(layout))

    assert in_child(unprivileged) == "STATE-READ-ONLY"
    project.chmod(0o777)
    assert in_child(unprivileged) == "STATE-READ-ONLY"
    assert list((project / "state/bench").iterdir()) == [project / "state/bench/serve"]


def test_a_host_folder_that_is_a_link_is_refused(layout: Layout, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    layout.committed.parent.mkdir()
    layout.committed.symlink_to(elsewhere)
    assert codes(check_writable(layout)) == "STATE-LINK"
    assert list(elsewhere.iterdir()) == []


def test_a_good_place_is_left_clean_and_swept(layout: Layout) -> None:
    leftover = layout.committed / "serve" / f".server.py.abc{TEMPORARY}"
    leftover.parent.mkdir(parents=True)
    leftover.write_text("half")
    draft = layout.committed / f".probe.abc{TEMPORARY}"
    draft.mkdir()
    (draft / "0").write_text("half")
    assert check_writable(layout) == []
    assert full_disk(layout) is None
    assert [path.name for path in layout.committed.rglob("*")] == ["serve"]
    assert list(layout.local.iterdir()) == []


def test_reading_is_bounded_and_of_regular_files_only(tmp_path: Path) -> None:
    path = tmp_path / "x"
    assert read_regular(path) == (None, None)
    path.write_bytes(b"12345")
    assert read_regular(path, 5) == (b"12345", None)
    data, problem = read_regular(path, 4)
    assert data is None and problem is not None and problem.code == "STATE-TOO-LARGE"
    for special in ("/dev/zero", "/dev/null", str(tmp_path)):
        data, problem = read_regular(Path(special))
        assert data is None and problem is not None and problem.code == "STATE-LINK"


@pytest.mark.parametrize(("files", "left", "named"), [(60_000, 0, True), (60_000, 1, False), (0, 0, False)])
def test_a_disk_without_inodes_is_not_called_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, files: int, left: int, named: bool
) -> None:
    facts = SimpleNamespace(f_bavail=1000, f_frsize=1024, f_blocks=2000, f_files=files, f_favail=left)
    monkeypatch.setattr(os, "statvfs", lambda _: facts)
    found = refused(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), tmp_path / "a")
    assert found.code == "STATE-DISK-FULL"
    assert ("inodes" in found.summary, "remove some files" in (found.hint or "")) == (named, named)
