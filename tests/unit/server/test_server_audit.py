"""The audit log: whatever is done to it afterwards shows, and whatever happens to the process does not."""

import dataclasses
import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.server.audit import audit_log as module
from octoform.server.audit import chain
from octoform.server.audit.audit_log import Audit, AuditFailed, verify

ROOT = str(Path(module.__file__).parents[3])
CALL = {
    "id": "0123456789abcdef",
    "tool": "move_joint",
    "principal": "local",
    "decision": "allow",
    "source": "default for actuate tools",
    "effect": "actuate",
    "arguments": {"joint": 3, "position": 2048.5},
    "ms": 1.25,
}


def written(folder: Path, count: int, **more: Any) -> Audit:
    audit = Audit.open(folder, **more)
    for number in range(count):
        audit.write("call", number=number)
    return audit


def lines(folder: Path) -> list[bytes]:
    return (folder / "audit.jsonl").read_bytes().splitlines(keepends=True)


def records(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in lines(folder)]


def test_records_chain(tmp_path: Path) -> None:
    audit = Audit.open(tmp_path / "log")
    first, second = audit.write("call", **CALL), audit.write("refused", tool="x", text="snow \u2603 \ud800 \x00")
    assert audit.head == (2, second)
    found = records(tmp_path / "log")
    assert [(item["seq"], item["event"], item["prev"], item["hash"]) for item in found] == [
        (1, "call", "0" * 64, first),
        (2, "refused", first, second),
    ]
    assert found[0]["arguments"] == CALL["arguments"]
    assert found[1]["text"] == "snow \u2603 \ud800 \x00"
    assert (tmp_path / "log/audit.jsonl").read_bytes().isascii()
    verdict = verify(tmp_path / "log")
    assert (verdict.ok, verdict.records, verdict.seq, verdict.hash) == (True, 2, 2, second)
    assert {path.name: path.stat().st_mode & 0o777 for path in (tmp_path / "log").iterdir()} == {
        "audit.jsonl": 0o600,
        "audit.head": 0o600,
    }


def test_the_chain_goes_on_after_closing(tmp_path: Path) -> None:
    for count in (2, 3):
        written(tmp_path, count).close()
    assert [item["seq"] for item in records(tmp_path)] == [1, 2, 3, 4, 5]
    assert verify(tmp_path).ok
    closed = written(tmp_path, 0)
    closed.close()
    with pytest.raises(AuditFailed, match="closed"):
        closed.write("call")


def test_nothing_recorded_is_nothing_wrong(tmp_path: Path) -> None:
    assert verify(tmp_path).note == "nothing was recorded yet"
    Audit.open(tmp_path)
    assert dataclasses.astuple(verify(tmp_path))[:3] == (True, 0, 0)


def test_fields_are_bounded_and_secrets_left_out(tmp_path: Path) -> None:
    deep: Any = "end"
    for _ in range(2000):
        deep = {"in": deep}
    arguments = {
        "text": "x" * 100_000,
        "token": "hunter2",
        "wifi_password": "hunter2",
        "nested": [{"apiKey": "hunter2", "api_key": "hunter2"}],
        "many": list(range(10_000)),
        "deep": deep,
        "number": float("nan"),
        "big": 10**4000,
        "object": object(),
        "bytes": b"x" * 999,
        "none": None,
        "yes": True,
    }
    audit = Audit.open(tmp_path)
    audit.write("call", arguments=arguments)
    audit.write("call", **{f"field{number}": ["y" * 200] * 16 for number in range(100)})
    (line, wide), (found, abridged) = lines(tmp_path), records(tmp_path)
    assert len(line) < 4000 and len(wide) < 20_000
    assert b"hunter2" not in line
    assert found["arguments"]["text"] == "x" * 200 + "... (100000 characters)"
    assert found["arguments"]["token"] == "(omitted)"
    assert found["arguments"]["number"] == "nan"
    assert found["arguments"]["yes"] is True
    assert abridged["abridged"] is True
    assert verify(tmp_path).ok
    with pytest.raises(ValueError, match="its own seq"):
        audit.write("call", seq=7)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
