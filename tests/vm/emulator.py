"""The command line of QEMU for a guest of each architecture: with KVM for this machine's own, else in software."""

import fcntl
import os
import platform
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vm.places import MACHINES, Places

_MACHINE = {
    # What is left out would only be probed, at the pace of an emulated processor.
    "amd64": ("qemu-system-x86_64", "q35,sata=off,i8042=off,hpet=off,vmport=off", "Nehalem", "ttyS0"),
    "arm64": ("qemu-system-aarch64", "virt,gic-version=3", "cortex-a53", "ttyAMA0"),
}
# The oldest processor that today's wheels run on: each instruction set above it costs emulation time.
_KERNEL = (
    "quiet loglevel=4 mitigations=off nokaslr audit=0 apparmor=0 raid=noautodetect random.trust_cpu=on "
    "no_timer_check tsc=reliable net.ifnames=0"
)
USB_PORTS = 12
_SOFTWARE = "tcg,thread=multi,tb-size=256"
# linux/kvm.h; version 12 is the only one that there ever was.
_KVM_GET_API_VERSION, _KVM_CREATE_VM, _KVM_VERSION = 0xAE00, 0xAE01, 12

_VIRTUALISES = re.compile(r"^flags\s*:.* (?:vmx|svm)(?: |$)", re.MULTILINE)


@cache
def has_kvm(arch: str) -> bool:
    """Whether this machine runs a guest of this architecture itself: the kernel makes an empty one for us to see.

    That the node is there is not enough: a container has it without the right to open it, and a virtual machine may
    have it without nested virtualisation, or with one (PVM) that runs kernels made for it alone.
    """
    if MACHINES[arch] != platform.machine():
        return False
    if arch == "amd64" and _VIRTUALISES.search(Path("/proc/cpuinfo").read_text()) is None:
        return False
    try:
        kvm = os.open("/dev/kvm", os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        if fcntl.ioctl(kvm, _KVM_GET_API_VERSION, 0) != _KVM_VERSION:
            return False
        os.close(fcntl.ioctl(kvm, _KVM_CREATE_VM, 0))
    except OSError:
        return False
    finally:
        os.close(kvm)
    return True


@dataclass(frozen=True)
class Run:
    """What differs from one run to the next."""

    folder: Path
    """For sockets and logs."""
    port: int
    """Where this machine's loopback leads to the guest's ssh server."""
    extra: tuple[str, ...] = ()
    """Further devices that are there from the start."""

    @property
    def console(self) -> Path:
        """What the guest's kernel and first process print."""
        return self.folder / "console.log"

    @property
    def control(self) -> Path:
        """QEMU's control socket."""
        return self.folder / "control"


def command(places: Places, run: Run, memory: int = 2048, processors: int = 2) -> list[str]:
    """QEMU's arguments. The root file system's changes are thrown away at the end."""
    program, machine, processor, line = _MACHINE[places.arch]
    processor, accelerator = ("host", "kvm") if has_kvm(places.arch) else (processor, _SOFTWARE)
    network = f"user,id=net,restrict=on,hostfwd=tcp:127.0.0.1:{run.port}-:22"
    return [
        *(program, "-machine", machine, "-cpu", processor, "-accel", accelerator),
        *("-m", str(memory), "-smp", str(processors)),
        *("-nodefaults", "-no-user-config", "-display", "none"),
        *("-kernel", str(places.kernel), "-initrd", str(places.initrd), "-append", f"console={line} {_KERNEL}"),
        *("-drive", f"if=none,id=root,file={places.root},format=raw,cache=unsafe,snapshot=on"),
        *("-device", "virtio-blk-pci,drive=root"),
        *("-drive", f"if=none,id=packages,file={places.packages},format=raw,readonly=on"),
        *("-device", "virtio-blk-pci,drive=packages"),
        *("-netdev", network, "-device", "virtio-net-pci,netdev=net,romfile="),
        *("-device", "virtio-rng-pci", "-device", f"qemu-xhci,id=usb,p2={USB_PORTS},p3={USB_PORTS}"),
        *("-chardev", f"file,id=console,path={run.console}", "-serial", "chardev:console"),
        *("-qmp", f"unix:{run.control},server=on,wait=off"),
        *run.extra,
    ]
