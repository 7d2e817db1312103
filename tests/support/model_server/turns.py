"""The script: which turn a request gets, and the calls and words of a turn."""

import json
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from model_server.asked import Asked, Tool

Turn = Mapping[str, Any]
SHELLS = (
    "bash",
    "shell",
    "run_shell_command",
    "shell_command",
    "exec_command",
    "local_shell",
    "execute_command",
    "terminal",
    "run_command",
)
COMMANDS = ("command", "cmd", "commands", "script")
PLAIN = {"integer": 1, "number": 1, "boolean": False, "array": [], "object": {}}
SIDE = "side"


@dataclass(frozen=True)
class Call:
    """One call of a tool; ``arguments`` is text, for it may be broken on purpose."""

    id: str
    tool: str
    arguments: str

    @property
    def value(self) -> Any:
        """The arguments as a value; None when they are broken."""
        try:
            return json.loads(self.arguments)
        except ValueError:
            return None


@dataclass(frozen=True)
class Spent:
    """Tokens of one reply; the cached are among the input."""

    input: int
    cached: int
    output: int


@dataclass(frozen=True)
class Reply:
    """The model's reply to one request."""

    id: str
    model: str
    text: str
    calls: tuple[Call, ...]
    spent: Spent


class Script:
    """The turns with what was already served of them; for many threads."""

    def __init__(self, script: Mapping[str, Any] | Sequence[Turn]) -> None:
        self.settings: Mapping[str, Any] = script if isinstance(script, Mapping) else {"turns": script}
        self._turns = self.settings["turns"]
        self._lock = threading.Lock()
        self._served = 0
        self._failed: dict[int, int] = {}

    def next(self, asked: Asked) -> tuple[int | None, Turn]:
        """The number of the turn (None for a request beside the conversation) and the turn."""
        if not asked.tools and self.settings.get("side", True):
            return None, {"text": "{}" if "schema" in asked.raw.lower() else "beside the point", "kind": SIDE}
        with self._lock:
            number = self._served if self.settings.get("index") == "counter" else asked.turn
            turn: Turn = self._turns[min(number, len(self._turns) - 1)]
            before = turn.get("fail_first") or ()
            failed = self._failed.get(number, 0)
            if failed < len(before):
                self._failed[number] = failed + 1
                turn = before[failed]
            self._served += not {"status", "drop"} & set(turn)
        return number, turn

    def reply(self, asked: Asked, number: int | None, turn: Turn, name: str) -> Reply:
        """The turn as a reply; ``name`` identifies it."""
        calls = tuple(_calls(turn, asked.tools, number or 0)) if number is not None else ()
        text = turn.get("text", "")
        size = len(text) + sum(len(call.arguments) for call in calls)
        tokens = {"input": len(asked.raw) // 4, "cached": 0, "output": size // 4 + 1}
        tokens |= {**self.settings.get("usage", {}), **turn.get("usage", {})}
        return Reply(name, asked.model, text, calls, Spent(**tokens))


def kind(turn: Turn) -> str:
    """The word for what a turn is, for the record."""
    return turn.get("kind") or next(iter(turn), "?")


def _calls(turn: Turn, tools: Sequence[Tool], number: int) -> list[Call]:
    found = []
    for place, item in enumerate(turn.get("calls") or [turn]):
        result = _call(item, tools, number)
        if result is not None:
            found.append(Call(f"call_t{number}n{place}", *result))
    return found


def _call(item: Turn, tools: Sequence[Tool], number: int) -> tuple[str, str] | None:
    if "shell" in item:
        return _shell(tools, item["shell"].replace("{turn}", str(number)))
    if "tool" in item:
        return item["tool"], json.dumps(item.get("args") or {})
    if "malformed" in item:
        name = (_shell(tools, "true") or ("bash", ""))[0]
        return {
            "json": (name, '{"command": "echo hi'),
            "unknown_tool": ("no_such_tool", '{"x": 1}'),
            "missing_args": (name, "{}"),
        }[item["malformed"]]
    return None


def _shell(tools: Sequence[Tool], command: str) -> tuple[str, str] | None:
    by_name = {tool.name.lower(): tool for tool in reversed(tools)}
    tool = next((by_name[name] for name in SHELLS if name in by_name), None)
    if tool is None:
        return None
    properties = tool.schema.get("properties") or {}
    key = next((name for name in COMMANDS if name in properties), "command")
    takes_list = _type(properties.get(key) or {}) == "array"
    return tool.name, json.dumps(_filled(tool.schema, {key: ["bash", "-lc", command] if takes_list else command}))


def _filled(schema: Mapping[str, Any], known: dict[str, Any]) -> dict[str, Any]:
    """The known arguments, and something plausible for the others that have to be there."""
    properties = schema.get("properties") or {}
    for name in schema.get("required") or ():
        if name not in known:
            fields = properties.get(name) or {}
            known[name] = (fields.get("enum") or [PLAIN.get(_type(fields), "a scripted step")])[0]
    return known


def _type(schema: Mapping[str, Any]) -> str:
    found = schema.get("type", "string")
    return str(found[0] if isinstance(found, list) else found).lower()
