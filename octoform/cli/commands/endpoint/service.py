"""``service install|uninstall``: let systemd run the endpoint and its daemon. Never as another user."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine import endpoint_process as engine
from octoform.views.endpoint import process as view
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """With ``-user`` show the units and do it, after a yes; with ``-print`` show those for the whole machine."""
    if not arguments.user and not arguments.print:
        return problems.show(screen, [view.for_whom(arguments.verb)])
    unit, found = engine.unit_of(project, os.environ, own=arguments.user)
    if unit is None:
        return problems.show(screen, found)
    if arguments.verb == "install":
        return _install(arguments, screen, unit)
    return _uninstall(arguments, screen, unit)


def _install(arguments: Namespace, screen: Console, unit: engine.Unit) -> int:
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
