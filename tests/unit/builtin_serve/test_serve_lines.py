"""Line protocols in the generated server: what goes out, what is taken for an answer, and when. No time passes."""

import re
import sys
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

import octoform.runtime
from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.serve.stage import render
from octoform.profiles import for_task, load_text
from octoform.runtime import DeviceFault

DEVICE = "usb-16c0-05df"
BOARD = {"id": DEVICE, "name": "lamp", "interface": "usb", "raw_descriptor": "product: Bench Lamp", "classes": ["tty"]}
LAMP = r"""---
name: bench-lamp
about: the lamp over the bench
evidence: {all: [{vid_pid: "16c0:05df"}, {text: [Bench Lamp]}]}
grammar:
  line: {class: tty, baud: 9600, ok: "OK.", error: "E({message})", timeout: 2s, settle: 1s}
  commands:
    - tool: lamp_dim
      send: 'DIM "{percent}" \ {fade} {count}'
      about: dim the lamp
      effect: actuate
      parameters:
        percent: {type: number, minimum: 0, maximum: 1000000000}
        fade: {type: string, enum: ["slow", 'f"s\t']}
        count: {type: integer, minimum: -9, maximum: 9}
    - tool: lamp_state
      send: "S?"
      about: state of the lamp
      effect: read
      reply: "S {celsius};{hours} {mode}"
      fields: {celsius: {type: number}, hours: {type: integer}, mode: {type: string, enum: [on, off]}}
    - tool: lamp_name
      send: "N?"
      about: what the owner called it
      effect: read
      reply: "N {label}"
      fields: {label: {type: string}}
---
It shines.
"""


@dataclass
class Bench:
    """The far end of the line and the clock: ``arriving`` are (moment, bytes), ``answers`` follow a written line."""

    now: float = 100.0
    arriving: list[tuple[float, bytes]] = field(default_factory=list)
    answers: list[tuple[float, bytes]] = field(default_factory=list)
    sent: list[tuple[float, bytes]] = field(default_factory=list)
    opened: list[dict[str, Any]] = field(default_factory=list)
    flags: int = 0o2000 | 0o4000
    fault: OSError | None = None

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class Port:
    """pyserial's port, as far as the server uses it."""

    fd = 7

    def __init__(self, bench: Bench, node: str, baud: int, **options: Any) -> None:
        bench.opened.append({"node": node, "baud": baud, **options})
        self._bench, self._timeout = bench, options["timeout"]

    def __enter__(self) -> "Port":
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def write(self, data: bytes) -> None:
        self._bench.sent.append((self._bench.now, data))
        if self._bench.fault:
            raise self._bench.fault
        self._bench.arriving += [(self._bench.now + delay, answer) for delay, answer in self._bench.answers]

    def read(self, count: int) -> bytes:
        """One byte at most; without one the timeout passes."""
        assert count == 1
        there = [item for item in self._bench.arriving if item[0] <= self._bench.now]
        if not there:
            self._bench.now += self._timeout
            return b""
        moment, data = there[0]
        self._bench.arriving[self._bench.arriving.index(there[0])] = (moment, data[1:])
        if len(data) == 1:
            self._bench.arriving.remove((moment, b""))
        return data[:1]

    def reset_input_buffer(self) -> None:
        self._bench.arriving = [item for item in self._bench.arriving if item[0] > self._bench.now]


Server = types.ModuleType


@pytest.fixture(scope="module")
def source() -> str:
    """A server of the lamp's tools."""
    profile, found = load_text(LAMP, "lamp")
    assert profile is not None, found
    task = [for_task(profile, {DEVICE})]
    named = identify({"devices": [BOARD]}, IdDatabases(Path("/nonexistent")), task)
    return render(declare(named, 30, task), task)


@pytest.fixture
def load(source: str, monkeypatch: pytest.MonkeyPatch) -> Callable[[Bench], Server]:
    def one(bench: Bench) -> Server:
        monkeypatch.setitem(sys.modules, "runtime", octoform.runtime)
        serial = types.SimpleNamespace(Serial=lambda *words, **options: Port(bench, *words, **options))
        monkeypatch.setitem(sys.modules, "serial", serial)
        server = types.ModuleType("server")
        exec(compile(source, "server.py", "exec"), server.__dict__)
        server.runtime = types.SimpleNamespace(device=_device, lines=octoform.runtime.lines)  # type: ignore[attr-defined]
        terminal = types.SimpleNamespace(
            HUPCL=0o2000,
            TCSANOW=0,
            error=ValueError,
            tcgetattr=lambda _: [0, 0, bench.flags],
            tcsetattr=lambda _fd, _when, settings: setattr(bench, "flags", settings[2]),
        )
        for name, value in {"time": bench, "termios": terminal, "_late": {}}.items():
            monkeypatch.setattr(octoform.runtime.lines, name, value)
        monkeypatch.setattr(octoform.runtime.counting, "attached", lambda _: 1)
        return server

    return one


def _device(name: str, actuate: bool = False) -> Any:
    @contextmanager
    def bus() -> Iterator[Any]:
        yield types.SimpleNamespace(node=lambda kind: f"/dev/{kind}{'!' if actuate else ''}")

    assert name == DEVICE
    return types.SimpleNamespace(bus=bus)


