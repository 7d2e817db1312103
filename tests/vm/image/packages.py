"""A disk for the guest with Python packages: octoform's own, installed, and wheels for the server that it will build.

The guest has no way out. Its package tool takes wheels from this folder, as on any host whose user configured that.
Everything comes through this machine's own package tools as they are configured.
"""

import shutil
import sys
from pathlib import Path

from vm.image.debian import run
from vm.image.steps import content, once
from vm.places import MACHINES, Places

_LOCK = Path(__file__).parents[3] / ".ci" / "requirements.lock"
# What generated servers ask for (`octoform.builtin.serve.stage`), to be resolved with all that it needs.
_SERVED = """\
fastmcp>=4.1,<4.2
feetech-servo-sdk>=1.0,<2
opencv-python-headless>=4.10
pydantic>=2.12,<3
pyserial>=3.5,<4
typing-extensions>=4.12
"""
_SOURCES = ("feetech-servo-sdk",)
"""Published as source alone: pure Python, so the wheel that is made here fits every guest."""
_ABIS = ("manylinux2014", "manylinux_2_17", "manylinux_2_28")
OCTOFORM = "/root/octoform"
"""Where octoform's own files lie in the guest."""
_STARTER = '#!/bin/sh\nexec /opt/guest/venv/bin/python -m octoform.cli "$@"\n'


def build(places: Places) -> None:
    """Make the disk once for each set of requirements."""
    made_of = content(_LOCK, Path(__file__)) + _SERVED
    once(places.folder, "packages", made_of, lambda: _build(places))


def _build(places: Places) -> None:
    work, machine = places.folder / "packages", MACHINES[places.arch]
    shutil.rmtree(work, ignore_errors=True)
    wheels, wanted, lock = work / "wheels", work / "served.in", work / "wheels.lock"
    wheels.mkdir(parents=True)
    wanted.write_text(_SERVED)
    target = ["--python-version", "3.11", "--python-platform", f"{machine}-manylinux_2_28"]
    compile_ = [sys.executable, "-m", "uv", "pip", "compile", "-q", *target, "--generate-hashes", "--no-header"]
    run([*compile_, "--no-annotate", "--no-emit-index-url", "--no-emit-find-links", _LOCK, wanted, "-o", lock])
    platforms = [part for abi in _ABIS for part in ("--platform", f"{abi}_{machine}")]
    kinds = ["--only-binary=:all:", *(f"--no-binary={name}" for name in _SOURCES)]
    download = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--require-hashes", *kinds]
    run([*download, "--implementation", "cp", "--python-version", "3.11", *platforms, "-d", wheels, "-r", lock])
    _make_wheels(wheels)
    _environment(work / "venv", wheels, target)
    run(["truncate", "-s", "768M", places.packages])
    run(["mke2fs", "-q", "-F", "-t", "ext4", "-O", "^has_journal", "-d", work, places.packages])
    shutil.rmtree(work)


def _make_wheels(wheels: Path) -> None:
    """The guest could not build anything: its package tool has no way to the tools of a build."""
    for source in wheels.glob("*.tar.gz"):
        run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", wheels, source])
        source.unlink()


def _environment(venv: Path, wheels: Path, target: list[str]) -> None:
    """What `python3 -m venv` and an installation would make in the guest, in seconds instead of minutes."""
    packages, programs = venv / "lib" / "python3.11" / "site-packages", venv / "bin"
    packages.mkdir(parents=True)
    programs.mkdir()
    (venv / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n")
    for name in ("python", "python3"):
        (programs / name).symlink_to("/usr/bin/python3.11")
    offline: list[str | Path] = ["--no-index", "--find-links", wheels, "--no-deps", "--link-mode", "copy"]
    install = [sys.executable, "-m", "uv", "pip", "install", "-q", *target, *offline, "--target", packages]
    run([*install, "--require-hashes", "-r", _LOCK])
    for path in (packages / "bin").iterdir():
        path.rename(programs / path.name)
    (packages / "octoform.pth").write_text(OCTOFORM + "\n")
    starter = programs / "octoform"
    starter.write_text(_STARTER)
    starter.chmod(0o755)
    if sys.version_info[:2] == (3, 11):
        run([sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "unchecked-hash", packages])
