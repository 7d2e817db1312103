"""What an agent of the daemon is given of perception: two pictures at most, and the summary of all looks.

Each picture comes under the reading that vouches for it: the current one, and the one before it. A picture without a
fresh reading says nothing of now, so it is not given, and the agent is told why there is none.
Perception that fails is no reason not to look at everything else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from octoform.manifest.model import Perception
from octoform.perception.frame_store import picture_of, read
from octoform.perception.frames import Frame, Record, words
from octoform.state.layout import Layout

FRAME, TROUBLE = "frame", "/trouble"
MOST_BYTES = 8 << 20
"""Of one picture."""


@dataclass(frozen=True, slots=True)
class Beheld:
    """``frames`` as the input lists them, ``files`` by name, ``reason`` why there is no picture (None: there is).

    ``summary`` are a few lines about all looks until now, at most 3 KB; None where nobody looked.
    """

    frames: tuple[dict[str, str], ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    reason: str | None = None
    summary: str | None = None

    @property
    def perception(self) -> dict[str, Any]:
        """What the input says of perception."""
        return {"available": bool(self.frames), "reason": self.reason, "summary": self.summary}


def beheld(layout: Layout, settings: Perception, readings: Sequence[Mapping[str, Any]]) -> Beheld:
    """The pictures of the last looks, where ``readings`` (rows of an input, oldest first) tell of them."""
    if not settings.enabled:
        return Beheld(reason="perception is off: nobody looks through a camera")
    record, _ = read(layout)
    reason = _absent(record)
    summary = words(record) if record is not None else None
    if record is None or record.current is None or reason is not None:
        return Beheld(reason=reason, summary=summary)
    seen = [row for row in readings if row["channel"] == FRAME and row["path"] == TROUBLE]
    frames, files = [], {}
    for frame, row in zip((record.current, record.previous), reversed(seen), strict=False):
        if frame is None or row["source"] != frame.camera.device:
            break
        data = picture_of(layout, frame)
        if data is None or len(data) > MOST_BYTES:
            break
        frames.append({"reading": row["id"], "file": frame.file})
        files[frame.file] = data
    if not frames:
        return Beheld(reason="no reading of now tells of the picture that is kept", summary=summary)
    return Beheld(tuple(frames), files, summary=summary)


def _absent(record: Record | None) -> str | None:
    if record is None:
        return "nobody has looked through the camera yet"
    if record.absent is not None:
        return f"no picture since {record.absent.since}: {record.absent.reason}"
    current: Frame | None = record.current
    if current is None:
        return "there is no picture"
    return f"the picture shows nothing: it is {current.trouble}" if current.trouble else None
