"""ROTATE: set a log aside that has grown large. Light; `octoform.endpoint.archiving` says how nothing of it is lost."""

from pathlib import Path

from octoform.daemon.model import Done
from octoform.endpoint.archiving import set_aside
from octoform.state.files import mount_point
from octoform.state.layout import Layout


def rotate(layout: Layout, name: str) -> Done:
    """Set the log ``name`` of a host aside; what the system refuses is told."""
    path = layout.logs / Path(name).name
    if path.is_symlink():
        return Done(False, f"{path.name} is a link, which is left alone", again=False)
    try:
        size = set_aside(path, held_open=path == layout.server_log)
    except FileNotFoundError:
        return Done(True, f"there is no {path.name}")
    except OSError as problem:
        where = mount_point(path.parent)
        return Done(False, f"{path.name} cannot be set aside: {problem.strerror or problem} (on {where})")
    return Done(True, f"{path.name} ({size // 1000} kB) was set aside as {path.name}.1")
