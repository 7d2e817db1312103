"""octoform installed in a folder with a blank in its name: what a unit and an MCP client start, for every user."""

import json
import shlex
import subprocess
import sysconfig
import venv
from pathlib import Path

import pytest
from ordinary import POSSIBLE, ordinary_user

ROOT = Path(__file__).parents[2]
STARTS = """
import json, sys
from pathlib import Path
from octoform.endpoint.publication import client_command
from octoform.endpoint.process.systemd import watch_text
from octoform.state.layout import Layout
layout = Layout(Path(sys.argv[1]), "bench")
print(json.dumps([client_command(layout), watch_text(layout, "/usr/bin"), sys.executable]))
"""


def installed(folder: Path) -> Path:
    """The interpreter of an environment in ``folder`` that has this octoform."""
    venv.create(folder / ".venv", symlinks=True)
    packages = next((folder / ".venv").glob("lib/*/site-packages"))
    (packages / "octoform.pth").write_text(f"{ROOT}\n{sysconfig.get_path('purelib')}\n")
    return folder / ".venv" / "bin" / "python"


def checked(folder: Path, prefix: list[str]) -> None:
    """Each program that is written into another program's file starts, though its path has a blank."""

    def run(*words: str) -> "subprocess.CompletedProcess[str]":
        environ = {"PATH": "/usr/bin:/bin", "HOME": str(folder)}
        return subprocess.run(
            [*prefix, *words], cwd=folder, env=environ, capture_output=True, text=True, timeout=60, check=False
        )

    python = installed(folder)
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    done = run(str(python), "-c", STARTS, str(folder))
    assert done.returncode == 0, done.stderr
    client, unit, executable = json.loads(done.stdout)
    assert " " in executable
    pipe = run(*client)
    assert (pipe.returncode, pipe.stdout) == (1, "") and "bench has no endpoint" in pipe.stderr, pipe.stderr
    (line,) = [line for line in unit.splitlines() if line.startswith("ExecStart=")]
    words = shlex.split(line.removeprefix("ExecStart=").removeprefix(":"))
    assert words[-1] == "watch"
    version = run(*words[:-1], "--version")
    assert version.returncode == 0 and version.stdout.startswith("octoform "), version.stderr


def test_what_a_unit_and_a_client_start_runs(tmp_path: Path) -> None:
    (tmp_path / "a folder").mkdir()
    checked(tmp_path / "a folder", [])


@pytest.mark.skipif(not POSSIBLE, reason="only root can become another user")
def test_the_same_for_another_user() -> None:
    with ordinary_user() as user:
        folder = user.place / "a folder"
        folder.mkdir()
        user.owns_all()
        checked(folder, user.prefix)
