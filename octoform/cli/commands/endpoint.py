"""Commands on the process of the endpoint: start, stop, logs, systemd units, clients.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.cli.dispatch import Stopped
from octoform.cli.parser import UsageError
from octoform.diagnostics import has_errors
from octoform.views.format import problems
from octoform.views.format.console import Console

if TYPE_CHECKING:
    from octoform.endpoint.logs import Logs
    from octoform.engine import endpoint_process as engine


def run_start(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when the endpoint runs, no matter who started it."""
    from octoform.engine.endpoint_process import start
    from octoform.views.endpoint import process

    done, found = start(project, os.environ)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    return process.started(screen, done, as_json=arguments.json)


def run_stop(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when no process of the endpoint is left, and nothing starts another."""
    from octoform.engine.endpoint_process import stop
    from octoform.views.endpoint import process

    done, found = stop(project, os.environ, arguments.host)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    held = not has_errors(found)
    problems.show(screen, found)
    process.stopped(screen, done, stays=held, as_json=arguments.json)
    return 0 if held else 1


def run_restart(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when the endpoint runs again."""
    from octoform.engine.endpoint_process import restart
    from octoform.views.endpoint import process

    done, found = restart(project, os.environ)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    return process.started(screen, done, as_json=arguments.json)


def run_logs(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0; with ``-f`` that of the signal which ended it, since nothing else does."""
    from octoform.engine.inspect.state import open_logs

    count = _count(arguments.n)
    logs, found = open_logs(project, os.environ)
    if logs is None:
        return problems.show(screen, found, as_json=arguments.json)
    try:
        show = _objects if arguments.json else _sentences
        show(logs, screen, count, arguments.follow)
    except Stopped as stopped:
        return 128 + stopped.number
    except KeyboardInterrupt:
        return 130
    finally:
        logs.close()
    return 0


def _sentences(logs: Logs, screen: Console, count: int, follow: bool) -> None:
    from octoform.engine.inspect.state import entries, following
    from octoform.views.endpoint import logs as view

    known, pairing = entries(logs)
    view.human(screen, known[max(0, len(known) - count) :])
    if not known and not follow:
        view.nothing(screen)
    if follow:
        for new in following(logs, pairing, view.Reader(screen).waits):
            view.human(screen, new)


def _objects(logs: Logs, screen: Console, count: int, follow: bool) -> None:
    from octoform.engine.inspect.state import lines
    from octoform.views.endpoint import logs as view

    known = logs.read()
    view.machine(screen, known[max(0, len(known) - count) :])
    if follow:
        for new in lines(logs, view.Reader(screen).waits):
            view.machine(screen, new)


def _count(text: str) -> int:
    if not text.isascii() or not text.isdigit():
        raise UsageError(f"-n: {text!r} is not a number of lines", "usage: octoform logs [-f] [-n LINES] [-json]")
    return int(text)


def run_service(arguments: Namespace, project: Path, screen: Console) -> int:
    """With ``-user`` show the units and do it, after a yes; with ``-print`` show those for the whole machine."""
    from octoform.engine import endpoint_process as engine
    from octoform.views.endpoint import process as view

    if not arguments.user and not arguments.print:
        return problems.show(screen, [view.for_whom(arguments.verb)])
    unit, found = engine.unit_of(project, os.environ, own=arguments.user)
    if unit is None:
        return problems.show(screen, found)
    if arguments.verb == "install":
        return _install(arguments, screen, unit)
    return _uninstall(arguments, screen, unit)


def _install(arguments: Namespace, screen: Console, unit: engine.Unit) -> int:
    from octoform.engine import endpoint_process as engine
    from octoform.views.endpoint import process as view

    if problem := engine.missing(unit):
        return problems.show(screen, [problem])
    view.unit(screen, unit)
    if not unit.own:
        return view.machine_wide(screen, unit)
    if problem := engine.obstacle(unit):
        return problems.show(screen, [problem])
    if not arguments.auto_approve and not view.approves(
        screen, "Write these units and run the endpoint and its daemon with them?"
    ):
        return problems.show(screen, [view.not_approved()])
    process, found = engine.install(unit)
    if process is None:
        return problems.show(screen, found)
    return view.installed(screen, unit, process)


def _uninstall(arguments: Namespace, screen: Console, unit: engine.Unit) -> int:
    from octoform.engine import endpoint_process as engine
    from octoform.views.endpoint import process as view

    if not unit.own:
        return view.no_machine_wide(screen, unit)
    if not unit.path.exists() and not unit.watch.path.exists():
        return view.uninstalled(screen, unit, was=False)
    if problem := engine.obstacle(unit):
        return problems.show(screen, [problem])
    question = f"Stop the endpoint and its daemon, and remove {unit.path} and {unit.watch.path}?"
    if not arguments.auto_approve and not view.approves(screen, question):
        return problems.show(screen, [view.not_approved()])
    was, found = engine.uninstall(unit)
    return problems.show(screen, found) or view.uninstalled(screen, unit, was=was)


def run_connect(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when the client closed the connection, 1 when the endpoint did or never came up."""
    from octoform.endpoint.dial import connect

    if arguments.print is not None:
        return printed(arguments, project, screen)
    problem = connect(project, arguments.host, revive=arguments.start)
    if problem is None:
        return 0
    # Standard output belongs to the protocol.
    print(f"octoform: {problem}", file=sys.stderr)
    return 1


def run_clients(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when a file was left alone."""
    from octoform.engine import clients as engine
    from octoform.views.endpoint import process

    if arguments.verb == "list":
        listing, found = engine.listed(project, os.environ)
        if listing is None:
            return problems.show(screen, found, as_json=arguments.json)
        return process.listing(screen, listing, found, as_json=arguments.json)
    if arguments.verb == "install":
        outcome, found = engine.install(project, os.environ, arguments.client, _transport(arguments))
    else:
        outcome, found = engine.remove(project, os.environ, arguments.client)
    if outcome is None:
        return problems.show(screen, found, as_json=arguments.json)
    return process.outcome(screen, outcome, found, as_json=arguments.json)


def printed(arguments: Namespace, project: Path, screen: Console) -> int:
    """``connect -print CLIENT``: the text alone on standard output, what to know on standard error."""
    from octoform.engine import clients as engine
    from octoform.views.endpoint import process

    given, host, transport = arguments.print, arguments.host, _transport(arguments)
    text, found = engine.printed(project, os.environ, given, host, transport)
    if text is None:
        return problems.show(screen, found)
    problems.show(screen, found)
    return process.printed(screen, text)


def _transport(arguments: Namespace) -> str | None:
    from octoform.engine import clients as engine

    if arguments.transport not in (None, *engine.TRANSPORTS):
        raise UsageError(f"-transport: {arguments.transport!r} is neither {' nor '.join(engine.TRANSPORTS)}", "")
    kind: str | None = arguments.transport
    return kind
