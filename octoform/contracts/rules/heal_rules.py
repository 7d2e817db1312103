"""Rules for HEAL: one error, one action that fits its class, and code only where code is at fault.

What a rewritten server itself may be is held by SERVE's contract and by the comparison with the accepted one.
"""

import ast
from collections.abc import Iterable, Iterator
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules import report_rules, text_rules
from octoform.contracts.rules.report_rules import Found, concerned, facts_of, source_of
from octoform.contracts.server_code.server_source import Function, Source, needed_source
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.records import dataclass, replace

NONE = "none"
REWRITE = "rewrite"
ACTIONS = {
    "dependency": ("redeploy", REWRITE),
    "broken_tool": (REWRITE,),
    "corrupted_file": ("restore",),
    "dead_process": ("restart",),
    "device_moved": ("rediscover",),
    "none": (),
}
"""The allowed actions for an error of each class; no action is always allowed."""


def class_differs(value: JsonObject, artifacts: Artifacts) -> Found:
    """The class is that of the error, unless the error is handed back."""
    given = (facts_of(artifacts).error or {}).get("class")
    if given is None or value["class"] == given or value["status"] == "not_mine":
        return []
    summary = f"the error is of the class {given}, and {value['class']} was treated"
    hint = f"write {given}; if that is wrong, the status is not_mine and the action none"
    return [error("HEAL-CLASS-DIFFERS", summary, pointer="/class", hint=hint)]


def target_differs(value: JsonObject, artifacts: Artifacts) -> Found:
    """The report must treat the error that was asked for."""
    target = facts_of(artifacts).target
    if target is None or value["target"] == target:
        return []
    summary = f"the target is {display(target)}, not {display(value['target'])}"
    return [error("HEAL-TARGET-DIFFERS", summary, pointer="/target", hint=f"write {target}")]


def action_misfit(value: JsonObject, _: Artifacts) -> Found:
    """The action is one that fixes this class, and there is one exactly where the report states that it repairs."""
    action, status, allowed = value["action"], value["status"], ACTIONS[value["class"]]
    problem = None
    if status == "repaired" and action == NONE:
        problem = "the status is repaired, and no action is named", "name the action, or write failed"
    elif status != "repaired" and action != NONE:
        problem = f"the status is {status}, and the action is {action}", "write none, or repaired"
    elif action not in (NONE, *allowed):
        hint = f"the class {value['class']} has {' or '.join(allowed)}" if allowed else "write none: a person is asked"
        problem = f"the action {action} fixes no error of the class {value['class']}", hint
    if problem is None:
        return []
    return [error("HEAL-ACTION-MISFIT", problem[0], pointer="/action", hint=problem[1])]


def server_misfit(value: JsonObject, _: Artifacts) -> Found:
    """Code is handed over with a rewrite and with nothing else, and then the functions are named that differ."""
    rewrite, found = value["action"] == REWRITE, []
    if rewrite != (value["server"] is not None):
        summary = "the action is rewrite, and there is no server" if rewrite else "there is a server without a rewrite"
        found.append((summary, "/server", "write server.py" if rewrite else "write null"))
    if rewrite != bool(value["functions"]):
        summary = "no function is named that differs" if rewrite else "functions are named without a rewrite"
        found.append((summary, "/functions", "name each that you changed" if rewrite else "write an empty list"))
    return [error("HEAL-SERVER-MISFIT", summary, pointer=where, hint=hint) for summary, where, hint in found]


def foreign_function(value: JsonObject, artifacts: Artifacts) -> Found:
    """Only functions that are the tool's own are rewritten."""
    own, found = facts_of(artifacts).functions, []
    for index, name in enumerate(value["functions"]):
        if name not in own:
            near = did_you_mean(name, own)
            hint = f"did you mean {near}?" if near else f"the tool's own are {listed(list(own))}" if own else "none is"
            summary = f"the function {display(name)} is not this tool's own"
            found.append(error("HEAL-FOREIGN-FUNCTION", summary, pointer=pointer("functions", index), hint=hint))
    return found


def unexplained(value: JsonObject, artifacts: Artifacts) -> Found:
    """A repair explains something that was read at its tool or device, or what the error itself rests on."""
    facts = facts_of(artifacts)
    cause = facts.error or {}
    known = set(facts.ids())
    wanted = concerned(facts.tool, cause.get("device"), artifacts)
    cited = [identity for identity in value["cites"] if identity in known]
    fits = any(identity in cause.get("cites", ()) or source_of(identity, artifacts) in wanted for identity in cited)
    if value["status"] != "repaired" or fits:
        return []
    summary = "nothing that is cited is about what was repaired"
    hint = "cite what the error rests on, or a reading or failure of the tool that your reason explains"
    return [error("HEAL-UNEXPLAINED", summary, pointer="/cites", hint=hint)]


