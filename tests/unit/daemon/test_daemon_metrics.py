"""The daemon in numbers: what Prometheus' own parser reads from the file."""

import stat
from pathlib import Path

from daemon_world import DaemonWorld, failed
from prometheus_client.parser import text_string_to_metric_families

from octoform.apply.repair_outcome import Cost
from octoform.base.health_status import Status
from octoform.daemon import metrics
from octoform.daemon.health import Health, Part
from octoform.daemon.metrics import Picture
from octoform.daemon.model import Cause, Repair
from octoform.daemon.store import incidents

Numbers = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def numbers(data: bytes) -> Numbers:
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(data.decode())
        for sample in family.samples
    }


def health(status: Status = Status.UNKNOWN) -> Health:
    parts = (Part("unit:arm/elbow", status, "does not report"),)
    return Health("bench", "2026-11-22T03:00:00Z", 50.0, status, parts, 7, ("arm/elbow",), ("c1",), ("c2", "c3"))


def test_health_is_one_of_five(tmp_path: Path) -> None:
    found = numbers(metrics.render(Picture(health(), (), 1234.5, frozen=2, paused=True, untold=3)))
    host = ("host", "bench")
    status = {dict(labels)["status"]: value for (name, labels), value in found.items() if name == "octoform_health"}
    assert status == {"healthy": 0, "degraded": 0, "error": 0, "down": 0, "unknown": 1}
    for name, value in {
        "last_round_timestamp_seconds": 1234.5,
        "paused": 1,
        "signals_reporting": 7,
        "signals_silent": 1,
        "claims": 1,
        "claims_pending": 2,
        "troubles_frozen": 2,
        "messages_lost": 3,
        "agent_calls": 0,
        "agent_usd": 0,
    }.items():
        assert found[f"octoform_{name}", (host,)] == value


def test_repairs_and_what_agents_cost_are_counted(tmp_path: Path) -> None:
    world = DaemonWorld(tmp_path)
    world.start()
    world.at(10, world.die, Cause.PROCESS)
    world.advance(60)
    world.mends[Repair.RESTART] = lambda world, finding: failed("no", cost=Cost(1, 100, 20, None))
    world.die()
    world.happens(Cause.PROCESS)
    found = numbers(metrics.render(Picture(health(), incidents.read(world.memory.shelf), world.now)))
    host = ("host", "bench")
    assert found["octoform_episodes_ended", (host, ("kind", "process_dead"), ("outcome", "repaired"))] == 1
    assert found["octoform_episodes_open", (host, ("kind", "process_dead"), ("outcome", "open"))] == 1
    assert found["octoform_repairs", (host, ("repair", "restart"), ("result", "ok"))] == 1
    assert found["octoform_repairs", (host, ("repair", "restart"), ("result", "failed"))] == 1
    assert found["octoform_agent_calls", (host,)] == 1
    assert found["octoform_agent_tokens", (("direction", "input"), host)] == 100
    assert not any(name == "octoform_agent_usd" for name, _ in found), "a cost that no one knows is no zero"


def test_the_file_is_whole_readable_and_leaves_nothing_beside(tmp_path: Path) -> None:
    path = tmp_path / "octoform.prom"
    for _ in range(2):
        assert metrics.write(path, Picture(health(), (), 1.0)) is None
    assert [each.name for each in tmp_path.iterdir()] == ["octoform.prom"]
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    assert numbers(path.read_bytes())


def test_a_folder_that_is_not_there_is_said(tmp_path: Path) -> None:
    problem = metrics.write(tmp_path / "none" / "octoform.prom", Picture(health(), (), 1.0))
    assert problem is not None
    assert "octoform.prom" in str(problem.path)


def test_hostile_names_stay_labels(tmp_path: Path) -> None:
    hostile = Health('be"n\nch\\', "", 0.0, Status.HEALTHY)
    found = numbers(metrics.render(Picture(hostile, (), 1.0)))
    assert ("octoform_paused", (("host", 'be"n\nch\\'),)) in found
