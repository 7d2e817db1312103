"""Repairs on a real deployment: what is damaged comes back, what a person did stays, and nothing gets worse."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import warm
from bench_host import bench_host
from plugged import CAMERA, Host
from projects import Project

from octoform.daemon.repair.restart import restart
from octoform.endpoint.environment.model import at, intact, packages_of
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import running
from octoform.endpoint.published_files import read_manifest
from octoform.engine.apply import approval
from octoform.engine.apply.rollback import go_back, remember
from octoform.engine.unattended.heal import settle
from octoform.engine.unattended.rediscover import rediscover
from octoform.engine.unattended.repairs import rebuild, republish, restore
from octoform.state.layout import Layout, is_left
from octoform.state.store.store import StateStore

pytestmark = pytest.mark.dear

NOT_WANTED = [["left_out"], [{"id": CAMERA, "reason": "a camera that no one here asks for"}]]
OTHERWISE: dict[str, object] = {
    "probe": [{"mutate": [NOT_WANTED, [["scan_methods", 1, "status"], "ok"]]}],
    "identify": [{"mutate": [[["devices", 0, "confidence"], 0.75]]}],
    "interface": [{"mutate": [[["tools", 0, "description"], "Read the temperature of the board once more."]]}],
}
"""All that comes before SERVE, not as it was before."""


@pytest.fixture(scope="module")
def applied(tmp_path_factory: pytest.TempPathFactory, compiled: Path) -> Iterator[Project]:
    """A live project of a host with a sensor, into which a camera can be plugged."""
    folder = tmp_path_factory.mktemp("repairs")
    project = Project(folder / "project", folder / "outside", script={"probe": [{"mutate": [NOT_WANTED]}]})
    project.take_environments(compiled)
    project.kept_servers = True
    project.environ["OCTOFORM_SYSROOT"] = str(bench_host(folder / "root"))
    project.apply(status=0)
    yield project
    project.run("destroy", "-auto-approve", status=0)


@contextmanager
def plugged(applied: Project) -> Iterator[None]:
    """A camera that PROBE has not seen."""
    host = Host.__new__(Host)
    host.root = Path(applied.environ["OCTOFORM_SYSROOT"])
    host.plug(CAMERA)
    (host.root / "sys/bus/usb/devices/1-5/modalias").write_text("usb:v046Dp0825d0012\n")
    try:
        yield
    finally:
        host.unplug_camera()


@pytest.fixture(autouse=True)
def loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a repair starts in this process is a fork of a loaded interpreter too."""
    monkeypatch.setattr(start_stop, "_Detached", warm.Loaded)


@pytest.fixture
def layout(applied: Project) -> Layout:
    """Its paths, with the endpoint running."""
    layout = Layout(applied.folder, applied.host)
    if running(layout) is None:
        applied.run("start", status=0)
    return layout


def changed_nothing(applied: Project, layout: Layout) -> tuple[object, ...]:
    """What must be the same when nothing was done."""
    return running(layout), applied.nodes(), layout.output("serve").read_bytes()


def in_sync(applied: Project) -> bool:
    return "No changes" in applied.run("plan").out


def test_a_killed_endpoint_is_started_again_and_a_stopped_one_is_not(applied: Project, layout: Layout) -> None:
    before = running(layout)
    assert before is not None
    os.kill(before.pid, signal.SIGKILL)
    done = restart(layout)
    after = running(layout)
    assert done.ok, done.detail
    assert after is not None and after.instance != before.instance
    applied.run("stop", status=0)
    assert json.loads(layout.stop_mark.read_bytes())["by"]
    refused = restart(layout)
    assert (refused.ok, refused.again) == (False, False)
    assert rediscover(layout, applied.environment(), apply="auto").ok is False
    assert running(layout) is None
    applied.run("start", status=0)
    assert not layout.stop_mark.exists()


