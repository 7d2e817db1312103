"""Rules for SERVE about the code as such: what it may import, and what it may never do.

A generated server runs with the rights of the person who started it, on the machine that has the hardware.
"""

import ast
import sys
from collections.abc import Iterator

from octoform.base.escaping import display
from octoform.base.source_lines import counted
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.rules.serve.tool_rules import tool_functions, tool_sites
from octoform.contracts.rules.text_rules import in_source
from octoform.contracts.server_code.script_header import declared_names, header, normalised
from octoform.contracts.server_code.server_source import Function, Source, imported_modules, needed_source, walk
from octoform.diagnostics import Diagnostic, Span, error
from octoform.patterns import regex

MAX_LINES = 500

_DYNAMIC = frozenset(
    {"eval", "exec", "compile", "__import__", "__builtins__", "importlib.import_module", "importlib.__import__"}
    | {"builtins.eval", "builtins.exec", "builtins.compile", "builtins.__import__", "runpy.run_path"}
    | {"runpy.run_module", "code.interact", "code.InteractiveInterpreter", "code.InteractiveConsole"}
)
_SHELL = regex(
    r"os\.(?:system|popen|exec[lv]p?e?|spawn[lv]p?e?|posix_spawnp?|fork|forkpty)|pty\.(?:spawn|fork)"
    r"|subprocess\.(?:getoutput|getstatusoutput)|asyncio\.create_subprocess_shell|asyncio\.subprocess\.create_.*shell"
)
SPAWN = frozenset(
    {f"subprocess.{name}" for name in ("run", "Popen", "call", "check_call", "check_output")}
    | {"asyncio.create_subprocess_exec"}
)
_INTERPRETERS = regex(r"(?:.*/)?(?:(?:ba|da|z|k|c|fi)?sh|python[\d.]*|perl|ruby|node|env|sudo|su|doas|pkexec|xargs)")
_UNSAFE_LOADS = regex(
    r"(?:c?pickle|_pickle|dill|cloudpickle|joblib|marshal|jsonpickle)\.(?:loads?|Unpickler|decode)|shelve\.open"
    r"|yaml\.(?:load|unsafe_load|full_load)(?:_all)?|torch\.load"
)
_LISTENERS = regex(
    r"asyncio\.start(?:_unix)?_server|(?:.*\.)?create_(?:unix_)?server|uvicorn\..*|hypercorn\..*|waitress\..*"
    r"|http\.server\..*Server|socketserver\..*Server|xmlrpc\.server\..*|wsgiref\..*|websockets\.(?:.*\.)?serve"
    r"|(?:.*\.)?(?:run_http_async|run_sse_async|http_app|sse_app|streamable_http_app)|(?:.*socket.*|.*sock)\.(?:bind|listen)"
)
_ENDS = frozenset({"sys.exit", "os._exit", "os.abort", "exit", "quit", "signal.raise_signal"})
_ENDING = frozenset({"SystemExit", "KeyboardInterrupt", "GeneratorExit"})
_STAND_INS = frozenset({"unittest", "mock", "pytest", "doctest", "faker"})
_SLEEPS = frozenset({"time.sleep", "asyncio.sleep", "anyio.sleep"})
_MAX_WAIT = 60.0
"""Seconds; the bound of protocol/interface.md."""


def too_long(value: str, _: Artifacts) -> list[Diagnostic]:
    """The server stays one file that a person reads at one sitting; blank lines and result classes do not count."""
    source = needed_source(value)
    lines = counted(value, source.tree)
    if len(lines) <= MAX_LINES:
        return []
    summary = f"the server has {len(lines)} lines without blank ones and result classes; {MAX_LINES} are allowed"
    hint = "share code between tools; leave lookup, locks and logging to the runtime package"
    return [error("SERVE-TOO-LONG", summary, span=Span(lines[MAX_LINES], 1), hint=hint)]


def import_octoform(value: str, _: Artifacts) -> list[Diagnostic]:
    """Generated code stands on its own."""
    source = needed_source(value)
    return [
        source.problem(
            "SERVE-IMPORT-OCTOFORM", node, "the server imports octoform", "use the `runtime` package beside the server"
        )
        for name, node, _inside in imported_modules(source)
        if name == "octoform"
    ]


