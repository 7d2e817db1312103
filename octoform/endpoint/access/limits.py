"""The limits of the published policy and what is used of them, and setting them back. Light."""

from collections.abc import Mapping
from typing import Any

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.endpoint.process import offline_commands, record
from octoform.endpoint.published_files import read_policy
from octoform.records import dataclass
from octoform.state.layout import Layout

SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class Limited:
    """A tool with its limits as the policy has them, and what was counted: ``sums`` and ``last`` by parameter,
    ``calls`` as ages in seconds. ``damaged``: what was counted is lost, and the tool is refused."""

    tool: str
    effect: str
    decision: str
    source: str
    limits: tuple[Mapping[str, Any], ...]
    sums: Mapping[str, float]
    last: Mapping[str, float]
    calls: tuple[float, ...]
    damaged: bool
    outside: Mapping[str, str]
    """Units that the device reported outside of their range after a call of it, which nothing moves any more."""
    unreported: bool
    """The ranges of its units are held against its callers' words alone: its results do not say where they are."""


@dataclass(frozen=True, slots=True)
class Limits:
    """All tools of a host's policy by name; ``mode`` is enforce, shadow or dry_run."""

    host: str
    mode: str
    tools: tuple[Limited, ...]


def show(layout: Layout) -> tuple[Limits | None, list[Diagnostic]]:
    """The limits now; asks the process, or reads what it left."""
    policy = read_policy(layout)
    if policy is None:
        return None, [_not_applied(layout)]
    answer = record.ask(layout, {"op": "limits"}, SECONDS)
    if answer is None or "used" not in answer:
        answer = offline_commands.ask(layout, "limits", {})
    if "used" not in answer:
        return None, [_refused(answer)]
    tools = tuple(_limited(name, tool, answer["used"].get(name, {})) for name, tool in sorted(policy["tools"].items()))
    return Limits(layout.host, str(policy["mode"]), tools), []


def reset(layout: Layout, tool: str, by: str) -> list[Diagnostic]:
    """Forget what was counted for a tool; ``all`` is every tool."""
    policy = read_policy(layout)
    if policy is None:
        return [_not_applied(layout)]
    if tool != "all" and tool not in policy["tools"]:
        near = did_you_mean(tool, policy["tools"])
        hint = f"did you mean {near!r}?" if near else "octoform limits lists the tools; `all` sets all of them back"
        return [error("ENDPOINT-UNKNOWN-TOOL", f"the endpoint has no tool {tool!r}", hint=hint)]
    asked = {"tool": None if tool == "all" else tool, "by": by}
    answer = record.ask(layout, {"op": "limits_reset", **asked}, SECONDS)
    if answer is None:
        answer = offline_commands.ask(layout, "reset", asked)
        return [] if answer["ok"] else [_refused(answer)]
    return [] if "error" not in answer else [_refused({"problems": [answer["error"]]})]


def _limited(name: str, tool: Mapping[str, Any], used: Mapping[str, Any]) -> Limited:
    return Limited(
        tool=name,
        effect=str(tool["effect"]),
        decision=str(tool.get("decision")),
        source=str(tool["source"]),
        limits=tuple(tool.get("limits") or ()),
        sums=used.get("sums", {}),
        last=used.get("last", {}),
        calls=tuple(used.get("calls", ())),
        damaged=bool(used.get("damaged")),
        outside=used.get("outside", {}),
        unreported=bool(tool.get("places")) and "reports" not in tool["units"],
    )


def _not_applied(layout: Layout) -> Diagnostic:
    return error("ENDPOINT-NOT-APPLIED", f"{layout.host} has no endpoint yet", hint="octoform apply makes one")


def _refused(answer: Mapping[str, Any]) -> Diagnostic:
    return error("LIMITS-UNREADABLE", "; ".join(str(text) for text in answer["problems"]))