RULES = (
    Rule("HEAL-UNESCAPED-TEXT", text_rules.in_values("HEAL-UNESCAPED-TEXT")),
    Rule("HEAL-UNKNOWN-READING", report_rules.unknown_reading("HEAL-UNKNOWN-READING")),
    Rule("HEAL-UNKNOWN-NAME", report_rules.unknown_name("HEAL-UNKNOWN-NAME")),
    Rule("HEAL-CLASS-DIFFERS", class_differs),
    Rule("HEAL-TARGET-DIFFERS", target_differs),
    Rule("HEAL-ACTION-MISFIT", action_misfit),
    Rule("HEAL-SERVER-MISFIT", server_misfit),
    Rule("HEAL-FOREIGN-FUNCTION", foreign_function),
    Rule("HEAL-UNEXPLAINED", unexplained),
    Rule("HEAL-ORDERS", report_rules.orders("HEAL-ORDERS")),
    *report_rules.rules("HEAL"),
)


# What a rewritten function no longer does: a repair that reads less, or returns what it has not read, is none.
#
# A wrong register makes a tool report nonsense, and the shortest way to silence it is to ask no longer: to leave out
# the check, to answer with a constant, to catch the error. Each of these would pass a test call. Reading code proves
# nothing for good, but it shows what was asked before and is not asked now.

READS_LESS, INVENTS = "HEAL-READS-LESS", "HEAL-INVENTS"
PATH = "server.py"
_LASTING = frozenset({"runtime.device", "runtime.bus"})
"""The calls that each tool begins with; the other names of the runtime may be misused, like those of a library."""
_KEEP = "fix what is asked wrongly, and go on asking; a tool that cannot be fixed so is left as it is"
_NO_VALUE = "return what was read, and let a failure be an error; no reading is invented or replaced by a default"


@dataclass(frozen=True, slots=True)
class _Side:
    """One of the two servers: its source, and the functions that are compared."""

    source: Source
    functions: tuple[Function, ...]


def bereft(accepted: str, rewritten: str, functions: Iterable[str]) -> list[Diagnostic]:
    """What the rewritten and new ``functions`` no longer do, invent or hide; both sources compile."""
    named = frozenset(functions)
    old, new = needed_source(accepted), needed_source(rewritten)
    known = {item.name for item in _functions(old)}
    before = _Side(old, tuple(item for item in _functions(old) if item.name in named))
    after = _Side(new, tuple(item for item in _functions(new) if item.name in named or item.name not in known))
    return [*_reads_less(before, after, known), *_invents(before, after), *_hides(before, after)]


def _functions(source: Source) -> list[Function]:
    return [item for item in source.tree.body if isinstance(item, Function)]


def _reads_less(before: _Side, after: _Side, known: set[str]) -> Iterator[Diagnostic]:
    """Calls of the server's own functions, of a device and its lock stay; what else is called does not get less."""
    had, has = _calls(before), _calls(after)
    lasting = {name for name in map(_name, had) if name in known or name in _LASTING}
    gone = sorted(lasting - set(map(_name, has)))
    if gone:
        summary = f"the rewrite no longer calls {listed(gone)}"
        yield error(READS_LESS, summary, path=PATH, hint=_KEEP)
    elif seldom := sorted(_always(before, lasting) - _always(after, lasting)):
        summary = f"the rewrite calls {listed(seldom)} in some cases only, where each call did"
        yield error(READS_LESS, summary, path=PATH, hint=_KEEP)
    elif len(has) < len(had):
        summary = f"the rewrite makes {len(has)} calls where there were {len(had)}"
        yield error(READS_LESS, summary, path=PATH, hint=_KEEP)


def _calls(side: _Side) -> list[ast.Call]:
    return [node for node in _live(side) if isinstance(node, ast.Call)]


def _live(side: _Side) -> Iterator[ast.AST]:
    """Every part of the functions that may be run, without decorators and the words of errors."""
    for function in side.functions:
        for statement in _reached(function.body):
            yield from _below(statement)


def _always(side: _Side, names: set[str]) -> set[str]:
    """Of these functions the ones that are called whatever was read, and not only under a condition."""
    found: set[str] = set()
    waiting: list[ast.AST] = [item for function in side.functions for item in _reached(function.body)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Call) and _name(node) in names:
            found.add(_name(node))
        whole = not isinstance(node, ast.If | ast.IfExp | ast.BoolOp | ast.While | ast.Match | ast.ExceptHandler)
        first = [getattr(node, name) for name in ("test", "subject") if hasattr(node, name)]
        waiting += ast.iter_child_nodes(node) if whole else first + getattr(node, "values", [])[:1]
    return found


def _below(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Raise):
        return
    yield node
    for _, part in ast.iter_fields(node):
        for child in _reached(part) if isinstance(part, list) else [part]:
            if isinstance(child, ast.AST):
                yield from _below(child)


def _reached(block: list[Any]) -> Iterator[Any]:
    """The statements of a block up to the one behind which nothing is run."""
    for item in block:
        yield item
        if isinstance(item, ast.Return | ast.Raise | ast.Continue | ast.Break):
            return


