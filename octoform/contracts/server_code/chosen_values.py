"""Numbers of a generated server that a test of what was read only chooses: ``21.5 if raw > 20000 else 18.0``.

Such a number follows the device, and still no one measured it: it shows on which side of a bound the reading was. That
is a state, a boolean or a word. A count or a level of a few steps may be chosen so, a quantity with a unit may not.
And numbers of a folder or a file, in its name, show when it was changed or how many of it there are: they
follow the device as well, and no one measured them.
"""

import ast
import re
from collections.abc import Iterable, Iterator
from typing import Any, TypeGuard

from octoform.base.quantities import last_word, unit_of_name, unit_of_text
from octoform.contracts.model import JsonObject
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import PLACES, PURE, Origin, arguments, last
from octoform.contracts.server_code.places import folded
from octoform.contracts.server_code.server_source import Function, Source, children, walk
from octoform.patterns import regex

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
_BOUND_WORDS = regex(
    r"max|min|crit|emergency|hyst|limit|label|alarm|threshold|trip|highest|lowest|bound|range|peak|warn", re.IGNORECASE
)
_PASSES = frozenset({"float", "int", "round", "abs", "min", "max"})
_CLIPS = frozenset({"numpy.clip", "np.clip"})
_MEANS = regex(r"(?:statistics|numpy|np)\.(?:fmean|mean|median|average)|mean|fmean|median")
_OF_COMPUTER = regex(
    r"(?:^|.*/)proc/(?:loadavg|uptime|stat|vmstat|meminfo|schedstat|softirqs|interrupts|swaps|slabinfo|buddyinfo|zoneinfo"
    r"|timer_list|version|cmdline|pressure/.*|self/.*|\d+/.*|sys/(?:kernel|vm|fs)/.*)"
)
"""Files in which the kernel reports of the computer itself (proc(5)), and of no device."""
_ASKS_COMPUTER = regex(
    r"os\.(?:getloadavg|times|cpu_count|sysconf)|resource\.get\w+"
    r"|psutil\.(?:cpu_\w+|virtual_memory|swap_memory|getloadavg|pids|boot_time|process_iter|users|net_io_counters)"
)
_COMPUTER_WORDS = regex(
    r"(?i)(?<![a-z])(?:load(?:avg)?|uptime|memory|process(?:es)?|interrupts?|swap|entropy|utili[sz]ation|usage|boot|stall)"
    r"(?![a-z])"
)
_DIGESTS = regex(r"hash|id|zlib\.(?:crc32|adler32)|binascii\.crc\w+|hashlib\..+")
_TEXTS = frozenset({"read_text", "read_bytes", "decode", "strip", "rstrip", "readline"})


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
            found = self._all([node.operand], depth)
            return frozenset(-each for each in found) if found and isinstance(node.op, ast.USub) else found
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
    words = f"{tool['name']} {tool.get('description')}"
    bounds = not _BOUND_WORDS.search(words)
    altered = _Altered(source, flow)
    for node, name, each in given:
        if is_measured(node, name, [units[name]], frozenset()) or units[name] is not None:
            what, cure = altered.at(each, declared_numbers(tool.get("output_schema"), name), units[name])
            if what == _COMPUTERS and _COMPUTER_WORDS.search(f"{words} {name}".replace("_", " ")):
                continue
            if what:
                yield name, each, what, cure
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
        parts = [item for item in children(node) if isinstance(item, ast.expr)]
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


_COMPUTERS = "a figure of the computer's kernel"
_Found = tuple[str, str]


