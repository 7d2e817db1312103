"""``token create|list|show|rotate|revoke``: who may reach the endpoint over the network."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.parser import seconds
from octoform.engine import safety
from octoform.views.endpoint import safety as view
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the verbs."""
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
