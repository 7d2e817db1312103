"""One look at a deployment: only as far as the causes make it worth while, and never more than that. (Light.)

Each part of the facts has its own sense in `octoform.daemon.observe`, which keeps what it needs from look to look. What
is not looked at is as it was at the last look; of the logs only what is new is reported, and that once.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from octoform.base import files
from octoform.base.escaping import escaped
from octoform.daemon.model import Cause, Clock, Facts
from octoform.daemon.observe.altered_files import Standing
from octoform.daemon.observe.log_events import Hearing
from octoform.daemon.observe.presence import Presence
from octoform.daemon.observe.process import Answering
from octoform.endpoint.expected_tools import published
from octoform.endpoint.process import record
from octoform.endpoint.process.estop import is_engaged
from octoform.endpoint.process.record import Running, running
from octoform.endpoint.published_files import read_manifest
from octoform.manifest.model import FILE_NAME
from octoform.state.files import read_regular, write_atomic
from octoform.state.layout import STEP, Layout
from octoform.state.store.lock import Holder, is_dead, read_holder
from octoform.state.store.quick_read import peek

FULL = frozenset((Cause.START, Cause.INTERVAL, Cause.RESUMED, Cause.ASKED, Cause.RETRY))
STANDING = FULL | {Cause.FILES, Cause.PROCESS}
PRESENCE = FULL | {Cause.HARDWARE, Cause.FILES}
LOGS = FULL | {Cause.LOG, Cause.PROCESS}
ANSWERS = FULL | {Cause.PING, Cause.PROCESS, Cause.FILES}
PLACES = "cursors.json"
_LIMIT = 64 * 1024
_MAX_CHARACTERS = 200


@dataclass(slots=True)
class Senses:
    """The observers of each part; tests may replace them."""

    answering: Answering
    standing: Standing
    presence: Presence
    hearing: Hearing


class Looker:
    """The look of one deployment.

    ``start_failed`` is the message of the last start when it failed; the starter sets it, and None after a success.
    ``manifest`` is why the manifest as it stands cannot be read; its reader sets that.
    """

    def __init__(self, layout: Layout, clock: Clock, senses: Senses, *, traceless: bool = False) -> None:
        """A ``traceless`` look writes nothing down: what it read of the logs is still new to the next daemon."""
        self._traceless = traceless
        self._layout = layout
        self._clock = clock
        self._senses = senses
        self._last: Facts | None = None
        self._written: dict[str, Any] = {}
        self.start_failed: str | None = None
        self.manifest: str | None = None

    def __call__(self, causes: frozenset[Cause]) -> Facts:
        """The facts now; never raises for what the world does."""
        layout = self._layout
        before = self._last or Facts(0.0, "", layout.host)
        if self._last is None:
            causes |= {Cause.START}
        process = running(layout)
        changed = _instance(process) != _instance(before.process)
        causes |= {Cause.PROCESS} if changed else frozenset()
        holder = busy(layout)
        applied = read_manifest(layout) is not None
        facts = replace(
            before,
            applied=applied,
            destroyed=not applied and _destroyed(layout),
            busy=holder,
            stopped_by=stop.by if (stop := record.read(layout)) is not None else None,
            process=process,
            latched=is_engaged(layout),
            unproved=_unproved(layout) if causes & STANDING else before.unproved,
            offered=frozenset(published(layout)) if causes & (STANDING | LOGS) else before.offered,
            disk_free=_free(layout),
            start_failed=self.start_failed if process is None else None,
            put_off=frozenset(),
        )
        facts = self._standing(facts, causes, after_work=before.busy is not None and holder is None)
        damaged = {path: how for path, how in facts.damaged.items() if path != FILE_NAME}
        facts = replace(facts, damaged={**damaged, FILE_NAME: self.manifest} if self.manifest else damaged)
        facts = self._answers(facts, causes)
        facts = self._log(facts, causes, changed=changed)
        # Last, so that nothing is recorded as seen before it was.
        facts = replace(facts, uptime=self._clock.uptime(), stamp=self._clock.stamp())
        if causes & {Cause.START, Cause.INTERVAL}:
            self.remember()
        self._last = facts
        return facts

    def remember(self) -> None:
        """Write down how far the logs were read, so that a restart neither misses nor repeats a line."""
        places = self._senses.hearing.places
        if not self._traceless and places != self._written and self._layout.daemon.is_dir():
            document = json.dumps({"format": 1, **places}).encode() + b"\n"
            if write_atomic(self._layout.daemon / PLACES, document, 0o600) is None:
                self._written = places

    def _standing(self, facts: Facts, causes: frozenset[Cause], *, after_work: bool) -> Facts:
        """Files and hardware; both are left alone while somebody changes them."""
        if facts.busy is not None:
            return facts
        if causes & STANDING or after_work:
            stands = self._senses.standing()
            facts = replace(
                facts, endpoint=stands.endpoint, environment=stands.environment, damaged=dict(stands.damaged)
            )
        if causes & PRESENCE or after_work:
            again = bool(causes & {Cause.START, Cause.HARDWARE, Cause.RESUMED})
            # A look without repairs starts no process, and so waits for none.
            seen = self._senses.presence(again=again, process=None if self._traceless else facts.process)
            if seen is None:
                return replace(facts, put_off=causes & PRESENCE or frozenset((Cause.FILES,)))
            facts = replace(facts, appeared=seen.appeared, gone=seen.gone, devices=dict(seen.devices))
        return facts

    def _answers(self, facts: Facts, causes: frozenset[Cause]) -> Facts:
        if facts.process is None:
            return replace(facts, answers=None, reported=None)
        if not causes & ANSWERS or facts.put_off:
            return facts
        answers, found = self._senses.answering(facts.process)
        if answers is not True and running(self._layout) is None:  # it ended while it was asked
            put_off = frozenset() if self._traceless else causes - {Cause.PROCESS}
            return replace(
                facts, process=facts.process if put_off else None, answers=None, reported=None, put_off=put_off
            )
        return replace(facts, answers=answers, reported=found)

    def _log(self, facts: Facts, causes: frozenset[Cause], *, changed: bool) -> Facts:
        hearing = self._senses.hearing
        heard = hearing(again=bool(causes & LOGS)) if facts.busy is None else hearing.successes()
        if changed:
            hearing.forget()
        sizes = _sizes(self._layout) if causes & LOGS else facts.log_bytes
        return replace(
            facts, failures=heard.failures, worked=heard.worked, printed=heard.printed, log_bytes=dict(sizes)
        )


def open_look(layout: Layout, environ: Mapping[str, str], clock: Clock, *, traceless: bool = False) -> Looker:
    """The look of a deployment, which goes on in the logs where the last daemon was."""
    places = _places(layout)
    senses = Senses(
        Answering(layout, clock.uptime),
        Standing(layout),
        Presence(layout, environ),
        Hearing(layout, clock.uptime, places),
    )
    return Looker(layout, clock, senses, traceless=traceless)


def _places(layout: Layout) -> Mapping[str, Any]:
    """Where the last daemon was; a file that shows nothing is as good as none, and written again."""
    data, _ = read_regular(layout.daemon / PLACES, _LIMIT)
    try:
        return files.record(files.parse(data or b""), 1)
    except ValueError:
        return {}


def _instance(process: Running | None) -> str | None:
    return process.instance if process is not None else None


def busy(layout: Layout) -> str | None:
    """The operation of a live holder of the state's lock."""
    holder = read_holder(layout)
    if not isinstance(holder, Holder):
        return None
    try:
        if is_dead(layout, holder):
            return None
    except FileNotFoundError:  # it was given back in this moment
        return None
    except OSError:
        pass  # a process that cannot be identified counts as alive
    return escaped(holder.operation[:_MAX_CHARACTERS])


def _destroyed(layout: Layout) -> bool:
    """True when the state knows of no endpoint either; a state that cannot be read now knows of one."""
    state = peek(layout)
    return "endpoint" not in state["nodes"] if state is not None else not os.path.lexists(layout.snapshot)


def _unproved(layout: Layout) -> tuple[str, ...]:
    """The steps that the state calls failed; none while the state cannot be read, which is a problem of its own."""
    nodes = (peek(layout) or {}).get("nodes", {})
    return tuple(
        name for name, node in sorted(nodes.items()) if name.startswith(STEP) and node.get("status") == "failed"
    )


def _free(layout: Layout) -> int | None:
    try:
        found = os.statvfs(layout.local)
    except OSError:
        return None
    return found.f_bavail * found.f_frsize


def _sizes(layout: Layout) -> dict[str, int]:
    """Every file in the folder of logs, by name."""
    try:
        with os.scandir(layout.logs) as entries:
            return {each.name: each.stat(follow_symlinks=False).st_size for each in entries if each.is_file()}
    except OSError:
        return {}
