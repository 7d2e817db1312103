"""The protocol definition that profiles bring with them, as the stages of the embedded agent read them from their task.

A protocol definition is a closed list of typed lines, so it is enough to make tools from: this is all that the embedded
agent ever knows of a product, and it knows it only from the owner's own text.
"""

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import Any

Profiles = Iterable[Mapping[str, Any]]
"""The profiles of a task (``Task.profiles``)."""


def holding(profiles: Profiles, device: str) -> Mapping[str, Any] | None:
    """The profile that matches a device: the first with a protocol definition, else the first; mostly None."""
    found = [profile for profile in profiles if device in profile.get("holds", ())]
    return next((profile for profile in found if profile.get("grammar")), found[0] if found else None)


def commands(profiles: Profiles) -> dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Tool name to (profile, command); the contracts of octoform keep a tool in one protocol definition alone."""
    return {
        str(command["tool"]): (profile, command)
        for profile in profiles
        for command in (profile.get("grammar") or {}).get("commands", ())
    }


def parameters(profile: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The parameters of a command, each with its bounds as far as the limits of the profile narrow them."""
    found = {name: dict(value) for name, value in command.get("parameters", {}).items()}
    for limit in profile.get("limits", ()):
        value = found.get(limit.get("parameter", ""))
        if value is None or not fnmatchcase(str(command["tool"]), limit.get("tool", "*")):
            continue
        for bound, tighter in (("minimum", max), ("maximum", min)):
            if bound in limit:
                value[bound] = tighter(value.get(bound, limit[bound]), limit[bound])
        if "unit" in limit:
            value["unit"] = limit["unit"]
    return found
