"""A heartbeat is looks at an interval: virtual time, a camera of our own, nothing made up for."""

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from octoform.apply.context import Clock
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.scripts.picture import digest, grain_of, shrunk
from octoform.engine.look import Eye, Look, heartbeat, look, save
from octoform.manifest.model import Perception
from octoform.perception.capture import Picture, Taken
from octoform.perception.frames import Camera
from octoform.simulation.scene import Scene, Sensor
from octoform.state.layout import Layout

CAMERA = Camera(device="usb-1f00-00c1", tool="capture_image", arguments={"device": "usb-1f00-00c1"})
EPOCH = datetime(2026, 1, 1, tzinfo=UTC)


@dataclass
class Bench:
    """A camera whose pictures take ``lasting`` seconds each, in a time of its own; ``views`` are what it was asked."""

    lasting: tuple[float, ...]
    outcome: Taken | Diagnostic | None = None
    now: float = 100.0
    views: list[ToolCall] = field(default_factory=list)

    @property
    def clock(self) -> Clock:
        return Clock(lambda: self.now, lambda: EPOCH + timedelta(seconds=self.now - 100), self.pass_time)

    def pass_time(self, seconds: float) -> None:
        assert seconds >= 0
        self.now += seconds

    def take(self, _layout: Layout, view: ToolCall, _person: object) -> Taken | Diagnostic:
        self.pass_time(self.lasting[min(len(self.views), len(self.lasting) - 1)])
        self.views.append(view)
        thumb = bytes([len(self.views)] * 64 + [200] * 3008)
        return self.outcome or Taken(b"data", "image/png", Picture(100.0, 50.0, thumb), 64, 48)


def seconds_of(looks: list[Look]) -> list[int]:
    return [int((datetime.fromisoformat(item.at) - EPOCH).total_seconds()) for item in looks]


@pytest.mark.parametrize(
    ("lasting", "at"),
    [
        ((0,), [0, 30, 60, 90]),
        ((2,), [2, 32, 62, 92]),
        ((2, 40, 2), [2, 70, 92, 122]),  # the one at 60 is left out, and the rhythm stays
        ((70, 0), [70, 90, 120, 150]),
    ],
)
def test_a_look_that_takes_long_is_not_made_up_for(tmp_path: Path, lasting: tuple[float, ...], at: list[int]) -> None:
    bench = Bench(lasting)
    beats = heartbeat(Eye(Layout(tmp_path, "bench"), Perception(), CAMERA), 30, None, bench.clock, bench.take)
    looks = [next(beats) for _ in range(4)]
    assert seconds_of(looks) == at
    assert bench.views[0] == ToolCall(CAMERA.tool, CAMERA.arguments)
    assert [item.problem for item in looks] == [None] * 4
    assert looks[-1].record is not None and looks[-1].record.summary.looks == 4


def test_a_heartbeat_goes_on_while_there_is_no_picture(tmp_path: Path) -> None:
    bench = Bench((1,), error("PERCEPTION-TOOL-FAILED", "no picture"))
    beats = heartbeat(Eye(Layout(tmp_path, "bench"), Perception(), CAMERA), 10, None, bench.clock, bench.take)
    next(beats)
    bench.outcome = None
    last = next(beats)
    assert last.record is not None and last.record.absent is None
    assert (
        last.record.summary.changes[0] == "2026-01-01T00:00:01Z to 2026-01-01T00:00:11Z: no picture because no picture"
    )


def test_a_host_without_a_camera_is_noted_as_one(tmp_path: Path) -> None:
    bench = Bench((1,))
    blind = error("PERCEPTION-NO-CAMERA", "no tool of this host takes a picture")
    seen = look(Eye(Layout(tmp_path, "bench"), Perception(), blind=blind), None, bench.clock, bench.take)
    assert seen.outcome is blind and bench.views == [] and seen.problem is None
    assert seen.record is not None and seen.record.absent is not None
    assert seen.record.absent.reason == "no tool of this host takes a picture"


def test_a_picture_is_saved_as_it_was_given(tmp_path: Path) -> None:
    taken = Taken(b"\x89PNG", "image/png", Picture(0, 0, b""), 1, 1)
    assert save(taken, tmp_path / "new" / "shot.png") is None
    assert (tmp_path / "new" / "shot.png").read_bytes() == b"\x89PNG"
    (tmp_path / "file").write_text("")
    problem = save(taken, tmp_path / "file" / "shot.png")
    assert problem is not None and problem.code == "STATE-WRITE-FAILED"


WIDE, HIGH = 128, 96
LOOKS = 40
"""More than a source without noise needs to be called frozen, several times over."""


@dataclass
class Still:
    """A camera before a scene in which nothing moves, not even a clock; ``sensor`` is None for a drawn source."""

    sensor: Sensor | None
    now: float = 100.0
    stuck: bytes | None = None
    taken: int = 0
    scene: bytes = field(default_factory=lambda: Scene(None, None, lambda: 7.0).frame(WIDE, HIGH)[0])

    @property
    def clock(self) -> Clock:
        return Clock(lambda: self.now, lambda: EPOCH + timedelta(seconds=self.now - 100), self.pass_time)

    def pass_time(self, seconds: float) -> None:
        self.now += seconds

    def take(self, _layout: Layout, _view: ToolCall, _person: object) -> Taken | Diagnostic:
        self.pass_time(0.4)
        self.taken += 1
        luma = self.stuck or (self.sensor.exposed(self.scene) if self.sensor else self.scene)
        thumb = shrunk(luma, WIDE, HIGH)
        seen = Picture(round(sum(luma) / len(luma), 1), 40.0, thumb, digest(luma), grain_of(luma, WIDE))
        return Taken(luma, "image/png", seen, WIDE, HIGH)

    def looks(self, folder: Path, count: int, every: float) -> list[Look]:
        """So many looks at this interval, as the daemon makes them."""
        beats = heartbeat(Eye(Layout(folder, "bench"), Perception(), CAMERA), every, None, self.clock, self.take)
        return [next(beats) for _ in range(count)]


@pytest.mark.parametrize("every", [5, 30])
def test_a_healthy_camera_before_a_scene_that_stands_still_is_never_called_frozen(tmp_path: Path, every: int) -> None:
    camera = Still(Sensor())
    looks = camera.looks(tmp_path, LOOKS, every)
    assert {item.problem for item in looks} == {None}
    assert looks[-1].record is not None and looks[-1].record.summary.frozen == 0
    assert camera.taken == LOOKS, "a healthy camera is asked once a look"


def test_a_camera_that_freezes_is_told_within_one_look_and_until_it_gives_new_pictures(tmp_path: Path) -> None:
    camera = Still(Sensor())
    camera.looks(tmp_path, 5, 30)
    camera.stuck = camera.sensor.exposed(camera.scene) if camera.sensor else None
    frozen = camera.looks(tmp_path, LOOKS, 30)
    assert [item.problem for item in frozen] == [None] + ["frozen"] * (LOOKS - 1)
    assert camera.taken < 5 + LOOKS + 5, "what is proven is not proven again at each look"
    camera.stuck = None
    assert {item.problem for item in camera.looks(tmp_path, LOOKS, 30)} == {None}


def test_of_a_source_without_noise_it_is_not_known_whether_it_is_frozen(tmp_path: Path) -> None:
    camera = Still(None)
    looks = camera.looks(tmp_path, LOOKS, 30)
    assert {item.problem for item in looks} == {None} and camera.taken == LOOKS
    frames = [item.record.current for item in looks if item.record is not None]
    assert {frame.frozen for frame in frames[1:] if frame is not None} == {None}
