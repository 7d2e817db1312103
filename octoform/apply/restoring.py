"""What a trial switches on by the way is put back: a unit that was limp before it is not left holding, and warming up.

What that is, how it is read and how it is set says the trial itself; here it is a number or a boolean like any other.
"""

from collections.abc import Mapping
from typing import Any

from octoform.apply.hand import Answer, Hand
from octoform.apply.pointing import at

Value = bool | int | float


class Restoring:
    """One value of the device, as it was before a trial and afterwards.

    ``wanted`` is the trial's member ``restore``; with None nothing is called. ``tools`` are those of INTERFACE by name.
    ``done``: it had changed and was put back. ``over``: no further call makes sense. ``words``: why the
    last call that failed gave nothing.
    """

    def __init__(self, hand: Hand, tools: Mapping[str, Mapping[str, Any]], wanted: Mapping[str, Any] | None) -> None:
        self._hand, self._tools, self._wanted = hand, tools, wanted
        self._first: Value | None = None
        self._last: Value | None = None
        self.done = self.over = False
        self.words = ""

    def remember(self) -> None:
        """Read it before the move."""
        self._first = self._read()

    def put_back(self) -> str | None:
        """Read it again, and set it where it has changed; what stays as it is now, None when all is as it was."""
        if self._wanted is None:
            return None
        if self._first is None:
            return f"{self._place} could not be read before the trial, and stays as it is now"
        self._last = self._read()
        if self._last == self._first:
            return None
        if not self.over:
            self._set(self._first)
            self._last = self._read()
        self.done = self._last == self._first
        if self.done:
            return None
        now = "unknown" if self._last is None else shown(self._last)
        return f"{self._place} was {shown(self._first)} before the trial, is {now} now, and stays so"

    @property
    def _place(self) -> str:
        read = (self._wanted or {})["read"]
        return f"{read['value'] or 'the top'} of {read['tool']}"

    def _read(self) -> Value | None:
        if self._wanted is None or self.over:
            return None
        read = self._wanted["read"]
        answer = self._call(read["tool"], read["arguments"])
        value = at(answer.value, read["value"])
        return value if isinstance(value, bool | int | float) else None

    def _set(self, value: Value) -> None:
        wanted = (self._wanted or {})["set"]
        given = fitting(value, self._tools[wanted["tool"]], wanted["vary"])
        self._call(wanted["tool"], {**wanted["arguments"], wanted["vary"]: given})

    def _call(self, tool: str, arguments: Mapping[str, Any]) -> Answer:
        answer = self._hand.call(tool, arguments)
        self.over = self.over or answer.over
        if answer.value is None:
            self.words = answer.words
        return answer


def fitting(value: Value, tool: Mapping[str, Any], parameter: str) -> Value:
    """The value as the parameter takes it: 0 is False for a boolean, False is 0 for a number."""
    kinds = tool["input_schema"].get("properties", {}).get(parameter, {}).get("type")
    kinds = kinds if isinstance(kinds, list) else [kinds]
    if "boolean" in kinds:
        return bool(value)
    return round(value) if "integer" in kinds else value + 0


def shown(value: Value) -> str:
    """A value in a sentence: ``0``, ``2.5``, ``true``."""
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"
