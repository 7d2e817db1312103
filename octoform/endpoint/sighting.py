"""Keep what was just seen of the live endpoint, so that the next plan knows of it.

A plan starts nothing, so it can only tell a dead endpoint from a live one by what was seen last. Whoever asks the
endpoint therefore leaves word when it is other than the last check found it: a plan that still said "no changes"
after a person was told that the endpoint is down would lead nowhere.
"""

import json
from datetime import UTC, datetime

from octoform.endpoint.environment import Environment
from octoform.endpoint.errand import Report, recorded_environment
from octoform.endpoint.files import CHECK
from octoform.state.files import write_atomic
from octoform.state.layout import Layout


def record_sight(layout: Layout, environment: Environment, report: Report) -> None:
    """Bring the record of the last check up to date where ``report`` differs from it; the trial calls stay.

    ``environment`` is the one that was asked: when another is published meanwhile, its own check is the newer word.
    A record that cannot be written changes nothing for the person who asked, so that is no problem of theirs.
    """
    path = layout.endpoint / CHECK
    names = sorted(str(tool["name"]) for tool in report.tools)
    try:
        known = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return  # never checked: a plan says so already
    if not isinstance(known, dict) or recorded_environment(layout) != environment:
        return
    seen = {"answered": report.answered, "error": report.error, "tools": names if report.answered else []}
    if {key: known.get(key) for key in ("answered", "tools")} == {key: seen[key] for key in ("answered", "tools")}:
        return
    document = {**known, **seen, "at": datetime.now(UTC).isoformat(timespec="seconds")}
    write_atomic(path, (json.dumps(document, indent=2) + "\n").encode(), 0o600)
