"""One call on its way through the gate, and what is written about it.

Each executed call leaves two records: what was decided, before its code begins, and what came of it. A refused one
leaves one. When a record cannot be written, nothing that moves may happen; a reading goes on, and states that.
"""

import asyncio
import itertools
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fastmcp.server.dependencies import fastmcp_request_ctx

from octoform.policy import is_number
from octoform.policy.enforce import Ledger, beyond_text
from octoform.policy.published import Reports, ToolPolicy
from octoform.server.audit.audit_log import Audit, AuditFailed
from octoform.server.execution.bus_queue import Holder
from octoform.server.execution.work import Work
from octoform.server.process import principal
from octoform.server.process.local_socket import Client, client_of
from octoform.server.process.principal import Principal
from octoform.server.process.stderr_log import write_line

from .argument_validation import NOTHING, Effective
from .tool_registry import Entry

READ = "read"
HELD = 0.25
Record = tuple[str, Mapping[str, Any]]


class CallRefused(Exception):
    """The call is not made; ``code`` for programs, the text for anyone who called."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


@dataclass(eq=False, slots=True)
class Call:
    """``given`` are the arguments as they came, ``effective`` as the tool will see them; ``began`` in monotonic
    seconds, of its way here, and once it waited for a person or a bus from then on; ``stops`` how many emergency stops
    there had been when it came; ``client`` is the program that calls; ``noted`` what shadow mode let pass; ``asked``
    what its records say of asking a person: approval (the same for question and answer), answer; ``well``: its code
    has ended with a result; ``restricted`` what a claim restricts about it now, in words."""

    identity: str
    entry: Entry
    caller: Principal
    given: Mapping[str, Any]
    dry: bool
    began: float
    stops: int = 0
    beats: bool = False
    effective: Effective = NOTHING
    noted: list[str] = field(default_factory=list)
    asked: dict[str, str] = field(default_factory=dict)
    holder: Holder | None = None
    work: Work | None = None
    answered: bool = False
    well: bool = False
    restricted: str = ""
    client: Client = field(default_factory=Client)

    @property
    def arguments(self) -> Mapping[str, Any]:
        """The arguments as the tool will see them, by the names of its schema."""
        return self.effective.shown

    @property
    def moves(self) -> bool:
        """Whether anything but a reading happens."""
        return self.entry.policy.effect != READ

    @property
    def limited(self) -> bool:
        """Whether any limit may stand against it."""
        return self.moves or bool(self.entry.policy.limits)

    @property
    def confirms(self) -> bool:
        """Whether a person has to confirm it; of what a claim denies no one is asked."""
        return self.entry.policy.decision == "confirm" or bool(self.restricted)

    @property
    def approved(self) -> bool:
        """Whether a person did."""
        return self.asked.get("answer") == "approved"

    def shown(self) -> dict[str, Any]:
        """Which call it is and how long it has run, in seconds, as plain values."""
        return {
            "tool": self.entry.name,
            "caller": self.caller.name,
            "buses": list(self.entry.policy.buses),
            "seconds": round(time.monotonic() - self.began, 1),
        }

    def words(self) -> str:
        """How far it is, for anyone who waits for it."""
        if self.work is not None or self.holder is None:
            return f"{self.entry.name} is running"
        waiting = next((queue.words(self.holder) for queue in self.entry.queues if not queue.free()), "it waits")
        return f"{self.entry.name} has not begun: {waiting}"


class Records:
    """Writes the records of calls; ``problem`` states why the last one could not be written, else None.

    Every decision is on the log before the tool begins, the outcome of what moves before the answer goes. Outcomes of
    readings are kept back for at most ``HELD`` seconds and go in one write: it would be half of what the gate costs.
    """

    def __init__(self, audit: Audit) -> None:
        self._audit = audit
        self._run = os.urandom(4).hex()
        self._count = itertools.count(1)
        self._held: list[Record] = []
        self._timer: asyncio.TimerHandle | None = None
        self.problem: str | None = None

    def identity(self) -> str:
        """A name for the next call, in the records alone."""
        return f"{self._run}-{next(self._count)}"

    def decided(self, call: Call, decision: str, **more: Any) -> bool:
        """Record what was decided about a call; False when it could not be written."""
        record = ("decision", _decision(call, decision, more))
        return self._write(record) if call.moves else self._append([record])

    def outcome(self, call: Call, outcome: str, **more: Any) -> bool:
        """Record what came of a call that ran; False when the log could not be written just before."""
        took = round((time.monotonic() - call.began) * 1000, 2)
        call.answered = True
        record = {"call": call.identity, "tool": call.entry.name, "outcome": outcome, "ms": took, **more}
        if call.moves:
            return self._write(("outcome", record))
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(HELD, self._due)
        self._held.append(("outcome", record))
        return self.problem is None

    def write(self, event: str, **fields: Any) -> bool:
        """Write a record, after those that were kept back; False when it could not be written."""
        return self._write((event, fields))

    def turned_away(self, tool: str, reason: str) -> None:
        """Record an answer to a question that never reached the gate."""
        caller = principal.current()
        self.write(
            "decision",
            tool=tool,
            caller=caller.name,
            transport=caller.transport,
            **client_of(fastmcp_request_ctx.get()).fields(),
            decision="refuse",
            code="replayed",
            text=f"an approval that is not for this call: {reason}",
        )

    def flush(self) -> bool:
        """Write what was kept back."""
        return self._write() if self._held else True

    def _due(self) -> None:
        self._timer = None
        self.flush()

    def _write(self, *records: Record) -> bool:
        """Write records behind those that were kept back."""
        whole, self._held = [*self._held, *records], []
        return self._append(whole)

    def _append(self, records: list[Record]) -> bool:
        try:
            self._audit.write_all(records)
        except AuditFailed as problem:
            if self.problem is None:
                write_line(f"the audit log cannot be written: {problem}")
            self.problem = str(problem)
            return False
        self.problem = None
        return True


def _decision(call: Call, decision: str, more: dict[str, Any]) -> dict[str, Any]:
    policy = call.entry.policy
    if call.noted:
        more["shadow"] = list(call.noted)
    return {
        "call": call.identity,
        "tool": call.entry.name,
        "effect": policy.effect,
        "caller": call.caller.name,
        "transport": call.caller.transport,
        **call.client.fields(),
        "decision": decision,
        "source": policy.source,
        "arguments": call.arguments or call.given,
        **{name: text for name, text in call.asked.items() if text},
        **more,
    }


# The positions that the device reports of its units after a call, held against their ranges.
#
# A limit checks the caller's arguments, and code between the caller and the device can make more of it. So what the
# result of a movement reports is compared too. A result without a unit proves nothing about it: it is neither held
# nor outside.


@dataclass(frozen=True, slots=True)
class Seen:
    """The result's positions of the units that a call moved: ``outside`` by unit, ``unknown`` the others."""

    outside: Mapping[str, str]
    unknown: tuple[str, ...] = ()


