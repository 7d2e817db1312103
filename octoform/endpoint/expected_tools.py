"""Which tools the endpoint should show: those of INTERFACE without what the policy denies. Light."""

from collections.abc import Mapping
from typing import Any

from octoform.base.files import read_json
from octoform.base.shape import fits
from octoform.endpoint.published_files import read_policy
from octoform.policy.resolve import LINE
from octoform.state.layout import Layout


def promised(layout: Layout) -> dict[str, Any]:
    """The tools of the INTERFACE artifact by name; none when it cannot be read, which the plan reports."""
    try:
        interface = read_json(layout.output("interface"), any_text=True)
    except (OSError, ValueError):
        return {}
    return {tool["name"]: tool for tool in interface["tools"]} if fits(interface, {"tools": [{"name": str}]}) else {}


def published(layout: Layout) -> dict[str, Mapping[str, Any]]:
    """The tools of the endpoint as it was last made, by name, each with ``effect`` and ``buses``; none without one."""
    tools = (read_policy(layout) or {"tools": {}})["tools"]
    return {name: {"effect": tool["effect"], "buses": tool.get("buses") or []} for name, tool in tools.items()}


def hidden(layout: Layout) -> frozenset[str]:
    """The tools that the published policy denies, which no client is shown; none where it only watches.

    A policy that cannot be read hides nothing here: the endpoint does not start with it, and a plan reports it.
    """
    policy = read_policy(layout)
    return frozenset() if policy is None else denied(policy)


def untried(layout: Layout) -> frozenset[str]:
    """The tools that nothing calls without a person: they write to a line of which no one states what is at its end."""
    tools = (read_policy(layout) or {"tools": {}})["tools"]
    return frozenset(name for name, tool in tools.items() if tool.get("source") == LINE)


def display(layout: Layout, interface: Mapping[str, Any]) -> dict[str, Any]:
    """An INTERFACE artifact without the tools that no client is shown."""
    unseen = hidden(layout)
    return {**interface, "tools": [tool for tool in interface["tools"] if tool["name"] not in unseen]}


def denied(policy: Mapping[str, Any]) -> frozenset[str]:
    """The tools that a resolved policy keeps from everybody; none where it only watches."""
    if policy.get("mode") == "shadow":
        return frozenset()
    return frozenset(name for name, tool in policy["tools"].items() if tool.get("decision") == "deny")
