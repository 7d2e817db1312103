"""The bounds that decide a run: what must hold of a set of recorded hosts, in one table, and whether it does.

Names first: one wrong name fails the run, whichever item it is on. The others are counted on the items that people
wrote by hand; items made by rules stand beside them for comparison, because a program with the same rules agrees with
those by construction. A share of few items proves little, so below FEWEST a missed share is only a warning.
"""

import resource
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from recordings import score
from recordings.onboarding import Onboarded

FEWEST = 10
LEAST_ONBOARDED = 0.95
PROBE_SECONDS, START_SECONDS = 0.3, 0.011
"""CPU of PROBE at most, on a machine that takes so much to start Python; on a slower one it may take as much longer."""
HELD, WARNED, MISSED = "ok", "warning: few items", "MISSED"


@dataclass(frozen=True)
class Bound:
    """One line of the table: what is asked, what came out on hand and rule items, and whether it held."""

    title: str
    wanted: str
    hand: str
    rule: str
    verdict: str


def bounds(hosts: Sequence[Onboarded], marks: Sequence[score.Mark], slower: float = 1.0) -> list[Bound]:
    """All lines, in the order of their weight, on a machine that is ``slower`` times as slow as that of the bounds."""
    hand = [mark for mark in marks if mark.item.by_hand]
    rule = [mark for mark in marks if not mark.item.by_hand]
    return [
        _precision(hand, rule),
        _unknowns(hand, rule),
        _onboarded(hand, rule),
        Bound("recall of all items", "-", _share(_right(hand), len(hand)), _share(_right(rule), len(rule)), HELD),
        _probe(hosts, PROBE_SECONDS * slower),
        _failures(hosts),
    ]


def held(lines: Sequence[Bound]) -> bool:
    """True when no bound was missed."""
    return all(line.verdict != MISSED for line in lines)


def print_bounds(lines: Sequence[Bound]) -> None:
    """The table, and the one line that decides."""
    print("\nwhat decides")
    print(f"  {'':<44}{'wanted':>10}{'hand':>18}{'rule':>18}  ")
    for line in lines:
        print(f"  {line.title:<44}{line.wanted:>10}{line.hand:>18}{line.rule:>18}  {line.verdict}")
    missed = [line.title for line in lines if line.verdict == MISSED]
    print(f"RESULT: {'failed: ' + '; '.join(missed) if missed else 'all bounds hold'}")


def _precision(hand: Sequence[score.Mark], rule: Sequence[score.Mark]) -> Bound:
    by_hand, by_rule = (
        _share(_count(some, score.NAMED), _count(some, score.NAMED, score.MISIDENTIFIED)) for some in (hand, rule)
    )
    wrong = _count((*hand, *rule), score.MISIDENTIFIED)
    return Bound("precision of named products", "1.000", by_hand, by_rule, MISSED if wrong else HELD)


def _unknowns(hand: Sequence[score.Mark], rule: Sequence[score.Mark]) -> Bound:
    asked = [[mark for mark in some if mark.asked_unknown] for some in (hand, rule)]
    right = [_count(some, score.UNKNOWN_RIGHT) for some in asked]
    by_hand, by_rule = (_share(count, len(some)) for count, some in zip(right, asked, strict=True))
    verdict = HELD if right[0] == len(asked[0]) else MISSED
    return Bound("right unknowns of asked unknowns", "1.000", by_hand, by_rule, verdict)


def _onboarded(hand: Sequence[score.Mark], rule: Sequence[score.Mark]) -> Bound:
    able = [[mark.usable for mark in some if mark.usable is not None] for some in (hand, rule)]
    by_hand, by_rule = (_share(sum(some), len(some)) for some in able)
    enough = not able[0] or sum(able[0]) >= LEAST_ONBOARDED * len(able[0])
    few = WARNED if len(able[0]) < FEWEST else MISSED
    return Bound("recall of onboardable devices", f">= {LEAST_ONBOARDED}", by_hand, by_rule, HELD if enough else few)


def _probe(hosts: Sequence[Onboarded], most: float) -> Bound:
    costs = [host.cpu["probe"] for host in hosts if host.laptop and "probe" in host.cpu]
    verdict = HELD if max(costs, default=0.0) <= most else MISSED
    shown = f"{max(costs):.2f} s of {len(costs)}" if costs else "no laptop"
    return Bound("CPU seconds of PROBE on a laptop, the most", f"<= {most:.2f}", shown, "", verdict)


def slowness() -> float:
    """How many times longer than `START_SECONDS` Python takes to start here, the median of nine; at least 1."""
    taken = []
    for _ in range(9):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, "-c", "pass"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        taken.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return max(1.0, sorted(taken)[len(taken) // 2] / START_SECONDS)


def _failures(hosts: Sequence[Onboarded]) -> Bound:
    failed = sum(bool(host.problems) for host in hosts)
    return Bound(
        "hosts that were onboarded", "all", f"{len(hosts) - failed}/{len(hosts)}", "", MISSED if failed else HELD
    )


def _right(marks: Sequence[score.Mark]) -> int:
    return _count(marks, *score.RIGHT)


def _count(marks: Sequence[score.Mark], *results: str) -> int:
    return sum(mark.result in results for mark in marks)


def _share(part: int, whole: int) -> str:
    return f"{part}/{whole} {part / whole:.3f}" if whole else "-"
