"""Profiles for a person and for a program: what one states, where its rule holds, and why it does not elsewhere."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from octoform.engine.profiles import Draft, HostReport, Met, ProfileReport
from octoform.policy.kinds import describe
from octoform.profiles import selection
from octoform.profiles.definition_forms import Value
from octoform.profiles.lines import Command, LineDefinition
from octoform.profiles.match_rule import Judged
from octoform.profiles.model import Grammar, Profile, plain
from octoform.profiles.registers import RegisterDefinition
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import escape, one_line

_INDENT = "    "


def report(console: Console, path: str, found: ProfileReport, *, as_json: bool) -> int:
    """The result of ``profile check``; a profile that fits no device is no error."""
    if as_json:
        hosts = [
            {"host": host.host, "devices": [_met_json(met) for met in host.devices], "others": host.others}
            for host in found.hosts
        ]
        return document(console, {"format": 1, "sound": True, "profile": _json(found.profile), "hosts": hosts})
    console.line(console.paint(f"{escape(path)} is sound", "green"))
    for line in _profile_lines(found.profile):
        console.line(escape(line))
    if not found.hosts:
        console.line()
        console.line("No host has been probed in this project: octoform apply -target probe")
    for host in found.hosts:
        _host(console, host)
    return 0


def _profile_lines(profile: Profile) -> Iterator[str]:
    yield f"  profile  {profile.name}: {profile.about}"
    if profile.product:
        yield f"  product  {profile.product}"
    rig = profile.rig
    of_product = profile.limits[: len(profile.limits) - len(rig.limits)]
    yield from _part("Limits of the product", [words for item in of_product for words in describe(item)])
    stops = [f"writes {len(item.write)} bytes to its {item.kind} node" for item in profile.stop]
    yield from _part("Emergency stop", stops or ["none is known: a stop refuses every further call"])
    if profile.grammar is not None:
        yield from _part("Tools of its protocol definition", list(_tools(profile.grammar)))
        yield from _part("Units on its bus", list(_bus(profile.grammar)))
    own = [*selection.of_rig(profile), *(words for item in rig.limits for words in describe(item))]
    yield from _part("This rig alone", own)


def _part(title: str, lines: list[str]) -> Iterator[str]:
    if lines:
        yield f"  {title}"
        yield from (f"{_INDENT}{line}" for line in lines)


def _tools(grammar: Grammar) -> Iterator[str]:
    """A line for each tool: what a caller may say, what is answered, the effect, and what the device is made to do."""
    if isinstance(grammar, LineDefinition):
        lines = {item.tool: (", ".join(map(_value, item.fields)), _does(item)) for item in grammar.commands}
        unit = ""
    else:
        lines = {item.tool: (", ".join(item.fields), "") for item in grammar.commands}
        unit = grammar.registers.unit  # the units are shown once, with their ids, and not at each tool
    for tool in grammar.tools():
        fields, does = lines.get(tool.tool, ("", ""))
        values = ", ".join(
            item.name if item.choices and item.name == unit else _value(item) for item in tool.parameters
        )
        found, returns = f" ({values})" if values else "", f" -> {fields}" if fields else ""
        yield f"{tool.tool}{found}{returns}  {tool.effect}, {does or tool.do}"


def _does(command: Command) -> str:
    return f"sends {command.send!r}" if command.send else "listens"


def _bus(grammar: Grammar) -> Iterator[str]:
    """The units that a protocol definition of registers speaks to, as they are on the rig, and through what."""
    if not isinstance(grammar, RegisterDefinition):
        return
    registers = grammar.registers
    yield ", ".join(f"{name} {number}" for name, number in registers.ids.items())
    library = registers.library
    yield f"{registers.baud} baud, by {library.module} of {library.distribution}, protocol {library.protocol}"
    if registers.protect is not None:
        guard, unit = registers.protect, f" {registers.protect.unit}" if registers.protect.unit else ""
        held = f"refused from {guard.refuse_at}{unit} on until it is below {guard.resume_below}{unit}"
        yield f"a movement of a unit is {held}, by its {guard.field}"


def _value(value: Value) -> str:
    if value.choices:
        return f"{value.name}: {' | '.join(value.choices)}"
    bounds = f" {value.minimum}..{value.maximum}" if value.minimum is not None else ""
    unit = f" {value.unit}" if value.unit else ""
    return f"{value.name}: {value.type}{bounds}{unit}" + (f" = {value.default}" if value.default is not None else "")


def _host(console: Console, host: HostReport) -> None:
    console.line()
    holding = sum(1 for met in host.devices if met.rule.holds)
    console.line(console.paint(f"host {escape(host.host)}", "bold") + f": matches {holding} of its devices")
    for met in host.devices:
        sign, style = ("+", "green") if met.rule.holds else ("-", "yellow")
        named = f"{sign} {met.id}  {one_line(met.name, 60)}"
        console.line(f"  {console.paint(escape(named), style)}")
        for line in _tree(met.rule, met.answer, 2):
            console.line(escape(line))
    if host.others:
        what = "devices meet" if host.others > 1 else "device meets"
        console.line(f"  {host.others} other {what} no number and no word of the rule")


def _tree(rule: Judged, answer: str, depth: int) -> Iterator[str]:
    """The rule with what each part of it found, one line for each."""
    verdict = "holds" if rule.holds else "fails"
    yield f"{_INDENT * depth}{rule.kind}: {verdict}{_because(rule, answer)}"
    for part in rule.parts:
        yield from _tree(part, answer, depth + 1)


def _because(rule: Judged, answer: str) -> str:
    if not rule.wanted:
        return ""
    met, wanted = ", ".join(rule.words), ", ".join(rule.wanted)
    if rule.kind != "text":
        return f", it has {met}" if met else f", it has {', '.join(rule.seen) or 'none'} and not {wanted}"
    if met:
        return f", {met} is in {'the answer about it' if set(rule.words) <= set(rule.answered) else 'its text'}"
    return f", none of {wanted} is in its text{' or in the answer' if answer else ', and there is no answer about it'}"


def _met_json(met: Met) -> dict[str, Any]:
    return {
        "id": met.id,
        "name": met.name,
        "holds": met.rule.holds,
        "answered": bool(met.answer),
        "rule": asdict(met.rule),
    }


def _json(profile: Profile) -> dict[str, Any]:
    rig = profile.rig
    return {
        "name": profile.name,
        "about": profile.about,
        "product": profile.product,
        "limits": [dict(item) for item in profile.limits[: len(profile.limits) - len(rig.limits)]],
        "stop": [{"class": item.kind, "baud": item.baud, "write": item.write.hex(" ")} for item in profile.stop],
        "grammar": plain(profile.grammar) if profile.grammar is not None else None,
        "rig": {
            "facts": list(rig.facts),
            "limits": [dict(item) for item in rig.limits],
            "disabled": dict(rig.disabled),
            "units": dict(rig.units),
        },
    }


def drafted(console: Console, draft: Draft, *, as_json: bool) -> int:
    """A draft was written; what to do with it."""
    line = f"profiles: [{draft.path}]"
    where = f"add it to `profiles` of octopus.yaml: {draft.path}" if draft.listed else f"add to octopus.yaml: {line}"
    steps = [
        "fill in what it leaves open: what the product is, words that name it, and prose below the front matter",
        f"octoform profile check {draft.path}",
        where,
    ]
    if as_json:
        return document(console, {"format": 1, "path": draft.path, "device": draft.device, "next": steps})
    console.line(f"{escape(draft.path)}: a draft from what PROBE saw of {escape(draft.device)}")
    for number, step in enumerate(steps, 1):
        console.line(f"  {number}. {escape(step)}")
    return 0
