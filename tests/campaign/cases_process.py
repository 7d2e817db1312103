"""Faults of the endpoint's process and of the daemon's own."""

import json
import os
import signal
import subprocess
import time
from functools import partial

from campaign.bench import Bench, until
from campaign.model import QUIET, Case

from octoform.daemon.model import Kind, Repair
from octoform.state.store.lock import acquire

DEAD, HUNG, LOOP = Kind.PROCESS_DEAD, Kind.PROCESS_HUNG, Kind.CRASH_LOOP
_SLEEP = ["sleep", "3600"]


def end(bench: Bench, number: int = signal.SIGKILL) -> None:
    """Signal the endpoint's process."""
    found = bench.process()
    assert found is not None
    os.kill(found.pid, number)
    if number != signal.SIGSTOP:
        until(lambda: bench.process() != found, 5.0)


def _stand_still(bench: Bench) -> None:
    end(bench, signal.SIGSTOP)


def _in_a_call(bench: Bench) -> None:
    """Killed while a tool waits for its device."""
    sensor = bench.host.tree.root.glob("sys/class/hwmon/*/temp1_input")
    path = next(iter(sensor))
    path.write_text("200000\n")
    bench.undo.append(lambda: path.exists() and path.write_text("21500\n"))
    client = bench.project.start("call", "wait_for_sensor")
    bench.undo += [client.wait, client.kill]  # undone from the end: killed, then waited for
    log = bench.layout.call_log
    size = log.stat().st_size if log.exists() else 0
    until(lambda: log.exists() and log.stat().st_size > size, 20.0)
    end(bench)
    path.write_text("21500\n")  # the daemon reads that tool too once it is back


def _crashing_start(bench: Bench) -> None:
    """A library in the environment that ends the interpreter as soon as it starts."""
    (bench.packages() / "crash.pth").write_text("import os; os.kill(os.getpid(), 11)\n")
    end(bench)


def _crashing_soon(bench: Bench) -> None:
    """It comes up and ends four seconds after it was begun, at every start."""
    later = "threading.Timer(4.0, os.kill, (os.getpid(), 9)).start()"
    text = f"import threading, os, sys; {later} if 'serve.py' in ' '.join(sys.orig_argv) else None\n"
    (bench.packages() / "crash.pth").write_text(text)
    end(bench)


def _stale_record(bench: Bench) -> None:
    """The record names a live process that is not the endpoint."""
    record = bench.layout.run / "process.json"
    stranger = innocent(bench)
    end(bench)
    document = json.loads(record.read_bytes()) if record.exists() else {"format": 1}
    record.write_text(json.dumps({**document, "pid": stranger.pid}))


def innocent(bench: Bench) -> "subprocess.Popen[bytes]":
    """A process that must not be touched; `unharmed` detects its end."""
    stranger = subprocess.Popen(_SLEEP)
    bench.undo += [stranger.wait, stranger.kill]  # undone from the end: killed, then waited for
    bench.strays.append(stranger)
    return stranger


def unharmed(bench: Bench) -> bool:
    """The endpoint serves, and the last stranger lives."""
    assert bench.strays[-1].poll() is None, "a foreign process was ended"
    return bench.serves()


def _stale_daemon_record(bench: Bench) -> None:
    """The daemon is killed, its record names an innocent process, another daemon starts."""
    bench.end_daemon(signal.SIGKILL)
    stranger = innocent(bench)
    path = bench.layout.daemon / "daemon.json"
    path.write_text(json.dumps({**json.loads(path.read_bytes()), "pid": stranger.pid}))
    bench.watch()


def _daemon_term(bench: Bench) -> None:
    """SIGTERM ends it with nothing left behind; another one starts and notices."""
    bench.end_daemon()
    assert not bench.strangers(), "the daemon left processes"
    assert not (bench.layout.daemon / "daemon.json").exists(), "the daemon left its record"
    end(bench)
    bench.watch()


def _second_daemon(bench: Bench) -> None:
    """A second daemon is refused while the first repairs."""
    end(bench)
    done = bench.project.start("watch")
    out = done.communicate(timeout=30)
    assert done.returncode == 1 and "DAEMON-RUNNING" in "".join(out), out


def _daemon_killed_while_repairing(bench: Bench) -> None:
    """The daemon dies in the middle of a rebuild; another one starts."""
    for path in bench.packages().glob("annotated_types*"):
        subprocess.run(["rm", "-rf", str(path)], check=True)
    known = set(bench.episodes())
    until(lambda: set(bench.episodes()) - known, 10.0)
    time.sleep(0.3)
    bench.end_daemon(signal.SIGKILL)
    bench.watch()


def _in_sync(bench: Bench) -> bool:
    """It serves with all of its packages, and nothing is left to be done."""
    whole = any(bench.packages().glob("annotated_types"))
    return whole and bench.serves() and bench.project.run("plan", "-detailed-exitcode").status == 0


def _stopped_by_person(bench: Bench) -> None:
    bench.project.run("stop", status=0)


