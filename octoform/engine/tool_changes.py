"""What an apply would change of the endpoint's tools, where that is known: INTERFACE was accepted and is not served."""

from collections.abc import Mapping
from typing import Any

from octoform.endpoint.promise import published
from octoform.plan.model import Change
from octoform.plan.tools import Tool, changes
from octoform.state.layout import Layout


def tool_changes(layout: Layout, artifacts: Mapping[str, Any]) -> tuple[Change, ...]:
    """Tools that are renamed, come or go; none where there is no endpoint or no accepted INTERFACE to compare."""
    offered = published(layout)
    if not offered or "interface" not in artifacts:
        return ()
    before = [Tool(name, frozenset(tool["buses"]), tool["effect"]) for name, tool in offered.items()]
    wanted = artifacts["interface"]["tools"]
    return changes(before, [Tool(tool["name"], frozenset(tool["devices"]), tool["effect"]) for tool in wanted])
