"""``audit``: what was allowed, refused, approved, stopped; ``audit -verify``: whether the log is as it was written."""

import os
from argparse import Namespace
from datetime import UTC, datetime, timedelta
from pathlib import Path

from octoform import durations
from octoform.cli.options import UsageError
from octoform.endpoint.access.audit_log import Wanted
from octoform.engine.safety import check_records, records
from octoform.views.endpoint import logs, safety
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when something was done to the log."""
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
    if text is None:
        return None
    back = durations.seconds(text)
    if back is not None:
        return datetime.now(UTC) - timedelta(seconds=back)
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        hint = "give a duration back from now, like 1h30m, or a time, like 2026-05-04T12:00:00Z"
        raise UsageError(f"-since: {text!r} is neither a duration nor a time; {hint}", "") from None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)
