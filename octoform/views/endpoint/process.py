"""Views of start, stop and restart."""

import json
from dataclasses import asdict

from octoform.engine.endpoint_process import Started, Stopped
from octoform.views.format.console import Console

_STAYS = "  it stays stopped until octoform start or apply; other clients are refused"


def started(console: Console, done: Started, *, as_json: bool) -> int:
    """Which process serves the endpoint now."""
    process = done.process
    if as_json:
        console.raw(json.dumps({"format": 1, "host": done.host, "running": True, **asdict(process)}))
        return 0
    where = f" at {process.url}" if process.url else ""
    if done.before == process:
        console.line(f"{done.host}: the endpoint runs already{where} (process {process.pid}, since {process.since})")
    else:
        console.line(f"{done.host}: the endpoint runs{where} (process {process.pid})")
    return 0


def stopped(console: Console, done: Stopped, *, as_json: bool) -> int:
    """What was ended."""
    pid = done.process.pid if done.process else None
    if as_json:
        document = {"format": 1, "host": done.host, "running": False, "pid": pid, "firmly": done.firmly}
        console.raw(json.dumps(document))
    elif pid is None:
        console.line(f"{done.host}: the endpoint was not running")
        console.line(_STAYS)
    else:
        how = " firmly, because it did not end by itself" if done.firmly else ""
        console.line(f"{done.host}: the endpoint was stopped{how} (process {pid})")
        console.line(_STAYS)
    return 0
