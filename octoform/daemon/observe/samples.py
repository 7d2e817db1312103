"""Fresh readings of what a deployment measures: its reading tools and its camera. (Light.)

Only tools are called that need no argument, move nothing, wait for nothing and take no picture. One that
serves several devices, and needs no argument but the device, is called for each. They are called through the
endpoint's own gate, in the daemon's name, and the endpoint is never started for it. What cannot be read is a reading
all the same, of nothing, with the reason. What no tool reads has no reading: that it is there is all that is known.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from octoform.base.escaping import escaped
from octoform.base.shape import step
from octoform.claims.model import Channel, Reading, Signal, Value
from octoform.diagnostics import Diagnostic
from octoform.endpoint.client.jsonrpc import ToolCall, Wire, WireError, sender
from octoform.endpoint.dial import knock
from octoform.endpoint.expected_tools import hidden, promised, untried
from octoform.endpoint.process.record import running
from octoform.patterns import regex
from octoform.state.layout import Layout

NAME = "octoform watch"
CALL_SECONDS = 10.0
MAX_CALLS, MAX_VALUES, MAX_DEPTH, TEXT_CHARS = 60, 400, 8, 200
DEVICE = "device"
"""The parameter that states which of a tool's devices is meant."""
SKIPPED = ("skipped", "error")
"""Members by which a result states that a unit was omitted, and why."""
_NAMES = ("name", "id", "label", "unit", "joint", "motor", "channel", "device", "index")
"""Members that identify the items of a list: the first that every item has, no two share, and is a word."""
_PICTURE = frozenset(
    ("capture", "picture", "image", "photo", "photograph", "frame", "snapshot", "video", "record", "audio", "sound")
)
_POSSIBLE = frozenset(("list", "describe", "formats", "modes", "capabilities"))
"""Words of tools that report what a device can do, which is no reading of what it does."""
_WAITING = regex(r"timeout|duration|seconds|wait|_ms$|_s$", re.I)

EMPTY = "empty"
"""The value of a result that shows nothing, as a list without items does: also that is an answer."""
Make = Callable[[Signal, Value, str], Reading]
"""Makes a reading with an id and its times: `octoform.claims.ledger.Ledger.make`."""


def source_of(call: ToolCall) -> str:
    """The source of a call's signals: ``joints``, or ``read_temperature(hwmon-k10temp)`` where it names a device."""
    device = call.arguments.get(DEVICE)
    return call.tool if device is None else f"{call.tool}({_text(device)})"


def tool_of(source: str) -> str:
    """The tool behind the source of a sensor's signal."""
    return source.partition("(")[0]


class Sensors:
    """The channel of the reading tools."""

    def __init__(self, layout: Layout, make: Make) -> None:
        self._layout = layout
        self._make = make
        self._pictures: set[str] = set()

    def __call__(self) -> tuple[Reading, ...]:
        """One call of each tool that can be called so; none where nothing runs, since then nothing can be reported."""
        probes = self.probes()
        made, left = probes[:MAX_CALLS], probes[MAX_CALLS:]
        untold = tuple(self._nothing(each, f"only {MAX_CALLS} readings are taken at a time") for each in left)
        connection = knock(self._layout) if made else None
        if connection is None or isinstance(connection, Diagnostic):
            return (*(self._nothing(probe, "the endpoint takes no client") for probe in made), *untold)
        wire = Wire(connection)
        try:
            return (*(reading for probe in made for reading in self._read(wire, probe)), *untold)
        finally:
            wire.close()

    def probes(self) -> list[ToolCall]:
        """The calls that are made, in order; tools whose result was a picture are called no more."""
        unseen = hidden(self._layout) | untried(self._layout) | self._pictures
        known = promised(self._layout).items()
        tools = [(name, tool) for name, tool in known if name not in unseen and is_sensor(tool)]
        return sorted((_call(name, device) for name, tool in tools for device in _devices(tool)), key=_order)

    def promised(self) -> frozenset[Signal]:
        """The signals that these calls ought to report, without a path."""
        return frozenset(Signal(Channel.SENSOR, source_of(each), "") for each in self.probes())

    def _read(self, wire: Wire, probe: ToolCall) -> Iterator[Reading]:
        if probe.tool in self._pictures:  # it gave one of another device a moment ago
            return
        try:
            result = wire.ask("tools/call", probe.params, probe.seconds, meta=sender(NAME))
        except WireError as problem:
            yield self._nothing(probe, str(problem))
            return
        content = result.get("content") or ()
        if any(isinstance(block, Mapping) and block.get("type") in ("image", "audio") for block in content):
            self._pictures.add(probe.tool)
            return
        structured = result.get("structuredContent")
        if result.get("resultType") == "input_required":
            yield self._nothing(probe, "it wants a person's approval")
        elif result.get("isError"):
            yield self._nothing(probe, _text_of(content) or "it failed")
        elif not isinstance(structured, Mapping):
            yield self._nothing(probe, "its result is not structured")
        else:
            leaves = list(flattened(structured)) or [("", EMPTY, "")]
            for path, value, why in leaves:
                yield self._make(Signal(Channel.SENSOR, source_of(probe), path), value, why)

    def _nothing(self, probe: ToolCall, why: str) -> Reading:
        return self._make(Signal(Channel.SENSOR, source_of(probe), ""), None, _text(why))


