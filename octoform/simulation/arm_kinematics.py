"""The shape of an arm: where its joints are in space, and what gravity asks of each motor.

The description's ``linkage`` lists the links from the shoulder up. All of them move in one upright plane, which
``turn`` turns about the base; ``roll`` and ``grip`` are the last joint and the jaws.
"""

import math
from collections.abc import Mapping
from typing import Any

GRAVITY = 9.81
Point = tuple[float, float, float]


class Linkage:
    """``positions`` are raw counts by unit number, everywhere."""

    def __init__(self, given: Mapping[str, Any], counts: int) -> None:
        self.given, self._counts = given, counts
        self._links: list[Mapping[str, Any]] = list(given.get("links", ()))

    def angle(self, count: float) -> float:
        """Radians away from the centre of a turn."""
        return (count - self._counts / 2) * math.tau / self._counts

    def moments(self, positions: Mapping[int, float]) -> dict[int, float]:
        """Newton metres that the weight asks of the motor of each link, positive where it pulls the count up."""
        ends = self._plane(positions)
        found = {}
        for first, link in enumerate(self._links):
            moment = 0.0
            for begin, end, one in list(zip(ends, ends[1:], self._links, strict=False))[first:]:
                moment += one["mass"] * GRAVITY * ((begin[0] + end[0]) / 2 - ends[first][0])
            found[link["joint"]] = -moment * link["sign"]
        return found

    def _plane(self, positions: Mapping[int, float]) -> list[tuple[float, float]]:
        """(outwards, up) of the shoulder and the end of each link, in metres."""
        out, up, angle = 0.0, float(self.given.get("base", 0.0)), 0.0
        ends = [(out, up)]
        for link in self._links:
            angle += math.radians(link["offset"]) + link["sign"] * self.angle(positions[link["joint"]])
            out, up = out + link["length"] * math.cos(angle), up + link["length"] * math.sin(angle)
            ends.append((out, up))
        return ends

    def points(self, positions: Mapping[int, float]) -> list[Point]:
        """Base, shoulder and the end of each link: x, y along the bench and z up, in metres."""
        turn = self.angle(positions[self.given["turn"]]) if "turn" in self.given else 0.0
        plane = self._plane(positions)
        return [(0.0, 0.0, 0.0), *((out * math.cos(turn), out * math.sin(turn), up) for out, up in plane)]
