"""Rules for SERVE about what a tool changes: nothing where its effect is ``read``, else what its caller passed.

Tools of effect ``read`` are called without asking anybody. A tool that sets something and does not, or does it once its
call is over, reports to its caller a state that is not there.
"""

import ast
import os
import re
from collections.abc import Iterator
from functools import lru_cache

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.serve.device_rules import RUNTIME_TOUCHES, is_node_path
from octoform.contracts.rules.serve.reading_rules import does_nothing, flow_of_tools
from octoform.contracts.rules.serve.tool_rules import ToolSite, binds, is_used, served_tools, tool_functions
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import PLACES, PURE, Origin, base, last, touches
from octoform.contracts.server_code.places import folded
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic, as_warning
from octoform.patterns import regex

CODE, ACTS = "SERVE-READ-WRITES", "SERVE-READ-ACTS"
SETS_NOTHING, LATER, HIDDEN = "SERVE-SETS-NOTHING", "SERVE-ACTS-LATER", "SERVE-FAILURE-HIDDEN"
UNUSED = "SERVE-ARGUMENT-UNUSED"
_MOVING = frozenset({"move", "move_percent", "move_many", "pose", "torque"})
"""Methods of ``runtime.units.Units`` that move a unit or switch its torque."""
_ALWAYS_WRITES = regex(
    r"os\.(?:remove|unlink|rmdir|removedirs|rename|renames|replace|mkdir|makedirs|chmod|chown|truncate|symlink|link"
    r"|mknod|mkfifo|setxattr|utime)|shutil\.(?:rmtree|move|copy|copy2|copyfile|copytree|chown)"
    r"|runtime\.gpio\.(?:drive|hold)|runtime\.evdev\.(?:rumble|beep)|runtime\.v4l2\.set_control"
    r"|runtime\.movement\.(?:carried_out|energised|planned)|runtime\.units\..*\.(?:move|move_percent|move_many|pose|torque)"
    r"|cv2\.imwrite|(?:numpy|np)\.save(?:txt|z\w*)?|logging\.(?:.+\.)?\w*FileHandler"
)
_PROGRAMS = regex(
    r"(?:.*/)?(?:tee|dd|cp|mv|rm|rmdir|mkdir|touch|chmod|chown|ln|truncate|mkfs(?:\..*)?|i2cset|gpioset|setserial|install"
    r"|setpci|hdparm|wipefs|parted|fdisk|eject|reboot|shutdown|poweroff|rfkill|modprobe|rmmod|insmod|usbreset)"
)
"""Programs that are there to change something (the manual pages' first lines)."""
_WRAPPERS = regex(r"(?:.*/)?(?:busybox|toybox|timeout|nice|ionice|stdbuf|setsid|nohup|chrt|taskset|time|flock)")
"""Programs that start the one that is named after them."""
_OPENS = frozenset({"open", "io.open", "os.fdopen", "io.FileIO", "codecs.open", "gzip.open", "bz2.open", "lzma.open"})
_OPENED_TO_WRITE = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_SCRATCH = ("tempfile.", "io.BytesIO", "io.StringIO")
_SETS = regex(
    r"-{0,2}(?:set|sset|cset|write|enable|disable|reset|erase|update|flash)(?!-fmt|-parm|-sel)(?:-\w+)*(?:=.*)?"
)
_SAYS = frozenset({"write", "writelines", "send", "sendall", "sendto", "query", "ask", "command", "send_command"})
_ORDER = regex(
    r"\W*(?:SET|MOVE|GOTO|TORQUE|JOG|HOME|WRITE|ENABLE|DISABLE|ROTATE|OPEN|CLOSE|ERASE|G0*[0123]|G28|M17|M3)(?:[\W_\d]|$)",
    re.IGNORECASE,
)
_MOVES = frozenset({"move", "goto", "jog", "home", "torque", "rotate", "actuate", "drive", "fire", "dispense"})
_STARTS = frozenset({"set", "write", "enable", "disable", "send", "start", "sync", "put"})
_MOVED = frozenset(
    {
        "goal",
        "goals",
        "position",
        "positions",
        "torque",
        "angle",
        "angles",
        "velocity",
        "pwm",
        "relay",
        "target",
        "pose",
    }
    | {"joint", "joints", "servo", "servos", "motor", "motors", "coil", "coils", "gripper", "setpoint", "pos", "ex"}
)
_WRITTEN = regex(r"write\d?(?:1|2|4)?Byte\w*|Write(?:Pos|Spec|Timer|Dir)\w*|(?:sync|reg|bulk)_?[wW]rite\w*|unlockEprom")
"""Methods that write registers, as the libraries of servo buses call them."""
_WRITING_METHODS = frozenset(
    {"write_text", "write_bytes", "unlink", "rmdir", "touch", "mkdir", "chmod", "symlink_to", "hardlink_to"}
)
_READING = regex(
    r"runtime\.(?:device|bus|files|sysroot|sentence|logged|read_\w+|channels\..+|evdev\.(?:axis|events)"
    r"|v4l2\.(?:is_node|formats))|os\.(?:listdir|scandir|stat|access|path\..+)|glob\.\w+"
)
_READING_METHODS = PLACES | {
    "read_text",
    "read_bytes",
    "iterdir",
    "glob",
    "rglob",
    "exists",
    "is_file",
    "is_dir",
    "stat",
}
_LATER = frozenset({"Thread", "Timer", "submit", "create_task", "ensure_future", "start_new_thread", "call_later"})
_WAITS = frozenset({"join", "result", "gather", "wait", "wait_for", "as_completed"})
_OF_VALUES = frozenset({"KeyError", "ValueError", "IndexError", "TypeError", "AttributeError", "StopIteration"})
"""Exceptions about values of the program, and not about a device."""


