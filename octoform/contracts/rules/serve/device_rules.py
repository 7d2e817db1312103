"""Rules for SERVE about devices: not at import, one lock for each bus, a camera open only as long as one call.

A device that is opened at import is held for as long as any client lives; two tools that talk on one bus at once
hear each other's answers; a camera kept open shows yesterday's picture. All three were seen in generated servers.
"""

import ast
from collections.abc import Iterable, Iterator
from functools import lru_cache

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.server_code.server_source import Function, Source, children, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

# Constructors and functions of device libraries, by the last part of their name.
_OPENERS = frozenset(
    {"VideoCapture", "VideoWriter", "Serial", "serial_for_url", "RS485", "SMBus", "SpiDev", "InputDevice", "UInput"}
    | {"PyAudio", "PCM", "InputStream", "OutputStream", "RawInputStream", "RawOutputStream", "SerialPort"}
    | {"PortHandler"}
    | {"open_serial_connection", "create_serial_connection", "request_lines", "Picamera2", "PiCamera", "ioctl"}
)
_DOTTED_OPENERS = frozenset(
    {"usb.core.find", "hid.device", "hid.Device", "gpiod.Chip", "gpiod.chip", "can.Bus", "can.interface.Bus"}
    | {"sounddevice.rec", "sounddevice.play", "sounddevice.playrec", "os.open", "periphery.I2C", "periphery.SPI"}
    | {"periphery.GPIO", "periphery.Serial", "serial.tools.miniterm.main"}
)
# The runtime's calls that take a device: the same as opening its node here.
RUNTIME_TOUCHES = frozenset(
    {f"runtime.gpio.{name}" for name in ("chips", "chip", "lines", "read", "drive", "hold")}
    | {f"runtime.evdev.{name}" for name in ("axis", "events", "rumble")}
    | {"runtime.v4l2.formats", "runtime.v4l2.codes", "runtime.v4l2.control", "runtime.v4l2.set_control"}
    | {"runtime.nmea.sentences"}
)
_FILE_OPENERS = frozenset({"open", "io.open", "os.open"})
_FILE_METHODS = frozenset({"open", "read_text", "read_bytes", "write_text", "write_bytes"})
# Finding a device reads the system, and fails the whole import when the device is away.
_RUNTIME_READS = frozenset(f"runtime.{name}" for name in ("device", "files", "read_text", "read_bytes", "read_number"))
_PROGRAMS = regex(r"subprocess\.(?:run|Popen|call|check_call|check_output)")
_CONTAINERS = frozenset({"append", "add", "setdefault", "insert", "put", "push", "appendleft", "update"})
_CACHES = frozenset({"functools.cache", "functools.lru_cache", "functools.cached_property", "cache", "lru_cache"})


def device_at_import(value: str, _: Artifacts) -> list[Diagnostic]:
    """No code that runs at import opens a file, a device or a program, directly or through a function."""
    source = needed_source(value)
    hint = "find and open the device inside the tool that needs it"
    return [
        source.problem("SERVE-DEVICE-AT-IMPORT", call, f"{display(source.dotted(call.func))} runs at import", hint)
        for call in _run_at_import(source)
        if opens_anything(source, call)
    ]


def bus_unlocked(value: str, _: Artifacts) -> list[Diagnostic]:
    """A device is touched only inside ``with runtime.bus(...)``, here or in every caller."""
    source = needed_source(value)
    exposed = _exposed(source)
    hint = "put the whole exchange, request and answer, inside one `with runtime.bus(device):`"
    out = []
    for name, call in _bare_touches(source):
        if name in exposed:
            summary = f"{display(source.dotted(call.func))} reaches a device outside the lock of its bus"
            out.append(source.problem("SERVE-BUS-UNLOCKED", call, summary, hint))
    return out


