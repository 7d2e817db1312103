"""Numbers of a generated server that a test of what was read only chooses: ``21.5 if raw > 20000 else 18.0``.

Such a number follows the device, and still no one measured it: it shows on which side of a bound the reading was. That
is a state, a boolean or a word. A count or a level of a few steps may be chosen so, a quantity with a unit may not.
And numbers of a folder or a file, in its name, show when it was changed or how many of it there are: they
follow the device as well, and no one measured them.
"""

import ast
import re
from collections.abc import Iterable, Iterator

from octoform.base.quantities import last_word, unit_of_name, unit_of_text
from octoform.contracts.model import JsonObject
from octoform.contracts.rules.serve.flow import Flow
from octoform.contracts.rules.serve.origins import PLACES, PURE, Origin, last
from octoform.contracts.server_source import Source, walk

Numbers = frozenset[float]
_DEPTH = 8
_STEPPED = frozenset({"%", None})
"""Units in which a number may stand for one of a few steps."""
_NAMES_OF_PATHS = frozenset({"name", "stem", "suffix"})
_LISTS = frozenset({"os.listdir", "os.scandir", "glob.glob", "glob.iglob", "runtime.files"})
_LISTING = frozenset({"iterdir", "glob", "rglob"})
_READS = frozenset({"read", "read_text", "read_bytes", "open", "readline", "recv"})
_TEXT_OF = frozenset({"read_text", "read_bytes"})
_BOUNDS = frozenset(
    {"max", "min", "crit", "lcrit", "emergency", "hyst", "limit", "label", "alarm", "threshold", "type"}
)
"""Last words of files that describe a channel, and not what it measures now."""
_BOUND_WORDS = re.compile(
    r"max|min|crit|emergency|hyst|limit|label|alarm|threshold|trip|highest|lowest|bound|range|peak|warn", re.IGNORECASE
)
_PASSES = frozenset({"float", "int", "round", "abs", "min", "max"})


class Chosen:
    """Which numbers of the file an expression chooses among; None where it is computed of something else as well."""

    def __init__(self, source: Source, flow: Flow) -> None:
        self._source, self._flow = source, flow

    def numbers(self, node: ast.AST | None, depth: int = _DEPTH) -> Numbers | None:
        """All numbers that the value can be; empty where it is None."""
        if depth == 0 or node is None:
            return None
        if isinstance(node, ast.Constant):
            return _number(node.value)
        if isinstance(node, ast.Name):
            return self._all(self._flow.plain(node), depth)
        if isinstance(node, ast.IfExp):
            return self._all([node.body, node.orelse], depth)
        if isinstance(node, ast.UnaryOp):
            return self._all([node.operand], depth)
        if isinstance(node, ast.BoolOp):
            return self._all([item for item in node.values if not _is_truth(item)], depth)
        if isinstance(node, ast.BinOp):
            return self._of_two(node, depth)
        if isinstance(node, ast.Subscript):
            return self._of_table(node, depth)
        return self._of_call(node, depth) if isinstance(node, ast.Call) else None

    def _all(self, nodes: Iterable[ast.AST], depth: int) -> Numbers | None:
        """The numbers of several, of which each is nothing but numbers."""
        parts = [self.numbers(item, depth - 1) for item in nodes]
        known = [item for item in parts if item is not None]
        return frozenset().union(*known) if parts and len(known) == len(parts) else None

    def _of_two(self, node: ast.BinOp, depth: int) -> Numbers | None:
        sides = [node.left, node.right]
        known = [self.numbers(item, depth - 1) for item in sides]
        if isinstance(node.op, ast.Mult) and frozenset({0.0}) in known:
            return frozenset({0.0})
        several = [item for item in known if item is not None and len(item) > 1]
        if len(several) == 1 and None not in known:
            return several[0]  # a scale, of which it is not known that it chooses anything
        return self._all([item for item in sides if not _is_truth(item)], depth)

    def _of_table(self, node: ast.Subscript, depth: int) -> Numbers | None:
        """A table whose place is a comparison has one of two values."""
        if not _is_truth(node.slice):
            return None
        tables = self._flow.plain(node.value) if isinstance(node.value, ast.Name) else [node.value]
        rows = [_rows(item) for item in tables]
        return self._all([item for row in rows for item in row], depth) if rows and all(rows) else None

    def _of_call(self, node: ast.Call, depth: int) -> Numbers | None:
        name = self._source.dotted(node.func)
        if name in _PASSES and not node.keywords:
            return self._all(node.args, depth)
        own = [item for item in self._source.functions if item.name == name]
        results = self._flow.results(own[0]) if len(own) == 1 and isinstance(node.func, ast.Name) else []
        return self._all(results, depth)


