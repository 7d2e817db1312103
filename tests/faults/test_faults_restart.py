"""A disk that takes no more: the endpoint that is well goes on, and the person is informed before anything is ended."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from projects import Project

from octoform.base.processes import command_line, start_of
from octoform.endpoint.process.record import running
from octoform.server.process.instance_lock import RECORD, Owner
from octoform.state.layout import Layout

FULL = ["sh", "-c", 'ulimit -f 0 && exec "$@"', "sh"]
"""The beginning of a command that, with all that it starts, can write into no file."""


def test_a_restart_on_a_full_disk_is_refused_and_the_endpoint_goes_on(project: Project, environments: Path) -> None:
    project.share_environments(environments)
    project.apply(status=0)
    before = running(Layout(project.folder, project.host))
    assert before is not None
    try:
        project.prefix = FULL
        done = project.run("restart", status=1)
        assert "error[STATE-DISK-FULL]" in done.err
        assert "the endpoint was left as it is" in done.err
        assert running(Layout(project.folder, project.host)) == before
        project.prefix = []
        assert "read" in project.run("tools", status=0).out
    finally:
        project.prefix = []
        project.run("stop", status=0)


def test_the_record_of_the_owner_is_whole_where_the_system_writes_in_pieces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole: Callable[[int, bytes], int] = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, data: whole(descriptor, bytes(data)[:7]))
    owner = Owner.take(tmp_path)
    assert owner is not None
    owner.record(scope="local", url=None)
    assert owner.is_recorded()
    assert str(start_of(os.getpid())) in (tmp_path / RECORD).read_text()
    assert command_line(os.getpid())
    owner.release()


@pytest.mark.parametrize("damage", [b"", b"{", b"[" * 200_000, b'{"pid": 1}', b"\0"])
def test_a_damaged_record_of_the_owner_is_written_again(tmp_path: Path, damage: bytes) -> None:
    owner = Owner.take(tmp_path)
    assert owner is not None
    owner.record(scope="local")
    before = (tmp_path / RECORD).read_bytes()
    (tmp_path / RECORD).write_bytes(damage)
    assert owner.is_recorded()
    assert (tmp_path / RECORD).read_bytes() == before
    (tmp_path / RECORD).unlink()
    assert not owner.is_recorded()
    owner.release()
