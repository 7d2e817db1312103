"""The campaign's results as a table of Markdown, and its sums."""

import os
import statistics
from collections.abc import Sequence
from pathlib import Path

from campaign.model import QUIET, Case, Result

HEADING = "## The last run\n"
HEAD = ("fault", "row", "end", "n", "noticed", "wrong", "notice s", "p95", "repair s", "p95", "calls", "left")


def table(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """A row for each case."""
    rows = [
        HEAD,
        ("---",) * len(HEAD),
        *(_row(case, [each for each in results if each.case == case.name]) for case in cases),
    ]
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in rows)


def totals(cases: Sequence[Case], results: Sequence[Result]) -> str:
    """Rates over all injections, and everything that was not as it should be."""
    loud = [each for each in results if _case(cases, each).ends != QUIET]
    noticed = sum(each.detected is not None for each in loud)
    wrong = sum(bool(each.wrong) for each in results)
    free = [each for each in results if not _case(cases, each).calls]
    lines = [
        f"{len(results)} injections of {len(cases)} faults.",
        f"Noticed: {noticed} of {len(loud)} ({100 * noticed / max(1, len(loud)):.1f} %).",
        f"Wrong repairs: {wrong} ({100 * wrong / max(1, len(results)):.1f} %).",
        f"Agent calls where rules suffice: {sum(each.calls for each in free)}; elsewhere: "
        f"{sum(each.calls for each in results) - sum(each.calls for each in free)}, "
        f"{sum(each.tokens for each in results)} tokens.",
        f"Processes left over: {sum(each.survivors for each in results)}.",
        f"Machine: {os.cpu_count()} cores, {_load(results)}.",
    ]
    lines += sorted(
        {f"- {each.case}: {words}" for each in results for words in (*each.missed, *each.wrong, *each.slow)}
    )
    return "\n".join(lines)


def _load(results: Sequence[Result]) -> str:
    known = sorted(each.load for each in results if each.load is not None)
    if not known:
        return "its load is not known"
    return f"load from {known[0]:.1f} to {known[-1]:.1f}, in the middle {statistics.median(known):.1f}"


def into(path: Path, text: str) -> None:
    """Put it below the heading of the last run, in place of what stands there."""
    document = path.read_text()
    before, heading, rest = document.partition(HEADING)
    assert heading, f"{path} has no heading {HEADING}"
    end = rest.find("\n## ")
    path.write_text(f"{before}{heading}\n{text}\n{rest[end:] if end >= 0 else ''}")


def _case(cases: Sequence[Case], result: Result) -> Case:
    return next(case for case in cases if case.name == result.case)


def _row(case: Case, results: Sequence[Result]) -> tuple[object, ...]:
    noticed = [each.detected for each in results if each.detected is not None]
    repaired = [each.repaired for each in results if each.repaired is not None]
    share = "-" if case.ends == QUIET else f"{100 * len(noticed) / max(1, len(results)):.0f} %"
    return (
        case.name,
        case.rows,
        case.ends,
        len(results),
        share,
        sum(bool(each.wrong) for each in results),
        *_times(noticed),
        *_times(repaired),
        sum(each.calls for each in results),
        sum(each.survivors for each in results),
    )


def _times(seconds: Sequence[float]) -> tuple[str, str]:
    if not seconds:
        return "-", "-"
    ordered = sorted(seconds)
    return f"{statistics.median(ordered):.2f}", f"{ordered[min(len(ordered) - 1, int(len(ordered) * 0.95))]:.2f}"
