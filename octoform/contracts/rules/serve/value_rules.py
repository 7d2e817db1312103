"""Rules for SERVE about the numbers of a result: each was read, none is written in the file and none is in.

A number that the file's author made up looks like a reading to anyone who receives it, and is believed.
"""

import ast
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from octoform.base.escaping import display
from octoform.base.quantities import unit_in, unit_of_name
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.server_code.chosen_values import Chosen, is_measured, is_of_environment, unmeasured
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.kept_values import Kept
from octoform.contracts.server_code.origins import Origin, last
from octoform.contracts.server_code.server_source import Source, children, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

_AGAIN = "read it in each call; where the device can be asked only so often, let the caller wait or be refused"
_OPTIONAL = ("offset", "scale", "count", "errors", "errno", "retries", "index", "timeout", "multiplier")
_STATIC = regex(
    r"(?:^|_)(?:max|maximum|min|minimum|limit|limits|range|width|height|resolution|fps|rate|baud|version|index|channel"
    r"|channels|id|number|count|samples|bits|depth|scale|step|steps|precision|accuracy|interval|timeout|size|format"
    r"|port|address|capacity|rated|nominal|full|length|total|failed|errors|retries|attempts|threshold|critical)(?:$|_)"
)
"""Members that may be known beforehand, or are no readings."""
_DRAWN = regex(
    r"(?:.*\.)?random\.(?:random|uniform|gauss|normal\w*|randint|randrange|triangular|randn?|\w*variate)"
    r"|secrets\.rand(?:below|bits)|(?:.*\.)?(?:default_rng|RandomState|SystemRandom|Random)\(\)\.\w+"
)
_BLANK = regex(r"(?:numpy|np)\.(?:zeros|ones|full|empty)(?:_like)?|(?:PIL\.)?Image\.new")
"""A picture of one colour."""
_SUBSTITUTING = (ast.Try, ast.With, ast.BoolOp, ast.IfExp, ast.If, ast.match_case, ast.Call)
_BROAD = frozenset({"Exception", "BaseException", "OSError", "IOError", "DeviceFault", "DeviceAbsent", "BusBusy"})


