"""Trials that a camera decides: a movement that the picture shows, and a picture that shows anything at all.

A device without feedback can only be seen to move. Two pictures before the movement say how much differs while nothing
happens; the movement must change more than that, and the way back must bring the first picture back.
"""

from collections.abc import Mapping
from typing import Any

from octoform.apply.hand import Seen
from octoform.apply.trials import POLL_SECONDS, Bench, Mover, Trial, Tried
from octoform.perception.judging import Picture, complaint, difference, frozen

NOISE_FACTOR = 3.0
"""A movement must change the picture by at least so many times what differs while nothing moves."""
_UNSEEN = frozenset({"STEP-NOT-SEEN", "STEP-NOT-BACK"})
_SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png"}


def by_view(bench: Bench, trial: Trial, where: str) -> Tried:
    """Carry out one trial of the kind view; ``where`` is its JSON pointer in the artifact.

    A device may move by itself until somebody talks to it, and what was seen then says nothing: so a movement that
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
    """Look twice through the chosen camera: both pictures must show something; that they are the same is told."""
    tried = Tried(camera["device"], camera["tool"])
    seen = [_look(bench, tried, camera, where, name) for name in ("first", "second")]
    if seen[0] is not None and seen[1] is not None:
        tried.noise = difference(seen[0], seen[1])
        if frozen(seen[0], seen[1]):
            text = f"two pictures of {camera['device']} are the same in every figure"
            hint = "a working sensor has noise; see whether the camera gives new pictures"
            tried.warn("STEP-PICTURE-FROZEN", text, where, hint)
    return tried


class _ByView(Mover):
    """A movement that the camera shows."""

    def carry_out(self) -> None:
        tried, view = self.tried, self.trial["view"]
        if not self.move["relative"]:
            text = f"{tried.unit} is to be moved to a place, and nothing reads where to go back to"
            tried.blame("STEP-NO-READING", text, f"{self.where}/move/relative", hint="move by a distance instead")
            return
        still = self._stillness(view)
        if still is None or tried.noise is None:
            return
        wanted = max(self.bench.proof.minimum, NOISE_FACTOR * tried.noise)
        if not self.go():
            return
        tried.moved = self._watched(still, "after", lambda change: change >= wanted)
        seen = tried.moved is not None and tried.moved >= wanted
        if tried.moved is not None and not seen:
            self._unseen(tried.moved, wanted)
        answer = self.go_back()
        if answer is None or tried.moved is None or not seen:
            return
        most = tried.moved / 2
        tried.returned = self._watched(still, "back", lambda change: change <= most) if answer.value else None
        if (tried.returned is None or tried.returned > most) and not tried.over:
            self._not_back(answer.words)

    def _stillness(self, view: Mapping[str, Any]) -> Picture | None:
        """The picture before the movement, once two of them agree or the time for it is over; sets the noise.

        A camera may still show what was a moment ago, and a device may still come to rest.
        """
        tried, end = self.tried, self.now + self.bench.proof.settle
        before = _look(self.bench, tried, view, self.where, "before")
        while before is not None:
            still = _look(self.bench, tried, view, self.where, "still")
            if still is None:
                return None
            tried.noise = difference(before, still)
            if tried.noise < self.bench.proof.minimum or self.now >= end:
                return still
            before = still
        return None

    def _watched(self, first: Picture, name: str, enough: Any) -> float | None:
        """How far the picture differs from ``first``: once that is enough, or when the time for it is over."""
        end = self.now + self.bench.proof.settle
        while True:
            seen = _look(self.bench, self.tried, self.trial["view"], self.where, name)
            if seen is None:
                return None
            change = difference(first, seen)
            if enough(change) or self.now >= end:
                return change
            self.bench.clock.sleep(POLL_SECONDS)

    def _unseen(self, moved: float, wanted: float) -> None:
        tried = self.tried
        self.tried.blame(
            "STEP-NOT-SEEN",
            f"{tried.unit} did not move in the camera's view: the picture differs by {moved:g} of 255, "
            f"by {tried.noise:g} while nothing moves; at least {wanted:g} were wanted",
            self.where,
            f"{tried.tool} answered that all is well",
            "see whether it has power and is free to move, whether the camera sees it, and whether `by` is enough",
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
        hint = "see whether the camera is connected and free; octoform logs has the call"
        tried.blame("STEP-NO-PICTURE", f"{view['tool']} gave no picture", where, seen.words, hint)
        return None
    _keep(bench, tried, seen, name)
    wrong = complaint(seen.picture)
    if wrong is not None:
        figures = f"brightness {seen.picture.mean:g} of 255 on average, spread {seen.picture.spread:g}"
        hint = "see whether the lens is covered, the room dark, or the first pictures not flushed"
        tried.blame("STEP-PICTURE-EMPTY", f"the picture of {view['tool']} is {wrong}", where, figures, hint)
        return None
    return seen.picture


def _keep(bench: Bench, tried: Tried, seen: Seen, name: str) -> None:
    unit = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in tried.unit)
    path = bench.folder / f"{unit}-{name}{_SUFFIXES.get(seen.mime, '.picture')}"
    path.write_bytes(seen.data)
