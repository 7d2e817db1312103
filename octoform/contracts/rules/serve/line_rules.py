"""The rule for SERVE about lines that no one knows: a tool that reads sends a constant question down them, or nothing.

A raw line carries bytes and no meaning. With neither a profile nor the owner's answer no one can distinguish a question
from a movement by its bytes, so what a caller gives never reaches the line, and no library that sets something does.
"""

import ast
import re
from collections.abc import Iterator

from octoform.base.escaping import display
from octoform.contracts.device_kinds import RAW
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.movement_words import commands_something, spoken
from octoform.contracts.rules.raw_line_rules import cure, unknown_lines
from octoform.contracts.rules.serve.tool_rules import ToolSite, served_tools, tool_functions, tool_sites
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

CODE = "SERVE-LINE-WRITTEN"
_SENDS = regex(r"write|writelines|send|sendall|sendto|query|ask|request|print|xfer[23]?|writebytes2?|query_\w+")
"""Methods that send what they are given: a constant question may go through them."""
_SETS = regex(
    r"\w*[wW]rite\w*|set(?:[A-Z_]\w*)?|(?:en|dis)able\w*|torque\w*|\w+_torque|goal\w*|goto\w*|go_?to\w*|go_home|move\w*"
    r"|home|homing|jog\w*|rotate\w*|turn_?\w*|drive\w*|send_\w+|transmit\w*|tx\w+|pose|release\w*|relax\w*|calibrate\w*"
    r"|configure\w*|actuate\w*|step_?(?:to|by)?|action|reboot\w*|factory_?reset\w*|reset|i2c_rdwr|ioctl|ctrl_transfer|transfer"
    r"|exchange|command|execute|apply\w*|sendBreak|send_break|tcsendbreak|(?:grip|open_grip|close_grip)\w*"
)
"""Methods of libraries that set or move something, whatever they are given."""
_PORT_ITSELF = regex(
    r"set_?(?:baud_?rate|timeout|blocking|packet_?timeout\w*|default|low_latency\w*|exclusive)|setdefault|set",
    re.IGNORECASE,
)
"""Names for the settings of a port, and containers."""
_MOVED_MEMBERS = frozenset(
    {"angle", "position", "goal", "goal_position", "target", "value", "throttle", "speed", "velocity", "torque"}
    | {"torque_enable", "duty_cycle", "fraction", "dtr", "rts", "break_condition", "state", "output", "goal_velocity"}
)
_HIDING = frozenset({"getattr", "setattr", "vars", "globals", "locals", "operator.methodcaller", "operator.attrgetter"})
_HANDING_ON = frozenset({"copyfileobj", "methodcaller", "attrgetter"})
"""Functions that send by way of another one, under whatever module's name."""
_NO_DEVICES = frozenset(
    {"os", "time", "re", "json", "math", "struct", "datetime", "threading", "logging", "contextlib"}
)
_LISTENING = frozenset(
    {"time", "re", "json", "math", "struct", "datetime", "dataclasses", "typing", "collections", "itertools", "enum"}
    | {"statistics", "string", "decimal", "contextlib", "pathlib", "select", "termios", "binascii", "codecs", "os"}
    | {"fastmcp", "pydantic", "mcp", "runtime", "operator", "functools", "__future__", "logging", "zoneinfo"}
)
"""Modules by which nothing but a node that is opened to be read is reached."""
_OS = regex(r"os\.(?:open|read|readv|close|isatty|fstat|set_blocking|O_\w+|path(?:\.\w+)?|fdopen|strerror|SEEK_\w+)")
_RUNTIME = regex(
    r"runtime\.(?:device|bus|logged|files|read_\w+|free_bytes|nmea(?:\.\w+)?|quantities(?:\.\w+)?|[A-Z]\w*)(?:\(\)\S*)?"
)
_FINDING = frozenset({"serial", "usb", "hid", "smbus", "smbus2", "spidev", "pyvisa", "libusb1", "usb1", "periphery"})
_READ_FLAGS = frozenset({"O_RDONLY", "O_NOCTTY", "O_NONBLOCK", "O_CLOEXEC", "O_NDELAY"})
_ELSEWHERE = frozenset({"os", "sys", "io", "builtins", "posix", "subprocess", "shutil", "fcntl", "socket", "modules"})