def read_writes(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool of effect ``read`` writes to nothing but temporary files."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "leave the write out; a tool that sets something has the effect actuate in INTERFACE"
    out: dict[ast.AST, Diagnostic] = {}
    writing: list[tuple[ast.expr, str]] = [each for each in source.calls if _writes(source, flow, *each)]
    writing += [(node, node.attr) for node in source.by_kind[ast.Attribute] if _hands_on(source, node)]
    for site, tool in served_tools(source, artifacts):
        used = source.entered_from(tool_functions(source, site)) if tool["effect"] == "read" else []
        for node, name in writing:
            if source.owner(node) in used and node not in out and not _switched_off(source, node, used):
                summary = f"{display(name)} writes, and the tool {display(site.name or '')} has the effect read"
                out[node] = source.problem(CODE, node, summary, hint)
    return list(out.values())


def read_acts(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool of effect ``read`` neither moves a unit of the runtime nor asks for its device as one that acts."""
    source = needed_source(value)
    has_units = any(source.dotted(node).startswith("runtime.units") for node in source.nodes)
    hint = "leave it out; a tool that moves or switches something has the effect actuate in INTERFACE"
    acting = [(node, what) for node in source.nodes if (what := _acts(node, has_units))]
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        used = source.entered_from(tool_functions(source, site)) if tool["effect"] == "read" else []
        for node, what in acting:
            if node in out or source.owner(node) not in used:
                continue
            if not isinstance(node, ast.Call) or not _switched_off(source, node, used):
                summary = f"{what}, and the tool {display(site.name or '')} has the effect read"
                problem = source.problem(ACTS, node, summary, hint)
                # Who asks so for a reading is refused a twin in doubt, and moves nothing by it.
                out[node] = as_warning(problem) if isinstance(node, ast.Call) else problem
    return list(out.values())


def sets_nothing(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that is no reading calls something that may change its device."""
    source = needed_source(value)
    hint = "write what the caller asked for to the device, or give the tool the effect read in INTERFACE"
    return [
        source.problem(
            SETS_NOTHING,
            site.node,
            f"the tool {display(site.name or '')} is there to set something, and only reads",
            hint,
        )
        for site, tool in served_tools(source, artifacts)
        if _sets_nothing(source, tool, tool_functions(source, site))
    ]


def argument_unused(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool uses which device its caller names, and all else that its caller passes."""
    source = needed_source(value)
    hint = "use it for what INTERFACE declares, or report in interface-errors that the device takes no such argument"
    out = []
    for site, tool in served_tools(source, artifacts):
        functions = tool_functions(source, site)
        idle = any(does_nothing(source, item) for item in functions) or _sets_nothing(source, tool, functions)
        declared = {"device"} if len(tool["devices"]) > 1 else set()
        declared |= {*(tool["input_schema"].get("properties") or {})} - {"device"}
        for function in () if idle else functions:
            inside = [item for part in function.body for item in walk(part)]
            loaded = {item.id for item in inside if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Load)}
            loaded -= {each for each in loaded & declared if not is_used(source, function, each)}
            given = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
            unused = {each for each in declared - loaded if tool["effect"] != "read" or binds(tool, each, loaded)}
            for name in (item for item in given if item.arg in unused and "locals" not in loaded):
                summary = f"{display(name.arg)} changes nothing in the tool {display(site.name or '')}"
                out.append(source.problem(UNUSED, name, summary, hint))
    return out


def acts_later(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool must finish its writes before its call ends: after it, neither lock nor emergency stop holds it."""
    source = needed_source(value)
    hint = "do it in the call itself, or wait there for what was started (join, result)"
    out: dict[ast.Call, Diagnostic] = {}
    for site, used in _acting(source, artifacts):
        for call, name in source.calls:
            owner = source.owner(call)
            if owner not in used or owner is None or last(call.func) not in _LATER or call in out:
                continue
            if not any(isinstance(item, ast.Call) and last(item.func) in _WAITS for item in walk(owner)):
                summary = f"{display(name)} acts when the call of {display(site.name or '')} may be over"
                out[call] = source.problem(LATER, call, summary, hint)
    return list(out.values())


def failure_hidden(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that could not set something fails: it does not return as if it had."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "let the error pass, or raise ToolError with what failed"
    out: dict[ast.AST, Diagnostic] = {}
    handlers: list[ast.AST]
    for site, used in _acting(source, artifacts):
        tries = [item for item in source.by_kind[ast.Try] if source.owner(item) in used and _may_act(source, item)]
        handlers = [each for item in tries for each in item.handlers if _returns_all_the_same(each)]
        handlers += [each for item in tries for each in _goes_on(source, flow, item)]
        handlers += _suppressing(source, flow, used)
        for handler in handlers:
            summary = f"the tool {display(site.name or '')} returns a result although what it did has failed"
            out.setdefault(handler, source.problem(HIDDEN, handler, summary, hint))
    return list(out.values())


RULES = (
    *(Rule(CODE, read_writes), Rule(ACTS, read_acts)),
    *(
        Rule(SETS_NOTHING, sets_nothing),
        Rule(LATER, acts_later),
        Rule(HIDDEN, failure_hidden),
        Rule(UNUSED, argument_unused),
    ),
)


def _acting(source: Source, artifacts: Artifacts) -> Iterator[tuple[ToolSite, list[Function]]]:
    """Each tool that is no reading, with the functions that it can enter."""
    for site, tool in served_tools(source, artifacts):
        if tool["effect"] != "read":
            yield site, source.entered_from(tool_functions(source, site))


def _sets_nothing(source: Source, tool: JsonObject, functions: list[Function]) -> bool:
    """Whether a tool that is no reading asks for its device and certainly changes nothing there."""
    used = source.entered_from(functions) if tool["effect"] != "read" else []
    stored = (item for function in used for item in walk(function) if isinstance(item, ast.Attribute | ast.Subscript))
    if not any(source.asking(item) for item in used) or any(isinstance(item.ctx, ast.Store) for item in stored):
        return False
    return all(only_reads(source, call, name) for call, name in source.calls if source.owner(call) in used)


def only_reads(source: Source, call: ast.Call, name: str) -> bool:
    """Whether a call certainly changes nothing, or enters a function of the file, which is looked at itself."""
    own = {item.name for item in (*source.functions, *source.classes)}
    root = base(call.func)
    if last(call.func) in own:
        return True
    if last(call.func) == "open":
        return name in ("open", "io.open") and len(call.args) == 1 and not call.keywords
    if root is not None and (root is call.func or root.id in source.names):
        record = root is call.func and root.id not in source.names and root.id[:1].isupper()
        known = _READING.fullmatch(name) or (PURE.fullmatch(name) and not touches(name))
        return record or bool(known)
    return last(call.func) in _READING_METHODS


def _may_act(source: Source, node: ast.Try) -> bool:
    calls = [item for part in node.body for item in walk(part) if isinstance(item, ast.Call)]
    own = {item.name for item in source.functions}
    return any(last(call.func) in own or not only_reads(source, call, source.dotted(call.func)) for call in calls)


def _returns_all_the_same(handler: ast.ExceptHandler) -> bool:
    """Whether a failure ends in a result that does not report it."""
    kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type] if handler.type else []
    if kinds and all(last(item) in _OF_VALUES for item in kinds):
        return False
    inside = [item for part in handler.body for item in walk(part)]
    is_known = any(isinstance(item, ast.Name) and item.id == handler.name for item in inside)
    returns = any(isinstance(item, ast.Return) and item.value is not None for item in inside)
    return returns and not is_known and not any(isinstance(item, ast.Raise) for item in inside)


def _goes_on(source: Source, flow: Flow, node: ast.Try) -> Iterator[ast.ExceptHandler]:
    """The handlers of a try that sets what the caller passes, after which a call goes on as if it had been set."""
    if not _sets_what_was_passed(source, flow, node.body) or _is_judged(source, node):
        return
    for handler in node.handlers:
        kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type] if handler.type else []
        quiet = all(isinstance(item, ast.Pass) or _is_a_note(source, item) for item in handler.body)
        if quiet and not (kinds and all(last(item) in _OF_VALUES for item in kinds)):
            yield handler


def _suppressing(source: Source, flow: Flow, used: list[Function]) -> Iterator[ast.AST]:
    """The blocks that suppress the failure of what sets what the caller passes."""
    for node in source.by_kind[ast.With]:
        items = [item.context_expr for item in node.items]
        suppresses = any(source.dotted(item).startswith("contextlib.suppress") for item in items)
        if suppresses and source.owner(node) in used and not _is_judged(source, node):
            yield from [node] if _sets_what_was_passed(source, flow, node.body) else ()


def _sets_what_was_passed(source: Source, flow: Flow, body: list[ast.stmt]) -> bool:
    calls = [item for part in body for item in walk(part) if isinstance(item, ast.Call)]
    acting = (call for call in calls if not only_reads(source, call, source.dotted(call.func)))
    return any(flow.of(item) & Origin.ARGUMENT for call in acting for item in call.args)


def _is_a_note(source: Source, statement: ast.stmt) -> bool:
    """``logging.warning(...)``: it reaches no caller."""
    call = statement.value if isinstance(statement, ast.Expr) else None
    return isinstance(call, ast.Call) and source.dotted(call.func).startswith(("logging.", "warnings.", "print"))


def _is_judged(source: Source, node: ast.stmt) -> bool:
    """Whether it is tried again, or something after it may end the call with an error."""
    owner = source.owner(node)
    if any(isinstance(above, ast.For | ast.While) for above, _ in source.above(node)):
        return True
    later = (item for item in walk(owner) if getattr(item, "lineno", 0) > (node.end_lineno or 0)) if owner else ()
    return any(isinstance(item, ast.Raise | ast.Assert) for item in later)


def _acts(node: ast.AST, has_units: bool) -> str | None:
    if has_units and isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load) and node.attr in _MOVING:
        return f"{display(node.attr)} moves a unit or switches it"
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute) or node.func.attr != "device":
        return None
    given = [item.value for item in node.keywords if item.arg == "actuate"] + node.args[1:2]
    plain = any(isinstance(item, ast.Constant) and item.value is True for item in given)
    return "it asks for its device as one that acts" if plain else None


