"""The stage: the INTERFACE artifact in, ``server.py`` out.

The same artifact always gives the same bytes. Types and parameters are written from the artifact's own schemas, so the
server's schemas are equal to them by construction; the templates hold only what a tool does.
"""

import ast
from collections.abc import Mapping, Sequence
from typing import Any

from octoform.base.source_lines import counted
from octoform.builtin.grammars import Profiles
from octoform.builtin.serve.assemble import assemble
from octoform.builtin.task import Refused, Task

MOST_LINES = 500


def run(task: Task) -> str:
    """Write server.py; the summary line (``server.py: 9 tools, 213 lines``). Refused says why there can be none."""
    interface = task.read_input()
    text = render(interface, task.profiles)
    task.write(text)
    tools = len(interface["tools"])
    return f"server.py: {tools} tool{'s' * (tools != 1)}, {text.count(chr(10))} lines"


def render(interface: Mapping[str, Any], profiles: Profiles = ()) -> str:
    """The server's source; Refused for a tool without a template, and for a server longer than the protocol allows."""
    try:
        text = assemble(interface["tools"], profiles)
        ast.parse(text)
    except (KeyError, TypeError, AttributeError, SyntaxError) as problem:
        raise Refused(f"the INTERFACE artifact cannot be rendered: {type(problem).__name__}: {problem}") from problem
    if (count := len(counted(text))) > MOST_LINES:
        raise Refused(
            f"the server would have {count} lines, more than {MOST_LINES}; lower budget.tools in the manifest"
        )
    return text


def lines(tools: Sequence[Mapping[str, Any]], profiles: Profiles = ()) -> int:
    """How many lines a person has to read of a server of these tools."""
    return len(counted(assemble(tools, profiles)))
