"""A person's orders to the daemon: to pause, to go on, to try again, and what it was that was given up."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from octoform.base.escaping import escaped_json
from octoform.claims.codec import to_json as claim_json
from octoform.claims.model import Claim, State
from octoform.daemon.requests import GivenUp
from octoform.daemon.store.backoff import Backoff
from octoform.daemon.store.instance_lock import Record
from octoform.views.format.console import Console
from octoform.views.format.values import ago, clock, one_line
from octoform.views.plan_text import counted

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
    console.line(f"The daemon (process {daemon.process.pid}) looks now{again}; octoform health shows the result.")
    _list(console, known, [each for each in known.frozen if each.target not in retried])
    return 0


def healed(console: Console, known: GivenUp, retried: Sequence[str], status: str, *, as_json: bool) -> int:
    """One check cycle was made by this command."""
    if as_json:
        return _object(console, {"asked": False, "status": status, "retried": list(retried), "frozen": _frozen(known)})
    console.line(
        f"This command makes one check cycle: {status}. No daemon runs afterwards (octoform watch starts one)."
    )
    _list(console, known, known.frozen)
    return 0


def _list(console: Console, known: GivenUp, frozen: Sequence[Backoff]) -> None:
    if not frozen:
        return
    console.line(f"\n{counted(len(frozen), 'trouble')} given up, until a person fixes the cause:")
    for each in frozen:
        since = f" at {clock(each.since)} ({ago(each.since)} ago)" if each.since else ""
        console.line(f"  {one_line(each.target, 60)}  {one_line(each.frozen or '', WIDTH)}{since}")
        console.line(f"    do     {console.paint(one_line(_do(known, each), WIDTH), 'bold')}")


def _do(known: GivenUp, each: Backoff) -> str:
    return known.advice.get(each.target) or f"octoform heal -retry {each.target}"


def _frozen(known: GivenUp) -> list[dict[str, object]]:
    return [
        {"target": each.target, "why": each.frozen, "since": each.since, "tries": each.tries, "key": each.key}
        for each in known.frozen
    ]


def _names(names: Sequence[str]) -> str:
    return one_line(", ".join(names), WIDTH)


def _object(console: Console, document: dict[str, object]) -> int:
    console.raw(escaped_json(json.dumps({"format": 1, **document}, ensure_ascii=False)))
    return 0


# Claims, for a person and for a program: the statement, the target, until when, and what it forbids.

_STYLES = {State.ACTIVE: "yellow", State.PENDING: "red"}
_WORDS = {
    State.ACTIVE: "in force",
    State.PENDING: "waits for a person",
    State.RETIRED: "over",
    State.REFUSED: "refused",
}
_ENDED = {
    "expired": "nothing bore it out any more",
    "contradicted": "a reading refutes it",
    "operator": "a person ended it",
    "superseded": "another one took its place",
}


def listed(console: Console, found: Sequence[Claim], *, everything: bool, as_json: bool) -> int:
    """The claims that are in force or wait; with ``everything`` also those that are over."""
    if as_json:
        document = {"format": 1, "claims": [claim_json(each) for each in found]}
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
        return 0
    if not found:
        console.line("Nothing is claimed." if everything else "Nothing is claimed now; octoform claims -all shows all.")
    for index, claim in enumerate(found):
        if index:
            console.line()
        for line in lines(console, claim):
            console.line(line)
    return 0


def lines(console: Console, claim: Claim) -> Iterator[str]:
    """One claim."""
    word = _WORDS[claim.state]
    style = _STYLES.get(claim.state)
    state = console.paint(word, style) if style else word
    yield f"{claim.id}  {state}  {one_line(claim.target, 60)}: {one_line(claim.statement, WIDTH)}"
    if claim.irreversible is not None:
        yield f"    kind      permanent restriction {claim.irreversible}: nothing moves there until a person ends it"
    else:
        yield "    kind temporary claim: ends by itself once a reading refutes it"
        yield f"    rests on  {one_line(_ground(claim), WIDTH)}"
    if claim.state is State.ACTIVE:
        until = f"until {clock(claim.expires_at)} unless it is borne out"
        yield f"    holds     {until if claim.expires_at else f'until octoform claims -retire {claim.id}'}"
    for each in claim.restrictions if claim.state in (State.ACTIVE, State.PENDING) else ():
        given = ", ".join(f"{name}={json.dumps(value)}" for name, value in each.arguments.items())
        effect = "refuses" if each.effect == "deny" else "asks before"
        yield f"    {effect:<9} {one_line(f'{each.tool}({given})', WIDTH)}"
    if claim.ended is not None:
        by = f" ({', '.join(claim.ended_by)})" if claim.ended_by else ""
        yield f"    ended     {one_line(_ENDED.get(claim.ended, claim.ended) + by, WIDTH)}"
    yield f" made by   {claim.by} at {clock(claim.made_at)}"
    if claim.state is State.PENDING:
        yield f"    do        {console.paint(f'octoform confirm {claim.id}', 'bold')}, or with -reject"


def rewrite_lines(identity: str, moves: str, difference: Sequence[str]) -> Iterator[str]:
    """A rewrite that waits for a person: what it moves, and what it changes, line by line."""
    yield f"{identity}  a rewrite of the code that moves a device ({one_line(moves, WIDTH)}); it was not tried:"
    yield from (f"    {one_line(line, 200)}" for line in difference)


def waiting(console: Console, claims: Sequence[Claim], rewrites: Sequence[Mapping[str, Any]], *, as_json: bool) -> int:
    """All that waits for a person: claims, and rewrites with what they change."""
    if as_json:
        whole = {"format": 1, "claims": [claim_json(claim) for claim in claims], "rewrites": list(rewrites)}
        console.raw(escaped_json(json.dumps(whole, ensure_ascii=False)))
        return 0
    for claim in claims:
        for line in lines(console, claim):
            console.line(line)
    for each in rewrites:
        for line in rewrite_lines(str(each["id"]), str(each["moves"]), each["difference"]):
            console.line(line)
    if not claims and not rewrites:
        console.line("Nothing waits for a person.")
    return 0


def rewrite_decided(console: Console, identity: str, *, served: bool, as_json: bool) -> int:
    """The result of a rewrite that a person decided about."""
    if as_json:
        console.raw(json.dumps({"format": 1, "rewrite": identity, "served": served}))
    else:
        console.line(f"{identity}: {'the rewritten server is in service' if served else 'dropped; nothing changed'}")
    return 0


def question(claim: Claim) -> str:
    """The question to a person: the effect of an approval."""
    if claim.irreversible is None:
        return "Put this temporary claim in force? It ends by itself once a reading refutes it."
    return f"Make this permanent restriction ({claim.irreversible}) true? Only octoform claims -retire ends it."


def decided(console: Console, claim: Claim, *, as_json: bool) -> int:
    """The result of a claim that a person decided about."""
    if as_json:
        console.raw(escaped_json(json.dumps({"format": 1, "claim": claim_json(claim)}, ensure_ascii=False)))
    else:
        for line in lines(console, claim):
            console.line(line)
    return 0


def _ground(claim: Claim) -> str:
    signal, condition = claim.signal, claim.condition
    return (
        f"{signal.source}{signal.path} {condition.op} {json.dumps(condition.value)}"
        f" ({counted_readings(len(claim.cites))}: {', '.join(claim.cites[-3:])})"
    )


def counted_readings(count: int) -> str:
    """``1 reading``, ``3 readings``."""
    return f"{count} reading{'' if count == 1 else 's'}"
