"""The known facts of a host's devices, and a person's input for them: tiers, profiles, open questions."""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import escaped
from octoform.contracts.rules.identify.answer_rules import tier, wanted
from octoform.diagnostics import Diagnostic, did_you_mean, warning
from octoform.engine.plan.configuration import Compiled
from octoform.graph.model import ANSWER
from octoform.manifest.profile_paths import shipped
from octoform.plan.diff import Prior
from octoform.plan.model import Action, NamedDevice, NearProfile, OpenQuestion, ProfileUse
from octoform.profiles import Profile, contributions, match_rule, near, profile_parser
from octoform.profiles.match_rule import Judged
from octoform.profiles.selection import attached, commands, devices_of
from octoform.records import dataclass

Artifacts = Mapping[str, Any]
STRAY = "PLAN-ANSWER-WITHOUT-DEVICE"
OFFERED = "PROFILE-OFFERED"
UNCOVERED = "PROFILE-COMMANDS-MISSING"
UNMATCHED = "PROFILE-UNMATCHED"


@dataclass(frozen=True, slots=True)
class Offer:
    """A profile that comes with octoform and matches ``devices``; ``line`` states what the manifest needs to use it."""

    profile: str
    product: str
    devices: tuple[str, ...]
    line: str

    @property
    def summary(self) -> str:
        """The offered profiles with their devices, as one sentence."""
        return f"octoform comes with a profile that matches {', '.join(self.devices)}: {self.product}"


def questions(artifacts: Artifacts, answers: Mapping[str, str]) -> tuple[OpenQuestion, ...]:
    """One for each device that is unidentified and has no answer."""
    return tuple(
        OpenQuestion(device["id"], device["identified_as"], device["missing"], asked)
        for device in _identified(artifacts)
        if device["id"] not in answers and device.get("missing") and (asked := wanted(device)) is not None
    )


def devices(artifacts: Artifacts, profiles: tuple[Profile, ...], prior: Mapping[str, Prior]) -> tuple[NamedDevice, ...]:
    """The devices that IDENTIFY could name, each with its tier, by the answers at its acceptance."""
    answers = accepted_answers(prior)
    descriptions = {profile.name for profile in profiles if profile.describes}
    return tuple(
        NamedDevice(
            device=device["id"],
            name=device["identified_as"],
            tier=tier(device, answers, descriptions),
            answer=answers.get(device["id"]),
            profile=device.get("profile"),
        )
        for device in _identified(artifacts)
        if wanted(device) is None
    )


def profile_uses(
    artifacts: Artifacts, profiles: tuple[Profile, ...], answers: Mapping[str, str], prior: Mapping[str, Prior]
) -> tuple[ProfileUse, ...]:
    """Which devices each profile matches, will match, or will match no longer; as far as PROBE is known."""
    probe = artifacts.get("probe")
    if probe is None:
        return ()
    parts = prior["identify"].key_parts if "identify" in prior else {}
    same = [profile for profile in profiles if parts.get(f"profile.{profile.name}") == profile.digest]
    before = set(contributions(same, probe, accepted_answers(prior)))
    now = set(contributions(profiles, probe, answers))
    return tuple(
        ProfileUse(profile, device, _action((device, profile) in before, (device, profile) in now))
        for device, profile in sorted(before | now)
    )


def near_profiles(
    artifacts: Artifacts, profiles: tuple[Profile, ...], answers: Mapping[str, str]
) -> tuple[NearProfile, ...]:
    """Which profiles a sentence about a device would make hold; nothing before PROBE is known."""
    found = near(profiles, artifacts.get("probe"), answers)
    return tuple(NearProfile(profile, device, word) for device, profile, word in found)


def _action(before: bool, now: bool) -> Action:
    if before and now:
        return Action.NOOP
    return Action.CREATE if now else Action.DESTROY


def accepted_answers(prior: Mapping[str, Prior]) -> dict[str, str]:
    """The answers when IDENTIFY was accepted."""
    parts = prior["identify"].key_parts if "identify" in prior else {}
    return {part.removeprefix(ANSWER): text for part, text in parts.items() if part.startswith(ANSWER)}


def offered(artifacts: Artifacts, compiled: Compiled) -> tuple[Offer, ...]:
    """Profiles that come with octoform, match a device of this host and are not in the manifest."""
    probe, answers = artifacts.get("probe"), compiled.manifest.answers
    if probe is None:
        return ()
    found = profile_parser.offered(shipped().glob("*.md"), compiled.profiles, probe, answers)
    form = "add `{}` to `profiles`" if compiled.manifest.profiles else "write `profiles: [{}]`"
    line = f"{form} in octopus.yaml to use it"
    return tuple(Offer(each.profile, each.product, each.devices, line.format(each.profile)) for each in found)


