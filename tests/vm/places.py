"""Where the emulated host's parts lie: all below one folder of the user, shared by all checkouts."""

import os
from dataclasses import dataclass
from pathlib import Path

ARCHITECTURES = ("amd64", "arm64")
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
"""Debian's name of an architecture and the one that everybody else uses."""


@dataclass(frozen=True)
class Places:
    """Files of one architecture's guest, and what all guests share."""

    arch: str
    folder: Path

    @property
    def kernel(self) -> Path:
        """The kernel, uncompressed."""
        return self.folder / "vmlinux"

    @property
    def initrd(self) -> Path:
        """What mounts the root file system."""
        return self.folder / "initrd.img"

    @property
    def root(self) -> Path:
        """The root file system; the emulator never writes to it."""
        return self.folder / "root.ext4"

    @property
    def packages(self) -> Path:
        """Wheels, and an environment with what octoform needs."""
        return self.folder / "packages.ext4"

    @property
    def key(self) -> Path:
        """The private key that every guest lets in."""
        return self.folder.parent / "id_guest"

    @property
    def debs(self) -> Path:
        """Debian packages as they were downloaded."""
        return self.folder.parent / f"deb-{self.arch}"


def places(arch: str) -> Places:
    """The files of an architecture: below OCTOFORM_VM, or in the user's cache."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Places(arch, Path(os.environ.get("OCTOFORM_VM") or Path(cache, "octoform", "vm")).resolve() / arch)
