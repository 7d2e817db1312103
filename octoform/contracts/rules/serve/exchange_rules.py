"""Rules for SERVE about one exchange with a device: whole under one lock, at a named speed, a picture of now.

A request and its answer under two locks let another tool's answer in between; a line opened at no named speed answers
with noise, or not; the first pictures of a camera show what its exposure was before. None of it fails in a quick test.
"""

import ast
import re
from collections.abc import Iterator

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.rules.serve.device_rules import lock_regions
from octoform.contracts.rules.serve.tool_rules import tool_functions, tool_sites
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic, as_warning
from octoform.patterns import regex

# How many pictures a generated server takes of a camera that it has opened, up to the one that it keeps.

GRABS = frozenset({"read", "grab"})
MANY = 1000
"""Where it cannot be determined how often a loop runs."""
_DEPTH = 4


def pictures(source: Source, opener: Function) -> int:
    """The number for a function that opens a camera, with what it calls or what calls it; 0 where none is seen."""
    own = _taken(source, opener, _DEPTH)
    if own:
        return own
    callers = {source.owner(call) for call, name in source.calls if name == opener.name}
    counts = [_taken(source, item, _DEPTH) for item in callers if item is not None and item is not opener]
    return min((count for count in counts if count), default=0)


def _taken(source: Source, function: Function, depth: int) -> int:
    """How many pictures one call of a function takes, up to the last one that it uses."""
    taken = kept = 0
    for call in sorted(_calls(source, function), key=lambda item: (item.lineno, item.col_offset)):
        method = call.func.attr if isinstance(call.func, ast.Attribute) else ""
        taken += _of_call(source, call, depth) * _times(source, call, function)
        if (method == "retrieve" or _of_call(source, call, depth)) and not _is_dropped(source, call):
            kept = taken
    return min(kept or taken, MANY)


def _calls(source: Source, function: Function) -> Iterator[ast.Call]:
    return (item for item in walk(function) if isinstance(item, ast.Call) and source.owner(item) is function)


def _of_call(source: Source, call: ast.Call, depth: int) -> int:
    if isinstance(call.func, ast.Attribute) and call.func.attr in GRABS:
        return 1
    own = [item for item in source.functions if item.name == source.dotted(call.func).rpartition(".")[2]]
    return _taken(source, own[0], depth - 1) if depth and len(own) == 1 else 0


def _is_dropped(source: Source, call: ast.Call) -> bool:
    return isinstance(source.parents.get(call), ast.Expr)


def _times(source: Source, node: ast.AST, function: Function) -> int:
    """How often a function runs one of its nodes, by the loops around it."""
    times = 1
    for above, below in source.above(node):
        if above is function:
            break
        if isinstance(above, ast.For | ast.AsyncFor) and below is not above.iter:
            times *= _length(source, above.iter, node)
        elif isinstance(above, ast.ListComp | ast.GeneratorExp | ast.SetComp | ast.DictComp):
            for each in above.generators:
                times *= _length(source, each.iter, node)
        elif isinstance(above, ast.While):
            times *= MANY
    return min(times, MANY)


def _length(source: Source, node: ast.expr, use: ast.AST) -> int:
    if isinstance(node, ast.List | ast.Tuple):
        return len(node.elts)
    if isinstance(node, ast.Call) and source.dotted(node.func) == "range" and len(node.args) == 1:
        count = _number(source, node.args[0], use)
        return MANY if count is None else max(count, 0)
    return MANY


