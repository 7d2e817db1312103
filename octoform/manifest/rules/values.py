"""Rules about the text of values, wherever they stand: references to variables, and secrets."""

import re
from collections.abc import Mapping

from octoform.diagnostics import Span
from octoform.manifest import agent_locations, credentials, references, secrets
from octoform.manifest.source import tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import Loc, Node, Scalar, Table

_WHERE = "variables may stand in `model`, `base_url`, `webhook` and the `command` of an agent only"
_KEY_NAME = re.compile("[A-Z_][A-Z0-9_]{0,99}")
_REFERENCE = re.compile(r"(?<!\$)\$\{[^{}]*\}?")


def check_secrets(root: Node, report: Report) -> None:
    """Refuse every literal that looks like a secret, in values, keys and comments, and mask it everywhere."""
    told: set[str] = set()
    for number, line in enumerate(report.lines, 1):
        for start, end in secrets.found_in(line):
            told.add(line[start:end])
            _refuse(Span(number, start + 1, end + 1), report)
    for loc, scalar in tree.scalars(root):
        if _may_hide_one(loc, scalar):
            _mask(scalar, report)
        found = _secrets_of(root, loc, scalar)
        if found:
            report.settle(loc)
        if found - told:
            _mask(scalar, report)
            _refuse(scalar.span, report)


def _secrets_of(root: Node, loc: Loc, scalar: Scalar) -> set[str]:
    text = scalar.text
    if not isinstance(scalar.value, str) or not text:
        return set()
    found = {text[start:end] for start, end in (*secrets.found_in(text), *secrets.assigned_in(text))}
    is_named = not found and not references.contains(text) and _is_named_secret(root, loc)
    return {text} if is_named else found


def _may_hide_one(loc: Loc, scalar: Scalar) -> bool:
    """True for what is no name where the name of a variable belongs, for a URL with more than a path,
    and for a webhook.

    The first two are refused by another rule. The text may be the secret itself and is not shown.
    """
    if scalar.value is None:
        return False
    if loc in agent_locations.KEYS:
        return _KEY_NAME.fullmatch(scalar.text) is None and not references.contains(scalar.text)
    if loc == agent_locations.WEBHOOK:
        return not references.contains(scalar.text)
    return loc in agent_locations.BASE_URLS and any(sign in scalar.text for sign in "@?#")


def _is_named_secret(root: Node, loc: Loc) -> bool:
    """True for the value of a key, or behind an option, whose name says that it is a secret."""
    if loc and isinstance(loc[-1], str):
        return secrets.is_secret_name(loc[-1])
    if loc and isinstance(loc[-1], int) and loc[-1] > 0:
        before = tree.at(root, (*loc[:-1], loc[-1] - 1))
        return isinstance(before, Scalar) and before.text.startswith("-") and secrets.is_secret_name(before.text)
    return False


def _mask(scalar: Scalar, report: Report) -> None:
    """Mask a value wherever it reaches to; a quoted or folded text may go on for several lines."""
    report.mask(scalar.span)
    for number in range(scalar.span.line + 1, scalar.last_line + 1):
        report.mask(Span(number, 1))


def _refuse(span: Span, report: Report) -> None:
    report.error(
        "MANIFEST-SECRET",
        "this looks like a secret",
        span,
        hint="keep it in the environment and name the variable; if it is a real one, revoke it now",
    )


def check_references(root: Table, environ: Mapping[str, str], report: Report) -> tuple[str, ...]:
    """Check every ``${NAME}``, and give the names of all variables that the manifest refers to or passes on."""
    found: set[str] = set()
    for loc, scalar in tree.scalars(root):
        pattern = _KEY_NAME if loc in agent_locations.KEYS else references.NAME
        if _names_only(loc) and pattern.fullmatch(scalar.text) and not report.is_settled(loc):
            found.add(scalar.text)
            is_key = loc in agent_locations.KEYS
            complaint = credentials.complaint(scalar.text, environ) if is_key or scalar.text not in environ else None
            if complaint is not None:
                otherwise = "name another variable" if is_key else "take it out of `env`"
                effect = "no agent is started" if scalar.text in environ else "the agent will run without it"
                report.warning(
                    "MANIFEST-ENV-UNSET",
                    f"{complaint}; {effect}",
                    scalar.span,
                    hint=f"export {scalar.text}, or {otherwise}",
                )
        elif references.contains(scalar.text):
            found |= _check_one(loc, scalar, environ, report)
    return tuple(sorted(found))


def _check_one(loc: Loc, scalar: Scalar, environ: Mapping[str, str], report: Report) -> set[str]:
    span = _reference_span(scalar, report)
    if not _may_refer(loc):
        report.error(
            "MANIFEST-ENV-NOT-ALLOWED",
            "a variable may not stand here",
            span,
            hint=_names_only(loc) or _WHERE,
        )
        return set()
    for text in references.malformed(scalar.text):
        report.error(
            "MANIFEST-WRONG-VALUE",
            f"`{report.shown(text)}` is no reference to a variable",
            span,
            hint="write ${NAME}, or $${ for a plain ${",
        )
    names = set(references.names(scalar.text))
    for name in sorted(names):
        if not environ.get(name):
            state = "is empty" if name in environ else "is not set"
            if loc == agent_locations.WEBHOOK:  # nothing but a message depends on it
                what = f"the variable {name} {state}; the daemon can tell nobody at this URL"
                report.warning("MANIFEST-ENV-UNSET", what, span, hint=f"export {name}=...")
                continue
            report.error("MANIFEST-ENV-UNSET", f"the variable {name} {state}", span, hint=f"export {name}=...")
    return names


def _may_refer(loc: Loc) -> bool:
    if loc[-1:] == ("model",) or loc in agent_locations.BASE_URLS or loc == agent_locations.WEBHOOK:
        return True
    return len(loc) > 1 and loc[-2] == "command" and "harness" in loc


def _names_only(loc: Loc) -> str | None:
    """What to write where a value is the name of a variable; None for all other places."""
    if loc in agent_locations.KEYS:
        return "write the name only, without ${}"
    is_of_a_list = len(loc) > 2 and loc[-3:-1] == ("harness", "env") and isinstance(loc[-1], int)
    return "list names only, without ${}" if is_of_a_list else None


def _reference_span(scalar: Scalar, report: Report) -> Span:
    """The place of the first reference inside a value, where the value stands on one line."""
    line = report.lines[scalar.span.line - 1] if scalar.span.line <= len(report.lines) else ""
    end = scalar.span.end_column - 1 if scalar.span.end_column is not None else len(line)
    found = _REFERENCE.search(line, scalar.span.column - 1, end)
    if found is None:
        return scalar.span
    return Span(scalar.span.line, found.start() + 1, found.end() + 1)
