"""A sign of life every second while a tool works that sends none itself.

Many clients give up on a call that says nothing. Only a call that came with a progress token hears anything, and only
when its tool cannot report by itself; the last sign is sent before the answer.
"""

import asyncio
import time
from collections.abc import Callable
from typing import Any

import anyio

EVERY = 1.0


class Beat:
    """Sends the elapsed seconds, which only grow, with ``words()`` as the message; from now to `stop`."""

    def __init__(self, context: Any, words: Callable[[], str], every: float = EVERY) -> None:
        self._context = context
        self._words = words
        self._every = every
        self._begun = time.monotonic()
        self._task = asyncio.get_running_loop().create_task(self._send())

    def stop(self) -> None:
        """Nothing is sent from here on."""
        self._task.cancel()

    async def _send(self) -> None:
        while True:
            await asyncio.sleep(self._every)
            elapsed = round(time.monotonic() - self._begun, 3)
            try:
                await self._context.report_progress(elapsed, None, self._words())
            except (anyio.ClosedResourceError, anyio.BrokenResourceError):  # nobody listens any more
                return
