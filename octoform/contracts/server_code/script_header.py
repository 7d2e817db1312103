"""The header of a generated server: what it states it needs (PEP 723 inline script metadata).

The header makes the file runnable by itself and is the claim that DEPLOY proves. Light.
"""

import re
import tomllib
from typing import Any

from octoform.contracts.model import Artifacts
from octoform.diagnostics import Diagnostic, Span, error
from octoform.patterns import regex
from octoform.records import dataclass

_BLOCK = regex(r"(?m)^# /// script$\s(?P<content>(?:^#(?:| .*)$\s)+)^# ///$")
_REQUIREMENT = regex(
    r"(?P<name>[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?)\s*(?:\[[A-Za-z0-9._,\s-]*\])?\s*(?P<rest>.*)", re.DOTALL
)
_HINT = 'start the file with: # /// script, # requires-python = ">=3.11", # dependencies = [...], # ///'


@dataclass(frozen=True, slots=True)
class Header:
    """``dependencies`` as written; ``problem`` is None when the header can be used."""

    dependencies: tuple[str, ...]
    problem: str | None
    line: int


def read_header(text: str) -> Header:
    """The script header of a source text; never raises."""
    blocks = list(_BLOCK.finditer(text.replace("\r\n", "\n")))
    if len(blocks) != 1:
        return Header((), "the file has no script header" if not blocks else "the file has two script headers", 1)
    line = text.count("\n", 0, blocks[0].start()) + 1
    table = _table(text)
    if isinstance(table, str):
        return Header((), f"the script header is not TOML: {table}", line)
    listed = table.get("dependencies")
    if not isinstance(listed, list) or not all(isinstance(item, str) for item in listed):
        return Header((), "the script header has no list of dependencies", line)
    if not isinstance(table.get("requires-python"), str):
        return Header(tuple(listed), "the script header has no requires-python", line)
    bad = next((item for item in listed if _name(item) is None), None)
    if bad is not None:
        return Header((), f"the dependency {bad[:80]!r} is not a name with a version range", line)
    return Header(tuple(listed), None, line)


def _table(text: str) -> dict[str, Any] | str:
    """The first script header of a string as a table, or why it is none."""
    block = _BLOCK.search(text.replace("\r\n", "\n"))
    rows = block["content"].splitlines(True) if block is not None else []
    try:
        return tomllib.loads("".join(row[2:] if row.startswith("# ") else row[1:] for row in rows))
    except tomllib.TOMLDecodeError as problem:
        return str(problem)


def interface_errors(text: str) -> list[tuple[str, str]]:
    """(tool, problem) of what the server's author states that only INTERFACE can fix; what has another form is none."""
    table = _table(text)
    own = table.get("tool", {}) if isinstance(table, dict) else {}
    listed = own.get("octoform", {}).get("interface-errors", ()) if isinstance(own.get("octoform"), dict) else ()
    entries = [item for item in listed if isinstance(item, dict)] if isinstance(listed, list) else []
    return [(str(item["tool"]), str(item["problem"])) for item in entries if {"tool", "problem"} <= item.keys()]


def declared_requirements(source: str) -> tuple[str, ...]:
    """The requirement strings of the header, as written; empty without a usable header."""
    header = read_header(source)
    return header.dependencies if header.problem is None else ()


def required_python(source: str) -> str:
    """The range of Python versions that the header asks for; empty without one."""
    found = re.search(r'(?m)^# requires-python\s*=\s*"([^"]*)"', source)
    return found[1] if found else ""


def declared_names(source: str) -> frozenset[str]:
    """The normalised distribution names that the header declares."""
    return frozenset(normalised(_name(item) or "") for item in declared_requirements(source))


def normalised(name: str) -> str:
    """A distribution name in the one spelling by which names are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).casefold()


def header(value: str, _: Artifacts) -> list[Diagnostic]:
    """The file states which Python and which packages it needs."""
    found = read_header(value)
    if found.problem is None:
        return []
    return [error("SERVE-HEADER", found.problem, span=Span(found.line, 1), hint=_HINT)]


def _name(requirement: str) -> str | None:
    match = _REQUIREMENT.fullmatch(requirement.strip())
    # A direct reference would fetch from anywhere; names go through the one allowed index.
    return None if match is None or "@" in match["rest"] or "://" in match["rest"] else match["name"]
