"""What a person told the daemon: to pause, to go on, to try again, and what it was that was given up."""

import json
from collections.abc import Sequence

from octoform.daemon.requests import GivenUp
from octoform.daemon.store.backoff import Breaker
from octoform.daemon.store.instance_lock import Record
from octoform.escaping import escaped_json
from octoform.views.format.console import Console
from octoform.views.format.values import ago, clock, one_line
from octoform.views.plan.text import counted

WIDTH = 110


def paused(console: Console, host: str, daemon: Record | None, *, as_json: bool) -> int:
    """Repairs are paused."""
    if as_json:
        return _object(console, {"host": host, "paused": True, "watched": daemon is not None})
    console.line(f"{host}: repairs are paused; the deployment is still looked at")
    console.line(
        "  octoform resume lets them go on" if daemon is not None else "  no daemon runs; the next one will be paused"
    )
    return 0


def resumed(console: Console, host: str, daemon: Record | None, *, was: bool, as_json: bool) -> int:
    """Repairs are made again; ``was`` is False when nothing was paused."""
    if as_json:
        return _object(console, {"host": host, "paused": False, "was": was, "watched": daemon is not None})
    console.line(f"{host}: {'repairs go on' if was else 'repairs were not paused'}")
    if daemon is None:
        console.line("  no daemon runs: octoform watch")
    return 0


def asked(console: Console, daemon: Record, known: GivenUp, retried: Sequence[str], *, as_json: bool) -> int:
    """The daemon was asked to look, and to try again what was given up."""
    if as_json:
        return _object(
            console, {"asked": True, "pid": daemon.process.pid, "retried": list(retried), "frozen": _frozen(known)}
        )
    again = f" and tries {_names(retried)} again" if retried else ""
    console.line(f"The daemon (process {daemon.process.pid}) looks now{again}; octoform health tells how it went.")
    _list(console, known, [each for each in known.frozen if each.target not in retried])
    return 0


def healed(console: Console, known: GivenUp, retried: Sequence[str], status: str, *, as_json: bool) -> int:
    """One round was made by this command."""
    if as_json:
        return _object(console, {"asked": False, "status": status, "retried": list(retried), "frozen": _frozen(known)})
    console.line(f"One round is made: {status}. No daemon runs, so nothing watches from here on (octoform watch).")
    _list(console, known, known.frozen)
    return 0


def _list(console: Console, known: GivenUp, frozen: Sequence[Breaker]) -> None:
    if not frozen:
        return
    console.line(f"\n{counted(len(frozen), 'trouble')} given up, until a person mends the cause:")
    for each in frozen:
        since = f" at {clock(each.since)} ({ago(each.since)} ago)" if each.since else ""
        console.line(f"  {one_line(each.target, 60)}  {one_line(each.frozen or '', WIDTH)}{since}")
        console.line(f"    do     {console.paint(one_line(_do(known, each), WIDTH), 'bold')}")


def _do(known: GivenUp, each: Breaker) -> str:
    return known.advice.get(each.target) or f"octoform heal -retry {each.target}"


def _frozen(known: GivenUp) -> list[dict[str, object]]:
    return [
        {"target": each.target, "why": each.frozen, "since": each.since, "tries": each.tries, "key": each.key}
        for each in known.frozen
    ]


def _names(names: Sequence[str]) -> str:
    return one_line(", ".join(names), WIDTH)


def _object(console: Console, told: dict[str, object]) -> int:
    console.raw(escaped_json(json.dumps({"format": 1, **told}, ensure_ascii=False)))
    return 0
