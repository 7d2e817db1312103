"""Few processes left: one sentence with the limit, no attempt counts for it, and what runs goes on."""

import json
import os
import runpy
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from bench_host import bench_host
from ordinary import OPEN_PYTHON, POSSIBLE, User, ordinary_user
from projects import AGENT, Project

from octoform.endpoint.process.record import running
from octoform.state.layout import Layout

pytestmark = pytest.mark.skipif(not POSSIBLE or not OPEN_PYTHON.exists(), reason="only root can become another user")
NUMBER = 40000 + os.getpid() % 20000
"""Only this user's own processes count."""


@pytest.fixture
def user() -> Iterator[User]:
    with ordinary_user(NUMBER) as made:
        yield made


@pytest.fixture
def project(user: User) -> Project:
    made = Project(user.place / "project", user.place / "outside")
    command = json.dumps([str(OPEN_PYTHON), str(AGENT), str(made.outside / "script.json")])
    # The interpreter of these tests may be closed to that user, and the open one has none of the packages to look up.
    made.script = {"deploy": [{"write": runpy.run_path(str(AGENT))["good"]("deploy")}]}
    made.harness = f"{{name: command, command: {command}, sandbox: false}}"
    closed = user.place / "closed"  # a folder of PATH that is closed to this user, as that of another one's home
    closed.mkdir(mode=0o700)
    home = user.place / "home"
    home.mkdir()
    path = f"{closed}:{closed}/bin:{os.environ['PATH']}"
    made.environ = {"HOME": str(home), "PATH": path, "OCTOFORM_SYSROOT": str(_host(made))}
    made.write()
    user.owns_all()
    closed.chmod(0o700)
    os.chown(closed, 0, 0)
    return made


def _host(project: Project) -> Path:
    return bench_host(project.outside / "host")


def limited(user: User, most: int) -> list[str]:
    return [*user.prefix, "prlimit", f"--nproc={most}:{most}"]


def of_the_user() -> list[str]:
    """The processes of the user that are left; a zombie is none."""
    done = subprocess.run(["ps", "-o", "stat=,args=", "-u", str(NUMBER)], capture_output=True, text=True, check=False)
    return [line for line in done.stdout.splitlines() if not line.startswith("Z")]


def test_apply_with_few_processes_left_is_one_sentence(project: Project, user: User) -> None:
    for number, most in enumerate((1, 2, 4), 1):
        project.prefix = limited(user, most)
        done = project.run("apply", "-auto-approve", status=1)
        assert done.err.count("error[") == 1, done.text
        assert "error[SYSTEM-NO-PROCESSES]: no more processes or threads can be started" in done.err
        assert f"ulimit -u is {most}" in done.err and "raise the limit" in done.err
        assert of_the_user() == []
        assert len(project.attempts("probe")) == number, most
    project.prefix = user.prefix
    project.run("apply", "-auto-approve", "-target", "probe", status=0)


def test_the_endpoint_that_runs_goes_on(project: Project, user: User, compiled: Path) -> None:
    project.take_environments(compiled, linked=False)
    user.owns_all()
    os.chown(user.place / "closed", 0, 0)
    project.prefix = user.prefix
    project.run("apply", "-auto-approve", status=0)
    layout = Layout(project.folder, project.host)
    before = running(layout)
    assert before is not None
    try:
        project.prefix = limited(user, 2)
        done = project.run("restart", status=1)
        assert "error[SYSTEM-NO-PROCESSES]" in done.err and "the endpoint was left as it is" in done.err
        assert "no more processes or threads can be started" in project.run("watch", "--once").err
        assert project.run("status").err == ""
        assert running(layout) == before
        # Now its own process gets no thread either: a tool is refused in a sentence, and the emergency stop works.
        lowered = ["prlimit", "--pid", str(before.pid), "--nproc=1:1"]
        subprocess.run([*user.prefix, *lowered], check=True)
        project.prefix = user.prefix
        project.run("estop", status=0)
        project.run("estop", "-clear", status=0)
        assert running(layout) == before
    finally:
        project.prefix = user.prefix
        project.run("stop", status=0)
    assert of_the_user() == []