def is_of_environment(source: Source, flow: Flow, test: ast.expr, depth: int = 3) -> bool:
    """Whether a test asks the environment or the command line, of which no device knows: a mode of the server."""
    for item in walk(test):
        name = source.dotted(item) if isinstance(item, ast.Name | ast.Attribute | ast.Call) else ""
        if name.startswith(("os.environ", "os.getenv", "sys.argv")):
            return True
        values = flow.plain(item) if depth and isinstance(item, ast.Name) and isinstance(item.ctx, ast.Load) else []
        if any(isinstance(each, ast.expr) and is_of_environment(source, flow, each, depth - 1) for each in values):
            return True
    return False


def is_measured(site: ast.AST, name: str, units: Iterable[str | None], numbers: Numbers) -> bool:
    """Whether a member is a quantity with a unit, by its name, by the unit beside it, or since it has decimals."""
    if len(numbers) > 1 and numbers == frozenset(map(float, range(len(numbers)))):
        return False  # the numbers of a state
    beside = [unit_of_text(item) for item in _units_beside(site)]
    known = [unit_of_name(name), *units, *beside]
    return any(unit not in _STEPPED for unit in known) or any(not number.is_integer() for number in numbers)


Given = list[tuple[ast.AST, str, ast.expr]]
"""The members of records: where each is stored, its name and its value."""


def unmeasured(
    source: Source, flow: Flow, given: Given, units: dict[str, str | None], tool: JsonObject
) -> Iterator[tuple[str, ast.expr, str, str]]:
    """(member, value, what it is instead, what to do) of each that follows the device and is no measurement of it."""
    bounds = not _BOUND_WORDS.search(f"{tool['name']} {tool.get('description')}")
    for node, name, each in given:
        origin = flow.of(each)
        placed = origin & (Origin.FOUND | Origin.DEVICE | Origin.ARGUMENT)
        read = origin & (Origin.READ | Origin.SYSTEM | Origin.COUNTED | Origin.CLOCK)
        unread = (placed and not read) or _is_of_file(source, flow, each)
        if unread and is_measured(node, name, [units[name]], frozenset()):
            yield name, each, "a fact about a file or its name", "read the content of the file, or ask the device"
        files = {item.rpartition("/")[2] for item in _texts(flow, each) if "_" in item and " " not in item}
        if bounds and files and not _BOUND_WORDS.search(name) and all(last_word(item) in _BOUNDS for item in files):
            hint = "read the file of the measurement, or name the member and the tool after the bound"
            yield name, each, "a bound or a label of its channel", hint


def _texts(flow: Flow, node: ast.AST, depth: int = 6) -> Iterator[str]:
    """The texts of which an expression is made, those of its names too."""
    for item in walk(node):
        if isinstance(item, ast.Constant) and isinstance(item.value, str):
            yield item.value
        elif isinstance(item, ast.Name) and isinstance(item.ctx, ast.Load) and depth:
            for value in flow.plain(item):
                yield from _texts(flow, value, depth - 1)


