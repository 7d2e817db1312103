"""The endpoint as a service: the unit is what systemd takes, and systemd gets what a person approved.

A small program replaces systemctl: it records its calls and starts and stops the command of the unit.
"""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import warm
from launched import Launched, launched, tool
from ordinary import has_account
from projects import OCTOFORM
from python_programs import python_program
from terminals import Terminal

from octoform.daemon.repair.restart import restart
from octoform.endpoint.process import record
from octoform.endpoint.process.record import is_marked, running
from octoform.endpoint.process.start_stop import start, stop
from octoform.endpoint.process.systemd import unit_text, watch_text
from octoform.state.layout import Layout

SYSTEMCTL = """
import json, os, shlex, signal, subprocess, sys
from pathlib import Path

folder = Path({folder!r})
user, pager, verb, *rest = sys.argv[1:]
assert (user, pager) == ("--user", "--no-pager")
with (folder / "told").open("a") as told:
    told.write(json.dumps([verb, *rest]) + "\\n")
if (folder / "refuses").exists() and verb in (folder / "refuses").read_text():
    sys.exit("Failed to connect to bus: No medium found")
name = rest[-1] if rest else ""
watch = name.startswith("octoform-watch-")
kept = folder / ("watch.pid" if watch else "pid")


def alive():
    return kept.exists() and Path("/proc", kept.read_text()).exists()


def begin():
    if alive():
        return
    unit = Path(os.environ["XDG_CONFIG_HOME"], "systemd", "user", name).read_text()
    said = dict(line.split("=", 1) for line in unit.splitlines() if "=" in line and line[0] != "#")
    words = [word.replace("%%", "%") for word in shlex.split(said["ExecStart"].removeprefix(":"))]
    given = dict(word.replace("%%", "%").split("=", 1) for word in shlex.split(said["Environment"]))
    with open(said.get("StandardOutput", os.devnull).removeprefix("append:").replace("%%", "%"), "ab") as log:
        apart = {"stdin": subprocess.DEVNULL, "start_new_session": True}
        if watch:  # not here: its own tests run it
            words = ["sleep", "600"]
        process = subprocess.Popen(words, env=given, stdout=log, stderr=log, **apart)
    kept.write_text(str(process.pid))


def end():
    if kept.exists():
        try:
            os.kill(int(kept.read_text()), signal.SIGTERM)
        except ProcessLookupError:
            pass
        kept.unlink()


if verb == "start" or (verb == "enable" and "--now" in rest):
    begin()
elif verb == "stop" or (verb == "disable" and "--now" in rest):
    end()
elif verb == "is-active":
    print("active" if alive() else "failed")
    sys.exit(0 if alive() else 3)
"""
SOURCE = """
from fastmcp import FastMCP

mcp = FastMCP("bench")


@mcp.tool
def one() -> int:
    return 1
"""
NAME, WATCH = "octoform-bench.service", "octoform-watch-bench.service"


class Systemd:
    """The stand-in, and the surroundings in which octoform finds it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.units = folder / "config" / "systemd" / "user"
        programs = folder / "bin"
        programs.mkdir(parents=True)
        python_program(programs / "systemctl", SYSTEMCTL.replace("{folder!r}", repr(str(folder))))
        path = f"{programs}:{os.environ['PATH']}"
        self.environ = {"PATH": path, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder / "config")}

    def told(self) -> list[list[str]]:
        """Its calls so far, without queries."""
        kept = self.folder / "told"
        words = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
        return [item for item in words if item[0] not in ("show-environment", "is-active")]

    def refuse(self, verb: str) -> None:
        (self.folder / "refuses").write_text(verb)


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Systemd]:
    """A person's own systemd, for the commands and for what runs in the test itself."""
    found = Systemd(tmp_path / "systemd")
    for name, value in found.environ.items():
        monkeypatch.setenv(name, value)
    yield found
    with contextlib.suppress(OSError, ValueError):
        os.kill(int((found.folder / "watch.pid").read_text()), signal.SIGTERM)


@pytest.fixture(scope="module")
def launched_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """A project, in a folder with everything in its name that a unit has to mind, whose endpoint runs by itself."""
    folder = tmp_path_factory.mktemp("service") / "the owner's 100% bench $HOME"
    folder.mkdir()
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    with launched(folder, SOURCE, [tool("one")]) as endpoint:
        yield endpoint


@pytest.fixture
def bench(systemd: Systemd, launched_bench: Launched) -> Iterator[Launched]:
    """That project as it was: when a test has handed the endpoint to systemd, it runs by itself again."""
    before = launched_bench.process
    yield launched_bench
    if running(launched_bench.layout) != before:
        launched_bench.stop()
        shutil.rmtree(systemd.units, ignore_errors=True)
        launched_bench.start()