def line_written(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool of effect ``read`` on a line without knowledge sends at most what is in the file as a question."""
    source, lines = needed_source(value), unknown_lines(artifacts)
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts) if lines else ():
        devices = sorted(lines.intersection(tool["devices"]))
        if tool["effect"] != "read" or not devices:
            continue
        for node, what in _writing(source, _reached(source, site)):
            summary = f"{what}, and no one knows what {display(devices[0])} does with it"
            hint = f"in a tool that reads send a constant question, or listen; {cure(devices[0], artifacts)}"
            out.setdefault(node, source.problem(CODE, node, summary, hint))
    return list(out.values())


RULES = (Rule(CODE, line_written),)


def listening(value: str) -> frozenset[str]:
    """The tools of a server of which the text shows that they open their devices to be read, and nothing else.

    What is no plain reading counts as writing: a library that opens the line itself may do with it what it likes.
    """
    source = needed_source(value)
    return frozenset(
        site.name
        for site in tool_sites(source)
        if site.name is not None
        and tool_functions(source, site)
        and all(_listens(source, node) for part in _reached(source, site) for node in walk(part))
    )


def on_a_line(value: str) -> frozenset[str]:
    """The tools of a server whose code names a class of raw lines, or a library that finds such lines by itself."""
    source = needed_source(value)
    found = set()
    for site in tool_sites(source):
        for node in (item for part in _reached(source, site) for item in walk(part)):
            name = source.names.get(node.id, "").partition(".")[0] if isinstance(node, ast.Name) else ""
            if (isinstance(node, ast.Constant) and node.value in RAW) or name in _FINDING:
                found.add(site.name or "")
    return frozenset(found)


def _reached(source: Source, site: ToolSite) -> list[ast.AST]:
    """The code that a call of the tool can enter: functions and classes of the file, and the values of its names."""
    bound: dict[str, list[ast.AST]] = {}
    for statement in source.tree.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            for target in (each for one in targets for each in walk(one)):
                if isinstance(target, ast.Name):
                    bound.setdefault(target.id, []).append(statement)
    for node in source.nodes:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            bound.setdefault(node.name, []).append(node)
    servers = {"mcp"}
    found: list[ast.AST] = []
    queue: list[ast.AST] = list(tool_functions(source, site))
    while queue:
        part = queue.pop()
        if part in found:
            continue
        found.append(part)
        for item in walk(part):
            name = item.id if isinstance(item, ast.Name) else item.attr if isinstance(item, ast.Attribute) else ""
            queue += [] if name in servers else bound.get(name, [])
    return found


def _writing(source: Source, parts: list[ast.AST]) -> Iterator[tuple[ast.AST, str]]:
    """(node, what is wrong) of each place that may send more than a constant question."""
    used = [part for part in parts if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef)]
    for node in (item for part in parts for item in walk(part)):
        name = source.dotted(node) if isinstance(node, ast.Name | ast.Attribute) else ""
        if name in _HIDING or name.rpartition(".")[2] in _HANDING_ON:
            yield node, f"{name} hides what is called"
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            if node.attr in _MOVED_MEMBERS and not _is_self(node.value):
                yield node, f"{display(node.attr)} of something is set"
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            yield from _sending(source, node, name, used)
        elif isinstance(node, ast.Call) and source.dotted(node.func) == "print":
            for item in node.keywords:
                if item.arg == "file" and any(not _question(source, each, used) for each in node.args):
                    yield node, "print sends what is no constant question"


def _sending(source: Source, node: ast.Attribute, name: str, used: list[Function]) -> Iterator[tuple[ast.AST, str]]:
    above = source.parents.get(node)
    call = above if isinstance(above, ast.Call) and above.func is node else None
    method, root = node.attr, name.partition(".")[0]
    if name in ("os.write", "os.writev", "os.pwrite", "fcntl.ioctl", "os.sendfile"):
        given = call.args[1:2] if call is not None else []
        if name == "fcntl.ioctl" or not given or not all(_question(source, item, used) for item in given):
            yield node, f"{name} sends what is no constant question"
        return
    if (
        root in _NO_DEVICES
        or name.startswith(("runtime.", "fastmcp."))
        or _is_self(node.value)
        or _is_own(source, node)
    ):
        return
    if _SENDS.fullmatch(method):
        given = [item for item in call.args] + [item.value for item in call.keywords] if call is not None else []
        if call is None or not given or not all(_question(source, item, used) for item in given):
            yield node, f"{display(method)} sends what is no constant question"
    elif _SETS.fullmatch(method) and not _PORT_ITSELF.fullmatch(method):
        yield node, f"{display(method)} sets or moves something"


def _is_self(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id in ("self", "cls")


def _is_own(source: Source, node: ast.Attribute) -> bool:
    """Whether a method is one of the file's own classes, whose body is judged by itself."""
    methods = {item.name for item in source.functions if isinstance(source.parents.get(item), ast.ClassDef)}
    return node.attr in methods


def _question(source: Source, node: ast.expr, used: list[Function], seen: frozenset[ast.AST] = frozenset()) -> bool:
    """Whether an expression gives nothing but texts that are in the file, none of which orders something."""
    if isinstance(node, ast.Constant):
        return _is_question(node.value)
    if node in seen or len(seen) > 40:
        return False
    seen |= {node}
    if isinstance(node, ast.Name):
        bound = _bindings(source, node, used)
        return bool(bound) and all(_question(source, item, used, seen) for item in bound)
    parts = _parts(node)
    return bool(parts) and all(_question(source, item, used, seen) for item in parts)


def _parts(node: ast.expr) -> list[ast.expr]:
    """The parts or alternatives of an expression; [] where that cannot be determined."""
    if isinstance(node, ast.IfExp):
        return [node.body, node.orelse]
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return [node.left, node.right]
    if isinstance(node, ast.List | ast.Tuple):
        return node.elts
    if isinstance(node, ast.Dict):
        return node.values
    if isinstance(node, ast.Subscript) and not isinstance(node.value, ast.Constant):  # a choice
        return [node.value]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        return [node.func.value] if node.func.attr in ("encode", "get", "values", "items", "strip") else []
    if isinstance(node, ast.JoinedStr):
        return [item.value if isinstance(item, ast.FormattedValue) else item for item in node.values]
    return []


def _is_question(value: object) -> bool:
    """A printable text that orders nothing; what is binary is known by no one."""
    text = value.decode("latin-1") if isinstance(value, bytes) else value
    if not isinstance(text, str):
        return False
    plain = text.strip("\r\n\0\x03\x04")
    return all(" " <= sign <= "~" for sign in plain) and not commands_something(plain) and len(spoken(plain)) < 12


def _bindings(source: Source, name: ast.Name, used: list[Function]) -> list[ast.expr]:
    """The values of a name: assignments, loops, and for a parameter what its callers here give; [] if unknown."""
    owner, found = source.owner(name), []
    scopes: list[ast.AST] = [owner] if owner is not None else []
    while scopes and (outer := source.owner(scopes[-1])) is not None:
        scopes.append(outer)
    for scope in (*scopes, source.tree):
        if isinstance(scope, ast.FunctionDef | ast.AsyncFunctionDef):
            names = [item.arg for item in (*scope.args.posonlyargs, *scope.args.args, *scope.args.kwonlyargs)]
            if name.id in names:
                return _given(source, scope, names.index(name.id), name.id, used)
        inside = scope.body if isinstance(scope, ast.Module) else [scope]
        for item in (each for part in inside for each in ([part] if isinstance(scope, ast.Module) else walk(part))):
            found += list(_bound_by(item, name.id))
        if found:
            return found
    return []


def _bound_by(item: ast.AST, name: str) -> Iterator[ast.expr]:
    if isinstance(item, ast.Assign):
        pairs = [(target, item.value) for target in item.targets]
    elif isinstance(item, ast.AnnAssign | ast.AugAssign | ast.NamedExpr) and item.value is not None:
        pairs = [(item.target, item.value)]
    elif isinstance(item, ast.For | ast.AsyncFor | ast.comprehension):
        pairs = [(item.target, item.iter)]
    else:
        return
    for target, value in pairs:
        if any(isinstance(part, ast.Name) and part.id == name for part in walk(target)):
            yield value


def _given(source: Source, function: Function, at: int, name: str, used: list[Function]) -> list[ast.expr]:
    """The arguments for a parameter in the used functions; [] where one of them cannot be determined."""
    if function.decorator_list and not any("contextmanager" in source.dotted(item) for item in function.decorator_list):
        return []  # a tool: its callers are outside
    method = isinstance(source.parents.get(function), ast.ClassDef)
    out = []
    for call, called in source.calls:
        if called.rpartition(".")[2] != function.name or source.owner(call) not in used:
            continue
        keywords = [item.value for item in call.keywords if item.arg == name]
        place = at - method if isinstance(call.func, ast.Attribute) else at
        if any(isinstance(item, ast.Starred) for item in call.args) or any(item.arg is None for item in call.keywords):
            return []
        out += keywords or call.args[place : place + 1]
    return out + _default(function, at)


def _default(function: Function, at: int) -> list[ast.expr]:
    given = [*function.args.posonlyargs, *function.args.args]
    first = len(given) - len(function.args.defaults)
    return [function.args.defaults[at - first]] if first <= at < len(given) else []


def _listens(source: Source, node: ast.AST) -> bool:
    if isinstance(node, ast.Import):
        return all(item.name.partition(".")[0] in _LISTENING for item in node.names)
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").partition(".")[0] in _LISTENING
    if isinstance(node, ast.Name):
        return _name_listens(source, node)
    if isinstance(node, ast.Attribute):
        return _attribute_listens(source, node)
    return True


def _name_listens(source: Source, node: ast.Name) -> bool:
    name = source.names.get(node.id, node.id)
    if name in _HIDING or name in ("eval", "exec", "compile", "__import__") or name.startswith("__"):
        return False
    if name == "open":
        call = source.parents.get(node)
        return isinstance(call, ast.Call) and call.func is node and _opens_to_read(call, call.args[1:2])
    if node.id not in source.names:
        return True
    above = source.parents.get(node)
    return isinstance(above, ast.Attribute) or _dotted_listens(name)


def _attribute_listens(source: Source, node: ast.Attribute) -> bool:
    name, above = source.dotted(node), source.parents.get(node)
    call = above if isinstance(above, ast.Call) and above.func is node else None
    if node.attr.startswith("__") or node.attr.startswith(("write", "touch", "unlink", "send", "methodcaller")):
        return False
    if name == "os.open":
        flags = [item for arg in call.args[1:2] for item in walk(arg)] if call is not None else []
        named = {item.attr for item in flags if isinstance(item, ast.Attribute)}
        plain = all(isinstance(item, ast.Attribute | ast.Name | ast.BinOp | ast.BitOr) for item in flags)
        return (
            bool(named)
            and plain
            and named <= _READ_FLAGS
            and {"os"} >= {i.id for i in flags if isinstance(i, ast.Name)}
        )
    if name in ("os.fdopen", "io.open"):
        return call is not None and _opens_to_read(call, call.args[1:2])
    if node.attr == "open":
        return call is not None and _opens_to_read(call, call.args[:1])
    root = name.partition(".")[0]
    if "(" in name or "[" in name:
        return True  # of a result; what gave it is judged by itself
    if root not in {each.partition(".")[0] for each in source.names.values()} or isinstance(above, ast.Attribute):
        return True
    return _dotted_listens(name)


def _dotted_listens(name: str) -> bool:
    root, _, rest = name.partition(".")
    if root == "os":
        return _OS.fullmatch(name) is not None
    if root == "runtime":
        return not rest or _RUNTIME.fullmatch(name) is not None
    return root in _LISTENING and not _ELSEWHERE.intersection(rest.split(".")) and "partial" not in rest


def _opens_to_read(call: ast.Call, positional: list[ast.expr]) -> bool:
    given = [item.value for item in call.keywords if item.arg == "mode"] or positional
    if any(item.arg in (None, "opener") for item in call.keywords) or any(
        isinstance(i, ast.Starred) for i in call.args
    ):
        return False
    return all(isinstance(item, ast.Constant) and item.value in ("r", "rb", "rt") for item in given)
