"""Commands on who may do what: tokens, the tunnel, the emergency stop, the audit log, limits.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.base import durations
from octoform.base.clock import parse_stamp
from octoform.cli.parser import UsageError, seconds
from octoform.views.format import problems
from octoform.views.format.console import Console

if TYPE_CHECKING:
    from datetime import datetime


def run_token(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the verbs."""
    from octoform.engine import safety
    from octoform.views.endpoint import safety as view

    as_json = arguments.json
    if arguments.verb == "list":
        tokens, found = safety.list_tokens(project, os.environ)
        if tokens is None:
            return problems.show(screen, found, as_json=as_json)
        return view.listed(screen, tokens, as_json=as_json)
    name = arguments.name
    if arguments.verb == "show":
        shown, found = safety.show_token(project, os.environ, name)
        if shown is None:
            return problems.show(screen, found, as_json=as_json)
        return view.value(screen, name, shown, as_json=as_json)
    if arguments.verb == "revoke":
        found = safety.revoke_token(project, os.environ, name)
        return problems.show(screen, found, as_json=as_json) if found else view.ended(screen, name, as_json=as_json)
    made, found = (
        safety.rotate_token(project, os.environ, name)
        if arguments.verb == "rotate"
        else safety.create_token(project, os.environ, name, _effects(arguments), _expires(arguments))
    )
    if made is None:
        return problems.show(screen, found, as_json=as_json)
    return view.made(screen, made, rotated=arguments.verb == "rotate", as_json=as_json)


def _effects(arguments: Namespace) -> list[str]:
    return [word.strip() for word in arguments.effects.split(",") if word.strip()]


def _expires(arguments: Namespace) -> float | None:
    return None if arguments.expires is None else seconds(arguments.expires)


def run_revoke(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 only when it is proved."""
    from octoform.engine.safety import revoke_tunnel
    from octoform.views.endpoint import safety

    done, found = revoke_tunnel(project, os.environ)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    return safety.revoked(screen, done, as_json=arguments.json)


def run_estop(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 only when it is engaged and every stop action was done; with -clear, when it is open."""
    from octoform.engine.safety import clear, stop
    from octoform.views.endpoint import safety

    done, found = clear(project) if arguments.clear else stop(project, arguments.reason or "")
    if not done:
        return problems.show(screen, found, as_json=arguments.json)
    if arguments.clear:
        return safety.cleared(screen, done, found, as_json=arguments.json)
    return safety.stopped(screen, done, found, as_json=arguments.json)


def run_audit(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when something was done to the log."""
    from octoform.endpoint.access.audit_log import Wanted
    from octoform.engine.safety import check_records, records
    from octoform.views.endpoint import logs, safety

    if arguments.verify:
        checked, found = check_records(project, os.environ)
        if checked is None:
            return problems.show(screen, found, as_json=arguments.json)
        return safety.checked(screen, checked, found, as_json=arguments.json)
    if not arguments.n.isascii() or not arguments.n.isdigit():
        raise UsageError(f"-n: {arguments.n!r} is no number of lines", "")
    count = int(arguments.n)
    wanted = Wanted(arguments.tool, arguments.client, _moment(arguments.since), arguments.refused)
    latest, found = records(project, os.environ, count, wanted)
    if latest is None:
        return problems.show(screen, found, as_json=arguments.json)
    return logs.records(screen, latest, count, as_json=arguments.json, filtered=wanted != Wanted())


def _moment(text: str | None) -> datetime | None:
    """A moment in UTC; UsageError for what is neither a duration nor a time."""
    from datetime import UTC, datetime, timedelta

    if text is None:
        return None
    back = durations.seconds(text)
    if back is not None:
        return datetime.now(UTC) - timedelta(seconds=back)
    moment = parse_stamp(text)
    if moment is None:
        hint = "give a duration back from now, like 1h30m, or a time, like 2026-05-04T12:00:00Z"
        raise UsageError(f"-since: {text!r} is neither a duration nor a time; {hint}", "")
    return moment


def run_limits(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when a limit's counters are damaged, or a device is outside of a range."""
    from octoform.engine.safety import limits, reset_limits
    from octoform.views.endpoint import safety

    if arguments.reset is not None:
        found = reset_limits(project, os.environ, arguments.reset)
        if found:
            return problems.show(screen, found, as_json=arguments.json)
        return safety.reset(screen, arguments.reset, as_json=arguments.json)
    listed, found = limits(project, os.environ)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return safety.limits(screen, listed, as_json=arguments.json)
