"""The commands of the daemon, as they are typed: exit codes, JSON, and what a person has to say yes to."""

import io
import json
from collections.abc import Iterator
from pathlib import Path

import ledgers
import pytest
from daemon_world import DaemonWorld, failed

import octoform
from octoform.claims.admission import Proposal
from octoform.claims.ledger import Ledger
from octoform.claims.model import State
from octoform.claims.settings import Settings
from octoform.cli.commands.inspect import NodeArguments
from octoform.cli.commands.safety import ConfirmArguments, run_confirm
from octoform.cli.dispatch import Line, Run, dispatch
from octoform.daemon import main
from octoform.daemon.model import Cause, Repair
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.store import instance_lock
from octoform.manifest.model import Daemon
from octoform.state.layout import Layout
from octoform.views.format.console import Console


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Layout:
    """A project; nothing is applied."""
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    monkeypatch.chdir(tmp_path)
    return Layout(tmp_path, "bench")


@pytest.fixture
def watched(host: Layout) -> Iterator[Layout]:
    owned, problem = instance_lock.take(host, "2026-11-22T03:00:00Z", SystemClock().uptime(), octoform.__version__)
    assert owned is not None, problem
    yield host
    owned.release()


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = dispatch(words)
    found = capsys.readouterr()
    return status, found.out, found.err


def test_health_before_the_first_apply(host: Layout, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "health")
    assert (status, out.splitlines()[0]) == (6, "bench: UNKNOWN: endpoint: nothing is applied yet")
    status, out, _ = run(capsys, "health", "-json")
    assert status == 6
    document = json.loads(out)
    assert (document["status"], document["watched"]) == ("unknown", None)
    assert document["todo"] == [{"command": "octoform apply", "why": "nothing is applied yet"}]


@pytest.mark.parametrize("words", [["health"], ["pause"], ["claims"], ["incidents"], ["heal"], ["confirm", "c1"]])
def test_without_a_manifest_each_says_so_and_leaves_with_1(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, *words)
    assert (status, out) == (1, "")
    assert "octopus.yaml" in err


def test_pause_and_resume(watched: Layout, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "pause")[:2] == (
        0,
        "bench: repairs are paused; the deployment is still looked at\n  octoform resume lets them go on\n",
    )
    assert instance_lock.paused_since(watched)
    assert json.loads(run(capsys, "resume", "-json")[1]) == {
        "format": 1,
        "host": "bench",
        "paused": False,
        "was": True,
        "watched": True,
    }
    assert instance_lock.paused_since(watched) is None
    assert run(capsys, "resume")[:2] == (0, "bench: repairs were not paused\n")


def test_heal_asks_the_daemon_that_lives(watched: Layout, capsys: pytest.CaptureFixture[str]) -> None:
    world = DaemonWorld(watched.project)
    for repair in (Repair.RESTART, Repair.REBUILD):
        world.mends[repair] = lambda world, finding: failed("no such file")
    world.start()
    world.die()
    world.happens(Cause.PROCESS)
    world.advance(1000)
    status, out, _ = run(capsys, "heal")
    assert status == 0
    assert "1 trouble given up" in out
    assert "octoform heal -retry endpoint" in out
    assert instance_lock.taken_up(watched) == ()
    status, out, _ = run(capsys, "heal", "-retry", "endpoint", "-json")
    assert json.loads(out)["retried"] == ["endpoint"]
    assert instance_lock.taken_up(watched) == ("endpoint",)
    status, out, err = run(capsys, "heal", "-retry", "endpiont")
    assert (status, out) == (1, "")
    assert "did you mean endpoint?" in err
    status, out, err = run(capsys, "incidents")
    assert (status, err) == (0, "")
    assert "process_dead" in out
    status, old, err = run(capsys, "episodes")
    assert (status, old) == (0, out)
    assert (
        err == "octoform: `octoform episodes` is now `octoform incidents`; the next version knows the new name only\n"
    )


def test_heal_asks_a_daemon_that_starts_beside_it(
    watched: Layout, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first look finds none; by the time that the command would be the daemon itself, there is one."""
    alive, looks = instance_lock.alive, iter([None])
    monkeypatch.setattr(instance_lock, "alive", lambda layout: next(looks, alive(layout)))
    monkeypatch.setattr(main, "_wanted", lambda folder, environ: (main.Wanted(watched, Daemon(), False), None))
    status, out, err = run(capsys, "heal")
    assert (status, err) == (0, "")
    assert "looks now" in out


def pending(host: Layout) -> str:
    """The id of a declaration that waits for a person, in the ledger that the commands open."""
    clock = SystemClock()
    ledger = Ledger.open(host, clock, Settings())
    reading = ledger.make(ledgers.heat(), 75)
    ledger.record([reading])
    proposal = Proposal(
        target=ledgers.ELBOW_TARGET,
        fault="none",
        statement="the elbow may never be moved again",
        cites=(reading.id,),
        irreversible="terminal_lock",
    )
    claim = ledger.propose(proposal, "watch")
    assert not isinstance(claim, octoform.diagnostics.Diagnostic), claim
    assert claim.state is State.PENDING
    return claim.id


def test_a_declaration_needs_a_person_on_a_terminal(
    host: Layout, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    name = pending(host)
    status, out, _ = run(capsys, "claims")
    assert status == 0
    assert f"{name}  waits for a person  {ledgers.ELBOW_TARGET}: the elbow may never be moved again" in out
    assert f"octoform confirm {name}, or with -reject" in out
    status, _, err = run(capsys, "confirm", name)
    assert status == 1
    assert "CLAIM-NOT-APPROVED" in err
    for typed, code, left in (("y\n", 1, "pending"), ("yes\n", 0, "active")):
        monkeypatch.setattr("sys.stdin", io.StringIO(typed))
        answer = io.StringIO()
        screen = Console(answer, io.StringIO(), colour=False, colour_err=False, interactive=True)
        asked = Run(screen)
        asked.project = host.project
        arguments = Line(["confirm", name]).arguments()
        assert isinstance(arguments, ConfirmArguments) and run_confirm(arguments, asked) == code
        claims = json.loads(run(capsys, "claims", "-json")[1])["claims"]
        assert [each["state"] for each in claims if each["id"] == name] == [left]
    assert run(capsys, "claims", "-retire", name)[0] == 0
    assert json.loads(run(capsys, "claims", "-json")[1])["claims"] == []
    (over,) = json.loads(run(capsys, "claims", "-all", "-json")[1])["claims"]
    assert (over["state"], over["ended"]) == ("retired", "operator")


def test_no_is_said_without_a_question(host: Layout, capsys: pytest.CaptureFixture[str]) -> None:
    name = pending(host)
    status, out, _ = run(capsys, "confirm", name, "-reject")
    assert status == 0
    assert "refused" in out
    status, _, err = run(capsys, "confirm", name, "-reject")
    assert (status, "CLAIM-NOT-FOUND" in err) == (1, True)


@pytest.mark.parametrize("folder", [(), ("-chdir", "accept"), ("-chdir=accept",)])
def test_a_former_name_is_the_new_command(folder: tuple[str, ...]) -> None:
    line = Line([*folder, "accept", "probe", "-json"])
    assert line.command is not None and line.command.name == "state adopt"
    assert (line.former, line.chdir) == ("accept", "accept" if folder else None)
    arguments = line.arguments()
    assert isinstance(arguments, NodeArguments) and (arguments.node, arguments.json) == ("probe", True)
    assert Line(["state", "adopt", "accept"]).former is None
