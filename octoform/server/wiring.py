"""One start of the endpoint: the server with everything around it, its doors, and the questions that it answers."""

import asyncio
import os
import signal
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from octoform.base.clock import boot_id
from octoform.policy import published
from octoform.policy.enforce import Ledger
from octoform.server.catalog import offer
from octoform.server.emergency_stop import ENDING, Emergency, Running
from octoform.server.internals import lifespan, low_level
from octoform.server.latch import Latch
from octoform.server.resources import DEVICES, FRAMES
from octoform.server.restrictions import CLAIMS_NAME as CLAIMS
from octoform.server.restrictions import NAME as RESTRICTIONS
from octoform.server.restrictions import WITNESS, Forbidden, Restrictions, Standing

from .audit.audit_log import Audit, AuditFailed
from .audit.chain import SEAL
from .execution.watchdog import WATCHDOG
from .gate.gate import Gate
from .process.control import Control
from .process.descriptor import Descriptor
from .process.instance_lock import Owner
from .process.local_socket import listen
from .process.stderr_log import write_line
from .transport.unix_socket import LocalClients

if TYPE_CHECKING:
    from octoform.server.tunnel_process import Tunnel

    from .transport.http import Web


# The endpoint's server info when a client connects: whose hardware it is, and how to deal with it.
#
# The generated server has a name of its own choice; two hosts of one client would look alike by it.

TEXT = (
    "The hardware of host {host}, as its operating system shows it. Every tool declares in its annotations, and in "
    "_meta as octoform/effect, whether it reads, actuates or cannot be undone. The resource {devices} lists the "
    "devices and whether they are there now; {frames}TOOL is the latest picture of a tool. The answer to a refused "
    "call names the rule or limit that refused it and what would pass: follow it, and do not try the same call again."
)


def introduce(server: Any, descriptor: Descriptor) -> None:
    """Give a FastMCP server the host's name, octoform's version and instructions for its clients."""
    inner = low_level(server)
    inner.name, inner.version = f"octoform-{descriptor.host}", descriptor.version
    server.instructions = TEXT.format(host=descriptor.host, devices=DEVICES, frames=FRAMES)


SOCKET = "endpoint.sock"
PAUSE_SECONDS = 0.01
LOOK_SECONDS = 2.0
"""How often the process looks whether its folder is still there: what serves a host must be findable."""


class DoorFailedError(Exception):
    """A door of the endpoint ended by itself; the text is one line for a person."""