def _hands_on(source: Source, node: ast.Attribute) -> bool:
    """Whether a method that writes a file is not called here, and is a value that something else may call."""
    above = source.parents.get(node)
    if node.attr not in ("write_text", "write_bytes") or (isinstance(above, ast.Call) and above.func is node):
        return False
    return isinstance(node.ctx, ast.Load) and not is_temporary(source, node.value, node)


def _named(flow: Flow, node: ast.expr) -> list[ast.AST]:
    """What a name stands for, where that can be determined; else the expression itself."""
    return (flow.plain(node) if isinstance(node, ast.Name) else []) or [node]


def _writes(source: Source, flow: Flow, call: ast.Call, name: str) -> bool:
    stands_for = [source.dotted(item) for item in _named(flow, call.func)]
    name = next((each for each in stands_for if each in _OPENS or each == "os.open"), name)
    method = call.func.attr if isinstance(call.func, ast.Attribute) else ""
    target = call.func.value if isinstance(call.func, ast.Attribute) else None
    if _ALWAYS_WRITES.fullmatch(name):
        return not any(is_temporary(source, item, call) for item in call.args)
    if method in _WRITING_METHODS and target is not None:
        return not is_temporary(source, target, call)
    if name == "functools.partial" and call.args and source.dotted(call.args[0]) in _OPENS:
        return _opens_to_write(source, flow, call, call.args[min(1, len(call.args) - 1)], call.args[2:3])
    if name in _OPENS:
        return _opens_to_write(source, flow, call, call.args[0] if call.args else None, call.args[1:2])
    if name == "os.open":
        given = next((item.value for item in call.keywords if item.arg == "flags"), None)
        flags = _flags(source, flow, (call.args[1:2] or ([given] if given is not None else []))[:1])
        # Who asks a device through its node writes the question.
        asks = bool(flags & os.O_RDWR) and bool(call.args) and not is_node_path(source, call.args[0], call)
        return bool(flags & _OPENED_TO_WRITE) or asks
    if name == "getattr":
        asked = call.args[1] if len(call.args) > 1 else None
        found = folded(source, flow, asked) if asked is not None else None
        return found in ("write_text", "write_bytes") and not is_temporary(source, call.args[0], call)
    if method == "open" and name not in RUNTIME_TOUCHES:
        return _opens_to_write(source, flow, call, target, call.args[:1])
    return _orders(source, flow, call, name, method)


