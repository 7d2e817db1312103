"""A driver that runs one agent through the harness port, as this user or another: ``driver.py CONFIG`` prints JSON."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from session_folders import session_folder

import octoform

DRIVER = """
import dataclasses, json, sys
from pathlib import Path
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.port import Task, TaskLimits
from octoform.manifest.model import Sandbox
config = json.load(open(sys.argv[1]))
work = Path(config["workdir"])
names = ("prompt.md", "output.json", "agent.log", "task.json")
prompt, output, log, document = (work / name for name in names)
task = Task("probe", 1, work, prompt, output, log, document, None, config["environ"], TaskLimits(config["seconds"]))
sandbox = Sandbox(**{"required": True, **config["sandbox"]}) if config["sandbox"] is not None else None
outcome = run_contained(task, Invocation(tuple(config["argv"]), sandbox=sandbox), lambda *event: None)
print(json.dumps({"outcome": dataclasses.asdict(outcome), "log": log.read_text() if log.exists() else ""}))
"""


PYTHONS = (str(Path(sys.executable).resolve()), "/usr/bin/python3", "/usr/local/bin/python3")


@cache
def _code(python: str) -> Path:
    """A folder with octoform that every user may read, compiled once for all tests; it goes with them."""
    folder = session_folder("code")
    package = folder / "octoform"
    shutil.copytree(Path(octoform.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run([python, "-I", "-S", "-m", "compileall", "-q", str(package)], stdout=subprocess.DEVNULL, check=False)
    folder.chmod(0o755)
    return folder


class Host:
    """A user's home and project below ``root``; all of it belongs to ``uid``."""

    def __init__(self, root: Path, uid: int) -> None:
        self.uid = uid
        self.home = root / "home"
        self.project = self.home / "project"
        self.workdir = self.project / ".octoform" / "bench" / "attempts" / "000002-probe-1"
        self.python = next(path for path in PYTHONS if self._may_run(path))
        self.code = _code(self.python)
        self.workdir.mkdir(parents=True)
        for private in (self.workdir, self.project / ".octoform"):  # as an apply makes them
            private.chmod(0o700)
        (root / "driver.py").write_text(DRIVER)
        self.root = root

    def _as_user(self) -> list[str]:
        """The beginning of a command that the user runs."""
        if self.uid == os.getuid():
            return []
        return ["setpriv", f"--reuid={self.uid}", f"--regid={self.uid}", "--clear-groups", "--"]

    def _may_run(self, python: str) -> bool:
        """Whether that Python is there for the user and new enough; this one may lie in somebody's private home."""
        # It must find itself again: setpriv starts it with rights that it then has no more.
        check = "import os, sys; sys.exit(sys.version_info < (3, 11) or not os.access(sys.executable, os.X_OK))"
        command = [*self._as_user(), python, "-I", "-S", "-c", check]
        try:
            return subprocess.run(command, cwd="/", capture_output=True, check=False).returncode == 0
        except OSError:
            return False

    def write(self, path: Path, text: str = "x") -> Path:
        """A file with its folders."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def start(
        self, argv: list[str], sandbox: Mapping[str, bool] | None, seconds: float = 60, **environ: str
    ) -> "subprocess.Popen[str]":
        """Start the driver as the user."""
        variables = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": str(self.home), **environ}
        config = {
            "workdir": str(self.workdir),
            "argv": argv,
            "sandbox": sandbox,
            "seconds": seconds,
            "environ": variables,
        }
        self.write(self.workdir / "task.json", "{}")
        (self.root / "config.json").write_text(json.dumps(config))
        for path in (self.root, *self.root.rglob("*")):
            os.chown(path, self.uid, self.uid, follow_symlinks=False)
        return subprocess.Popen(
            [*self._as_user(), self.python, str(self.root / "driver.py"), str(self.root / "config.json")],
            env={**variables, "PYTHONPATH": str(self.code)},
            cwd=self.root,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def call(self, code: str, *arguments: str) -> str:
        """What a piece of Python with octoform at hand prints, run as the user."""
        command = [*self._as_user(), self.python, "-c", code, *arguments]
        variables = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": str(self.home), "PYTHONPATH": str(self.code)}
        return subprocess.run(command, env=variables, cwd=self.root, capture_output=True, text=True, check=True).stdout

    def run(self, argv: list[str], sandbox: Mapping[str, bool] | None, seconds: float = 60, **environ: str) -> Any:
        """Run an agent to its end: ``outcome`` and ``log``."""
        process = self.start(argv, sandbox, seconds, **environ)
        try:
            out, err = process.communicate(timeout=90)
        finally:
            process.kill()
            process.wait()
        assert process.returncode == 0, err
        return json.loads(out)
