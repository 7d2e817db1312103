"""Which camera is looked through: the one that a person named, else one on a hub of its own, else a USB one."""

from collections.abc import Mapping, Sequence
from typing import Any

from octoform.builtin.task import Refused


def best(cameras: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
    """The camera to take; the first of equals by its id. Refused when there is none.

    A camera that shares a hub with what moves may vanish just when it is needed; a built-in one looks elsewhere.
    """
    if not cameras:
        raise Refused("no tool of this host takes a picture, so nothing can be seen to move")
    ranked = sorted(
        cameras,
        key=lambda item: (not item["hint"], bool(item["hub_shared_with"]), item["built_in"], item["device"]),
    )
    return ranked[0]
