"""``profile check``: what a profile says, and for which devices of which hosts its evidence rule holds, and why not.

It asks what PROBE recorded, of this host and of every other host that the project's state knows. Nothing is run and
nothing is written; a profile that fits no host yet is sound all the same. (Heavy.)
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.diagnostics import Diagnostic
from octoform.manifest.loader import load as load_manifest
from octoform.profiles import Profile, load, match_rule
from octoform.profiles.match_rule import Judged
from octoform.state.files import read_regular
from octoform.state.layout import Layout

MANIFEST = "octopus.yaml"


@dataclass(frozen=True, slots=True)
class Met:
    """One device that meets the rule, or at least a number or a word of it."""

    id: str
    name: str
    answer: str
    rule: Judged


@dataclass(frozen=True, slots=True)
class HostReport:
    """One host: devices that meet something of the rule, those that meet all of it first; ``others`` meet nothing."""

    host: str
    devices: tuple[Met, ...]
    others: int


@dataclass(frozen=True, slots=True)
class Report:
    """A sound profile and what it would be used for."""

    profile: Profile
    hosts: tuple[HostReport, ...]


def check(project: Path, environ: Mapping[str, str], file: Path) -> tuple[Report | None, list[Diagnostic]]:
    """The report; None with every problem of the file when it is not sound. Warnings come along with a report."""
    profiles, found = load([project / file])
    if not profiles:
        return None, found
    manifest, _ = load_manifest(project / MANIFEST, environ)
    hosts = []
    for name, probe in sorted(probes(project).items()):
        answers = manifest.answers if manifest is not None and manifest.host == name else {}
        hosts.append(_of_host(profiles[0], name, probe, answers))
    return Report(profiles[0], tuple(hosts)), found


def probes(project: Path) -> dict[str, list[Mapping[str, Any]]]:
    """Host to the devices that its accepted PROBE lists; hosts without one are not in it."""
    found = {}
    for folder in sorted((project / "state").glob("*/probe")):
        host = folder.parent.name
        data, _ = read_regular(Layout(project, host).output("probe"))
        if data is not None and (devices := list(_devices(data))):
            found[host] = devices
    return found


def _devices(data: bytes) -> Iterator[Mapping[str, Any]]:
    """The devices in an artifact; an artifact that is damaged is another command's matter."""
    try:
        document = parse(data)
    except ValueError:
        return
    listed = document.get("devices") if isinstance(document, dict) else None
    for item in listed if isinstance(listed, list) else ():
        if isinstance(item, dict) and isinstance(item.get("id"), str):
            yield item


def _of_host(profile: Profile, host: str, probe: list[Mapping[str, Any]], answers: Mapping[str, str]) -> HostReport:
    judged = [
        Met(device["id"], str(device.get("name", "")), answer, match_rule.judge(profile.evidence, device, answer))
        for device in probe
        if device.get("context") is not True
        for answer in [answers.get(device["id"], "")]
    ]
    near = [item for item in judged if item.rule.holds or _meets_something(item.rule)]
    near.sort(key=lambda item: (not item.rule.holds, item.id))
    return HostReport(host, tuple(near), len(probe) - len(near))


def _meets_something(rule: Judged) -> bool:
    """Whether a number or a word of the rule was met: classes and drivers are those of many devices."""
    return any(test.holds for test in rule.tests() if test.kind in ("vid_pid", "text"))
