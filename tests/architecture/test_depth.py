"""A module is deep: one that is short and has a single reader lies in its reader.

Entry points are read by no module. A reader that imports a module inside a function alone, or for its types, keeps what
it brings out of programs that do not need it: a reason of its own. Links are read beside the server too.
"""

import ast
import tomllib
from collections import defaultdict
from pathlib import Path

from architecture.parsed import tree

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "octoform"
SHORT = 60


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def read_at_once(module: ast.Module) -> set[str]:
    """What a module imports when it is imported itself: as modules, and as names of modules."""
    nodes = [node for node in module.body if isinstance(node, ast.Import | ast.ImportFrom)]
    whole = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    origins = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    return whole | {
        each for node in origins for each in (node.module or "", *(f"{node.module}.{a.name}" for a in node.names))
    }


def shallow(modules: dict[str, tuple[int, set[str]]], entries: set[str]) -> dict[str, str]:
    """Each short module that one module alone reads, with that one; ``modules`` has lines and what is read."""
    readers = defaultdict(list)
    for reader, (_, read) in modules.items():
        for name in read & modules.keys():
            readers[name].append(reader)
    short = [name for name, (lines, _) in modules.items() if lines < SHORT and name not in entries]
    return {name: readers[name][0] for name in short if len(readers[name]) == 1}


def test_a_short_module_with_one_reader_lies_in_its_reader() -> None:
    files = [path for path in sorted(PACKAGE.rglob("*.py")) if path.name not in ("__init__.py", "__main__.py")]
    texts = {module_of(path): path.read_text() for path in sorted(PACKAGE.rglob("*.py"))}
    modules = {name: (len(text.splitlines()), read_at_once(tree(text))) for name, text in texts.items()}
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"].values()
    linked = {module_of(path.resolve()) for path in files if path.is_symlink()}
    rest = modules.keys() - {module_of(path) for path in files}
    entries = {entry.partition(":")[0] for entry in scripts} | linked | rest
    assert shallow(modules, entries) == {}


def test_the_rule_sees_a_short_module_with_one_reader_and_no_other() -> None:
    modules = {
        "a": (10, set()),
        "b": (10, set()),
        "c": (70, set()),
        "one": (100, {"a", "b", "c"}),
        "two": (100, {"b", "outside"}),
    }
    assert shallow(modules, set()) == {"a": "one"}
    assert shallow(modules, {"a"}) == {}


def test_the_rule_takes_what_is_read_inside_a_function_for_a_reason() -> None:
    assert read_at_once(ast.parse("from x import y\ndef f():\n    from x import z\n")) == {"x", "x.y"}
