"""Situations of a deployment and all commands that report its status: the same word and exit code everywhere.

A user without rights is this one without the two capabilities that let root pass by the mode of a file; so are the
endpoint and the daemon in every situation, and the commands that report rights.
"""

import json
import os
import runpy
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from ordinary import OPEN_PYTHON, POSSIBLE, ordinary_user
from projects import AGENT, Project
from replugged import ANSWERS, BOARD, CAMERA, Host, script

pytestmark = [pytest.mark.dear, pytest.mark.skipif(os.geteuid() != 0, reason="only root gives up rights")]
BARE = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search"]
CODES = {"healthy": 0, "degraded": 3, "error": 4, "down": 5, "unknown": 6}
SECONDS = 40.0


@dataclass
class Bench:
    """The live project, the host that it looks at, and the file of metrics."""

    project: Project
    host: Host
    metrics: Path

    @property
    def camera(self) -> Path:
        return self.host.tree.root / "dev/video0"

    def status(self) -> str:
        """The word of ``status``, whose exit code has to agree."""
        done = self.project.run("status", "-json")
        found = json.loads(done.out)
        assert done.status == (CODES[found["health"]] or (0 if found["in_sync"] else 1)), done.text
        return str(found["health"])

    def health(self) -> str:
        """The word of ``health``, whose exit code has to agree."""
        done = self.project.run("health", "-json")
        word = str(json.loads(done.out)["status"])
        assert done.status == CODES[word], done.text
        return word

    def http(self) -> str:
        """The word of the HTTP door, whose status has to agree; a door without a listener is down."""
        record = self.project.local / "run" / "network.json"
        url = json.loads(record.read_bytes())["url"] if record.exists() else "http://127.0.0.1:9"
        try:
            with urllib.request.urlopen(f"{url.removesuffix('/mcp')}/health", timeout=5) as answer:
                code, body = answer.status, answer.read()
        except urllib.error.HTTPError as problem:
            code, body = problem.code, problem.read()
        except OSError:
            return "down"
        found = json.loads(body)
        assert set(found) == {"status", "tools", "instance"}, "it tells strangers no names"
        assert code == (200 if found["status"] == "healthy" else 503)
        return str(found["status"])

    def counted(self) -> str:
        """The word of the file of metrics."""
        lines = self.metrics.read_text().splitlines()
        return next(line.split('status="')[1].split('"')[0] for line in lines if "_health{" in line and "} 1.0" in line)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("verdict")
    host = Host(folder / "root")
    plug_in(host)
    project = Project(folder / "project", folder / "outside", script=script())
    project.manifest["answers"] = ANSWERS
    project.environ["OCTOFORM_SYSROOT"] = str(host.tree.root)
    metrics = folder / "octoform.prom"
    project.manifest |= {
        "stages": "{probe: {harness: builtin}}",
        "scope": "intranet",
        "network": "{interface: 127.0.0.1, port: 7810}",
        "daemon": f"{{metrics: {metrics}, apply: ask, interval: 10s}}",
    }
    project.share_environments(environments)
    project.apply(status=0)
    project.run("stop", status=0)
    with bare(project):
        project.run("start", status=0)
    yield Bench(project, host, metrics)
    project.run("stop", status=0)
    host.clear()


@contextmanager
def bare(project: Project) -> Iterator[None]:
    """What is run in the block has no such rights, nor has what it starts."""
    project.user = BARE
    try:
        yield
    finally:
        project.user = []


def plug_in(host: Host) -> None:
    host.clear()
    host.camera("1-1", 0)
    host.board("1-2", "ttyUSB0", "left")
    host.board("1-3", "ttyUSB1", "right")
    host.sensor("1-4", 2, "21500")


@contextmanager
def well(bench: Bench) -> Iterator[None]:
    yield


@contextmanager
def device_gone(bench: Bench) -> Iterator[None]:
    bench.host.unplug("1-1")
    yield
    bench.host.camera("1-1", 0)


@contextmanager
def no_rights(bench: Bench) -> Iterator[None]:
    os.chown(bench.camera, 65534, 44)
    bench.camera.chmod(0o660)
    try:
        with bare(bench.project):
            yield
    finally:
        os.chown(bench.camera, 0, 0)


