"""Read the ``grammar`` of a profile, of either kind: every problem of it with its place, or the grammar. Pure."""

import json
from collections.abc import Mapping

from octoform.frontmatter import Place
from octoform.profiles.definitions import line_parser, register_parser
from octoform.profiles.definitions.definition import Grammar, plain
from octoform.profiles.definitions.problems import Found, Problem

PLACE: Place = ("grammar",)
MOST_BYTES = 24 * 1024
"""An agent is told every parameter of every command, and its prompt is bounded."""


def read(given: object) -> tuple[Grammar | None, list[Problem]]:
    """The grammar that a front-matter value says, and every problem of it as (place, summary, hint)."""
    found = Found()
    if not isinstance(given, Mapping):
        found.add(
            PLACE, "the grammar is no mapping", "write grammar: {line: ..., commands: ...}, or registers: for line:"
        )
        return None, found.problems
    if "registers" in given and "line" in given:
        found.add(PLACE, "a grammar is of one kind, and this is of two", "keep `line` or `registers`")
        return None, found.problems
    read_kind = register_parser.read if "registers" in given else line_parser.read
    grammar: Grammar = read_kind(found, given, PLACE)
    if not found.problems and len(json.dumps(plain(grammar))) > MOST_BYTES:
        hint = "a tool that moves all units has a parameter for each: keep one of them, and what an agent needs"
        found.add(PLACE, f"the commands and their parameters, written out, are more than {MOST_BYTES} bytes", hint)
    return (None if found.problems else grammar), found.problems
