"""The daemon in numbers, as a file that Prometheus' node exporter reads. Written as a whole, or not at all.

The numbers are made of what is kept anyway, so they say the same as `octoform health` and `octoform incidents`. All are
gauges: they are read off a record that is cut when it has grown. Light until it is used: the library is loaded only
where the manifest names a file.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from octoform.base.health_status import Status
from octoform.daemon.health import Health
from octoform.daemon.model import Outcome
from octoform.daemon.store.incidents import Incident
from octoform.diagnostics import Diagnostic
from octoform.records import dataclass, replace
from octoform.state.files import write_atomic

if TYPE_CHECKING:
    from prometheus_client.core import Metric

Rows = Mapping[tuple[str, ...], float]
Tally: TypeAlias = "Counter[tuple[str, ...]]"


@dataclass(frozen=True, slots=True)
class Picture:
    """The counted values. ``episodes`` are all that are kept, ``frozen`` counts breakers.

    ``now`` is the wall clock's epoch, ``untold`` counts messages that reached no one.
    """

    health: Health
    episodes: Sequence[Incident]
    now: float
    frozen: int = 0
    paused: bool = False
    untold: int = 0


def write(path: Path, picture: Picture) -> Diagnostic | None:
    """Replace the file by the numbers of now; None when that is done. Everybody may read it, as an exporter must."""
    problem = write_atomic(path, render(picture), 0o644)
    if problem is None:
        return None
    hint = "see to the folder and its rights, or change daemon.metrics in octopus.yaml"
    return replace(problem, summary=f"the file of metrics {problem.summary}", hint=hint)


def render(picture: Picture) -> bytes:
    """The numbers in the text format of Prometheus."""
    from prometheus_client import CollectorRegistry, generate_latest

    registry = CollectorRegistry()
    registry.register(_Collector(picture))
    return generate_latest(registry)


class _Collector:
    """The collector that the metrics library calls."""

    def __init__(self, picture: Picture) -> None:
        self._picture = picture

    def collect(self) -> "Iterator[Metric]":
        """One family for each name."""
        from prometheus_client.core import GaugeMetricFamily

        host = self._picture.health.host
        for name, text, labels, rows in _families(self._picture):
            family = GaugeMetricFamily(f"octoform_{name}", text, labels=("host", *labels))
            for values, number in rows.items():
                family.add_metric((host, *values), number)
            yield family


def _families(picture: Picture) -> Iterator[tuple[str, str, tuple[str, ...], Rows]]:
    health, episodes = picture.health, picture.episodes
    statuses: Rows = {(str(each),): float(each is health.status) for each in Status}
    yield "health", "1 for the status that the deployment has, 0 for the others", ("status",), statuses
    for name, text, value in (
        ("last_round_timestamp_seconds", "when this was written; an old one means that no daemon works", picture.now),
        ("paused", "1 while a person keeps repairs from being made", float(picture.paused)),
        ("signals_reporting", "signals that report", health.covered),
        ("signals_silent", "signals that should report and do not", len(health.uncovered)),
        ("claims", "claims in force", len(health.claims)),
        ("claims_pending", "claims that wait for a person", len(health.pending)),
        ("troubles_frozen", "problems that the daemon gave up and that wait for a person", picture.frozen),
        ("messages_lost", "messages that reached no one since the last that did", picture.untold),
    ):
        yield name, text, (), {(): float(value)}
    lasting = (Outcome.OPEN, Outcome.FROZEN, Outcome.SURFACED)
    standing: Tally = Counter((str(each.kind), str(each.outcome)) for each in episodes if not each.over)
    ended: Tally = Counter(
        (str(each.kind), str(each.outcome)) for each in episodes if each.over and each.outcome not in lasting
    )
    labels = ("kind", "outcome")
    yield "episodes_open", "incidents that are open", labels, _floats(standing)
    yield "episodes_ended", "incidents that ended, of those that are kept", labels, _floats(ended)
    yield from _work(episodes)


def _work(episodes: Iterable[Incident]) -> Iterator[tuple[str, str, tuple[str, ...], Rows]]:
    """Repairs with the time they took, and what agents cost."""
    tries: Tally = Counter()
    seconds: dict[tuple[str, ...], float] = {}
    tokens: Tally = Counter()
    calls, dollars, is_known = 0, 0.0, True
    for each in episodes:
        for made in each.tries:
            tries[made.repair, "ok" if made.ok else "failed"] += 1
            seconds[made.repair,] = seconds.get((made.repair,), 0.0) + (made.seconds or 0.0)
        calls += each.spent.calls
        tokens["input",] += each.spent.input_tokens
        tokens["output",] += each.spent.output_tokens
        is_known = is_known and each.spent.usd is not None
        dollars += each.spent.usd or 0.0
    yield "repairs", "repairs that were tried, by their own word", ("repair", "result"), _floats(tries)
    yield "repair_seconds", "what they took, together", ("repair",), seconds
    yield "agent_calls", "runs of agents that the daemon asked", (), {(): float(calls)}
    yield "agent_tokens", "what they used", ("direction",), _floats(tokens)
    if is_known:  # an unknown cost is not zero
        yield "agent_usd", "what they cost, in US dollars", (), {(): dollars}


def _floats(counts: Mapping[tuple[str, ...], int]) -> Rows:
    return {key: float(count) for key, count in sorted(counts.items())}