def import_relative(value: str, _: Artifacts) -> list[Diagnostic]:
    """The server is no package, so a relative import finds nothing; a star hides what comes in."""
    source = needed_source(value)
    out = []
    for name, node, _inside in imported_modules(source):
        if name == ".":
            hint = "import `runtime` by its name; it lies beside the server"
            out.append(source.problem("SERVE-IMPORT-FORM", node, "the server has a relative import", hint))
        elif name in _STAND_INS:
            summary = f"{display(name)} makes fakes, and a server that has one reads no device"
            hint = "let the import of a missing library fail: its tool then reports which one is missing"
            out.append(source.problem("SERVE-IMPORT-FORM", node, summary, hint))
        elif isinstance(node, ast.ImportFrom) and any(item.name == "*" for item in node.names):
            summary = f"a star import from {display(name)} hides what the server uses"
            out.append(source.problem("SERVE-IMPORT-FORM", node, summary, "import each name"))
    return out


def import_undeclared(value: str, _: Artifacts) -> list[Diagnostic]:
    """An import from neither the standard library nor ``runtime`` must come from a declared dependency.

    A module may be called otherwise than its distribution. So a module of another name is let pass as long as the
    header declares a distribution that no import accounts for; DEPLOY names the provider of each module exactly.
    """
    source = needed_source(value)
    foreign = [(name, node) for name, node, _ in imported_modules(source) if name not in _local_modules()]
    declared = declared_names(value)
    spare = declared - {normalised(name) for name, _ in foreign}
    return [
        source.problem(
            "SERVE-IMPORT-UNDECLARED",
            node,
            f"{display(name)} is imported, but no dependency of the header provides it",
            "declare the distribution that provides it in the script header",
        )
        for name, node in foreign
        if normalised(name) not in declared and not spare
    ]


def dynamic_code(value: str, _: Artifacts) -> list[Diagnostic]:
    """No code is made from text at run time."""
    source = needed_source(value)
    own = {function.name for function in source.functions}
    out = []
    for node in source.nodes:
        if not isinstance(node, ast.Name | ast.Attribute) or not isinstance(node.ctx, ast.Load):
            continue
        name = source.dotted(node)
        if name in _DYNAMIC and name not in own:
            hint = "write the code out, or choose among written functions with a table"
            out.append(source.problem("SERVE-DYNAMIC-CODE", node, f"{display(name)} makes code from data", hint))
    return out


def shell(value: str, _: Artifacts) -> list[Diagnostic]:
    """Programs are started without a shell, by a literal list whose program name is constant."""
    source = needed_source(value)
    out = []
    for call, name in source.calls:
        why = None
        if _SHELL.fullmatch(name):
            why = f"{display(name)} hands a command line to a shell or replaces the process"
        elif name in SPAWN:
            why = _spawn_problem(source, call, name)
        if why is not None:
            hint = "call subprocess.run with a literal list that starts with the program's name, and without a shell"
            out.append(source.problem("SERVE-SHELL", call, why, hint))
    return out


def unsafe_loads(value: str, _: Artifacts) -> list[Diagnostic]:
    """A server may not unpickle: device data would become code."""
    source = needed_source(value)
    hint = "use json, struct or plain text"
    return [
        source.problem("SERVE-UNSAFE-LOADS", call, f"{display(name)} can run code that is in the data", hint)
        for call, name in source.calls
        if _UNSAFE_LOADS.fullmatch(name) and not _safe_loader(call)
    ]


def listens(value: str, _: Artifacts) -> list[Diagnostic]:
    """The server opens no port; how it is reached is octoform's business."""
    source = needed_source(value)
    out = []
    for call, name in source.calls:
        transport = _keyword(call, "transport")
        if transport is None and name.endswith((".run", ".run_async")) and call.args:
            transport = None if isinstance(call.args[0], ast.List | ast.Tuple) else call.args[0]  # a program's words
        runs = name.endswith((".run", ".run_async")) and transport is not None and not name.startswith("subprocess")
        networked = runs and not (isinstance(transport, ast.Constant) and transport.value == "stdio")
        if _LISTENERS.fullmatch(name) or (networked and not name.startswith("asyncio.")):
            hint = 'end the file with mcp.run() under `if __name__ == "__main__":`, which speaks over stdio'
            out.append(source.problem("SERVE-LISTENS", call, f"{display(name)} listens on a network", hint))
    return out