def _is_of_file(source: Source, flow: Flow, node: ast.AST, depth: int = 8) -> bool:
    """Whether a value is made of what is known of a file that was found without reading it, and of nothing else."""
    if isinstance(node, ast.Attribute) and (node.attr in _NAMES_OF_PATHS or node.attr.startswith("st_")):
        return True
    if _counts_files(source, flow, node):
        return True
    if depth == 0 or isinstance(node, ast.Constant):
        return False
    if isinstance(node, ast.Name):
        values = flow.plain(node)
        return bool(values) and all(_is_of_file(source, flow, each, depth - 1) for each in values)
    if isinstance(node, ast.Call):
        own = [item for item in source.functions if isinstance(node.func, ast.Name) and item.name == node.func.id]
        if len(own) == 1:
            results = flow.results(own[0])
            return bool(results) and all(_is_of_file(source, flow, each, depth - 1) for each in results)
        name, method = source.dotted(node.func), isinstance(node.func, ast.Attribute) and node.func.attr in PLACES
        belongs = [node.func.value] if method and isinstance(node.func, ast.Attribute) else []
        parts: list[ast.expr] = [*belongs, *node.args] if method or PURE.fullmatch(name) else []
    else:
        parts = [item for item in ast.iter_child_nodes(node) if isinstance(item, ast.expr)]
    lines = [item for item in parts if flow.of(item) & (Origin.READ | Origin.SYSTEM)]
    return bool(lines) and all(_is_of_file(source, flow, item, depth - 1) for item in lines)


def _counts_files(source: Source, flow: Flow, node: ast.AST) -> bool:
    """Whether an expression is how many files there are, none of which was read, or how long the text of one is."""
    if not isinstance(node, ast.Call) or len(node.args) != 1:
        return False
    name, given = source.dotted(node.func), node.args[0]
    ones = isinstance(given, ast.GeneratorExp | ast.ListComp) and isinstance(given.elt, ast.Constant)
    if name == "len" and isinstance(given, ast.Call) and last(given.func) in _TEXT_OF:
        return True
    return (name == "len" or (name == "sum" and ones)) and _lists_files(source, flow, given)


def _lists_files(source: Source, flow: Flow, node: ast.AST, depth: int = 5) -> bool:
    if depth == 0:
        return False
    if isinstance(node, ast.Name):
        values = flow.plain(node)
        return bool(values) and all(_lists_files(source, flow, each, depth - 1) for each in values)
    if isinstance(node, ast.GeneratorExp | ast.ListComp | ast.SetComp):
        parts = [node.elt, *(test for one in node.generators for test in one.ifs)]
        called = [item.func for part in parts for item in walk(part) if isinstance(item, ast.Call)]
        read = any(getattr(item, "attr", getattr(item, "id", "")) in _READS for item in called)
        return not read and _lists_files(source, flow, node.generators[0].iter, depth - 1)
    if not isinstance(node, ast.Call):
        return False
    if source.dotted(node.func) in _LISTS or (isinstance(node.func, ast.Attribute) and node.func.attr in _LISTING):
        return True
    passed = source.dotted(node.func) in ("list", "sorted", "tuple", "set", "frozenset", "reversed") and node.args
    return bool(passed) and _lists_files(source, flow, node.args[0], depth - 1)


def _number(value: object) -> Numbers | None:
    if value is None:
        return frozenset()
    return None if isinstance(value, bool) or not isinstance(value, int | float) else frozenset({float(value)})


def _rows(node: ast.AST) -> list[ast.expr]:
    if isinstance(node, ast.Dict):
        return node.values
    return node.elts if isinstance(node, ast.List | ast.Tuple) else []


def _is_truth(node: ast.AST) -> bool:
    """Whether an expression is true or false and nothing else."""
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id in ("bool", "any", "all", "isinstance")
    if isinstance(node, ast.BoolOp):
        return all(map(_is_truth, node.values))
    return isinstance(node, ast.Compare) or (isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not))


def _units_beside(site: ast.AST) -> Iterator[object]:
    """The unit that a record has beside a number."""
    if isinstance(site, ast.Call):
        pairs = [(item.arg, item.value) for item in site.keywords]
    elif isinstance(site, ast.Dict):
        pairs = [
            (key.value, each)
            for key, each in zip(site.keys, site.values, strict=True)
            if isinstance(key, ast.Constant) and isinstance(key.value, str)
        ]
    else:
        pairs = []
    for name, value in pairs:
        if name is not None and last_word(name) in ("unit", "units") and isinstance(value, ast.Constant):
            yield value.value
