"""Pictures that show nothing are reported, new ones differ from old ones, and light alone is no change."""

import random
from collections.abc import Callable

import pytest

from octoform.perception.capture import (
    CHANGED,
    FROZEN_PICTURES,
    FROZEN_SECONDS,
    GRAIN,
    HEIGHT,
    THUMB_BYTES,
    WIDTH,
    Picture,
    complaint,
    difference,
    frozen,
    repeated,
)

Place = Callable[[int, int], float]


def picture(at: Place, noise: float = 0.0, seed: int = 1) -> Picture:
    chance = random.Random(seed)
    values = [at(x, y) + chance.gauss(0, noise) for y in range(HEIGHT) for x in range(WIDTH)]
    thumb = bytes(round(min(255, max(0, value))) for value in values)
    mean = sum(thumb) / THUMB_BYTES
    return Picture(mean, (sum((value - mean) ** 2 for value in thumb) / THUMB_BYTES) ** 0.5, thumb)


def bench(x: int, y: int) -> float:
    """A bright wall over a dark table with something in the middle."""
    return 60 + (x % 17) if y > 30 else 150 - x + (40 if 20 < x < 30 else 0)


def moved(x: int, y: int) -> float:
    """The same with a small thing (2 % of the picture) at another place."""
    return 230 if 40 <= x < 48 and 10 <= y < 18 else bench(x, y)


@pytest.mark.parametrize(
    ("mean", "spread", "said"),
    [
        (0.0, 0.0, "black"),
        (12.0, 4.0, "black"),
        (5.0, 20.0, None),
        (16.0, 1.0, "uniform"),
        (254.0, 0.3, "uniform"),
        (128.0, 1.99, "uniform"),
        (128.0, 2.0, None),
        (90.0, 45.0, None),
    ],
)
def test_what_shows_nothing_is_told(mean: float, spread: float, said: str | None) -> None:
    assert complaint(Picture(mean, spread, bytes(THUMB_BYTES))) == said


def test_a_picture_is_repeated_when_no_pixel_differs_whatever_its_figures_say() -> None:
    first = Picture(100.0, 50.0, bytes(THUMB_BYTES), "one", 0.8)
    assert repeated(first, Picture(100.0, 50.0, bytes(THUMB_BYTES), "one", 0.8))
    assert not repeated(first, Picture(100.0, 50.0, bytes(THUMB_BYTES), "two", 0.8))
    unknown = Picture(100.0, 50.0, bytes(THUMB_BYTES))
    assert not repeated(unknown, unknown)


@pytest.mark.parametrize(
    ("grain", "repeats", "seconds", "verdict"),
    [
        (0.9, 0, 0.0, False),
        (0.0, 0, 900.0, False),
        (0.9, 1, 900.0, None),
        (0.9, FROZEN_PICTURES - 1, FROZEN_SECONDS - 1, None),
        (0.9, FROZEN_PICTURES - 1, FROZEN_SECONDS, True),
        (GRAIN, 400, 9000.0, True),
        (GRAIN - 0.01, 400, 9000.0, None),
    ],
)
def test_frozen_needs_a_sensors_noise_several_pictures_and_some_seconds(
    grain: float, repeats: int, seconds: float, verdict: bool | None
) -> None:
    assert frozen(Picture(100.0, 50.0, bytes(THUMB_BYTES), "one", grain), repeats, seconds) is verdict


def test_the_same_scene_differs_by_its_noise_alone() -> None:
    assert difference(picture(bench), picture(bench)) == 0.0
    assert difference(picture(bench, 0.5, 1), picture(bench, 0.5, 2)) < 1.0


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 25.0), (1.0, -25.0), (1.3, 0.0), (0.7, 0.0), (1.2, -15.0)])
def test_light_over_the_whole_picture_is_no_change(gain: float, offset: float) -> None:
    brighter = picture(lambda x, y: gain * bench(x, y) + offset, 0.5, 2)
    assert difference(picture(bench, 0.5, 1), brighter) < CHANGED / 2


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (1.15, 10.0), (0.8, -5.0)])
def test_a_small_thing_that_moved_is_a_change_whatever_the_light_does(gain: float, offset: float) -> None:
    first, second = picture(bench, 0.5, 1), picture(lambda x, y: gain * moved(x, y) + offset, 0.5, 2)
    assert difference(first, second) > 2 * CHANGED
    assert difference(first, second) == difference(second, first)


def test_a_scene_that_slid_aside_is_a_change() -> None:
    assert difference(picture(bench), picture(lambda x, y: bench(x + 4, y))) > CHANGED


def test_pictures_without_any_structure_can_be_compared() -> None:
    assert difference(picture(lambda x, y: 10), picture(lambda x, y: 90)) == 0.0
    assert difference(picture(lambda x, y: 10), picture(bench)) > CHANGED
