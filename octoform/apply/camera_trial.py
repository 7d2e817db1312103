"""Tests that a camera decides: a movement that the picture shows, and a picture that shows anything at all.

A device without feedback can only be seen to move. Pictures before the movement say how much differs while nothing
happens; the movement must change more than that, and the way back must bring the first picture back.
"""

from collections.abc import Mapping
from itertools import combinations, product
from typing import Any

from octoform.apply.reading_trial import Bench, Mover, Trial, Tried
from octoform.apply.trial_tools import Seen
from octoform.base.files import replace
from octoform.perception.capture import (
    FROZEN_PICTURES,
    FROZEN_SECONDS,
    Picture,
    complaint,
    difference,
    frozen,
    noisy,
    repeated,
)

NOISE_FACTOR = 3.0
"""A movement must change the picture by at least so many times what differs while nothing moves."""
APART_SECONDS = 0.25
"""Between two pictures that are compared: a camera may give one twice, and slow movement takes time to show."""
_UNSEEN = frozenset({"STEP-NOT-SEEN", "STEP-NOT-BACK"})
_STILL = "check that it has power and is free to move, that the camera sees it, and that `by` is enough"
_RESTLESS = (
    "the picture changes by itself: check if the device moves while no call is under way, as some do while their line "
    "is closed, and if something else moves in the camera's view"
)
_SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png"}


def by_view(bench: Bench, trial: Trial, where: str) -> Tried:
    """Carry out one test of the kind view; ``where`` is its JSON pointer in the artifact.

    A device may move by itself until somebody talks to it, and what was seen then states nothing: so a movement that
    was not seen, or not seen to go back, is tried once more.
    """
    for again in (False, True):
        attempt = _ByView(bench, trial, where)
        attempt.tried.again = again
        attempt.carry_out()
        if attempt.tried.over or {item.code for item in attempt.tried.found} - _UNSEEN or not attempt.tried.found:
            break
    return attempt.tried


def by_frame(bench: Bench, camera: Mapping[str, Any], where: str = "/camera") -> Tried:
    """Look twice through the chosen camera: both pictures must show something.

    Where both are the same, more are taken some seconds apart: a sensor's picture that comes again and again fails,
    and of a source without noise it cannot be determined.
    """
    tried = Tried(camera["device"], camera["tool"])
    seen = [_look(bench, tried, camera, where, "first")]
    bench.clock.sleep(APART_SECONDS)
    seen.append(_look(bench, tried, camera, where, "second"))
    if seen[0] is not None and seen[1] is not None:
        tried.noise = difference(seen[0], seen[1])
        if repeated(seen[0], seen[1]):
            _require_still(bench, tried, camera, where)
    return tried


def _require_still(bench: Bench, tried: Tried, camera: Mapping[str, Any], where: str) -> None:
    """Distinguish a frozen camera from an undetermined one, by further pictures."""
    began, first, count = bench.clock.monotonic(), None, 0
    while count < FROZEN_PICTURES or bench.clock.monotonic() - began < FROZEN_SECONDS:
        seen = _look(bench, tried, camera, where, "again")
        if seen is None or (first is not None and not repeated(first, seen)):
            return
        first, count = first or seen, count + 1
        bench.clock.sleep(FROZEN_SECONDS / FROZEN_PICTURES)
    if first is not None and frozen(first, count - 1, bench.clock.monotonic() - began):
        text = f"{count} pictures of {camera['device']} in a row are the same, pixel by pixel, with the same noise"
        hint = "a working sensor's noise is never twice the same: plug the camera in again, or choose another one"
        tried.blame("STEP-PICTURE-FROZEN", text, where, hint=hint)
    else:
        text = f"{camera['device']} gives the same picture again and again, and the picture has no noise"
        hint = "a drawn or digital source may simply not move: move something in its view and run octoform look"
        tried.warn("STEP-PICTURE-REPEATED", text, where, hint)