def _number(source: Source, node: ast.expr, use: ast.AST) -> int | None:
    """An integer that is written here, or that the one assignment to a name of the file gives it."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, int) else None
    if not isinstance(node, ast.Name):
        return None
    stored = [
        item
        for item in source.nodes
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store) and item.id == node.id
    ]
    owner = source.owner(use)
    given = owner.args if owner is not None else None
    taken = [*given.posonlyargs, *given.args, *given.kwonlyargs] if given is not None else []
    above = source.parents.get(stored[0]) if len(stored) == 1 else None
    if any(item.arg == node.id for item in taken) or not isinstance(above, ast.Assign | ast.AnnAssign):
        return None
    return _number(source, above.value, use) if isinstance(above.value, ast.Constant) else None


_LINES = frozenset({"Serial", "serial_for_url", "RS485", "open_serial_connection", "create_serial_connection"})
_OPENED = frozenset({"Serial", "serial_for_url", "RS485"})
_MEASURED = frozenset({"time.monotonic", "time.time", "time.perf_counter", "time.monotonic_ns", "datetime.now"})
_ASKS = frozenset({"write", "writelines", "sendall", "send", "send_feature_report"})
_HEARS = frozenset({"read", "readline", "readlines", "read_until", "readexactly", "read_all", "readinto", "recv"})
_SETTLED = 3
"""The first picture that may count: one that is thrown away is no flush."""
_UNPACKED = regex(r"(?:bytes|bytearray)\.fromhex|binascii\.(?:unhexlify|a2b_\w+)|base64\.\w*decode\w*|codecs\.decode")
_SPEED = regex(r"\b(\d{3,7})[ -]?(?:baud|bd|bit/s|bps)\b", re.IGNORECASE)


def exchange_split(value: str, _: Artifacts) -> list[Diagnostic]:
    """Request and answer of one exchange on a line are under one lock."""
    source = needed_source(value)
    hint = "put the write and the read of its answer inside one `with runtime.bus(device):`"
    out: dict[ast.AST, Diagnostic] = {}
    for site in tool_sites(source):
        used = source.entered_from(tool_functions(source, site))
        if not any(opens_line(source, function) for function in used):
            continue
        talks = [(block, _talk(source, block)) for block in lock_regions(source) if source.owner(block) in used]
        asking = [block for block, talk in talks if talk == {"asks"}]
        hearing = [block for block, talk in talks if talk == {"hears"}]
        if asking and hearing:
            summary = f"the tool {display(site.name or '')} writes under one lock and reads the answer under another"
            out.setdefault(hearing[0], source.problem("SERVE-EXCHANGE-SPLIT", hearing[0], summary, hint))
    return list(out.values())


def camera_not_flushed(value: str, _: Artifacts) -> list[Diagnostic]:
    """The first pictures of a camera that was just opened are thrown away."""
    source = needed_source(value)
    hint = "throw several pictures away before the one that counts: for _ in range(5): camera.grab()"
    out = []
    for call, name in source.calls:
        owner = source.owner(call)
        if name.rpartition(".")[2] != "VideoCapture" or owner is None:
            continue
        taken = pictures(source, owner)
        if 0 < taken < _SETTLED:
            which = "first" if taken == 1 else "second"
            summary = f"the very {which} picture is returned, taken while the camera's exposure was settling"
            out.append(source.problem("SERVE-CAMERA-NOT-FLUSHED", call, summary, hint))
    return out


def camera_in_server(value: str, _: Artifacts) -> list[Diagnostic]:
    """A camera is opened in a process that ends: what its library took of the memory is free again."""
    source = needed_source(value)
    opened = [call for call, name in source.calls if name.rpartition(".")[2] == "VideoCapture"]
    own = source.called_by_name
    first = [call.args[0] for call, name in source.calls if name.endswith("child.call") and call.args]
    apart = source.entered_from(own[each.id] for each in first if isinstance(each, ast.Name) and each.id in own)
    here: list[ast.AST] = [call for call in opened if source.owner(call) not in apart]
    here += [item for item in source.tree.body if opened and _imports(item, "cv2")]
    summary = "the camera's library is loaded into the server, which then keeps some 40 MB of memory"
    hint = "import it and open the camera in a function that runtime.child.call runs: child.call(picture, node)"
    return [as_warning(source.problem("SERVE-CAMERA-IN-SERVER", node, summary, hint)) for node in here[:1]]


def _imports(statement: ast.stmt, module: str) -> bool:
    if isinstance(statement, ast.ImportFrom):
        return (statement.module or "").partition(".")[0] == module
    return isinstance(statement, ast.Import) and any(each.name.partition(".")[0] == module for each in statement.names)


def line_speed(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A serial line is opened at a speed that is written down, and at the one that INTERFACE names."""
    source = needed_source(value)
    tools = (artifacts.interface or {"tools": []})["tools"]
    named = {int(speed) for tool in tools for speed in _SPEED.findall(tool["description"])}
    out = []
    for call, name in source.calls:
        if name.rpartition(".")[2] not in _LINES:
            continue
        speed = _speed(call)
        if speed is None and not _set_later(source, call):
            summary = f"{display(name)} is given no speed, so the line is opened at whatever the library takes"
            hint = "name the speed: baudrate=115200, as INTERFACE or the profile gives it"
        elif isinstance(speed, ast.Constant) and named and speed.value not in named:
            summary = f"{display(name)} opens the line at {speed.value!r} baud, which no tool of INTERFACE names"
            hint = f"use the speed that INTERFACE names: {', '.join(map(str, sorted(named)))}"
        else:
            continue
        out.append(source.problem("SERVE-LINE-SPEED", call, summary, hint))
    return out


