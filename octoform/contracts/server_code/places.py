"""Which strings and numbers a generated server has, put together or not, and which of them are places of devices."""

import ast
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache

from octoform.base.escaping import display
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import Origin
from octoform.contracts.server_code.server_source import Source
from octoform.patterns import regex

_UNKNOWN = "\0"
_PLACES = regex(r"/(?:dev|sys)(?:/.*)?", re.DOTALL)
_NUMBERED = regex(rf"{_UNKNOWN}+/+(?:dev|sys)/(?:[^{_UNKNOWN}]*/)?[a-z][a-z_:-]*\d+(?:/[^{_UNKNOWN}]*)?", re.IGNORECASE)
_NAMES = regex(r"(?:tty(?:USB|ACM|AMA|S|THS|O)|video|hidraw|hwmon|spidev|COM|i2c-)\d+(?:\.\d+)?")
_ADDRESS = regex(r"(?:\w+://)?(?!127\.|0\.0\.0\.0)(?:\d{1,3}\.){3}\d{1,3}(?::\d+)?(?:/.*)?")
_BY_ITSELF = regex(r"psutil\.sensors_\w+")
"""Calls that search the machine that runs them for devices, whichever host is meant."""
_NOT_DEVICES = regex(r"/dev/(?:null|zero|full|u?random|shm(?:/.*)?|std\w+|fd(?:/.*)?)")
_PATH_TESTS = frozenset(
    {"startswith", "removeprefix", "endswith", "is_relative_to", "relative_to", "match", "fullmatch"}
)
_DEPTH = 6
_TEXTS = (ast.Constant, ast.BinOp, ast.JoinedStr, ast.Call)
_BY_NUMBER = frozenset({"VideoCapture", "SMBus", "SpiDev", "I2C", "SPI", "Picamera2"})


@lru_cache(maxsize=4)
def literal_places(source: Source, flow: Flow) -> tuple[tuple[ast.AST, str], ...]:
    """Where a place is written down, each with what is wrong with it."""
    return tuple(_written_places(source, flow))


def _written_places(source: Source, flow: Flow) -> Iterator[tuple[ast.AST, str]]:
    names: set[ast.AST] = set()
    for node in source.nodes:
        if not isinstance(node, _TEXTS) or (names and names & _upwards(source, node)):
            continue
        text = folded(source, flow, node)
        if text is not None and _is_place(source, node, text):
            names.add(node)
            written = text.replace(_UNKNOWN, "*")
            yield node, f"{display(written)} is where a device was when this was written"
    for call, name in source.calls:
        if _BY_ITSELF.fullmatch(name):
            yield call, f"{display(name)} looks for devices of its own"
    cameras = any(name.rpartition(".")[2] == "VideoCapture" for _, name in source.calls)
    for call, name in source.calls:
        number = _number(source, flow, call, name.rpartition(".")[2], cameras)
        if number is not None:
            what = "camera" if "VideoCapture" in name or name.endswith(".open") else "device"
            yield call, f"{what} number {number} is whichever {what} the kernel found at that place"


def constants(flow: Flow, node: ast.expr | None, depth: int = _DEPTH) -> frozenset[str]:
    """The texts that an expression can be, where each of them is written in the file; none where one is not."""
    if node is None or depth == 0:
        return frozenset()
    if isinstance(node, ast.Constant):
        return frozenset({node.value}) if isinstance(node.value, str) else frozenset()
    if isinstance(node, ast.IfExp):
        return _both(flow, [node.body, node.orelse], depth)
    if isinstance(node, ast.BoolOp):
        return _both(flow, node.values, depth)
    if isinstance(node, ast.Name):
        if flow.is_inner(node):
            return frozenset()
        values = flow.plain(node)
        return _both(flow, values, depth) if values else frozenset()
    if isinstance(node, ast.Attribute):
        stored = flow.bindings.attributes.get(node.attr, [])
        return _both(flow, [each.value for each in stored], depth)
    return frozenset()


def _both(flow: Flow, nodes: Sequence[ast.AST], depth: int) -> frozenset[str]:
    found = [constants(flow, node, depth - 1) if isinstance(node, ast.expr) else frozenset() for node in nodes]
    return frozenset().union(*found) if found and all(found) else frozenset()


