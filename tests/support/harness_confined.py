"""A driver that runs one agent through the harness port, as this user or another: ``driver.py CONFIG`` prints JSON."""

import json
import os
import select
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

LOADED = """
import gc, json, os, sys, traceback
import octoform.harness.contained_attempt, octoform.harness.port, octoform.manifest.model
gc.freeze()
for order in sys.stdin:
    folder, program, environ = json.loads(order)
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            os.dup2(os.open("/dev/null", os.O_RDONLY), 0)
            for number, name in ((1, "out"), (2, "err")):
                os.dup2(os.open(os.path.join(folder, name), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), number)
            os.closerange(3, 64)
            os.chdir(folder)
            os.environ.clear()
            os.environ.update(environ)
            sys.argv = [os.path.join(folder, "driver.py"), os.path.join(folder, "config.json")]
            exec(program, {"__name__": "__main__"})
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)
"""
"""Runs drivers as forks of a process that has loaded what they import, one after the other."""

PYTHONS = (str(Path(sys.executable).resolve()), "/usr/bin/python3", "/usr/local/bin/python3")


@cache
def _code() -> Path:
    """A folder with octoform and its bytecode that every user may read, for all tests; it goes with them."""
    folder = session_folder("code")
    shutil.copytree(Path(octoform.__file__).parent, folder / "octoform")
    folder.chmod(0o755)
    return folder


@cache
def _loaded(python: str, *as_user: str) -> "subprocess.Popen[str]":
    """The process that runs a user's drivers; it ends with the tests."""
    return subprocess.Popen(
        [*as_user, python, "-c", LOADED],
        env={"PYTHONPATH": str(_code())},
        cwd="/",
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


class Host:
    """A user's home and project below ``root``; all of it belongs to ``uid``."""

    def __init__(self, root: Path, uid: int) -> None:
        self.uid = uid
        self.home = root / "home"
        self.project = self.home / "project"
        self.workdir = self.project / ".octoform" / "bench" / "attempts" / "000002-probe-1"
        self.python = next(path for path in PYTHONS if self._may_run(path))
        self.code = _code()
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
        """Start the driver as the user, as a program of its own."""
        variables = self._configured(argv, sandbox, seconds, environ)
        return subprocess.Popen(
            [*self._as_user(), self.python, str(self.root / "driver.py"), str(self.root / "config.json")],
            env=variables,
            cwd=self.root,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def _configured(
        self, argv: list[str], sandbox: Mapping[str, bool] | None, seconds: float, environ: Mapping[str, str]
    ) -> dict[str, str]:
        """Write what the driver reads; its variables."""
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
        return {**variables, "PYTHONPATH": str(self.code)}

    def call(self, code: str, *arguments: str) -> str:
        """What a piece of Python with octoform at hand prints, run as the user."""
        command = [*self._as_user(), self.python, "-c", code, *arguments]
        variables = {"PATH": "/usr/local/bin:/usr/bin:/bin", "HOME": str(self.home), "PYTHONPATH": str(self.code)}
        return subprocess.run(command, env=variables, cwd=self.root, capture_output=True, text=True, check=True).stdout

    def run(self, argv: list[str], sandbox: Mapping[str, bool] | None, seconds: float = 60, **environ: str) -> Any:
        """Run an agent to its end: ``outcome`` and ``log``."""
        variables = self._configured(argv, sandbox, seconds, environ)
        loaded = _loaded(self.python, *self._as_user())
        assert loaded.stdin is not None and loaded.stdout is not None
        print(json.dumps([str(self.root), DRIVER, variables]), file=loaded.stdin, flush=True)
        if not select.select([loaded.stdout], [], [], 90)[0]:
            loaded.kill()
            raise subprocess.TimeoutExpired(argv, 90)
        assert loaded.stdout.readline() == "0\n", (self.root / "err").read_text()
        return json.loads((self.root / "out").read_text())
