"""Read profile files. (Heavy: reads YAML.)

A profile is prose. It reaches an agent as text and is never executed, so a file that is a program, or carries one, is
refused: what it would do on the host could not be seen in the plan.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from octoform import digest, frontmatter
from octoform.diagnostics import Diagnostic, did_you_mean, error, has_errors, warning
from octoform.frontmatter import Document
from octoform.profiles import evidence, limits, stopping
from octoform.profiles.evidence import Rule
from octoform.profiles.model import Profile

MOST_BYTES = 8 * 1024
FIELDS = ("name", "about", "evidence", "limits", "stop")
PROGRAMS = frozenset(
    {"python", "py", "sh", "bash", "zsh", "shell", "console", "powershell", "c", "cpp", "c++", "rust", "go", "java"}
    | {"javascript", "js", "typescript", "ts", "ruby", "perl", "lua", "arduino", "ino", "sql", "html"}
)
_NAME = re.compile(r"[a-z0-9]+(?:-[a-z0-9]+)*")
_BLOCK = re.compile(r"^ {0,3}(?:```+|~~~+) *([A-Za-z+]+)", re.MULTILINE)


def load(paths: Iterable[Path]) -> tuple[tuple[Profile, ...], list[Diagnostic]]:
    """The profiles in the order of ``paths``, and every problem of all of them; a file with a problem is left out."""
    profiles: list[Profile] = []
    found: list[Diagnostic] = []
    for path in paths:
        profile, problems = _load_one(Path(path))
        found += problems
        if profile is None:
            continue
        before = next((item for item in profiles if item.name == profile.name), None)
        if before is None:
            profiles.append(profile)
        else:
            summary = f"the profile name {profile.name!r} is taken by {before.path.name}"
            found.append(error("PROFILE-DUPLICATE-NAME", summary, path=str(path), hint="give it another name"))
    return tuple(profiles), found


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
    if len(document.text.encode("utf-8", "replace")) > MOST_BYTES:
        summary = f"the profile is larger than {MOST_BYTES} bytes"
        hint = "a profile goes into a prompt as it is: keep what an agent needs to know"
        found.append(error("PROFILE-TOO-LARGE", summary, path=str(document.path), hint=hint))
    if not document.body.strip():
        found.append(document.problem("PROFILE-FIELD", "the profile says nothing after its front matter"))
    rule, more = _evidence(document)
    bounds, also = _limits(document)
    stop, problems = stopping.read(fields.get("stop", []))
    found += [*more, *also]
    found += [document.problem("PROFILE-STOP", summary, place, hint) for place, summary, hint in problems]
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
        limits=bounds,
        stop=stop,
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
        return None  # reading it says why
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
        found.append(document.problem("PROFILE-FIELD", "the profile does not say what it is about", ("about",), hint))
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
        hint = "say when it may be used: evidence: {all: [{vid_pid: ...}, {text: [...]}]}"
        return None, [document.problem("PROFILE-EVIDENCE", "the profile has no evidence rule", (), hint)]
    rule, problems = evidence.read(document.fields["evidence"], ("evidence",))
    found = [document.problem("PROFILE-EVIDENCE", summary, place, hint) for place, summary, hint in problems]
    if rule is not None and not evidence.needs_more_than_a_number(rule):
        span = document.places.get(("evidence",))
        summary = "the evidence rule holds on numbers alone, and the numbers of a chip sit on many products"
        hint = "ask for words, a class or a driver as well: {all: [{vid_pid: ...}, {text: [...]}]}"
        found.append(warning("PROFILE-WEAK-EVIDENCE", summary, path=str(document.path), span=span, hint=hint))
    return rule, found


def _limits(document: Document) -> tuple[tuple[Mapping[str, Any], ...], list[Diagnostic]]:
    given = document.fields.get("limits", [])
    if not isinstance(given, list):
        hint = "write limits: [{parameter: ..., minimum: ..., maximum: ..., unit: ...}]"
        return (), [document.problem("PROFILE-LIMIT", "limits is no list", ("limits",), hint)]
    found: list[Diagnostic] = []
    for index, item in enumerate(given):
        place = ("limits", index)
        if not isinstance(item, Mapping):
            found.append(document.problem("PROFILE-LIMIT", "a limit is a mapping", place))
            continue
        found += _unknown(document, item, limits.FIELDS, place)
        problem = limits.problem(item)
        if problem is not None:
            found.append(document.problem("PROFILE-LIMIT", problem[0], place, problem[1]))
    return tuple(given), found
