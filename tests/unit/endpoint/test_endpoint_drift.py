"""Drift of the endpoint, seen cheaply; and its removal."""

import hashlib
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from endings import record_running
from unit.endpoint.endpoint_servers import publish

from octoform.apply.destroy import left_behind
from octoform.diagnostics import Severity
from octoform.endpoint.drift import Expected, observe
from octoform.endpoint.environment.model import MARKER, Environment, packages_of
from octoform.endpoint.process import systemd
from octoform.endpoint.publication import remove
from octoform.endpoint.published_files import CHECK
from octoform.runtime import counting
from octoform.state.layout import Layout

PIPED = "octoform/server/transport/unix_socket.py"


@pytest.fixture
def applied(layout: Layout, serving: Environment) -> Layout:
    """A published endpoint whose check went well; its environment is an outline that a test may damage."""
    path = layout.environments / serving.path.name
    outline(serving.path, path)
    publish(layout, Environment(path / "bin" / "python", serving.digest, path, serving.lock))
    write_check(layout)
    record_running(layout.run)
    return layout


def outline(environment: Path, path: Path) -> None:
    """What a look at an environment can see: marker, interpreter and every name beside the packages, unfilled."""
    packages_of(path).mkdir(parents=True)
    shutil.copy(environment / MARKER, path)
    shutil.copytree(environment / "bin", path / "bin", symlinks=True)
    for entry in packages_of(environment).iterdir():
        if entry.is_dir():
            (packages_of(path) / entry.name).mkdir()
        else:
            (packages_of(path) / entry.name).touch()


def write_check(
    layout: Layout, *, answered: bool = True, tools: tuple[str, ...] = ("read_clock", "read_voltage")
) -> None:
    record = {"format": 1, "at": "2026-01-01T00:00:00+00:00", "answered": answered, "tools": list(tools)}
    (layout.endpoint / CHECK).write_text(json.dumps(record))


def another_start(layout: Layout) -> None:
    """The pid of the record was given to another process."""
    record = json.loads((layout.run / "process.json").read_text())
    (layout.run / "process.json").write_text(json.dumps({**record, "start": record["start"] + 1}))


def upgrade(layout: Layout) -> None:
    (folder,) = layout.environments.glob("*/lib/python*/site-packages")
    (info,) = folder.glob("fastmcp-[0-9]*.dist-info")
    info.rename(folder / "fastmcp-9.9.dist-info")


def lose(layout: Layout, name: str) -> None:
    """A package or module goes; the record of its installation stays."""
    (path,) = layout.environments.glob(f"*/lib/python*/site-packages/{name}")
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def test_an_endpoint_as_it_was_left_gives_no_reason(applied: Layout) -> None:
    facts = observe(applied)
    assert facts.present and facts.answered
    assert facts.reasons == ()
    assert facts.tools == ("read_clock", "read_voltage")


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda at: (at.endpoint / "launch").unlink(), "the launcher is missing"),
        (lambda at: (at.endpoint / "launch").write_text("#!/bin/sh\n"), "the launcher was changed"),
        (lambda at: (at.endpoint / "launch").chmod(0o600), "the launcher is not executable"),
        (lambda at: (at.endpoint / "connection.json").write_text("{}"), "the connection descriptor was changed"),
        (lambda at: (at.endpoint / "clients/codex.toml").unlink(), "the endpoint's clients/codex.toml is missing"),
        (lambda at: shutil.rmtree(at.environments), "the serving environment is missing"),
        (lambda at: lose(at, "fastmcp"), "fastmcp is gone from the serving environment"),
        (lambda at: lose(at, "typing_extensions.py"), "typing_extensions.py is gone from the serving environment"),
        (
            lambda at: next(at.environments.glob("*/bin/python")).unlink(),
            "the interpreter of the serving environment is missing",
        ),
        (lambda at: at.output("serve").unlink(), "server.py is missing"),
        (lambda at: at.output("serve").write_text("x"), "server.py is not the one that the endpoint was made for"),
        (lambda at: shutil.rmtree(at.runtime), "the runtime beside server.py is missing"),
        (lambda at: (at.runtime / "extra.py").touch(), "the runtime was changed"),
        (lambda at: (at.endpoint / CHECK).unlink(), "the endpoint was never seen to answer"),
        (lambda at: write_check(at, answered=False), "the endpoint did not answer when it was last checked"),
        (lambda at: write_check(at, tools=("read_clock", "x")), "tools differ: +x -read_voltage"),
        (lambda at: (at.endpoint / "policy.json").write_text("{}"), "the resolved policy was changed"),
        (
            lambda at: (at.endpoint / "octoform/server/transport/unix_socket.py").unlink(),
            "the endpoint's octoform/server/transport/unix_socket.py is missing",
        ),
        (lambda at: (at.run / "process.json").unlink(), "the endpoint is not running"),
        (lambda at: another_start(at), "the endpoint is not running"),
    ],
)
def test_each_drift_is_one_plain_reason(applied: Layout, damage: Callable[[Layout], None], reason: str) -> None:
    damage(applied)
    assert observe(applied).reasons == (reason,)


