"""Hardware is looked at when udev is done with it, and in the end in any case."""

from pathlib import Path

import pytest

from octoform.host import QUEUE, QUIET_SECONDS, SETTLE_SECONDS, settle


@pytest.fixture
def queue(tmp_path: Path) -> Path:
    queue = tmp_path / QUEUE
    queue.parent.mkdir(parents=True)
    return queue


def test_it_waits_until_udev_has_had_nothing_to_do_for_a_while(tmp_path: Path, queue: Path) -> None:
    queue.touch()
    waited: list[float] = []

    def pause(seconds: float) -> None:
        """The first device is done, its driver takes a moment, and then there is another one."""
        waited.append(seconds)
        if len(waited) in (7, 15):
            queue.unlink()
        if len(waited) == 12:
            queue.touch()

    assert settle(tmp_path, pause)
    assert sum(waited) == pytest.approx(1.5 + QUIET_SECONDS)


def test_a_udev_that_never_ends_is_not_waited_for_without_end(tmp_path: Path, queue: Path) -> None:
    queue.touch()
    waited: list[float] = []
    assert not settle(tmp_path, waited.append)
    assert sum(waited) == pytest.approx(SETTLE_SECONDS)


def test_without_udev_nothing_is_waited_for(tmp_path: Path) -> None:
    waited: list[float] = []
    assert settle(tmp_path, waited.append)
    assert waited == []
