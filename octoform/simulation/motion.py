"""How a motor goes from here to there: a speed that rises, stays and falls, so that a position follows from the time.

All in counts and seconds. A movement begun while another is under way starts with the speed that it has then: a motor
that has to turn round slows down first.
"""

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class _Piece:
    lasts: float
    speed: float
    gain: float

    def way(self, after: float) -> float:
        return self.speed * after + self.gain * after * after / 2


@dataclass(frozen=True)
class Motion:
    """One movement. Pieces of constant acceleration, the goal at the end of the last."""

    began: float
    start: float
    goal: float
    pieces: tuple[_Piece, ...] = field(default=())

    @property
    def ends(self) -> float:
        """The time at which the goal is reached."""
        return self.began + sum(piece.lasts for piece in self.pieces)

    def at(self, now: float) -> tuple[float, float]:
        """Position and speed."""
        place, after = self.start, max(0.0, now - self.began)
        for piece in self.pieces:
            if after < piece.lasts:
                return place + piece.way(after), piece.speed + piece.gain * after
            place, after = place + piece.way(piece.lasts), after - piece.lasts
        return self.goal, 0.0

    def turns(self) -> list[float]:
        """The positions between the pieces: no position of the movement lies outside of them, start and goal."""
        place, found = self.start, []
        for piece in self.pieces[:-1]:
            place += piece.way(piece.lasts)
            found.append(place)
        return found


def resting(place: float, now: float) -> Motion:
    """No movement at all."""
    return Motion(now, place, place)


def planned(before: Motion, now: float, goal: float, top: float, gain: float) -> Motion:
    """The movement to ``goal`` from where ``before`` is now, with a highest speed and an acceleration (above 0)."""
    start, speed = before.at(now)
    pieces: list[_Piece] = []
    place = start
    stops = place + speed * abs(speed) / (2 * gain)
    if speed and (goal - stops) * speed < 0:
        pieces.append(_Piece(abs(speed) / gain, speed, -math.copysign(gain, speed)))
        place, speed = stops, 0.0
    pieces += _straight(goal - place, abs(speed), top, gain)
    return Motion(now, start, goal, tuple(piece for piece in pieces if piece.lasts > 0))


def _straight(way: float, speed: float, top: float, gain: float) -> list[_Piece]:
    """A way without turning round, begun with a speed towards its end."""
    side, far = (math.copysign(1, way), abs(way))
    pieces = []
    if speed > top:
        slow = (speed - top) / gain
        pieces.append(_Piece(slow, side * speed, -side * gain))
        far, speed = far - (speed + top) / 2 * slow, top
    peak = min(top, math.sqrt(gain * max(0.0, far) + speed * speed / 2))
    rise, fall = max(0.0, peak - speed) / gain, peak / gain
    cruise = far - (peak + speed) / 2 * rise - peak / 2 * fall
    pieces.append(_Piece(rise, side * speed, side * gain))
    if peak > 0:
        pieces.append(_Piece(max(0.0, cruise) / peak, side * peak, 0.0))
        pieces.append(_Piece(fall, side * peak, -side * gain))
    return pieces
