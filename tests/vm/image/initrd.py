"""What the guest's kernel starts first: one static program and the modules of the disk that everything else is on."""

import lzma
import shutil
from pathlib import Path

from vm.image import kernel
from vm.image.debian import Archive, run
from vm.image.steps import content, once

_INIT = Path(__file__).with_name("initrd-init")
# ext4 asks for the checksum as it starts, when nothing can load a module for it any more.
_MODULES = ["crc32c_generic", "virtio_pci", "virtio_mmio", "virtio_blk", "ext4"]


def build(archive: Archive, release: str) -> None:
    """Pack it once for each kernel."""
    folder = archive.places.folder
    made_of = content(_INIT, folder / ".made-kernel") + str(_MODULES)
    once(folder, "initrd", made_of, lambda: _build(archive, release))


def _build(archive: Archive, release: str) -> None:
    places = archive.places
    work, shell = places.folder / "initrd", places.folder / "busybox"
    for folder in (work, shell):
        shutil.rmtree(folder, ignore_errors=True)
    for name in ("bin", "dev", "proc", "sys", "root", "modules"):
        (work / name).mkdir(parents=True)
    archive.unpack("busybox-static", shell)
    shutil.copy(shell / "bin" / "busybox", work / "bin" / "busybox")
    for number, path in enumerate(kernel.modules_for(places, release, _MODULES), 10):
        data = path.read_bytes()
        plain = lzma.decompress(data) if path.suffix == ".xz" else data
        (work / "modules" / f"{number}-{path.name.removesuffix('.xz')}").write_bytes(plain)
    shutil.copy(_INIT, work / "init")
    (work / "init").chmod(0o755)
    run(["sh", "-c", f"find . | cpio -o -H newc --quiet > '{places.initrd}'"], cwd=work)
    shutil.rmtree(work)
    shutil.rmtree(shell)