def camera_held(value: str, _: Artifacts) -> list[Diagnostic]:
    """A camera is opened and released in the same call of the same function, whatever happens between."""
    source = needed_source(value)
    hint = "open it in the function that grabs, and call release() in a `finally`"
    out = []
    for call, name in source.calls:
        if name.rpartition(".")[2] != "VideoCapture":
            continue
        owner = source.owner(call)
        if owner is None:
            why = "a camera is opened outside any function"
        elif any(source.dotted(_called(item)) in _CACHES for item in owner.decorator_list):
            why = "a camera is opened in a function whose result is cached"
        elif _kept(source, call, owner):
            why = "a camera is kept beyond the call that opened it"
        elif not _released(source, call, owner):
            why = "a camera is opened and not released on every way out of the function"
        else:
            continue
        out.append(source.problem("SERVE-CAMERA-HELD", call, why, hint))
    return out


RULES = (
    Rule("SERVE-DEVICE-AT-IMPORT", device_at_import),
    Rule("SERVE-BUS-UNLOCKED", bus_unlocked),
    Rule("SERVE-CAMERA-HELD", camera_held),
)


def _called(node: ast.expr) -> ast.expr:
    return node.func if isinstance(node, ast.Call) else node


def opens_device(source: Source, call: ast.Call) -> bool:
    """Whether a call opens a device, or a node of one."""
    name = source.dotted(call.func)
    if name == "os.open" and call.args and _is_below(call.args[0]):
        return is_node_path(source, call.args[0], call)
    if name in _DOTTED_OPENERS | RUNTIME_TOUCHES or name.rpartition(".")[2] in _OPENERS:
        return True
    if name in _FILE_OPENERS:
        return any(is_node_path(source, item, call) for item in call.args[:1])
    if isinstance(call.func, ast.Attribute) and call.func.attr in _FILE_METHODS:
        return is_node_path(source, call.func.value, call)
    return False


def _is_below(path: ast.expr) -> bool:
    """``folder / "brightness"``: an attribute of the kernel, unless the folder is that of nodes."""
    named = isinstance(path, ast.BinOp) and isinstance(path.op, ast.Div) and isinstance(path.right, ast.Constant)
    return named or (isinstance(path, ast.Call) and bool(path.args) and _is_below(path.args[0]))


def opens_anything(source: Source, call: ast.Call) -> bool:
    """Whether a call opens a file, a device or a program, or looks for a device."""
    name = source.dotted(call.func)
    if name in _FILE_OPENERS | _RUNTIME_READS | {"os.open"} or _PROGRAMS.fullmatch(name) or opens_device(source, call):
        return True
    return isinstance(call.func, ast.Attribute) and call.func.attr in _FILE_METHODS and call.func.attr != "open"


def is_node_path(source: Source, path: ast.expr, call: ast.Call) -> bool:
    """True for an expression that names a device node: below /dev, from ``.node(...)``, or a variable of such."""
    if _mentions_node(source, path):
        return True
    names = {item.id for item in walk(path) if isinstance(item, ast.Name)}
    scope = source.owner(call)
    for statement in walk(scope) if scope is not None else ():
        for target, value in _bindings(statement):
            bound = {item.id for item in walk(target) if isinstance(item, ast.Name)}
            if names & bound and _mentions_node(source, value):
                return True
    return False