def test_values_go_out_as_they_are_described(load: Callable[[Bench], Server]) -> None:
    bench = Bench(answers=[(0.3, b"\r\nOK.\r\n")])
    done = load(bench).lamp_dim(percent=0.00001, fade='f"s\t'.replace("\t", "\\t"), count=-3)
    assert done == {"device": DEVICE, "command": bench.sent[0][1].decode().strip(), "answer": "OK."}
    assert bench.sent == [(101.0, b'DIM "0.000010" \\ f"s\\t -3\n')]
    assert bench.opened[0] == {
        "node": "/dev/tty!", "baud": 9600, "timeout": 0.1, "write_timeout": 2.0, "exclusive": True
    }  # fmt: skip
    assert bench.flags == 0o4000  # closing the line must not restart the board


@pytest.mark.parametrize("percent", [0, 1, 1e-7, 0.5, 123456.789, 1e9])
def test_no_number_is_written_in_a_way_that_firmware_misreads(load: Callable[[Bench], Server], percent: float) -> None:
    load(bench := Bench(answers=[(0, b"OK.\n")])).lamp_dim(percent=percent, fade="slow", count=9)
    assert re.fullmatch(rb'DIM "\d+\.\d{6}" \\ slow 9\n', bench.sent[0][1])


def test_answers_are_typed(load: Callable[[Bench], Server]) -> None:
    server = load(bench := Bench(answers=[(0, b"S -12.5e1;+7 off\n")]))
    assert server.lamp_state() == {"device": DEVICE, "celsius": -125.0, "hours": 7, "mode": "off"}
    assert bench.opened[0]["node"] == "/dev/tty"


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (b"S warm;7 on\n", "answered 'S?' with 'S warm;7 on', which its protocol definition does not know"),
        (b"S 1;7 broken\n", "which its protocol definition does not know"),
        (b"S 1;7.5 on\n", "which its protocol definition does not know"),
        (b"OK.\n", "which its protocol definition does not know"),
        (b"E(too \x1b[2Jhot)\n", r"refused 'S?': 'too \x1b[2Jhot'"),
        (b"x" * 5000 + b"\n", "with '" + "x" * 200 + "', which"),
        (b"S 1;7 on", "did not answer 'S?' within 2 s; it may still do it"),
        (b"\xff\xfe\n", r"with '\xff\xfe', which"),
        (b"S " + b"9" * 190 + b";7 on\n", "which its protocol definition does not know"),
    ],
)
def test_what_is_no_answer_is_an_error_that_shows_it(load: Callable[[Bench], Server], answer: bytes, told: str) -> None:
    with pytest.raises(DeviceFault) as problem:
        load(Bench(answers=[(0, answer)])).lamp_state()
    assert told in str(problem.value) and len(str(problem.value)) < 400


def test_a_late_answer_is_waited_for_and_thrown_away(load: Callable[[Bench], Server]) -> None:
    server = load(bench := Bench())
    with pytest.raises(DeviceFault, match="did not answer"):
        server.lamp_name()
    assert bench.now == pytest.approx(103.0, abs=0.2)
    bench.arriving.append((bench.now + 1.4, b"N the former one\n"))
    bench.answers = [(0.1, b"N Sun\n")]
    assert server.lamp_name()["label"] == "Sun"
    assert bench.sent[1][0] >= 104.4  # not before the late answer was there


def test_the_answer_behind_an_echo_is_not_taken_for_that_of_the_next_command(load: Callable[[Bench], Server]) -> None:
    server = load(bench := Bench(answers=[(0, b"N?\n"), (1.5, b"N the former one\n")]))
    with pytest.raises(DeviceFault, match="answered 'N\\?' with 'N\\?', which its protocol definition does not know"):
        server.lamp_name()
    bench.answers = [(1.9, b"N Sun\n")]
    assert server.lamp_name()["label"] == "Sun"


def test_an_answer_that_never_comes_is_waited_for_once(load: Callable[[Bench], Server]) -> None:
    server = load(bench := Bench())
    with pytest.raises(DeviceFault, match="did not answer"):
        server.lamp_name()
    bench.answers = [(0, b"N Sun\n")]
    server.lamp_name()
    before = bench.now
    server.lamp_name()
    assert bench.now - before == pytest.approx(1.0)  # the settling of the line alone


def test_chatter_before_the_command_is_no_answer(load: Callable[[Bench], Server]) -> None:
    bench = Bench(arriving=[(90.0, b"boot\nN Moon\n")], answers=[(0, b"N Sun\n")])
    assert load(bench).lamp_name()["label"] == "Sun"


def test_a_line_that_breaks_off_says_what_is_not_known(load: Callable[[Bench], Server]) -> None:
    server = load(Bench(fault=OSError(5, "gone")))
    with pytest.raises(DeviceFault, match=f"{DEVICE}: the device did not answer; whether it did 'N\\?' is not known"):
        server.lamp_name()
    assert octoform.runtime.lines._late == {}


def test_what_can_be_sent_stands_in_the_code(source: str) -> None:
    sent = re.findall(r'(?:line = |exchange\(device, )(f?"(?:[^"\\]|\\.)*")', source)
    assert len(sent) == 3 and all("\\n" not in text and "\\r" not in text for text in sent)
    assert '"pyserial>=3.5,<4"' in source.partition("\n# ///\n")[0]