def folded(source: Source, flow: Flow, node: ast.AST, depth: int = _DEPTH) -> str | None:
    """The text that an expression makes of constants, a zero byte for each part that is none; None for no text."""
    if depth == 0:
        return _UNKNOWN
    if isinstance(node, ast.Constant):
        value = node.value.decode("latin-1") if isinstance(node.value, bytes) else node.value
        return (
            value if isinstance(value, str) else str(value) if type(value) in (int, float) and depth < _DEPTH else None
        )
    if isinstance(node, ast.JoinedStr):
        return "".join(_part(source, flow, item, depth) for item in node.values)
    if isinstance(node, ast.FormattedValue):
        return _part(source, flow, node.value, depth)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _part(source, flow, node.left, depth) + _part(source, flow, node.right, depth)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
        return _joined([_part(source, flow, node.left, depth), _part(source, flow, node.right, depth)])
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
        return re.sub(r"%[-+0-9.]*[a-z]", _UNKNOWN, _part(source, flow, node.left, depth))
    if isinstance(node, ast.Name | ast.Attribute):
        name = source.dotted(node)
        if name in ("os.sep", "os.path.sep", "posixpath.sep"):
            return "/"
        known = constants(flow, node, depth - 1)
        return next(iter(known)) if len(known) == 1 else None
    return _called(source, flow, node, depth) if isinstance(node, ast.Call) else None


def _called(source: Source, flow: Flow, node: ast.Call, depth: int) -> str | None:
    name, method = source.dotted(node.func), node.func.attr if isinstance(node.func, ast.Attribute) else ""
    parts = [_part(source, flow, item, depth) for item in node.args]
    if name.rpartition(".")[2] in ("Path", "PosixPath", "PurePath", "PurePosixPath") or name == "os.path.join":
        return _joined(parts) if parts else None
    if method == "joinpath" and isinstance(node.func, ast.Attribute):
        return _joined([_part(source, flow, node.func.value, depth), *parts])
    listed = node.args[0] if len(node.args) == 1 else None
    if method == "join" and isinstance(node.func, ast.Attribute) and isinstance(listed, ast.List | ast.Tuple):
        texts = [_part(source, flow, item, depth) for item in listed.elts]
        return _part(source, flow, node.func.value, depth).join(texts)
    if method == "format" and isinstance(node.func, ast.Attribute):
        return re.sub(r"\{[^{}]*\}", _UNKNOWN, _part(source, flow, node.func.value, depth))
    if method in ("decode", "encode", "strip") and isinstance(node.func, ast.Attribute):
        return _part(source, flow, node.func.value, depth)
    return parts[0] if name in ("str", "os.fspath", "os.fsencode") and len(parts) == 1 else None


def _part(source: Source, flow: Flow, node: ast.AST, depth: int) -> str:
    found = folded(source, flow, node, depth - 1)
    return _UNKNOWN if found is None else found


def _joined(parts: list[str]) -> str:
    text = ""
    for part in parts:
        text = part if part.startswith("/") else f"{text.rstrip('/')}/{part}" if text else part
    return text


def _upwards(source: Source, node: ast.AST) -> set[ast.AST]:
    found: set[ast.AST] = set()
    above = source.parents.get(node)
    while isinstance(above, ast.expr | ast.FormattedValue):
        found.add(above)
        above = source.parents.get(above)
    return found


def _is_place(source: Source, node: ast.AST, text: str) -> bool:
    named = isinstance(node, ast.Constant) and (_NAMES.fullmatch(text) or _ADDRESS.fullmatch(text))
    placed = _PLACES.fullmatch(text) and not _NOT_DEVICES.fullmatch(text)
    if not (named or placed or _NUMBERED.fullmatch(text)):
        return False
    above = source.parents.get(node)
    if isinstance(above, ast.Expr | ast.Compare):  # a docstring, a comparison
        return False
    if isinstance(above, ast.BinOp) and isinstance(above.op, ast.Div) and above.right is node:
        return True
    called = above.func if isinstance(above, ast.Call) else None
    if isinstance(called, ast.Attribute) and called.attr in _PATH_TESTS:
        return False
    return not any(isinstance(item, ast.Raise) for item, _ in source.above(node))


def _number(source: Source, flow: Flow, call: ast.Call, name: str, cameras: bool) -> str | None:
    """The number by which a device is opened, where it is a constant."""
    by_number = name in _BY_NUMBER or (name == "open" and isinstance(call.func, ast.Attribute) and cameras)
    if not by_number or not (call.args or call.keywords):
        return None
    named = [item.value for item in call.keywords if item.arg in ("index", "filename", "bus", "device", "camera_num")]
    given = call.args[0] if call.args else next(iter(named), None)
    if isinstance(given, ast.Starred):
        given = given.value if isinstance(given.value, ast.List | ast.Tuple) else None
    if given is None or flow.of(given) & ~Origin.CHANCE or (name == "open" and not _is_int(given)):
        return None
    text = folded(source, flow, given)
    if text is not None and not text.strip().isdigit():
        return None  # a string, which is a path or nothing
    return ast.unparse(given)[:20]


def _is_int(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) is int
