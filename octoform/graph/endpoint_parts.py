"""The parts of manifest and profiles that make the endpoint, for the input hash, in the manifest's words.

A setting has its part only where it differs from its default, so the key of an endpoint without such settings is what
it was before they were there. Rules and limits are named by their place, as the endpoint names them when it refuses.
"""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

from octoform.base import digest
from octoform.manifest.model import Limit, Manifest, Network, Policy, Tunnel

if TYPE_CHECKING:  # the package brings the YAML reader with it
    from octoform.profiles.model import Profile

_PREFIX = "setting."
SCOPE = f"{_PREFIX}scope"
_BOUNDS = ("minimum", "maximum", "step", "cumulative")


def parts(manifest: Manifest, profiles: "tuple[Profile, ...]") -> dict[str, str]:
    """The key parts of the endpoint of a manifest."""
    out = {SCOPE: manifest.scope}
    for name, text in _settings(manifest.network, manifest.tunnel, manifest.policy).items():
        if text != DEFAULTS.get(name):
            out[name] = text
    return out | dict(_of_profiles(profiles))


def in_force(part: str, scope: str | None) -> str | None:
    """The default of a missing part; None for what the scope, where it is known, does not have."""
    scopes = next((used for prefix, used in _USED_IN.items() if part.startswith(prefix)), None)
    return None if scopes is not None and scope is not None and scope not in scopes else DEFAULTS.get(part)


def _settings(network: Network | None, tunnel: Tunnel | None, policy: Policy) -> dict[str, str]:
    found = dict(_policy(policy))
    if network is not None:
        found |= {"network.interface": network.interface, "network.port": str(network.port)}
        found |= {"network.hosts": ", ".join(network.hosts), "network.origins": ", ".join(network.origins)}
    if tunnel is not None:
        found["tunnel.command"] = shlex.join(tunnel.command)
    return {f"{_PREFIX}{name}": text for name, text in found.items()}


def _policy(policy: Policy) -> Iterator[tuple[str, str]]:
    for name in ("mode", "read", "actuate", "irreversible"):
        yield f"policy.{name}", getattr(policy, name)
    yield "policy.timeout", f"{policy.timeout}s"
    yield "policy.result_bytes", str(policy.result_bytes)
    for index, rule in enumerate(policy.rules):
        yield f"policy.rules[{index}]", f"{rule.decision} {', '.join(rule.tools)}"
    for index, limit in enumerate(policy.limits):
        yield f"policy.limits[{index}]", _limit(limit)
    for glob, seconds in policy.timeouts:
        yield f"policy.timeouts {glob}", f"{seconds}s"


def _limit(limit: Limit) -> str:
    """A limit as it is written, in one line."""
    words = [f"{name} {getattr(limit, name)!r}" for name in _BOUNDS if getattr(limit, name) is not None]
    if limit.rate is not None:
        words.append(f"rate {limit.rate[0]}/{limit.rate[1]}s")
    if limit.cooldown is not None:
        words.append(f"cooldown {limit.cooldown}s")
    if limit.quiet_hours is not None:
        words.append(f"quiet_hours {'-'.join(limit.quiet_hours)}")
    of = f"{limit.tool} {limit.parameter}" if limit.parameter is not None else limit.tool
    return f"{of}: {', '.join(words)}"


def _of_profiles(profiles: "tuple[Profile, ...]") -> Iterator[tuple[str, str]]:
    """The part of each profile that the endpoint enforces, and the rule that states for which devices."""
    for profile in profiles:
        if profile.limits or profile.stop:
            stop = [[action.kind, action.baud, action.write.hex()] for action in profile.stop]
            limits = [dict(item) for item in profile.limits]
            value = {"evidence": asdict(profile.evidence), "limits": limits, "stop": stop}
            yield f"profile.{profile.name} limits", digest.of_value(value)


DEFAULTS: Mapping[str, str] = _settings(Network(), Tunnel(), Policy())
"""The text of every part that is omitted where it is just this."""
_USED_IN = {f"{_PREFIX}network": ("intranet", "internet"), f"{_PREFIX}tunnel": ("internet",)}
