"""Programs of the system that an accepted server starts and that are not on this host's PATH."""

import shutil

from octoform.contracts.rules.serve.programs import tools_starting
from octoform.state.files import read_regular
from octoform.state.layout import Layout


def missing_programs(layout: Layout) -> dict[str, list[str]]:
    """Each program that is missing to the tools that need it."""
    path = layout.output("serve")
    if not path.is_file():
        return {}
    text = read_regular(path)[0]
    if not text:
        return {}
    needed = tools_starting(text.decode("utf-8", "replace"))
    return {program: tools for program, tools in sorted(needed.items()) if not is_here(program)}


def is_here(program: str) -> bool:
    """Whether a program can be started by its name or path."""
    return shutil.which(program) is not None
