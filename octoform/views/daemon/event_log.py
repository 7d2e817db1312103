"""Live view of the daemon: on a terminal one line for each event, elsewhere one JSON object a line.

Light: it is loaded in the daemon's own process and stays there.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from statistics import median
from typing import Any

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.escaping import escaped_json
from octoform.base.health_status import Status
from octoform.daemon.model import Outcome
from octoform.daemon.reconcile.supervisor import Cycle
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.incidents import to_json as episode_json
from octoform.diagnostics import Diagnostic
from octoform.views.format import problems, table
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream
from octoform.views.format.table import Column
from octoform.views.format.values import clock, length, one_line
from octoform.views.plan_text import counted

EXIT = {Status.HEALTHY: 0, Status.DEGRADED: 3, Status.ERROR: 4, Status.DOWN: 5, Status.UNKNOWN: 6}
"""How a command leaves that shows how the deployment is; 1 and 2 mean other things."""
STYLES = {
    Status.HEALTHY: "green",
    Status.DEGRADED: "yellow",
    Status.ERROR: "red",
    Status.DOWN: "red",
    Status.UNKNOWN: "yellow",
}
Style = tuple[str, ...]
_STANDING = (Outcome.FROZEN, Outcome.SURFACED)


class Standing:
    """Which problems wait for a person, shown once each time that they begin to."""

    def __init__(self) -> None:
        self._shown: set[str] = set()
        self._known: dict[str, Incident] = {}

    def fresh(self, made: Cycle) -> list[Incident]:
        """Those that are given up, or that nothing repairs, since the check cycle before."""
        for each in (*made.opened, *(episode for episode, _ in made.tried), *made.ended):
            self._known[each.key] = each
        for each in made.ended:
            self._known.pop(each.key, None)
        now = {key: each for key, each in self._known.items() if each.outcome in _STANDING}
        new = [each for key, each in now.items() if key not in self._shown]
        self._shown = set(now)
        return new


def named(target: str, sentence: str) -> str:
    """``target: sentence``; the sentence alone where it names its target."""
    name = target.partition(":")[2] or target
    return sentence if name in sentence else f"{target}: {sentence}"


def seconds_of(episode: Incident) -> float | None:
    """From its first sign to its end; None while it lasts, and where a restart of the machine lies between."""
    if episode.closed_uptime is None or episode.closed_uptime < episode.opened_uptime:
        return None
    return episode.closed_uptime - episode.opened_uptime


class Lines:
    """The events for a person, and below them a line that states how it is."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._standing = Standing()
        self._status = ""
        self._paused: str | None = None
        self._gone = False

    def __call__(self, made: Cycle) -> None:
        """Show one round; nothing any more once the terminal was closed, which ends the daemon in order (SIGHUP)."""
        if self._gone:
            return
        try:
            self._show(made)
        except BrokenPipeError:
            raise
        except OSError:
            self._gone = True

    def _show(self, made: Cycle) -> None:
        self._wipe()
        stamp = clock(made.facts.stamp)
        for target, style, words, colour in self._events(made):
            target = one_line(target, self._console.width // 2)
            head = f"{self._console.paint(stamp, 'dim')}  {self._console.paint(target, *style)}"
            room = self._console.width - len(stamp) - len(target) - 4
            self._console.line(f"{head}  {self._console.paint(one_line(words, room), *colour)}")
        self._draw(made)

    def end(self) -> None:
        """Leave the terminal as it was."""
        with suppress(OSError):  # it may have been closed
            self._wipe()

    def _events(self, made: Cycle) -> Iterator[tuple[str, Style, str, Style]]:
        """The target and its style, the statement and its style."""
        for problem in made.problems:
            yield "octoform", (), _problem(problem), ("yellow",)
        if made.paused != self._paused:
            self._paused = made.paused
            words = "repairs go on" if made.paused is None else "repairs are paused: octoform resume lets them go on"
            yield "octoform", (), words, ()
        for episode in made.opened:
            yield episode.target, (STYLES[episode.status],), episode.summary, ()
        for episode, tried in made.tried:  # before what was begun because of it
            word = f"{tried.repair} {'done' if tried.ok else 'failed'} in {length(tried.seconds or 0.0)}"
            yield episode.target, (), f"{word}{f': {tried.detail}' if tried.detail else ''}", _colour(tried)
        for target, repair in _under_way(made):
            yield target, (), f"{repair} ...", ("dim",)
        for episode in made.ended:
            took = seconds_of(episode)
            word = "repaired" if episode.outcome is Outcome.REPAIRED else "resolved by itself"
            yield episode.target, (), f"{word}{f' after {length(took)}' if took is not None else ''}", ("green",)
        for episode in self._standing.fresh(made):
            yield episode.target, (), _needed(episode), ("red",)

    def _draw(self, made: Cycle) -> None:
        """The quiet line; it is drawn again only when something is written above it or it states something new."""
        if made.health is None or not self._console.out.isatty():
            return
        health = made.health
        word = self._console.paint(str(health.status), STYLES[health.status])
        paused = ", repairs paused" if made.paused is not None else ""
        wrong = f", {len(health.parts)} not well" if health.parts else ""
        read = counted(health.covered, "signal") if health.status is not Status.DOWN else "no signal is read"
        rest = f"{read}{wrong}{paused}, last check {clock(made.facts.stamp)}"
        self._status = f"{one_line(health.host, 40)}: {word}  {rest}  (Ctrl-C ends)"
        self._console.out.write(self._status[: self._console.width + (len(word) - len(str(health.status)))])
        self._console.out.flush()

    def _wipe(self) -> None:
        if self._status:
            self._console.out.write("\r\x1b[K")
            self._console.out.flush()
            self._status = ""


class Objects:
    """The events as JSON lines; see docs/daemon.md for their types."""

    def __init__(self, console: Console) -> None:
        self._stream = JsonStream(console)
        self._standing = Standing()
        self._health: tuple[object, ...] | None = None
        self._paused: str | None = None

    def __call__(self, made: Cycle) -> None:
        """Show one check cycle; a check cycle in which nothing happened shows nothing."""
        emit = self._stream.emit
        self._stream.diagnostics(made.problems)
        if made.paused != self._paused:
            self._paused = made.paused
            emit(
                "paused" if made.paused is not None else "resumed",
                "repairs are paused" if made.paused is not None else "repairs go on",
            )
        for episode in made.opened:
            emit("noticed", named(episode.target, episode.summary), level="warn", episode=episode_json(episode))
        for episode, tried in made.tried:  # before what was begun because of it
            emit("repair_end", f"{episode.target}: {tried.repair}", **_tried(episode, tried))
        for target, repair in _under_way(made):
            emit("repair_start", f"{target}: {repair}", target=target, repair=repair)
        for episode in made.ended:
            emit(
                "over",
                f"{episode.target}: {episode.outcome}",
                episode=episode_json(episode),
                seconds=seconds_of(episode),
            )
        for episode in self._standing.fresh(made):
            text = f"{episode.target}: {episode.outcome}"
            emit("needs_person", text, level="error", episode=episode_json(episode), hint=episode.hint)
        self._print_health(made)

    def end(self) -> None:
        """Has no effect: no line is pending."""

    def _print_health(self, made: Cycle) -> None:
        health = made.health
        if health is None:
            return
        lines = (health.status, health.parts, health.uncovered, health.claims, health.pending)
        if lines != self._health:
            self._health = lines
            self._stream.emit("health", f"{health.host}: {health.status}", health=health.as_json())


class Silence:
    """Nothing, for a command that prints one document at its end."""

    def __call__(self, _made: Cycle) -> None:
        """Show nothing."""

    def end(self) -> None:
        """There is nothing to clear away."""


def _tried(episode: Incident, tried: RepairOutcome) -> dict[str, Any]:
    return {
        "episode": episode.id,
        "target": episode.target,
        "repair": tried.repair,
        "ok": tried.ok,
        "detail": tried.detail,
        "seconds": tried.seconds,
    }


def _under_way(made: Cycle) -> list[tuple[str, str]]:
    """(target, repair) of what was begun and has not ended in the same check cycle."""
    over = {(episode.target, tried.repair) for episode, tried in made.tried}
    begun = [(each.finding.target, str(each.repair)) for each in made.begun if each.finding and each.repair]
    return [each for each in begun if each not in over]


def _needed(episode: Incident) -> str:
    """Why, and where the whole of it is shown: a line of events is no place for a command that is cut."""
    return f"needs a person (octoform health): {episode.hint.partition('; ')[0] or episode.summary}"


def _colour(tried: RepairOutcome) -> Style:
    return () if tried.ok else ("yellow",)


def _problem(item: Diagnostic) -> str:
    return one_line(f"{item.summary}{f' ({item.path})' if item.path else ''}", 160)


# What went wrong, for a person and for a program: by kind first, then the latest ones.

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


def listed(
    console: Console, found: Sequence[Incident], diagnostics: Sequence[Diagnostic], count: int, *, as_json: bool
) -> int:
    """All kinds with their figures, and the latest ``count`` incidents, the newest last."""
    latest = found[max(0, len(found) - count) :]
    if as_json:
        document = {
            "format": 1,
            "kinds": [figures(kind, found) for kind in kinds(found)],
            "episodes": [{**episode_json(each), "seconds": seconds_of(each)} for each in latest],
        }
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
        return 0
    problems.show(console, diagnostics)
    if not found:
        console.line("Nothing is on record: no daemon has found anything wrong.")
        return 0
    for line in table.lines(_KINDS, [_figures(figures(kind, found)) for kind in kinds(found)], console.width):
        console.line(line)
    console.line()
    for line in table.lines(_LATEST, [tuple(_row(each)) for each in latest], console.width):
        console.line(line)
    if len(latest) < len(found):
        console.line(f"and {len(found) - len(latest)} before: octoform incidents -n {len(found)}")
    return 0


def kinds(found: Sequence[Incident]) -> list[str]:
    """The kinds that there are, the most frequent first."""
    names = [str(each.kind) for each in found]
    return sorted(set(names), key=lambda name: (-names.count(name), name))


def figures(kind: str, found: Sequence[Incident]) -> dict[str, Any]:
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


def _figures(figures: dict[str, Any]) -> tuple[str, ...]:
    times = (figures["median_seconds"], figures["p95_seconds"])
    counts = (
        figures["count"],
        figures["repaired"],
        figures["cleared"],
        figures["open"],
        figures["frozen"] + figures["surfaced"],
    )
    return (
        figures["kind"],
        *(str(count) for count in counts),
        *("-" if seconds is None else length(seconds) for seconds in times),
        str(figures["agent_calls"]),
    )


def _row(each: Incident) -> Iterator[str]:
    took = seconds_of(each)
    yield each.id
    yield clock(each.opened)
    yield "-" if took is None else length(took)
    yield str(each.outcome)
    yield ", ".join(dict.fromkeys(made.repair for made in each.tries)) or "-"
    yield one_line(named(each.target, each.summary), 300)
