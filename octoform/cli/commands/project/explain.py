"""``explain``: the long story of a diagnostic code."""

from argparse import Namespace
from pathlib import Path

from octoform.diagnostics.explain import codes, unknown_code
from octoform.diagnostics.explain import explain as page_of
from octoform.views.format import output, problems
from octoform.views.format.console import Console


def run(arguments: Namespace, _: Path, screen: Console) -> int:
    """The page of a code, or the list of all codes."""
    if arguments.code is None:
        return output.codes(screen, codes(), as_json=arguments.json)
    code = arguments.code.upper()
    text = page_of(code)
    if text is None:
        return problems.show(screen, [unknown_code(code)], as_json=arguments.json)
    return output.page(screen, code, text, as_json=arguments.json)