def octoform(systemd: Systemd, endpoint: Launched, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return warm.completed(OCTOFORM, arguments, endpoint.layout.project, systemd.environ)


@pytest.mark.parametrize("folder", ["plain", "with blanks", "100%h", "$HOME", 'o\'brien "q" \\x', "größe"])
@pytest.mark.parametrize("account", [None, "root"])
def test_the_unit_is_one_that_systemd_takes(tmp_path: Path, folder: str, account: str | None) -> None:
    program = shutil.which("systemd-analyze")
    assert program is not None, "systemd-analyze is missing; `make setup` installs it"
    layout = Layout(tmp_path / folder, "bench")
    layout.endpoint.mkdir(parents=True)
    layout.run.mkdir()
    (layout.endpoint / "launch").write_text("#!/bin/sh\n")
    (layout.endpoint / "launch").chmod(0o700)
    unit = tmp_path / NAME
    unit.write_text(unit_text(layout, "/usr/bin:/opt/my tools/100%", account))
    kind = ["--user"] if account is None else []
    environ = {"PATH": os.environ["PATH"], "HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(tmp_path)}
    watch = tmp_path / WATCH
    watch.write_text(watch_text(layout, "/usr/bin:/opt/my tools/100%", account))
    done = subprocess.run(
        [program, *kind, "verify", str(unit), str(watch)], env=environ, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")


def is_shown_asked_for_written_and_given_to_systemd(systemd: Systemd, bench: Launched) -> None:
    before = bench.process.pid
    terminal = Terminal(bench.layout.project, systemd.environ, "service", "install", "-user")
    terminal.wait_for("Enter a value:")
    assert not systemd.units.exists() and systemd.told() == []
    assert running(bench.layout) is not None
    terminal.type("yes\n")
    status, screen = terminal.end()
    assert status == 0, screen
    assert any("loginctl enable-linger" in line for line in screen)
    unit = systemd.units / NAME
    assert unit.stat().st_mode & 0o777 == 0o600
    assert systemd.told()[:2] == [["daemon-reload"], ["enable", "--now", NAME]]
    assert systemd.told()[-1] == ["enable", "--now", WATCH]
    assert (systemd.units / WATCH).stat().st_mode & 0o777 == 0o600
    assert bench.process.pid != before, "the process that belonged to no one was stopped first"
    assert bench.process.pid == int((systemd.folder / "pid").read_text())


def is_started_and_stopped_by_systemd(systemd: Systemd, bench: Launched) -> None:
    """The unit is skipped at a boot while the mark of a stop is there, so a start takes the mark away before it asks.

    A start that systemd reports as failed is reported with its reason.
    """
    found = len(systemd.told())
    assert stop(bench.layout).process is not None
    assert running(bench.layout) is None
    assert systemd.told()[found:] == [["stop", NAME]]

    mark = str(bench.layout.stop_mark).replace("%", "%%")
    condition = f"ConditionPathExists=!{mark}"
    assert condition in (systemd.units / NAME).read_text().splitlines()
    assert record.mark(bench.layout) is None
    process, problem = start(bench.layout)
    assert problem is None and process is not None
    assert systemd.told()[found:] == [["stop", NAME], ["start", NAME]]
    assert process.pid == int((systemd.folder / "pid").read_text())
    assert not record.is_marked(bench.layout)

    bench.stop()
    server = bench.layout.output("serve")
    good = server.read_bytes()
    server.unlink()
    process, problem = start(bench.layout)
    server.write_bytes(good)
    assert process is None and problem is not None
    assert problem.code == "ENDPOINT-START-FAILED"
    assert f"systemd reports that {NAME} is failed" in problem.summary
    assert "cannot be read" in str(problem.detail)


def stops_with_the_uninstall_and_leaves_nothing(systemd: Systemd, bench: Launched) -> None:
    assert start(bench.layout)[1] is None
    done = octoform(systemd, bench, "service", "uninstall", "-user")
    assert done.returncode == 1 and "SERVICE-NOT-APPROVED" in done.stderr
    assert (systemd.units / NAME).exists() and running(bench.layout) is not None
    done = octoform(systemd, bench, "service", "uninstall", "-user", "-auto-approve")
    assert done.returncode == 0, done.stderr
    assert list(systemd.units.iterdir()) == []
    assert running(bench.layout) is None
    assert not restart(bench.layout).ok and running(bench.layout) is None, "a daemon would start it again"
    ended = [words[-1] for words in systemd.told() if words[0] == "disable"]
    assert ended == [WATCH, NAME], "the daemon first, so that it starts nothing again"
    assert systemd.told()[-1] == ["daemon-reload"]
    assert "was not installed" in octoform(systemd, bench, "service", "uninstall", "-user").stdout
    assert octoform(systemd, bench, "service", "install", "-user", "-auto-approve").returncode == 0
    assert not is_marked(bench.layout), "anyone who installs it wants it to run"


@pytest.mark.skipif(not has_account(), reason="units of a user need an account in the user database")
def test_from_the_question_before_it_is_installed_to_what_is_left_after_it(systemd: Systemd, bench: Launched) -> None:
    """One installation is enough for all of it: each start of the endpoint by a unit is that of a new program."""
    is_shown_asked_for_written_and_given_to_systemd(systemd, bench)
    is_started_and_stopped_by_systemd(systemd, bench)
    stops_with_the_uninstall_and_leaves_nothing(systemd, bench)


@pytest.mark.parametrize("verb", ["install", "uninstall"])
def test_units_for_the_machine_are_only_printed_and_systemd_is_not_asked(
    systemd: Systemd, bench: Launched, verb: str
) -> None:
    done = octoform(systemd, bench, "service", verb)
    assert done.returncode == 1 and "SERVICE-FOR-WHOM" in done.stderr and done.stdout == ""
    assert "not allowed with" in octoform(systemd, bench, "service", verb, "-user", "-print").stderr
    done = octoform(systemd, bench, "service", verb, "-print")
    assert done.returncode == 0
    assert f"/etc/systemd/system/{NAME}" in done.stdout and f"/etc/systemd/system/{WATCH}" in done.stdout
    assert ("WantedBy=multi-user.target" in done.stdout) == (verb == "install")
    assert "sudo" not in done.stdout
    assert not systemd.units.exists() and not (systemd.folder / "told").exists()


def test_a_program_in_a_cache_is_given_to_no_unit(systemd: Systemd, bench: Launched) -> None:
    systemd.environ["UV_CACHE_DIR"] = sys.prefix
    done = octoform(systemd, bench, "service", "install", "-user", "-auto-approve")
    assert done.returncode == 1 and "SERVICE-COMMAND-TEMPORARY" in done.stderr
    assert not systemd.units.exists() and systemd.told() == []


def test_without_a_yes_nothing_is_written(systemd: Systemd, bench: Launched) -> None:
    before = bench.process.pid
    done = octoform(systemd, bench, "service", "install", "-user")
    assert done.returncode == 1 and "SERVICE-NOT-APPROVED" in done.stderr
    assert "ExecStart=" in done.stdout
    assert not systemd.units.exists() and systemd.told() == []
    assert bench.process.pid == before


def test_where_no_systemd_answers_the_unit_is_shown_and_nothing_is_touched(systemd: Systemd, bench: Launched) -> None:
    before = bench.process.pid
    systemd.refuse("show-environment")
    done = octoform(systemd, bench, "service", "install", "-user", "-auto-approve")
    assert done.returncode == 1
    assert "SERVICE-NO-SYSTEMD" in done.stderr and "No medium found" in done.stderr
    assert "ExecStart=" in done.stdout
    (systemd.folder / "bin" / "systemctl").unlink()
    lonely = {**systemd.environ, "PATH": str(systemd.folder / "bin")}
    command = [str(OCTOFORM), "service", "install", "-user", "-auto-approve"]
    done = subprocess.run(command, cwd=bench.layout.project, env=lonely, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "systemctl cannot be started" in done.stderr
    assert not systemd.units.exists() and bench.process.pid == before


def test_a_unit_of_something_else_is_left_alone(systemd: Systemd, bench: Launched) -> None:
    systemd.units.mkdir(parents=True)
    (systemd.units / NAME).write_text("[Service]\nExecStart=/bin/true\n")
    for verb in ("install", "uninstall"):
        done = octoform(systemd, bench, "service", verb, "-user", "-auto-approve")
        assert done.returncode == 1 and "SERVICE-FOREIGN-UNIT" in done.stderr
    assert (systemd.units / NAME).read_text() == "[Service]\nExecStart=/bin/true\n"
    bench.stop()
    bench.start()
    assert systemd.told() == [] and running(bench.layout) is not None


def test_a_unit_that_watches_something_else_is_left_alone(systemd: Systemd, bench: Launched) -> None:
    systemd.units.mkdir(parents=True)
    other = watch_text(Layout(bench.layout.project / "other", "bench"), "/usr/bin")
    (systemd.units / WATCH).write_text(other)
    done = octoform(systemd, bench, "service", "install", "-user", "-auto-approve")
    assert done.returncode == 1 and "SERVICE-FOREIGN-UNIT" in done.stderr
    assert (systemd.units / WATCH).read_text() == other and systemd.told() == []


def test_what_systemctl_refuses_is_told(systemd: Systemd, bench: Launched) -> None:
    systemd.refuse("enable")
    done = octoform(systemd, bench, "service", "install", "-user", "-auto-approve")
    assert done.returncode == 1
    assert f"systemctl --user enable --now {NAME} failed" in done.stderr