WORDS = ['"event":"audit_rotated"', '"event":"audit_torn","bytes":1', '","prev":"0","hash":"1"}\n{"seq":1,"time":"']


@given(values=st.lists(json_values | st.sampled_from(WORDS), max_size=8), name=st.sampled_from(WORDS))
def test_no_text_breaks_the_log(tmp_path_factory: pytest.TempPathFactory, values: list[Any], name: str) -> None:
    folder = tmp_path_factory.mktemp("audit")
    audit = Audit.open(folder)
    for value in values:
        audit.write("call", arguments={"value": value, name: value, "event": "audit_rotated"})
    audit.close()
    Audit.open(folder).write("call")
    assert [item["event"] for item in records(folder)] == ["call"] * (len(values) + 1)
    assert verify(folder).ok


def change(found: list[bytes]) -> list[bytes]:
    return [*found[:4], found[4].replace(b'"number":4', b'"number":7'), *found[5:]]


def forge(found: list[bytes]) -> list[bytes]:
    """A change with a hash that fits the changed record itself."""
    match = chain.RECORD.fullmatch(found[4])
    assert match is not None
    body = match["body"].replace(b'"number":4', b'"number":7')
    line = body + b',"prev":"%s","hash":"%s"}\n' % (match["prev"], chain.rule(match["prev"], body).encode())
    return [*found[:4], line, *found[5:]]


TAMPERED: dict[str, tuple[Callable[[list[bytes]], list[bytes]], int, str]] = {
    "changed": (change, 5, "record 5 was changed"),
    "changed with a new hash": (forge, 6, "record 6 does not follow from the one before it: record 5 was changed"),
    "one space": (lambda found: [*found[:2], found[2].replace(b":", b": ", 1), *found[3:]], 3, "no record"),
    "removed": (lambda found: [*found[:3], *found[5:]], 4, "records 4 to 5 before record 6 went missing"),
    "first removed": (lambda found: found[1:], 1, "record 1 before record 2 went missing"),
    "added": (lambda found: [*found[:3], b'{"seq":4,"event":"call"}\n', *found[3:]], 4, "no record"),
    "doubled": (lambda found: [*found[:3], found[2], *found[3:]], 4, "record 3 comes after record 3"),
    "reordered": (lambda found: [*found[:3], found[4], found[3], *found[5:]], 4, "record 4 before record 5 went miss"),
    "cut off": (lambda found: found[:-2], 9, "records 9 to 10 went missing at the end: cut off"),
    "cut off within": (lambda found: [*found[:-1], found[-1][:-30]], 10, "record 10 went missing at the end"),
    "emptied": (lambda found: [], 1, "records 1 to 10 went missing at the end"),
    "garbage": (lambda found: [*found[:7], b"\xff\x00garbage\n", *found[7:]], 8, "no record"),
    "blank line": (lambda found: [*found[:7], b"\n", *found[7:]], 8, "no record"),
}


@pytest.mark.parametrize("how", TAMPERED)
def test_what_was_done_to_the_log_shows_with_its_line(tmp_path: Path, how: str) -> None:
    written(tmp_path, 10).close()
    tamper, line, text = TAMPERED[how]
    (tmp_path / "audit.jsonl").write_bytes(b"".join(tamper(lines(tmp_path))))
    verdict = verify(tmp_path)
    assert (verdict.ok, verdict.file, verdict.line) == (False, "audit.jsonl", line)
    assert text in verdict.problem
    Audit.open(tmp_path).write("call")
    assert verify(tmp_path).problem  # going on hides nothing


def test_a_lost_seal_shows_now_and_later(tmp_path: Path) -> None:
    written(tmp_path, 5).close()
    (tmp_path / "audit.head").unlink()
    assert verify(tmp_path).problem.startswith("the seal audit.head is missing")
    (tmp_path / "audit.jsonl").write_bytes(b"".join(lines(tmp_path)[:3]))
    Audit.open(tmp_path).write("call")
    verdict = verify(tmp_path)
    assert (verdict.ok, verdict.line) == (False, 4)
    assert "the seal was missing when record 4 was written" in verdict.problem