def _bindings(statement: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """(target, value) of each assignment that a statement makes, a loop over values too."""
    if isinstance(statement, ast.Assign):
        yield from ((target, statement.value) for target in statement.targets)
    elif isinstance(statement, ast.For | ast.AsyncFor | ast.comprehension):
        yield statement.target, statement.iter
    elif isinstance(statement, ast.NamedExpr):
        yield statement.target, statement.value


def _mentions_node(source: Source, tree: ast.AST) -> bool:
    for item in walk(tree):
        if isinstance(item, ast.Constant) and isinstance(item.value, str) and item.value.startswith("/dev/"):
            return True
        if isinstance(item, ast.Call) and source.dotted(item.func).endswith((".node", ".nodes")):
            return True
    return False


def _run_at_import(source: Source) -> Iterator[ast.Call]:
    """The calls that importing the module executes, in local functions too."""
    bodies = {function.name: function for function in source.functions}
    entered: set[str] = set()
    queue: list[ast.AST] = [item for item in source.tree.body if not _is_main_guard(item)]
    while queue:
        node = queue.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            queue += [*node.decorator_list, *node.args.defaults, *(item for item in node.args.kw_defaults if item)]
            queue += [item for item in node.decorator_list if isinstance(item, ast.Name)]
            continue
        if isinstance(node, ast.Lambda):
            queue += [*node.args.defaults, *(item for item in node.args.kw_defaults if item)]
            continue
        if isinstance(node, ast.Call):
            yield node
            name = node.func.id if isinstance(node.func, ast.Name) else ""
            if name in bodies and name not in entered:
                entered.add(name)
                queue += bodies[name].body
        queue += children(node)


def _is_main_guard(node: ast.stmt) -> bool:
    test = node.test if isinstance(node, ast.If) else None
    return isinstance(test, ast.Compare) and isinstance(test.left, ast.Name) and test.left.id == "__name__"


def _guarded(source: Source, node: ast.AST) -> bool:
    """True when a ``with`` of the same function that holds the lock of a bus encloses the node."""
    return _encloses(source, node, _locking_managers(source))


def _encloses(source: Source, node: ast.AST, managers: frozenset[str]) -> bool:
    for above, below in source.above(node):
        if isinstance(above, ast.With | ast.AsyncWith):
            before = above.items[: above.items.index(below)] if isinstance(below, ast.withitem) else above.items
            if any(_locks(source, item.context_expr, managers) for item in before):
                return True
    return False


def lock_regions(source: Source) -> list[ast.With | ast.AsyncWith]:
    """Every ``with`` that takes the lock of a bus."""
    managers = _locking_managers(source)
    blocks = (item for item in source.nodes if isinstance(item, ast.With | ast.AsyncWith))
    return [block for block in blocks if any(_locks(source, item.context_expr, managers) for item in block.items)]


def _locks(source: Source, expression: ast.expr, managers: frozenset[str]) -> bool:
    name = source.dotted(expression.func) if isinstance(expression, ast.Call) else ""
    return (name.startswith("runtime.") and name.endswith(".bus")) or name in managers


@lru_cache(maxsize=4)
def _locking_managers(source: Source) -> frozenset[str]:
    """The file's own context managers that yield only while they hold the lock of a bus."""
    found: frozenset[str] = frozenset()
    while True:
        more = {
            item.name for item in source.functions if _is_manager(source, item) and _yields_locked(source, item, found)
        }
        if more == found:
            return found
        found = frozenset(more)


def _is_manager(source: Source, function: Function) -> bool:
    names = (source.dotted(item) for item in function.decorator_list)
    return any(name in ("contextlib.contextmanager", "contextlib.asynccontextmanager") for name in names)


def _yields_locked(source: Source, function: Function, managers: frozenset[str]) -> bool:
    yields = [item for item in walk(function) if isinstance(item, ast.Yield) and source.owner(item) is function]
    return bool(yields) and all(_encloses(source, item, managers) for item in yields)


def _bare_touches(source: Source) -> Iterator[tuple[str, ast.Call]]:
    """(function name, call) of each device access without a lock around it in its own function."""
    for call, _ in source.calls:
        owner = source.owner(call)
        if owner is not None and opens_device(source, call) and not _guarded(source, call):
            yield owner.name, call


def _exposed(source: Source) -> set[str]:
    """The functions that can be entered without the lock of a bus: called bare from one such, or from outside."""
    known = {function.name for function in source.functions}
    entries: dict[str, list[tuple[str | None, bool]]] = {name: [] for name in known}
    for caller, name, locked in _references(source, known):
        entries[name].append((caller, locked))
    exposed = {function.name for function in source.functions if function.decorator_list and _is_root(source, function)}
    # A method may be entered by what calls it for the language; a function of the module that nothing names is dead.
    methods = {item.name for item in source.functions if not isinstance(source.parents.get(item), ast.Module)}
    exposed |= {name for name, callers in entries.items() if not callers and name in methods}
    while True:
        more = {
            name
            for name, callers in entries.items()
            if name not in exposed and any(not locked and (at is None or at in exposed) for at, locked in callers)
        }
        if not more:
            return exposed
        exposed |= more


def _is_root(source: Source, function: Function) -> bool:
    return any(source.dotted(_called(item)).rpartition(".")[2] == "tool" for item in function.decorator_list)


def _references(source: Source, known: Iterable[str]) -> Iterator[tuple[str | None, str, bool]]:
    """(function that refers, function referred to, whether under a lock); None for module level."""
    names = set(known)
    for node in source.nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            name = node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            name = node.attr
        else:
            continue
        if name in names:
            owner = source.owner(node)
            yield (owner.name if owner is not None else None), name, _guarded(source, node)


def _kept(source: Source, call: ast.Call, owner: Function) -> bool:
    """True when the camera goes into an attribute, a global or a container, at once or by its name."""
    shared = {name for item in walk(owner) if isinstance(item, ast.Global | ast.Nonlocal) for name in item.names}
    statement = source.parents.get(call)
    while statement is not None and not isinstance(statement, ast.stmt):
        if isinstance(statement, ast.Call) and _stores(statement):
            return True
        statement = source.parents.get(statement)
    if not isinstance(statement, ast.Assign | ast.AnnAssign):
        return False
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    if any(not isinstance(item, ast.Name) or item.id in shared for item in targets):
        return True
    names = {item.id for item in targets if isinstance(item, ast.Name)}
    return any(_hands_on(item, names, shared) for item in walk(owner))


def _stores(call: ast.Call) -> bool:
    return isinstance(call.func, ast.Attribute) and call.func.attr in _CONTAINERS


def _hands_on(node: ast.AST, names: set[str], shared: set[str]) -> bool:
    """Whether a statement puts what one of the names stands for into something that outlives the call."""
    if isinstance(node, ast.Call) and _stores(node):
        given = [*node.args, *(item.value for item in node.keywords)]
        return any(isinstance(item, ast.Name) and item.id in names for each in given for item in walk(each))
    if not isinstance(node, ast.Assign) or not isinstance(node.value, ast.Name) or node.value.id not in names:
        return False
    return any(not isinstance(item, ast.Name) or item.id in shared for item in node.targets)


def _released(source: Source, call: ast.Call, owner: Function) -> bool:
    """True when the camera is a ``with`` item, or a ``finally`` of the function releases a camera.

    A capture that is made of a device which a ``with`` around it closes (``with closing(Device(node)) as camera:``)
    ends with that device.
    """
    given = {item.id for item in call.args if isinstance(item, ast.Name)}
    for above, _ in source.above(call):
        if isinstance(above, ast.withitem):
            return True
        if isinstance(above, ast.With | ast.AsyncWith) and given & _bound(above):
            return True
    finals = [item for node in walk(owner) if isinstance(node, ast.Try) for item in node.finalbody]
    if any(_is_registered_release(item) for item in walk(owner)):
        return True
    return any(
        isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("release", "close")
        for item in finals
        for node in walk(item)
    )


def _is_registered_release(node: ast.AST) -> bool:
    """``stack.callback(camera.release)``: what an ExitStack calls on every way out."""
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute) or node.func.attr != "callback":
        return False
    return any(isinstance(item, ast.Attribute) and item.attr in ("release", "close") for item in node.args[:1])


def _bound(block: ast.With | ast.AsyncWith) -> set[str]:
    """The names that a ``with`` binds to what it opens and closes."""
    return {item.optional_vars.id for item in block.items if isinstance(item.optional_vars, ast.Name)}