def prints(value: str, _: Artifacts) -> list[Diagnostic]:
    """Standard output carries the protocol and nothing else."""
    source = needed_source(value)
    hint = "use logging, or print(..., file=sys.stderr)"
    out = []
    for call, name in source.calls:
        target = _keyword(call, "file")
        if name == "print" and (target is None or source.dotted(target) == "sys.stdout"):
            out.append(source.problem("SERVE-PRINTS", call, "print writes into the protocol's stream", hint))
        elif name in ("sys.stdout.write", "sys.stdout.writelines", "sys.stdout.buffer.write"):
            out.append(source.problem("SERVE-PRINTS", call, f"{display(name)} writes into the protocol's stream", hint))
    return out


def ends_process(value: str, _: Artifacts) -> list[Diagnostic]:
    """No tool ends the process: it serves all other tools, and all other clients, as well."""
    source = needed_source(value)
    used = source.entered_from(item for site in tool_sites(source) for item in tool_functions(source, site))
    hint = "raise ToolError with one sentence: the call fails, and the server goes on"
    out = []
    for node in (each for each in source.nodes if isinstance(each, (ast.Call, ast.Raise))):
        called = node.func if isinstance(node, ast.Call) else node.exc
        name = source.dotted(called).removesuffix("()")
        own = name == "os.kill" and isinstance(node, ast.Call) and "os.getpid" in ast.unparse(node)
        ends = name in (_ENDING if isinstance(node, ast.Raise) else _ENDS)
        if (own or ends) and source.owner(node) in used:
            out.append(source.problem("SERVE-ENDS-PROCESS", node, f"{display(name)} ends the whole server", hint))
    return out


def module_changed(value: str, _: Artifacts) -> list[Diagnostic]:
    """A server must not replace attributes of its imports: a replaced reader reads nothing any more."""
    source = needed_source(value)
    hint = "write a function of your own and call that; modules are used as they are"
    out = []
    for node in source.nodes:
        if isinstance(node, ast.Attribute) and not isinstance(node.ctx, ast.Load):
            changed: ast.expr = node.value
        elif isinstance(node, ast.Call) and source.dotted(node.func) in ("setattr", "delattr") and node.args:
            changed = node.args[0]
        else:
            continue
        root = changed
        while isinstance(root, ast.Attribute):
            root = root.value
        name = source.dotted(changed)
        if isinstance(root, ast.Name) and root.id in source.names and not name.startswith("logging"):
            summary = f"a part of {display(name)} is replaced, for everyone who uses it"
            out.append(source.problem("SERVE-MODULE-CHANGED", node, summary, hint))
    return out


def waits_too_long(value: str, _: Artifacts) -> list[Diagnostic]:
    """No call sleeps for longer than a caller waits."""
    source = needed_source(value)
    out = []
    for call, name in source.calls:
        given = call.args[0] if name in _SLEEPS and call.args else None
        seconds = given.value if isinstance(given, ast.Constant) else None
        if isinstance(seconds, int | float) and seconds > _MAX_WAIT:
            summary = f"{display(name)} waits {seconds:g} s, and a call may last {_MAX_WAIT:g} s"
            hint = "return what is there now, or let a parameter say how long to wait, within a minute"
            out.append(source.problem("SERVE-WAIT-TOO-LONG", call, summary, hint))
    return out


RULES = (
    Rule("SERVE-TOO-LONG", too_long),
    Rule("SERVE-HEADER", header),
    Rule("SERVE-IMPORT-OCTOFORM", import_octoform),
    Rule("SERVE-IMPORT-FORM", import_relative),
    Rule("SERVE-IMPORT-UNDECLARED", import_undeclared),
    Rule("SERVE-DYNAMIC-CODE", dynamic_code),
    Rule("SERVE-SHELL", shell),
    Rule("SERVE-UNSAFE-LOADS", unsafe_loads),
    Rule("SERVE-LISTENS", listens),
    Rule("SERVE-PRINTS", prints),
    Rule("SERVE-ENDS-PROCESS", ends_process),
    Rule("SERVE-MODULE-CHANGED", module_changed),
    Rule("SERVE-WAIT-TOO-LONG", waits_too_long),
    Rule("SERVE-UNESCAPED-TEXT", in_source("SERVE-UNESCAPED-TEXT")),
)


