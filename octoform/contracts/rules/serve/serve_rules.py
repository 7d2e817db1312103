"""The whole SERVE contract over one source text: it compiles, and then every rule of each family."""

import ast
from collections.abc import Iterator
from functools import lru_cache

from octoform.base.escaping import display, listed
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.serve import (
    attribute_rules,
    code_rules,
    device_rules,
    exchange_rules,
    failure_rules,
    line_rules,
    outcome_rules,
    profile_rules,
    reading_rules,
    scale_rules,
    tool_rules,
    value_rules,
    write_rules,
)
from octoform.contracts.rules.serve.device_rules import opens_device
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import ToolSite, readings_of, served_tools, tool_functions, tool_sites
from octoform.contracts.rules.serve.value_rules import numbers_read, stored_members
from octoform.contracts.rules.serve.write_rules import only_reads
from octoform.contracts.server_code.chosen_values import Chosen
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import Origin, last
from octoform.contracts.server_code.places import constants
from octoform.contracts.server_code.server_source import Function, Source, needed_source, read_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex
from octoform.records import replace

# A reading of the wrong one of two equal devices misleads; a movement of the wrong one hurts.
CODE = "SERVE-ACTUATE-UNBOUND"
_HINT = "write runtime.device(id, actuate=True) in a tool that acts"


