"""The program on an emulated board: a line protocol with a state that a test can look at."""

import threading
from collections.abc import Callable


class LineFirmware:
    """Answers each line: moves along two axes from where it is, home, and an error for all else."""

    def __init__(self) -> None:
        """Nothing was said to it yet."""
        self.lock = threading.Lock()
        self.heard: list[str] = []
        self.reset()

    def reset(self) -> None:
        """Power was lost: half a line is forgotten, and the axes are where they are counted from."""
        self._rest = b""
        self.at = {"X": 0, "Y": 0}

    def feed(self, data: bytes) -> bytes:
        """Bytes from the host in, bytes of the answer out."""
        with self.lock:
            *lines, self._rest = (self._rest + data).split(b"\n")
            texts = [line.decode("ascii", "replace").strip() for line in lines]
            self.heard += texts
            return b"".join(self._answer(text).encode() + b"\n" for text in texts if text)

    def _answer(self, line: str) -> str:
        word, _, argument = line.partition(" ")
        acts: dict[str, Callable[[str], None]] = {"MOVE_X": self._move_x, "MOVE_Y": self._move_y, "HOME": self._home}
        if word not in acts:
            return f"ERR unknown command {word}"
        try:
            acts[word](argument)
        except ValueError:
            return f"ERR not a number of steps: {argument}"
        return "OK"

    def _move_x(self, steps: str) -> None:
        self.at["X"] += int(steps)

    def _move_y(self, steps: str) -> None:
        self.at["Y"] += int(steps)

    def _home(self, _: str) -> None:
        self.at = {"X": 0, "Y": 0}
