"""Where the device says its units are after a call, held against their ranges.

A limit looks at what a caller says, and code between the caller and the device can make more of it. So what the result
of a movement reports is compared too. A result that says nothing of a unit proves nothing: it is neither held nor
outside.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .calls import Call, Records
from .limits import Ledger, beyond_words, is_number, outside
from .policy import ToolPolicy
from .saying import say
from .units import Reports


@dataclass(frozen=True, slots=True)
class Seen:
    """What a result says of the units that a call moved: ``outside`` in words by unit, ``unknown`` are the others."""

    outside: Mapping[str, str]
    unknown: tuple[str, ...] = ()


def seen(policy: ToolPolicy, arguments: Mapping[str, Any], content: Any) -> Seen:
    """What stands in a result of a call, of those units that have a range."""
    units = policy.units
    if units is None or not policy.places:
        return Seen({})
    moved = units.of_call(arguments)
    told = {} if units.reports is None else _places(units.reports, content, moved)
    known = {word: unit for unit in moved for word in (unit, *units.names[unit])}
    places = {known[word]: place for word, place in told.items() if word in known and is_number(place)}
    found: dict[str, str] = {}
    ranged = [limit for limit in policy.places if limit.of in moved]
    for limit in ranged:
        within = units.reports.within if units.reports is not None else 0.0
        if limit.of in places and (text := outside(limit, places[limit.of], within)):
            found[limit.of] = text
    return Seen(found, tuple(limit.of for limit in ranged if limit.of not in places))


def held(call: Call, content: Any, records: Records, ledger: Ledger) -> str:
    """What the caller hears where the device reports a unit outside of its range; empty where it does not.

    From then on the ledger lets nothing move that unit, but in shadow mode.
    """
    name = call.entry.name
    found = seen(call.entry.policy, call.arguments, content)
    if found.unknown:
        records.write("place_unknown", call=call.identity, tool=name, units=list(found.unknown))
    if not found.outside:
        return ""
    records.write("outside", call=call.identity, tool=name, units=dict(found.outside))
    text = "; ".join(beyond_words(name, unit, words) for unit, words in found.outside.items())
    say(text)
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
