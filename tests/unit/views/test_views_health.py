"""Health as a person reads it at night, and as a program does."""

import io
import json
from collections.abc import Iterable
from datetime import UTC, datetime, timedelta

import pytest

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.base.health_status import Status
from octoform.daemon.health import Health, Part
from octoform.daemon.model import FaultClass, Kind, Outcome
from octoform.daemon.notices import Failing
from octoform.daemon.status import OpenProblem, Survey
from octoform.daemon.store.incidents import Incident
from octoform.daemon.store.instance_lock import Record
from octoform.state.store.lock import myself
from octoform.views.daemon import event_log, requests
from octoform.views.daemon import health as health_view
from octoform.views.endpoint import logs
from octoform.views.format.console import Console
from octoform.views.format.values import clock, length

NOW = datetime.now(UTC)


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")


def stamp(seconds_ago: float) -> str:
    return (NOW - timedelta(seconds=seconds_ago)).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def console(*, colour: bool = False) -> tuple[Console, io.StringIO]:
    out = io.StringIO()
    return Console(out, io.StringIO(), colour=colour, colour_err=False, interactive=False), out


def episode(**changes: object) -> Incident:
    known = {
        "id": "e7",
        "kind": Kind.CRASH_LOOP,
        "fault": FaultClass.DEAD_PROCESS,
        "target": "endpoint",
        "key": "endpoint dead_process 12ab",
        "summary": "it ended 5 times in 60 s, each time soon after its start",
        "status": Status.DOWN,
        "boot": "b",
        "opened": stamp(7500),
        "opened_uptime": 100.0,
        "outcomes": [tried("restart", 7450, "ModuleNotFoundError: No module named 'cv2'")] * 3,
        "outcome": Outcome.FROZEN,
        "hint": "3 tries did not help",
    }
    return Incident(**{**known, **changes})  # type: ignore[arg-type]


def tried(repair: str, ago: int, why: str) -> RepairOutcome:
    """A repair that failed so many seconds ago."""
    return RepairOutcome.failed(f"{repair}.start", why, repair=repair, at=stamp(ago), seconds=1.2)


def survey(status: Status, parts: Iterable[Part] = (), **more: object) -> Survey:
    uncovered = tuple(each.target.removeprefix("unit:") for each in parts if each.target.startswith("unit:"))
    health = Health("bench", stamp(0), 1.0, status, tuple(parts), 14, uncovered, ("c1",))
    known = {"watched": Record(myself(), stamp(9000), 1.0, "1.0"), "looked": False, "age": 4.0}
    return Survey(health, **{**known, **more})  # type: ignore[arg-type]


def bad_night() -> Survey:
    frozen = OpenProblem(
        "endpoint",
        episode().summary,
        stamp(7500),
        episode(),
        "given up: 3 tries did not help",
        "fix the cause, then: octoform heal -retry endpoint",
    )
    gone = episode(
        target="device:usb-1", summary="usb-1 is not there", status=Status.DEGRADED, outcomes=[], outcome="open"
    )
    parts = [
        Part("endpoint", Status.DOWN, "its process does not run"),
        Part("device:usb-1", Status.DEGRADED, "it is not there"),
        Part("unit:arm_status/joints/elbow", Status.UNKNOWN, "does not report: switched off by hand"),
    ]
    return survey(
        Status.DOWN,
        parts,
        problems=(OpenProblem("device:usb-1", gone.summary, stamp(60), gone, "", "put it back"), frozen),
        todo=(("octoform confirm c3", "waits for a person: the elbow is locked"),),
        untold=(Failing("webhook", stamp(7400), "it answered with 404", 4),),
    )


def test_a_person_at_night_reads_it_in_one_screen() -> None:
    screen, out = console()
    assert health_view.health(screen, bad_night(), as_json=False, now=NOW) == 5
    lines = out.getvalue().splitlines()
    since, second, untold = clock(stamp(7500), NOW), clock(stamp(60), NOW), clock(stamp(7400), NOW)
    assert lines == [
        f"bench: DOWN since {since} (2 h 5 min): endpoint: its process does not run",
        "",
        "  endpoint",
        "    it ended 5 times in 60 s, each time soon after its start",
        f"    since  {since} (2 h 5 min)",
        "    tried  restart 3 times; the last one 2 h 4 min ago failed: ModuleNotFoundError: No module named 'cv2'",
        "    now    given up: 3 tries did not help",
        "    why    octoform incidents show e7",
        "    do     fix the cause, then: octoform heal -retry endpoint",
        "",
        "  device:usb-1",
        "    usb-1 is not there",
        f"    since  {second} (1 min)",
        "    do     put it back",
        "",
        "  cannot report (1), so nothing is known of it:",
        "    arm_status/joints/elbow  switched off by hand",
        "",
        "  octoform confirm c3  waits for a person: the elbow is locked",
        "",
        "  no signal is read while the endpoint is down; claims in force: c1 (octoform claims)",
        f"  watched by process {myself().pid} since {clock(stamp(9000), NOW)}; last look 4.0 s ago",
        f"  no one was notified by the webhook since {untold} (4 messages lost): it answered with 404",
        "  octoform explain DAEMON-NOT-NOTIFIED  what can be done about that",
    ]