def actuate_unbound(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that is no reading asks for its device with ``actuate=True``, itself or in what it calls."""
    source = needed_source(value)
    effects = {tool["name"]: tool["effect"] for tool in (artifacts.interface or {"tools": []})["tools"]}
    out: dict[ast.Call, Diagnostic] = {}
    for site in tool_sites(source):
        effect = effects.get(site.name or "", "read")
        for call in _unbound(source, site) if effect != "read" else ():
            summary = f"the tool {display(site.name or '')} ({effect}) asks for its device as a reader does"
            out.setdefault(call, source.problem(CODE, call, summary, _HINT))
    return list(out.values())


ACTUATE_RULES = (Rule(CODE, actuate_unbound),)


def _unbound(source: Source, site: ToolSite) -> list[ast.Call]:
    """The calls by which a tool gets a device without saying that it acts; none when a function that it uses does."""
    roots = tool_functions(source, site)
    own = [call for root in roots for call in source.asking(root) if not _acts(call)]
    if own:
        return own
    used = source.entered_from(roots)
    asking = [call for function in used for call in source.asking(function)]
    if any(_acts(call) for call in asking):
        return []
    opening = [call for call, _ in source.calls if source.owner(call) in used and opens_device(source, call)]
    return (asking or opening)[:1]


def _acts(call: ast.Call) -> bool:
    """Whether it may ask as one that acts: anything but a plain no."""
    given = [item.value for item in call.keywords if item.arg in ("actuate", None)] + call.args[1:2]
    return any(not isinstance(item, ast.Constant) or item.value is True for item in given)


# Rules for SERVE that a tool that sets a quantity sets that one, in its own direction, and reports what came of it.
#
# INTERFACE's readings of the same device are the measure: what they return under the argument's name is what the tool
# is there to change. Only attributes of the kernel are followed, since of a library's call nothing is known.

ECHOED, OTHERWISE = "SERVE-SET-ECHOED", "SERVE-SETS-OTHERWISE"
_ASKED_FOR = frozenset(
    {"requested", "request", "commanded", "command", "target", "goal", "sent", "wanted", "asked", "setpoint", "desired"}
    | {"set", "written", "given", "planned", "expected", "seconds", "duration", "time", "waited", "previous", "before"}
)
"""Words of members that tell what was asked for, and not what the device has."""
_CHOOSES = frozenset({"line", "chip", "pin", "port", "channel", "index", "unit", "joint", "motor", "slot", "number"})
"""Words of arguments that choose a part of a device."""
_PROMISED = regex(
    r"(?i)\bread(?:s|ing)?[\w ]{0,20} back\b|\bread-?back\b|\bthat the \w+ (?:now )?(?:reports?|has)\b|\bas reported\b"
    r"|\bactual(?:ly)?\b"
)
_ARITHMETIC = frozenset({"int", "float", "round", "str", "bytes", "min", "max", "format", "math.floor", "math.ceil"})
_CONVERTS = frozenset({"encode", "decode", "strip", "rstrip", "split", "format", "ljust", "zfill", "to_bytes"})
_READERS = frozenset({"read_number", "read_integer", "read_text", "read_bytes", "read_first"})
_OPPOSITE = frozenset(
    {"dim", "dimming", "dark", "darkness", "off", "closed", "close", "inverse", "inverted", "invert", "mute", "muted"}
    | {"attenuation", "reduction", "remaining", "left", "transparency", "shade", "opposite", "duty", "below"}
)
"""Words of an argument that is large where what it sets is small."""
_GOALS = regex(r"(?i)target|goal|setpoint|request|demand|command|limit|threshold|max|min|crit|alarm|trip")
_MEASURED = regex(r"actual_\w+|\w+_(?:input|average)")
"""Attributes in which the kernel shows what it measured, and in which nothing can be set."""
_COMMON = frozenset({"raw", "input", "value", "state", "max", "min", "enable", "power", "mode", "cur", "percent", "in"})


class _Setting:
    """What one tool writes into attributes of the kernel, and what of them its results are made of."""

    def __init__(self, source: Source, flow: Flow, functions: list[Function], roots: tuple[Function, ...]) -> None:
        self._source, self._flow, self._used, self._roots = source, flow, functions, roots
        self._values: dict[ast.expr, list[ast.expr]] = {}
        self._ways: dict[tuple[ast.expr, frozenset[str] | None], int | None] = {}
        self._calls = [(call, name) for call, name in source.calls if source.owner(call) in functions]
        self.writes = [(call, *written) for call, _ in self._calls if (written := self._written(call)) is not None]
        files = {call for call, _, _ in self.writes}
        self.acts = [call for call, name in self._calls if call not in files and self._may_act(call, name)]

    def values(self, node: ast.expr) -> list[ast.expr]:
        """What a name may stand for, by its bindings or by the arguments of a function of the file; else itself."""
        if node not in self._values:
            seen, waiting = set[ast.expr](), [node]
            out: list[ast.expr] = []
            while waiting:
                item = waiting.pop(0)
                if item in seen:
                    continue
                seen.add(item)
                found = self._bound(item) if isinstance(item, ast.Name) and not self._flow.is_inner(item) else []
                waiting += found
                out += [] if found else [item]
            self._values[node] = out
        return self._values[node]

    def _bound(self, node: ast.Name) -> list[ast.expr]:
        return [item for item in self._flow.plain(node) if isinstance(item, ast.expr)] or self._passed(node)

    def _passed(self, node: ast.Name) -> list[ast.expr]:
        owner = self._source.owner(node)
        if owner is None or owner in self._roots or not self._flow.bindings.is_parameter(owner, node.id):
            return []
        given = [item.arg for item in (*owner.args.posonlyargs, *owner.args.args) if item.arg not in ("self", "cls")]
        out = []
        for call, _ in self._calls:
            if last(call.func) == owner.name:
                out += [item.value for item in call.keywords if item.arg == node.id]
                out += [item for name, item in zip(given, call.args, strict=False) if name == node.id]
        return out

    def leaves(self, node: ast.expr, *, whole: bool = True) -> Iterator[ast.expr]:
        """The parts of a sum, a product or a conversion that are none themselves; without ``whole`` no divisors."""
        seen, waiting = set[ast.expr](), [node]
        while waiting:
            for item in (each for each in self.values(waiting.pop()) if each not in seen):
                seen.add(item)
                parts = self._parts(item)
                divided = isinstance(item, ast.BinOp) and isinstance(item.op, ast.Div | ast.FloorDiv)
                waiting += parts[:1] if divided and not whole else parts
                if not parts:
                    yield item

    def _parts(self, node: ast.expr) -> list[ast.expr]:
        if isinstance(node, ast.BinOp):
            return [node.left, node.right]
        if isinstance(node, ast.UnaryOp):
            return [node.operand]
        if isinstance(node, ast.IfExp):
            return [node.body, node.orelse]
        if isinstance(node, ast.JoinedStr):
            return [item.value for item in node.values if isinstance(item, ast.FormattedValue)]
        if isinstance(node, ast.Call) and not self._reads(node):
            if self._source.dotted(node.func) in _ARITHMETIC:
                return list(node.args)
            if isinstance(node.func, ast.Attribute) and node.func.attr in _CONVERTS:
                return [node.func.value, *node.args]
        return []

    def is_given(self, node: ast.expr) -> bool:
        """Whether an expression is an argument of the caller, and nothing of a device."""
        origin = self._flow.of(node)
        return isinstance(node, ast.Name) and bool(origin & Origin.ARGUMENT) and not origin & ~_BY_CALLER

    def arguments(self, node: ast.expr) -> set[str]:
        """The caller's arguments of which a number is made."""
        return {item.id for item in self.leaves(node) if isinstance(item, ast.Name) and self.is_given(item)}

    def echoes(self, record: ast.AST, node: ast.expr, choosing: set[str]) -> bool:
        """Whether a number is made of the caller's, and of nothing read after the write; what only chooses is none."""
        leaves = list(self.leaves(node))
        owner = self._source.owner(record)
        given = {name for name in self.arguments(node) - choosing if not _CHOOSES & set(tokens(name))}
        if not given or owner is None or not (self.writes or self.acts):
            return False
        acting = [*(call for call, _, _ in self.writes), *self.acts, *self._entering(owner)]
        first = min((call.lineno for call in acting if self._source.owner(call) is owner), default=0)
        read = [item for item in leaves if not self.is_given(item) and self._flow.of(item) & ~_BY_CALLER]
        before = all(self._source.owner(item) is owner and item.lineno < first for item in read)
        return before and not self._confirmed(owner, first)

    def _entering(self, owner: Function) -> list[ast.Call]:
        """The calls of a function by which it enters another one of the file that writes."""
        acting = {self._source.owner(call) for call in (*(each for each, _, _ in self.writes), *self.acts)}
        names = {
            item.name for item in self._used if item is not owner and acting & set(self._source.entered_from([item]))
        }
        return [call for call, _ in self._calls if last(call.func) in names]

    def _confirmed(self, owner: Function, line: int) -> bool:
        """Whether what was read afterwards decides if the call fails."""
        tests = [item for item in walk(owner) if isinstance(item, ast.If | ast.Assert) and item.lineno > line]
        failing = [item for item in tests if any(isinstance(each, ast.Raise | ast.Assert) for each in walk(item))]
        return any(self._flow.of(item.test) & Origin.READ for item in failing)

    def attributes(self, node: ast.expr) -> set[str] | None:
        """The names of the file that a path leads to; None where one is not written down."""
        found: set[str] = set()
        for item in self.values(node):
            part = item.right if isinstance(item, ast.BinOp) and isinstance(item.op, ast.Div) else None
            if isinstance(item, ast.Call) and last(item.func) in ("joinpath", "Path", "with_name") and item.args:
                part = item.args[-1]
            elif isinstance(item, ast.Call) and last(item.func) == "str" and item.args:
                inner = self.attributes(item.args[0])
                if inner is None:
                    return None
                found |= inner
                continue
            names = constants(self._flow, part) if part is not None else frozenset()
            if not names and part is not None:
                names = frozenset(str(each.value) for each in self.values(part) if isinstance(each, ast.Constant))
            if not names:
                return None
            found |= {name.rpartition("/")[2] for name in names}
        return found

    def _written(self, call: ast.Call) -> tuple[set[str], ast.expr] | None:
        """(names, value) of a write into attributes of the kernel; None for every other call."""
        if not isinstance(call.func, ast.Attribute) or not call.args:
            return None
        path: ast.expr | None = call.func.value if call.func.attr in ("write_text", "write_bytes") else None
        if call.func.attr == "write" and isinstance(call.func.value, ast.Name):
            path = self._opened(call.func.value)
        names = self.attributes(path) if path is not None else None
        return None if names is None else (names, call.args[0])

    def _opened(self, file: ast.Name) -> ast.expr | None:
        for item in self._flow.plain(file) or [each.value for each in self._flow.bindings.reaching(file)[0]]:
            if isinstance(item, ast.Call) and last(item.func) == "open":
                return item.func.value if isinstance(item.func, ast.Attribute) else next(iter(item.args), None)
        return None

    def _may_act(self, call: ast.Call, name: str) -> bool:
        opened = last(call.func) == "open" or (last(call.func) == "bus" and not call.args)
        return not opened and not only_reads(self._source, call, name) and not name.startswith("runtime.read")

    def _reads(self, node: ast.expr) -> set[str]:
        """The attributes that one call reads; empty for every other expression."""
        if not isinstance(node, ast.Call) or last(node.func) not in _READERS:
            return set()
        own = self._source.dotted(node.func).startswith("runtime.")
        path = node.args[0] if own and node.args else node.func.value if isinstance(node.func, ast.Attribute) else None
        return (self.attributes(path) or set()) if path is not None else set()

    def read_for(self, node: ast.expr) -> set[str]:
        """The attributes of which a number is made; empty where one of its parts is not known."""
        found: set[str] = set()
        for item in self.leaves(node, whole=False):
            names = self._reads(item)
            if not names and self._flow.of(item) & (Origin.READ | Origin.SYSTEM):
                return set()
            found |= names
        return found

    def direction(self, node: ast.expr, names: frozenset[str] | None) -> int | None:
        """1 where a number grows with the caller's (or with what is read from ``names``), -1 where it falls, else 0."""
        if (node, names) not in self._ways:
            self._ways[node, names] = 0  # while it is being found
            ways = {self._direction(item, names) for item in self.values(node)} - {0}
            self._ways[node, names] = 0 if not ways else ways.pop() if len(ways) == 1 else None
        return self._ways[node, names]

    def _direction(self, node: ast.expr, names: frozenset[str] | None) -> int | None:
        if self.is_given(node) if names is None else bool(self._reads(node) & names):
            return 1
        parts = [self.direction(item, names) for item in self._parts(node)]
        if not parts or not any(item != 0 for item in parts):
            return 0
        turned = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Invert)
        if isinstance(node, ast.BinOp):
            if isinstance(node.op, ast.Sub | ast.Div | ast.FloorDiv):
                parts[1] = -parts[1] if parts[1] is not None else None
            elif isinstance(node.op, ast.BitXor):
                turned = True
            elif not isinstance(node.op, ast.Add | ast.Mult):
                return None
            factors = zip(self._parts(node), parts, strict=True) if isinstance(node.op, ast.Mult | ast.Div) else ()
            minus = (
                isinstance(each, ast.UnaryOp) and isinstance(each.op, ast.USub) and not way for each, way in factors
            )
            turned = turned or any(minus)
        known = {item for item in parts if item != 0}
        if None in known or len(known) != 1:
            return None
        [one] = known
        return one if one is None else -one if turned else one

    def members(self, tool: JsonObject) -> list[tuple[ast.AST, str, ast.expr]]:
        """(record, name, value) of each number of the tool's results."""
        wanted, stored = _numbers(tool), stored_members(self._source).items()
        found = [(at, *each) for at, row in stored for each in row if each[0] in wanted]
        return [item for item in found if self._source.owner(item[0]) in self._used]

    def held_back(self) -> Iterator[tuple[ast.AST, str, str]]:
        """A write that is omitted where the device is already near what was asked for, without any error."""
        hint = "write it at every call, or fail with a sentence where it cannot be written"
        held = {call for call, _, _ in self.writes if any(self._is_near(test) for test in self._silent(call))}
        for call, names, _ in self.writes:
            beside = [
                each
                for each, others, _ in self.writes
                if names & others and self._source.owner(each) is self._source.owner(call)
            ]
            if held.issuperset(beside):
                yield call, "writes only where the change is large, and answers as if it had", hint

    def _silent(self, call: ast.Call) -> Iterator[ast.expr]:
        """The tests on the way to a call after which, in their other case, nothing is written and no error raised."""
        writes: set[ast.AST] = {each for each, _, _ in self.writes}
        for above, below in self._source.above(call):
            blocks = [block for _, block in ast.iter_fields(above) if isinstance(block, list) and below in block]
            for item in (each for block in blocks for each in block[: block.index(below)] if isinstance(each, ast.If)):
                inside = list(walk(item))
                ends = any(isinstance(each, ast.Return | ast.Continue) for each in inside)
                if ends and not any(isinstance(each, ast.Raise) or each in writes for each in inside):
                    yield item.test
            if isinstance(above, ast.If) and below is not above.test:
                other = above.orelse if below in above.body else above.body
                told = [each for part in other for each in walk(part)]
                if not any(isinstance(each, ast.Raise) or each in writes for each in told):
                    yield above.test

    def _is_near(self, test: ast.expr) -> bool:
        """Whether a test compares how far the device is from what was asked for with more than one step."""
        chosen = Chosen(self._source, self._flow)
        for item in walk(test):
            sides = [item.left, *item.comparators] if isinstance(item, ast.Compare) else []
            bounds = [chosen.numbers(side) for side in sides]
            wide = any(abs(number) > 1 for bound in bounds for number in bound or ())
            if wide and any(self._is_distance(side) for side in sides):
                return True
        return False

    def _is_distance(self, node: ast.expr, depth: int = 4) -> bool:
        for item in self.values(node) if depth else ():
            if isinstance(item, ast.BinOp) and isinstance(item.op, ast.Sub):
                given = [bool(self.arguments(side)) for side in (item.left, item.right)]
                read = [bool(self._flow.of(side) & Origin.READ) for side in (item.left, item.right)]
                return (given[0] and not given[1] and read[1]) or (given[1] and not given[0] and read[0])
            asked = item.args if isinstance(item, ast.Call) and last(item.func) in ("abs", *_ARITHMETIC) else []
            if any(self._is_distance(each, depth - 1) for each in asked):
                return True
        return False