def test_an_upgrade_behind_our_back_is_a_reason(applied: Layout) -> None:
    upgrade(applied)
    (reason,) = observe(applied).reasons
    assert reason.startswith("fastmcp 4.1.")
    assert reason.endswith(" -> 9.9 in the serving environment")


def test_what_the_artifacts_call_for_counts(applied: Layout) -> None:
    assert observe(applied, Expected(tools=("read_clock",))).reasons == ("tools differ: +read_voltage",)
    assert observe(applied, Expected(lock_text="other==1\n")).reasons == (
        "the endpoint was built for another set of packages",
    )
    assert observe(applied, Expected(server="sha256:00")).reasons


@pytest.mark.parametrize("content", [None, "", "[]", '{"format": 1}', '{"format": 9, "files": {}}', "\x00"])
def test_no_manifest_or_a_foreign_one_is_no_endpoint(layout: Layout, content: str | None) -> None:
    if content is not None:
        layout.endpoint.mkdir(parents=True)
        (layout.endpoint / "manifest.json").write_text(content)
    facts = observe(layout)
    assert not facts.present
    assert facts.reasons == ("the endpoint is not there",)


def test_observing_costs_little_more_than_reading_the_files_once(applied: Layout) -> None:
    files = [path for root in (applied.endpoint, applied.runtime) for path in root.rglob("*") if path.is_file()]

    def cost(work: Callable[[], object]) -> float:
        before = time.process_time()
        work()
        return time.process_time() - before

    def read() -> None:
        for path in files:
            hashlib.sha256(path.read_bytes()).hexdigest()

    observe(applied)
    # What else shares the processor's caches makes most rounds dearer than they are. Measured: 2.2 times
    rounds = [(cost(lambda: observe(applied)), cost(read)) for _ in range(20)]
    assert min(spent for spent, _ in rounds) < 4 * min(least for _, least in rounds)


def test_observing_imports_nothing_heavy() -> None:
    heavy = (
        "subprocess",
        "tempfile",
        "uv",
        "pydantic",
        "jsonschema",
        "ruamel",
        "jinja2",
        "rich",
        "git",
        "fastmcp",
        "asyncio",
    )
    program = f"import sys, octoform.endpoint.drift; print(*(set(sys.modules) & set({heavy!r})))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_removal_takes_what_is_ours_and_leaves_the_rest(applied: Layout) -> None:
    (applied.endpoint / ".launch.x1.tmp").touch()
    (applied.environments / ".0123456789ab.lock").touch()
    mine = [applied.endpoint / "clients" / "mine.json", applied.environments / "notes"]
    for path in mine:
        path.touch()
    assert set(remove(applied)) == {mine[0], mine[0].parent, mine[1]}
    assert {path for path in applied.local.rglob("*") if path.is_file()} == set(mine)
    for path in mine:
        path.unlink()
    assert remove(applied) == []
    assert not applied.endpoint.exists() and not applied.environments.exists()
    assert applied.output("serve").is_file()


@pytest.mark.parametrize("words", ['{"format": 1, "by": "ada", "reason": "arm at the window", "since": ""}', "damaged"])
def test_an_emergency_stop_outlives_its_endpoint(applied: Layout, words: str) -> None:
    (applied.run / "tokens").mkdir(parents=True, exist_ok=True)
    (applied.run / "limits.json").touch()
    (applied.run / "estop.json").write_text(words)
    remove(applied)
    assert [path.name for path in applied.run.iterdir()] == ["estop.json"]
    assert (applied.run / "estop.json").read_text() == words
    [found] = left_behind(applied)
    assert found.code == "DESTROY-ESTOP-KEPT" and found.severity is Severity.WARNING


def test_the_stop_of_a_device_outlives_its_endpoint(applied: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OCTOFORM_STOPS", str(applied.run))
    applied.run.mkdir(mode=0o700, exist_ok=True)
    assert counting.put("usb-2341-804f", "rail_home") == ""
    (applied.run / "limits.json").touch()
    remove(applied)
    assert [path.name for path in applied.run.iterdir()] == ["stopped-usb-2341-804f.json"]
    [found] = left_behind(applied)
    assert found.code == "DESTROY-STOP-KEPT" and found.severity is Severity.WARNING
    stopped = counting.seen("usb-2341-804f")
    assert stopped is not None and stopped.until == "rail_home"


def test_a_service_that_is_left_is_told(applied: Layout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    remove(applied)
    assert left_behind(applied) == []
    unit = systemd.unit_path(applied)
    unit.parent.mkdir(parents=True)
    unit.write_text("[Service]\nExecStart=/of/another/project\n")
    assert left_behind(applied) == []
    unit.write_text(systemd.unit_text(applied, "/usr/bin"))
    [found] = left_behind(applied)
    assert found.code == "DESTROY-UNIT-LEFT" and "service uninstall -user" in str(found.hint)


def test_removing_nothing_is_no_error(layout: Layout) -> None:
    assert remove(layout) == []
