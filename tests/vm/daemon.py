"""The daemon in a guest: started as a person starts it, and asked for what it has noted."""

import contextlib
import json
import shlex
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from vm.user import PROJECT, Octoform

EPISODES = f"{PROJECT}/.octoform/bench/daemon/episodes.jsonl"
LEFT = r"[o]ctoform\.(cli watch|daemon\.|runtime\.)"
"""Processes of the daemon, as pgrep looks for them: itself, its worker, and whom it asks."""
NOTICED_SECONDS = 120.0
"""For what a real computer notices at once: here the daemon shares one emulated processor with everything else."""


@dataclass(frozen=True)
class Watch:
    """A running `octoform watch`."""

    octoform: Octoform

    def episodes(self) -> list[dict[str, Any]]:
        """All troubles so far, the latest state of each."""
        lines = self.octoform.guest.run(f"cat {EPISODES} 2>/dev/null", check=False).splitlines()
        known = {}
        for line in lines:
            with contextlib.suppress(ValueError):  # the line that is being written
                episode = json.loads(line)
                known[episode["id"]] = episode
        return list(known.values())

    def count(self) -> int:
        """How many troubles there were so far."""
        return len(self.episodes())

    def until(
        self, wanted: Callable[[dict[str, Any]], bool], since: int = 0, seconds: float = NOTICED_SECONDS
    ) -> dict[str, Any]:
        """The first trouble after the first ``since`` ones that is as wanted; waits for it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for episode in self.episodes()[since:]:
                if wanted(episode):
                    return episode
            time.sleep(0.3)
        found = self.octoform.guest.run("tail -n 20 /root/watch.log", check=False)
        raise AssertionError(f"not noticed within {seconds:.0f} s\n{self.episodes()[since:]}\n{found}")

    def rediscovered(self, since: int, seconds: float) -> str:
        """Wait until hardware was onboarded after the first ``since`` troubles, and no change of it is open.

        The report of each run; mostly one is enough, but a driver may take longer than anybody waits here.
        """

        def changes() -> list[dict[str, Any]]:
            return [each for each in self.episodes()[since:] if each["kind"] == "hardware_changed"]

        def done(episode: dict[str, Any]) -> bool:
            return episode["outcome"] == "repaired" and all(each["closed"] for each in changes())

        self.until(lambda episode: episode["kind"] == "hardware_changed" and done(episode), since, seconds)
        return "; then ".join(made["detail"] for episode in changes() for made in episode["tries"])

    def end(self) -> None:
        """End it as a service manager does, and wait until nothing of it is left."""
        guest = self.octoform.guest
        record = f"{PROJECT}/.octoform/bench/daemon/daemon.json"
        ending = f"test ! -e {record} || kill $(python3 -c \"import json; print(json.load(open('{record}'))['pid'])\")"
        guest.run(ending, check=False)
        guest.until(f"! pgrep -f '{LEFT}' >/dev/null", 60.0)


@contextlib.contextmanager
def watching(octoform: Octoform) -> Iterator[Watch]:
    """The daemon from its start until it is ended."""
    line = octoform.line("watch", "-json")
    folder, _, command = line.partition(" && ")
    whole = f"{folder} && env {command} >/root/watch.log 2>&1 </dev/null; touch /root/watch.ended"
    octoform.guest.run(f"setsid sh -c {shlex.quote(whole)} >/dev/null 2>&1 & echo started")
    try:
        octoform.guest.until(f"test -e /root/watch.ended || test -s {PROJECT}/.octoform/bench/daemon/health.json")
        found = octoform.guest.run("tail -n 30 /root/watch.log", check=False)
        assert octoform.guest.run(f"pgrep -f '{LEFT}'", check=False), f"the daemon ended\n{found}"
        yield Watch(octoform)
    finally:
        Watch(octoform).end()