def offers(artifacts: Artifacts, compiled: Compiled) -> list[Diagnostic]:
    """One warning for each profile that is `offered`."""
    return [warning(OFFERED, each.summary, hint=each.line) for each in offered(artifacts, compiled)]


def unmatched(artifacts: Artifacts, compiled: Compiled) -> list[Diagnostic]:
    """One warning for each chosen profile that matches no device, with its match rule and the device nearest to it."""
    probe, answers = artifacts.get("probe"), compiled.manifest.answers
    if probe is None:
        return []
    missed = [profile for profile in compiled.profiles if not devices_of(profile, probe, answers)]
    return [_unmatched(profile, list(attached(probe)), answers) for profile in missed]


def _unmatched(profile: Profile, listed: list[Mapping[str, Any]], answers: Mapping[str, str]) -> Diagnostic:
    judged = [(match_rule.judge(profile.evidence, item, answers.get(item["id"], "")), item) for item in listed]
    verdict, device = max(judged, key=lambda item: match_rule.nearness(item[0]), default=(None, None))
    detail = f"its match rule asks for {match_rule.describe(match_rule.judge(profile.evidence, {}))}"
    check = f"octoform profile check {profile.name} shows the rule part by part"
    if verdict is None or device is None or not any(match_rule.nearness(verdict)):
        hint = f"attach the device, or take {profile.name} out of `profiles`; {check}"
        detail += "\nno device of this host meets any part of it"
    else:
        name = escaped(str(device.get("name", "")))
        detail += f"\nnearest is {device['id']} ({name}), which has {_phrase(match_rule.met(verdict))}, and lacks "
        detail += _phrase(match_rule.lacking(verdict))
        words = match_rule.words_wanting(profile.evidence, device)
        say = (
            f'if it is {device["id"]}, tell so: octoform answer {device["id"]} "... {words[0]} ..."; ' if words else ""
        )
        hint = f"{say}{check}"
    summary = f"the profile {profile.name} matches no device of this host and has no effect"
    return warning(UNMATCHED, escaped(summary), detail=escaped(detail, "\n"), hint=escaped(hint))


def _phrase(parts: Iterator[Judged]) -> str:
    return "; ".join(dict.fromkeys(map(match_rule.describe, parts)))


def uncovered(artifacts: Artifacts, compiled: Compiled) -> list[Diagnostic]:
    """One warning for each chosen profile of whose commands some have no tool, with the reason that INTERFACE gives."""
    interface, probe = artifacts.get("interface"), artifacts.get("probe")
    if interface is None or probe is None:
        return []
    out = []
    for profile in compiled.profiles:
        ids = devices_of(profile, probe, compiled.manifest.answers)
        served = {tool["capability"] for tool in interface["tools"] if not ids.isdisjoint(tool["devices"])}
        absent = [command["tool"] for command in commands(profile) if command["tool"] not in served] if ids else []
        if absent:
            left = [item for item in interface["left_out"] if item["id"] in ids]
            why = [
                f"{item['id']}: {item['reason']}{' - ' + item['detail'] if 'detail' in item else ''}" for item in left
            ]
            summary = f"INTERFACE has no tool for {len(absent)} commands of the profile {profile.name}: "
            hint = "octoform apply -replace interface; budget.tools in octopus.yaml limits the number of tools"
            detail = "\n".join(map(escaped, why)) or "INTERFACE gives no reason"
            out.append(warning(UNCOVERED, summary + ", ".join(absent), detail=detail, hint=hint))
    return out


def stray(artifacts: Artifacts, answers: Mapping[str, str]) -> list[Diagnostic]:
    """Answers about devices that PROBE does not list: misspelt, or unplugged for good."""
    probe = artifacts.get("probe")
    return [] if probe is None else list(_stray([device["id"] for device in probe["devices"]], answers))


def _stray(known: list[str], answers: Mapping[str, str]) -> Iterator[Diagnostic]:
    for device in answers:
        if device not in known:
            near = did_you_mean(device, known)
            hint = f"did you mean {near}? " if near else ""
            summary = f"the answer about {device} has no effect: PROBE lists no such device"
            yield warning(STRAY, summary, hint=f"{hint}`octoform answer -remove {device}` takes it back")


def _identified(artifacts: Artifacts) -> list[dict[str, Any]]:
    identify = artifacts.get("identify")
    return identify["devices"] if identify is not None else []