@pytest.mark.parametrize(
    ("status", "code"),
    [(Status.HEALTHY, 0), (Status.DEGRADED, 3), (Status.ERROR, 4), (Status.DOWN, 5), (Status.UNKNOWN, 6)],
)
def test_the_exit_code_tells_in_both_forms(status: Status, code: int) -> None:
    for as_json in (False, True):
        screen, out = console()
        assert health_view.health(screen, survey(status), as_json=as_json) == code
    assert json.loads(out.getvalue())["status"] == status


def test_all_is_well_in_three_lines() -> None:
    screen, out = console()
    health_view.health(screen, survey(Status.HEALTHY), as_json=False)
    assert out.getvalue().splitlines()[0] == "bench: healthy"
    assert len(out.getvalue().splitlines()) == 4


def test_a_program_reads_all_of_it() -> None:
    screen, out = console()
    health_view.health(screen, bad_night(), as_json=True)
    document = json.loads(out.getvalue())
    assert document["format"] == 1
    assert document["uncovered"] == ["arm_status/joints/elbow"]
    assert [each["target"] for each in document["troubles"]] == ["device:usb-1", "endpoint"]
    assert document["troubles"][1]["episode"]["outcome"] == "frozen"
    assert document["todo"] == [{"command": "octoform confirm c3", "why": "waits for a person: the elbow is locked"}]
    assert document["untold"][0]["lost"] == 4
    assert document["watched"]["pid"] == myself().pid


def test_what_devices_say_is_bounded_and_escaped() -> None:
    hostile = "\x1b[2J" + "x" * 5000 + "\u202e"
    trouble = OpenProblem(hostile, hostile, hostile, episode(target=hostile, summary=hostile), hostile, hostile)
    parts = [Part("unit:" + hostile, Status.UNKNOWN, hostile), Part(hostile, Status.DOWN, hostile)] * 30
    found = survey(Status.DOWN, parts, problems=(trouble,) * 30, todo=((hostile, hostile),))
    screen, out = console()
    health_view.health(screen, found, as_json=False)
    assert "\x1b" not in out.getvalue()
    assert "\u202e" not in out.getvalue()
    assert len(out.getvalue()) < 60_000
    assert "and 18 more: octoform incidents" in out.getvalue()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.04, "0.0 s"),
        (9.94, "9.9 s"),
        (59, "59 s"),
        (60, "1 min"),
        (125, "2 min 5 s"),
        (7500, "2 h 5 min"),
        (90061, "1 d 1 h"),
    ],
)
def test_lengths(seconds: float, text: str) -> None:
    assert length(seconds) == text


def test_a_stamp_that_is_none_is_shown_as_it_is() -> None:
    assert clock("yesterday") == "yesterday"


def ended(number: int, seconds: float, outcome: Outcome = Outcome.REPAIRED) -> Incident:
    spent = Cost(1, 10, 5, 0.01)
    return episode(
        id=f"e{number}", closed=stamp(0), closed_uptime=100.0 + seconds, outcome=outcome, spent=spent, outcomes=[]
    )


def test_episodes_are_counted_by_kind() -> None:
    found = [ended(number, float(number)) for number in range(1, 21)]
    found += [ended(21, 500.0, Outcome.CLEARED), episode(id="e22"), episode(id="e23", kind=Kind.DISK_FULL)]
    screen, out = console()
    assert event_log.listed(screen, found, (), 2, as_json=True) == 0
    document = json.loads(out.getvalue())
    assert [each["kind"] for each in document["kinds"]] == ["crash_loop", "disk_full"]
    assert document["kinds"][0] == {
        "kind": "crash_loop",
        "count": 22,
        "repaired": 20,
        "cleared": 1,
        "open": 0,
        "frozen": 1,
        "surfaced": 0,
        "median_seconds": 11.0,
        "p95_seconds": 20.0,
        "agent_calls": 21,
    }
    assert [each["id"] for each in document["episodes"]] == ["e22", "e23"]
    screen, out = console()
    event_log.listed(screen, found, (), 2, as_json=False)
    assert "and 21 before: octoform incidents -n 23" in out.getvalue()


