"""Packages of Debian for the guest's architecture, by the sources that this machine's own apt is configured with.

Lists and downloads have folders of their own, so that nothing of this machine's package state is touched.
"""

import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vm.places import Places

SUITE = "bookworm"
_LISTS_ARE_GOOD_FOR = 12 * 3600.0


def run(arguments: Sequence[str | Path], **options: object) -> str:
    """What a program prints; CalledProcessError with its own words when it fails."""
    words = [str(item) for item in arguments]
    done = subprocess.run(words, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]
    if done.returncode:
        raise SystemExit(
            f"{' '.join(words)[:300]}\nended with {done.returncode}\n{(done.stdout + done.stderr)[-2000:]}"
        )
    return str(done.stdout)


def host_architecture() -> str:
    """Debian's name for this machine's architecture."""
    return run(["dpkg", "--print-architecture"]).strip()


@dataclass(frozen=True)
class Archive:
    """The package archive as a guest's architecture sees it."""

    places: Places

    def _options(self) -> list[str]:
        own = self.places.folder / "apt"
        settings = {
            "APT::Architecture": self.places.arch,
            "APT::Architectures::": self.places.arch,
            "APT::Sandbox::User": "root",
            "Dir::State": own / "state",
            "Dir::State::status": own / "status",
            "Dir::Cache": own / "cache",
            "Acquire::Languages": "none",
        }
        return [part for name, value in settings.items() for part in ("-o", f"{name}={value}")]

    def update(self) -> None:
        """Fetch the lists unless those that are there are from today."""
        own = self.places.folder / "apt"
        for folder in (own / "state" / "lists" / "partial", own / "cache" / "archives" / "partial", self.places.debs):
            folder.mkdir(parents=True, exist_ok=True)
        (own / "status").touch()
        known = [path.stat().st_mtime for path in (own / "state" / "lists").glob("*Packages*")]
        if not known or time.time() - max(known) > _LISTS_ARE_GOOD_FOR:
            run(["apt-get", *self._options(), "update"])
            for path in (own / "state" / "lists").glob("*Packages*"):
                path.touch()

    def mirror(self) -> str:
        """Where the packages of the guest's suite come from."""
        form = "$(REPO_URI) $(RELEASE) $(CREATED_BY)"
        for line in run(["apt-get", *self._options(), "indextargets", "--format", form]).splitlines():
            words = line.split()
            if words[1:] == [SUITE, "Packages"]:
                return words[0]
        raise SystemExit(f"this machine's apt has no source for {SUITE}; the guest is made of that suite's packages")

    def fetch(self, package: str) -> Path:
        """The package's file, downloaded unless it is there."""
        found = run(["apt-get", *self._options(), "--print-uris", "download", package], cwd=self.places.folder)
        name = found.split()[1]
        path = self.places.debs / name
        if not path.exists():
            run(["apt-get", *self._options(), "-qq", "download", package], cwd=self.places.debs)
        return path

    def unpack(self, package: str, folder: Path) -> Path:
        """The package's files laid below ``folder``; the file that they came from."""
        path = self.fetch(package)
        run(["dpkg", "-x", path, folder])
        return path

    def depends(self, package: str, start: str, end: str = "") -> str:
        """The package's first dependency with such a name."""
        for line in run(["apt-cache", *self._options(), "depends", package]).splitlines():
            word, _, name = line.strip().partition(" ")
            if word == "Depends:" and name.startswith(start) and name.endswith(end):
                return name
        raise SystemExit(f"{package} depends on no {start}*{end}")