class _ByView(Mover):
    """A movement that the camera shows."""

    _blind = False
    _looked = -APART_SECONDS

    def carry_out(self) -> None:
        tried = self.tried
        if not self.move["relative"]:
            text = f"{tried.unit} is to be moved to a place, and nothing reads where to go back to"
            tried.blame("STEP-NO-READING", text, f"{self.where}/move/relative", hint="move by a distance instead")
            return
        still = self._stillness()
        if not still:
            return
        tried.noise = max(difference(a, b) for a, b in combinations(still, 2))
        wanted = max(self.bench.proof.minimum, NOISE_FACTOR * tried.noise)
        if not self.go():
            return
        after = self._at_rest("after")
        if after:
            self._blind = noisy(after[0]) and all(repeated(after[0], seen) for seen in (*still, *after))
            tried.moved = min(difference(a, b) for a, b in product(still, after))
            if tried.moved < wanted:
                self._unseen(tried.moved, wanted)
        answer = self.go_back()
        if answer is None or tried.moved is None or tried.found:
            return
        back = self._at_rest("back") if answer.value is not None else []
        tried.returned = max((difference(a, b) for a, b in product(still, back)), default=None)
        if not tried.found and (tried.returned is None or 2 * tried.returned > tried.moved):
            self._not_back(answer.words)

    def _stillness(self) -> list[Picture]:
        """The pictures before the movement; none when there is a finding.

        The last of them are taken whatever they show: pictures that were chosen for being alike show no noise.
        """
        found = self._at_rest("before")
        for name in ("still", "still") if found else ():
            seen = self._look(name)
            if seen is None:
                return []
            found.append(seen)
        return found

    def _at_rest(self, name: str) -> list[Picture]:
        """Two pictures in a row that agree, or the last two when the time for it is over; none for a finding.

        A camera may still show what was a moment ago, and what moved may still come to rest.
        """
        end = self.now + self.bench.proof.settle
        alike = max(self.bench.proof.minimum, self.tried.noise or 0.0)
        before = self._look(name)
        while before is not None:
            seen = self._look(name)
            if seen is None:
                return []
            if difference(before, seen) <= alike or self.now >= end:
                return [before, seen]
            before = seen
        return []

    def _look(self, name: str) -> Picture | None:
        self.bench.clock.sleep(max(0.0, self._looked + APART_SECONDS - self.now))
        seen = _look(self.bench, self.tried, self.trial["view"], self.where, name)
        self._looked = self.now
        return seen

    def _unseen(self, moved: float, wanted: float) -> None:
        tried = self.tried
        if self._blind:
            text = f"the camera gives the same picture again and again: it cannot show whether {tried.unit} moved"
            hint = "a working sensor's noise is never twice the same: plug the camera in again, or choose another one"
            tried.blame("STEP-PICTURE-FROZEN", text, self.where, hint=hint)
            return
        tried.blame(
            "STEP-NOT-SEEN",
            f"{tried.unit} did not move in the camera's view: the picture differs by {moved:g} of 255, "
            f"by {tried.noise:g} while nothing moves; at least {wanted:g} were wanted",
            self.where,
            f"{tried.tool} answered that all is well",
            _RESTLESS if wanted > NOISE_FACTOR**2 * self.bench.proof.minimum else _STILL,
        )

    def _not_back(self, words: str) -> None:
        tried = self.tried
        where = f"{tried.returned:g}" if tried.returned is not None else "unknown"
        text = f"{tried.unit} is not seen to move back: the picture differs by {tried.moved:g} after the move, "
        tried.blame("STEP-NOT-BACK", f"{text}by {where} after the way back", self.where, words or None)


def _look(bench: Bench, tried: Tried, view: Mapping[str, Any], where: str, name: str) -> Picture | None:
    """A picture that shows something, kept in the attempt's folder; None with a finding for any other."""
    seen = bench.hand.look({"tool": view["tool"], "arguments": view["arguments"]})
    if seen.picture is None:
        hint = "check that the camera is connected and free; octoform logs has the call"
        tried.blame("STEP-NO-PICTURE", f"{view['tool']} gave no picture", where, seen.words, hint)
        return None
    _keep(bench, tried, seen, name)
    wrong = complaint(seen.picture)
    if wrong is not None:
        figures = f"brightness {seen.picture.mean:g} of 255 on average, spread {seen.picture.spread:g}"
        hint = "check if the lens is covered, the scene dark, or the first pictures not flushed"
        tried.blame("STEP-PICTURE-EMPTY", f"the picture of {view['tool']} is {wrong}", where, figures, hint)
        return None
    return seen.picture


def _keep(bench: Bench, tried: Tried, seen: Seen, name: str) -> None:
    unit = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in tried.unit)
    path = bench.folder / f"{unit}-{name}{_SUFFIXES.get(seen.mime, '.picture')}"
    replace(path, seen.data, 0o644, synced=False)
