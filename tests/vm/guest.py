"""A running guest: started, spoken to over ssh, given devices and relieved of them, and ended with all that served it.

Only processes that this module started are ended. QEMU dies with the process that started it, however that ends.
"""

import contextlib
import ctypes
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

from vm.control import Control
from vm.devices.model import Model
from vm.emulator import Run, command
from vm.places import Places
from vm.usb_redir import Carrier

UP, SETTLED = "GUEST-UP", "GUEST-SETTLED"
BOOT_SECONDS = 300.0
_TAIL = 3000
_DIE_WITH_PARENT = 1  # prctl(2)
_LIBC = ctypes.CDLL(None)


class GuestError(Exception):
    """The guest did not do what it should; the text ends with what it last said."""


@dataclass
class Plugged:
    """What belongs to one device and goes with it."""

    carrier: Carrier | None = None
    image: str | None = None


@dataclass
class Guest:
    """``with Guest(places(arch)) as guest:``"""

    places: Places
    extra: tuple[str, ...] = ()
    plugged: dict[str, Plugged] = field(default_factory=dict)

    # -- from the start to the end

    def __enter__(self) -> "Guest":
        """Boot, and wait until devices are settled."""
        self._folder = Path(tempfile.mkdtemp(prefix="octoform-vm-"))
        self._processes: list[subprocess.Popen[bytes]] = []
        try:
            self._boot()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Ends QEMU and what served it."""
        self._end()

    def _boot(self) -> None:
        self._run = Run(self._folder, _free_port(), self.extra)
        self._log = (self._folder / "qemu.log").open("wb")
        self._emulator = self._start(command(self.places, self._run))
        self._control = Control(self._run.control, 30.0)
        self._await(lambda: UP in self.console(), "the guest did not come up")
        self._await(self._connected, "the guest's ssh server did not answer")
        self._await(lambda: SETTLED in self.console(), "the guest's devices did not settle")

    def _start(self, arguments: Sequence[str]) -> "subprocess.Popen[bytes]":
        process = subprocess.Popen(
            list(arguments),
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            preexec_fn=_step_back,
            start_new_session=True,
        )
        self._processes.append(process)
        return process

    def _await(self, done: Callable[[], bool], failing: str) -> None:
        end = time.monotonic() + BOOT_SECONDS
        while not done():
            if self._emulator.poll() is not None:
                raise GuestError("QEMU ended: " + (self._folder / "qemu.log").read_text(errors="replace")[-_TAIL:])
            if time.monotonic() > end:
                raise GuestError(f"{failing} within {BOOT_SECONDS:.0f} s; its console ends:\n{self.console()[-_TAIL:]}")
            time.sleep(0.1)

    def _connected(self) -> bool:
        """One connection carries all commands: a handshake costs the emulated processor a second."""
        if (self._folder / "ssh").exists():
            return True
        master = self._processes[-1]
        if master is self._emulator or master.poll() is not None:
            self._start(["ssh", "-M", "-N", *self.ssh])
        return False

    def _end(self) -> None:
        for device in self.plugged.values():
            if device.carrier:
                device.carrier.close()
        for process in reversed(self._processes):
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            process.wait()
        if hasattr(self, "_control"):
            self._control.close()
        if hasattr(self, "_log"):
            self._log.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def console(self) -> str:
        """What the guest printed on its console so far."""
        try:
            return self._run.console.read_text(errors="replace")
        except FileNotFoundError:
            return ""

    # -- commands and files

    @property
    def ssh(self) -> list[str]:
        """Options and address that reach the guest with ssh."""
        options = {
            "IdentityFile": self.places.key,
            "Port": self._run.port,
            "ControlPath": self._folder / "ssh",
            "StrictHostKeyChecking": "no",
            "UserKnownHostsFile": "/dev/null",
            "LogLevel": "ERROR",
            "BatchMode": "yes",
        }
        return ["-F", "none", *(f"-o{name}={value}" for name, value in options.items()), "root@127.0.0.1"]

    def run(self, line: str, seconds: float = 120.0, *, check: bool = True, stdin: bytes = b"") -> str:
        """What a shell command in the guest prints; GuestError when it fails and ``check`` is true."""
        done = subprocess.run(["ssh", *self.ssh, line], input=stdin, capture_output=True, timeout=seconds, check=False)
        printed = done.stdout.decode("utf-8", "replace")
        if check and done.returncode:
            text = printed + done.stderr.decode("utf-8", "replace")
            raise GuestError(
                f"{line} -> {done.returncode}\n{text[-_TAIL:]}\nthe kernel said last:\n{self._kernel_log()}"
            )
        return printed.strip()

    def _kernel_log(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            done = subprocess.run(["ssh", *self.ssh, "dmesg | tail -15"], capture_output=True, timeout=30, check=False)
            return done.stdout.decode("utf-8", "replace")
        return self.console()[-_TAIL:]

    def until(self, line: str, seconds: float = 180.0) -> str:
        """What the command prints once it succeeds."""
        end = time.monotonic() + seconds
        while True:
            try:
                return self.run(line)
            except GuestError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.5)

    def read(self, path: str) -> bytes:
        """The content of a file of the guest."""
        return subprocess.run(["ssh", *self.ssh, f"cat '{path}'"], capture_output=True, timeout=120, check=True).stdout

    def write(self, path: str, text: str) -> None:
        """Make or replace a file of the guest."""
        self.run(f"cat > '{path}'", stdin=text.encode())

    @contextlib.contextmanager
    def held_open(self, node: str) -> Iterator[None]:
        """Some program has the device node open, so that the kernel cannot give its number to another."""
        # Without O_NOCTTY the node would become the terminal of that program, which its unplugging then ends.
        program = f"import os,time; os.open('{node}', os.O_RDWR | os.O_NOCTTY); print(1, flush=True); time.sleep(3600)"
        holder = subprocess.Popen(
            ["ssh", *self.ssh, f'echo $$; exec python3 -c "{program}"'],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
        )
        assert holder.stdout is not None
        number = int(holder.stdout.readline())
        opened = holder.stdout.readline().strip() == b"1"
        try:
            if not opened:
                raise GuestError(f"{node} could not be opened")
            yield
        finally:
            self.run(f"kill {number}", check=False)
            holder.wait(30)
            holder.stdout.close()

    # -- devices

    def plug(self, name: str, model: Model, port: int) -> None:
        """A device of `vm.devices` on a port of the guest's USB controller."""
        way = f"{name}-{time.monotonic_ns()}"  # the former way of a device is dropped when QEMU has time for it
        socket_path = self._folder / f"usb-{way}"
        carrier = Carrier(model, socket_path)
        self.plugged[name] = Plugged(carrier)
        address = {"type": "unix", "data": {"path": str(socket_path)}}
        backend = {"type": "socket", "data": {"addr": address, "server": False}}
        self._control.ask("chardev-add", id=f"to-{way}", backend=backend)
        self._control.ask("device_add", driver="usb-redir", id=name, bus="usb.0", port=str(port), chardev=f"to-{way}")
        if not carrier.plugged.wait(30.0):
            raise GuestError(f"QEMU did not take {name}")

    def plug_disk(self, name: str, image: Path, port: int, serial: str) -> None:
        """A USB disk whose content is a file."""
        node = f"disk-{name}"
        file = {"driver": "file", "filename": str(image)}
        self._control.ask("blockdev-add", **{"driver": "raw", "node-name": node, "file": file})
        self.plugged[name] = Plugged(image=node)
        place = {"bus": "usb.0", "port": str(port), "removable": True}
        self._control.ask("device_add", driver="usb-storage", id=name, drive=node, serial=serial, **place)

    def unplug(self, name: str) -> None:
        """Pull a device; QEMU drops what connected it to its program."""
        device = self.plugged.pop(name)
        self._control.ask("device_del", id=name)
        self._control.until_gone(name)
        if device.carrier:
            device.carrier.close()
        if device.image:
            self._control.ask("blockdev-del", **{"node-name": device.image})


def _step_back() -> None:
    """In the child: be nice to all other work, and end with the parent."""
    os.nice(5)
    _LIBC.prctl(_DIE_WITH_PARENT, signal.SIGKILL)


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])