def seen(policy: ToolPolicy, arguments: Mapping[str, Any], content: Any) -> Seen:
    """The units with a range in the result of a call."""
    units = policy.units
    if units is None or not policy.places:
        return Seen({})
    moved = units.of_call(arguments)
    fields = {} if units.reports is None else _places(units.reports, content, moved)
    known = {word: unit for unit in moved for word in (unit, *units.names[unit])}
    places = {known[word]: place for word, place in fields.items() if word in known and is_number(place)}
    found: dict[str, str] = {}
    ranged = [limit for limit in policy.places if limit.of in moved]
    for limit in ranged:
        within = units.reports.within if units.reports is not None else 0.0
        if limit.of in places and (text := limit.outside(places[limit.of], within)):
            found[limit.of] = text
    return Seen(found, tuple(limit.of for limit in ranged if limit.of not in places))


def held(call: Call, content: Any, records: Records, ledger: Ledger) -> str:
    """The note for the caller when the device reports a unit outside of its range; else empty.

    From then on the ledger lets nothing move that unit, but in shadow mode.
    """
    name = call.entry.name
    found = seen(call.entry.policy, call.arguments, content)
    if found.unknown:
        records.write("place_unknown", call=call.identity, tool=name, units=list(found.unknown))
    if not found.outside:
        return ""
    records.write("outside", call=call.identity, tool=name, units=dict(found.outside))
    text = "; ".join(beyond_text(name, unit, words) for unit, words in found.outside.items())
    write_line(text)
    if not ledger.hold(name, found.outside):
        return ""
    records.outcome(call, "outside", text=text)
    return f"{name} has moved its device, but {text}"


def _places(reports: Reports, content: Any, moved: frozenset[str]) -> dict[str, Any]:
    """The reported place by the word for its unit; a record that names no unit is of the only one."""
    listed = content.get(reports.records) if reports.records and isinstance(content, Mapping) else [content]
    found: dict[str, Any] = {}
    for record in listed if isinstance(listed, list) else ():
        if not isinstance(record, Mapping):
            continue
        word = str(record.get(reports.unit)) if reports.unit else next(iter(moved)) if len(moved) == 1 else ""
        found[word] = record.get(reports.field)
    return found