def default_reading(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading that failed is an error or null, never a number that looks like a reading."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "let the error pass, raise ToolError with what failed, or return None where output_schema allows null"
    served = list(served_tools(source, artifacts))
    used = {function for site, _ in served for function in source.entered_from(tool_functions(source, site))}
    read = {name: unit for _, tool in served for name, unit in numbers_read(tool.get("output_schema") or {})}
    kept, substitutes, stored, out = Kept(source, flow), _Substitutes(source, flow), stored_members(source), []
    for node in (each for each in source.nodes if source.owner(each) in used):
        for name, each in stored.get(node, ()):
            if name in read and kept.holds(each) and is_measured(node, name, [read[name]], frozenset()):
                why = f"a {display(name)} of an earlier call replaces a reading"
                out.append(source.problem("SERVE-DEFAULT-READING", each, why, _AGAIN))
        for place, absent in substitutes.at(node) if isinstance(node, _SUBSTITUTING) else ():
            out.append(source.problem("SERVE-DEFAULT-READING", place, f"a made-up value replaces {absent}", hint))
    return out


def constant_reading(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """No number that INTERFACE declares as read is written in the file, computed of such, or drawn."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    stored = [(node, name, each) for node, members in stored_members(source).items() for name, each in members]
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        roots = tool_functions(source, site)
        units = dict(numbers_read(tool.get("output_schema") or {}))
        found = Origin.NONE
        for function in roots:
            found |= flow.returned(function)
        if tool["effect"] != "read" or not units or not found & (Origin.READ | Origin.SYSTEM):
            continue
        used = source.entered_from(roots)
        given = [each for each in stored if each[1] in units and source.owner(each[0]) in used]
        for _, name, each in given:
            if _is_invented(source, flow, each):
                summary = f"the result's {display(name)} is a number of this file, and not one that the device gave"
                hint = "read it, or omit the member from INTERFACE's output_schema; null there lets None mean unknown"
                out.setdefault(each, source.problem("SERVE-CONSTANT-READING", each, summary, hint))
        for name, each, what, hint in unmeasured(source, flow, given, units, tool):
            summary = f"the result's {display(name)} is {what}, and not what the device measured"
            out.setdefault(each, source.problem("SERVE-CONSTANT-READING", each, summary, hint))
        for call in (node for node, _ in source.calls if source.owner(node) in used and _draws(source, flow, node)):
            summary = "a number that is drawn by chance goes into what this tool returns"
            hint = "return what was read as it is; a wait of chance belongs to time.sleep"
            out.setdefault(call, source.problem("SERVE-CONSTANT-READING", call, summary, hint))
        for name, each in _chosen(source, flow, given, units):
            summary = f"the result's {display(name)} is one of the numbers in this file, whatever the device measured"
            hint = "return the number that was read; where a bound is all that is known, that is a state: in INTERFACE "
            hint += "a boolean or an enum"
            out.setdefault(each, source.problem("SERVE-CONSTANT-READING", each, summary, hint))
    return list(out.values())


def _draws(source: Source, flow: Flow, node: ast.Call) -> bool:
    """Whether a number is drawn, or is a wave of the clock's, and for more than a wait, an order or a choice."""
    name = source.dotted(node.func)
    counted = any(isinstance(above, ast.BinOp) for above, _ in source.above(node))
    if name in ("math.sin", "math.cos") and flow.of(node) == Origin.CLOCK:
        return counted
    if not _DRAWN.fullmatch(name) and not (counted and name in ("os.urandom", "os.getrandom")):
        return False
    return not any(
        isinstance(above, ast.Call) and source.dotted(above.func).endswith(("sleep", "Timer", "wait"))
        for above, _ in source.above(node)
    )


def _chosen(
    source: Source, flow: Flow, given: list[tuple[ast.AST, str, ast.expr]], units: dict[str, str | None]
) -> Iterator[tuple[str, ast.expr]]:
    """The members with a unit of which every value is one of the file's own, whichever test chooses it."""
    chosen = Chosen(source, flow)
    for name in units:
        sites = [(node, each, chosen.numbers(each)) for node, each_name, each in given if each_name == name]
        known = [(node, each, numbers) for node, each, numbers in sites if numbers is not None]
        alone = len(known) == len(sites)
        yield from (
            (name, each)
            for node, each, numbers in known
            if len(numbers) > (0 if alone else 1) and is_measured(node, name, [units[name]], numbers)
        )


RULES = (Rule("SERVE-DEFAULT-READING", default_reading), Rule("SERVE-CONSTANT-READING", constant_reading))


def numbers_read(schema: Any) -> Iterator[tuple[str, str | None]]:
    """(member, unit) of what is a number in a result and no fact known beforehand."""
    if isinstance(schema, list):
        for item in schema:
            yield from numbers_read(item)
    elif isinstance(schema, dict):
        members = schema.get("properties")
        for name, member in members.items() if isinstance(members, dict) else ():
            if isinstance(member, dict) and not {"const", "enum"} & member.keys():
                forms = [member, *(each for each in member.get("anyOf", ()) if isinstance(each, dict))]
                kinds = {str(form.get("type")) for form in forms}
                if kinds & {"number", "integer"} and not _STATIC.search(name.casefold()):
                    yield name, unit_of_name(name) or unit_in(member.get("description"))
        for item in schema.values():
            yield from numbers_read(item)


@lru_cache(maxsize=4)
def stored_members(source: Source) -> dict[ast.AST, list[tuple[str, ast.expr]]]:
    """The members of each record of a file, by the node that makes or changes it."""
    kinds = (ast.Call, ast.Dict, ast.Assign)
    return {node: list(_members(source, node)) for node in source.nodes if isinstance(node, kinds)}


def _members(source: Source, node: ast.AST) -> Iterator[tuple[str, ast.expr]]:
    """(member, value) of what a record is made with, or has stored into it."""
    if isinstance(node, ast.Call):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if called[:1].isupper() or called in ("dict", "update"):
            yield from ((item.arg, item.value) for item in node.keywords if item.arg is not None)
            yield from zip(_fields(source, called), node.args, strict=False)
    elif isinstance(node, ast.Dict):
        for key, each in zip(node.keys, node.values, strict=True):
            if isinstance(key, ast.Constant) and isinstance(key.value, str):
                yield key.value, each
    elif isinstance(node, ast.Assign):
        for target in node.targets:
            key = target.slice if isinstance(target, ast.Subscript) else None
            if isinstance(key, ast.Constant) and isinstance(key.value, str):
                yield key.value, node.value
            elif isinstance(target, ast.Attribute):
                yield target.attr, node.value


def _fields(source: Source, name: str) -> list[str]:
    """The members that a class of the file lists, in their order."""
    owners = [item for item in source.classes if item.name == name]
    body = owners[0].body if len(owners) == 1 else []
    return [item.target.id for item in body if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)]


def _is_invented(source: Source, flow: Flow, value: ast.expr) -> bool:
    """Whether a number comes from nothing but the file or chance; how long something took is measured."""
    origin = flow.of(value)
    if origin & ~Origin.CHANCE:
        return False
    if (not origin and not _has_number(flow, value)) or flow.past(value):
        return False
    for above, below in source.above(value):
        if isinstance(above, ast.ExceptHandler):
            return False  # a default, which another rule reports
        if isinstance(above, ast.If | ast.While) and below is not above.test and flow.of(above.test) & ~Origin.DEVICE:
            return False  # one of several things that were read decides which number it is
        if isinstance(above, ast.Match):
            return False
    return True


def _has_number(flow: Flow, node: ast.expr, depth: int = 5) -> bool:
    if depth == 0:
        return False
    if isinstance(node, ast.Name):
        values = flow.plain(node)
        return bool(values) and all(
            isinstance(each, ast.expr) and _has_number(flow, each, depth - 1) for each in values
        )
    if isinstance(node, ast.Constant):
        return type(node.value) in (int, float)
    if isinstance(node, ast.UnaryOp | ast.BinOp | ast.Call):
        parts = [item for item in children(node) if isinstance(item, ast.expr)]
        return any(_has_number(flow, item, depth - 1) for item in parts)
    return False


class _Substitutes:
    """Where a number of the file is taken instead of a reading that failed or is not there."""

    def __init__(self, source: Source, flow: Flow) -> None:
        self._source, self._flow = source, flow

    def at(self, node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
        """(where, for what) of the number at one node."""
        if self._replaces_no_reading(node):
            return
        if isinstance(node, ast.Try):
            yield from self._after_failure(node)
        elif isinstance(node, ast.With):
            yield from self._suppressed(node)
        elif isinstance(node, ast.BoolOp) and isinstance(node.op, ast.Or):
            last = node.values[-1]
            neutral = isinstance(last, ast.Constant) and last.value == 1  # division by one means no value
            stands_in = self._is_number(last) and not neutral and not _is_optional(node.values[0])
            neutral = _is_zero(last) and _of_nothing(node.values[0])
            if stands_in and not neutral and self._is_read(node.values[0]) and not self._decides(node):
                yield node, "what could not be read"
        elif isinstance(node, ast.IfExp):
            yield from (*self._chosen(node), *self._in_a_mode(node))
        elif isinstance(node, ast.If):
            yield from self._in_a_mode(node)
            absent = _compares_none(node.test, ast.Is) and not _is_optional(node.test)
            body = [item for item in node.body if self._gives_number(item)] if absent else []
            body += [] if absent else [item for item in node.body if self._is_substitute(node.test, item)]
            body += self._instead(node)
            yield from ((item, "a reading that is not there") for item in body)
        elif isinstance(node, ast.match_case):
            nothing = isinstance(node.pattern, ast.MatchSingleton) and node.pattern.value is None
            yield from ((item, "a reading that is None") for item in node.body if nothing and self._gives_number(item))
        elif isinstance(node, ast.Call):
            yield from self._given(node)

    def _in_a_mode(self, node: ast.If | ast.IfExp) -> Iterator[tuple[ast.AST, str]]:
        if is_of_environment(self._source, self._flow, node.test):
            branches = (*node.body, *node.orelse) if isinstance(node, ast.If) else (node.body, node.orelse)
            for item in branches:
                value = item.value if isinstance(item, ast.Return | ast.Assign) else item
                if isinstance(value, ast.expr) and self._of_numbers(value):
                    yield item, "a reading that the environment turns on"

    def _is_read(self, node: ast.expr) -> bool:
        if isinstance(node, ast.Call) and self._source.dotted(node.func) in ("locals", "globals"):
            return True  # a name that may not have got its value
        return bool(self._flow.of(node) & (Origin.READ | Origin.SYSTEM)) and not isinstance(node, ast.Compare)

    def _is_number(self, node: ast.AST | None, depth: int = 3) -> bool:
        plain = node.operand if isinstance(node, ast.UnaryOp) else node
        if isinstance(plain, ast.Name) and depth:
            values = self._flow.plain(plain)
            return bool(values) and all(self._is_number(each, depth - 1) for each in values)
        if isinstance(plain, ast.Call):
            name = self._source.dotted(plain.func)
            none = name == "float" and any(isinstance(item, ast.Constant) for item in plain.args)  # float("nan")
            return none or bool(_BLANK.fullmatch(name)) or (depth > 0 and self._gives_numbers(plain, depth))
        if isinstance(plain, ast.Attribute):
            return self._source.dotted(plain) in ("math.nan", "math.inf", "numpy.nan", "np.nan")
        if not isinstance(plain, ast.Constant):
            return False
        text = plain.value if isinstance(plain.value, str | bytes) else b""
        return type(plain.value) in (int, float) or (bool(text) and text.strip().isdigit())

    def _gives_numbers(self, call: ast.Call, depth: int) -> bool:
        """Whether a function of the file has nothing but numbers of its own to return."""
        if not isinstance(call.func, ast.Name):
            return False
        name = call.func.id
        own = [item for item in self._source.functions if item.name == name]
        plain = self._flow.plain(call.func) if not own else []
        results: list[ast.AST] = [item.body for item in plain if isinstance(item, ast.Lambda)]
        results += self._flow.results(own[0]) if len(own) == 1 else []
        return bool(results) and all(self._is_number(item, depth - 1) for item in results)

    def _replaces_no_reading(self, node: ast.AST) -> bool:
        """Whether a node is about an argument that the caller omitted, or lies in a key by which a list is sorted."""
        test = node.test if isinstance(node, ast.If | ast.IfExp) else None
        asked = self._flow.of(test.left) if isinstance(test, ast.Compare) else Origin.NONE
        omitted = bool(asked & Origin.ARGUMENT) and not asked & (Origin.FOUND | Origin.READ | Origin.SYSTEM)
        keys = (above for above, below in self._source.above(node) if isinstance(below, ast.Lambda))
        return omitted or any(isinstance(above, ast.keyword) and above.arg == "key" for above in keys)

    def _decides(self, node: ast.expr) -> bool:
        """Whether a value is compared or looked up, and is no part of a result itself."""
        below: ast.AST = node
        above = self._source.parents.get(node)
        while isinstance(above, ast.Call | ast.UnaryOp | ast.BinOp):
            below, above = above, self._source.parents.get(above)
        return isinstance(above, ast.Compare) or (isinstance(above, ast.Subscript) and above.slice is below)

    def _chosen(self, node: ast.IfExp) -> Iterator[tuple[ast.AST, str]]:
        absent = _branch_of_none(node.test, node.body, node.orelse)
        if absent is None and isinstance(node.test, ast.Name | ast.Call | ast.Subscript | ast.Attribute):
            absent = node.orelse if self._is_read(node.test) and self._is_read(node.body) else None
            divided = {ast.unparse(item.right) for item in walk(node.body) if isinstance(item, ast.BinOp)}
            follows = absent is not None and _is_zero(absent) and _of_nothing(node.body, node.test)
            absent = None if ast.unparse(node.test) in divided or follows else absent
        if absent is not None and self._is_number(absent) and not _is_optional(node.test):
            other = node.orelse if absent is node.body else node.body
            if not self._is_number(other):
                yield node, "a reading that is not there"

    def _given(self, node: ast.Call) -> Iterator[tuple[ast.AST, str]]:
        """A default that a call takes: of a table, of an iterator, of an attribute, of a largest."""
        name = self._source.dotted(node.func)
        default: ast.expr | None = None
        asked: ast.expr | None = node.args[0] if node.args else None
        if name in ("max", "min"):
            default = next((item.value for item in node.keywords if item.arg == "default"), None)
        elif name in ("next", "getattr"):
            default = node.args[-1] if len(node.args) == (2 if name == "next" else 3) else None
        elif isinstance(node.func, ast.Attribute) and node.func.attr in ("get", "pop") and len(node.args) == 2:
            default, asked = node.args[1], node.func.value
        counted = isinstance(self._source.parents.get(node), ast.BinOp)  # how often something came about
        if default is None or asked is None or (counted and isinstance(node.func, ast.Attribute)):
            return
        if self._is_read(asked) and self._is_number(default) and not _is_optional(node):
            yield node, "what was not reported"

    def _after_failure(self, node: ast.Try) -> Iterator[tuple[ast.AST, str]]:
        read = {target.id for item in node.body for target in _targets(item)}
        for handler in node.handlers:
            ends = any(isinstance(item, ast.Raise | ast.Return | ast.Continue | ast.Break) for item in walk(handler))
            for item in walk(handler):
                returned = isinstance(item, ast.Return) and item.value is not None and self._of_numbers(item.value)
                returned = returned or (isinstance(item, ast.Return) and _returns_nothing(item, handler))
                assigned = isinstance(item, ast.Assign) and self._is_number(item.value) and read & _names(item)
                if returned or assigned:
                    yield item, "a reading that failed"
            if not ends and not any(read & _names(item) for item in walk(handler)):
                yield from self._preset(node, read)

    def _suppressed(self, node: ast.With) -> Iterator[tuple[ast.AST, str]]:
        calls = [item.context_expr for item in node.items if isinstance(item.context_expr, ast.Call)]
        if any(self._source.dotted(call.func) == "contextlib.suppress" for call in calls):
            yield from self._preset(node, {target.id for item in node.body for target in _targets(item)})

    def _preset(self, node: ast.stmt, names: set[str]) -> Iterator[tuple[ast.AST, str]]:
        """The numbers that were set before it was tried, once or in a loop."""
        place: ast.AST | None = node
        while place is not None:
            for item in self._before(place):
                if isinstance(item, ast.Assign) and self._is_number(item.value) and names & _names(item):
                    yield item, "a reading that failed"
            above = self._source.parents.get(place)
            place = above if isinstance(above, ast.For | ast.While) else None

    def _before(self, place: ast.AST) -> list[ast.stmt]:
        """The statements of its block that are before one."""
        above = self._source.parents.get(place)
        blocks = [block for _, block in ast.iter_fields(above) if isinstance(block, list)] if above is not None else []
        return next((block[: block.index(place)] for block in blocks if place in block), [])

    def _gives_number(self, statement: ast.stmt) -> bool:
        return isinstance(statement, ast.Return | ast.Assign) and self._is_number(statement.value)

    def _is_substitute(self, test: ast.expr, statement: ast.stmt) -> bool:
        """``if not value: value = 0``"""
        if not isinstance(test, ast.UnaryOp) or not isinstance(test.op, ast.Not) or _is_optional(test):
            return False
        asked = {item.id for item in walk(test) if isinstance(item, ast.Name)}
        same = isinstance(statement, ast.Assign) and bool(asked & _names(statement))
        return same and self._is_read(test.operand) and self._gives_number(statement)

    def _instead(self, node: ast.If) -> Iterator[ast.stmt]:
        """The number that is set where a series is empty: ``if all: top = max(all)``, ``else: top = 0``, or before."""
        test = node.test
        if not isinstance(test, ast.Name) or not self._is_read(test) or _is_optional(test) or len(node.body) != 1:
            return
        taken = node.body[0]
        if not isinstance(taken, ast.Assign) or not _of_one(taken.value, test):
            return
        for item in node.orelse or self._before(node)[-1:]:
            if isinstance(item, ast.Assign) and self._is_number(item.value) and _names(taken) & _names(item):
                yield item

    def _of_numbers(self, node: ast.expr) -> bool:
        """A number, or a record or list one of whose members is written as a number."""
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            record = name[:1].isupper() or name == "dict"
            return record and any(map(self._of_numbers, (*node.args, *(each.value for each in node.keywords))))
        if isinstance(node, ast.Dict):
            return any(map(self._of_numbers, node.values))
        if isinstance(node, ast.List | ast.Tuple):
            return any(map(self._of_numbers, node.elts))
        return self._is_number(node)


def _returns_nothing(node: ast.Return, handler: ast.ExceptHandler) -> bool:
    """Whether a handler of whatever goes wrong returns a record with empty lists, as if there were nothing."""
    kinds = [handler.type] if not isinstance(handler.type, ast.Tuple) else handler.type.elts
    broad = any(item is None or last(item) in _BROAD for item in kinds)
    parts = list(walk(node))
    lists = [item for item in parts if isinstance(item, ast.List)]
    is_known = any(isinstance(item, ast.Name) and item.id == handler.name for item in parts)
    is_known = is_known or any(
        isinstance(item, ast.Constant) and isinstance(item.value, str) and " " in item.value for item in parts
    )
    record = isinstance(node.value, ast.Call | ast.Dict)
    return broad and record and bool(lists) and not any(item.elts for item in lists) and not is_known


def _is_optional(node: ast.expr) -> bool:
    """Whether an offset, a scale or how often something came about is read: without one the kernel means 0 and 1
    (ABI/testing/sysfs-bus-iio).
    """
    names = (item.id for item in walk(node) if isinstance(item, ast.Name))
    texts = (item.value for item in walk(node) if isinstance(item, ast.Constant) and isinstance(item.value, str))
    return any(word in text.casefold() for text in (*names, *texts) for word in _OPTIONAL)


def _targets(statement: ast.stmt) -> Iterator[ast.Name]:
    """The names that a statement sets; the target of an augmented assignment was there before."""
    added = {item.target for item in walk(statement) if isinstance(item, ast.AugAssign)}
    for item in walk(statement):
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store) and item not in added:
            yield item


def _names(node: ast.AST) -> set[str]:
    return {item.id for item in walk(node) if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store)}


