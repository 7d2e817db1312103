"""One command of an agent, ended in time and let go of when it has ended, for programs that do neither themselves.

Such a program waits until no one holds the command's output any more, so whatever the command has left running holds
up the whole run. Its shell is replaced by this script, started as ``python -I -S bounded_command.py SECONDS PROGRAM
[ARGUMENT ...]`` (0 seconds: no limit). The command writes into pipes of this process, which passes on what comes and
leaves with the command itself, as it did: the same exit status or the same signal. It uses the standard library alone
and few modules of it, because it starts at every command.
"""

import os
import selectors
import signal
import subprocess
import sys
import time
from contextlib import suppress

PIECE_BYTES = 64 << 10
STEP_SECONDS = 0.02
GRACE_SECONDS = 2.0
LAST_PIECES = 64
"""What still is in a pipe at the end: its capacity, and a bound against what goes on writing."""
STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


class Command:
    """The command in a process group of its own, and when it has to be gone."""

    def __init__(self, seconds: float, argv: list[str]) -> None:
        self.process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, process_group=0)
        self._term_at = time.monotonic() + seconds if seconds else None
        self._kill_at: float | None = None
        self.late = False

    def end(self, *_: object) -> None:
        """Ask the whole group to end; who does not is killed a little later."""
        if self._kill_at is None:
            self._kill_at = time.monotonic() + GRACE_SECONDS
            self._send(signal.SIGTERM)

    def tick(self) -> bool:
        """Keep the limit; True when the command has ended."""
        now = time.monotonic()
        if self._term_at is not None and now > self._term_at and self._kill_at is None:
            self.late = True
            self.end()
        if self._kill_at is not None and now > self._kill_at:
            self._send(signal.SIGKILL)
        return self.process.poll() is not None

    def _send(self, number: int) -> None:
        # Not waited for yet, so its id cannot be another's.
        if self.process.returncode is None:
            with suppress(ProcessLookupError):
                os.killpg(self.process.pid, number)


def follow(command: Command) -> None:
    """Pass on what the command prints until it has ended."""
    ways = {stream.fileno(): to for stream, to in ((command.process.stdout, 1), (command.process.stderr, 2)) if stream}
    with selectors.DefaultSelector() as selector:
        for source in ways:
            os.set_blocking(source, False)
            selector.register(source, selectors.EVENT_READ)
        while not command.tick():
            if not selector.get_map():
                time.sleep(STEP_SECONDS)
            for key, _ in selector.select(STEP_SECONDS):
                if not passed_on(key.fd, ways[key.fd]):
                    selector.unregister(key.fd)
    for source, to in ways.items():
        rounds = LAST_PIECES
        while rounds and passed_on(source, to):
            rounds -= 1


def passed_on(source: int, to: int) -> bool:
    """Pass one piece on; False when there is none now, or never again."""
    try:
        data = os.read(source, PIECE_BYTES)
    except BlockingIOError:
        return False
    whole = bool(data)
    while data:
        data = data[os.write(to, data) :]
    return whole


def main(seconds: float, argv: list[str]) -> int:
    """Run it; its exit status, or minus the signal that it ended by."""
    command = Command(seconds, argv)
    for number in STOP_SIGNALS:
        signal.signal(number, command.end)
    with suppress(BrokenPipeError):  # no reader is left: it has to end all the same
        follow(command)
    while not command.tick():
        time.sleep(STEP_SECONDS)
    if command.late:
        os.write(2, f"[ended after {seconds:g} seconds, its limit]\n".encode())
    return command.process.returncode


if __name__ == "__main__":
    status = main(float(sys.argv[1]), sys.argv[2:])
    if status < 0:
        with suppress(OSError):  # the disposition of two signals cannot be changed
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    os._exit(abs(status))
