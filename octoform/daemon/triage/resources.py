"""The room that a deployment has on its machine: the disk, its logs, the port."""

import re
from collections.abc import Iterator

from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair, Status

LEAST_FREE = 64_000_000
"""Bytes below which a state, a log or a built environment may not be written any more."""
LARGEST_LOG = 10_000_000
"""Bytes above which a log is set aside."""
_ASIDE = re.compile(r"\.\d+(\.\w+)?$")
_PORT = re.compile(
    r"address already in use|\bports?\b.{0,80}\b(taken|in use|free)\b|\b(taken|in use)\b.{0,40}\bport", re.I
)


def disk(facts: Facts) -> Iterator[Finding]:
    """A disk that is nearly full: what can be made again is dropped."""
    if facts.disk_free is not None and facts.disk_free < LEAST_FREE:
        yield Finding(
            Kind.DISK_FULL,
            FaultClass.NONE,
            "disk",
            f"the disk of the project has {facts.disk_free // 1_000_000} MB left",
            ("full",),
            Repair.ROTATE,
            (Repair.PERSON,),
            Status.ERROR,
            data={"free": facts.disk_free, "wanted": LEAST_FREE},
        )


def logs(facts: Facts) -> Iterator[Finding]:
    """Logs that outgrew their bound; what was set aside already (``.1``, ``.2.gz``) stays as it is."""
    for name, size in sorted(facts.log_bytes.items()):
        if size > LARGEST_LOG and not _ASIDE.search(name):
            summary = f"the log {name} has grown to {size // 1_000_000} MB"
            target = f"log:{name}"
            yield Finding(
                Kind.LOG_OVERGROWN,
                FaultClass.NONE,
                target,
                summary,
                ("overgrown",),
                Repair.ROTATE,
                status=Status.HEALTHY,
                data={"name": name, "bytes": size},
            )


def port(facts: Facts) -> Iterator[Finding]:
    """A port that another program holds; its holder is never touched."""
    if facts.process is None and facts.stopped_by is None and facts.start_failed and _PORT.search(facts.start_failed):
        yield Finding(
            Kind.PORT_TAKEN,
            FaultClass.DEAD_PROCESS,
            "endpoint",
            "another program holds the ports of the endpoint",
            ("port",),
            Repair.RESTART,
            (Repair.WAIT,),
            Status.DOWN,
            detail=facts.start_failed,
        )
