"""The limits on calls: judged and counted in one step, outside the generated code, for every caller.

What is counted (sums, last values, times of calls) survives a restart in ``limits.json``, and a call counts before the
device moves: one that fails may have moved it. A file that cannot be trusted never means "nothing counted": the tools
concerned are refused until a person sets them back.
"""

import json
import os
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import datetime
from fractions import Fraction
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.base.clock import boot_id
from octoform.base.files import private_folder
from octoform.policy import Call, Kept, Kind, OfValue, Refusal, Used, cut, is_number
from octoform.policy.published import Policy, ToolPolicy
from octoform.records import replace

# The file that keeps the counters over a restart.
#
# Each counted call appends one line before the call goes on: the sums and last values of its tool, and its own moment
# alone, however many moments there are already. When the lines outgrow what they stand for, the file is written again
# with one line for each tool, which holds all. (Replacing it for each call would cost a tenth of a millisecond.) A file
# that is cut off, empty or not wholly understood is damaged: no one knows what it lost.
#
# Times are those of the clock that only goes forward; they hold as they are while the machine has not been started
# again. After that the wall clock states how much time went by, and where it went backwards, none did: a cooldown then
# lasts once more, but not permanently.

HEADER = {"format": 1}
_COMPACT_BYTES = 262_144
_LARGEST = 256_000_000
"""Bytes that are read: several times what the moments of a host's tools can come to."""
_APPEND = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


class CountersUnwritable(OSError):
    """The file could not be replaced; what was to be counted is not counted."""


