"""The long story of each code: one page of prose for each, shipped beside this module.

``octoform explain CODE`` prints a page. The pages are files so that writing one needs no code, and so that a test
can hold codes and pages against each other.
"""

import re
from importlib import resources

_CODE = re.compile(r"[A-Z][A-Z0-9]*(?:-[A-Z0-9]+)+")


def explain(code: str) -> str | None:
    """The page of a code in markdown, its first line ``# CODE: title``; None when there is no such code.

    Letter case and surrounding blanks do not matter.
    """
    wanted = code.strip().upper()
    if _CODE.fullmatch(wanted) is None:
        return None
    page = resources.files("octoform.diagnostics") / "pages" / f"{wanted}.md"
    return page.read_text("utf-8") if page.is_file() else None


def codes() -> list[str]:
    """Every code that has a page, in alphabetical order."""
    folder = resources.files("octoform.diagnostics") / "pages"
    names = [entry.name.removesuffix(".md") for entry in folder.iterdir() if entry.name.endswith(".md")]
    return sorted(name for name in names if _CODE.fullmatch(name))
