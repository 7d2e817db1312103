"""``devices`` for a person and for a program: one line a device, and with ``-v`` what lies behind it.

Real serial numbers are shown with ``-v`` only: what is printed without it may be pasted anywhere.
"""

import json
from dataclasses import asdict
from typing import Any

from octoform.base.escaping import escaped_json
from octoform.engine.inspect.devices import LeftOut, Listing, Row
from octoform.views.format.console import Console
from octoform.views.format.values import one_line
from octoform.views.plan_text import counted

_MAX_LENGTH = 4000
_WIDEST_ID = 32
"""A longer id moves its own line alone."""
_BY = {"strong": "by serial", "positional": "by port", "weak": "ambiguous"}
_MEANS = {
    "strong": "its serial number identifies it at any port",
    "positional": "its port identifies it; an equal device in that port would be taken for it",
    "weak": "only its device model identifies it; with two of them attached, nothing is moved",
}


def show(console: Console, found: Listing, *, as_json: bool, verbose: bool) -> int:
    """Every identified device; exit code 0, also when some are absent."""
    if as_json:
        console.raw(escaped_json(json.dumps(_document(found, verbose), ensure_ascii=False, indent=2)))
        return 0
    if not found.ledger:
        console.line("This machine does not know which units it has; `octoform apply` lets PROBE look again.")
    wide = min(_WIDEST_ID, max((len(row.id) for row in found.devices), default=0))
    for row in found.devices:
        _row(console, row, wide, verbose=verbose)
    there = sum(row.now is not None and row.now.attached for row in found.devices)
    attached = f", {there} attached now" if any(row.now is not None for row in found.devices) else ""
    more = "" if verbose else "; -v shows reasons, evidence and serial numbers"
    console.line(f"{counted(len(found.devices), 'device')}{attached}, {len(found.left_out)} skipped{more}")
    if verbose:
        for item in found.left_out:
            console.wrapped("", one_line(_left_out(item), _MAX_LENGTH), indent=4)
    return 0


def _row(console: Console, row: Row, wide: int, *, verbose: bool) -> None:
    tools = counted(len(row.tools), "tool") if row.tools else "no tool"
    tools += ", needs a profile" if row.needs_profile else ""
    what = one_line(f"{row.identified_as} ({row.category}, {tools})", _MAX_LENGTH)
    lead = f"{console.paint(f'{row.id:<{wide}}', 'bold')}  "
    console.wrapped(lead, f"{what}  {_where(console, row)}", indent=wide + 2)
    if not verbose:
        return
    details = [f"serial number: {row.serial}, committed as {row.pseudonym or 'nothing'}"] if row.serial else []
    details += [f"evidence: {quote}" for quote in row.evidence]
    details += [f"missing: {row.missing}"] if row.missing else []
    details += [f"needs a profile: octoform profile new {row.id} drafts one"] if row.needs_profile else []
    details += [f"tools: {', '.join(row.tools)}"] if row.tools else []
    if row.now is not None:
        details += [f"{_BY[row.now.strength]}: {_MEANS[row.now.strength]}"] if row.now.strength in _MEANS else []
        details += [f"note: {row.now.doubt}"] if row.now.doubt else []
        details += [f"no rights: {node['node']}: {node['remedy']}" for node in row.now.refused]
    for line in details:
        console.wrapped("    ", one_line(line, _MAX_LENGTH), indent=8)


def _where(console: Console, row: Row) -> str:
    if row.now is None:
        return console.paint("not known whether attached", "yellow")
    if not row.now.attached:
        return console.paint("absent", "red")
    nodes = f" as {', '.join(row.now.nodes)}" if row.now.nodes else ""
    by = _BY.get(row.now.strength, row.now.strength)
    held = f"{by}, in doubt" if row.now.doubt else by
    held += ", no rights" if row.now.refused else ""
    return one_line(f"at {row.now.port}{nodes} [{held}]", _MAX_LENGTH)


def _left_out(item: LeftOut) -> str:
    return f"skipped: {item.id}: {item.reason.replace('_', ' ')}{f' ({item.detail})' if item.detail else ''}"


def _document(found: Listing, verbose: bool) -> dict[str, Any]:
    devices = []
    for row in found.devices:
        whole = asdict(row)
        if not verbose:
            whole = {name: value for name, value in whole.items() if name not in ("serial", "pseudonym", "evidence")}
        devices.append(whole)
    left = [asdict(item) for item in found.left_out]
    offers = [asdict(item) for item in found.offers]
    fields = {"format": 1, "host": found.host, "ledger": found.ledger}
    return {**fields, "devices": devices, "left_out": left, "offers": offers}
