"""What the scorer prints: misses one by one, counts by class, and what onboarding cost."""

import statistics
from collections import defaultdict
from collections.abc import Iterable, Sequence

import score
from onboarding import Onboarded

_HEAD = (
    "items",
    "seen",
    "named",
    "unknown",
    "misident.",
    "not named",
    "left out",
    "usable",
    "precision",
    "recall",
)
_STEPS = {
    "probe": "PROBE alone",
    "onboarding": "PROBE to INTERFACE",
    "serve": "SERVE with its import",
}


def print_details(marks: Iterable[score.Mark], *, verbose: bool) -> None:
    """Every misidentification; with ``verbose`` every item that did not go right."""
    for mark in marks:
        if mark.result == score.MISIDENTIFIED or (verbose and mark.result not in score.RIGHT):
            basis = "hand" if mark.item.by_hand else "rule"
            print(f"{mark.result.upper()} [{basis}] {mark.item.recording}: {mark.item.match}")
            print(f"    is {mark.item.product} ({mark.item.category}, {mark.item.kind}); {mark.why}")


def print_marks(title: str, marks: Sequence[score.Mark], *, verbose: bool) -> None:
    """One table; with ``verbose`` a line for each class of device."""
    print(f"\nitems {title}")
    print(f"  {'':<18}" + "".join(f"{word:>10}" for word in _HEAD))
    by_class: dict[str, list[score.Mark]] = defaultdict(list)
    for mark in marks if verbose else ():
        by_class[mark.item.kind].append(mark)
    for kind, some in sorted(by_class.items()):
        print(f"  {kind:<18}" + _row(some))
    print(f"  {'all':<18}" + _row(marks))


def print_hosts(hosts: Sequence[Onboarded]) -> None:
    """How many hosts, what they cost, and everything that failed."""
    print()
    for step, title in _STEPS.items():
        cost = [host.cpu[step] for host in hosts if step in host.cpu]
        if cost:
            figures = f"median {statistics.median(cost):.2f}, max {max(cost):.2f} of {len(cost)} hosts"
            print(f"CPU seconds, {title + ':':<23} {figures}")
    lines = [host.server_lines for host in hosts if host.server_lines is not None]
    if lines:
        print(f"servers imported: {len(lines)}, median {statistics.median(lines):.0f}, max {max(lines)} lines")
    for host in hosts:
        for note in host.notes:
            print(f"note {host.name}: {note}")
    for host in hosts:
        for problem in host.problems:
            print(f"FAILED {host.name}: {problem}")
    print(f"hosts onboarded: {sum(not host.problems for host in hosts)} of {len(hosts)}")


def _row(marks: Sequence[score.Mark]) -> str:
    count = {result: sum(mark.result == result for mark in marks) for result in score.RESULTS}
    right = sum(count[result] for result in score.RIGHT)
    wrong = count[score.MISIDENTIFIED]
    usable = [mark.usable for mark in marks if mark.usable is not None]
    cells = [
        str(len(marks)),
        str(len(marks) - count[score.NOT_SEEN]),
        str(count[score.NAMED]),
        str(count[score.UNKNOWN_RIGHT]),
        str(wrong),
        str(count[score.MISSED]),
        str(count[score.LEFT_OUT]),
        f"{sum(usable)}/{len(usable)}",
        f"{right / (right + wrong):.3f}" if right + wrong else "-",
        f"{right / len(marks):.3f}" if marks else "-",
    ]
    return "".join(f"{cell:>10}" for cell in cells)
