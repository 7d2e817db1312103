"""`python -m vm.image ARCHITECTURE` makes a guest from Debian's packages, or what has changed of it. Needs root.

Each step is done once; what it makes lies below `vm.places.places`.
"""

import os
import sys

from vm.image import initrd, kernel, packages, root, simulators
from vm.image.debian import Archive
from vm.places import ARCHITECTURES, places


def main(arguments: list[str]) -> None:
    """Make the guests of these architectures."""
    if os.geteuid() != 0:
        raise SystemExit("a root file system is unpacked, which needs root")
    for arch in arguments or ARCHITECTURES:
        if arch not in ARCHITECTURES:
            raise SystemExit(f"{arch}: there are guests for {' and '.join(ARCHITECTURES)}")
        archive = Archive(places(arch))
        archive.places.folder.mkdir(parents=True, exist_ok=True)
        archive.update()
        release = kernel.version(archive)
        kernel.build(archive, release)
        simulators.build(archive, release)
        root.build(archive, release)
        initrd.build(archive, release)
        packages.build(archive.places)


if __name__ == "__main__":
    main(sys.argv[1:])