def is_standard(module: str) -> bool:
    """True for a top-level module of the standard library."""
    return module in sys.stdlib_module_names


def _local_modules() -> frozenset[str]:
    return sys.stdlib_module_names | {"runtime", "octoform", "."}


def _keyword(call: ast.Call, name: str) -> ast.expr | None:
    return next((item.value for item in call.keywords if item.arg == name), None)


def _safe_loader(call: ast.Call) -> bool:
    loader = _keyword(call, "Loader") or (call.args[1] if len(call.args) > 1 else None)
    return isinstance(loader, ast.Attribute) and loader.attr in ("SafeLoader", "CSafeLoader")


def _spawn_problem(source: Source, call: ast.Call, name: str) -> str | None:
    flag = _keyword(call, "shell")
    if flag is not None and not (isinstance(flag, ast.Constant) and flag.value is False):
        return f"{display(name)} may use a shell"
    if name.startswith("asyncio."):
        program: ast.expr | None = call.args[0] if call.args else None
    else:
        given = call.args[0] if call.args else _keyword(call, "args")
        listed = literal(source, given)
        if listed is None or not listed.elts:
            return f"{display(name)} is not given a literal list of arguments"
        program = listed.elts[0]
    if not (isinstance(program, ast.Constant) and isinstance(program.value, str)):
        return f"{display(name)} starts a program whose name is not constant"
    if _INTERPRETERS.fullmatch(program.value):
        return f"{display(name)} starts {display(program.value)}, which runs other commands"
    return None


def literal(source: Source, node: ast.expr | None) -> ast.List | ast.Tuple | None:
    """A list display, or the one that a name of the same scope is assigned."""
    if isinstance(node, ast.List | ast.Tuple):
        return node
    if not isinstance(node, ast.Name):
        return None
    scopes = (source.owner(node), None)
    for statement in source.nodes:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and source.owner(statement) in scopes:
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            if any(isinstance(item, ast.Name) and item.id == node.id for item in targets):
                return statement.value if isinstance(statement.value, ast.List | ast.Tuple) else None
    return None


# The rule for SERVE about time: an ``async`` function never waits in a way that holds up everybody.
#
# All clients of a host share one event loop. A tool without ``async`` runs in a thread of its own and may block as long
# as its timeout allows; one with it runs on the loop, and while it sleeps or waits for a program no client gets an
# answer.

_BLOCKING = regex(
    r"time\.sleep|subprocess\.(?:run|call|check_call|check_output|getoutput|getstatusoutput)|select\.(?:select|poll)"
    r"|os\.(?:system|popen|wait|wait3|wait4|waitpid)|socket\.create_connection|input|signal\.(?:pause|sigwait)"
    r"|urllib\.request\.urlopen|(?:requests|httpx)\.(?:get|head|post|put|patch|delete|request)"
    r"|serial\.(?:.*\.)?(?:Serial|serial_for_url)|cv2\.VideoCapture"
    r"|runtime\.evdev\.(?:events|rumble)|runtime\.nmea\.sentences|runtime\.child\.call"
)


def async_blocks(value: str, _: Artifacts) -> list[Diagnostic]:
    """No ``async`` function makes a call that is known to block, itself or through a function of the file."""
    source = needed_source(value)
    blocking = _blocking_functions(source)
    hint = "write the tool without async: it then runs in a thread of its own; or await what waits (asyncio.sleep)"
    out = []
    for call, owner in _direct_calls(source):
        if not isinstance(owner, ast.AsyncFunctionDef):
            continue
        name = source.dotted(call.func)
        if _BLOCKING.fullmatch(name):
            summary = f"{display(name)} blocks every client while {display(owner.name)} waits"
        elif name in blocking:
            summary = f"{display(name)} blocks ({blocking[name]}), and {display(owner.name)} calls it on the event loop"
        else:
            continue
        out.append(source.problem("SERVE-ASYNC-BLOCKS", call, summary, hint))
    return out