def test_a_log_that_was_written_anew_does_not_fit_its_seal(tmp_path: Path) -> None:
    written(tmp_path / "a", 5).close()
    other = Audit.open(tmp_path / "b")
    for _ in range(5):
        other.write("harmless")
    (tmp_path / "b/audit.jsonl").replace(tmp_path / "a/audit.jsonl")
    assert verify(tmp_path / "a").problem == "record 5 is not the one that was sealed: the log was written again"


def test_a_deleted_log_shows_although_the_process_goes_on(tmp_path: Path) -> None:
    audit = written(tmp_path, 5)
    (tmp_path / "audit.jsonl").unlink()
    audit.write("call")
    assert [item["seq"] for item in records(tmp_path)] == [6]
    assert verify(tmp_path).problem == "records 1 to 5 before record 6 went missing: removed or moved"


def test_a_log_cut_under_the_process_shows(tmp_path: Path) -> None:
    audit = written(tmp_path, 5)
    (tmp_path / "audit.jsonl").write_bytes(b"".join(lines(tmp_path)[:2]))
    audit.write("call")
    assert verify(tmp_path).problem == "records 3 to 5 before record 6 went missing: removed or moved"


def test_a_torn_line_is_closed_off_and_the_chain_goes_on(tmp_path: Path) -> None:
    written(tmp_path, 3).close()
    with (tmp_path / "audit.jsonl").open("ab") as log:
        log.write(b'{"seq":4,"time":"2026')
    assert verify(tmp_path).note.startswith("the last line is incomplete")
    audit = written(tmp_path, 1)
    assert audit.head[0] == 5
    torn = json.loads(lines(tmp_path)[4])
    assert (torn["event"], torn["seq"], torn["bytes"]) == ("audit_torn", 4, 21)
    assert verify(tmp_path).ok
    data = (tmp_path / "audit.jsonl").read_bytes()
    (tmp_path / "audit.jsonl").write_bytes(data.replace(b'{"seq":4,"time":"2026\n', b'{"seq":4,"time":"2027\n'))
    assert verify(tmp_path).line == 4


DYING = """
import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])
from octoform.server.audit.audit_log import Audit
audit = Audit.open(Path(sys.argv[2]))
print("ready", flush=True)
while True: audit.write("call", arguments={"x": "y" * 100})
"""


