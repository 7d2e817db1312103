"""What went wrong, for a person and for a program: by kind first, then the latest ones."""

import json
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Any

from octoform.daemon.model import Outcome
from octoform.daemon.store.incidents import Episode
from octoform.daemon.store.incidents import to_json as episode_json
from octoform.diagnostics import Diagnostic
from octoform.escaping import escaped_json
from octoform.views.daemon.event_log import named, seconds_of
from octoform.views.format import problems, table
from octoform.views.format.console import Console
from octoform.views.format.table import Column
from octoform.views.format.values import clock, length, one_line

_KINDS = (
    Column("KIND", most=20),
    Column("COUNT", right=True),
    Column("REPAIRED", right=True),
    Column("BY ITSELF", right=True, goes=3),
    Column("LASTS", right=True),
    Column("PERSON", right=True),
    Column("MEDIAN", right=True),
    Column("P95", right=True, goes=2),
    Column("AGENT CALLS", right=True, goes=1),
)
_LATEST = (
    Column("ID", most=8, goes=2),
    Column("SINCE", most=19),
    Column("OVER AFTER", right=True, goes=3),
    Column("OUTCOME", most=10),
    Column("TRIED", most=30, goes=1),
    Column("WHAT", most=300),
)


def listed(console: Console, found: Sequence[Episode], said: Sequence[Diagnostic], count: int, *, as_json: bool) -> int:
    """All kinds with their figures, and the latest ``count`` episodes, the newest last."""
    latest = found[max(0, len(found) - count) :]
    if as_json:
        document = {
            "format": 1,
            "kinds": [figures(kind, found) for kind in kinds(found)],
            "episodes": [{**episode_json(each), "seconds": seconds_of(each)} for each in latest],
        }
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
        return 0
    problems.show(console, said)
    if not found:
        console.line("Nothing is on record: no daemon has found anything wrong.")
        return 0
    for line in table.lines(_KINDS, [_figures(figures(kind, found)) for kind in kinds(found)], console.width):
        console.line(line)
    console.line()
    for line in table.lines(_LATEST, [tuple(_row(each)) for each in latest], console.width):
        console.line(line)
    if len(latest) < len(found):
        console.line(f"and {len(found) - len(latest)} before: octoform episodes -n {len(found)}")
    return 0


def kinds(found: Sequence[Episode]) -> list[str]:
    """The kinds that there are, the most frequent first."""
    names = [str(each.kind) for each in found]
    return sorted(set(names), key=lambda name: (-names.count(name), name))


def figures(kind: str, found: Sequence[Episode]) -> dict[str, Any]:
    """Counts of one kind; seconds from the first sign to the end, over those that are over and can be timed."""
    of_kind = [each for each in found if str(each.kind) == kind]
    outcomes = [each.outcome for each in of_kind if each.over]
    took = sorted(seconds for each in of_kind if (seconds := seconds_of(each)) is not None)
    lasting = [each.outcome for each in of_kind if not each.over]
    return {
        "kind": kind,
        "count": len(of_kind),
        "repaired": outcomes.count(Outcome.REPAIRED),
        "cleared": outcomes.count(Outcome.CLEARED),
        "open": lasting.count(Outcome.OPEN),
        "frozen": lasting.count(Outcome.FROZEN),
        "surfaced": lasting.count(Outcome.SURFACED),
        "median_seconds": round(median(took), 3) if took else None,
        "p95_seconds": round(took[max(0, -(-len(took) * 95 // 100) - 1)], 3) if took else None,
        "agent_calls": sum(each.spent.calls for each in of_kind),
    }


def _figures(told: dict[str, Any]) -> tuple[str, ...]:
    times = (told["median_seconds"], told["p95_seconds"])
    counts = (told["count"], told["repaired"], told["cleared"], told["open"], told["frozen"] + told["surfaced"])
    return (
        told["kind"],
        *(str(count) for count in counts),
        *("-" if seconds is None else length(seconds) for seconds in times),
        str(told["agent_calls"]),
    )


def _row(each: Episode) -> Iterator[str]:
    took = seconds_of(each)
    yield each.id
    yield clock(each.opened)
    yield "-" if took is None else length(took)
    yield str(each.outcome)
    yield ", ".join(dict.fromkeys(made.repair for made in each.tries)) or "-"
    yield one_line(named(each.target, each.summary), 300)
