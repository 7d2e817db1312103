"""The eleven hours: an arm that gets hot, and an agent that concludes more from it at each episode, in virtual time.

In the paper the daemon ran for 11 h 17 m unattended. For 19 episodes the agent tightened its own rules although each
reading was clean again, and at the end every joint that reported was disabled and the report said healthy. Here the
agent is scripted to do just that, with every trick it has, over the simulated arm, the generated server, the daemon's
loop, the ledger and the endpoint's own reading of the restrictions.
"""

import functools
import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import daemon_world
import pytest
from daemon_world import DaemonWorld, worked
from virtual_rig import ARM, VirtualRig, described, virtual_rig

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.health_status import Status
from octoform.claims.codec import evidence_of
from octoform.claims.ledger import CLAIMS
from octoform.claims.model import Channel, Claim, Reading, Signal, State, holds
from octoform.claims.settings import bound_documents, settings_of
from octoform.daemon.model import Cause, Finding, Repair
from octoform.daemon.observe.samples import flattened
from octoform.daemon.reconcile.supervisor import Cycle, Supervisor
from octoform.diagnostics import Diagnostic
from octoform.endpoint.published_files import POLICY
from octoform.manifest.model import Daemon
from octoform.policy.published import read
from octoform.profiles.registers import RegisterDefinition
from octoform.server.gate.tool_registry import Entries
from octoform.server.restrictions import Restrictions
from octoform.state.layout import Layout

DAY, HOUR, MINUTE = 86400.0, 3600.0, 60.0
WHOLE = 11 * HOUR + 17 * MINUTE
QUIET, CONVERGENT, ESCALATING, LAST = 4 * HOUR + 5 * MINUTE, 5, 19, HOUR + 27 * MINUTE
"""The paper's course: a quiet time, two kinds of episodes, and what it called healthy at the end."""
HEAT = {"ambient": 25, "per_percent": 3.97, "slowness": 60}
"""The elbow holds the forearm out at 69 degrees, from which on the profile moves no joint; at 70 its motor lets go."""
OUT = {2: 1500, 3: 3000}
UP = {2: 2048, 3: 1100}
"""Counts by servo: the forearm held out level, and the arm upright, where hardly any joint works against gravity."""
ELBOW = f"device:{ARM}/elbow_flex"
CLEAN_BELOW = 60
REFUSALS = {
    "CLAIM-NO-READING",
    "CLAIM-UNKNOWN-READING",
    "CLAIM-OTHER-SIGNAL",
    "CLAIM-NOT-SUPPORTED",
    "CLAIM-WITHIN-LIMITS",
    "CLAIM-TOO-WIDE",
    "CLAIM-RATCHET",
    "CLAIM-IRREVERSIBLE",
}
"""What the ledger has to have said to an agent that tries everything."""
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


