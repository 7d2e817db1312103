"""Endpoints of other hosts in a folder: one that the manifest no longer names runs on until it is stopped. Light."""

from octoform.endpoint.process.record import RECORD, running
from octoform.state.layout import Layout


def running_beside(layout: Layout) -> tuple[str, ...]:
    """The hosts of this folder, but for this one, whose endpoints run, by name."""
    records = layout.project.glob(f".octoform/*/{layout.run.name}/{RECORD}")
    hosts = sorted(path.parents[1].name for path in records)
    return tuple(host for host in hosts if host != layout.host and running(Layout(layout.project, host)))
