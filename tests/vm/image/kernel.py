"""The guest's kernel: Debian's own, unpacked and without the modules that no device of the tests needs."""

import gzip
import lzma
import shutil
import struct
from pathlib import Path

from vm.image.debian import Archive, host_architecture, run
from vm.image.steps import once
from vm.places import Places

_UNUSED = """
    drivers/crypto drivers/gpu drivers/infiniband drivers/isdn drivers/md drivers/media/dvb-frontends drivers/media/pci
    drivers/media/tuners drivers/message drivers/net/ethernet drivers/net/wireless drivers/net/wwan drivers/staging
    drivers/target drivers/video fs/btrfs fs/ceph fs/cifs fs/gfs2 fs/jfs fs/nfs fs/nfsd fs/ocfs2 fs/reiserfs fs/xfs
    net/batman-adv net/ceph net/ipv6/netfilter net/netfilter net/openvswitch net/sctp net/tipc sound/soc
"""


def version(archive: Archive) -> str:
    """The kernel's version, such as 6.1.0-1-amd64."""
    return archive.depends(f"linux-image-{archive.places.arch}", "linux-image-").removeprefix("linux-image-")


def tree(places: Places) -> Path:
    """Where the kernel's package lies unpacked."""
    return places.folder / "kernel"


def build(archive: Archive, release: str) -> None:
    """Unpack the newest kernel of the suite, once for each."""
    places = archive.places
    package = archive.fetch(f"linux-image-{release}")
    once(places.folder, "kernel", package.name + _UNUSED, lambda: _build(archive, release))


def _build(archive: Archive, release: str) -> None:
    places, folder = archive.places, tree(archive.places)
    shutil.rmtree(folder, ignore_errors=True)
    archive.unpack(f"linux-image-{release}", folder)
    places.kernel.write_bytes(_unpacked((folder / "boot" / f"vmlinuz-{release}").read_bytes()))
    modules = folder / "lib" / "modules" / release
    for name in _UNUSED.split():
        shutil.rmtree(modules / "kernel" / name, ignore_errors=True)
    if places.arch == host_architecture():
        # The signatures go with the debug sections: an emulated processor takes long to check them.
        for path in modules.rglob("*.ko"):
            run(["strip", "--strip-debug", path])
    run(["depmod", "-b", folder, release])


def _unpacked(image: bytes) -> bytes:
    """A kernel that QEMU starts as it is: unpacking it in the guest would take long."""
    if image[:2] == b"\x1f\x8b":
        return gzip.decompress(image)
    if image[56:60] == b"ARM\x64":
        return image
    if image[0x1FE:0x200] != b"\x55\xaa":
        raise SystemExit("the kernel's package holds an image of a kind that is not known")
    setup = (image[0x1F1] or 4) + 1  # sectors before the packed kernel (the x86 boot protocol)
    start, length = struct.unpack_from("<II", image, 0x248)
    packed = image[setup * 512 + start : setup * 512 + start + length]
    if packed[:6] != b"\xfd7zXZ\0":
        raise SystemExit("the kernel is packed in a way that is not known")
    return lzma.LZMADecompressor(format=lzma.FORMAT_XZ).decompress(packed)


def modules_for(places: Places, release: str, names: list[str]) -> list[Path]:
    """The files of these modules and of all that they need, in the order in which they load."""
    found: list[Path] = []
    for name in names:
        shown = run(["modprobe", "-d", tree(places), "-S", release, "--show-depends", name])
        words = [line.split() for line in shown.splitlines()]
        found += [Path(word[1]) for word in words if word[0] == "insmod"]
    return list(dict.fromkeys(found))


def install_modules(places: Places, release: str, root: Path, built: list[Path]) -> None:
    """Put the kernel's modules, and those that were built besides, into a root file system."""
    folder = root / "lib" / "modules" / release
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(tree(places) / "lib" / "modules" / release, folder, symlinks=True)
    (folder / "extra").mkdir()
    for path in built:
        shutil.copy(path, folder / "extra" / path.name)
    run(["depmod", "-b", root, release])