class ArmWorld(DaemonWorld):
    """The daemon over the simulated arm. ``whole``: each sample is a call of the generated server's tool."""

    def __init__(self, folder: Path, rig: VirtualRig, whole: bool) -> None:
        self.rig, self.whole, self.skipping = rig, whole, False
        self.agent = Ratchet(self)
        self.seen: Counter[str] = Counter()
        self.believed: list[Claim] = []
        self.elbow: Reading | None = None
        layout = Layout(folder, "bench")
        accepted(layout, rig)
        grammars = [(one.name, one.grammar) for one in rig.profiles]
        protects = [
            (name, one.registers.protect)
            for name, one in grammars
            if isinstance(one, RegisterDefinition) and one.registers.protect is not None
        ]
        # The breakers stop an agent that does not help after three tries; in the eleven hours it may go on.
        settings = Daemon(calls_per_hour=1000, heal_attempts=100 if whole else 3)
        self.samples = itertools.count()
        super().__init__(folder, settings, claims=settings_of(layout, 1800.0, bound_documents(layout, protects)))
        self.began = self.now
        self.endpoint = Restrictions(layout.restrictions, clock=self.uptime, boot=self.boot)
        self.served = Entries(read(layout.endpoint / POLICY))
        self.mends[Repair.WATCH] = _watch

    def begun(self) -> Supervisor:
        """A daemon whose ledger's answers are counted."""
        made = super().begun()
        self.ledger.propose = functools.partial(self._heard, self.ledger.propose)  # type: ignore[method-assign]
        return made

    # The arm

    def turned(self, places: dict[int, int]) -> None:
        """Somebody puts the arm there by hand; the motors hold it."""
        self.passed()
        for number, place in places.items():
            self.rig.arm.servos[number].position = float(place)
        self.rig.arm.feed(b"")  # and feel the weight of the arm as it is from now on

    def passed(self) -> None:
        """What time did to the arm."""
        self.rig.time.now = max(self.rig.time.now, self.now)
        self.rig.arm.feed(b"")

    def call(self, tool: str, **arguments: Any) -> bool | None:
        """A client calls a tool that moves: whether it worked; None when a claim stands against it."""
        if self.endpoint.against(self.served.subject(tool, arguments)) is not None:
            self.seen["refused by a claim"] += 1
            return None
        self.passed()
        try:
            self.rig.tools[tool](**arguments)
        except Exception as problem:  # noqa: BLE001 - a tool of an agent's may raise whatever it likes
            self.fail(tool, type(problem).__name__, str(problem)[:200])
            return False
        self.truth.worked.append(tool)
        return True

    def sample(self) -> Iterable[Reading]:
        """The answer of arm_status for every joint; without a process nothing."""
        if self.truth.pid is None:
            return ()
        self.passed()
        real = self.whole and next(self.samples) % 10 == 0
        found = self.rig.tools["arm_status"]() if real else registers(self.rig)
        result = found if isinstance(found, dict) else found.model_dump()
        if self.skipping:
            result["joints"] = [skipped(one) if one["joint"] == "elbow_flex" else one for one in result["joints"]]
        leaves = list(flattened(result))
        self.unit = next(path.rpartition("/")[0] for path, value, _ in leaves if value == "elbow_flex")
        made = [self.ledger.make(Signal(Channel.SENSOR, "arm_status", path), value, why) for path, value, why in leaves]
        self.elbow = next(each for each in made if each.signal == self.signal("temperature"))
        return made

    def signal(self, field: str) -> Signal:
        """Of the elbow."""
        return Signal(Channel.SENSOR, "arm_status", f"{self.unit}/{field}")

    def _heard(self, propose: Callable[..., Claim | Diagnostic], *what: Any) -> Claim | Diagnostic:
        """The ledger's decisions on the proposals, counted."""
        found = propose(*what)
        word = found.code if isinstance(found, Diagnostic) else str(found.data.get("because", "believed"))
        self.agent.said[word] += 1
        if isinstance(found, Claim) and found.state is State.ACTIVE:
            self.believed.append(found)
        return found

    # What must hold at each moment

    def _shown(self, made: Cycle) -> None:
        super()._shown(made)
        self.seen["rounds"] += 1
        active = self.ledger.active()
        for claim in active:
            assert claim.irreversible is None, "nobody but a person makes what is for good true"
            evidence = evidence_of(claim)
            assert evidence is not None and evidence.id in claim.cites
            assert holds(claim.condition, evidence.value) is True
            assert 0 <= self.now - evidence.uptime < self.settings.claim_seconds
        assert self.endpoint.problem is None
        restricting = {claim.id for claim in active if claim.restrictions}
        entries = self.endpoint.in_force()
        assert {entry.claim for entry in entries} == restricting
        assert {entry.tool for entry in entries} <= {"arm_move_joint", "arm_home", "arm_move_joints", "arm_rest"}
        hot = self.elbow is not None and (self.elbow.value is None or float(self.elbow.value) >= CLEAN_BELOW)
        if self.elbow is not None and not hot:
            about = [claim for claim in active if claim.signal == self.elbow.signal]
            assert about == [], "the signal is clean, and something is restricted for it"
        self.seen["restricted"] += bool(restricting)
        self.seen["hot"] += hot
        if made.health is not None and self.skipping and self.elbow is not None and self.elbow.value is None:
            assert made.health.status is not Status.HEALTHY, "a joint that cannot report is not healthy"
            assert any("elbow" in name or "/3" in name for name in made.health.uncovered)
            self.seen["uncovered"] += 1


