"""``episodes``: what went wrong, how often, and how long it took."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.daemon.store.incidents import read
from octoform.daemon.store.json_store import Shelf
from octoform.engine.tools import layout_of
from octoform.views.daemon import event_log as view
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0, whatever went wrong."""
    text = arguments.n
    if not text.isascii() or not text.isdigit():
        raise UsageError(f"-n: {text!r} is not a number of episodes", "usage: octoform episodes [-n COUNT] [-json]")
    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    shelf = Shelf(layout)
    episodes = read(shelf) if layout.daemon.is_dir() else []
    return view.listed(screen, episodes, shelf.said, int(text), as_json=arguments.json)
