"""Which devices a profile may be used for, and how it is told to an agent. Pure."""

from collections.abc import Collection, Mapping
from typing import Any

from octoform.profiles import evidence, limits
from octoform.profiles.model import Profile


def holds(profile: Profile, probe: Any) -> frozenset[str]:
    """Ids of the PROBE devices for which the profile's evidence rule holds; never raises, whatever ``probe`` is.

    The words must stand in what PROBE recorded of that very device. A neighbour (``context``) is never met.
    """
    devices = probe.get("devices") if isinstance(probe, Mapping) else None
    return frozenset(
        device["id"]
        for device in (devices if isinstance(devices, list) else ())
        if isinstance(device, Mapping)
        and isinstance(device.get("id"), str)
        and device.get("context") is not True
        and evidence.holds(profile.evidence, device)
    )


def briefing(profile: Profile, ids: Collection[str]) -> str:
    """The profile as an agent is told it: for which devices it holds, its limits, its prose; no other device."""
    lines = [f"Profile {profile.name}: {profile.about}", f"Its evidence rule holds for: {', '.join(sorted(ids))}."]
    lines += [f"Limit: {words}." for item in profile.limits for words in limits.told(item)]
    return "\n".join([*lines, "", profile.body.strip(), ""])
