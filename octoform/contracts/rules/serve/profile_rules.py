"""Rules for SERVE about a device whose profile has a protocol definition: the server commands it as defined.

An arm that is asked at another speed acknowledges nothing, a rest pose that is another pose drops it, and a stop that
moves is none. The profile has all of it as data, so the code is held against that.
"""

import ast
import contextlib
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.server_code.chosen_values import Chosen
from octoform.contracts.server_code.computed_values import Failed, Spent, Unsure, World, is_plain
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import last
from octoform.contracts.server_code.sending_evaluator import SendingEvaluator, Sent
from octoform.contracts.server_code.server_evaluator import ways
from octoform.contracts.server_code.server_source import Function, Source, needed_source
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

CODE = "SERVE-PROFILE-CONTRADICTED"
_BUDGET, _MAX_WAYS = 60_000, 6
_TRIED = (7, -13, 1)
_OPENS = frozenset({"Serial", "serial_for_url", "open_serial_connection", "create_serial_connection"})
_MOVES = frozenset({"move", "move_percent", "move_many", "pose", "torque"})
_RAW = {"read1ByteTxRx", "read2ByteTxRx", "write1ByteTxRx", "write2ByteTxRx", "write1ByteTxOnly", "write2ByteTxOnly"}
_NUMBER = regex(r"([+-]?\d+(?:\.\d+)?)")
Found = Iterator[tuple[ast.AST, str]]
Grammar = Mapping[str, Any]
_ALL_UNITS = {254.0}
"""The address by which the libraries of servo buses reach every unit at once."""


