"""octoform on a pseudo terminal, as a person has it in front of them."""

import fcntl
import os
import pty
import subprocess
import termios
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import pyte
import warm
from projects import OCTOFORM

LINES, COLUMNS = 40, 100


class Terminal:
    """A command on a pseudo terminal; every screen that it has shown is kept. ``stdout`` may go elsewhere.

    It is a fork of the loaded command line (see `warm`), whose streams are UTF-8; a ``program`` of its own takes the
    encoding from its locale, and has the command line of one.
    """

    def __init__(
        self,
        folder: Path,
        environ: Mapping[str, str],
        *arguments: str,
        stdout: "IO[bytes] | int | None" = None,
        program: bool = False,
    ) -> None:
        self._screen = pyte.Screen(COLUMNS, LINES)
        self._stream = pyte.ByteStream(self._screen)
        self.screens: list[list[str]] = []
        self.raw = b""
        self._master, slave = pty.openpty()
        settings = {"TERM": "xterm", "COLUMNS": str(COLUMNS), "LINES": str(LINES)}
        found = slave if stdout is None else stdout if isinstance(stdout, int) else stdout.fileno()
        self.process: subprocess.Popen[bytes] | warm.Begun
        if program:
            self.process = subprocess.Popen(
                [str(OCTOFORM), *arguments],
                cwd=folder,
                env={**settings, **environ},
                stdin=slave,
                stdout=found,
                stderr=slave,
                start_new_session=True,
                preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # so that Ctrl-C becomes a signal
            )
        else:
            streams = (slave, found, slave)
            self.process = warm.begin(OCTOFORM, arguments, folder, {**settings, **environ}, streams)
        os.close(slave)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while True:
            try:
                data = os.read(self._master, 65536)
            except OSError:  # the other side is closed
                return
            if not data:
                return
            self.raw += data
            self._stream.feed(data)
            self.screens.append([line.rstrip() for line in self._screen.display])

    def type(self, text: str) -> None:
        """What the person types; ``\\x03`` is Ctrl-C."""
        os.write(self._master, text.encode())

    def wait_for(self, text: str) -> None:
        """Wait until a line of the screen holds ``text``."""
        deadline = time.monotonic() + 60
        while not any(text in line for screen in self.screens[-1:] for line in screen):
            assert time.monotonic() < deadline, (text, self.screens[-1:])
            time.sleep(0.02)

    def end(self) -> tuple[int, list[str]]:
        """The exit status and the last screen."""
        try:
            status = self.process.wait(timeout=60)
        finally:
            self.process.kill()
        self._reader.join(timeout=10)
        os.close(self._master)
        return status, self.screens[-1] if self.screens else []
