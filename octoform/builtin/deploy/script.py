"""What a server's text says about itself: the dependencies in its header (PEP 723) and the modules that it imports."""

import ast
import re
import sys
import tomllib
from dataclasses import dataclass

from octoform.builtin.task import Refused

_BLOCK = re.compile(r"(?m)^# /// script\r?\n((?:^#(?: .*)?\r?\n)+?)^# ///\s*$")
_REQUIREMENT = re.compile(r"^\s*([A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?)\s*(?:\[[^\]]*\]\s*)?([^@/]*)$")
BESIDE = "runtime"


@dataclass(frozen=True, slots=True)
class Script:
    """``requirements`` maps a normalised name to the requirement as written; ``modules`` a top-level module that is
    not of the standard library to whether it is imported only inside functions."""

    python: str
    requirements: dict[str, str]
    standard: tuple[str, ...]
    modules: dict[str, bool]
    uses_runtime: bool


def read_script(text: str) -> Script:
    """The facts of a server; Refused when it is no Python or has no usable header."""
    python, listed = _header(text)
    imports = _imports(text)
    foreign = {name: inside for name, inside in imports.items() if name not in sys.stdlib_module_names}
    return Script(
        python=python,
        requirements={normalised(_name(item)): item for item in listed},
        standard=tuple(sorted(name for name in imports if name in sys.stdlib_module_names)),
        modules={name: inside for name, inside in sorted(foreign.items()) if name != BESIDE},
        uses_runtime=BESIDE in imports,
    )


def normalised(name: str) -> str:
    """A distribution name in the one spelling by which names are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).casefold()


def _header(text: str) -> tuple[str, list[str]]:
    blocks = _BLOCK.findall(text)
    if len(blocks) != 1:
        raise Refused(f"server.py has {len(blocks) or 'no'} script headers, and one is needed")
    try:
        table = tomllib.loads("".join(line[2:] or "\n" for line in blocks[0].splitlines(keepends=True)))
    except tomllib.TOMLDecodeError as problem:
        raise Refused(f"the script header of server.py is not TOML: {problem}") from problem
    listed, python = table.get("dependencies"), table.get("requires-python")
    if not isinstance(listed, list) or not all(isinstance(item, str) for item in listed):
        raise Refused("the script header of server.py has no list of dependencies")
    return python if isinstance(python, str) else "", listed


def _name(requirement: str) -> str:
    match = _REQUIREMENT.match(requirement)
    if match is None:
        raise Refused(f"the dependency {requirement[:80]!r} is no name with a range of versions")
    return match[1]


def _imports(text: str) -> dict[str, bool]:
    """Top-level module to whether all of its imports are inside functions."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError) as problem:
        raise Refused(f"server.py does not compile: {problem}") from problem
    found: dict[str, bool] = {}

    def visit(node: ast.AST, inside: bool) -> None:
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        for name in names:
            top = name.partition(".")[0]
            found[top] = found.get(top, True) and inside
        within = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            visit(child, within)

    visit(tree, inside=False)
    return found
