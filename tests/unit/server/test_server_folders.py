"""The folders of what the process keeps are its user's alone, or nothing is served."""

import os
import stat
from pathlib import Path

import pytest
from launched import launched, tool

from octoform.endpoint.process import start_stop
from octoform.server.main import NotOursError, private

SOURCE = """
from fastmcp import FastMCP
mcp = FastMCP("bench")

@mcp.tool
def look() -> int:
    return 1
"""
TOOLS = [tool("look")]


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_folders_that_are_open_to_others_are_closed(tmp_path: Path) -> None:
    with launched(tmp_path, SOURCE, TOOLS) as endpoint:
        endpoint.stop()
        for folder in (endpoint.layout.run, endpoint.layout.logs):
            folder.chmod(0o777)
        endpoint.start()
        assert (mode(endpoint.layout.run), mode(endpoint.layout.logs)) == (0o700, 0o700)


@pytest.mark.parametrize("name", ["run", "logs"])
def test_a_link_in_place_of_a_folder_is_not_served(tmp_path: Path, name: str) -> None:
    with launched(tmp_path / "project", SOURCE, TOOLS) as endpoint:
        endpoint.stop()
        folder: Path = getattr(endpoint.layout, name)
        folder.rename(tmp_path / "elsewhere")
        folder.symlink_to(tmp_path / "elsewhere")
        before = {path.name: path.stat().st_size for path in (tmp_path / "elsewhere").iterdir()}
        process, problem = start_stop.start(endpoint.layout)
        assert process is None and problem is not None and problem.code == "ENDPOINT-START-FAILED"
        assert problem.detail == f"{folder} is a symlink; it must be a folder"
        assert {path.name: path.stat().st_size for path in (tmp_path / "elsewhere").iterdir()} == before
        with pytest.raises(NotOursError, match="is a symlink"):  # the process's own error, started by hand
            private(folder)
        folder.unlink()
        (tmp_path / "elsewhere").rename(folder)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_another_users_folder_is_not_served(tmp_path: Path) -> None:
    with launched(tmp_path, SOURCE, TOOLS) as endpoint:
        endpoint.stop()
        os.chown(endpoint.layout.run, 65534, 65534)
        _, problem = start_stop.start(endpoint.layout)
        assert problem is not None and "belongs to another user (uid 65534)" in (problem.detail or "")
        with pytest.raises(NotOursError, match="belongs to another user"):
            private(endpoint.layout.run)
        os.chown(endpoint.layout.run, os.geteuid(), os.getegid())


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_what_others_put_into_an_open_folder_is_not_used(tmp_path: Path) -> None:
    with launched(tmp_path, SOURCE, TOOLS) as endpoint:
        endpoint.stop()
        planted = endpoint.layout.run / "tokens.json"
        planted.write_text("{}")
        os.chown(planted, 65534, 65534)
        endpoint.layout.run.chmod(0o770)
        for _ in range(2):  # also once the folder is closed again
            _, problem = start_stop.start(endpoint.layout)
            assert problem is not None and problem.detail is not None
            assert problem.detail.startswith(f"tokens.json in {endpoint.layout.run} belongs to another user")
        planted.unlink()


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NotOursError, match="cannot be used"):
        private(tmp_path / "file/run")
    private(tmp_path / "new/run")
    assert mode(tmp_path / "new/run") == 0o700