def _flags(source: Source, flow: Flow, given: list[ast.expr]) -> int:
    """The flags of a descriptor, by their names and numbers."""
    found = 0
    for item in (part for each in given for value in _named(flow, each) for part in walk(value)):
        name = source.dotted(item).rpartition(".")[2]
        found |= item.value if isinstance(item, ast.Constant) and type(item.value) is int else 0
        found |= getattr(os, name, 0) if name.startswith("O_") else 0
    return found


def _program(flow: Flow, call: ast.Call) -> list[str]:
    """The words of a program that are written down, from its own name on."""
    given = call.args[:1] or [item.value for item in call.keywords if item.arg == "args"]
    parts = [part for item in given for value in _named(flow, item) for part in walk(value)]
    words = [item.value for item in parts if isinstance(item, ast.Constant) and isinstance(item.value, str)]
    while words and _WRAPPERS.fullmatch(words[0]):
        words = words[1:]
        while words and (words[0].startswith("-") or words[0].replace(".", "").rstrip("smhd").isdigit()):
            words = words[1:]
    return words


def _orders(source: Source, flow: Flow, call: ast.Call, name: str, method: str) -> bool:
    """Whether a call makes something else change: a program, a library's method, a line of text."""
    if name.startswith("subprocess."):
        words = _program(flow, call)
        return bool(words) and (_PROGRAMS.fullmatch(words[0]) is not None or any(map(_SETS.fullmatch, words[1:])))
    if isinstance(call.func, ast.Call) and source.dotted(call.func.func) == "getattr":
        return not isinstance(call.func.args[1] if len(call.func.args) > 1 else None, ast.Constant)
    if (
        not method
        or name.startswith(("cv2.", "numpy.", "np."))
        or any(item.name == method for item in source.functions)
    ):
        return False
    reached = flow.of(call) & (Origin.READ | Origin.FOUND)
    if method in ("rename", "replace") and len(call.args) == 1:
        return bool(flow.of(call.func.value) & Origin.FOUND) if isinstance(call.func, ast.Attribute) else False
    if method in _SAYS and reached:
        texts = (folded(source, flow, item) for item in call.args)
        return any(_ORDER.match(text) and "?" not in text for text in texts if text is not None)
    words = tokens(method)
    moves = words[0] in _MOVES or (words[0] in _STARTS and bool(_MOVED & set(words)))
    return bool(reached) and (moves or _WRITTEN.fullmatch(method) is not None)


