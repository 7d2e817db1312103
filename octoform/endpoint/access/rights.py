"""The devices behind the endpoint's tools, and the nodes of them that its user may not use. Light."""

from collections.abc import Mapping

from octoform.base.files import read_json
from octoform.endpoint.files import CONNECTION
from octoform.state.layout import Layout


def describe(refused: Mapping[str, str]) -> str:
    """One sentence on a node as `octoform.runtime.rights.refused` tells of it, with the command that helps."""
    return (
        f"this user may not {refused['lacks']} {refused['node']} (mode {refused['mode']}, group {refused['group']}): "
        f"{refused['remedy']}"
    )


def served(layout: Layout) -> dict[str, bool]:
    """The devices of the endpoint's tools by id, each with whether a tool acts on it; none without an endpoint."""
    found: dict[str, bool] = {}
    try:
        for tool in read_json(layout.endpoint / CONNECTION)["tools"]:
            for each in tool.get("devices") or ():
                found[str(each)] = found.get(str(each), False) or tool.get("effect") != "read"
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    return dict(sorted(found.items()))