LOOP_RULES = (Rule("SERVE-ASYNC-BLOCKS", async_blocks),)


def _blocking_functions(source: Source) -> dict[str, str]:
    """The file's functions without ``async`` that block when they are called, each with the call that does."""
    found: dict[str, str] = {}
    calls = [(source.dotted(call.func), owner.name) for call, owner in _direct_calls(source) if _is_plain(owner)]
    while True:
        more = {
            owner: display(name) if _BLOCKING.fullmatch(name) else found[name]
            for name, owner in calls
            if owner not in found and (_BLOCKING.fullmatch(name) or name in found)
        }
        if not more:
            return found
        found |= more


def _direct_calls(source: Source) -> Iterator[tuple[ast.Call, Function]]:
    """Every call with the function that makes it; one in a lambda is made by anyone who calls that, and omitted."""
    for call, _ in source.calls:
        owner = source.owner(call)
        if owner is not None and not any(isinstance(above, ast.Lambda) for above, _ in source.above(call)):
            yield call, owner


def _is_plain(function: Function) -> bool:
    """A call of it runs its body: neither a coroutine nor a generator."""
    return isinstance(function, ast.FunctionDef)


# Which programs of the system a generated server starts, and which of its tools cannot do without them.

_MISSING = frozenset({"FileNotFoundError", "OSError", "Exception"})


def programs_of(value: str) -> set[str]:
    """The names of all programs that a server starts."""
    return {name for _, name in _started(needed_source(value))}


def tools_starting(value: str) -> dict[str, list[str]]:
    """Each program to the tools that need it: those that start it and have no other way where it is missing."""
    source = needed_source(value)
    out: dict[str, list[str]] = {}
    needed = [(call, name) for call, name in _started(source) if not _has_other_way(source, call)]
    for site in tool_sites(source):
        used = source.entered_from(tool_functions(source, site))
        for program in sorted({name for call, name in needed if source.owner(call) in used}):
            if site.name is not None:
                out.setdefault(program, []).append(site.name)
    return out


def started_blindly(value: str) -> dict[str, int]:
    """Each program that is started without a word for the case that it is missing, with the line where."""
    source = needed_source(value)
    out: dict[str, int] = {}
    for call, name in _started(source):
        looked = any(each == "shutil.which" and source.owner(one) is source.owner(call) for one, each in source.calls)
        caught = any(
            isinstance(above, ast.Try) and below in above.body and any(map(_catches_missing, above.handlers))
            for above, below in source.above(call)
        )
        if not looked and not caught:
            out.setdefault(name, call.lineno)
    return out


def _catches_missing(handler: ast.ExceptHandler) -> bool:
    kinds = walk(handler.type) if handler.type else ()
    return not handler.type or any(isinstance(item, ast.Name) and item.id in _MISSING for item in kinds)


def _started(source: Source) -> list[tuple[ast.Call, str]]:
    out = []
    for call, name in source.calls:
        if name not in SPAWN:
            continue
        first: ast.expr | None = call.args[0] if call.args else None
        if not name.startswith("asyncio."):
            given = first or next((item.value for item in call.keywords if item.arg == "args"), None)
            listed = literal(source, given)
            first = listed.elts[0] if listed is not None and listed.elts else None
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            out.append((call, first.value))
    return out


def _has_other_way(source: Source, call: ast.Call) -> bool:
    """Whether a tool goes on where the program is missing: it looks first, or catches that and does not raise."""
    for above, below in source.above(call):
        if isinstance(above, ast.If) and below is not above.test and above.orelse:
            looks = (item for item in walk(above.test) if isinstance(item, ast.Call))
            if any(source.dotted(item.func) == "shutil.which" for item in looks):
                return True
        if isinstance(above, ast.Try) and below in above.body:
            for handler in above.handlers:
                names = (
                    {item.id for item in walk(handler.type) if isinstance(item, ast.Name)}
                    if handler.type
                    else {"OSError"}
                )
                if names & _MISSING and not any(isinstance(item, ast.Raise) for item in walk(handler)):
                    return True
    return False