class _Altered:
    """What a reading was made into on its way into a result."""

    def __init__(self, source: Source, flow: Flow) -> None:
        self._source, self._flow, self._chosen = source, flow, Chosen(source, flow)
        self._names: dict[Function, set[str]] = {}

    def at(self, node: ast.expr, declared: Numbers | None, unit: str | None) -> _Found:
        """(what a member is instead of its reading, what to do); empty where it is the reading."""
        allowed = (declared or frozenset()) | ({0.0, 100.0} if unit == "%" else {0.0})
        parts = list(self._reached(node))
        bounds = [each for item, scaled in parts for each in self._bounds(item, scaled)]
        found = [bound for bound, scaled in bounds if bound not in allowed and not (scaled and declared)]
        cut = next(iter(found), None)
        if cut is not None:
            hint = (
                "return what was read; where the device ends there, declare it as minimum or maximum in output_schema"
            )
            return f"cut off at {cut:g}", hint
        if self._is_of_computer(node, set()):
            return _COMPUTERS, "read the device; the load, the memory and the uptime are those of the computer"
        if any(self._is_mean(item) for item, _ in parts):
            return "a mean with a number of this file", "return what was read, or a mean of several readings"
        if any(self._is_digest(item) for item, _ in parts):
            return "the length or a hash of a string", "convert the string itself: float(text), struct.unpack"
        return "", ""

    def _reached(self, node: ast.expr) -> Iterator[tuple[ast.expr, bool]]:
        """(part, whether the value is scaled afterwards) of each expression by way of which a value comes about."""
        seen, waiting = set[ast.expr](), [(node, False)]
        while waiting:
            item, scaled = waiting.pop()
            if item not in seen:
                seen.add(item)
                yield item, scaled
                waiting += [(each, scaled or isinstance(item, ast.BinOp)) for each in self._steps(item)]

    def _bounds(self, node: ast.expr, scaled: bool) -> Iterator[tuple[float, bool]]:
        """(bound, whether the value is scaled afterwards) of each constant at which a reading is cut off."""
        if isinstance(node, ast.Name):
            yield from self._set_beyond(node, scaled)
        sides: list[ast.expr] = []
        if isinstance(node, ast.Call) and (self._name(node) in ("min", "max") or self._name(node) in _CLIPS):
            sides = list(node.args) if len(node.args) > 1 else []
        elif isinstance(node, ast.IfExp) and isinstance(node.test, ast.Compare):
            tested = {ast.unparse(item) for item in (node.test.left, *node.test.comparators)}
            sides = [node.body, node.orelse] if {ast.unparse(node.body), ast.unparse(node.orelse)} <= tested else []
        if any(self._is_read(item) for item in sides):
            numbers = [self._chosen.numbers(item) for item in sides]
            yield from ((number, scaled) for each in numbers if each is not None for number in each)

    def _set_beyond(self, node: ast.Name, scaled: bool) -> Iterator[tuple[float, bool]]:
        """``if value > 50: value = 50``"""
        for value in self._flow.plain(node):
            above = next((item for item, _ in self._source.above(value) if isinstance(item, ast.If)), None)
            numbers = self._chosen.numbers(value) or frozenset()
            tests = [item for item in walk(above.test) if isinstance(item, ast.Compare)] if above is not None else []
            for test in tests:
                sides = (test.left, *test.comparators)
                own = any(isinstance(item, ast.Name) and item.id == node.id for item in sides)
                if own and any(self._chosen.numbers(item) == numbers for item in sides):
                    yield from ((number, scaled) for number in numbers)

    def _steps(self, node: ast.expr) -> list[ast.expr]:
        """The parts of an expression that are in its value, and not what divides it."""
        if isinstance(node, ast.Name):
            return [item for item in self._flow.plain(node) if isinstance(item, ast.expr)]
        if isinstance(node, ast.BinOp):
            return [node.left] if isinstance(node.op, ast.Div | ast.FloorDiv | ast.Mod) else [node.left, node.right]
        if isinstance(node, ast.IfExp):
            return [node.body, node.orelse]
        if isinstance(node, ast.Call) and (self._name(node) in _PASSES or self._name(node) in _CLIPS):
            return list(node.args)
        own = self._own(node)
        if own is not None and isinstance(node, ast.Call) and any(map(self._is_read, node.args)):
            return [item for item in (*self._flow.results(own), *node.args) if isinstance(item, ast.expr)]
        return [node.operand] if isinstance(node, ast.UnaryOp) else []

    def _name(self, node: ast.Call) -> str:
        return self._source.dotted(node.func)

    def _is_read(self, node: ast.AST) -> bool:
        return bool(self._flow.of(node) & (Origin.READ | Origin.SYSTEM))

    def _is_of_computer(self, node: ast.AST, seen: set[ast.AST]) -> bool:
        """Whether what the kernel reports of the computer goes into a value, by way of functions of the file too.

        What divides is not in it: the computer's uptime is a clock as good as any for a rate.
        """
        if node in seen:
            return False
        seen.add(node)
        for item in self._undivided(node):
            text = folded(self._source, self._flow, item) if isinstance(item, ast.Constant | ast.BinOp) else None
            if text is not None and _OF_COMPUTER.fullmatch(text):
                return True
            if isinstance(item, ast.Call) and _ASKS_COMPUTER.fullmatch(self._name(item)):
                return True
            if any(self._is_of_computer(each, seen) for each in self._behind(item)):
                return True
        return False

    def _undivided(self, node: ast.AST) -> Iterator[ast.AST]:
        """The nodes of an expression that are in its value: no divisor, and no argument that a function divides by."""
        waiting = [node]
        while waiting:
            item = waiting.pop()
            yield item
            parts = list(children(item))
            if isinstance(item, ast.BinOp) and isinstance(item.op, ast.Div | ast.FloorDiv):
                parts = [item.left]
            own = self._own(item)
            if own is not None and isinstance(item, ast.Call):
                used = self._returned_names(own)
                names = [each.arg for each in arguments(own)]
                parts = [each for name, each in zip(names, item.args, strict=False) if name in used]
                parts += [each.value for each in item.keywords if each.arg in used or each.arg is None]
            waiting += parts

    def _returned_names(self, function: Function) -> set[str]:
        """The names that are in what a function returns, by way of its other names too, and do not only divide it."""
        if function not in self._names:
            found = self._names[function] = set()
            waiting: list[ast.AST] = [*self._flow.results(function)]
            while waiting:
                for item in filter(_is_load, self._undivided(waiting.pop())):
                    waiting += self._flow.plain(item) if item.id not in found else []
                    found.add(item.id)
        return self._names[function]

    def _own(self, node: ast.AST) -> Function | None:
        """The function of the file that is called, or the method of one of its classes (``Guard.inside(value)``)."""
        called = node.func if isinstance(node, ast.Call) else None
        if isinstance(called, ast.Attribute):
            classes = {item.name for item in self._source.classes}
            name = called.attr if isinstance(called.value, ast.Name) and called.value.id in classes else None
        else:
            name = called.id if isinstance(called, ast.Name) else None
        own = [each for each in self._source.functions if each.name == name]
        return own[0] if len(own) == 1 else None

    def _behind(self, node: ast.AST) -> list[ast.AST]:
        """What a name stands for, a file that was opened too, or a call of a function of the file returns."""
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            reaching = self._flow.bindings.reaching(node)[0]
            opened = [each.value for each in reaching if each.whole and isinstance(each.node, ast.With)]
            return [*self._flow.plain(node), *opened]
        own = self._own(node)
        return [*self._flow.results(own)] if own is not None else []

    def _is_mean(self, node: ast.expr) -> bool:
        """Whether a reading is taken together with a number of the file, as a mean or half the sum of a kernel's."""
        if isinstance(node, ast.Call) and node.args and _MEANS.fullmatch(self._name(node)):
            return self._mixes(self._rows(node.args[0]), 0)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            count = self._chosen.numbers(node.right)
            terms = self._terms(node.left)
            inputs = any(text.endswith("_input") for text in _texts(self._flow, node.left))
            own = inputs and len(terms) > 1 and count == frozenset({float(len(terms))})
            return own and self._mixes(terms, len(terms))
        return False

    def _mixes(self, terms: list[ast.expr], least: float) -> bool:
        """Whether some terms were read, and another is a number of the file that is no rounding."""
        numbers = [self._chosen.numbers(item) or frozenset() for item in terms]
        made_up = any(abs(number) > least for each in numbers for number in each)
        return made_up and any(self._is_read(item) for item in terms)

    def _rows(self, node: ast.expr) -> list[ast.expr]:
        values = self._flow.plain(node) if isinstance(node, ast.Name) else [node]
        return [item for each in values if isinstance(each, ast.List | ast.Tuple) for item in each.elts]

    def _terms(self, node: ast.expr, depth: int = _DEPTH) -> list[ast.expr]:
        """The terms of a sum."""
        if depth == 0:
            return [node]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
            return [*self._terms(node.left, depth - 1), *self._terms(node.right, depth - 1)]
        if isinstance(node, ast.Call) and self._name(node) == "sum" and len(node.args) == 1:
            return self._rows(node.args[0])
        values = self._flow.plain(node) if isinstance(node, ast.Name) else []
        sums = [item for item in values if isinstance(item, ast.BinOp) and isinstance(item.op, ast.Add)]
        return self._terms(sums[0], depth - 1) if len(values) == len(sums) == 1 else [node]

    def _is_digest(self, node: ast.expr) -> bool:
        """Whether a value is the length, the hash or the check sum of a string that was read."""
        if isinstance(node, ast.Call) and len(node.args) == 1 and self._is_read(node.args[0]):
            name = self._name(node)
            if _DIGESTS.fullmatch(name) or (name == "len" and self._is_text(node.args[0])):
                return True
        if isinstance(node, ast.Call) and self._name(node) == "int.from_bytes" and node.args:
            parts = [item for item in walk(node.args[0]) if isinstance(item, ast.Call)]
            return any(_DIGESTS.fullmatch(self._name(item)) for item in parts)
        return False

    def _is_text(self, node: ast.expr, depth: int = 4) -> bool:
        if isinstance(node, ast.Name):
            values = self._flow.plain(node) if depth else []
            return bool(values) and all(
                isinstance(item, ast.expr) and self._is_text(item, depth - 1) for item in values
            )
        return isinstance(node, ast.Call) and (last(node.func) in _TEXTS or self._name(node) == "str")


def _is_load(node: ast.AST) -> TypeGuard[ast.Name]:
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)


def declared_numbers(schema: Any, name: str) -> Numbers | None:
    """The bounds that INTERFACE declares of a member, at any depth, and the numbers in its description."""
    found: set[float] = set()
    if isinstance(schema, list):
        found = {number for item in schema for number in declared_numbers(item, name) or ()}
    elif isinstance(schema, dict):
        members = schema.get("properties")
        member = members.get(name) if isinstance(members, dict) else None
        for form in (member, *member.get("anyOf", ())) if isinstance(member, dict) else ():
            sides = [form.get(side) for side in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")]
            found |= {float(side) for side in sides if isinstance(side, int | float)}
            found |= {float(text) for text in re.findall(r"-?\d+(?:\.\d+)?", str(form.get("description", "")))}
        found |= {number for item in schema.values() for number in declared_numbers(item, name) or ()}
    return frozenset(found) or None
