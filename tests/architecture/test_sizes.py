"""Sizes are held from the first commit, with no list of exceptions: a file or function that grows is split."""

import ast
import statistics
from pathlib import Path

from architecture.parsed import nodes, tree

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "octoform").rglob("*.py"))
GRAB_BAGS = {"utils", "util", "helpers", "helper", "common", "misc", "manager", "managers"}


def functions(path: Path) -> list[tuple[str, int, int]]:
    """(name, lines, parameters) of every function in a file."""
    out = []
    for node in nodes(path.read_text()):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
            count = len([argument for argument in arguments if argument.arg not in ("self", "cls")])
            out.append((f"{path.relative_to(ROOT)}:{node.name}", (node.end_lineno or 0) - node.lineno + 1, count))
    return out


def percentile95(values: list[int]) -> float:
    return statistics.quantiles(values, n=20)[-1]


def test_no_file_is_longer_than_500_lines() -> None:
    lengths = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in FILES}
    assert {name: lines for name, lines in lengths.items() if lines > 500} == {}


def test_most_files_are_at_most_450_lines() -> None:
    assert percentile95([len(path.read_text().splitlines()) for path in FILES]) <= 450


def test_functions_are_short_and_take_few_parameters() -> None:
    found = [item for path in FILES for item in functions(path)]
    assert [name for name, lines, _ in found if lines > 60] == []
    assert [name for name, _, count in found if count > 6] == []
    assert percentile95([lines for _, lines, _ in found]) <= 40


def test_every_module_says_why_it_exists_and_none_is_a_grab_bag() -> None:
    assert [str(path) for path in FILES if {path.stem, path.parent.name} & GRAB_BAGS] == []
    assert [str(path) for path in FILES if not ast.get_docstring(tree(path.read_text()))] == []
