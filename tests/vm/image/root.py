"""The guest's root file system: a small Debian with the tools that make and look at hardware, as one disk image."""

import shutil
import subprocess
import sys
from pathlib import Path

from vm.image import kernel, simulators
from vm.image.debian import SUITE, Archive, host_architecture, run
from vm.image.steps import content, once
from vm.places import Places

_PACKAGES = """
    ca-certificates i2c-tools iproute2 kmod libasound2 openssh-server procps python3 python3-venv udev
"""
_SIZE = "4G"
_INIT = Path(__file__).parent / "init"
_SSHD = """\
HostKey /etc/ssh/ssh_host_ed25519_key
PermitRootLogin prohibit-password
UsePAM no
UseDNS no
MaxSessions 100
"""
_NEVER_LOADED = "kvm kvm_amd kvm_intel powernow_k8 acpi_cpufreq pcspkr iTCO_wdt intel_pmc_bxt ccp"
"""Modules for a real processor's parts, which cost seconds under emulation."""
_BINFMT = Path("/proc/sys/fs/binfmt_misc")


def build(archive: Archive, release: str) -> None:
    """Bootstrap once, and make the image anew whenever a setting or a module changed."""
    places = archive.places
    once(places.folder, "rootfs", SUITE + _PACKAGES, lambda: _bootstrap(archive))
    built = [f"{path.name} {path.stat().st_mtime_ns}" for path in simulators.modules(places)]
    once(places.folder, "key", "ed25519", lambda: _make_key(places.key))
    stamps = [places.folder / f".made-{name}" for name in ("rootfs", "kernel")]
    made_of = content(_INIT, Path(__file__), places.key.with_suffix(".pub"), *stamps) + str(built)
    once(places.folder, "image", made_of, lambda: _image(places, release))


def _make_key(path: Path) -> None:
    if not path.exists():
        run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", "guest", "-f", path])


def _bootstrap(archive: Archive) -> None:
    places = archive.places
    root, foreign = places.folder / "rootfs", places.arch != host_architecture()
    shutil.rmtree(root, ignore_errors=True)
    options = [f"--arch={places.arch}", "--variant=minbase", f"--cache-dir={places.debs}"]
    options += [f"--include={','.join(_PACKAGES.split())}", *(["--foreign"] if foreign else [])]
    run(["debootstrap", *options, SUITE, root, archive.mirror()])
    if foreign:
        _run_foreign_programs()
        run(["chroot", root, "/debootstrap/debootstrap", "--second-stage"])
    for name in ("doc", "man", "locale", "info"):
        shutil.rmtree(root / "usr" / "share" / name, ignore_errors=True)
    for path in (root / "var" / "cache" / "apt" / "archives").glob("*.deb"):
        path.unlink()
    shutil.rmtree(root / "var" / "lib" / "apt" / "lists", ignore_errors=True)
    (root / "etc" / "apt" / "sources.list").write_text("")


def _run_foreign_programs() -> None:
    """Have this machine's kernel hand programs of the guest's architecture to qemu-user."""
    if not (_BINFMT / "register").exists():
        run(["mount", "-t", "binfmt_misc", "none", _BINFMT])
    if not (_BINFMT / "qemu-aarch64").exists():
        run(["update-binfmts", "--enable", "qemu-aarch64"])


def _image(places: Places, release: str) -> None:
    root = places.folder / "rootfs"
    kernel.install_modules(places, release, root, simulators.modules(places))
    _settings(root, places.key.with_suffix(".pub").read_text())
    _compile(root, places)
    places.root.unlink(missing_ok=True)
    run(["truncate", "-s", _SIZE, places.root])
    features = "^has_journal,^metadata_csum"
    run(["mke2fs", "-q", "-t", "ext4", "-O", features, "-E", "lazy_itable_init=1", "-d", root, places.root])


def _settings(root: Path, public: str) -> None:
    shutil.copy(_INIT, root / "usr" / "sbin" / "guest-init")
    (root / "usr" / "sbin" / "guest-init").chmod(0o755)
    (root / "etc" / "hostname").write_text("guest\n")
    (root / "etc" / "hosts").write_text("127.0.0.1 localhost guest\n")
    keys = root / "root" / ".ssh" / "authorized_keys"
    keys.parent.mkdir(mode=0o700, exist_ok=True)
    keys.write_text(public)
    keys.chmod(0o600)
    ssh = root / "etc" / "ssh"
    for path in ssh.glob("ssh_host_*"):
        path.unlink()
    _make_key(ssh / "ssh_host_ed25519_key")
    (ssh / "sshd_config").write_text(_SSHD)
    never = "".join(f"blacklist {name}\n" for name in _NEVER_LOADED.split())
    (root / "etc" / "modprobe.d" / "guest.conf").write_text(never)


def _compile(root: Path, places: Places) -> None:
    """Compile Python's own library here once: in the guest it would cost a minute."""
    library = root / "usr" / "lib" / "python3.11"
    if places.arch == host_architecture():
        command = ["chroot", str(root), "python3", "-m", "compileall", "-q", "/usr/lib/python3.11"]
    elif sys.version_info[:2] == (3, 11):
        command = [sys.executable, "-m", "compileall", "-q", "-s", str(root), "-p", "/", str(library)]
    else:
        return
    # Debian's library holds files that are meant not to compile.
    subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