def test_a_killed_process_leaves_a_log_that_verifies(tmp_path: Path) -> None:
    for _ in range(3):
        command = [sys.executable, "-c", DYING, ROOT, str(tmp_path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
            assert process.stdout is not None and process.stdout.readline() == b"ready\n"
            before = (tmp_path / "audit.jsonl").stat().st_size
            while (tmp_path / "audit.jsonl").stat().st_size < before + 50_000:
                assert process.poll() is None
            process.send_signal(signal.SIGKILL)
        assert verify(tmp_path).ok
    assert verify(tmp_path).records > 100


WRITER = """
import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])
from octoform.server.audit.audit_log import Audit
audit = Audit.open(Path(sys.argv[2]), rotate_bytes=20_000)
for number in range(200): audit.write("call", by=sys.argv[3], number=number)
"""


def test_threads_and_processes_share_one_chain_through_rotations(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITER, ROOT, str(tmp_path)]
    processes = [subprocess.Popen([*command, str(one)]) for one in range(3)]
    audit = Audit.open(tmp_path, rotate_bytes=20_000)
    threads = [threading.Thread(target=lambda: [audit.write("call", by="t") for _ in range(100)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(process.poll() is None for process in processes):  # checking while it is written finds nothing wrong
        assert verify(tmp_path).ok
    for thread in threads:
        thread.join(60)
    assert [process.wait(60) for process in processes] == [0, 0, 0]
    verdict = verify(tmp_path)
    aside = sorted(path.name for path in tmp_path.glob("audit-*.jsonl"))
    assert (verdict.ok, verdict.records) == (True, 1000 + len(aside))
    assert len(aside) > 5 and aside[0] == "audit-000000000000001.jsonl"
    (tmp_path / aside[2]).unlink()
    assert verify(tmp_path).file == aside[3]
    assert "went missing" in verify(tmp_path).problem


def test_a_full_disk_is_told_and_leaves_no_fragment(tmp_path: Path) -> None:
    program = f"""
import sys; from pathlib import Path; sys.path.insert(0, {ROOT!r})
import resource, signal
from octoform.server.audit.audit_log import Audit, AuditFailed
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
audit = Audit.open(Path({str(tmp_path)!r}))
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, resource.RLIM_INFINITY))
told = 0
for number in range(40):
    try: audit.write("call", number=number)
    except AuditFailed as problem: told += 1
print(told)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
audit.write("after")
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert int(done.stdout) > 20
    assert records(tmp_path)[-1]["event"] == "after"
    verdict = verify(tmp_path)
    assert (verdict.ok, verdict.records + int(done.stdout)) == (True, 41)


def test_a_lock_that_nobody_gives_up_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import fcntl

    audit = written(tmp_path, 1)
    monkeypatch.setattr(module, "_LOCK_SECONDS", 0.05)
    with (tmp_path / "audit.jsonl").open("rb") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(AuditFailed, match="another process holds the log"):
            audit.write("call")
    audit.write("call")
    assert verify(tmp_path).records == 2


TRAPS: dict[str, Callable[[Path], object]] = {
    "a link": lambda path: path.symlink_to(path.parent.with_name("elsewhere")),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a pipe": os.mkfifo,
    "a folder": Path.mkdir,
}


@pytest.mark.parametrize("trap", TRAPS)
@pytest.mark.parametrize("name", ["log/audit.jsonl", "log/audit.head", "run/audit.head"])
@pytest.mark.parametrize("open_already", [True, False])
def test_what_stands_in_the_place_of_log_or_seal_is_set_aside_and_shows(
    tmp_path: Path, trap: str, name: str, open_already: bool
) -> None:
    log, witness, elsewhere = tmp_path / "log", tmp_path / "run/audit.head", tmp_path / "elsewhere"
    elsewhere.write_text("")
    audit = written(log, 3, witness=witness)
    if not open_already:
        audit.close()
    (tmp_path / name).unlink()
    TRAPS[trap](tmp_path / name)
    command = [sys.executable, "-I", "-S", chain.__file__, "verify", str(log), str(witness)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    if name == "log/audit.jsonl":
        assert (done.returncode, done.stderr) == (
            3,
            f"{log / 'audit.jsonl'}: the log cannot be read: it is no regular file\n",
        )
    else:
        assert done.returncode == (1 if name == "log/audit.head" else 0)
    if not open_already:
        audit = Audit.open(log, witness=witness)
    audit.write("call")
    audit.close()
    Audit.open(log, witness=witness).close()
    assert elsewhere.read_text() == "" and (tmp_path / name).is_file() and not (tmp_path / name).is_symlink()
    assert verify(log, witness).ok == (name == "run/audit.head")


def test_log_and_seal_cannot_go_together(tmp_path: Path) -> None:
    log, witness = tmp_path / "log", tmp_path / "run/audit.head"
    written(log, 5, witness=witness).close()
    assert (verify(log, witness).ok, witness.stat().st_mode & 0o777) == (True, 0o600)
    old = {path.name: path.read_bytes() for path in log.iterdir()}
    written(log, 2, witness=witness).close()
    for path in log.iterdir():
        path.write_bytes(old[path.name])  # an older copy, complete in itself
    assert verify(log).ok
    assert verify(log, witness).problem.startswith("records 6 to 7 went missing at the end: log and seal were taken")
    for path in log.iterdir():
        path.unlink()
    assert verify(log).ok
    assert verify(log, witness).problem.startswith("records 1 to 7 went missing at the end: log and seal were taken")
    command = [sys.executable, "-I", "-S", chain.__file__, "verify", str(log), str(witness)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, json.loads(done.stdout)) == (1, dataclasses.asdict(verify(log, witness)))
    written(log, 1, witness=witness).close()  # going on hides nothing
    assert not verify(log, witness).ok and "records 1 to 7 before record 8 went missing" in verify(log).problem


def test_a_log_of_the_same_length_does_not_fit_the_witness(tmp_path: Path) -> None:
    written(tmp_path / "log", 3, witness=tmp_path / "witness").close()
    for path in (tmp_path / "log").iterdir():
        path.unlink()
    other = Audit.open(tmp_path / "log")
    for _ in range(3):
        other.write("harmless")
    assert verify(tmp_path / "log").ok
    assert "the log was written again" in verify(tmp_path / "log", tmp_path / "witness").problem


def test_a_log_from_before_there_was_a_witness_goes_on(tmp_path: Path) -> None:
    written(tmp_path / "log", 3).close()
    assert verify(tmp_path / "log", tmp_path / "witness").ok
    written(tmp_path / "log", 1, witness=tmp_path / "witness").close()
    assert verify(tmp_path / "log", tmp_path / "witness").records == 4


@pytest.mark.parametrize("name", ["audit.jsonl", "audit.head"])
def test_nothing_is_written_into_what_took_the_number_of_a_file(tmp_path: Path, name: str) -> None:
    """A tool closed a descriptor twice, so a device got the number of the log."""
    audit = written(tmp_path / "log", 2)
    links = {str(each.readlink()): int(each.name) for each in Path("/proc/self/fd").iterdir() if each.is_symlink()}
    number = links[str(tmp_path / "log" / name)]
    with (tmp_path / "device").open("w+b") as device:
        os.dup2(device.fileno(), number)
        try:
            audit.write("call", number=2)
            audit.close()
            assert os.fstat(number).st_ino == os.fstat(device.fileno()).st_ino  # not ours to close
            assert device.read() == b""
        finally:
            os.close(number)
    verdict = verify(tmp_path / "log")
    assert (verdict.ok, verdict.records) == (True, 3)


def test_a_descriptor_that_was_closed_is_opened_anew(tmp_path: Path) -> None:
    audit = written(tmp_path, 1)
    for each in Path("/proc/self/fd").iterdir():
        if each.is_symlink() and str(each.readlink()).startswith(str(tmp_path)):
            os.close(int(each.name))
    audit.write("call", number=1)
    assert verify(tmp_path).records == 2


def test_the_program_tells_the_same(tmp_path: Path) -> None:
    written(tmp_path, 4)
    command = [sys.executable, "-I", "-S", chain.__file__, "verify", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, json.loads(done.stdout)) == (0, dataclasses.asdict(verify(tmp_path)))
    (tmp_path / "audit.jsonl").write_bytes(b"")
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, json.loads(done.stdout)["ok"]) == (1, False)


def test_a_record_costs_little_and_checking_is_quick(tmp_path: Path) -> None:
    audit, plain = Audit.open(tmp_path), os.open(tmp_path / "plain", os.O_WRONLY | os.O_CREAT | os.O_APPEND)

    def write_plainly() -> None:
        line = json.dumps(CALL).encode()
        hashlib.sha256(line).digest()
        os.write(plain, line)

    def spent(work: Callable[[], object]) -> float:
        begun = time.process_time()
        for _ in range(500):
            work()
        return time.process_time() - begun

    # The machine's other work makes most rounds dearer than they are. Measured: 7 times
    rounds = [(spent(lambda: audit.write("call", **CALL)), spent(write_plainly)) for _ in range(20)]
    os.close(plain)
    assert min(each for each, _ in rounds) < 15 * min(least for _, least in rounds)
    begun = time.process_time()
    assert verify(tmp_path).records == 10_000
    assert time.process_time() - begun < 0.5  # measured: 0.05 s
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 2_000_000
    assert (tmp_path / "audit.head").stat().st_size == 128