def frame_by_hand(value: str, _: Artifacts) -> list[Diagnostic]:
    """Data for a serial line must be text, or come from the library that knows the frames."""
    source = needed_source(value)
    if not any(opens_line(source, function) for function in source.functions):
        return []
    hint = "use the protocol's library; for a profile with registers runtime.registers, with lines runtime.lines"
    return [
        source.problem("SERVE-FRAME-BY-HAND", call, "a frame that this file puts together is written to a line", hint)
        for function in source.functions
        for call in _calls_of(function, _ASKS)
        if source.owner(call) is function and any(_is_frame(source, item, function, 0) for item in call.args)
    ]


def line_wait(value: str, _: Artifacts) -> list[Diagnostic]:
    """No read of a serial line waits permanently, and no loop over one goes on while the device is silent."""
    source = needed_source(value)
    out = []
    for call, name in source.calls:
        if name.rpartition(".")[2] in _OPENED and not _has_limit(source, call):
            summary = f"{display(name)} is given no time limit, so a read of a silent device never ends"
            out.append(source.problem("SERVE-LINE-WAIT", call, summary, "pass timeout=1, or what the device needs"))
    hint = "leave it after a time (time.monotonic) or a number of turns, with an error, or where a read came back empty"
    for loop in source.nodes:
        owner = source.owner(loop) if isinstance(loop, ast.While) else None
        if (
            isinstance(loop, ast.While)
            and owner is not None
            and opens_line(source, owner)
            and _is_endless(source, loop)
        ):
            summary = "a loop over what a line sends never ends where the device sends nothing"
            out.append(source.problem("SERVE-LINE-WAIT", loop, summary, hint))
    return out


def _has_limit(source: Source, call: ast.Call) -> bool:
    """Whether a line is opened with a time limit, or is waited for in another way in the same function."""
    given = [item.value for item in call.keywords if item.arg in ("timeout", None)] + call.args[5:6]
    if given or any(isinstance(item, ast.Starred) for item in call.args):
        return not given or not all(isinstance(item, ast.Constant) and item.value is None for item in given)
    scope = source.owner(call) or source.tree
    waits = {"timeout", "in_waiting", "inWaiting", "select", "wait_for", "read_all"}
    named = {item.attr for item in walk(scope) if isinstance(item, ast.Attribute)}
    reads = any(True for _ in _calls_of(scope, _HEARS)) or isinstance(scope, ast.Module)
    return not reads or bool(waits & named)


