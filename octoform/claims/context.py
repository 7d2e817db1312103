"""What the ledger has to know of a deployment, gathered from what octoform itself wrote and what profiles say. Light.

Tools come from the accepted interface and the published policy. Profiles are prose with front matter, too heavy for
the daemon: what they call clean is made into plain values once (`bounds_told`, in the daemon's child) and comes back
from there (`bounds_of`).
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from octoform.base.files import read_json
from octoform.claims.settings import Bound, Settings, ToolFacts
from octoform.conditions import is_number
from octoform.endpoint.files import POLICY, read_policy
from octoform.endpoint.publish.expected_tools import promised
from octoform.state.layout import Layout


class Protects(Protocol):
    """A field that no unit may exceed: it is moved no more from ``refuse_at`` on, and again below ``resume_below``."""

    @property
    def field(self) -> str:
        """The name of the field in a tool's result."""

    @property
    def refuse_at(self) -> float:
        """Where trouble begins."""

    @property
    def resume_below(self) -> float:
        """Where it is over."""


def settings_of(layout: Layout, claim_seconds: float, bounds: Iterable[Mapping[str, Any]] = ()) -> Settings:
    """The ledger's settings for a host; ``bounds`` as `bounds_told` gave them. Its tools are those of each moment."""
    return Settings(claim_seconds=claim_seconds, tools=ServedTools(layout), bounds=bounds_of(bounds))


class ServedTools(Mapping[str, ToolFacts]):
    """`tools_of` a host, read again once the endpoint was published anew."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._seen: tuple[tuple[int, int, int] | None, ...] = ()
        self._tools: dict[str, ToolFacts] = {}

    def _now(self) -> dict[str, ToolFacts]:
        seen = _stamp(self._layout.endpoint / POLICY), _stamp(self._layout.output("interface"))
        if seen != self._seen:
            self._seen, self._tools = seen, tools_of(self._layout)
        return self._tools

    def __getitem__(self, name: str) -> ToolFacts:
        return self._now()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._now())

    def __len__(self) -> int:
        return len(self._now())


def tools_of(layout: Layout) -> dict[str, ToolFacts]:
    """The tools that the endpoint serves, by name; none where interface or policy cannot be read."""
    try:
        policies = (read_policy(layout) or {"tools": {}})["tools"]
        return {
            name: _facts(tool, policies[name])
            for name, tool in promised(layout).items()
            if isinstance(policies.get(name), Mapping)
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def bounds_told(layout: Layout, protects: Iterable[tuple[str, Protects]]) -> list[dict[str, Any]]:
    """What profiles (name, what protects its units) call clean, as plain values, for the tools of their devices."""
    found = []
    for name, each in protects:
        devices = _devices(layout, name)
        tools = sorted(tool for tool, facts in promised(layout).items() if devices & set(facts.get("devices") or ()))
        if tools:
            told = {"name": each.field, "trouble_above": each.refuse_at, "settled_below": each.resume_below}
            found.append({**told, "sources": tools, "source": f"the profile {name}"})
    return found


def bounds_of(told: Iterable[Mapping[str, Any]]) -> tuple[Bound, ...]:
    """The bounds in plain values; what is none is left out, which refuses less and never more."""
    found = []
    for each in told:
        numbers = {name: each.get(name) for name in _NUMBERS}
        if isinstance(each.get("name"), str) and all(one is None or is_number(one) for one in numbers.values()):
            sources = tuple(str(source) for source in each.get("sources") or ())
            found.append(Bound(str(each["name"]), **numbers, sources=sources, source=str(each.get("source"))))
    return tuple(found)


_NUMBERS = ("trouble_above", "settled_below", "trouble_below", "settled_above")


def _facts(tool: Mapping[str, Any], policy: Mapping[str, Any]) -> ToolFacts:
    properties = (tool.get("input_schema") or {}).get("properties") or {}
    choices = {name: tuple(each["enum"]) for name, each in properties.items() if isinstance(each.get("enum"), list)}
    named = str((tool.get("units") or {}).get("parameter") or "")
    return ToolFacts(str(tool["effect"]), bool(policy.get("stops")), tuple(tool.get("devices") or ()), choices, named)


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def _devices(layout: Layout, profile: str) -> set[str]:
    """The devices to whose meaning a profile contributed."""
    try:
        devices = read_json(layout.output("identify"))["devices"]
        return {str(each["id"]) for each in devices if each.get("profile") == profile}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return set()
