"""Profiles for their owner: a draft from what was found, and where one matches."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.contracts.name_clues import is_chip_name
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.manifest.loader import load as load_manifest
from octoform.manifest.profile_paths import located
from octoform.patterns import regex
from octoform.profiles import Profile, load, match_rule
from octoform.profiles.match_rule import Judged
from octoform.records import dataclass
from octoform.state.files import read_regular, write_atomic
from octoform.state.layout import Layout
from octoform.state.store.lock import acquire

# ``profile check``: the content of a profile, which devices of which hosts its match rule matches, and why not.
#
# It asks what PROBE recorded, of this host and of every other host that the project's state knows. Nothing is run and
# nothing is written; a profile that fits no host yet is sound all the same. (Heavy.)

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
class ProfileReport:
    """A sound profile and what it would be used for."""

    profile: Profile
    hosts: tuple[HostReport, ...]


def check(project: Path, environ: Mapping[str, str], file: Path) -> tuple[ProfileReport | None, list[Diagnostic]]:
    """The report; None with every problem of the file when it is not sound. Warnings come along with a report."""
    profiles, found = load([located(project, str(file))])
    if not profiles:
        return None, found
    manifest, _ = load_manifest(project / MANIFEST, environ)
    hosts = []
    for name, probe in sorted(probes(project).items()):
        answers = manifest.answers if manifest is not None and manifest.host == name else {}
        hosts.append(_of_host(profiles[0], name, probe, answers))
    return ProfileReport(profiles[0], tuple(hosts)), found


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


# ``profile new``: the draft of a profile, written from what PROBE recorded of one device of this host.
#
# The draft has the device's own facts. What it does not know is left open in places that the reader of
# profiles refuses, so that a draft is never taken for knowledge. (Heavy.)

FOLDER = "profiles"
# A hidden serial number, where a value was cut, a character that cannot be shown, a pseudonym.
_MARKS = regex(
    r"<serial>|\[cut]|\\x1b(?:\[[0-9;]*[A-Za-z])?|\\x[0-9a-f]{2}|\\u[0-9a-f]{4}|\\U[0-9a-f]{8}|\bredacted-[0-9]{10}\b"
)
# Words before the name of a product in a sentence about it, and words that begin a description of its place.
_BEFORE = regex(r"^(?:(?:it's|that's|this|that|it|there|here|is|are|a|an|the|my|our|one)\b[ ,]*)+", re.IGNORECASE)
_BEHIND = regex(r"\s(?:on|of|at|in|under|over|behind|beside|near|for|which|that|with|and)\s|[,;()]|\.\s", re.IGNORECASE)
_DRAFT = """\
---
name: {name}
# One line: what this product is. The check rejects the profile until it is here.
about: ""
# What a person calls it: maker and model.
product: {product}
# When this profile may be used; octoform evaluates it on what PROBE saw, an agent never does. Words count when they
# are in the device's own text, or in your answer about it:
#   octoform answer {device} "..."
# Keep only words that no other product has: the numbers of a chip sit on thousands of boards.
evidence:
  all:
{evidence}
# What every call has to keep to; the endpoint enforces it. For example:
# limits:
#   - {{tool: lamp_dim, parameter: percent, minimum: 0, maximum: 80, unit: "%"}}
{grammar}# What is true of your own copy alone:
# rig:
#   facts: [The left bulb is broken.]
---
"""
_LINES = """\
# If it is driven by lines of text over its serial line, its commands are enough to make tools of. Omit `ok` where
# it acknowledges nothing, and `send` where it speaks by itself. For example:
# grammar:
#   line: {class: tty, baud: 115200, ok: "OK", error: "ERR {message}", timeout: 5s}
#   commands:
#     - tool: lamp_dim
#       send: "DIM {percent}"
#       about: dim the lamp
#       effect: actuate
#       parameters: {percent: {type: integer, minimum: 0, maximum: 80, unit: "%"}}
"""
_REGISTERS = """\
# If it is a bus of units behind a public library (servos, drives), their registers are enough. For example:
# grammar:
#   registers:
#     class: tty
#     baud: 57600
#     library: {distribution: name-on-pypi, module: imported_as, protocol: 1}
#     units: {left: 1, right: 2}
#     fields:
#       torque: {address: 24, bytes: 1}
#       goal: {address: 30, bytes: 2}
#       position: {address: 36, bytes: 2, unit: raw}
#     motion:
#       goal: goal
#       present: position
#       minimum: 0
#       maximum: 1023
#       before: [{torque: 1}]
#       moved: 10
#       timeout: 5s
#       release: {torque: 0}
#   commands:
#     - {tool: pump_status, do: read_units, about: where the pumps are, fields: [position]}
#     - {tool: pump_move, do: move_unit, about: move one pump}
#     - {tool: pump_stop, do: stop, about: stop both pumps where they are}
# docs/profiles.md has every field of both kinds.
"""


@dataclass(frozen=True, slots=True)
class Draft:
    """A file that was written: its path in the project, the device, and whether the manifest lists profiles already."""

    path: str
    device: str
    listed: bool


def draft(project: Path, environ: Mapping[str, str], device: str) -> tuple[Draft | None, list[Diagnostic]]:
    """Write the draft; nothing is written over a file that is there."""
    manifest, found = load_manifest(project / MANIFEST, environ)
    if manifest is None:
        return None, found
    devices = {item["id"]: item for item in probes(project).get(manifest.host, [])}
    if not devices:
        hint = "octoform apply -target probe lists the devices"
        return None, [error("PROFILE-NO-DEVICE", f"nothing is known of the devices of {manifest.host} yet", hint=hint)]
    if device not in devices:
        near = did_you_mean(device, list(devices)[:2000])
        hint = f"did you mean {near}?" if near else "octoform coverage lists the devices"
        return None, [error("PROFILE-NO-DEVICE", f"{device!r} is no device of {manifest.host}", hint=hint)]
    text, name = _text(devices[device], manifest.answers.get(device, ""))
    path = project / FOLDER / f"{name}.md"
    # While an apply runs, it removes every new profile, since its agent may have written it.
    acquired = acquire(Layout(project, manifest.host), "profile new")
    if acquired.lock is None:
        return None, list(acquired.diagnostics)
    with acquired.lock:
        if path.exists() or path.is_symlink():
            summary = f"{FOLDER}/{name}.md is there already"
            hint = "look at it with octoform profile check, or move it away"
            return None, [error("PROFILE-EXISTS", summary, path=str(path), hint=hint)]
        path.parent.mkdir(exist_ok=True)
        problem = write_atomic(path, text.encode("utf-8"))
    if problem is not None:
        return None, [problem]
    return Draft(f"{FOLDER}/{name}.md", device, bool(manifest.profiles)), []


def _text(device: Mapping[str, Any], answer: str) -> tuple[str, str]:
    """The draft and the name of the profile in it; what the owner answered goes before what the device reports."""
    product, maker = _named_in(answer), ""
    if not product and not is_chip_name(_text_of(device, "product"), str(device.get("raw_descriptor", ""))):
        product, maker = _text_of(device, "product"), _text_of(device, "manufacturer")
    called = product if maker.casefold() in product.casefold() else f"{maker} {product}".strip()
    name = _slug(called) or _slug(device["id"]) or "device"
    tests = []
    if device.get("vid") and device.get("pid"):
        tests.append(f'    - vid_pid: "{device["vid"]}:{device["pid"]}"')
    words = json.dumps([product]) if product else "[]  # it has no strings of its own: which words name it?"
    tests.append(f"    - text: {words}")
    for kind, listed in (("class", device.get("classes")), ("driver", device.get("drivers"))):
        if isinstance(listed, list) and listed:
            tests.append(f"    - {kind}: {json.dumps(listed[:8])}")
            break
    text = _DRAFT.format(
        name=name,
        product=json.dumps(called),
        device=device["id"],
        evidence="\n".join(tests),
        grammar=_LINES + _REGISTERS if "tty" in (device.get("classes") or ()) else "",
    )
    return text, name


def _named_in(answer: str) -> str:
    """The device's name in an answer, verbatim: without the words before the name and the place behind it."""
    found = _BEFORE.sub("", " ".join(answer.split()))
    return _BEHIND.split(found, maxsplit=1)[0].strip(" .,;:!")[:120]


def _text_of(device: Mapping[str, Any], key: str) -> str:
    """The device's own string under a key of its PROBE text: of what is between PROBE's marks the longest part."""
    found = re.search(rf"^{key}: (.{{1,120}})$", str(device.get("raw_descriptor", "")), re.MULTILINE)
    parts = _MARKS.split(found[1]) if found else [""]
    return max((" ".join(part.split()) for part in parts), key=len)


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.casefold()).strip("-")[:60].strip("-")
