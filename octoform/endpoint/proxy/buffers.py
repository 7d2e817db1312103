"""The two directions of a pipe: what waits on its way, and where one message ends and the next begins. Light.

Upwards only whole messages go, so that none is cut in two between an endpoint and the next. Downwards bytes go as they
come, since pictures are large; only the beginning of each message is looked at.
"""

import os
from collections import deque

from octoform.endpoint.proxy.session import HEAD, Conversation

CHUNK = 1 << 16
MOST_WAITING = 1 << 20
"""Bytes that may wait for a slow reader before its writer is made to wait too."""
LONGEST_LINE = 9 << 20
"""Bytes of a client's message that are waited for; no endpoint takes one that is longer."""


def read(source: int) -> bytes | None:
    """What can be read now; empty at the end, None when there is nothing yet."""
    try:
        return os.read(source, CHUNK)
    except BlockingIOError:
        return None
    except OSError:
        return b""


class Up:
    """From the client to whichever endpoint there is."""

    def __init__(self, source: int, conversation: Conversation) -> None:
        self.source = source
        self.ended = False
        self._conversation = conversation
        self._parts: list[bytes] = []
        self._part_bytes = 0
        self._ahead: deque[bytes] = deque()
        """What this endpoint is told in the client's name, before anything of the client's own."""
        self._lines: deque[bytes] = deque()
        self._bytes = 0
        self._current, self._own, self._gone = b"", False, 0
        """The message that is being sent, whether it is the client's own, and how much of it this endpoint has."""

    @property
    def waits(self) -> bool:
        """Whether a message of the client's waits for an endpoint."""
        return bool(self._lines) or (bool(self._current) and self._own)

    @property
    def ready(self) -> bool:
        """Whether something can be sent now: while an endpoint has not answered the introduction, only that."""
        return bool(self._current or self._ahead or (self._lines and not self._conversation.shaking))

    @property
    def full(self) -> bool:
        """Whether so much waits that the client has to wait too."""
        return self._bytes >= MOST_WAITING

    def fill(self) -> None:
        """Take what the client says now."""
        part = read(self.source)
        if part is None:
            return
        self.ended = not part
        *whole, rest = part.split(b"\n")
        for piece in whole:
            self._put(b"".join((*self._parts, piece, b"\n")))
            self._parts, self._part_bytes = [], 0
        self._parts.append(rest)
        self._part_bytes += len(rest)
        if self.ended or self._part_bytes > LONGEST_LINE:
            self._put(b"".join(self._parts))
            self._parts, self._part_bytes = [], 0

    def ahead(self, lines: list[bytes]) -> None:
        """Let this endpoint be told something in the client's name."""
        self._ahead.extend(lines)

    def drain(self, target: int) -> bool:
        """Send what the endpoint takes now; False when it is gone."""
        try:
            while self._current or self._next():
                self._gone += os.write(target, self._current[self._gone :] if self._gone else self._current)
                if self._gone == len(self._current):
                    if self._own:
                        self._conversation.sent(self._current)
                    self._current, self._gone = b"", 0
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    def anew(self) -> None:
        """The endpoint is gone: a message of which it got only a part was never received by it."""
        if self._current and self._own:
            self._lines.appendleft(self._current)
            self._bytes += len(self._current)
        self._current, self._gone = b"", 0
        self._ahead.clear()

    def taken(self) -> list[bytes]:
        """All that waits, which waits no longer."""
        lines = list(self._lines)
        self._lines.clear()
        self._bytes = 0
        return lines

    def _next(self) -> bool:
        """Take the next message up; False when there is none that may be sent now."""
        if self._ahead:
            self._current, self._own = self._ahead.popleft(), False
            return True
        while self._lines and not self._conversation.shaking:
            line = self._lines.popleft()
            self._bytes -= len(line)
            self._current, self._own = self._conversation.from_client(line), True
            if self._current:
                return True
        return False

    def _put(self, line: bytes) -> None:
        if line:
            self._lines.append(line)
            self._bytes += len(line)


class Down:
    """From whichever endpoint there is to the client."""

    def __init__(self, target: int, conversation: Conversation) -> None:
        self.target = target
        self.waiting = b""
        self._conversation = conversation
        self._head = b""
        self._open = False
        """Whether a message has begun and not ended."""
        self._held = b""

    @property
    def full(self) -> bool:
        """Whether so much waits that the endpoint has to wait too."""
        return len(self.waiting) >= MOST_WAITING

    def put(self, part: bytes) -> list[bytes]:
        """Take what the endpoint said; what it has to be answered in the client's place.

        ValueError when the client cannot go on with it.
        """
        back: list[bytes] = []
        if self._held or self._conversation.careful:
            part = self._judged(self._held + part, back)
        if part:
            self._scan(part)
            self.waiting += part
        return back

    def tell(self, lines: list[bytes]) -> None:
        """Tell the client something in the endpoint's place; only between two messages."""
        self.waiting += b"".join(lines)

    def anew(self) -> None:
        """The endpoint is gone: what it had begun is ended, so that the next message can be read."""
        if self._open:
            self.waiting += b"\n"
        self._open, self._head, self._held = False, b"", b""

    def drain(self) -> bool:
        """Give the client what it takes now; False when it is gone."""
        try:
            self.waiting = self.waiting[os.write(self.target, self.waiting) :]
        except BlockingIOError:
            return True
        except OSError:  # what it did not take is nobody's
            self.waiting = b""
            return False
        return True

    def _judged(self, data: bytes, back: list[bytes]) -> bytes:
        """Look at each whole message as long as one has to be careful; the bytes that need not be looked at."""
        while self._conversation.careful:
            line, end, rest = data.partition(b"\n")
            if not end:
                self._held = data
                return b""
            if line.strip():
                told, answers = self._conversation.from_endpoint(line + end)
                self.waiting += told
                back += answers
            data = rest
        self._held = b""
        return data

    def _scan(self, part: bytes) -> None:
        """Note the beginning of each message that ends here."""
        start = 0
        while (end := part.find(b"\n", start)) >= 0:
            if self._open or end > start:
                self._conversation.heard(self._head + part[start : min(end, start + HEAD - len(self._head))])
            self._head, self._open, start = b"", False, end + 1
        if start < len(part):
            self._head += part[start : start + HEAD - len(self._head)]
            self._open = True
