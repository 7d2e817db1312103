"""Projects as a released version left them, kept for every later version to read.

``python tests/support/former.py`` keeps the one of the version that runs it, below ``tests/cases/formats/<version>``:
the project's files, a saved plan, and as ``local`` what git does not hold, without what `publish` makes on each
machine. A kept project is never made again: a later version reads what was released.
"""

import os
import shutil
import tempfile
from pathlib import Path

from settled import Settled, sysroot

import octoform
from octoform.cli.main import main
from octoform.state.layout import STAGES

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "tests" / "cases" / "formats"
DEVICES = ["usb:v1F00p00B1d0100dc00dsc00dp00ic0Eisc01ip00in00"]
MANIFEST = "version: 1\nhost: bench\nharness: {name: command, command: [my-agent]}\n"
LOCAL = ".octoform/bench"
MADE_HERE = ("endpoint", "environments", "kept", "run")


def keep(place: Path) -> None:
    """Keep a settled project and a plan of this version; ``place`` must not exist."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["OCTOFORM_SYSROOT"] = str(sysroot(Path(folder, "root"), DEVICES))
        project = Path(folder, "project")
        (project / "protocol").mkdir(parents=True)
        for stage in STAGES:
            shutil.copy(ROOT / "protocol" / f"{stage}.md", project / "protocol")
        (project / "octopus.yaml").write_text(MANIFEST)
        Settled(project, os.environ).apply()
        assert main(["-chdir", str(project), "plan", "-out", str(project / "saved.plan")]) == 0
        shutil.copytree(project, place, ignore=shutil.ignore_patterns(".octoform"))
        shutil.copytree(project / LOCAL, place / "local", ignore=shutil.ignore_patterns(*MADE_HERE))


def restored(version: str, folder: Path) -> tuple[Path, Path]:
    """(project, system root) of a kept project, with its endpoint published and running on this machine."""
    root = sysroot(folder / "root", DEVICES)
    project = folder / "project"
    shutil.copytree(KEPT / version, project, ignore=shutil.ignore_patterns("local"))
    shutil.copytree(KEPT / version / "local", project / LOCAL)
    settled = Settled(project, {**os.environ, "OCTOFORM_SYSROOT": str(root)})
    settled.publish(settled.compiled().layout)
    return project, root


if __name__ == "__main__":
    keep(KEPT / octoform.__version__)
