"""End the tunnel and find proof that it is gone. Standard library only; also a program, for when no process serves.

    python -m octoform.launcher.revoking RUN-FOLDER

Exactly the process group that this host's endpoint started is ended, known by the leader's pid, start time and boot,
or, once the leader is gone, by a mark in the environment of what is left of the group. The proof has two parts: nothing
of the group lives, and the public address no longer answers with this endpoint's identity.
"""

import contextlib
import http.client
import json
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from .owner import boot, replace

RECORD = "tunnel.json"
REVOKED = "tunnel-revoked.json"
MARK = "OCTOFORM_TUNNEL"
INSTANCE_HEADER = "Octoform-Instance"
"""The header by which the door can be told from whatever else answers at an address."""
GRACE_SECONDS = 3.0
"""What the program has for its own end before it is killed."""
PROOF_SECONDS = 12.0
"""How long the address may go on answering (a provider's edge takes a moment) before the proof fails."""
_ASK_SECONDS = 3.0
_PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Proof:
    """What was found. ``answered_before`` tells whether the address could be reached from here at all.

    ``answers`` is None when no address is known. ``proved``: the group is gone, and the address answers no more.
    """

    pid: int | None
    url: str | None
    was_running: bool
    process_gone: bool
    answered_before: bool | None
    answers: bool | None
    proved: bool
    seconds: float


def revoke(run: Path) -> Proof:
    """Forbid the tunnel until a person starts it again, end it, prove it. OSError when the mark cannot be written."""
    began = time.monotonic()
    forbid(run)
    record = read(run)
    if record is None:
        return Proof(None, None, False, True, None, None, True, 0.0)
    pid, url = int(record["pid"]), record["url"]
    before = None if url is None else answers(url, record["instance"])
    was_running = end(record)
    gone = not list(members(record))
    after = None if url is None else _still_answers(url, record["instance"])
    proved = gone and not after
    return Proof(pid, url, was_running, gone, before, after, proved, round(time.monotonic() - began, 1))


def forbid(run: Path) -> None:
    """Let no tunnel start from now on."""
    text = json.dumps({"format": 1, "since": datetime.now(UTC).isoformat(timespec="seconds")})
    replace(run / REVOKED, text.encode())


def forbidden(run: Path) -> bool:
    """True while the tunnel is revoked."""
    return (run / REVOKED).exists()


def read(run: Path) -> dict[str, Any] | None:
    """The record of the tunnel that was started last; None when there is none, or it is none of ours."""
    try:
        record = json.loads((run / RECORD).read_bytes())
        int(record["pid"]), int(record["start"]), str(record["instance"]), str(record["mark"]), str(record["boot"])
        return record if record["url"] is None or isinstance(record["url"], str) else None
    except (OSError, ValueError, LookupError, TypeError):
        return None


def end(record: Mapping[str, Any]) -> bool:
    """End the group of the record: SIGTERM, then SIGKILL; True when there was something to end."""
    if not list(members(record)):
        return False
    _signal(record, signal.SIGTERM)
    if not _gone_within(record, GRACE_SECONDS):
        _signal(record, signal.SIGKILL)
        _gone_within(record, GRACE_SECONDS)
    return True


def members(record: Mapping[str, Any]) -> Iterator[int]:
    """The live processes of the record's group that are proved to be ours."""
    group = int(record["pid"])
    if record["boot"] != boot():
        return
    ours = _stat(group)[1] == record["start"]
    for pid in [int(entry.name) for entry in _PROC.iterdir() if entry.name.isdigit()]:
        if _stat(pid)[0] == group and (ours or _marked(pid, str(record["mark"]))):
            yield pid


def answers(url: str, instance: str) -> bool:
    """True when whoever answers at ``url`` is the endpoint with this instance id, whatever it answers.

    The endpoint's door refuses the name of a revoked address at once, and a refusal that comes through the tunnel shows
    that the tunnel is there. So every answer of the door bears the id.
    """
    parts = urlsplit(url)
    host = parts.hostname or ""
    kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
    # Names below localhost are this machine, whatever a resolver says (RFC 6761).
    connection = kind("127.0.0.1" if host.endswith(".localhost") else host, parts.port, timeout=_ASK_SECONDS)
    try:
        connection.request("GET", "/health", headers={"Host": parts.netloc, "Connection": "close"})
        return connection.getresponse().getheader(INSTANCE_HEADER) == instance
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
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(pid, number)


def _gone_within(record: Mapping[str, Any], seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while list(members(record)):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def _stat(pid: int) -> tuple[int | None, int | None]:
    """Process group and start time (clock ticks since boot) of a live process; two None when there is none."""
    try:
        text = (_PROC / str(pid) / "stat").read_text(errors="replace")
        fields = text[text.rindex(")") + 2 :].split()
        return (None, None) if fields[0] in "ZX" else (int(fields[2]), int(fields[19]))
    except (OSError, ValueError, IndexError):
        return None, None


def _marked(pid: int, mark: str) -> bool:
    try:
        return f"{MARK}={mark}".encode() in (_PROC / str(pid) / "environ").read_bytes().split(b"\0")
    except OSError:
        return False


def main(run: Path) -> int:
    """Revoke and print the proof as one line of JSON; status 0 only when it is proved."""
    proof = revoke(run)
    print(json.dumps(asdict(proof)))
    return 0 if proof.proved else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