def test_damaged_files_come_back_and_lie_aside_and_an_edit_stays_while_it_does_no_harm(
    applied: Project, layout: Layout
) -> None:
    server, probe, policy = layout.output("serve"), layout.output("probe"), layout.endpoint / "policy.json"
    texts = {path: path.read_bytes() for path in (server, probe, policy)}
    server.write_bytes(texts[server][:200])
    probe.unlink()
    policy.write_bytes(b"{}")
    (layout.output("interface")).write_bytes(layout.output("interface").read_bytes().replace(b"\n", b"\n\n", 1))
    done = restore(layout)
    assert {path: path.read_bytes() for path in texts} == texts
    assert "server.py (truncated)" in done.detail and "output.json (missing)" in done.detail
    assert "interface/output.json was edited and stays" in done.detail
    aside = [path for path in (layout.daemon / "aside").rglob("server.py")]
    assert [path.read_bytes() for path in aside] == [texts[server][:200]]
    applied.run("plan", "-detailed-exitcode", status=2)
    layout.output("interface").write_bytes(layout.output("interface").read_bytes().replace(b"\n\n", b"\n", 1))
    assert restore(layout).detail == "every file is as it was accepted"
    assert in_sync(applied)


def test_an_edited_server_gives_way_only_when_the_endpoint_is_down_for_it(layout: Layout) -> None:
    server = layout.output("serve")
    accepted = server.read_bytes()
    edited = accepted + b"\n# a person was here\n"
    server.write_bytes(edited)
    kept = restore(layout)
    assert (kept.ok, kept.again) == (False, False)
    assert server.read_bytes() == edited
    process = running(layout)
    assert process is not None
    os.kill(process.pid, signal.SIGKILL)
    while running(layout) is not None:
        pass
    done = restore(layout)
    assert done.ok and server.read_bytes() == accepted
    place = Path(done.detail.partition("lies in ")[2].partition(";")[0])
    assert (layout.project / place if not place.is_absolute() else place).name == "server.py"
    assert edited in [path.read_bytes() for path in (layout.daemon / "aside").rglob("server.py")]


def test_a_conflicting_package_and_a_lost_one_go_with_the_environment_that_is_built_again(
    applied: Project, layout: Layout, packaged: Callable[..., Path]
) -> None:
    manifest = read_manifest(layout)
    assert manifest is not None
    environment = at(Path(manifest["environment"]))
    assert environment is not None
    folder = packages_of(environment.path)
    record = next(folder.glob("anyio-*.dist-info/RECORD")).read_text()
    rival = folder / "anyio_rival-1.0.dist-info"
    rival.mkdir()
    (rival / "RECORD").write_text("\n".join(line for line in record.splitlines() if line.startswith("anyio/")))
    reasons = intact(environment)
    assert any("anyio is provided by both anyio and anyio-rival" in reason for reason in reasons), reasons
    before = running(layout)
    with applied.borrowed_bytecode(packaged("pyserial")):
        done = rebuild(layout)
    assert done.ok, done.detail
    assert intact(environment) == [] and not rival.exists()
    after = running(layout)
    assert before is not None and after is not None and after.instance != before.instance
    assert [path.name for path in layout.environments.iterdir() if path.name.endswith(".damaged")] == []


