"""Programs of the system that an accepted server starts and that are not on this host's PATH."""

import shutil

from octoform.base import files
from octoform.contracts.rules.serve.programs import started_blindly, tools_starting
from octoform.state.files import read_regular
from octoform.state.layout import Layout


def missing_programs(layout: Layout) -> dict[str, list[str]]:
    """Each program that is missing to the tools that need it, as INTERFACE says of them.

    A program that INTERFACE does not name is the server's own choice: the trial finds it, and SERVE takes another way.
    """
    text, named = _text(layout, "serve"), _descriptions(layout)
    needed = tools_starting(text) if text and named else {}
    out = {}
    for program, tools in sorted(needed.items()):
        meant = [name for name in tools if program in named.get(name, "").replace("`", " ").replace(",", " ").split()]
        if meant and not is_here(program):
            out[program] = meant
    return out


def chosen_programs(text: str, interface: object) -> dict[str, int]:
    """What a server starts of its own choice, that is not here, and whose absence it does not report: name to line."""
    tools = interface.get("tools", []) if isinstance(interface, dict) else []
    named = {word for tool in tools for word in _words(str(tool["description"]))}
    return {
        name: line for name, line in sorted(started_blindly(text).items()) if name not in named and not is_here(name)
    }


def _words(description: str) -> list[str]:
    plain = f"{description} ".replace(". ", " ").replace(".\n", " ")
    return plain.replace("`", " ").replace(",", " ").split()


def _text(layout: Layout, stage: str) -> str:
    path = layout.output(stage)
    data = read_regular(path)[0] if path.is_file() else None
    return (data or b"").decode("utf-8", "replace")


def _descriptions(layout: Layout) -> dict[str, str]:
    """Tool to what INTERFACE says of it; empty where there is no INTERFACE that could be read."""
    try:
        document = files.parse(_text(layout, "interface"))
    except ValueError:
        return {}
    tools = document.get("tools", []) if isinstance(document, dict) else []
    return {tool["name"]: f"{tool['description']} ".replace(". ", " ").replace(".\n", " ") for tool in tools}


def is_here(program: str) -> bool:
    """Whether a program can be started by its name or path."""
    return shutil.which(program) is not None
