"""Hardware is looked at when udev is done with it, and in the end in any case."""

from pathlib import Path

from octoform.host.settling import QUEUE, SETTLE_SECONDS, settle


def test_it_waits_for_as_long_as_udev_is_at_work(tmp_path: Path) -> None:
    (tmp_path / QUEUE).parent.mkdir(parents=True)
    (tmp_path / QUEUE).touch()
    waited: list[float] = []

    def pause(seconds: float) -> None:
        waited.append(seconds)
        if len(waited) == 7:
            (tmp_path / QUEUE).unlink()

    assert settle(tmp_path, pause)
    assert len(waited) == 7
    assert settle(tmp_path, pause)
    assert len(waited) == 7, "nobody is at work"


def test_a_udev_that_never_ends_is_not_waited_for_without_end(tmp_path: Path) -> None:
    (tmp_path / QUEUE).parent.mkdir(parents=True)
    (tmp_path / QUEUE).touch()
    waited: list[float] = []
    assert not settle(tmp_path, waited.append)
    assert 0.9 * SETTLE_SECONDS < sum(waited) < 1.1 * SETTLE_SECONDS