def test_a_build_that_fails_leaves_the_environment_that_is_there(
    layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    manifest = read_manifest(layout)
    assert manifest is not None
    environment = at(Path(manifest["environment"]))
    assert environment is not None
    monkeypatch.setenv("UV_CACHE_DIR", str(layout.local / "no-cache"))
    monkeypatch.setenv("UV_OFFLINE", "1")
    before = running(layout)
    done = rebuild(layout)
    assert not done.ok and "is as it was" in done.detail
    assert intact(environment) == [] and running(layout) == before


def test_an_endpoint_that_lost_its_own_files_answers_again(layout: Layout) -> None:
    (layout.endpoint / "check.json").unlink()
    (layout.endpoint / "launch").unlink()
    (layout.endpoint / "manifest.json").write_bytes(b"")
    done = republish(layout)
    assert done.ok, done.detail
    assert os.access(layout.endpoint / "launch", os.X_OK)
    assert (layout.endpoint / "check.json").is_file()
    (layout.endpoint / "launch").chmod(0o600)
    assert republish(layout).ok
    assert os.access(layout.endpoint / "launch", os.X_OK)


@pytest.mark.parametrize("stage", ["probe", "serve"])
def test_re_discovery_that_fails_leaves_everything_as_it_was(applied: Project, layout: Layout, stage: str) -> None:
    before, count = changed_nothing(applied, layout), len(applied.agent_runs())
    script = {**OTHERWISE, stage: [{"exit": 1}]}
    (applied.outside / "script.json").write_text(json.dumps(script))
    with plugged(applied):
        done = rediscover(layout, applied.environment(), apply="auto")
    assert not done.ok and f"{stage} failed" in done.detail
    assert done.spent.calls == len(applied.agent_runs()) - count > 0
    assert changed_nothing(applied, layout) == before
    (applied.outside / "script.json").write_text("{}")
    assert in_sync(applied)


ENDED = """
import os, signal, sys
from functools import partial
from pathlib import Path
from octoform.daemon.repair import worker
from octoform.engine.unattended import rediscover
from octoform.state.store.store import Ports
from octoform.state.layout import Layout as Paths

number, last = int(sys.argv[2]), int(sys.argv[3])
passed = []

def checkpoint(name):
    if name == "journal.success.synced":
        passed.append(name)
        if len(passed) == last:
            os.kill(os.getpid(), number)

signal.signal(signal.SIGTERM, worker._end)
rediscover.Options = partial(rediscover.Options, ports=Ports(checkpoint=checkpoint))
done = rediscover.rediscover(Paths(Path(sys.argv[1]), "bench"), os.environ, apply="auto")
print(len(passed), done)
"""
"""A re-discovery whose process gets a signal when so many nodes were accepted."""


@pytest.mark.parametrize(("number", "accepted"), [("KILL", 1), ("KILL", 4), ("TERM", 4), ("KILL", 5)])
def test_re_discovery_that_is_ended_at_any_point_is_taken_back(
    applied: Project, layout: Layout, number: str, accepted: int
) -> None:
    before = changed_nothing(applied, layout)
    (applied.outside / "script.json").write_text(json.dumps(OTHERWISE))
    ended = signal.Signals[f"SIG{number}"]
    with plugged(applied):
        program = applied.outside / "ended.py"
        program.write_text(ENDED)
        words = [str(applied.folder), str(int(ended)), str(accepted)]
        status, out, err = warm.run(program, words, applied.folder, applied.environment(), 120, kept=True)
    assert status == (-9 if number == "KILL" else 1), out + err
    (applied.outside / "script.json").write_text("{}")
    if number == "KILL":
        assert is_left(layout)
        found = settle(layout, applied.environment())
        assert found is not None and found.ok, found
    assert not is_left(layout) and not layout.lock.exists()
    assert applied.nodes() == before[1] and layout.output("serve").read_bytes() == before[2]
    assert running(layout) is not None and in_sync(applied)


def test_the_former_endpoint_serves_again_when_a_new_one_was_published_and_failed(
    applied: Project, layout: Layout
) -> None:
    store, _ = StateStore.open(layout)
    assert store is not None
    former = remember(layout, store.snapshot)
    assert former is not None
    before = changed_nothing(applied, layout)
    start_stop.stop(layout)
    layout.output("serve").write_text("the server that failed")
    for name in ("policy.json", "connection.json", "manifest.json", "launch"):
        (layout.endpoint / name).write_text("of the server that failed")
    assert go_back(former) == []
    assert changed_nothing(applied, layout)[1:] == before[1:]
    assert running(layout) is not None and in_sync(applied)


def test_what_a_person_has_not_applied_yet_is_asked_about_once_and_an_apply_answers(
    applied: Project, layout: Layout
) -> None:
    before = changed_nothing(applied, layout)
    text = (applied.folder / "octopus.yaml").read_text()
    with plugged(applied):
        (applied.folder / "octopus.yaml").write_text(text.replace("policy: {actuate: allow}", "policy: {read: deny}"))
        first, second = (rediscover(layout, applied.environment(), apply="auto") for _ in range(2))
        assert (first.ok, first.again, first.asked, second.asked) == (False, False, True, False)
        assert "setting.policy.read" in first.detail
        (applied.folder / "octopus.yaml").write_text(text)
        third = rediscover(layout, applied.environment(), apply="ask")
        assert (third.asked, changed_nothing(applied, layout)) == (True, before)
        question = approval.read(layout)
        assert question is not None and any("046D" in entry.upper() or "usb" in entry for entry in question.hardware)
        done = rediscover(layout, applied.environment(), apply="auto")
        assert done.ok, done
        assert approval.read(layout) is None
        # The kinds came out the same, so the endpoint was not touched.
        assert running(layout) == before[0]