_BY_CALLER = Origin.ARGUMENT | Origin.DEVICE


@lru_cache(maxsize=64)
def _setting(source: Source, flow: Flow, roots: tuple[Function, ...]) -> _Setting:
    return _Setting(source, flow, source.entered_from(roots), roots)


def _numbers(tool: JsonObject) -> dict[str, str | None]:
    return dict(numbers_read(tool.get("output_schema") or {}))


def set_echoed(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """What a tool that sets something returns was read after it, where the device can be read, and is not repeated."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "read the device after the write and return that; what was only asked for is called so (requested_...)"
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        if tool["effect"] == "read":
            continue
        setting = _setting(source, flow, tuple(tool_functions(source, site)))
        others = readings_of(tool, artifacts)
        known = {name for other in others for name in _numbers(other)}
        choosing = {name for other in others for name in other["input_schema"].get("properties") or ()}
        promised = bool(_PROMISED.search(tool["description"]))
        for record, name, each in setting.members(tool):
            told = promised or name in known
            if told and not _ASKED_FOR & set(tokens(name)) and setting.echoes(record, each, choosing):
                summary = f"the {display(name)} that {display(site.name or '')} returns is what its caller asked for"
                out.setdefault(each, source.problem(ECHOED, each, summary, hint))
    return list(out.values())


def sets_otherwise(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool writes what it was given where its readings find it, the right way round, and every time."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        if tool["effect"] == "read" or "units" in tool:
            continue
        setting = _setting(source, flow, tuple(tool_functions(source, site)))
        others = [item for item in served_tools(source, artifacts) if item[1] in readings_of(tool, artifacts)]
        read = [(each, setting) for each in setting.members(tool)]
        for where, other in others:
            asked = _setting(source, flow, tuple(tool_functions(source, where)))
            read += [(each, asked) for each in asked.members(other)]
        for place, what, hint in (*_elsewhere(setting, read, tool), *_turned(setting, read), *setting.held_back()):
            summary = f"the tool {display(site.name or '')} {what}"
            out.setdefault(place, source.problem(OTHERWISE, place, summary, hint))
    return list(out.values()) or outcome_rules.set_not_read(value, artifacts)


Member = tuple[ast.AST, str, ast.expr]
Findings = Iterator[tuple[ast.AST, str, str]]


def _elsewhere(setting: _Setting, read: list[tuple[Member, _Setting]], tool: JsonObject) -> Findings:
    """A write into attributes of which none is read for what the argument is called."""
    given = [(call, names, setting.arguments(each)) for call, names, each in setting.writes]
    if setting.acts or not given:
        return
    for name in sorted(set().union(*(arguments for _, _, arguments in given))):
        found = [by.read_for(each) for (_, member, each), by in read if member == name]
        mine = [(call, names) for call, names, arguments in given if name in arguments]
        wanted, written = set().union(*found), set().union(*(names for _, names in mine))
        words = f"{tool['name']} {tool['description']} {name}"
        if not found or not all(found) or wanted & written or any(_belongs(one, wanted, words) for one in written):
            continue
        found_in = listed(sorted(wanted))
        what = f"writes {display(name)} to {listed(sorted(written))}, and its readings find it in {found_in}"
        yield mine[0][0], what, "write the attribute that is read for it, or read the one that is written"


def _belongs(written: str, read: set[str], words: str) -> bool:
    """Whether an attribute sets what others show: its name has their words, or it is a goal of them."""
    if _MEASURED.fullmatch(written):
        return False
    if _GOALS.search(written):
        return bool(_GOALS.search(words)) or not ("max" in written or "min" in written)
    own = {word for word in tokens(written) if not word.isdigit()} - _COMMON
    return any(own & set(tokens(name)) for name in read)


def _turned(setting: _Setting, read: list[tuple[Member, _Setting]]) -> Findings:
    """A write that falls where the argument grows, of an attribute whose readings grow with it, or the opposite."""
    for call, names, each in setting.writes:
        way = setting.direction(each, None)
        for name in sorted(setting.arguments(each)) if way else ():
            mine = [(value, by) for (_, member, value), by in read if member == name and names & by.read_for(value)]
            shown = [by.direction(value, frozenset(names)) for value, by in mine]
            ways = {item for item in shown if item != 0}
            if way is not None and ways == {-way} and not _OPPOSITE & set(tokens(name)):
                what = f"writes less the more its {display(name)} is, and reads it the other way round"
                yield call, what, "write it as it is read: what is set to 30 percent is then read as 30 percent"


SETTING_RULES = (Rule(ECHOED, set_echoed), Rule(OTHERWISE, sets_otherwise))


def syntax(value: str, _: Artifacts) -> list[Diagnostic]:
    """The text compiles."""
    source = read_source(value)
    return [] if isinstance(source, Source) else [source]


RULES = (
    Rule("SERVE-SYNTAX", syntax),  # the others do not see a source that it refuses
    *code_rules.RULES,
    *device_rules.RULES,
    *code_rules.LOOP_RULES,
    *tool_rules.RULES,
    *ACTUATE_RULES,
    *reading_rules.RULES,
    *value_rules.RULES,
    *failure_rules.RULES,
    *attribute_rules.RULES,
    *write_rules.RULES,
    *SETTING_RULES,
    *scale_rules.RULES,
    *outcome_rules.RULES,
    *line_rules.RULES,
    *exchange_rules.RULES,
    *profile_rules.RULES,
)


def serve_static(source: str, interface: JsonObject, path: str = "server.py") -> list[Diagnostic]:
    """Everything that the text of a server shows to be wrong, each with line and column; nothing is run."""
    artifacts = Artifacts(interface=interface)
    found = syntax(source, artifacts) or [item for rule in RULES for item in rule.check(source, artifacts)]
    return [replace(item, path=path) for item in found]