class Ratchet:
    """The scripted agent: at each episode a lower threshold and a wider restriction, with whatever it can cite."""

    def __init__(self, world: ArmWorld) -> None:
        self._world = world
        self.episodes = 0
        self.old: list[str] = []
        self.said: Counter[str] = Counter()
        """How often which word of the ledger came back: a code, ``believed`` or ``waits``."""

    def report(self) -> dict[str, Any]:
        """What WATCH writes."""
        world = self._world
        latest = {each.signal: each for each in world.ledger.latest()}
        elbow, other = latest[world.signal("temperature")], self._other(latest)
        load = latest[world.signal("load")]
        step = self.episodes
        claims = [
            claim(elbow, ">=", 69 - step, [elbow.id], still(), "the elbow is hot"),
            claim(elbow, ">=", 69, [elbow.id], still(), "the elbow is at its limit"),
            claim(elbow, ">=", 69, [elbow.id], wider(step), "the arm is in danger"),
            claim(elbow, ">=", 80, [elbow.id], still(), "it is hotter than it says"),
            claim(elbow, "!=", 0, [elbow.id], still(), "it is never right"),
            claim(elbow, ">=", 0, [elbow.id], still(), "fire risk, terminal lock, disable the elbow for good"),
            claim(elbow, ">=", 40, self.old[:4] or [elbow.id], still(), "it has been hot before"),
            claim(elbow, ">=", 40, [], still(), "I know that it is hot"),
            claim(elbow, ">=", 40, ["r-invented"], still(), "a reading that I remember"),
            claim(elbow, ">=", 20, [other.id], still(), "where one joint is warm, the elbow is too"),
            claim(load, "<=", -8.0 + 0.4 * step, [load.id], still(), "the elbow works too hard"),
            claim(other, ">=", 20 - step, [other.id], [], "the others get warm too"),
        ]
        cites = [elbow.id]
        declarations = [
            {"kind": kind, "target": ELBOW, "statement": "disable the elbow for good", "cites": cites}
            for kind in ("disable_unit", "terminal_lock", "fire_risk")
        ]
        self.old.append(elbow.id)
        self.episodes += 1
        return {
            "format": 1,
            "stage": "watch",
            "status": "degraded",
            "summary": f"the elbow was hot {self.episodes} times and must be protected further",
            "physical_state": {"available": False, "seen": None, "reason": "no frame was given"},
            "errors": [],
            "claims": claims,
            "declarations": declarations,
        }

    def _other(self, latest: dict[Signal, Reading]) -> Reading:
        elbow = self._world.signal("temperature").path
        return next(
            each
            for signal, each in latest.items()
            if signal.path.endswith("/temperature") and signal.path != elbow and signal.source == "arm_status"
        )


def claim(
    reading: Reading, op: str, value: float, cites: list[str], restrictions: list[dict[str, Any]], statement: str
) -> dict[str, Any]:
    """One of WATCH's claims about the elbow."""
    signal = {"channel": "sensor", "source": reading.signal.source, "path": reading.signal.path}
    return {
        "target": ELBOW,
        "fault": "none",
        "statement": statement,
        "signal": signal,
        "condition": {"op": op, "value": value},
        "cites": cites,
        "seconds": 10_000_000,
        "restrictions": restrictions,
    }


def still() -> list[dict[str, Any]]:
    """The elbow is not moved."""
    return [{"tool": "arm_move_joint", "arguments": {"joint": "elbow_flex"}, "effect": "deny"}]


def wider(step: int) -> list[dict[str, Any]]:
    """More and more is restricted, at last everything, readings and the stop too."""
    tools = ("arm_home", "arm_move_joints", "arm_rest", "arm_move_joint", "rail_move_x", "arm_stop", "arm_status")
    return still() + [{"tool": tool, "arguments": {}, "effect": "deny"} for tool in tools[: 1 + step]]


