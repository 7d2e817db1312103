"""A project that was copied or renamed: each folder owns what was started from it, and nothing more."""

import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from ordinary import POSSIBLE, ordinary_user
from projects import Project

from octoform.base import place, processes
from octoform.base.place import KEY, place_of
from octoform.endpoint.process.record import running
from octoform.harness.containment import orphans
from octoform.server import tunnel_termination
from octoform.server.process.instance_lock import Owner
from octoform.server.transport import addresses
from octoform.state.layout import Layout
from octoform.state.store import lock
from octoform.state.store.lock import Lock, acquire

LOCAL = Path(".octoform", "bench")
ENVIRONMENTS = "environments"


@pytest.fixture(scope="module")
def applied(tmp_path_factory: pytest.TempPathFactory, compiled: Path) -> Iterator[Project]:
    place = tmp_path_factory.mktemp("copied")
    project = Project(place / "project", place / "outside", kept_servers=True)
    project.take_environments(compiled)
    project.apply(status=0)
    yield project
    project.run("stop")


@contextmanager
def copied_project(applied: Project, place: Path) -> Iterator[Project]:
    """A copy as ``cp -a`` makes it, in a folder of the same owner.

    The environments, thousands of files that no test changes, are linked, and those of a copy before it serve again.
    """
    place.mkdir(exist_ok=True)
    facts = applied.folder.stat()
    os.chown(place, facts.st_uid, facts.st_gid)
    made = replace(applied, folder=place / "copy", environ=dict(applied.environ))
    kept = place / ENVIRONMENTS
    for former in [path for path in place.iterdir() if path != kept]:
        if (former / LOCAL / ENVIRONMENTS).exists():
            (former / LOCAL / ENVIRONMENTS).rename(kept)
        shutil.rmtree(former)
    (made.folder / LOCAL).mkdir(parents=True)
    for folder, left in ((Path(), LOCAL.parts[0]), (Path(LOCAL.parts[0]), LOCAL.parts[1]), (LOCAL, ENVIRONMENTS)):
        parts = [str(path) for path in (applied.folder / folder).iterdir() if path.name != left]
        subprocess.run(["cp", "-a", *parts, str(made.folder / folder)], check=True)
        shutil.copystat(applied.folder / folder, made.folder / folder)
        os.chown(made.folder / folder, facts.st_uid, facts.st_gid)
    if kept.exists():
        kept.rename(made.local / ENVIRONMENTS)
    else:
        subprocess.run(["cp", "-al", str(applied.local / ENVIRONMENTS), str(made.local)], check=True)
    yield made
    made.run("stop")