class Counters:
    """The counters of the tools ``names``, read from ``path`` once. Not safe to use from threads by itself."""

    def __init__(self, path: Path, names: set[str], clock: Callable[[], float], wall: Callable[[], float]) -> None:
        self.names = frozenset(names)
        self.damage = ""
        self._path, self._clock, self._wall, self._boot = path, clock, wall, boot_id()
        self._used: dict[str, Used] = {}
        self._compacted = 0
        """Bytes of the file when it was last written as a whole."""
        self._whole = True
        """Whether the next change writes the whole file: there is none, or it cannot be added to."""
        try:
            self._used = self._read()
        except (
            OSError,
            ValueError,
            LookupError,
            TypeError,
            AttributeError,
            ArithmeticError,
        ) as problem:
            self.damage = f"{path} cannot be read ({problem})"
            self._used = {name: Used(damaged=True) for name in names}
            with suppress(OSError):  # for inspection; the file itself is replaced by the first reset
                path.with_suffix(".damaged").unlink(missing_ok=True)
                files.publish_new(path, path.with_suffix(".damaged"))

    def of(self, tool: str) -> Used:
        """The counters of a tool."""
        return self._used.get(tool) or Used()

    def put(self, tool: str, used: Used) -> None:
        """Keep what a tool has used now; CountersUnwritable, and nothing changed, when it cannot be written."""
        if self._whole:
            self._replace({**self._used, tool: used})
        else:
            size = self._append(self._line(tool, used, self._used.get(tool)))
            self._whole = size > max(_COMPACT_BYTES, 2 * self._compacted)
        self._used[tool] = used

    def reset(self, tool: str | None) -> None:
        """Reset the counters of one tool or of all; CountersUnwritable when the file cannot be replaced."""
        used = {} if tool is None else {name: item for name, item in self._used.items() if name != tool}
        self._replace(used)
        self._used = used
        if not any(item.damaged for item in used.values()):
            self.damage = ""

    def _line(self, tool: str, used: Used, before: Used | None = None) -> bytes:
        """All that a tool has used; after a line with ``before``, the moments only as far as they are new.

        ``kept`` is how many of the moments count, the latest ones.
        """
        kept = len(used.calls)
        calls, more = used.calls, {}
        if before is not None and kept and used.calls[:-1] == before.calls[len(before.calls) - kept + 1 :]:
            calls, more = used.calls[-1:], {"kept": kept}
        document = {
            "tool": tool,
            "boot": self._boot,
            "wall": self._wall(),
            "clock": self._clock(),
            "sums": {name: str(value) for name, value in used.sums.items()},
            "last": {name: str(value) for name, value in used.last.items()},
            "calls": calls,
            "damaged": used.damaged,
            **(
                {"doubts": {name: [str(low), str(high)] for name, (low, high) in used.doubts.items()}}
                if used.doubts
                else {}
            ),
            **({"outside": dict(used.outside)} if used.outside else {}),
            **more,
        }
        return _encoded(document)

    def _append(self, line: bytes) -> int:
        """Add a line and give back the file's size; a line that the disk took only in part is taken back."""
        try:
            descriptor = os.open(self._path, _APPEND, 0o600)
            try:
                written = os.write(descriptor, line)
                size = os.lseek(descriptor, 0, os.SEEK_END)
                if written != len(line):
                    self._whole = True
                    os.ftruncate(descriptor, size - written)
                    raise CountersUnwritable(f"{self._path} cannot be written: the disk is full")
            finally:
                os.close(descriptor)
        except OSError as problem:
            raise self._unwritable(problem) from problem
        return size

    def _replace(self, used: Mapping[str, Used]) -> None:
        data = b"".join([_encoded(HEADER), *(self._line(name, item) for name, item in used.items())])
        try:
            private_folder(self._path.parent)
            files.replace(self._path, data, synced=False)
        except OSError as problem:
            raise self._unwritable(problem) from problem
        self._whole, self._compacted = False, len(data)

    def _unwritable(self, problem: OSError) -> CountersUnwritable:
        if isinstance(problem, CountersUnwritable):
            return problem
        return CountersUnwritable(f"{self._path} cannot be written: {problem.strerror or problem}")

    def _read(self) -> dict[str, Used]:
        try:
            lines = files.read(self._path, _LARGEST, follow=False).split(b"\n")
        except FileNotFoundError:
            return {}
        if lines.pop() or not lines or files.parse(lines[0]) != HEADER:
            raise ValueError("it is cut off, or of another format")
        latest: dict[str, Mapping[str, Any]] = {}
        moments: dict[str, list[float]] = {}
        for item in map(files.parse, lines[1:]):
            name = str(item["tool"])
            shift = self._shift(str(item["boot"]), float(item["wall"]), float(item["clock"]))
            calls = [float(moment) + shift for moment in item["calls"]]
            if "kept" in item:
                moments[name] += calls
            else:
                moments[name] = calls
            latest[name] = item
        used = {name: self._of(item, moments[name]) for name, item in latest.items()}
        self._whole = False
        if any(item.damaged for item in used.values()):
            self.damage = f"{self._path} had been damaged"
        return used

    def _of(self, item: Mapping[str, Any], moments: list[float]) -> Used:
        """The counters in the last line of a tool, with the moments of all its lines."""
        kept, now = int(item.get("kept", len(moments))), self._clock()
        if not 0 <= kept <= len(moments):
            raise ValueError("it has lost moments of calls")
        calls = tuple(sorted(min(now, moment) for moment in moments[len(moments) - kept :]))
        sums, last = ({key: Fraction(value) for key, value in item[name].items()} for name in ("sums", "last"))
        doubts = {key: (Fraction(low), Fraction(high)) for key, (low, high) in item.get("doubts", {}).items()}
        outside = {str(unit): str(text) for unit, text in item.get("outside", {}).items()}
        return Used(sums, last, calls, bool(item["damaged"]), doubts, outside)

    def _shift(self, boot: str, wall: float, clock: float) -> float:
        """The offset from the file's moments to those of the present clock, in seconds."""
        if boot and boot == self._boot and clock <= self._clock():
            return 0.0
        return self._clock() - max(0.0, self._wall() - wall) - clock


def _encoded(document: Mapping[str, Any]) -> bytes:
    return json.dumps(document).encode("ascii") + b"\n"