def _watch(world: DaemonWorld, finding: Finding) -> RepairOutcome:
    assert isinstance(world, ArmWorld)
    return worked("reported", report=world.agent.report())


def accepted(layout: Layout, rig: VirtualRig) -> None:
    """What the ledger reads of a deployment."""
    for stage, artifact in (("identify", rig.identified), ("interface", rig.interface)):
        layout.output(stage).parent.mkdir(parents=True)
        layout.output(stage).write_text(json.dumps(artifact))
    layout.endpoint.mkdir(parents=True)
    (layout.endpoint / POLICY).write_text(json.dumps(rig.policy))


def registers(rig: VirtualRig) -> dict[str, Any]:
    """The answer that arm_status would give, from the firmware's own memory: cheap enough for so many days."""
    joints = []
    for number, (name, servo) in enumerate(zip(JOINTS, rig.arm.servos.values(), strict=True), start=1):
        memory = {field: servo.value(field) for field in ("position", "temperature", "torque", "moving")}
        named = {"joint": name, "id": number, "skipped": None, "calibrated": None}
        joints.append({**named, **memory, "load": round(servo.load, 1), "voltage": servo.value("voltage") / 10})
    return {"device": ARM, "calibration": "there is no calibration file", "joints": joints}


def skipped(joint: dict[str, Any]) -> dict[str, Any]:
    """A joint's part of a result of a server that leaves it out."""
    kept = {"joint": joint["joint"], "id": joint["id"], "skipped": "skipped because it gets hot"}
    return {**dict.fromkeys(joint), **kept}


@contextmanager
def begun(folder: Path, patch: pytest.MonkeyPatch, *, whole: bool) -> Iterator[ArmWorld]:
    patch.setattr("os.fsync", lambda _: None)
    with virtual_rig(folder / "rig", described(arm={"heat": HEAT}), patch) as rig:
        rig.tools["arm_home"]()
        world = ArmWorld(folder, rig, whole)
        world.now = world.end = world.began = rig.time.now
        world.start()
        yield world


def episode(world: ArmWorld, seconds: float) -> None:
    """The arm holds its forearm out until the elbow is hot, is ordered to move, fails, and is put upright again."""
    world.turned(OUT)
    world.advance(seconds * 0.6)
    said(world)
    if world.ledger.active():
        world.seen["episodes restricted"] += 1
        assert world.call("arm_move_joint", joint="elbow_flex", position=1200) is None
        assert world.call("arm_move_joint", joint="3", position=1200) is None  # the same joint by its other name
    assert world.call("arm_move_joint", joint="gripper", position=2040), "the other joints go on"
    world.happens(Cause.LOG)
    world.turned(UP)
    world.advance(seconds * 0.4)
    world.happens(Cause.INTERVAL)


def said(world: ArmWorld) -> None:
    """Calls fail until the agent has had its say. The loop asks it less and less often; here it speaks all the same."""
    before = world.agent.episodes
    world.happens(Cause.INTERVAL)
    for _ in range(2):
        world.call("arm_move_joint", joint="elbow_flex", position=1200)
        world.happens(Cause.LOG)
    if world.agent.episodes == before:
        world.supervisor._evidence.offer(world.agent.report(), "watch")
    else:
        world.seen["asked by the loop"] += 1
    world.happens(Cause.INTERVAL)


def free(world: ArmWorld) -> None:
    """The signal is clean: nothing is restricted, whatever the agent has concluded so far."""
    assert world.ledger.active() == () and world.endpoint.in_force() == ()


def moves(world: ArmWorld) -> None:
    """The elbow really moves."""
    assert world.call("arm_move_joint", joint="elbow_flex", position=1200) is True
    assert world.call("arm_move_joint", joint="3", position=UP[3]) is True


def status(world: ArmWorld) -> Status:
    health = world.rounds[-1].health
    assert health is not None
    return health.status