def _is_endless(source: Source, loop: ast.While) -> bool:
    """Whether nothing but the words of a device ends a loop that reads them."""
    inside = [item for part in (loop.test, *loop.body) for item in walk(part)]
    if not any(True for _ in _calls_of(loop, _HEARS)) or any(isinstance(item, ast.Yield) for item in inside):
        return False
    counted = {name for item in inside if isinstance(item, ast.AugAssign) and _is_step(item) for name in _stored(item)}
    tests = [loop.test, *(item.test for item in inside if isinstance(item, ast.If) and _leaves(item))]
    return not any(_bounds(source, test, counted) for test in tests)


def _is_step(node: ast.AugAssign) -> bool:
    return isinstance(node.value, ast.Constant) and isinstance(node.value.value, int)


def _leaves(node: ast.If) -> bool:
    return any(isinstance(item, ast.Break | ast.Return | ast.Raise) for part in node.body for item in walk(part))


def _bounds(source: Source, test: ast.expr, counted: set[str]) -> bool:
    """Whether a test comes true some time whatever a device reports: by the clock, a count, or that nothing came."""
    if isinstance(test, ast.Name | ast.NamedExpr):
        return True
    for item in walk(test):
        if isinstance(item, ast.Call) and source.dotted(item.func) in _MEASURED | {"len"}:
            return True
        if isinstance(item, ast.Name) and (item.id in counted or item.id.rpartition("_")[2] in ("left", "remaining")):
            return True
        if isinstance(item, ast.UnaryOp) and isinstance(item.op, ast.Not) and not isinstance(item.operand, ast.Call):
            return True
        if isinstance(item, ast.Compare) and any(_is_nothing(each) for each in item.comparators):
            return True
    return False


def _is_nothing(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value in (None, b"", "")


RULES = (
    Rule("SERVE-LINE-WAIT", line_wait),
    Rule("SERVE-EXCHANGE-SPLIT", exchange_split),
    Rule("SERVE-CAMERA-NOT-FLUSHED", camera_not_flushed),
    Rule("SERVE-CAMERA-IN-SERVER", camera_in_server),
    Rule("SERVE-LINE-SPEED", line_speed),
    Rule("SERVE-FRAME-BY-HAND", frame_by_hand),
)


def _calls_of(tree: ast.AST, methods: frozenset[str]) -> Iterator[ast.Call]:
    for item in walk(tree):
        if isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute) and item.func.attr in methods:
            yield item


def opens_line(source: Source, function: Function) -> bool:
    """Whether a function opens a serial line, or asks for the node of one."""
    calls = [item for item in walk(function) if isinstance(item, ast.Call)]
    if any(source.dotted(call.func).rpartition(".")[2] in _LINES for call in calls):
        return True
    nodes = [call for call in calls if isinstance(call.func, ast.Attribute) and call.func.attr in ("node", "nodes")]
    return any(isinstance(item, ast.Constant) and item.value == "tty" for call in nodes for item in call.args[:1])


def _talk(source: Source, block: ast.AST) -> set[str]:
    """Whether a block writes to something and reads from something, itself or in what it calls."""
    named = {source.dotted(item.func) for item in walk(block) if isinstance(item, ast.Call)}
    entered = source.entered_from(item for item in source.functions if item.name in named)
    places = [block, *entered]
    asks = any(True for place in places for _ in _calls_of(place, _ASKS))
    hears = any(True for place in places for _ in _calls_of(place, _HEARS))
    return {word for word, found in (("asks", asks), ("hears", hears)) if found}


def _speed(call: ast.Call) -> ast.expr | None:
    for item in call.keywords:
        if item.arg in ("baudrate", None):
            return item.value
    starred = any(isinstance(item, ast.Starred) for item in call.args)
    return call.args[1] if len(call.args) > 1 else call.args[0] if starred else None


