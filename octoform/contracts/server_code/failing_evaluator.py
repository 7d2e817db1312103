"""What a tool of a generated server answers while its device fails, computed from the syntax tree alone.

From a given access on, each access to a device raises an error. A tool that then returns has answered without a
reading; which handlers let it do that is noted. What cannot be computed has no outcome.
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeGuard

from octoform.contracts.server_code.computed_values import (
    UNKNOWN,
    Failed,
    Inner,
    Method,
    Unknown,
    Unsure,
    World,
    is_unknown,
    plainly,
)
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import ADDS, ELSEWHERE, PLACES, PURE, Origin, last
from octoform.contracts.server_code.server_evaluator import Evaluator, Scope
from octoform.contracts.server_code.server_source import Source, walk

NEUTRAL = Unknown()
"""What is unknown and comes from the caller or the clock: it is no part of what a device gave."""
_EVERYTHING = frozenset({"Exception", "BaseException"})
_KINDS = {
    "OSError": frozenset({"OSError", "IOError", "EnvironmentError", "SerialException"}),
    "DeviceFault": frozenset({"DeviceFault"}),
    "DeviceAbsent": frozenset({"DeviceFault", "DeviceAbsent"}),
    "CalledProcessError": frozenset({"CalledProcessError", "SubprocessError"}),
}
FAULTS = tuple(_KINDS)
"""The kinds of error that an access can raise."""
_LISTS = frozenset({"files", "sysroot"})
_READERS = frozenset({"read_number", "read_integer", "read_text", "read_first", "read_bytes"})
_LOOKS = frozenset({"glob", "rglob", "iterdir", "exists", "is_file", "is_dir", "close", "release", "flush", "kill"})
_MANAGERS = frozenset({"contextmanager", "asynccontextmanager"})
_NOT_OF_DEVICE = Origin.CLOCK | Origin.ARGUMENT | Origin.DEVICE | Origin.CHANCE | Origin.COUNTED


@dataclass(frozen=True)
class Fault:
    """An exception that a handler caught."""


@dataclass(frozen=True)
class Swallowed:
    """A handler that let a failure pass, and whether it catches whatever goes wrong."""

    node: ast.AST
    everything: bool


class _Broken(Failed):
    """An access to the device failed."""


class FailingEvaluator(Evaluator):
    """One call of one tool while each access raises an error of a kind, but for the first ones; ``fault`` is both."""

    max_turns = 3

    def __init__(
        self, source: Source, world: World, choices: Sequence[bool], flow: Flow, fault: tuple[str, int]
    ) -> None:
        super().__init__(source, world, choices, lambda *_: True)
        self._flow, self._kind, self._spared = flow, *fault
        self._own = {each.name for each in (*source.functions, *source.classes)}
        said = ((each.name, source.dotted(item)) for each in source.functions for item in each.decorator_list)
        self._managers = {name for name, word in said if word.rpartition(".")[2] in _MANAGERS}
        self._count, self.failed = 0, False
        self.swallowed: list[Swallowed] = []

    def value(self, node: ast.expr, scope: Scope) -> Any:
        """The value of an expression; an access to the device fails."""
        found = self._replaced(node, scope)
        if found is not None:
            return found[0]
        value = super().value(node, scope)
        if value is UNKNOWN and not self._flow.of(node) & ~_NOT_OF_DEVICE:
            return NEUTRAL
        return value

    def _replaced(self, node: ast.expr, scope: Scope) -> tuple[Any] | None:
        """The value of what is computed otherwise than in a world where everything works, in a tuple."""
        if not isinstance(node, ast.Call):
            if isinstance(node, (ast.ListComp, ast.GeneratorExp, ast.SetComp)) and len(node.generators) == 1:
                rows = self.value(node.generators[0].iter, scope)
                return ([self._row(node, scope)],) if is_unknown(rows) else None
            return None
        if self._is_manager(node):
            return (UNKNOWN,)
        return self._filled(node, scope) or self._accessed(node, scope)

    def _row(self, node: ast.ListComp | ast.GeneratorExp | ast.SetComp, scope: Scope) -> Any:
        """The one row of a comprehension over what is unknown: something is there that fails."""
        inner = dict(scope)
        self._store(node.generators[0].target, UNKNOWN, inner)
        return self.value(node.elt, inner)

    def _filled(self, node: ast.Call, scope: Scope) -> tuple[Any] | None:
        """A list or a table that is filled with what is unknown."""
        if not isinstance(node.func, ast.Attribute) or node.func.attr not in ADDS:
            return None
        owner = self.value(node.func.value, scope)
        if not isinstance(owner, list | dict):
            return None
        given, named = self._given(node, scope)
        if not given and (isinstance(owner, list) or not named):
            raise Failed
        if any(map(is_unknown, (*given, *named.values()))) and isinstance(owner, list):
            owner.append(given[-1] if node.func.attr == "append" else UNKNOWN)
        elif isinstance(owner, list) and node.func.attr == "append":
            owner.append(given[-1])
        elif any(map(is_unknown, (*given, *named.values()))):
            raise Unsure
        else:
            return None
        return (None,)

    def _accessed(self, node: ast.Call, scope: Scope) -> tuple[Any] | None:
        """The result of a call that reads the device, in a tuple; None for every other call."""
        name = self._source.dotted(node.func)
        own = name.removeprefix("runtime.") if name.startswith("runtime.") and "()" not in name else ""
        reads = own in _READERS
        if not reads and not self._accesses(node, name, own, scope):
            return None
        self._given(node, scope)
        self._count += 1
        if self._count <= self._spared:
            return (UNKNOWN,)
        self.failed = True
        if reads:
            return (None,)
        raise _Broken

    def _accesses(self, node: ast.Call, name: str, own: str, scope: Scope) -> bool:
        """Whether a call reaches the device, in a way that can fail so."""
        if own == "child.call" and node.args and isinstance(self.value(node.args[0], scope), Inner | Method):
            return False
        if self._kind == "DeviceAbsent" or own == "device":
            return self._kind == "DeviceAbsent" and own == "device"
        if self._kind == "CalledProcessError":
            return name.startswith("subprocess.") and name.rpartition(".")[2] in ("run", "check_output", "check_call")
        if own:
            return not PURE.fullmatch(name) and own not in _LISTS
        method = last(node.func)
        if self._kind == "DeviceFault" or method in self._own:
            return False
        if ELSEWHERE.fullmatch(name):
            return True
        if method in PLACES | _LOOKS | ADDS or PURE.fullmatch(name):
            return False
        given = [*node.args, *(item.value for item in node.keywords)]
        receiver = [node.func.value] if isinstance(node.func, ast.Attribute) else []
        return any(self._flow.of(item) & (Origin.FOUND | Origin.SYSTEM) for item in (*given, *receiver))

    def _is_manager(self, node: ast.Call) -> bool:
        """Whether a call enters a context manager of the file that is a generator; what it yields is unknown."""
        return last(node.func) in self._managers

    def _block(self, statements: Sequence[ast.stmt], scope: Scope) -> None:
        for item in statements:
            if isinstance(item, ast.Try):
                self._guarded(item, scope)
            elif isinstance(item, ast.With) and (caught := self._suppressed(item)):
                try:
                    super()._block([item], scope)
                except Failed as problem:
                    self._swallow(item, caught, problem)
            elif isinstance(item, ast.For) and is_unknown(self.value(item.iter, scope)):
                self._store(item.target, UNKNOWN, scope)
                if self._turn(item.body, scope):
                    self._block(item.orelse, scope)
            elif isinstance(item, ast.AugAssign):
                self._grown(item, scope)
            else:
                super()._block([item], scope)

    def _grown(self, node: ast.AugAssign, scope: Scope) -> None:
        before = self.value(node.target, scope)
        added = self.value(node.value, scope)
        if isinstance(before, list):
            before += [UNKNOWN] if is_unknown(added) else plainly(list, added)
        elif isinstance(node.target, ast.Name):
            scope[node.target.id] = self._two(type(node.op), before, added)

    def _guarded(self, node: ast.Try, scope: Scope) -> None:
        try:
            try:
                self._block(node.body, scope)
            except Failed as problem:
                self._handled(node, scope, problem)
            else:
                self._block(node.orelse, scope)
        finally:
            self._block(node.finalbody, scope)

    def _handled(self, node: ast.Try, scope: Scope, problem: Failed) -> None:
        for handler in node.handlers:
            kinds = self._kinds(handler.type)
            if self._catches(kinds, problem):
                if any(isinstance(item, ast.Raise) for item in walk(handler)):
                    raise Unsure  # it distinguishes errors, or makes one of another
                self._swallow(handler, kinds, problem)
                if handler.name:
                    scope[handler.name] = Fault()
                return self._block(handler.body, scope)
        raise problem

    def _swallow(self, node: ast.AST, kinds: frozenset[str], problem: Failed) -> None:
        if not self._catches(kinds, problem):
            raise problem
        self.swallowed.append(Swallowed(node, bool(kinds & _EVERYTHING)))

    def _catches(self, kinds: frozenset[str], problem: Failed) -> bool:
        if kinds & _EVERYTHING:
            return True
        return isinstance(problem, _Broken) and bool(kinds & _KINDS[self._kind])

    def _kinds(self, node: ast.expr | None) -> frozenset[str]:
        """The last names of the exceptions that a handler catches."""
        if node is None:
            return _EVERYTHING
        parts = [item for item in self._flow.plain(node) if isinstance(item, ast.expr)] if _is_name(node) else []
        every = [each for item in parts or [node] for each in (item.elts if isinstance(item, ast.Tuple) else [item])]
        return frozenset(last(each) for each in every)

    def _suppressed(self, node: ast.With) -> frozenset[str]:
        """The last names of the exceptions that a ``with`` suppresses."""
        calls = [item.context_expr for item in node.items if isinstance(item.context_expr, ast.Call)]
        found = [each for each in calls if self._source.dotted(each.func) == "contextlib.suppress"]
        return frozenset(name for call in found for item in call.args for name in self._kinds(item))

    def _strange(self, _: ast.Call, *given: Any) -> Any:
        """A call of what is not of the file gives what is unknown; it may fill the list that it is given."""
        if any(isinstance(item, list | dict | set) for item in given):
            raise Unsure
        return UNKNOWN


def _is_name(node: ast.expr) -> TypeGuard[ast.Name]:
    return isinstance(node, ast.Name)
