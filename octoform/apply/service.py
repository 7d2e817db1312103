"""What the accepted artifacts, the manifest and the profiles make of the endpoint: tools, scope, policy."""

from octoform.apply.context import Context
from octoform.apply.reading import accepted
from octoform.endpoint.service import Service


def service_of(context: Context) -> Service:
    """The endpoint as it is to be published."""
    tools = accepted(context, "interface")["tools"]
    described = accepted(context, "identify")["devices"]
    devices = [{"id": item["id"], "name": item["identified_as"], "category": item["category"]} for item in described]
    policy = {
        "format": 1,
        "mode": "enforce",
        "stop": [],
        "tools": {
            tool["name"]: {
                "effect": tool["effect"],
                "decision": "allow",
                "source": "x",
                "timeout": 30.0,
                "result_bytes": 10_000_000,
                "buses": tool["devices"],
                "limits": [],
            }
            for tool in tools
        },
    }
    return Service(tools=tools, policy=policy, devices=devices)