def _set_later(source: Source, call: ast.Call) -> bool:
    """Whether the function that opens the line sets its speed as an attribute."""
    scope = source.owner(call) or source.tree
    return any(
        isinstance(item, ast.Attribute) and isinstance(item.ctx, ast.Store) and item.attr == "baudrate"
        for item in walk(scope)
    )


def _is_frame(source: Source, node: ast.expr, scope: Function, depth: int) -> bool:
    """Whether an expression is bytes that are no text, made in this file."""
    if depth > 4:
        return False
    if isinstance(node, ast.Constant):
        return isinstance(node.value, bytes) and any(byte > 126 or byte < 9 for byte in node.value)
    if isinstance(node, ast.BinOp):
        return _is_frame(source, node.left, scope, depth + 1) or _is_frame(source, node.right, scope, depth + 1)
    if isinstance(node, ast.Name):
        return _is_bound_to_frame(source, node.id, scope, depth)
    if not isinstance(node, ast.Call):
        return False
    name = source.dotted(node.func)
    if name in ("bytes", "bytearray"):
        given = node.args[0] if len(node.args) == 1 else None
        return given is not None and (_is_list(given, scope, depth) or _is_frame(source, given, scope, depth + 1))
    method = node.func.attr if isinstance(node.func, ast.Attribute) else ""
    if method == "join" and len(node.args) == 1 and isinstance(node.args[0], ast.List | ast.Tuple):
        return any(_is_frame(source, item, scope, depth + 1) for item in node.args[0].elts)
    if method == "encode" and isinstance(node.func, ast.Attribute):
        parts = list(walk(node.func.value))
        signs = (item.value for item in parts if isinstance(item, ast.Constant) and isinstance(item.value, str))
        drawn = any(isinstance(item, ast.Call) and source.dotted(item.func) == "chr" for item in parts)
        return drawn or any(ord(sign) > 126 or ord(sign) < 9 for text in signs for sign in text)
    if name.startswith("struct.pack") or name.endswith(".to_bytes") or _UNPACKED.fullmatch(name):
        return True
    made = [item for item in source.functions if item.name == name]
    returned = [(item, each) for item in made for each in walk(item) if isinstance(each, ast.Return) and each.value]
    return any(_is_frame(source, each.value, item, depth + 1) for item, each in returned if each.value is not None)


def _is_bound_to_frame(source: Source, name: str, scope: Function, depth: int) -> bool:
    """Whether a name of a function stands for a frame, at once or number by number."""
    filled = (item for item in _calls_of(scope, frozenset({"append", "extend"})) if _last_name(item) == name)
    if any(isinstance(part, ast.Constant) and type(part.value) is int for item in filled for part in item.args):
        return True
    bound = [item for item in walk(scope) if isinstance(item, ast.Assign | ast.AugAssign)]
    return any(name in _stored(item) and _is_frame(source, item.value, scope, depth + 1) for item in bound)


def _is_list(node: ast.expr, scope: Function, depth: int) -> bool:
    """Whether an expression is a list of numbers."""
    if isinstance(node, ast.List | ast.Tuple | ast.ListComp | ast.GeneratorExp):
        return True
    if isinstance(node, ast.BinOp) and depth < 5:
        return _is_list(node.left, scope, depth + 1) or _is_list(node.right, scope, depth + 1)
    if isinstance(node, ast.Name) and depth < 5:
        bound = [item for item in walk(scope) if isinstance(item, ast.Assign | ast.AugAssign)]
        return any(node.id in _stored(item) and _is_list(item.value, scope, depth + 1) for item in bound)
    return False


def _last_name(call: ast.Call) -> str:
    value = call.func.value if isinstance(call.func, ast.Attribute) else None
    return value.id if isinstance(value, ast.Name) else ""


def _stored(statement: ast.Assign | ast.AugAssign) -> set[str]:
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    return {item.id for target in targets for item in walk(target) if isinstance(item, ast.Name)}
