"""What the scorer prints: misses one by one, counts by class, and what onboarding cost."""

import statistics
from collections import defaultdict
from collections.abc import Iterable, Sequence

from recordings import score
from recordings.onboardable import REASONS
from recordings.onboarding import Onboarded, is_whole_host

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
    """Every misidentification; with ``verbose`` every item that did not go right or has no tool."""
    for mark in marks:
        if mark.result == score.MISIDENTIFIED or (verbose and mark.result not in score.RIGHT):
            print(f"{mark.result.upper()} [{_basis(mark)}] {mark.item.recording}: {mark.item.match}")
            print(f"    is {mark.item.product} ({mark.item.category}, {mark.item.kind}); {mark.why}")
        if verbose and mark.usable is False:
            print(f"NO TOOL [{_basis(mark)}] {mark.item.recording}: {mark.item.match}")
            print(f"    is {mark.item.product}, for {' or '.join(mark.item.capabilities)}; {mark.why}")


def _basis(mark: score.Mark) -> str:
    return "hand" if mark.item.by_hand else "rule"


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
    """What onboarding cost, for each whole host and in all, and everything that failed."""
    print_costs([host for host in hosts if is_whole_host(host.name)])
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


def print_costs(hosts: Sequence[Onboarded]) -> None:
    """CPU seconds of each whole host: PROBE alone, and from PROBE to SERVE with the import of its server."""
    if not hosts:
        return
    print("\nCPU seconds of whole hosts")
    print(f"  {'':<36}{'PROBE':>10}{'to SERVE':>10}{'devices':>10}{'':>4}")
    for host in hosts:
        probe = f"{host.cpu['probe']:.2f}" if "probe" in host.cpu else "-"
        whole = f"{host.cpu['onboarding'] + host.cpu['serve']:.2f}" if "serve" in host.cpu else "-"
        print(f"  {host.name:<36}{probe:>10}{whole:>10}{host.funnel[0]:>10}{'laptop' if host.laptop else '':>8}")


def print_funnel(hosts: Sequence[Onboarded]) -> None:
    """How many devices were seen, annotated and given tools: of all recordings, and of whole hosts."""
    print("\nthe funnel")
    print(f"  {'':<18}{'seen':>10}{'annotated':>11}{'with tools':>12}")
    for title, some in (("all", hosts), ("whole hosts", [host for host in hosts if is_whole_host(host.name)])):
        seen, annotated, served = (sum(host.funnel[at] for host in some) for at in range(3))
        print(f"  {title:<18}{seen:>10}{annotated:>11}{served:>12}")


def print_excluded(marks: Sequence[score.Mark]) -> None:
    """How many items each reason keeps from being onboardable, hand and rule apart."""
    print(f"\n{'not onboardable, and why':<74}{'hand':>6}{'rule':>6}")
    for reason in REASONS:
        hand, rule = (
            sum(mark.excluded == reason and mark.item.by_hand == by_hand for mark in marks) for by_hand in (True, False)
        )
        print(f"  {reason:<72}{hand:>6}{rule:>6}")


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