def _is_zero(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) in (int, float) and node.value == 0


_KEPT_ZERO = frozenset({"abs", "round", "float", "int"})


def _mentions(node: ast.expr, series: ast.expr | None) -> bool:
    wanted = ast.unparse(series) if series is not None else None
    return wanted is None or any(ast.unparse(item) == wanted for item in walk(node) if isinstance(item, ast.expr))


def _of_one(node: ast.expr, series: ast.expr) -> bool:
    """Whether a value needs a member of a series: the last one, the largest one, the mean."""
    if isinstance(node, ast.Subscript):
        return _mentions(node.value, series)
    if isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        asked = name in ("max", "min", "mean", "fmean", "median") and any(_mentions(each, series) for each in node.args)
        return asked or (name in _KEPT_ZERO and any(_of_one(each, series) for each in node.args))
    if isinstance(node, ast.BinOp) and not _of_nothing(node, series):
        return any(_of_one(each, series) for each in (node.left, node.right)) or (
            isinstance(node.op, ast.Div) and _mentions(node.right, series)
        )
    return False


def _of_nothing(node: ast.expr, series: ast.expr | None = None) -> bool:
    """Whether a value is zero by definition where a series has no member: its sum, its length, how far it went."""
    if isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        given = node.func.value if isinstance(node.func, ast.Attribute) and name == "count" else None
        if name in ("sum", "fsum", "len") and len(node.args) == 1:
            return _mentions(node.args[0], series)
        return (given is not None and _mentions(given, series)) or (
            name in _KEPT_ZERO and bool(node.args) and _of_nothing(node.args[0], series)
        )
    if not isinstance(node, ast.BinOp):
        return False
    left, right = _of_nothing(node.left, series), _of_nothing(node.right, series)
    if isinstance(node.op, ast.Sub) and series is not None:
        return (left and right) or (_of_one(node.left, series) and _of_one(node.right, series))
    if isinstance(node.op, ast.Mult):
        return left or right
    if isinstance(node.op, ast.Div):
        return left and not _mentions(node.right, series)
    return isinstance(node.op, ast.Add) and left and right


def _branch_of_none(test: ast.expr, body: ast.expr, otherwise: ast.expr) -> ast.expr | None:
    if _compares_none(test, ast.Is):
        return body
    return otherwise if _compares_none(test, ast.IsNot) else None


def _compares_none(test: ast.expr, kind: type[ast.cmpop]) -> bool:
    if not isinstance(test, ast.Compare) or not isinstance(test.ops[0], kind):
        return False
    return isinstance(test.comparators[0], ast.Constant) and test.comparators[0].value is None