def _started_by_person(bench: Bench) -> None:
    bench.project.run("start", status=0)


def _latched(bench: Bench) -> None:
    bench.project.run("estop", "-reason", "campaign")
    bench.undo.append(lambda: bench.project.run("estop", "-clear"))


def _paused(bench: Bench) -> None:
    """While repairs are paused nothing is begun; it is when they are resumed."""
    bench.project.run("pause", status=0)
    bench.undo.append(lambda: bench.project.run("resume"))
    end(bench)
    time.sleep(2.0)
    assert bench.process() is None, "a paused daemon repaired"
    bench.project.run("resume", status=0)


def _five_times(bench: Bench) -> None:
    """Somebody kills it whenever all is well again, five times: a start that is killed at once is a failed one."""
    for _ in range(5):
        assert until(bench.ready, 60.0), f"it does not come back: {bench.said()}"
        end(bench)


def _applied_meanwhile(bench: Bench) -> None:
    """A person applies while the environment is built again: one of both waits or is refused, and neither is torn."""
    for path in bench.packages().glob("annotated_types*"):
        subprocess.run(["rm", "-rf", str(path)], check=True)
    known = set(bench.episodes())
    assert until(lambda: set(bench.episodes()) - known, 10.0), "it is not noticed"
    done = bench.project.run("apply", "-auto-approve")
    assert done.status == 0 or "LOCK" in done.text, done.text


def _at_work(bench: Bench) -> None:
    """Somebody holds the state (an apply) while the endpoint dies; nothing is begun until they are done."""
    lock = acquire(bench.layout, "apply").lock
    assert lock is not None
    with lock:
        end(bench)
        time.sleep(2.0)
        assert bench.process() is None, "the daemon interfered with an apply"


def _wall_clock(bench: Bench) -> None:
    """The daemon is suspended for a while, as by the machine's sleep."""
    assert bench.daemon is not None
    bench.daemon.send_signal(signal.SIGSTOP)
    end(bench)
    time.sleep(2.0)
    bench.daemon.send_signal(signal.SIGCONT)


def _nothing(bench: Bench) -> None:
    """Nothing happens: a quiet time, with a client that works."""
    assert bench.call("capture_image")[0]


_RESTART = frozenset({Repair.RESTART})
_DEAD = frozenset({DEAD, LOOP})
_again = partial(Case, kinds=_DEAD, repairs=_RESTART, detect=1.0, repair=5.0)
CASES = (
    _again("killed", end),
    _again("ended by SIGTERM of another", partial(end, number=signal.SIGTERM)),
    _again("segmentation fault", partial(end, number=signal.SIGSEGV)),
    _again("killed in the middle of a call", _in_a_call),
    Case("stands still (SIGSTOP)", _stand_still, frozenset({HUNG}), _RESTART, detect=10.0, repair=25.0),
    Case(
        "crashes at every start",
        _crashing_start,
        _DEAD | {Kind.PACKAGE_CONFLICT},  # a file that came into the environment is seen as such
        frozenset({Repair.RESTART, Repair.REBUILD}),
        repair=60.0,
        rows="F13",
    ),
    Case(
        "crashes soon after every start",
        _crashing_soon,
        _DEAD | {Kind.PACKAGE_CONFLICT},
        frozenset({Repair.RESTART, Repair.REBUILD}),
        right=lambda bench: bench.serves() and not (bench.packages() / "crash.pth").exists(),
        repair=90.0,
        rows="F13",
    ),
    _again("record names another process", _stale_record, right=unharmed, rows="F12a F12d"),
    Case("daemon's record names another process", _stale_daemon_record, ends=QUIET, right=unharmed, rows="F12b"),
    _again("daemon ended and started again", _daemon_term, rows="F12c"),
    _again("second daemon started during a repair", _second_daemon, rows="F22"),
    Case(
        "daemon killed in the middle of a repair",
        _daemon_killed_while_repairing,
        frozenset({Kind.PACKAGE_DAMAGED}),
        frozenset({Repair.REBUILD, Repair.RESTART}),
        right=lambda bench: bench.serves() and any(bench.packages().glob("annotated_types")),
        rows="F22",
    ),
    Case(
        "killed five times, whenever it is well again",
        _five_times,
        _DEAD,
        frozenset({Repair.RESTART, Repair.REBUILD}),
        repair=60.0,
    ),
    Case(
        "a person applies during a repair",
        _applied_meanwhile,
        frozenset({Kind.PACKAGE_DAMAGED}),
        frozenset({Repair.REBUILD, Repair.RESTART}),
        right=_in_sync,
        may_change=("state/bench/state.json",),
    ),
    Case("stopped by a person", _stopped_by_person, ends=QUIET, mend=_started_by_person, hold=3.0),
    Case("emergency stop", _latched, ends=QUIET, hold=3.0),
    _again("repairs paused, then resumed", _paused),
    _again("dies while an apply holds the state", _at_work),
    _again("daemon suspended meanwhile", _wall_clock),
    Case("a quiet time", _nothing, ends=QUIET, hold=5.0),
)
