"""The short way of a client's pipe leads where the long one does."""

import subprocess
import sys
from pathlib import Path

import pytest

from octoform.cli import main
from octoform.state.layout import Layout

LEAN = ("argparse", "asyncio", "dataclasses", "fastmcp", "inspect", "json", "pathlib", "pydantic", "re", "subprocess")


def test_the_socket_is_the_hosts_own() -> None:
    layout = Layout(Path("/srv/bench"), "left-arm")
    assert f"/srv/bench{main.PLACE.format(host='left-arm')}" == str(layout.socket)


@pytest.mark.parametrize(
    "words",
    [
        ["connect", "../elsewhere"],
        ["connect", ""],
        ["-json", "connect", "bench"],
        ["-chdir=/nowhere", "extra", "connect", "bench"],
        ["-chdir=/nowhere", "connect", "bench"],
    ],
)
def test_what_is_not_that_simple_takes_the_long_way(words: list[str]) -> None:
    assert main.connected(words) is None


def test_the_short_way_loads_next_to_nothing() -> None:
    modules = "sys, octoform.cli.main, octoform.endpoint.sockets, octoform.endpoint.stdio"
    code = f"import {modules}; print(sorted(set(sys.modules) & set({LEAN!r})))"
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_plugin_of_pydantic_is_sought(tmp_path: Path) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    code = (
        "from importlib import metadata; metadata.distributions = lambda: print('sought') or []; "
        "from octoform.cli.main import main; main(['validate'])"
    )
    done = subprocess.run([sys.executable, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "valid" in done.stdout and "sought" not in done.stdout
