"""Simulated hardware that Debian's kernel leaves out, built from Debian's own source of that same kernel.

`gpio-sim` is a GPIO controller whose lines a test can see from the other side, `iio_dummy` a sensor of known values.
Headers and source are unpacked, never installed. Only for a guest of this machine's own architecture: the packages'
build programs run on it.
"""

import os
import re
import shutil
from pathlib import Path

from vm.image.debian import Archive, host_architecture, run
from vm.image.steps import once
from vm.places import Places

_SOURCES = {
    "drivers/gpio": ("gpio-sim.c", "gpiolib.h"),
    "kernel/irq": ("irq_sim.c",),
    "drivers/iio": ("industrialio-configfs.c", "industrialio-sw-device.c"),
    "drivers/iio/dummy": ("iio_simple_dummy.c", "iio_simple_dummy.h"),
}
_MAKE = """\
obj-m += irq_sim.o gpio-sim.o industrialio-configfs.o industrialio-sw-device.o iio_dummy.o
iio_dummy-y := iio_simple_dummy.o
ccflags-y += -DCONFIG_IRQ_SIM=1 -DCONFIG_IIO_SW_DEVICE_MODULE=1 -DCONFIG_IIO_CONFIGFS_MODULE=1
"""


def are_possible(places: Places) -> bool:
    """True when this machine can build them."""
    return places.arch == host_architecture()


def modules(places: Places) -> list[Path]:
    """What was built; empty where nothing can be."""
    return sorted((places.folder / "simulators").glob("*.ko"))


def build(archive: Archive, release: str) -> None:
    """Build them once for each kernel."""
    if are_possible(archive.places):
        made_of = release + _MAKE + str(_SOURCES)
        once(archive.places.folder, "simulators", made_of, lambda: _build(archive, release))


def _build(archive: Archive, release: str) -> None:
    folder = archive.places.folder
    headers, work, out = folder / "headers", folder / "simulators-build", folder / "simulators"
    for path in (headers, work, out):
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir()
    series = ".".join(release.split(".")[:2])
    named = f"linux-headers-{release}"
    kinds = [("linux-headers-", "-common"), ("linux-kbuild-", ""), ("linux-compiler-", "")]
    packages = [named, f"linux-source-{series}", *(archive.depends(named, *kind) for kind in kinds)]
    for package in packages:
        archive.unpack(package, headers)
    place = headers / "usr" / "src" / named
    makefile = place / "Makefile"
    # The package's own makefile names the common headers where they would be installed.
    makefile.write_text(re.sub(r"^include /usr/src", f"include {headers}/usr/src", makefile.read_text(), flags=re.M))
    _take(headers / "usr" / "src" / f"linux-source-{series}.tar.xz", work)
    run(["make", "-C", place, f"M={work}", f"-j{os.cpu_count()}", "modules"])
    for path in work.glob("*.ko"):
        run(["strip", "--strip-debug", "-o", out / path.name, path])
    shutil.rmtree(headers)
    shutil.rmtree(work)


def _take(source: Path, work: Path) -> None:
    """The few files that are built, changed where a module may not do what the kernel itself may."""
    top = source.name.removesuffix(".tar.xz")
    wanted = [f"{top}/{folder}/{name}" for folder, names in _SOURCES.items() for name in names]
    run(["tar", "-xJf", source, "-C", work, "--transform", "s#.*/##", *wanted])
    simulator = work / "irq_sim.c"
    text = re.sub(r"irq_to_desc\(([a-z]*)\)", r"irq_data_to_desc(irq_get_irq_data(\1))", simulator.read_text())
    simulator.write_text(text + '\n#include <linux/module.h>\nMODULE_LICENSE("GPL");\n')
    (work / "Kbuild").write_text(_MAKE)
