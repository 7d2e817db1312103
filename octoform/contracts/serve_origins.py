"""What the names of a generated server's calls tell of what comes back: a device's word, the clock's, chance's."""

import ast
import re
from abc import ABC, abstractmethod
from enum import IntFlag
from typing import TypeGuard

from octoform.contracts.source import Source


class Origin(IntFlag):
    """What a value depends on; none is a constant of the file.

    ``SYSTEM``: a program, the network or a library said it without being told of a device. ``COUNTED``: how often
    something came about.
    """

    NONE = 0
    ARGUMENT = 1
    FOUND = 2
    READ = 4
    SYSTEM = 8
    CHANCE = 16
    COUNTED = 32
    DEVICE = 64
    CLOCK = 128


ROUNDS = 12
ELSEWHERE = re.compile(
    r"subprocess\.\w+|asyncio\.create_subprocess_exec|asyncio\.open_connection|socket\.\w+|urllib\.request\.\w+"
    r"|http\.client\.\w+|(?:requests|httpx|aiohttp|paramiko|telnetlib|ftplib|smtplib|bleak|psutil)\..+"
)
"""What asks something outside of the process: programs and the network."""
CHANCE = re.compile(
    r"(?:.*\.)?random\..+|secrets\..+|uuid\..+"
    r"|os\.(?:urandom|getpid|getloadavg|times|getrandom|cpu_count)|hash|id"
    r"|resource\..+|platform\..+"
)
CLOCK = re.compile(
    r"time\.(?:time|monotonic|perf_counter|time_ns|monotonic_ns|process_time)|(?:.*\.)?datetime\.(?:now|utcnow|today)"
    r"|(?:.*\.)?date\.today"
)
PURE = re.compile(
    r"(?:str|int|float|complex|bool|bytes|bytearray|memoryview|round|len|min|max|sum|sorted|reversed|list|dict|tuple|set"
    r"|frozenset|abs|repr|ascii|format|enumerate|zip|range|isinstance|issubclass|getattr|hasattr|setattr|next|iter|map"
    r"|filter|any|all|type|divmod|pow|ord|chr|hex|bin|oct|slice|vars|super|print|callable|anext|aiter|cast|object"
    r"|(?:pathlib\.)?(?:Pure)?(?:Posix)?Path"
    r"|(?:os\.path|re|json|math|cmath|struct|statistics|decimal|fractions|collections|itertools|functools|operator"
    r"|string|textwrap|base64|binascii|zlib|hashlib|copy|dataclasses|typing|typing_extensions|enum|types|array|io"
    r"|datetime|calendar|logging|contextlib|numpy|np|PIL|pydantic|fastmcp|mcp|attrs|attr|cv2|fnmatch|shlex|bisect"
    r"|heapq|numbers|unicodedata|warnings|asyncio|threading|queue|concurrent|time|random|inspect|weakref|locale|html"
    r"|colorsys|difflib|pprint|reprlib|zoneinfo|runtime\.sentence|runtime\.bus|runtime\.sysroot)(?:\..+)?|.*Error|.*Fault)"
)
"""What only makes one value of another, unless it is given the place of a device."""
PLACES = frozenset(
    {"node", "nodes", "path", "paths", "bus", "joinpath", "with_name", "with_suffix", "with_stem", "relative_to"}
    | {
        "resolve",
        "absolute",
        "expanduser",
        "as_posix",
        "format",
        "join",
        "strip",
        "split",
        "rsplit",
        "replace",
        "lower",
    }
    | {
        "upper",
        "partition",
        "rpartition",
        "removeprefix",
        "removesuffix",
        "startswith",
        "endswith",
        "encode",
        "confirm",
    }
    | {
        "is_relative_to",
        "match",
        "append",
        "add",
        "extend",
        "insert",
        "update",
        "setdefault",
        "items",
        "values",
        "keys",
    }
    | {
        "copy",
        "index",
        "count",
        "title",
        "capitalize",
        "casefold",
        "lstrip",
        "rstrip",
        "zfill",
        "push",
        "enter_context",
    }
    | {"acquire", "release", "__enter__", "__exit__", "debug", "info", "warning", "error", "exception", "log"}
)
"""Methods that tell of a place, or make another one of it; whatever else is asked of it reads."""
OPENS = frozenset({"open", "io.open", "os.open", "os.fdopen", "io.FileIO"})
OF_ITSELF = frozenset({"id", "strength", "actuate"})
"""What a device that was found knows without being asked."""
SELF = frozenset({"self", "cls"})
MADE = ("__init__", "__post_init__", "__new__")


