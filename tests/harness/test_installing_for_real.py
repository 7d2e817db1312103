"""The smallest agent program, installed for real from the registries into an empty folder, with a node of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

OCTOFORM = Path(sys.executable).parent / "octoform"
SECONDS = 600.0


@pytest.mark.harness
@pytest.mark.slow
def test_pi_is_installed_where_no_node_is_and_starts(tmp_path: Path) -> None:
    (tmp_path / "bin").mkdir()
    for name in ("env", "sh"):  # what the first lines of scripts name; and no node
        (tmp_path / "bin" / name).symlink_to(f"/usr/bin/{name}")
    environ = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    environ |= {"PATH": str(tmp_path / "bin"), "OCTOFORM_AGENTS": str(tmp_path / "agents")}

    def install() -> dict[str, str]:
        done = subprocess.run(
            [OCTOFORM, "install", "-json", "pi"], env=environ, capture_output=True, text=True, timeout=SECONDS
        )
        assert done.returncode == 0, (done.stdout, done.stderr)
        (found,) = json.loads(done.stdout)["installed"]
        return dict(found)

    first = install()
    assert first["state"] == "installed"
    assert first["node"].startswith(str(tmp_path / "agents" / "node-"))
    started = subprocess.run(
        [first["program"], "--version"],
        env={"PATH": f"{first['node']}:{tmp_path / 'bin'}", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert started.stdout.strip() == first["version"]
    assert install() == {**first, "state": "present"}