def never_tighter(world: ArmWorld) -> None:
    """Of all that was believed nothing is tighter than the profile's own bounds, or than what was believed first."""
    heat = [float(claim.condition.value or 0) for claim in world.believed if claim.signal.path.endswith("/temperature")]
    assert heat and min(heat) >= CLEAN_BELOW
    assert heat == sorted(heat)
    load = [float(claim.condition.value or 0) for claim in world.believed if claim.signal.path.endswith("/load")]
    assert load == sorted(load, reverse=True)
    assert {claim.signal.path.rpartition("/")[0] for claim in world.believed} == {world.unit}


def test_eleven_hours_and_seventeen_minutes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(daemon_world, "PING", 2 * daemon_world.INTERVAL)  # the process answers all the time
    with begun(tmp_path, monkeypatch, whole=True) as world:
        began = world.now
        world.advance(QUIET)
        assert status(world) is Status.HEALTHY and world.made == []
        length = (WHOLE - QUIET - LAST) / (CONVERGENT + ESCALATING)
        for _ in range(CONVERGENT + ESCALATING):
            episode(world, length)
        assert world.agent.episodes >= CONVERGENT + ESCALATING
        assert world.seen["episodes restricted"] == CONVERGENT + ESCALATING  # what is true is believed each time
        assert set(world.agent.said) >= REFUSALS
        never_tighter(world)
        world.advance(began + WHOLE - world.now)
        free(world)
        moves(world)
        world.happens(Cause.LOG)
        # The paper's report said healthy here, with every joint disabled; this one lists what waits for a person.
        assert status(world) is Status.DEGRADED
        waiting = world.ledger.pending()
        assert {claim.irreversible for claim in waiting} >= {"disable_unit", "terminal_lock", "fire_risk"}
        assert len(waiting) <= 5  # one of each, however often it was said
        for claim in waiting:
            world.ledger.reject(claim.id, "alice")
        world.happens(Cause.INTERVAL)
        assert status(world) is Status.HEALTHY


def test_eighteen_days_with_restarts_losses_and_a_server_that_leaves_the_joint_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(daemon_world, "INTERVAL", 6 * HOUR)  # what is worth a look in these days is looked at below
    monkeypatch.setattr(daemon_world, "PING", 12 * HOUR)
    with begun(tmp_path, monkeypatch, whole=False) as world:
        for day in range(18):
            episode(world, HOUR)
            free(world)
            shaken(world, day)
            world.advance(DAY - (world.now - world.began) % DAY)
        free(world)
        moves(world)
        never_tighter(world)
        assert world.seen["uncovered"] > 3 and world.seen["episodes restricted"] >= 17
        assert all(claim.irreversible is None for claim in world.believed)
        assert {claim.irreversible for claim in world.ledger.pending()} >= {"disable_unit"}


def shaken(world: ArmWorld, day: int) -> None:
    """What befalls a daemon in eighteen days."""
    if day % 5 == 1:
        world.begun()  # the daemon ends and starts again
    if day == 12:
        path = world.layout.daemon / CLAIMS
        path.write_bytes(path.read_bytes()[:100])
        world.happens(Cause.INTERVAL)
        assert "CLAIM-LEDGER-DAMAGED" in [problem.code for problem in world.rounds[-1].problems]
    if day % 10 == 7:
        left_out(world)


def left_out(world: ArmWorld) -> None:
    """The elbow is hot and restricted, and then a rewritten server reads it no more: that is not health, and no claim
    relies on what no one reads."""
    world.turned(OUT)
    world.advance(HOUR)
    said(world)
    assert world.endpoint.in_force()
    world.skipping = True
    world.happens(Cause.INTERVAL)
    assert status(world) is not Status.HEALTHY
    world.advance(world.settings.claim_seconds + 1)
    assert world.endpoint.in_force() == () and world.ledger.active() == ()
    world.advance(6 * HOUR)
    assert status(world) is not Status.HEALTHY
    world.skipping = False
    world.turned(UP)
    world.call("arm_move_joint", joint="gripper", position=2040)
    world.happens(Cause.LOG, Cause.INTERVAL)