def leads_out(statement: ast.AST) -> TypeGuard[ast.If | ast.While]:
    """Whether a test decides if what follows a statement is reached, by more than that there is something."""
    if isinstance(statement, ast.While):
        return not isinstance(statement.test, ast.Constant)
    if not isinstance(statement, ast.If):
        return False
    ways = (ast.Return, ast.Raise, ast.Break, ast.Continue)
    leaves = any(isinstance(item, ways) for part in statement.body for item in ast.walk(part))
    only_raises = all(isinstance(item, ast.Raise) for item in statement.body)
    absent = ast.Is | ast.IsNot
    compares = [item for item in ast.walk(statement.test) if isinstance(item, ast.Compare)]
    tells = any(not isinstance(operator, absent) for item in compares for operator in item.ops)
    return leaves and (tells or not only_raises)


def touches(name: str) -> bool:
    """What of the modules that only make one value of another reaches a device all the same."""
    return name.rpartition(".")[2] in ("VideoCapture", "to_thread", "run_in_executor", "FileIO", "fromfile", "imread")


def last(node: ast.AST) -> str:
    """The last part of a name."""
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def inherits(owner: ast.ClassDef, name: str) -> bool:
    """Whether a class names another one as its base."""
    return any(last(item) == name for item in owner.bases)


def is_called(source: Source, node: ast.AST) -> bool:
    """Whether an expression is what a call calls."""
    above = source.parents.get(node)
    return isinstance(above, ast.Call) and above.func is node


def is_registered(source: Source, node: ast.AST) -> bool:
    """Whether a function stands where a tool is registered or logged, and not as a value for another one."""
    above = source.parents.get(node)
    if not isinstance(above, ast.Call) or node not in above.args:
        return False
    name = source.dotted(above.func)
    return name.endswith((".tool", ".add_tool")) or (name.startswith("runtime.") and name.endswith(".logged"))


class Deciding(ABC):
    """What decides whether a statement of a file runs, of what was read."""

    _source: Source

    @abstractmethod
    def of(self, node: ast.AST | None) -> Origin:
        """What the value of an expression depends on."""

    def control(self, node: ast.AST) -> Origin:
        """What decides whether a statement runs, of what was read: not whom the caller named."""
        found = Origin.NONE
        for above, below in self._source.above(node):
            if isinstance(above, ast.If | ast.While) and below is not above.test:
                found |= self.of(above.test)
            elif isinstance(above, ast.For | ast.AsyncFor) and below is not above.iter:
                found |= self.of(above.iter)
            elif isinstance(above, ast.Match) and below is not above.subject:
                found |= self.of(above.subject)
        return (found & (Origin.READ | Origin.SYSTEM | Origin.COUNTED)) | self.past(node)

    def past(self, node: ast.AST) -> Origin:
        """What was read that decided that a statement is reached at all: a wait before it, or a way out.

        A way out where nothing was read is none: whoever makes up a result may still look whether there is one.
        """
        owner, found = self._source.owner(node), Origin.NONE
        below, above = node, self._source.parents.get(node)
        while above is not None and below is not owner:
            for _, block in ast.iter_fields(above):
                before = block[: block.index(below)] if isinstance(block, list) and below in block else []
                for item in before:
                    found |= self.of(item.test) if leads_out(item) else Origin.NONE
            below, above = above, self._source.parents.get(above)
        return found & (Origin.READ | Origin.SYSTEM)
