"""REBIND: write down where a device is now, where that is certain. Light.

The generated server finds its devices at every call, so a device that moved works already; what is written down is what
the next move is compared with. A device that was distinguished only because it was left over, while there is another
one of its kind, is not written down: a guess must not become what is believed. A person decides there.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from octoform.daemon.model import Done
from octoform.daemon.observe.presence import Asked
from octoform.patterns import regex
from octoform.state.artifact_cache import read_instances, write_instances
from octoform.state.layout import Layout
from octoform.state.store.lock import Waiting, acquire

LOCK_SECONDS = 20.0
WEAK = "weak"
_ORDINAL = regex(r"-\d+$")

Where = Callable[[Sequence[str]], Mapping[str, Mapping[str, Any]] | None]
"""Device ids to the runtime's facts of each, as `octoform.runtime.where` reports them; None: it does not answer."""


def rebind(layout: Layout, device: str, where: Where | None = None) -> Done:
    """Write down where a device is; what is in doubt is left as it is."""
    acquired = acquire(layout, "rebind", Waiting(timeout=LOCK_SECONDS))
    if acquired.lock is None:
        return Done(False, acquired.diagnostics[0].summary)
    with acquired.lock:
        return _bound(layout, device, where or Asked(layout, os.environ))


def _bound(layout: Layout, device: str, where: Where) -> Done:
    ledger, _ = read_instances(layout)
    known = (ledger or {}).get(device)
    if ledger is None or not isinstance(known, dict):
        return Done(False, f"{device} is not known on this machine; octoform apply -replace probe", again=False)
    answers = where([device])
    found = (answers or {}).get(device)
    if found is None:
        return Done(False, f"where {device} is cannot be determined now")
    if not found["attached"]:
        return Done(False, f"{device} is not attached")
    if found["doubt"]:
        return Done(False, f"it is left as it was: {found['doubt']}", again=False)
    if found["strength"] == WEAK and (twin := _twin(device, ledger)):
        text = f"{device} is found because it is what is left over beside {twin}, which is equal; not written down"
        return Done(False, f"{text}; octoform apply -replace probe settles it", again=False)
    if (known.get("sysfs"), known.get("port")) == (found["sysfs"], found["port"]):
        return Done(True, f"{device} is where it was written down: {found['port']}")
    problems = write_instances(layout, {**ledger, device: {**known, "sysfs": found["sysfs"], "port": found["port"]}})
    if problems:
        return Done(False, problems[0].summary)
    return Done(True, f"{device} is at {found['port']} now ({found['strength']} identity)")


def _twin(device: str, ledger: Mapping[str, object]) -> str | None:
    """Another id of the same kind."""
    kinds = {_ORDINAL.sub("", device), device}
    return next(
        (other for other in sorted(ledger) if other != device and {_ORDINAL.sub("", other), other} & kinds), None
    )
