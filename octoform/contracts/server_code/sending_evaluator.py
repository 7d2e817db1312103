"""What a tool of a generated server sends to its device, computed from the syntax tree alone.

Nothing fails, what comes back is unknown, and each call that speaks to the device is noted with what it is given.
"""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from octoform.contracts.server_code.computed_values import UNKNOWN, World, is_unknown
from octoform.contracts.server_code.origins import last
from octoform.contracts.server_code.server_evaluator import Evaluator, Scope
from octoform.contracts.server_code.server_source import Source

_SPEAKS = frozenset(
    {"write", "send", "sendall", "Exchange", "Step", "move", "move_percent", "move_many", "pose", "torque", "stop"}
)
"""Methods of a port and of the runtime by which a device is commanded."""
_OF_DATA = ("runtime.registers.", "runtime.lines.Wire")


@dataclass(frozen=True)
class Sent:
    """One call that speaks to a device."""

    node: ast.Call
    name: str
    given: Sequence[Any]
    named: Mapping[str, Any]

    def argument(self, at: int, name: str, otherwise: Any = UNKNOWN) -> Any:
        """An argument by its place or its name."""
        return self.named.get(name, self.given[at] if at < len(self.given) else otherwise)


class SendingEvaluator(Evaluator):
    """One call of one tool, of which each call that speaks to the device is noted in ``sent``."""

    max_turns = 2

    def __init__(self, source: Source, world: World, choices: Sequence[bool] = ()) -> None:
        super().__init__(source, world, choices, lambda *_: True)
        self.sent: list[Sent] = []

    def constant(self, node: ast.expr) -> Any:
        """The value of an expression of the module."""
        return self.value(node, {})

    def value(self, node: ast.expr, scope: Scope) -> Any:
        """The value of an expression; what speaks to the device gives nothing that is known."""
        if isinstance(node, ast.Call):
            name = self._source.dotted(node.func)
            made = name.startswith(_OF_DATA) and name != "runtime.registers.NoReply"
            if made or (last(node.func) in _SPEAKS and not self._is_own(node)):
                given, named = self._given(node, scope)
                sent = Sent(node, name, given, named)
                if made:
                    return sent
                self.sent.append(sent)
                return UNKNOWN
        return super().value(node, scope)

    def _is_own(self, node: ast.Call) -> bool:
        return isinstance(node.func, ast.Name) and node.func.id in self._functions

    def _block(self, statements: Sequence[ast.stmt], scope: Scope) -> None:
        for item in statements:
            if isinstance(item, ast.Try):
                self._block([*item.body, *item.orelse, *item.finalbody], scope)
            elif isinstance(item, ast.AugAssign) and not isinstance(item.target, ast.Name):
                self.value(item.value, scope)
            elif not isinstance(item, ast.Delete | ast.Global | ast.Nonlocal):
                super()._block([item], scope)

    def _store(self, target: ast.expr, value: Any, scope: Scope) -> None:
        if isinstance(target, ast.Attribute | ast.Subscript) and is_unknown(self.value(target.value, scope)):
            return
        super()._store(target, value, scope)

    def _strange(self, _: ast.Call, *__: Any) -> Any:
        return UNKNOWN
