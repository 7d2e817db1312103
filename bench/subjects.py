"""A project for a benchmark: with the instantaneous scripted agent of the tests, or with the embedded agent."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from measuring import PYTHON, SUPPORT, environment

if TYPE_CHECKING:
    from projects import Project

INSIDE = Path(__file__).with_name("inside.py")


def project(folder: Path) -> "Project":
    """A fresh project whose agent answers at once with accepted artifacts, on the host that they are about."""
    sys.path.insert(0, str(SUPPORT))
    from projects import Project

    made = Project(folder / "project", folder / "outside")
    made.write()
    os.environ["OCTOFORM_SYSROOT"] = made.environment()["OCTOFORM_SYSROOT"]
    return made


def embedded(folder: Path) -> Path:
    """A fresh project folder that holds nothing but a manifest for the embedded agent, on this machine."""
    os.environ.pop("OCTOFORM_SYSROOT", None)
    made = folder / "embedded"
    made.mkdir()
    (made / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    return made


def inside(folder: Path, *arguments: str, environ: Mapping[str, str] | None = None) -> dict[str, Any]:
    """One octoform command measured from inside, with more variables if given; see `inside`."""
    report = folder.parent / "report.json"
    command = [PYTHON, str(INSIDE), str(report), *arguments]
    done = subprocess.run(command, cwd=folder, env=environment(environ), capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr or _errors(report)
        raise SystemExit(f"octoform {' '.join(arguments)}: exit status {done.returncode}\n{said}")
    found: dict[str, Any] = json.loads(report.read_text())
    return found


def _errors(report: Path) -> str:
    """The messages of the JSON stream that tell of something wrong."""
    events = json.loads(report.read_text())["events"] if report.exists() else []
    return "\n".join(event["@message"] for event in events if event["@level"] == "error")
