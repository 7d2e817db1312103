"""Read profile files. (Heavy: reads YAML.)

A profile is prose. It reaches an agent as text and is never executed, so a file that is a program, or carries one, is
refused: what it would do on the host could not be seen in the plan.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from octoform import frontmatter
from octoform.base import digest
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors, warning
from octoform.frontmatter import Document, Place
from octoform.patterns import regex
from octoform.policy.kinds import BOUNDS, PACES, RANGE, SETTINGS, Cumulative
from octoform.profiles import definition_parser, match_rule
from octoform.profiles.definition_forms import Found, near
from octoform.profiles.match_rule import Rule
from octoform.profiles.model import Grammar, Profile, Rig, Stop
from octoform.profiles.register_parser import MAX_ID
from octoform.profiles.registers import RegisterDefinition
from octoform.profiles.selection import contributions, devices_by
from octoform.records import dataclass, replace

# Read the ``rig`` of a profile: what holds for the owner's own copy alone, apart from what holds for the product.

OF_UNITS = ("disabled", "units")
BENCH_FIELDS = ("facts", "limits", *OF_UNITS)
MAX_FACTS, FACT_CHARS = 20, 300
PLACE = ("rig",)


def read_bench(found: Found, given: object, limits: tuple[Mapping[str, Any], ...], grammar: Grammar | None) -> Rig:
    """The rig that a front-matter value states, its limits being read already; every problem of it in ``found``."""
    if not isinstance(given, Mapping):
        found.add(PLACE, "rig is no mapping", "write rig: {facts: [...], limits: [...]}")
        return Rig()
    facts = given.get("facts", [])
    sound = [item for item in facts if _is_sentence(item)] if isinstance(facts, list) else []
    if not isinstance(facts, list) or len(sound) < len(facts) or len(facts) > MAX_FACTS:
        summary = f"the facts of the rig are no list of at most {MAX_FACTS} sentences"
        found.add((*PLACE, "facts"), summary, f"one line each, at most {FACT_CHARS} characters")
    named = [name for name in OF_UNITS if name in given]
    if named and not isinstance(grammar, RegisterDefinition):
        for name in named:
            hint = "only a definition of registers names units; write what is true of your copy under facts"
            found.add((*PLACE, name), f"{name!r} of the rig without units in the protocol definition", hint)
        return Rig(tuple(sound), limits)
    product = grammar.registers.units if isinstance(grammar, RegisterDefinition) else {}
    disabled = {
        str(unit): reason
        for unit, reason in _of_units(found, given, "disabled", product).items()
        if _is_reason(found, str(unit), reason)
    }
    return Rig(tuple(sound), limits, disabled, _renumbered(found, given, product))


def fitted(grammar: Grammar | None, rig: Rig) -> Grammar | None:
    """The protocol definition as it is on the rig."""
    if not isinstance(grammar, RegisterDefinition):
        return grammar
    return replace(grammar, registers=replace(grammar.registers, renumbered=rig.units, disabled=rig.disabled))


def _of_units(found: Found, given: Mapping[str, Any], name: str, units: Mapping[str, int]) -> dict[str, Any]:
    """The members of a mapping whose names are units."""
    place, listed = (*PLACE, name), given.get(name, {})
    if not isinstance(listed, Mapping):
        example = "disabled: {base: the motor is broken}" if name == "disabled" else "units: {base: 2, tip: 1}"
        found.add(place, f"{name!r} of the rig is no mapping of units", f"write {example}")
        return {}
    for unit in listed:
        if unit not in units:
            found.add(
                (*place, unit),
                f"{unit!r} is no unit of the protocol definition",
                near(str(unit), units, "its units are "),
            )
    return {unit: value for unit, value in listed.items() if unit in units}


def _is_reason(found: Found, unit: str, reason: object) -> bool:
    if _is_sentence(reason):
        return True
    hint = f"one line of at most {FACT_CHARS} characters; callers get it"
    found.add((*PLACE, "disabled", unit), f"the reason is missing {unit!r} is disabled", hint)
    return False


def _renumbered(found: Found, given: Mapping[str, Any], product: Mapping[str, int]) -> dict[str, int]:
    place = (*PLACE, "units")
    listed = _of_units(found, given, "units", product)
    ids = {unit: found.whole(listed, unit, place, (0, MAX_ID)) for unit in listed}
    whole = {**product, **ids}
    for unit, number in ids.items():
        other = next((name for name in whole if name != unit and whole[name] == number), None)
        if other is not None:
            hint = f"name the other unit with id {other!r} has on your copy"
            found.add((*place, unit), f"the id {number} of {unit!r} is the one of {other!r}", hint)
    return ids


def _is_sentence(item: object) -> bool:
    return isinstance(item, str) and bool(item.strip()) and item.isprintable() and len(item) <= FACT_CHARS


# What the emergency stop writes to a product: bytes as data, never a program. Pure.

STOP_FIELDS = ("class", "baud", "write")
MAX_STOP_BYTES = 256
MAX_ACTIONS = 20
_CLASS = regex(r"[a-z0-9][a-z0-9_-]{0,63}")
_EXAMPLE = '{class: tty, baud: 115200, write: "01 02 0A"}'

Problem = tuple[Place, str, str | None]


def read_stop(given: object) -> tuple[tuple[Stop, ...], list[Problem]]:
    """The actions that a front-matter value states, and every problem of it as (place, summary, hint)."""
    if not isinstance(given, list) or len(given) > MAX_ACTIONS:
        summary = f"stop is no list of at most {MAX_ACTIONS} actions"
        return (), [(("stop",), summary, f"write stop: [{_EXAMPLE}]")]
    found: list[Problem] = []
    actions: list[Stop] = []
    for index, item in enumerate(given):
        problems = list(_problems(item))
        found += [(("stop", index, *place), summary, hint) for place, summary, hint in problems]
        if not problems and isinstance(item, Mapping):
            actions.append(Stop(item["class"], item.get("baud"), bytes.fromhex(item["write"])))
    return tuple(actions), found


def _problems(item: object) -> list[Problem]:
    if not isinstance(item, Mapping):
        return [((), "a stop action is a mapping", f"write {_EXAMPLE}")]
    found: list[Problem] = []
    for name in item:
        if name not in STOP_FIELDS:
            near = did_you_mean(str(name), STOP_FIELDS)
            hint = f"did you mean {near!r}?" if near else f"known fields: {', '.join(STOP_FIELDS)}"
            found.append(((name,), f"{name!r} is no field here", hint))
    kind, baud = item.get("class"), item.get("baud")
    if not (isinstance(kind, str) and _CLASS.fullmatch(kind)):
        found.append((("class",), "the class of a stop action is no word of /sys/class", "write for example tty"))
    if "baud" in item and (isinstance(baud, bool) or not isinstance(baud, int) or not 1 <= baud <= 100_000_000):
        found.append((("baud",), "the baud of a stop action is not a positive integer", "write for example 115200"))
    if not _is_bytes(item.get("write")):
        hint = 'write pairs of hexadecimal digits in quotes: "01 02 0A"'
        found.append((("write",), f"a stop action writes 1 to {MAX_STOP_BYTES} bytes", hint))
    return found


def _is_bytes(value: object) -> bool:
    try:
        return isinstance(value, str) and 1 <= len(bytes.fromhex(value)) <= MAX_STOP_BYTES
    except ValueError:
        return False


# Prose of four pages and a definition that names every unit, field and command, with facts of the owner's own copy.
MAX_BYTES = 12 * 1024
FIELDS = ("name", "about", "product", "evidence", "limits", "stop", "grammar", "rig")
PROGRAMS = frozenset(
    {"python", "py", "sh", "bash", "zsh", "shell", "console", "powershell", "c", "cpp", "c++", "rust", "go", "java"}
    | {"javascript", "js", "typescript", "ts", "ruby", "perl", "lua", "arduino", "ino", "sql", "html"}
)
_NAME = regex(r"[a-z0-9]+(?:-[a-z0-9]+)*")
_BLOCK = regex(r"^ {0,3}(?:```+|~~~+) *([A-Za-z+]+)", re.MULTILINE)


def load(sources: Iterable[Path | tuple[str, str]]) -> tuple[tuple[Profile, ...], list[Diagnostic]]:
    """The profiles in the order of ``sources``, and every problem of all of them; one with a problem is omitted.

    A source is a file, or a string and the place where it stands (see `load_text`).
    """
    profiles: list[Profile] = []
    found: list[Diagnostic] = []
    for source in sources:
        profile, problems = load_text(*source) if isinstance(source, tuple) else _load_one(source)
        found += problems
        if profile is None:
            continue
        clashes = _clashes(profile, profiles)
        found += clashes
        if not clashes:
            profiles.append(profile)
    return tuple(profiles), found


@dataclass(frozen=True, slots=True)
class Offered:
    """A profile that may be chosen: its name, the product that it is about, the devices that it matches."""

    profile: str
    product: str
    devices: tuple[str, ...]


def offered(
    paths: Iterable[Path], chosen: Collection[Profile], probe: object, answers: Mapping[str, str]
) -> list[Offered]:
    """Those of the files, each named as its profile, that match a device which no chosen profile matches."""
    known = {profile.name for profile in chosen}
    settled = {device for device, _ in contributions(chosen, probe, answers)}
    found = []
    for path in sorted(path for path in paths if path.stem not in known):
        document, _ = frontmatter.read(path, "PROFILE-FRONT-MATTER", frozenset({"product", "evidence"}))
        rule, _ = _evidence(document) if document is not None else (None, None)
        matched = sorted(devices_by(rule, probe, answers) - settled) if rule is not None else []
        if document is not None and matched:
            found.append(Offered(path.stem, str(document.fields.get("product", path.stem)), tuple(matched)))
    return found


def _clashes(profile: Profile, others: Iterable[Profile]) -> list[Diagnostic]:
    """Diagnostics for what two profiles may not both have: a name, and a tool of their protocol definitions."""
    found = []
    for other in others:
        shared = sorted(_tools(profile) & _tools(other))
        if profile.name == other.name:
            summary = f"the profile name {profile.name!r} is taken by {other.path.name}"
            found.append(error("PROFILE-DUPLICATE-NAME", summary, path=str(profile.path), hint="give it another name"))
        elif shared:
            summary = f"the tool {shared[0]!r} is in the protocol definition of {other.path.name} too"
            hint = "give the tool another name; one tool has one protocol definition"
            found.append(error("PROFILE-GRAMMAR", summary, path=str(profile.path), hint=hint))
    return found


def _tools(profile: Profile) -> set[str]:
    return {item.tool for item in profile.grammar.tools()} if profile.grammar is not None else set()


def load_text(text: str, place: str) -> tuple[Profile | None, list[Diagnostic]]:
    """The profile of a string that is no file, such as one written into the manifest; ``place`` states where it stands.

    The same text gives the same profile as a file of it.
    """
    document, found = frontmatter.parse(Path(place), text.replace("\r\n", "\n"), "PROFILE-FRONT-MATTER")
    return parse(document) if document is not None else (None, found)


def _load_one(path: Path) -> tuple[Profile | None, list[Diagnostic]]:
    program = _is_program(path)
    if program is not None:
        return None, [_code(path, program)]
    document, found = frontmatter.read(path, "PROFILE-FRONT-MATTER")
    return parse(document) if document is not None else (None, found)


def parse(document: Document) -> tuple[Profile | None, list[Diagnostic]]:
    """A profile from its text; the same text gives the same profile wherever it came from."""
    fields = document.fields
    found = _check_fields(document)
    block = next((word for word in _BLOCK.findall(document.body) if word.casefold() in PROGRAMS), None)
    if block is not None:
        found.append(_code(document.path, f"it holds a program in {block}"))
    if len(document.text.encode("utf-8", "replace")) > MAX_BYTES:
        summary = f"the profile is larger than {MAX_BYTES} bytes"
        hint = "a profile goes into a prompt as it is: keep what an agent needs to know"
        found.append(error("PROFILE-TOO-LARGE", summary, path=str(document.path), hint=hint))
    if not document.body.strip():
        found.append(
            document.problem(
                "PROFILE-FIELD",
                "the profile has no text after its front matter",
                hint="write below it what you know of the product",
            )
        )
    rule, more = _evidence(document)
    bounds, also = _limits(document, fields.get("limits", []), ("limits",))
    found += [*more, *also]
    stop, problems = read_stop(fields.get("stop", []))
    found += [document.problem("PROFILE-STOP", summary, place, hint) for place, summary, hint in problems]
    grammar, problems = definition_parser.read(fields["grammar"]) if "grammar" in fields else (None, [])
    found += [document.problem("PROFILE-GRAMMAR", summary, place, hint) for place, summary, hint in problems]
    rig, too = _rig(document, grammar)
    found += [*too, *_idle_limits(document, grammar)]
    if rule is None or has_errors(found):
        return None, found
    profile = Profile(
        name=fields["name"],
        about=fields["about"],
        path=document.path,
        text=document.text,
        body=document.body,
        digest=digest.of_bytes(document.text.encode("utf-8")),
        evidence=rule,
        limits=(
            *bounds,
            *(definition_parser.derived(grammar.tools(), bounds) if grammar is not None else ()),
            *rig.limits,
        ),
        stop=stop,
        grammar=fitted(grammar, rig),
        product=fields.get("product", ""),
        rig=rig,
    )
    return profile, found


def _is_program(path: Path) -> str | None:
    """Why the file cannot be prose, or None; a file that is not there is no program."""
    if path.suffix.casefold() not in (".md", ".markdown"):
        return "its name does not end in .md"
    try:
        if path.is_file() and path.stat().st_mode & 0o111:
            return "it is marked as executable"
    except OSError:
        return None  # reading it reports why
    return None


def _code(path: Path, why: str) -> Diagnostic:
    hint = "write down what is known of the product in words; the agent writes the code"
    return error("PROFILE-CODE", f"a profile is prose, and this is none: {why}", path=str(path), hint=hint)


def _check_fields(document: Document) -> list[Diagnostic]:
    found = _unknown(document, document.fields, FIELDS, ())
    name, about = document.fields.get("name"), document.fields.get("about")
    if not (isinstance(name, str) and _NAME.fullmatch(name) and len(name) <= 60):
        summary = "the profile has no usable name"
        hint = "write name: in lower-case letters, digits and dashes"
        found.append(document.problem("PROFILE-FIELD", summary, ("name",), hint))
    if not (isinstance(about, str) and about.strip() and len(about) <= 200):
        hint = "write about: the product in one line"
        found.append(document.problem("PROFILE-FIELD", "the profile has no `about`", ("about",), hint))
    product = document.fields.get("product", "-")
    if not (isinstance(product, str) and product.strip() and product.isprintable() and len(product) <= 200):
        hint = "write product: maker and model, as a person would call it"
        found.append(document.problem("PROFILE-FIELD", "the product has no usable name", ("product",), hint))
    return found


def _unknown(
    document: Document, given: Mapping[str, Any], known: tuple[str, ...], place: frontmatter.Place
) -> list[Diagnostic]:
    found = []
    for name in given:
        if name not in known:
            near = did_you_mean(name, known)
            hint = f"did you mean {near!r}?" if near else f"known fields: {', '.join(known)}"
            found.append(document.problem("PROFILE-FIELD", f"{name!r} is no field here", (*place, name), hint))
    return found


def _evidence(document: Document) -> tuple[Rule | None, list[Diagnostic]]:
    if "evidence" not in document.fields:
        hint = "write when it may be used: evidence: {all: [{vid_pid: ...}, {text: [...]}]}"
        return None, [document.problem("PROFILE-EVIDENCE", "the profile has no match rule", (), hint)]
    rule, problems = match_rule.read(document.fields["evidence"], ("evidence",))
    found = [document.problem("PROFILE-EVIDENCE", summary, place, hint) for place, summary, hint in problems]
    if rule is not None and not match_rule.needs_more_than_a_number(rule):
        span = document.places.get(("evidence",))
        summary = "the match rule uses numbers only, and many products have the numbers of a chip"
        hint = "ask for words, a class or a driver as well: {all: [{vid_pid: ...}, {text: [...]}]}"
        found.append(warning("PROFILE-WEAK-EVIDENCE", summary, path=str(document.path), span=span, hint=hint))
    return rule, found


def _limits(
    document: Document, given: object, place: frontmatter.Place
) -> tuple[tuple[Mapping[str, Any], ...], list[Diagnostic]]:
    if not isinstance(given, list):
        hint = "write limits: [{parameter: ..., minimum: ..., maximum: ..., unit: ...}]"
        return (), [document.problem("PROFILE-LIMIT", "limits is no list", place, hint)]
    found: list[Diagnostic] = []
    for index, item in enumerate(given):
        where = (*place, index)
        if not isinstance(item, Mapping):
            found.append(document.problem("PROFILE-LIMIT", "a limit is a mapping", where))
            continue
        found += _unknown(document, item, ("tool", "parameter", "unit", "zero", *SETTINGS), where)
        problem = _problem_of(item)
        if problem is not None:
            found.append(document.problem("PROFILE-LIMIT", problem[0], where, problem[1]))
    return tuple(given), found


def _problem_of(item: Mapping[str, Any]) -> tuple[str, str | None] | None:
    """The problem of a limit, and what to do about it; None when it is sound. Unknown fields are another matter."""
    words = [name for name in ("parameter", "tool", "unit", "zero") if name in item]
    for name in words:
        if not (isinstance(item[name], str) and item[name].strip()):
            return f"{name!r} of a limit is not a string", None
    given = [name for name in SETTINGS if name in item]
    bounds = [name for name in given if name in BOUNDS]
    if not given:
        return "the limit bounds nothing", f"give it one of {', '.join((*BOUNDS, *PACES))}"
    if bounds and "parameter" not in item:
        return "the limit does not name its parameter", f"name the parameter {bounds[0]!r} is"
    if not bounds and "parameter" in item:
        return "nothing in the limit speaks of its parameter", f"remove it, or give one of {', '.join(BOUNDS)}"
    if "zero" in item and Cumulative.name not in item:
        return (
            f"`zero` is of a limit without `{Cumulative.name}`",
            "it names the tool after which a sum begins again at zero",
        )
    if not bounds and "tool" not in item:
        return "the limit does not name its tool", f"name the tool {given[0]!r} is"
    return _problem_of_values(item)


def _problem_of_values(item: Mapping[str, Any]) -> tuple[str, str | None] | None:
    given = [name for name in SETTINGS if name in item]
    for name in given:
        wrong = SETTINGS[name].form.problem(item[name])
        if wrong is not None:
            return f"{name!r} of the limit {wrong[0]}", wrong[1]
    if set(RANGE) <= set(given) and item[RANGE[0]] > item[RANGE[1]]:
        return "the minimum is above the maximum", None
    return None


def _rig(document: Document, grammar: Grammar | None) -> tuple[Rig, list[Diagnostic]]:
    """The settings for the owner's own unit, apart from those for the product."""
    given, problems = document.fields.get("rig", {}), Found()
    listed = given if isinstance(given, Mapping) else {}
    found = _unknown(document, listed, BENCH_FIELDS, ("rig",))
    bounds, more = _limits(document, listed.get("limits", []), ("rig", "limits"))
    if grammar is None and "grammar" in document.fields and listed:  # its problems are reported; units are unknown
        given = {name: value for name, value in listed.items() if name not in OF_UNITS}
    rig = read_bench(problems, given, bounds, grammar)
    lines = [document.problem("PROFILE-RIG", summary, place, hint) for place, summary, hint in problems.problems]
    return rig, [*found, *lines, *more]


def _idle_limits(document: Document, grammar: Grammar | None) -> list[Diagnostic]:
    """Limits of what the protocol definition does not have: anyone who wrote them believes in a bound that is none."""
    tools = grammar.tools() if grammar is not None else ()
    rig = document.fields.get("rig")
    places: list[tuple[Any, frontmatter.Place]] = [
        (document.fields.get("limits"), ("limits",)),
        (rig.get("limits") if isinstance(rig, Mapping) else None, ("rig", "limits")),
    ]
    found = []
    for given, place in places if tools else ():
        for index, item in enumerate(given if isinstance(given, list) else ()):
            idle = definition_parser.idle(item, tools) if isinstance(item, Mapping) else None
            if idle is not None:
                name, summary, hint = idle
                found.append(document.problem("PROFILE-LIMIT", summary, (*place, index, name), hint))
    return found