def test_uptimes_of_two_starts_of_the_machine_give_no_time() -> None:
    found = [episode(closed=stamp(0), closed_uptime=3.0, outcome=Outcome.CLEARED)]
    assert event_log.figures("crash_loop", found)["median_seconds"] is None


def test_nothing_ever_went_wrong() -> None:
    screen, out = console()
    event_log.listed(screen, (), (), 20, as_json=False)
    requests.listed(screen, (), everything=False, as_json=False)
    assert out.getvalue().count("\n") == 2


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("colour", [True, False])
def test_a_terminal_breaks_between_words_whatever_is_painted(colour: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    screen = Console(out := Terminal(), io.StringIO(), colour=colour, colour_err=False, interactive=False)
    lead, text = f"bench: {screen.paint('DEGRADED', 'bold', 'yellow')}: ", "nothing that moves is called " * 5
    screen.wrapped(lead, text.strip(), indent=4)
    printed = [
        line.replace(screen.paint("DEGRADED", "bold", "yellow"), "DEGRADED") for line in out.getvalue().splitlines()
    ]
    assert printed[0].startswith("bench: DEGRADED: nothing") and all(len(line) <= 60 for line in printed)
    assert " ".join(" ".join(printed).split()) == f"bench: DEGRADED: {text.strip()}"
    assert all(line.startswith("    nothing"[:4]) for line in printed[1:])


LONG_LINES = (
    "2 devices, 2 attached now, 47 skipped; -v shows reasons, evidence and serial numbers, none of them here",
    "  help: connect a camera and run octoform apply; a tool that takes a picture answers with image content",
    "  \x1b[36mhelp:\x1b[0m connect a camera and run octoform apply; a tool that takes a picture answers with an image",
)


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_no_sentence_breaks_a_word_on_a_terminal(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    screen = Console(out := Terminal(), err := Terminal(), colour=True, colour_err=True, interactive=False)
    for text in LONG_LINES:
        for write, stream in ((screen.line, out), (screen.problem, err)):
            stream.seek(0)
            stream.truncate()
            write(text)
            printed = stream.getvalue().splitlines()
            assert all(len(line.replace("\x1b[36m", "").replace("\x1b[0m", "")) <= columns for line in printed)
            assert " ".join(stream.getvalue().split()) == " ".join(text.split())
            indent = "        " if "help" in text else "  "
            assert all(line.startswith(indent) and line[len(indent)] != " " for line in printed[1:])
    out.seek(0)
    out.truncate()
    source = "12 | " + "model: a-model-that-does-not-exist " * 4
    screen.raw(copied := '{"a": "' + "word " * 40 + '"}')
    screen.problem(source)
    assert out.getvalue() == f"{copied}\n" and err.getvalue().endswith(f"{source}\n")


def test_the_audit_and_the_attempts_fit_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    screen = Console(out := Terminal(), io.StringIO(), colour=False, colour_err=False, interactive=False)
    made = {"seq": 4, "event": "decision", "decision": "allow", "tool": "read_network_interfaces", "caller": "local"}
    given = {"arguments": {"device": "usb-1f00-00b1-virtio-0001"}, "client": "octoform watch 0.1.0", "pid": 1, "uid": 0}
    days = [f"2026-11-{day}T21:32:06.4Z" for day in (25, 25, 26)]
    logs.records(screen, [{**made, **given, "time": day} for day in days], 3, as_json=False)
    lines = out.getvalue().splitlines()
    assert all(len(line) <= 80 for line in lines)
    assert [line for line in lines if line.startswith("2026")] == ["2026-11-25", "2026-11-26"]
    assert "     4  21:32:06Z  allowed     read_network_interfaces(" in lines
    assert lines[2].strip().startswith("device=usb-1f00-00b1-virtio-0001)")


def test_a_recorded_host_is_called_one() -> None:
    out = io.StringIO()
    console = Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)
    health_view.health(console, survey(Status.UNKNOWN, recorded="/hosts/x"), as_json=False)
    assert "The host is the recorded or simulated one in /hosts/x (OCTOFORM_SYSROOT)" in " ".join(
        out.getvalue().split()
    )