def contradicted(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """Speed, registers, units, lines, poses and stop of a device are those of its profile's protocol definition."""
    grammars = [
        (facts.grammar, facts.name, facts.holds)
        for facts in artifacts.profiles.values()
        if facts.grammar and facts.holds
    ]
    if not grammars:
        return []
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    out: dict[tuple[ast.AST, str], Diagnostic] = {}
    for grammar, name, holds in grammars:
        commands = {command["tool"]: command for command in grammar.get("commands", ())}
        tools = [
            (commands[tool["name"]], tool_functions(source, site))
            for site, tool in served_tools(source, artifacts)
            if tool["name"] in commands and set(tool["devices"]) <= holds
        ]
        judge = _Judge(source, flow, grammar, [root for _, roots in tools for root in roots])
        hint = f"write it as the protocol definition of the profile {display(name)} has it"
        for node, what in judge.found(tools) if tools else ():
            out.setdefault((node, what), source.problem(CODE, node, what, hint))
    return list(out.values())


RULES = (Rule(CODE, contradicted),)


class _Judge:
    """The calls of the tools of one profile, held against its protocol definition."""

    def __init__(self, source: Source, flow: Flow, grammar: Grammar, roots: list[Function]) -> None:
        self._source, self._flow, self._grammar = source, flow, grammar
        self._used = source.entered_from(roots)
        self._numbers = Chosen(source, flow).numbers
        self._left = [_BUDGET]

    def found(self, tools: list[tuple[Mapping[str, Any], list[Function]]]) -> Found:
        """What contradicts the profile, each with where."""
        yield from self._speeds()
        registers = self._grammar.get("registers")
        if registers is not None:
            yield from self._raw(registers)
            yield from self._maps(registers)
        for command, roots in tools:
            for root in roots if len(roots) == 1 else ():
                wrong = (list(self._wrong(command, given, root)) for given in _arguments(command))
                yield from next(filter(None, wrong), [])
                yield from self._held(root, registers) if command.get("do") == "stop" and registers else ()

    def _wrong(self, command: Mapping[str, Any], given: Mapping[str, Any], root: Function) -> Found:
        """What one call of a tool sends to its device that the command does not."""
        registers = self._grammar.get("registers") if "runtime.units" in self._source.text else None
        for sent in self._sent(root, given):
            yield from self._lines(command, given, sent)
            yield from self._counted(command, given, sent)
            yield from self._moved(command, given, sent, registers)

    def _held(self, root: Function, registers: Grammar) -> Found:
        """A goal of the file that a stop writes: what stops holds where it is."""
        motion = registers.get("motion") or {}
        goal = float(registers["fields"].get(motion.get("goal"), {}).get("address", -1))
        for call, name in self._source.calls:
            writes = name.rpartition(".")[2] in _RAW and len(call.args) > 3
            if writes and self._source.owner(call) in self._source.entered_from([root]):
                at, value = self._numbers(call.args[2]), self._numbers(call.args[3])
                if at == frozenset({goal}) and value:
                    yield call, f"a stop moves to {min(value):g}: it holds each unit where it is"

    def _calls(self) -> Iterator[tuple[ast.Call, str]]:
        return (each for each in self._source.calls if self._source.owner(each[0]) in self._used)

    def _speeds(self) -> Found:
        """The speeds of the ports that the tools of the device open; that of the profile is one of them."""
        baud = (self._grammar.get("registers") or self._grammar.get("line") or {}).get("baud")
        stated: list[tuple[ast.AST, ast.expr]] = []
        for call, name in self._calls():
            opens = name.rpartition(".")[2] in _OPENS
            stated += [(call, item.value) for item in call.keywords if opens and item.arg in ("baudrate", "baud")]
            stated += [(call, item) for item in (call.args[1:2] if opens else ())]
            stated += [(call, item) for item in (call.args[:1] if name.rpartition(".")[2] == "setBaudRate" else ())]
        for node in self._source.by_kind[ast.Assign]:
            pairs = [each for item in node.targets for each in _pairs(item, node.value)]
            named = [each for item, each in pairs if isinstance(item, ast.Attribute) and item.attr == "baudrate"]
            stated += [(node, each) for each in named if self._source.owner(node) in self._used]
        speeds = [(node, self._numbers(each)) for node, each in stated]
        if baud is None or any(each is None for _, each in speeds):
            return
        for node, numbers in speeds if all(float(baud) not in (each or ()) for _, each in speeds) else ():
            shown = listed([f"{number:g}" for number in sorted(numbers or ())])
            yield node, f"the server opens the line at {shown} baud, and the profile has {baud}"

    def _raw(self, registers: Grammar) -> Found:
        """Addresses and units of calls of the maker's library that the profile does not have."""
        addresses = {float(field["address"]) for field in registers.get("fields", {}).values()}
        units = {float(number) for number in registers.get("units", {}).values()} | _ALL_UNITS
        for call, name in self._calls():
            if name.rpartition(".")[2] in _RAW and len(call.args) > 2:
                one, at = self._numbers(call.args[1]), self._numbers(call.args[2])
                if at and not at & addresses:
                    yield call, f"the server asks for the register {min(at):g}, which the profile does not have"
                if one and not one & units:
                    yield call, f"the server asks the unit {min(one):g}, which the profile does not have"

    def _maps(self, registers: Grammar) -> Found:
        """What a map of ``runtime.registers`` has otherwise than the profile."""
        for call, name in self._source.calls:
            if name == "runtime.registers.Map" and self._source.owner(call) is None:
                made = self._constant(call)
                if isinstance(made, Sent):
                    yield from _map_problems(made, registers)

    def _constant(self, node: ast.expr) -> Any:
        with contextlib.suppress(Failed, Unsure, Spent):
            return SendingEvaluator(self._source, World(lambda _: 0.0, self._left)).constant(node)
        return None

    def _sent(self, root: Function, given: Mapping[str, Any]) -> list[list[Sent]]:
        """What is sent along each way through one call of a tool; none where one is not known."""

        def sending(choices: list[bool]) -> SendingEvaluator:
            return SendingEvaluator(self._source, World(lambda _: 0.0, self._left), choices)

        out: list[list[Sent]] = []
        for call in ways(sending, _MAX_WAYS):
            try:
                with contextlib.suppress(Failed):
                    call.call(root, given)
                    out.append(call.sent)
            except (Unsure, Spent):
                return []
        return out

    def _lines(self, command: Mapping[str, Any], given: Mapping[str, Any], sent: list[Sent]) -> Found:
        """Lines that are sent by a tool, and are not its command's."""
        if "line" not in self._grammar:
            return
        send = str(command.get("send") or "")
        try:
            wanted = send.format(**given) if send else None
        except (LookupError, ValueError):
            return
        for each in sent:
            yield from self._wire(each)
            for line in _lines_of(each):
                if line and not _is_same(line, wanted):
                    expected = f"the profile sends {display(wanted)}" if wanted else "the profile sends nothing"
                    called = f" of {listed([f'{name} {number}' for name, number in given.items()])}" if given else ""
                    yield each.node, f"{display(command['tool'])}{called} sends {display(line)}, and {expected}"

    def _wire(self, sent: Sent) -> Found:
        """Speed and ending of a ``runtime.lines.Wire`` that are not the profile's."""
        wire = sent.argument(1, "wire") if last(sent.node.func) == "Exchange" else None
        if not isinstance(wire, Sent):
            return
        for at, member in ((1, "baud"), (2, "ending")):
            stated, wanted = wire.argument(at, member), self._grammar["line"].get(member)
            if is_plain(stated) and stated != wanted:
                yield (
                    wire.node,
                    f"the wire has {display(str(stated))} as {member}, and the profile {display(str(wanted))}",
                )

    def _counted(self, command: Mapping[str, Any], given: Mapping[str, Any], sent: list[Sent]) -> Found:
        """A step of ``runtime.counting`` that is not what the command does."""
        tool, position = command["tool"], self._grammar.get("position") or {}
        until = (self._grammar.get("stop") or {}).get("until")
        axes = {item["tool"]: (name, item["parameter"]) for name, item in position.get("axes", {}).items()}
        for each in (item for item in sent if last(item.node.func) == "Step"):
            resumes, zero = each.argument(3, "resumes", False), each.argument(2, "zero", False)
            if tool == until and resumes is False:
                yield each.node, f"{display(tool)} does not end a stop: the profile has it as what resumes"
            if tool == position.get("zero") and zero is False:
                yield each.node, f"{display(tool)} is not counted as the way to the origin"
            if tool in axes:
                axis, parameter = axes[tool]
                by, name = each.argument(1, "by", 0), each.argument(0, "axis", "")
                if is_plain(by) and by != given.get(parameter):
                    yield each.node, f"{display(tool)} counts {by} where it is given {given.get(parameter)}"
                if is_plain(name) and name != axis:
                    yield each.node, f"{display(tool)} counts the axis {display(str(name))}, and moves {display(axis)}"

    def _moved(
        self, command: Mapping[str, Any], given: Mapping[str, Any], sent: list[Sent], registers: Grammar | None
    ) -> Found:
        """Movements of units that are not what the command does."""
        does, tool = command.get("do"), command["tool"]
        for each in sent if registers is not None else ():
            name = last(each.node.func)
            goals = each.argument(0, "goals")
            if does == "stop" and name in _MOVES:
                yield each.node, f"{display(tool)} moves a unit, and the profile has it as the stop"
            elif does == "pose" and name in ("pose", "move_many") and isinstance(goals, dict) and is_plain(goals):
                wanted = dict(registers["poses"][command["pose"]]) if registers is not None else {}
                wrong = [f"{unit} {at}" for unit, at in goals.items() if wanted.get(unit) != at]
                if wrong:
                    yield each.node, f"{display(tool)} moves {listed(wrong)}, which is not the pose of the profile"
                if name == "pose" and command.get("release") and each.argument(2, "release", False) is False:
                    yield each.node, f"{display(tool)} does not release the units, as the profile has it"
            elif does == "move_unit" and name == "move" and "position" in given:
                at = each.argument(1, "goal")
                if is_plain(at) and at != given["position"]:
                    yield each.node, f"{display(tool)} moves to {at} where it is given {given['position']}"


def _pairs(target: ast.expr, value: ast.expr) -> list[tuple[ast.expr, ast.expr]]:
    """(target, value) of an assignment, one after the other where several are made at once."""
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        return list(zip(target.elts, value.elts, strict=False))
    return [(target, value)]


def _lines_of(sent: Sent) -> list[str]:
    """The line that one call sends, without its ending; empty where it is not known."""
    name = last(sent.node.func)
    line = sent.argument(2, "command") if name == "Exchange" else sent.argument(0, "data")
    if name not in ("Exchange", "write", "send", "sendall") or not isinstance(line, str | bytes):
        return []
    if (name == "Exchange") is not isinstance(line, str):
        return []  # a file may be written as well, with a string
    return [(line.decode("latin-1") if isinstance(line, bytes) else line).rstrip("\r\n")]


def _is_same(line: str, wanted: str | None) -> bool:
    """Whether two lines have the same words and numbers, however a number is written."""
    one, other = (_NUMBER.split(" ".join(text.split())) for text in (line, wanted or ""))
    return len(one) == len(other) and all(
        float(each) == float(than) if at % 2 else each == than
        for at, (each, than) in enumerate(zip(one, other, strict=True))
    )


def _arguments(command: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Arguments of a command to compute its call with: integers, choices, one after the other."""
    parameters = command.get("parameters", {})
    if any(member.get("type") in ("boolean", "string") and "enum" not in member for member in parameters.values()):
        return  # how these are written is the server's choice
    for tried in _TRIED if parameters else (0,):
        given: dict[str, Any] = {}
        for name, member in parameters.items():
            if "enum" in member:
                given[name] = member["enum"][abs(tried) % len(member["enum"])]
            else:
                low, high = member.get("minimum", tried), member.get("maximum", tried)
                # Not the lowest number itself, which a server that caps what it is given would send as well.
                given[name] = int(min(max(tried, low), high)) + (37 if low > tried and high >= low + 37 else 0)
        yield given


def _map_problems(made: Sent, registers: Grammar) -> Found:
    """What a map has otherwise than the profile: units, registers, how a unit is moved, what protects it."""
    units, fields = made.named.get("units"), made.named.get("fields")
    wanted = registers.get("units", {})
    if isinstance(units, dict) and is_plain(units):
        for name, number in units.items():
            if wanted.get(name) != number:
                what = f"the map has the unit {display(str(name))} as {number}, and the profile {wanted.get(name)}"
                yield made.node, what
    known = registers.get("fields", {})
    for name, field in fields.items() if isinstance(fields, dict) else ():
        if isinstance(field, Sent):
            yield from _field_problems(str(name), field, known)
    motion, protect = made.named.get("motion"), made.named.get("protect")
    if isinstance(motion, Sent) and registers.get("motion"):
        for member in ("goal", "present"):
            stated = motion.argument(("goal", "present").index(member), member)
            if isinstance(stated, str) and stated != registers["motion"][member]:
                what = f"the motion has {display(stated)} as {member}, and the profile {registers['motion'][member]}"
                yield motion.node, what
    if protect is None and registers.get("protect") and isinstance(motion, Sent):
        yield made.node, "the map has no `protect`, and the profile refuses to move a unit that is too hot"


def _field_problems(name: str, field: Sent, known: Grammar) -> Found:
    if name not in known:
        yield field.node, f"the map has the register {display(name)}, which the profile does not have"
        return
    usual = {"address": _UNSET, "size": 1, "scale": 1, "sign_bit": None}
    for at, (member, otherwise) in enumerate(usual.items()):
        stated = field.argument(at, member, otherwise)
        wanted = known[name].get({"size": "bytes"}.get(member, member), otherwise)
        if is_plain(stated) and stated != wanted:
            what = f"the map has {stated} as {member} of the register {display(name)}, and the profile {wanted}"
            yield field.node, what


_UNSET = object()
