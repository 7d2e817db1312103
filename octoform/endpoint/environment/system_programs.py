"""Programs of the system that tools go through and that the host lacks.

A recorded host is asked where its programs were recorded; otherwise nothing is known of them, for those of the machine
that works on the recording say nothing.
"""

import shutil
import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.base.shape import fits
from octoform.contracts.rules.serve.code_rules import started_blindly, tools_starting
from octoform.contracts.server_code.server_source import Source, read_source
from octoform.host import SYSROOT_VARIABLE
from octoform.patterns import regex
from octoform.state.files import read_regular
from octoform.state.layout import Layout

FOLDERS = ("usr/local/sbin", "usr/local/bin", "usr/sbin", "usr/bin", "sbin", "bin")
COMMANDS = "var/lib/command-not-found/commands.db"
"""Where Debian keeps which package has which program, if that was installed."""
_NAMED = regex(
    r"`([a-z][\w.+-]+)(?= -)[^`]*`|\b([a-z][\w.+-]*\w) --?[a-z]"
    r"|\b(?:program|utility) `?([a-z][\w.+-]*\w)`?(?= *(?:[-.,;()]|of|$))"
)


def named_programs(interface: Mapping[str, Any], environ: Mapping[str, str]) -> dict[str, list[str]]:
    """Each program that tools say they go through, and that the host lacks, to these tools.

    A program is what stands with an option (``smartctl -j``), or what is called one.
    """
    out: dict[str, list[str]] = {}
    for tool in interface["tools"]:
        result = tool["description"].rpartition("Through:")[2]
        for program in sorted({next(filter(None, found)) for found in _NAMED.findall(result)}):
            if lacks(program, environ):
                out.setdefault(program, []).append(tool["name"])
    return out


def package_of(program: str, environ: Mapping[str, str]) -> str | None:
    """The package that has a program, where the host's own database reports that."""
    path = Path(environ.get(SYSROOT_VARIABLE) or "/") / COMMANDS
    if not path.is_file():
        return None
    wanted = "SELECT name FROM packages JOIN commands USING (pkgID) WHERE command = ? ORDER BY priority DESC"
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
            row = database.execute(wanted, (program,)).fetchone()
    except sqlite3.Error:
        return None  # of another release: it is only a hint
    return str(row[0]) if row else None


def missing_programs(layout: Layout, environ: Mapping[str, str]) -> dict[str, list[str]]:
    """Each program that is missing to the tools that need it, by their descriptions in INTERFACE.

    A program that INTERFACE does not name is the server's own choice: the test finds it, and SERVE takes another way.
    A server or an INTERFACE that was damaged names none: plan and status report the damage.
    """
    text, named = _text(layout, "serve"), _descriptions(layout)
    needed = tools_starting(text) if named and isinstance(read_source(text), Source) else {}
    out = {}
    for program, tools in sorted(needed.items()):
        meant = [name for name in tools if program in named.get(name, "").replace("`", " ").replace(",", " ").split()]
        if meant and lacks(program, environ):
            out[program] = meant
    return out


def chosen_programs(text: str, interface: object, environ: Mapping[str, str]) -> dict[str, int]:
    """Missing programs that a server starts by its own choice without reporting their absence: name to line."""
    tools = interface.get("tools", []) if isinstance(interface, dict) else []
    named = {word for tool in tools for word in _words(str(tool["description"]))}
    return {
        name: line for name, line in sorted(started_blindly(text).items()) if name not in named and lacks(name, environ)
    }


def _words(description: str) -> list[str]:
    plain = f"{description} ".replace(". ", " ").replace(".\n", " ")
    return plain.replace("`", " ").replace(",", " ").split()


def _text(layout: Layout, stage: str) -> str:
    path = layout.output(stage)
    data = read_regular(path)[0] if path.is_file() else None
    return (data or b"").decode("utf-8", "replace")


def _descriptions(layout: Layout) -> dict[str, str]:
    """Tool to its description in INTERFACE; empty where there is no INTERFACE that could be read."""
    try:
        document = files.parse(_text(layout, "interface"))
    except ValueError:
        return {}
    tools = document.get("tools", []) if isinstance(document, dict) else []
    return {
        tool["name"]: f"{tool['description']} ".replace(". ", " ").replace(".\n", " ")
        for tool in (tools if isinstance(tools, list) else ())
        if fits(tool, {"name": str, "description": str})
    }


def lacks(program: str, environ: Mapping[str, str]) -> bool:
    """Whether the host is known to lack a program."""
    recorded = environ.get(SYSROOT_VARIABLE)
    if not recorded:
        return shutil.which(program) is None
    folders = [folder for folder in (Path(recorded) / name for name in FOLDERS) if folder.is_dir()]
    return bool(folders) and not any(
        (folder / Path(program).name).is_symlink() or (folder / Path(program).name).exists() for folder in folders
    )
