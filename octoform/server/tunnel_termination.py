"""End the tunnel and find proof that it is gone. Standard library only; also a program, for when no process serves.

    python -m octoform.server.tunnel_termination RUN-FOLDER

Exactly what this host's endpoint started is ended: the leader, known by its pid, start time and boot, all that is below
it or in its group, and whatever bears the leader's mark, in any group and under any parent. The
proof has two parts: none of these lives, and the public address no longer answers with this endpoint's identity, which
it was seen to do before. Silence of an address that was never heard proves nothing.
"""

import http.client
import json
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from octoform.base import clock, processes
from octoform.base.files import make_way, parse, read_json, replace
from octoform.base.place import KEY, is_from, place_of
from octoform.base.processes import ProcessStat, process_stat

RECORD = "tunnel.json"
REVOKED = "tunnel-revoked.json"
MARK = "OCTOFORM_TUNNEL"
INSTANCE_HEADER = "Octoform-Instance"
"""The header by which the door can be distinguished from whatever else answers at an address."""
GRACE_SECONDS = 3.0
"""Seconds that the program has for its own end before it is killed."""
PROOF_SECONDS = 12.0
"""How long the address may go on answering (a provider's edge takes a moment) before the proof fails."""
_ASK_SECONDS = 3.0
_MAX_BYTES = 65_536
_PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Proof:
    """The proof of a revocation. ``answered_before``: the address answered just before; ``known``: it ever did.

    These and ``answers`` are None when no address is known. ``proved``: the processes are gone, and an address that is
    known to lead here answers no more.
    """

    pid: int | None
    url: str | None
    was_running: bool
    process_gone: bool
    answered_before: bool | None
    known: bool | None
    answers: bool | None
    proved: bool
    seconds: float


def revoke(run: Path) -> Proof:
    """Forbid the tunnel until a person starts it again, end it, prove it. OSError when the mark cannot be written."""
    began = time.monotonic()
    forbid(run)
    record = read(run)
    if record is None:
        return Proof(None, None, False, True, None, None, None, True, 0.0)
    pid, url = int(record["pid"]), record["url"]
    before = None if url is None else answers(url, record["instance"])
    known = None if url is None else before or record.get("answered") is True
    if before:
        publish(run, {**record, "answered": True})
    was_running = end(record)
    gone = not list(members(record))
    after = None if url is None else _still_answers(url, record["instance"])
    proved = gone and not after and known is not False
    return Proof(pid, url, was_running, gone, before, known, after, proved, round(time.monotonic() - began, 1))


def publish(run: Path, record: Mapping[str, Any]) -> None:
    """Write the record; that its address once answered is never forgotten."""
    former = read(run)
    if former is not None and former["mark"] == record["mark"] and former["url"] == record["url"]:
        record = {**record, "answered": record.get("answered") is True or former.get("answered") is True}
    make_way(run / RECORD)
    replace(run / RECORD, json.dumps({**record, KEY: place_of(run)}, indent=1).encode())


def forbid(run: Path) -> None:
    """Let no tunnel start from now on."""
    text = json.dumps({"format": 1, "since": clock.stamp()})
    make_way(run / REVOKED)
    replace(run / REVOKED, text.encode())


def forbidden(run: Path) -> bool:
    """True while the tunnel is revoked."""
    return (run / REVOKED).exists()


def read(run: Path) -> dict[str, Any] | None:
    """The record of the tunnel that was started last; None when there is none, or it is none of ours."""
    try:
        record = read_json(run / RECORD, follow=False)
        int(record["pid"]), int(record["start"]), str(record["instance"]), str(record["mark"]), str(record["boot"])
        fits = record["url"] is None or isinstance(record["url"], str)
        return record if fits and is_from(record, run) else None
    except (OSError, ValueError, LookupError, TypeError):
        return None


def end(record: Mapping[str, Any]) -> bool:
    """End what belongs to the record: SIGTERM, then SIGKILL; True when there was something to end."""
    if not list(members(record)):
        return False
    _signal(record, signal.SIGTERM)
    if not _gone_within(record, GRACE_SECONDS):
        _signal(record, signal.SIGKILL)
        _gone_within(record, GRACE_SECONDS)
    return True


def members(record: Mapping[str, Any]) -> Iterator[int]:
    """The live processes that are proved to be the record's, in whatever group or session they are."""
    if record["boot"] != clock.boot_id():
        return
    leader, mark = int(record["pid"]), str(record["mark"])
    found = {int(entry.name): _stat(int(entry.name)) for entry in _PROC.iterdir() if entry.name.isdigit()}
    alive = {pid: stat for pid, stat in found.items() if stat is not None}
    ours: set[int] = set()
    if leader in alive and alive[leader].start == record["start"]:
        ours = {pid for pid, stat in alive.items() if stat.group == leader}
        more = {leader}
        while more:
            ours |= more
            more = {pid for pid, stat in alive.items() if stat.parent in ours} - ours
    for pid in sorted(alive):
        if pid in ours or processes.bears(pid, mark, MARK):
            yield pid


def answers(url: str, instance: str) -> bool:
    """True when the server that answers at ``url`` is the endpoint with this instance id, whatever it answers.

    The endpoint's door refuses the name of a revoked address at once, and a refusal that comes through the tunnel shows
    that the tunnel is there. So every answer of the door bears the id, and these two bear it in their body as well,
    because there are tunnels that pass on no header which they do not know.
    """
    parts = urlsplit(url)
    host = parts.hostname or ""
    kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
    # Names below localhost are this machine, whatever a resolver answers (RFC 6761).
    connection = kind("127.0.0.1" if host.endswith(".localhost") else host, parts.port, timeout=_ASK_SECONDS)
    try:
        connection.request("GET", "/health", headers={"Host": parts.netloc, "Connection": "close"})
        answer = connection.getresponse()
        if answer.getheader(INSTANCE_HEADER) == instance:
            return True
        fields = parse(answer.read(_MAX_BYTES))
        return isinstance(fields, dict) and fields.get("instance") == instance
    except (OSError, http.client.HTTPException, ValueError):
        return False
    finally:
        connection.close()


def _still_answers(url: str, instance: str) -> bool:
    """Ask until it is silent twice in a row; True when it never was."""
    deadline = time.monotonic() + PROOF_SECONDS
    silent = 0
    while silent < 2:
        silent = 0 if answers(url, instance) else silent + 1
        if time.monotonic() > deadline and silent == 0:
            return True
        time.sleep(0.2)
    return False


def _signal(record: Mapping[str, Any], number: signal.Signals) -> None:
    for pid in members(record):
        processes.signal_one(pid, processes.start_of(pid), number)


def _gone_within(record: Mapping[str, Any], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while list(members(record)):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def _stat(pid: int) -> ProcessStat | None:
    """The facts in /proc of a live process; None when there is none."""
    found = process_stat(pid, _PROC)
    return None if found is None or found.is_over else found


def main(run: Path) -> int:
    """Revoke and print the proof as one line of JSON; status 0 only when it is proved."""
    proof = revoke(run)
    print(json.dumps(asdict(proof)))
    return 0 if proof.proved else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