class Ledger:
    """The limits of a policy and what is used of them. Safe to use from threads.

    ``path`` is the file of the counters. ``clock`` gives seconds that never jump back, ``now`` the local wall clock.
    """

    def __init__(
        self,
        policy: Policy,
        path: Path,
        clock: Callable[[], float] = time.monotonic,
        now: Callable[[], datetime] = datetime.now,
    ) -> None:
        self._tools, self._shadow = policy.tools, policy.mode == "shadow"
        self._clock, self._times = clock, (clock, now)
        self._lock = threading.Lock()
        counted = {name for name, tool in policy.tools.items() if any(item.is_counted for item in tool.limits)}
        counted |= {name for name, tool in policy.tools.items() if tool.places}
        self._counters = Counters(path, counted, clock, lambda: now().timestamp())
        self._summing = {name for name, tool in policy.tools.items() if any(item.sum for item in tool.limits)}
        self._outside = {name: dict(self._counters.of(name).outside) for name in sorted(counted)}
        """By the tool that moved them: the units whose device reports a place outside of their range, in words."""
        self._zeroed: dict[str, set[tuple[str, str]]] = {}
        """Tool to the (tool, sum) pairs that begin again at zero once a call of it went well."""
        for name, item in policy.tools.items():
            for limit in item.limits:
                if limit.zero:
                    self._zeroed.setdefault(limit.zero, set()).add((name, limit.sum))

    def judge(self, tool: str, arguments: Mapping[str, Any]) -> Refusal | None:
        """Whether the call would be let through now; counts nothing."""
        with self._lock:
            return self._judged(tool, arguments)

    def reserve(self, tool: str, arguments: Mapping[str, Any]) -> Refusal | None:
        """Judge the call and, where it is let through, count it: None means that it may go on, and has counted."""
        with self._lock:
            refusal = self._judged(tool, arguments)
            if refusal is not None:
                return refusal
            limits = self._tools[tool].limits
            if not any(limit.is_counted for limit in limits):
                return None
            try:
                self._counters.put(tool, self._after(self._call(tool, arguments), limits))
            except CountersUnwritable as problem:
                return Refusal("counters_unwritable", f"{tool} is refused: {problem}. Its limits could not be kept.")
            return None

    def hold(self, tool: str, outside: Mapping[str, str]) -> bool:
        """Let nothing move these units of a tool any more until a person sets the tool back; it has moved them.

        False in shadow mode, which holds nothing. What cannot be written holds as long as this process lives.
        """
        if self._shadow:
            return False
        with self._lock, suppress(CountersUnwritable):
            self._outside.setdefault(tool, {}).update(outside)
            self._counters.put(tool, replace(self._counters.of(tool), outside=dict(self._outside[tool])))
        return True

    def settle(self, tool: str, arguments: Mapping[str, Any], *, well: bool) -> None:
        """A call that counted has ended. After one that went well, sums that it brings to their origin are zero.

        One that failed may have moved the device, wholly or in part, or not at all, and from then on all of it is
        reckoned with, also on the way to the origin. What cannot be written stays as it was for a sum that should be
        zero: that refuses too much rather than too little.
        """
        if tool not in self._zeroed and (well or tool not in self._summing):
            return
        with self._lock, suppress(CountersUnwritable):
            if not well and tool in self._summing:
                self._counters.put(tool, self._doubted(self._counters.of(tool), self._tools[tool].limits, arguments))
            for name, key in sorted(self._zeroed.get(tool, ())):
                used = self._counters.of(name)
                if not used.damaged and (used.sums.get(key) or key in used.doubts):
                    self._counters.put(name, _at_zero(used, key) if well else _near_zero(used, key))

    @staticmethod
    def _doubted(used: Used, limits: tuple[Kind, ...], arguments: Mapping[str, Any]) -> Used:
        doubts = dict(used.doubts)
        summed = [limit for limit in limits if limit.sum and isinstance(limit, OfValue)]
        # Shadow mode lets calls run that no sum has counted, with arguments that are no numbers.
        counted = [limit for limit in summed if is_number(arguments.get(limit.parameter, 0))]
        for key, value in {(limit.sum, limit.value(arguments)) for limit in counted}:
            low, high = doubts.get(key, (Fraction(0), Fraction(0)))
            if value is not None:
                doubts[key] = (low + max(value, Fraction(0)), high - min(value, Fraction(0)))
        return replace(used, doubts=doubts)

    def reset(self, tool: str | None) -> None:
        """Forget what was counted for a tool, or for all: sums, last values, times. Makes a damaged file good.

        KeyError for a tool that is not in the policy; OSError when the file cannot be written.
        """
        if tool is not None and tool not in self._tools:
            raise KeyError(tool)
        with self._lock:
            self._counters.reset(tool)
            for name in self._outside if tool is None else (tool,):
                self._outside[name] = {}

    def used(self) -> dict[str, dict[str, Any]]:
        """For each tool with counted limits, as plain values: ``sums`` and ``last`` by parameter, ``calls`` (the ages
        of its counted calls in seconds), ``damaged``."""
        with self._lock:
            return {name: self._counters.of(name).shown(self._clock()) for name in sorted(self._counters.names)}

    def held(self) -> dict[str, dict[str, str]]:
        """By tool: the units that nothing moves, because the device reported them outside of their range."""
        with self._lock:
            return {name: dict(units) for name, units in self._outside.items() if units}

    def _judged(self, tool: str, arguments: Mapping[str, Any]) -> Refusal | None:
        policy = self._tools.get(tool)
        if policy is None:
            return Refusal("unknown_tool", f"{cut(ascii(tool))} is not in the policy of this endpoint")
        if (beyond := self._beyond(policy, arguments)) is not None:
            return beyond
        if not policy.limits:
            return None
        used = self._counters.of(tool)
        if used.damaged:
            text = (
                f"{tool} is refused: {self._counters.damage}, so what was counted for its limits is not known. "
                f"A person looks at the device and then sets it back: octoform limits -reset {tool}"
            )
            return Refusal("counters_damaged", text)
        call = Call(tool, arguments, used, policy.units, self._times)
        found = [refusal for limit in policy.limits if (refusal := limit.refusal(call)) is not None]
        texts = list(dict.fromkeys(item.text for item in found))
        return Refusal(found[0].code, " ".join(texts)) if found else None

    def _beyond(self, policy: ToolPolicy, arguments: Mapping[str, Any]) -> Refusal | None:
        """The refusal of a call of a unit that its device last reported outside of its range."""
        if policy.effect == "read" or policy.ends:
            return None
        for name, units in self._outside.items():
            other = self._tools[name]
            if not units or set(other.buses).isdisjoint(policy.buses):
                continue
            for unit, text in units.items():
                words = {unit, *(other.units.names[unit] if other.units and unit in other.units.names else ())}
                if policy.units is None or policy.units.acts_on(words, arguments):
                    return Refusal("reported", f"{beyond_text(name, unit, text)}.")
        return None

    def _call(self, tool: str, arguments: Mapping[str, Any]) -> Call:
        return Call(tool, arguments, self._counters.of(tool), self._tools[tool].units, self._times)

    @staticmethod
    def _after(call: Call, limits: tuple[Kind, ...]) -> Used:
        """The counters once this call counts."""
        used, now = call.used, call.clock()
        timed = [limit for limit in limits if limit.seconds]
        span = max((limit.seconds for limit in timed), default=0.0)
        calls = [moment for moment in used.calls if now - moment < span] + [now] * bool(timed)
        kept = max((limit.calls for limit in timed), default=0) or 1
        counters = Kept(used)
        for limit in limits:
            limit.count(call, counters)
        return replace(used, sums=counters.sums, last=counters.last, calls=tuple(calls[-kept:]))


def beyond_text(tool: str, unit: str, text: str) -> str:
    """Why a unit moves no more, and what ends that."""
    return (
        f"after a call of {tool} the device reported {unit} {text}; nothing moves it until a person has looked at it "
        f"and runs: octoform limits -reset {tool}"
    )


def _at_zero(used: Used, key: str) -> Used:
    doubts = {other: doubt for other, doubt in used.doubts.items() if other != key}
    return replace(used, sums={**used.sums, key: Fraction(0)}, doubts=doubts)


def _near_zero(used: Used, key: str) -> Used:
    """Somewhere between where it may have been and zero."""
    total = used.sums.get(key, Fraction(0))
    low, high = used.doubts.get(key, (Fraction(0), Fraction(0)))
    doubt = (total - min(total - low, Fraction(0)), max(total + high, Fraction(0)) - total)
    return replace(used, doubts={**used.doubts, key: doubt})