def _switched_off(source: Source, call: ast.expr, used: list[Function]) -> bool:
    """Whether a call is under an ``if`` about an optional parameter that none of these functions gives."""
    owner = source.owner(call)
    tests = [above.test for above, below in source.above(call) if isinstance(above, ast.If) and below in above.body]
    asked = {item.id for test in tests for item in walk(test) if isinstance(item, ast.Name)}
    optional = {} if owner is None else _optional(owner)
    switches = {name: index for name, index in optional.items() if name in asked}
    if owner is None or not switches:
        return False
    entries = [each for each, name in source.calls if name == owner.name and source.owner(each) in used]
    return bool(entries) and any(
        all(not _gives(entry, name, index) for entry in entries) for name, index in switches.items()
    )


def _optional(function: Function) -> dict[str, int]:
    """The parameters whose default is None or False, each with its position."""
    given = function.args.args
    defaults = [None] * (len(given) - len(function.args.defaults)) + list(function.args.defaults)
    pairs = [(item.arg, index, default) for index, (item, default) in enumerate(zip(given, defaults, strict=True))]
    keywords = zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True)
    pairs += [(item.arg, 1000, default) for item, default in keywords]
    return {name: at for name, at, value in pairs if isinstance(value, ast.Constant) and _is_off(value.value)}


