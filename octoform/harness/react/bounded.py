"""Text of bounded size: the beginning and the end of what a tool said, the middle left out."""

from octoform.escaping import escaped

KEPT = "\n\t\r"


class HeadAndTail:
    """Takes any amount of bytes and keeps at most ``limit`` of them, a third from the beginning."""

    def __init__(self, limit: int) -> None:
        self._most_head = limit // 3
        self._most_tail = limit - self._most_head
        self._head = bytearray()
        self._tail = bytearray()
        self._left_out = 0

    def feed(self, data: bytes) -> None:
        """Take a piece."""
        room = self._most_head - len(self._head)
        self._head += data[:room]
        self._tail += data[max(0, room) :]
        excess = len(self._tail) - self._most_tail
        # The end is cut now and then, not at every piece.
        if excess > self._most_tail:
            self._drop(excess)

    def text(self) -> str:
        """What is kept, readable whatever the bytes were."""
        self._drop(max(0, len(self._tail) - self._most_tail))
        head, tail = bytes(self._head), bytes(self._tail)
        if not self._left_out:
            return readable(head + tail)
        return f"{readable(head)}\n[... {self._left_out} bytes left out ...]\n{readable(tail)}"

    def _drop(self, count: int) -> None:
        del self._tail[:count]
        self._left_out += count


def readable(data: bytes) -> str:
    """Bytes as text in which nothing is hidden."""
    return escaped(data.decode("utf-8", "replace"), KEPT)


def cut(text: str, limit: int) -> str:
    """A text of at most about ``limit`` bytes, its middle left out."""
    data = text.encode("utf-8", "replace")
    if len(data) <= limit:
        return text
    keeper = HeadAndTail(limit)
    keeper.feed(data)
    return keeper.text()
