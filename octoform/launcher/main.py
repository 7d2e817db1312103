"""The process behind every client of a host: check, load, own, serve, until it is asked to stop."""

import asyncio
import os
import signal
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .control import Control
from .descriptor import Descriptor, RefusedError, read
from .owner import Owner
from .socketfile import listen

REFUSED = 78
"""Exit status for a configuration that may not be served (EX_CONFIG)."""
TAKEN = 75
"""Exit status when another process owns the endpoint (EX_TEMPFAIL)."""
GRACE_SECONDS = 4.0
"""What running calls have for their end once the process was asked to stop."""
SOCKET = "endpoint.sock"


def main(folder: Path) -> int:
    """Serve the endpoint in ``folder``; the exit status."""
    try:
        descriptor = read(folder)
        owner = Owner.take(descriptor.run)
        if owner is None:
            print("octoform: another process serves this endpoint already", file=sys.stderr)
            return TAKEN
        from .loading import load

        server = load(descriptor)
    except RefusedError as problem:
        print(f"octoform: refused: {problem}", file=sys.stderr)
        return REFUSED
    asyncio.run(Endpoint(descriptor, owner, server).serve())
    owner.release()
    sys.stdout.flush()
    sys.stderr.flush()
    # A tool that never returns has a thread that never ends, and the interpreter would wait for it.
    os._exit(0)


class Endpoint:
    """One start of the endpoint."""

    def __init__(self, descriptor: Descriptor, owner: Owner, server: Any) -> None:
        self._descriptor = descriptor
        self._owner = owner
        self._server = server
        self._control = Control(descriptor.run)

    async def serve(self) -> None:
        """Open the doors, record who serves, wait for the word to stop, close them."""
        from .unix import LocalClients

        stopping = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, stopping.set)
        clients = LocalClients(self._server)
        async with self._server._lifespan_manager():
            listener = listen(self._descriptor.run / SOCKET)
            serving = asyncio.create_task(clients.serve(listener))
            self._control.on("status", lambda _: self._status(clients.count))
            self._control.start()
            self._owner.record(scope=self._descriptor.scope, url=None)
            await stopping.wait()
            listener.close()
            (self._descriptor.run / SOCKET).unlink(missing_ok=True)
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            self._control.stop()

    def _status(self, clients: int) -> Mapping[str, Any]:
        return {"pid": os.getpid(), "instance": self._owner.instance, "clients": clients}
