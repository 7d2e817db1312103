"""The long story of each code: one page of prose for each, shipped beside this module.

``octoform explain CODE`` prints a page. The pages are files so that writing one needs no code, and so that a test
can hold codes and pages against each other.
"""

import re
from importlib import resources

from octoform.diagnostics import Diagnostic, did_you_mean, error

_PAGES = resources.files("octoform.diagnostics") / "pages"
_CODE = re.compile(r"[A-Z][A-Z0-9]*(?:-[A-Z0-9]+)+")


def explain(code: str) -> str | None:
    """The page of a code in markdown, its first line ``# CODE: title``; None when there is no such code.

    Letter case and surrounding blanks do not matter.
    """
    wanted = code.strip().upper()
    if _CODE.fullmatch(wanted) is None:
        return None
    page = f"{wanted}.md"
    return (_PAGES / page).read_text("utf-8") if (_PAGES / page).is_file() else None


def codes() -> list[str]:
    """Every code that has a page, in alphabetical order."""
    folder = resources.files("octoform.diagnostics") / "pages"
    names = [entry.name.removesuffix(".md") for entry in folder.iterdir() if entry.name.endswith(".md")]
    return sorted(name for name in names if _CODE.fullmatch(name))


def unknown_code(code: str) -> Diagnostic:
    """EXPLAIN-UNKNOWN-CODE, with the nearest code as a hint."""
    near = did_you_mean(code.strip().upper(), codes())
    hint = f"did you mean {near}?" if near else "`octoform explain` without a code lists all of them"
    return error("EXPLAIN-UNKNOWN-CODE", f"there is no page for {code!r}", hint=hint)