def _name(call: ast.Call) -> str:
    return ast.unparse(call.func)


def _invents(before: _Side, after: _Side) -> Iterator[Diagnostic]:
    """No answer is a constant that was none before, and no name that held what was read holds a constant now."""
    names = {ast.dump(node.value) for node in _returns(before) if node.value is not None}
    for node in _returns(after):
        if node.value is not None and _constant(node.value) and ast.dump(node.value) not in names:
            summary = f"the rewrite answers with {display(ast.unparse(node.value), 40)}, which nothing has read"
            yield _placed(after.source, node, summary)
    if _defaults(after) > _defaults(before):
        summary = "the rewrite puts a constant in the place of what could not be read (`or`)"
        yield error(INVENTS, summary, path=PATH, hint=_NO_VALUE)
    read = {name for name, values in _assigned(before).items() if any(_asks(value) for value in values)}
    for name, values in _assigned(after).items():
        if name in read and not any(_asks(value) for value in values):
            summary = f"the rewrite gives {display(name)} a value that it has not read"
            yield _placed(after.source, values[0], summary)


def _defaults(side: _Side) -> int:
    """How often a number or a string of the file stands behind an ``or``, as the value of what is asked before it."""
    ways = [node for node in _live(side) if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.Or)]
    return sum(isinstance(each.values[-1], ast.Constant) and each.values[-1].value is not None for each in ways)


def _returns(side: _Side) -> Iterator[ast.Return]:
    for function in side.functions:
        yield from (node for node in ast.walk(function) if isinstance(node, ast.Return))


def _constant(value: ast.expr) -> bool:
    """Whether an expression asks no one and holds nothing that was asked: no name, no call."""
    return not any(isinstance(node, ast.Name | ast.Call | ast.Attribute) for node in ast.walk(value))


def _assigned(side: _Side) -> dict[str, list[ast.expr]]:
    """The values assigned to each name, over all functions."""
    found: dict[str, list[ast.expr]] = {}
    for function in side.functions:
        for node in ast.walk(function):
            if isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr) and node.value is not None:
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                for item in (part for target in targets for part in ast.walk(target) if isinstance(part, ast.Name)):
                    found.setdefault(item.id, []).append(node.value)
    return found


def _asks(value: ast.expr) -> bool:
    return any(isinstance(node, ast.Call | ast.Await) for node in ast.walk(value)) or not _constant(value)


def _placed(source: Source, node: ast.AST, summary: str) -> Diagnostic:
    return replace(source.problem(INVENTS, node, summary, _NO_VALUE), path=PATH)


HIDES = "HEAL-HIDES"


def _hides(before: _Side, after: _Side) -> Iterator[Diagnostic]:
    """Nothing is tried again, kept for later, waited for longer, passed over; the review judges what is caught."""
    hint = "fix what is wrong; where the code is right and the device fails, the status is not_mine"
    for what, count in (
        ("tries again", _tried_again),
        ("keeps what was read", _kept),
        ("waits longer", _waited),
        ("leaves a function before its end", _left),
        ("sends again and again what was sent once", _repeated),
    ):
        if count(after) > count(before):
            yield error(HIDES, f"the rewrite {what}", path=PATH, hint=hint)


def _tried_again(side: _Side) -> float:
    """How many loops end as soon as what they try succeeds."""
    loops = [node for node in _live(side) if isinstance(node, ast.For | ast.While)]
    return sum(
        any(isinstance(item, ast.If) and any(isinstance(each, ast.Break) for each in item.body) for item in loop.body)
        or any(isinstance(item, ast.Try) for item in loop.body)
        for loop in loops
    )


def _kept(side: _Side) -> float:
    """How many statements let a function assign to a name that outlives the call."""
    return sum(isinstance(node, ast.Global | ast.Nonlocal) for node in _live(side))


def _left(side: _Side) -> float:
    """Returns of nothing: whatever stands below them, a check too, is passed over."""
    return sum(isinstance(node, ast.Return) and node.value is None for node in _live(side))


_SENDS = frozenset({"write", "writelines", "send", "sendall", "sendto", "write_text", "write_bytes"})


def _repeated(side: _Side) -> float:
    """Calls within a loop that send something to a device."""
    loops = [node for node in _live(side) if isinstance(node, ast.For | ast.While)]
    calls = {item for loop in loops for item in ast.walk(loop) if isinstance(item, ast.Call)}
    return sum(_name(call).rpartition(".")[2] in _SENDS for call in calls)


def _waited(side: _Side) -> float:
    """Seconds that are slept or waited for, as far as they are numbers."""
    calls = _calls(side)
    slept = [call.args[0] for call in calls if _name(call).rpartition(".")[2] == "sleep" and call.args]
    waits = [item.value for call in calls for item in call.keywords if item.arg == "timeout"]
    numbers = [item.value for item in (*slept, *waits) if isinstance(item, ast.Constant)]
    return float(sum(each for each in numbers if isinstance(each, int | float)))
