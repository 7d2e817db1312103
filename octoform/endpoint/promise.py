"""Which tools the endpoint should show: those of INTERFACE without what the policy denies. Light."""

from collections.abc import Mapping
from typing import Any

from octoform.endpoint.files import POLICY
from octoform.state.layout import Layout
from octoform.state.reading import json_of


def promised(layout: Layout) -> dict[str, Any]:
    """The tools of the INTERFACE artifact by name; none when it can be read no more, which the plan tells."""
    try:
        return {tool["name"]: tool for tool in json_of(layout.output("interface"))["tools"]}
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def published(layout: Layout) -> dict[str, Mapping[str, Any]]:
    """The tools of the endpoint as it was last made, by name, each with ``effect`` and ``buses``; none without one."""
    try:
        tools = json_of(layout.endpoint / POLICY)["tools"]
        return {name: {"effect": str(tool["effect"]), "buses": list(tool["buses"])} for name, tool in tools.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def hidden(layout: Layout) -> frozenset[str]:
    """The tools that the published policy denies, which no client is shown; none where it only watches.

    A policy that cannot be read hides nothing here: the endpoint does not start with it, and a plan tells.
    """
    try:
        return denied(json_of(layout.endpoint / POLICY))
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return frozenset()


def shown(layout: Layout, interface: Mapping[str, Any]) -> dict[str, Any]:
    """An INTERFACE artifact without the tools that no client is shown."""
    unseen = hidden(layout)
    return {**interface, "tools": [tool for tool in interface["tools"] if tool["name"] not in unseen]}


def denied(policy: Mapping[str, Any]) -> frozenset[str]:
    """The tools that a resolved policy keeps from everybody; none where it only watches."""
    if policy["mode"] == "shadow":
        return frozenset()
    return frozenset(name for name, tool in policy["tools"].items() if tool["decision"] == "deny")