@contextmanager
def emergency_stop(bench: Bench) -> Iterator[None]:
    bench.project.run("estop", "-reason", "verdict", status=0)
    yield
    bench.project.run("estop", "-clear", status=0)


@contextmanager
def stopped(bench: Bench) -> Iterator[None]:
    bench.project.run("stop", status=0)
    yield
    with bare(bench.project):
        bench.project.run("start", status=0)


BAD: dict[str, tuple[Callable[[Bench], object], str]] = {
    "a device gone": (device_gone, "degraded"),
    "no rights on a node": (no_rights, "degraded"),
    "emergency stop": (emergency_stop, "degraded"),
    "stopped": (stopped, "down"),
}


def becomes(told: Callable[[], str], word: str) -> str:
    """The status once it is the expected one; and after a while."""
    end = time.monotonic() + SECONDS
    while (found := told()) != word and time.monotonic() < end:
        time.sleep(0.2)
    return found


@pytest.mark.parametrize("situation", BAD)
def test_without_a_daemon_what_is_plainly_bad_is_so_everywhere(bench: Bench, situation: str) -> None:
    made, word = BAD[situation]
    with made(bench):  # type: ignore[attr-defined]
        assert {"status": bench.status(), "health": bench.health(), "http": becomes(bench.http, word)} == dict.fromkeys(
            ("status", "health", "http"), word
        )


def test_without_a_daemon_the_door_calls_nothing_healthy_that_nobody_looked_at(bench: Bench) -> None:
    assert becomes(bench.http, "unknown") == "unknown"
    assert bench.status() == bench.health() == "healthy", "these two look themselves"


def test_without_a_daemon_a_device_that_works_in_another_place_is_well(bench: Bench) -> None:
    bench.host.unplug("1-1")
    bench.host.camera("1-5", 1)
    try:
        bench.project.run("call", "capture_image", status=0)
        assert (bench.status(), bench.health()) == ("healthy", "healthy"), bench.project.run("status").out
        assert "another place" not in bench.project.run("status").out + bench.project.run("health").out
    finally:
        bench.host.unplug("1-5")
        bench.host.camera("1-1", 0)


def test_a_daemon_that_died_vouches_for_nothing(bench: Bench) -> None:
    """Its last status file is stale: a command looks itself, and who cannot look does not call it healthy."""
    with bare(bench.project):
        daemon = bench.project.start("watch", start_new_session=True)
    try:
        assert becomes(bench.http, "healthy") == "healthy"
    finally:
        os.killpg(daemon.pid, signal.SIGKILL)
        daemon.communicate(timeout=30)
    assert becomes(bench.http, "unknown") == "unknown"
    assert bench.status() == bench.health() == "healthy", "these two look themselves"
    assert "octoform watch" in bench.project.run("health").out, "no one watches it, and that is said"
    lines = bench.metrics.read_text().splitlines()
    written = next(line for line in lines if line.startswith("octoform_last_round_timestamp_seconds"))
    assert 0 <= time.time() - float(written.split()[-1]) < 60, "the file tells how old it is"
    with device_gone(bench):
        words = (bench.status(), bench.health(), becomes(bench.http, "degraded"))
        assert words == ("degraded", "degraded", "degraded")


@pytest.fixture(scope="module")
def watched(bench: Bench) -> Iterator[Bench]:
    with bare(bench.project):
        daemon = bench.project.start("watch")
    try:
        yield bench
    finally:
        daemon.terminate()
        daemon.communicate(timeout=30)


@pytest.mark.parametrize("situation", ["well", *BAD])
def test_with_a_daemon_all_say_the_same(watched: Bench, situation: str) -> None:
    made, word = BAD.get(situation, (well, "healthy"))
    surfaces = {"status": watched.status, "health": watched.health, "http": watched.http, "metrics": watched.counted}
    with made(watched):  # type: ignore[attr-defined]
        until_metrics = becomes(lambda: watched.counted() if watched.metrics.exists() else "", word)
        assert until_metrics == word
        assert {name: becomes(text, word) for name, text in surfaces.items()} == dict.fromkeys(surfaces, word)