def _call(tool: str, device: str | None) -> ToolCall:
    return ToolCall(tool, {} if device is None else {DEVICE: device}, seconds=CALL_SECONDS)


def is_sensor(tool: Mapping[str, Any]) -> bool:
    """Whether a tool measures, needs at most a device, waits for nothing and takes no picture, by its names."""
    schema = tool.get("input_schema") or {}
    if tool.get("effect") != "read" or not isinstance(schema.get("properties", {}), Mapping) or not _devices(tool):
        return False
    words = {word for name in (tool.get("name"), tool.get("capability")) for word in re.split(r"\W|_", str(name or ""))}
    return not (
        words & (_PICTURE | _POSSIBLE) or any(_WAITING.search(str(name)) for name in schema.get("properties", {}))
    )


def _devices(tool: Mapping[str, Any]) -> list[str | None]:
    """The devices for which a tool is called, one None where it takes no argument; none where it needs more."""
    schema = tool.get("input_schema") or {}
    required = schema.get("required") or []
    if not required:
        return [None]
    if list(required) != [DEVICE]:
        return []
    parameter = (schema.get("properties") or {}).get(DEVICE)
    listed = parameter.get("enum") if isinstance(parameter, Mapping) else None
    return [name for name in dict.fromkeys(listed or ()) if isinstance(name, str)]


def _order(probe: ToolCall) -> tuple[str, str]:
    return probe.tool, str(probe.arguments.get(DEVICE, ""))


def flattened(value: object) -> Iterator[tuple[str, Value, str]]:
    """(path, value, why it is none) of each number, truth, text and null of a structured result, in its order.

    ``path`` is a JSON pointer in which a member of a list stands by its name where it has one
    (``/joints/elbow/heat``). A null beside a ``skipped`` or an ``error`` has that as its reason. Bounded.
    """
    for count, found in enumerate(_leaves(value, "", "", 0)):
        if count >= MAX_VALUES:
            return
        yield found


def _leaves(value: object, path: str, why: str, depth: int) -> Iterator[tuple[str, Value, str]]:
    if value is None or isinstance(value, bool | int | float):
        yield path, value, why if value is None else ""
    elif isinstance(value, str):
        yield path, _text(value), ""
    elif depth < MAX_DEPTH and isinstance(value, Mapping):
        why = next((_text(str(value[name])) for name in SKIPPED if value.get(name)), why)
        for name, member in value.items():
            yield from _leaves(member, f"{path}/{_part(name)}", why, depth + 1)
    elif depth < MAX_DEPTH and isinstance(value, Sequence):
        for name, member in zip(_names(value), value, strict=True):
            yield from _leaves(member, f"{path}/{_part(name)}", why, depth + 1)


def _names(items: Sequence[object]) -> list[object]:
    """The names of the items of a list: by a member of theirs, else by their number."""
    for kind in (str, int):  # a word identifies more than a number
        for member in _NAMES:
            found = [item.get(member) if isinstance(item, Mapping) else None for item in items]
            if all(isinstance(name, kind) and name != "" for name in found) and len({*map(str, found)}) == len(items):
                return list(found)
    return list(range(len(items)))


def _part(name: object) -> str:
    return step(_text(str(name)))


def _text_of(content: Iterable[object]) -> str:
    blocks = [block for block in content if isinstance(block, Mapping)]
    return _text(" ".join(str(block.get("text") or "") for block in blocks).strip())


def _text(text: str) -> str:
    return escaped(text if len(text) <= TEXT_CHARS else f"{text[:TEXT_CHARS]}...")


class Frames:
    """The channel of the camera. ``look`` makes one look in a child, as the daemon's job of that name reports it.

    For hosts whose manifest has perception switched on; no one else's camera is looked through.
    """

    def __init__(self, layout: Layout, make: Make, look: Callable[[], Mapping[str, Any]]) -> None:
        self._layout = layout
        self._make = make
        self._look = look

    def __call__(self) -> tuple[Reading, ...]:
        """The problem of the picture (empty: none) and its brightness; a reading without value without a picture."""
        if running(self._layout) is None:
            return ()  # a look would start it
        found = self._look()
        source, picture = str(found.get("camera") or "camera"), found.get("picture")
        if not isinstance(picture, Mapping):
            why = _text(str(found.get("detail") or "there was no picture"))
            return (self._make(Signal(Channel.FRAME, source, "/trouble"), None, why),)
        values = {"trouble": _text(str(picture.get("trouble") or ""))}
        values |= {name: picture[name] for name in ("mean", "spread") if isinstance(picture.get(name), int | float)}
        return tuple(self._make(Signal(Channel.FRAME, source, f"/{name}"), value, "") for name, value in values.items())