@pytest.fixture(scope="module")
def copies(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("copies")


@pytest.fixture
def copy(applied: Project, copies: Path) -> Iterator[Project]:
    with copied_project(applied, copies) as made:
        yield made


@contextmanager
def beside(copy: Project, name: str) -> Iterator[Project]:
    """The copy under another name, until the block ends.

    It gets environments of that name: what has loaded those of the former one would look for its modules there.
    """
    renamed = replace(copy, folder=copy.folder.with_name(name))
    kept = copy.folder.with_name(ENVIRONMENTS)
    copy.folder.rename(renamed.folder)
    (renamed.local / ENVIRONMENTS).rename(kept)
    subprocess.run(["cp", "-al", str(kept), str(renamed.local)], check=True)
    try:
        yield renamed
    finally:
        shutil.rmtree(renamed.local / ENVIRONMENTS)
        kept.rename(renamed.local / ENVIRONMENTS)
        renamed.folder.rename(copy.folder)


def pid(project: Project) -> int | None:
    found = running(Layout(project.folder, project.host))
    return found.pid if found else None


COMMANDS = [
    ("stop",), ("estop",), ("start",), ("restart",), ("status",), ("call", "read_temperature"),
    ("tools",), ("revoke",), ("pause",), ("logs",), ("token", "list"), ("watch", "-once"), ("health",), ("plan",),
    ("destroy", "-auto-approve"),
]  # fmt: skip
ENDING = ("stop", "estop", "restart", "pause", "destroy")


def test_nothing_that_is_done_in_a_copy_ends_names_or_steers_the_original(applied: Project, copy: Project) -> None:
    attack_by_commands(applied, copy)


def attack_by_commands(applied: Project, copy: Project, commands: Sequence[tuple[str, ...]] = COMMANDS) -> None:
    before = pid(applied)
    assert before is not None and pid(copy) is None
    for words in commands:
        done = copy.run(*words)
        assert str(before) not in done.text, (words, done.text)
        assert pid(applied) == before, words
    assert not (applied.local / "run" / "estop.json").exists()
    assert not (applied.local / "run" / "stopped.json").exists()
    assert applied.run("tools", status=0).out


def test_a_copy_says_whose_endpoint_it_holds_and_gets_its_own_by_apply(applied: Project, copy: Project) -> None:
    before = pid(applied)
    for words in (("tools",), ("call", "read_temperature")):
        found = copy.run(*words, status=1).err
        assert "ENDPOINT-ELSEWHERE" in found and f"octoform -chdir={applied.folder}" in found
        assert "octoform start" in found
    stopped = copy.run("estop", status=1).text
    assert f"octoform -chdir={applied.folder}" in stopped
    assert str(applied.folder) in copy.run("plan").out
    runs = len(applied.agent_runs())
    copy.run("apply", "-auto-approve", status=0)
    assert len(applied.agent_runs()) == runs, "no agent is asked for that"
    mine = pid(copy)
    assert mine is not None and mine != before == pid(applied)
    for path in (copy.local / "endpoint").rglob("*"):
        assert path.is_dir() or str(applied.folder).encode() + b"/" not in path.read_bytes(), path
    copy.run("stop", status=0)
    assert pid(copy) is None and pid(applied) == before


def own(project: Project) -> None:
    """Every file of its endpoint leads to itself, and its socket lies in it and answers."""
    for path in (project.local / "endpoint").rglob("*"):
        if path.is_dir() or path.suffix == ".pyc":  # bytecode has the path of its compilation, unread there
            continue
        names = re.findall(rb"/[^ \"']*/(?:project|copy|moved|restored)\b", path.read_bytes())
        assert {name for name in names if b"/octoform/" not in name} <= {os.fsencode(project.folder)}, path
    assert (project.local / "run" / "endpoint.sock").is_socket()
    assert "read_temperature" in project.run("tools", status=0).out
    assert [line.strip() for line in project.run("plan", status=0).out.splitlines() if "drift:" in line] == []


@pytest.mark.parametrize("command", ["start", "restart"])
def test_a_start_makes_the_copy_an_endpoint_of_its_own(applied: Project, copy: Project, command: str) -> None:
    attack_by_start(applied, copy, command)


def attack_by_start(applied: Project, copy: Project, command: str = "start") -> None:
    before, runs = pid(applied), len(applied.agent_runs())
    made = (applied.local / "endpoint" / "connection.json").read_bytes()
    found = copy.run(command, status=0)
    assert "the endpoint runs" in found.out and str(before) not in found.text
    mine = pid(copy)
    assert mine is not None and mine != before == pid(applied)
    own(copy)
    assert (applied.local / "endpoint" / "connection.json").read_bytes() == made
    assert len(applied.agent_runs()) == runs, "no agent is asked for that"
    copy.run("estop", status=0)
    assert not (applied.local / "run" / "estop.json").exists()
    copy.run("stop", status=0)
    assert pid(applied) == before


def test_what_was_edited_in_a_copy_does_not_come_into_service_by_a_start(applied: Project, copy: Project) -> None:
    copy.manifest = {"policy": "{read: deny}"}
    copy.write()
    found = copy.run("start", status=1).err
    assert "ENDPOINT-ELSEWHERE" in found and "edited since it was applied" in found, found
    assert pid(copy) is None and pid(applied) is not None


def test_a_restored_backup_is_not_the_lost_machines(applied: Project, copy: Project) -> None:
    """As a backup brings it on another machine: another id, another place, and the original is nowhere."""
    with beside(copy, "restored") as restored:
        for path in restored.folder.rglob("*.json"):
            data = path.read_bytes()
            if b'"machine"' in data or os.fsencode(applied.folder) in data:
                other = data.replace(os.fsencode(applied.folder), b"/home/ada/robot")
                path.write_bytes(re.sub(rb'"machine": ?"[0-9a-f]*"', b'"machine": "0123456789ab"', other))
        before = pid(applied)
        assert pid(restored) is None
        assert "which is not there" in restored.run("tools", status=1).err
        restored.run("start", status=0)
        own(restored)
        restored.run("stop", status=0)
        assert pid(applied) == before


def test_a_renamed_folder_keeps_what_was_started_from_it(applied: Project, copy: Project) -> None:
    copy.run("start", status=0)
    mine = pid(copy)
    assert mine is not None
    with beside(copy, "moved") as moved:
        assert pid(moved) == mine
        assert str(copy.folder) in moved.run("plan").out
        moved.run("stop", status=0)
        assert pid(moved) is None
        assert "which is not there" in moved.run("tools", "-start", status=1).err
        moved.run("start", status=0)
        assert pid(moved) is not None and pid(applied) is not None
        own(moved)
        moved.run("stop", status=0)


def test_a_record_of_another_machine_is_of_no_process_here(applied: Project) -> None:
    path = applied.local / "run" / "process.json"
    before = path.read_bytes()
    record = json.loads(before)
    assert record[KEY] == place_of(path.parent)
    try:
        for of in ({"boot": "another"}, {"boot": ""}):
            path.write_text(json.dumps({**record, **of, KEY: {**record[KEY], "machine": "another"}}))
            assert pid(applied) is None
    finally:
        path.write_bytes(before)
    assert pid(applied) is not None


OTHER_ID = ["unshare", "-m", "sh", "-c", 'mount --bind "$0" /etc/machine-id && exec "$@"']
"""A command runs where the machine has the id of a file, and no other process sees it."""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount another id")
def test_a_machine_that_gets_another_id_keeps_what_it_has_started(applied: Project, tmp_path: Path) -> None:
    """The kernel reports the same process in the same folder since the same start of the machine."""
    (tmp_path / "machine-id").write_text("0123456789abcdef0123456789abcdef\n")
    later = replace(applied, prefix=[*OTHER_ID, str(tmp_path / "machine-id")])
    if subprocess.run([*later.prefix, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("this container mounts nothing")
    before = pid(applied)
    found = later.run("status").out
    assert f"process {before} since" in found and "not running" not in found, found
    assert later.run("call", "read_temperature").status == 0
    assert f"process {before}" in later.run("stop", status=0).out
    assert pid(applied) is None
    applied.run("start", status=0)


def test_a_run_keeps_its_lock_when_the_machine_gets_another_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout, workdir = Layout(tmp_path / "a", "bench"), tmp_path / "attempt"
    workdir.mkdir()
    orphans.write(workdir, orphans.Record(processes.new(), 1, 1))
    held = acquire(layout, "apply").lock
    assert isinstance(held, Lock)
    (tmp_path / "machine-id").write_text("0123456789abcdef0123456789abcdef\n")
    for module in (place, lock):
        monkeypatch.setattr(module, "_MACHINE_ID", tmp_path / "machine-id")
    with held:
        assert acquire(layout, "apply").lock is None
    assert orphans.read(workdir) is not None


def test_a_process_without_a_record_of_this_machine_is_told_to_whoever_starts_another(applied: Project) -> None:
    """As after the machine got another id, or where a container serves the same folder."""
    applied.run("stop", status=0)
    owner = Owner.take(applied.local / "run")
    assert owner is not None
    try:
        refused = applied.run("start", status=1).err
    finally:
        owner.release()
        applied.run("start", status=0)
    assert "a process that has no record of this machine serves this folder" in refused and "fuser" in refused


def copied(folder: Path) -> Path:
    other = folder.with_name(f"{folder.name}-copy")
    shutil.copytree(folder, other, symlinks=True)
    return other


def test_a_lock_that_was_copied_does_not_hold(tmp_path: Path) -> None:
    layout = Layout(tmp_path / "a", "bench")
    held = acquire(layout, "apply").lock
    assert isinstance(held, Lock)
    with held:
        other = Layout(copied(layout.project), "bench")
        mine = acquire(other, "apply")
        assert mine.lock is not None, mine.diagnostics
        mine.lock.release()
        assert held.held() and acquire(layout, "apply").lock is None


def test_agents_and_tunnels_of_the_original_are_none_of_the_copys(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    record = {"pid": 1, "start": 1, "boot": "b", "instance": "i", "mark": "m", "url": None}
    tunnel_termination.publish(run, record)
    assert tunnel_termination.read(run) is not None and tunnel_termination.read(copied(run)) is None
    attempt = tmp_path / "attempt"
    attempt.mkdir()
    orphans.write(attempt, orphans.Record(processes.new(), 1, 1))
    assert orphans.read(attempt) is not None and orphans.read(copied(attempt)) is None


def test_the_port_of_the_original_stays_with_it(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "network.json").write_text(json.dumps({"first": 9000, "port": 9007, KEY: place_of(run)}))
    assert next(iter(addresses._candidates(run, 9000))) == 9007
    assert next(iter(addresses._candidates(copied(run), 9000))) == 9000


@pytest.mark.skipif(not POSSIBLE, reason="only root can become another user")
def test_the_same_as_an_ordinary_user(applied: Project, compiled: Path) -> None:
    """What ends processes, starts them or writes their records: of the others, none asks whose they are."""
    with ordinary_user() as user, copied_project(applied, user.place / "first") as project:
        shutil.rmtree(project.local / ENVIRONMENTS)  # links to files that stay root's
        project.take_bytecode(compiled)
        (user.place / "home").mkdir()
        user.owns_all()
        project.environ, project.user = {"HOME": str(user.place / "home")}, user.prefix
        project.run("start", status=0)
        with copied_project(project, user.place / "copied") as copy:
            attack_by_start(project, copy)
            attack_by_commands(project, copy, [words for words in COMMANDS if words[0] in ENDING])


def test_a_client_that_leads_to_the_original_is_not_turned_or_taken_away_in_a_copy(
    applied: Project, copy: Project
) -> None:
    home = copy.folder.parent
    former = applied.environ
    for project in (applied, copy):
        project.environ = {**project.environ, "HOME": str(home)}
    try:
        applied.run("clients", "install", "cursor", status=0)
        before = (home / ".cursor" / "mcp.json").read_bytes()
        assert os.fsencode(applied.folder) in before
        for words in (("install", "cursor"), ("remove", "cursor")):
            found = copy.run("clients", *words)
            assert str(applied.folder) in found.text, found.text
            assert (home / ".cursor" / "mcp.json").read_bytes() == before
        assert "CLIENT-ENTRY-LEFT" not in copy.run("destroy", "-auto-approve").text
        assert (home / ".cursor" / "mcp.json").read_bytes() == before
    finally:
        applied.environ = former


def test_a_service_of_a_copy_would_not_be_the_originals(applied: Project, copy: Project) -> None:
    home = copy.folder.parent
    copy.environ = {**copy.environ, "HOME": str(home), "XDG_CONFIG_HOME": str(home / "config")}
    found = copy.run("service", "install", "-user", "-auto-approve", status=1)
    assert "ENDPOINT-ELSEWHERE" in found.err and "octoform start" in found.err
    assert not (home / "config").exists()
    copy.run("service", "uninstall", "-user", "-auto-approve")
    assert pid(applied) is not None


def test_tokens_pauses_and_watches_of_a_copy_are_its_own(applied: Project, copy: Project) -> None:
    def kept() -> dict[str, bytes]:
        folders = (applied.local / "run", applied.local / "daemon")
        return {str(path): path.read_bytes() for folder in folders for path in folder.rglob("*") if path.is_file()}

    before, mine = pid(applied), kept()
    watch = copy.start("watch")
    try:
        record = copy.local / "daemon" / "daemon.json"
        deadline = time.monotonic() + 60
        while not record.exists():
            assert time.monotonic() < deadline and watch.poll() is None
            time.sleep(0.05)
        assert json.loads(record.read_text())[KEY] == place_of(record.parent)
        for words in (("token", "add", "-name", "other"), ("pause",), ("resume",), ("heal",), ("estop",), ("stop",)):
            assert str(before) not in copy.run(*words).text
    finally:
        watch.terminate()
        watch.communicate(timeout=60)
    assert kept() == mine and pid(applied) == before