class Endpoint:
    """The endpoint of one host, from `serve` until the process is asked to stop."""

    def __init__(self, descriptor: Descriptor, owner: Owner, server: Any) -> None:
        rules = published.read(descriptor.policy)
        self._descriptor = descriptor
        self._owner = owner
        self._server = server
        self._control = Control(descriptor.run)
        self._audit = Audit.open(descriptor.log, witness=descriptor.run / SEAL)
        self._ledger = Ledger(rules, descriptor.run / "limits.json")
        self._latch = Latch(descriptor.run / "estop.json")
        self._emergency = Emergency(self._latch, self._audit, rules.stop)
        introduce(server, descriptor)
        self._offer = offer(server, descriptor.devices, descriptor.tools, rules)
        self._gate = Gate(rules, self._ledger, self._audit, self._latch, self._offer.presence)
        self._gate.on_result = self._offer.frames.keep
        ledger = Standing(descriptor.run.parent / "daemon" / CLAIMS, boot_id())
        self._gate.restrictions = Restrictions(descriptor.run / RESTRICTIONS, self._record, ledger=ledger)
        self._gate.restrictions.forbidden = Forbidden(descriptor.run.parent / WITNESS)
        server.add_middleware(self._gate)
        WATCHDOG.cover(Path(descriptor.server["path"]).parent)
        self._clients = LocalClients(server)
        self._tunnel: Tunnel | None = None
        self._url: str | None = None

    async def serve(self) -> None:
        """Open the doors, record who serves, wait for the word to stop, close them.

        DoorFailedError, after all is closed in order, when one of them ended by itself: what answers no one must not
        live on and own the devices.
        """
        stopping = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, stopping.set)
        _outlive_lines()
        async with lifespan(self._server):
            await self._gate.arm(self._server)  # only now: no client waits yet, so what begins may take its time
            doors = self._open()
            control = self._answer()
            self._owner.record(scope=self._descriptor.scope, url=self._url)
            self._audit.write("started", instance=self._owner.instance, scope=self._descriptor.scope)
            failed = await self._stop_requested(stopping, [*doors, control])
            self._offer.changes.close()
            self._control.stop()
            if self._tunnel is not None:
                try:
                    await asyncio.to_thread(self._tunnel.stop)
                except RuntimeError:  # no thread is to be had
                    self._tunnel.stop()
            halted = self._gate.halt("shutdown", everything=True)
            self._gate.disarm()
            for door in doors:
                door.cancel()
            await asyncio.gather(*doors, return_exceptions=True)
            await _ended(halted)
            (self._descriptor.run / SOCKET).unlink(missing_ok=True)
            self._offer.presence.stop()
            self._audit.write("stopped", instance=self._owner.instance)
            self._audit.close()
        if failed:
            raise DoorFailedError(failed)

    async def _stop_requested(self, stopping: asyncio.Event, doors: Sequence["asyncio.Future[None]"]) -> str:
        """Wait for the word, or until no one could say it any more because the record of this process is gone.

        Empty, or which door ended before.
        """
        found = asyncio.create_task(stopping.wait())
        waited: set[asyncio.Future[Any]] = {found, *doors}
        try:
            while self._owner.is_recorded():
                self._gate.restrictions.in_force()  # so that an end is in the log even without a call
                done, _ = await asyncio.wait(waited, timeout=LOOK_SECONDS, return_when=asyncio.FIRST_COMPLETED)
                if found in done:
                    return ""
                if self._clients.lost:
                    return "the door of local clients lost its socket"
                for door in done:
                    name = door.get_name() if isinstance(door, asyncio.Task) else "control"
                    return f"the door {name} ended: {door.exception()!r}"
        finally:
            found.cancel()
        write_line("the record of this process is gone, so it ends")
        return ""

    def _open(self) -> list["asyncio.Task[None]"]:
        """The doors: the socket of this machine's clients always, HTTP and the tunnel where the scope has them."""
        descriptor = self._descriptor
        doors = [asyncio.create_task(self._clients.serve(listen(descriptor.run / SOCKET)), name="of local clients")]
        if descriptor.network is not None:
            from .transport.authentication import (
                Tokens,  # here, so that scope local carries no web server in its memory
            )
            from .transport.health_verdict import Verdict
            from .transport.http import PATH, Web

            tokens = Tokens(descriptor.run / "tokens.json")
            web = Web(self._server, descriptor, tokens, instance=self._owner.instance)
            daemon, latched = descriptor.run.parent / "daemon", lambda: self._latch.engaged() is not None
            lacks = self._offer.presence.lacks
            web.verdict = Verdict(daemon, self._owner.instance, latched, lambda: lacks() or bool(self._ledger.held()))
            listening = web.open()
            self._url = listening.url + PATH
            doors.append(asyncio.create_task(web.serve(), name="of HTTP"))
            if descriptor.tunnel is not None:
                self._dig(web, listening.local_url)
        self._offer.presence.start()
        return doors

    def _dig(self, web: "Web", local_url: str) -> None:
        from octoform.server.tunnel_process import Tunnel

        assert self._descriptor.tunnel is not None
        command, run = self._descriptor.tunnel["command"], self._descriptor.run
        instance = self._owner.instance
        self._tunnel = Tunnel(command, run, local_url=local_url, instance=instance, changed=web.published)
        self._tunnel.start()

    def _answer(self) -> "asyncio.Future[None]":
        """Answer octoform's questions; what comes back is done should that end by itself."""
        self._control.on("status", lambda _: self._status())
        self._control.on("limits", lambda _: {"used": self._ledger.used()})
        self._control.on("limits_reset", self._reset)
        self._control.on("revoke_tunnel", self._revoke)
        self._control.on("estop", self._stop)
        self._control.on("clear_estop", self._clear)
        loop = asyncio.get_running_loop()
        over: asyncio.Future[None] = loop.create_future()

        def ended() -> None:
            loop.call_soon_threadsafe(over.set_result, None)

        self._control.start(ended)
        return over

    def _stop(self, question: Mapping[str, Any]) -> Mapping[str, Any]:
        by, reason = str(question.get("by") or "unknown"), str(question.get("reason") or "")
        return self._emergency.stop(by, reason, interrupt=self._gate.halt)

    def _clear(self, question: Mapping[str, Any]) -> Mapping[str, Any]:
        self._gate.void()  # before anything may move: what waited while it was engaged waits for nothing any more
        return self._emergency.clear(str(question.get("by") or "unknown"))

    def _reset(self, question: Mapping[str, Any]) -> Mapping[str, Any]:
        tool = question.get("tool")
        # Written first: what is not in the log must not have happened.
        self._audit.write("limits_reset", tool=tool, by=question.get("by"))
        try:
            self._ledger.reset(tool)
        except KeyError:
            return {"error": f"{tool} is no tool of this endpoint"}
        return {"reset": True}

    def _revoke(self, question: Mapping[str, Any]) -> Mapping[str, Any]:
        if self._tunnel is None:
            return {"error": "this endpoint has no tunnel"}
        proof = asdict(self._tunnel.revoke())
        self._audit.write("tunnel_revoked", by=question.get("by"), **proof)
        return proof

    def _record(self, event: str, fields: Mapping[str, Any]) -> None:
        """Record what begins or ends to be restricted; calls report a log that cannot be written."""
        with suppress(AuditFailed):
            self._audit.write(event, **fields)

    def _status(self) -> Mapping[str, Any]:
        latched = self._latch.engaged()
        return {
            "pid": os.getpid(),
            "instance": self._owner.instance,
            "scope": self._descriptor.scope,
            "url": self._url,
            "clients": self._clients.count,
            "gate": self._gate.status(),
            "estop": None if latched is None else {"by": latched.by, "reason": latched.reason, "since": latched.since},
            "restrictions": self._gate.restrictions.shown(),
            "outside": self._ledger.held(),
            "tunnel": None if self._tunnel is None else dict(self._tunnel.status()),
        }


async def _ended(halted: Sequence[Running]) -> None:
    """Wait, but not permanently, until what was interrupted has ended: its code may have to make its device stand."""
    end = time.monotonic() + ENDING
    while time.monotonic() < end and not all(each.over for each in halted):
        await asyncio.sleep(PAUSE_SECONDS)


def _outlive_lines() -> None:
    """Go on when a serial line is unplugged that a tool has opened.

    A process without a terminal gets the first line that it opens as its own, unless the tool thought of O_NOCTTY, and
    a hang-up of one's own terminal ends a process. One that was started in a terminal still ends with that.
    """
    try:
        os.close(os.open("/dev/tty", os.O_RDWR))
    except OSError:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
