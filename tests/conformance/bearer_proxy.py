"""What stands between a suite that can send no token and an endpoint that wants one: it adds the header and no more.

Host, Origin, bodies and streams pass as they are, so a suite that tries a foreign Host tries it on the endpoint's own
guard.
"""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import urlsplit

CHUNK = 1 << 16


@contextmanager
def bearer_proxy(url: str, token: str) -> Iterator[str]:
    """The URL under which everything of ``url`` can be asked for with a token added; on loopback, for the block."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, name="bearer-proxy", daemon=True)
    thread.start()
    target = urlsplit(url)
    proxy = _Proxy(target.hostname or "127.0.0.1", target.port or 80, f"Authorization: Bearer {token}\r\n".encode())
    try:
        port = asyncio.run_coroutine_threadsafe(proxy.open(), loop).result(10)
        yield f"http://127.0.0.1:{port}{target.path}"
    finally:
        asyncio.run_coroutine_threadsafe(proxy.close(), loop).result(10)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10)
        loop.close()


class _Proxy:
    def __init__(self, host: str, port: int, header: bytes) -> None:
        self._host, self._port, self._header = host, port, header
        self._tasks: set[asyncio.Task[None]] = set()

    async def open(self) -> int:
        self._server = await asyncio.start_server(self._take, "127.0.0.1", 0, limit=1 << 20)
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    async def close(self) -> None:
        self._server.close()
        for task in list(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        try:
            there_reader, there_writer = await asyncio.open_connection(self._host, self._port)
        except OSError:
            writer.close()
            return
        answers = asyncio.create_task(_copy(there_reader, writer))
        requests = asyncio.create_task(self._requests(reader, there_writer))
        try:
            # When one side closes, so does the other: that is how a client ends a call.
            await asyncio.wait({answers, requests}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for each in (answers, requests):
                each.cancel()
            await asyncio.gather(answers, requests, return_exceptions=True)
            writer.close()
            there_writer.close()

    async def _requests(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            head = await reader.readuntil(b"\r\n\r\n")
            first, _, rest = head.partition(b"\r\n")
            writer.write(first + b"\r\n" + self._header + rest)
            headers = rest.lower()
            if b"transfer-encoding: chunked" in headers:
                await _chunks(reader, writer)
            elif b"content-length:" in headers:
                left = int(headers.split(b"content-length:")[1].split(b"\r\n")[0])
                writer.write(await reader.readexactly(left))
            await writer.drain()


async def _chunks(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    size = 1
    while size:
        line = await reader.readline()
        size = int(line.partition(b";")[0], 16)
        writer.write(line + await reader.readexactly(size + 2))


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while part := await reader.read(CHUNK):
        writer.write(part)
        await writer.drain()