def test_a_call_names_the_rights_that_vanished_while_it_serves_and_works_once_they_are_back(bench: Bench) -> None:
    project = bench.project
    project.run("call", "capture_image", status=0)
    with no_rights(bench):
        refused = project.run("call", "capture_image")
        words = " ".join(refused.text.split())
        assert refused.status == 1
        for piece in ("/dev/video0", "mode 0660", "group video", "`octoform doctor` shows what grants the use"):
            assert piece in words, (piece, words)
        other = project.run("call", "read_temperature", status=0).out
        assert "21500" in other
    project.run("call", "capture_image", status=0)


def test_a_user_without_rights_is_told_by_apply_doctor_and_coverage(bench: Bench) -> None:
    """Each names the node, its mode and group, and the command that helps; the device does not count as usable."""
    project = bench.project
    with bare(project):
        before = json.loads(project.run("coverage", "-json", status=0).out)["coverage"]["onboardable"]
        assert project.run("doctor", status=0).status == 0
    with no_rights(bench):
        applied = project.run("apply", "-auto-approve")
        assert applied.status == CODES["degraded"]
        assert "Apply incomplete" in applied.out and "Apply complete" not in applied.out
        doctor = project.run("doctor")
        assert doctor.status == 1
        for text in (applied.err, doctor.out):
            words = " ".join(text.split())
            for piece in (CAMERA, "/dev/video0", "mode 0660", "group video", "usermod -aG video root", "log in again"):
                assert piece in words, (piece, words)
        after = json.loads(project.run("coverage", "-json", status=0).out)["coverage"]["onboardable"]
        assert (after["usable"], after["of"]) == (before["usable"] - 1, before["of"])
    with bare(project):
        assert project.run("doctor").status == 0
    assert BOARD in project.run("coverage", status=0).out


@pytest.mark.skipif(not POSSIBLE or not OPEN_PYTHON.exists(), reason="only root can become another user")
def test_a_first_apply_by_another_user_ends_as_incomplete_where_a_node_is_closed_to_it(compiled: Path) -> None:
    """From nothing on everything is that user's: no root has applied before; the packages are a copy of their own."""
    with ordinary_user() as user:
        host = Host(user.place / "root")
        plug_in(host)
        scout = Project(user.place / "scout", user.place / "scripts", harness="builtin")
        scout.environ["OCTOFORM_SYSROOT"] = str(host.tree.root)
        scout.apply("-target", "probe", status=0)
        [seen] = scout.attempts("probe")
        project = Project(user.place / "project", user.place / "outside", prefix=user.prefix)
        # The interpreter of these tests may be closed to that user, so what the embedded agent wrote is handed in.
        project.script = {"probe": [{"write": (seen / "output.json").read_text()}], **script()}
        project.script["deploy"] = [{"write": runpy.run_path(str(AGENT))["good"]("deploy")}]
        command = json.dumps([str(OPEN_PYTHON), str(AGENT), str(project.outside / "script.json")])
        project.harness = f"{{name: command, command: {command}, sandbox: false}}"
        project.manifest["answers"] = ANSWERS
        project.environ |= {"OCTOFORM_SYSROOT": str(host.tree.root), "HOME": str(user.place / "home")}
        (user.place / "home").mkdir()
        project.write()
        project.take_environments(compiled, linked=False)
        user.owns_all()
        for name in ("ttyUSB0", "ttyUSB1"):
            os.chown((host.tree.root / "dev" / name).resolve(), 65534, -1)
        camera = host.tree.root / "dev/video0"
        os.chown(camera, 0, 44)
        camera.chmod(0o600)
        try:
            done = project.run("apply", "-auto-approve")
            assert done.status == CODES["degraded"], done.text
            words = " ".join(done.text.split())
            for piece in ("Apply incomplete", CAMERA, "/dev/video0", "mode 0600"):
                assert piece in words, (piece, words)
            assert "Apply complete" not in words
            text = " ".join(project.run("doctor").text.split())
            assert "/dev/video0" in text and "mode 0600" in text, text
        finally:
            project.run("stop")
            host.clear()