def _is_off(value: object) -> bool:
    return value is None or value is False


def _gives(call: ast.Call, name: str, index: int) -> bool:
    starred = any(isinstance(item, ast.Starred) for item in call.args)
    return starred or len(call.args) > index or any(item.arg in (name, None) for item in call.keywords)


def _opens_to_write(
    source: Source, flow: Flow, call: ast.Call, path: ast.expr | None, positional: list[ast.expr]
) -> bool:
    mode = next((item.value for item in call.keywords if item.arg == "mode"), positional[0] if positional else None)
    found = folded(source, flow, mode) if mode is not None else None
    if path is None or found is None:
        return False
    if not set(found) <= set("rwxabt+U") or is_temporary(source, path, call):
        return False
    return bool(set(found) & set("wxa")) or ("+" in found and not is_node_path(source, path, call))


def is_temporary(source: Source, path: ast.expr, call: ast.expr) -> bool:
    """Whether a path is made by ``tempfile``, or a file is in memory, directly or by names of the same function."""
    names = {item.id for item in walk(path) if isinstance(item, ast.Name)}
    scope = source.owner(call)
    for _ in range(4):  # a path of a path of a folder
        if any(source.dotted(item).startswith(_SCRATCH) for item in walk(path)) or names & _temporary(source, scope):
            return True
        more = {
            item.id
            for statement in (walk(scope) if scope is not None else ())
            if isinstance(statement, ast.Assign)
            and any(isinstance(target, ast.Name) and target.id in names for target in statement.targets)
            for item in walk(statement.value)
            if isinstance(item, ast.Name)
        }
        if more <= names:
            return False
        names |= more
    return False


@lru_cache(maxsize=64)
def _temporary(source: Source, scope: Function | None) -> frozenset[str]:
    """The names that a function binds to something of ``tempfile``, or to a file in memory."""
    found: set[str] = set()
    for item in walk(scope) if scope is not None else ():
        bound: list[tuple[ast.expr | None, ast.expr]] = []
        if isinstance(item, ast.Assign):
            bound = [(target, item.value) for target in item.targets]
        elif isinstance(item, ast.With | ast.AsyncWith):
            bound = [(each.optional_vars, each.context_expr) for each in item.items]
        for target, value in bound:
            if target is not None and any(source.dotted(part).startswith(_SCRATCH) for part in walk(value)):
                found |= {name.id for name in walk(target) if isinstance(name, ast.Name)}
    return frozenset(found)
